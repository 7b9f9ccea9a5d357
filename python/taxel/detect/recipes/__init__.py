"""Recipes by name, one data file each: where none is named, `taxel train` chooses the one that fits the recording.

A recipe's file says `about` what it is, its `source`, which recordings it `fits` ("events", units of frames, or "many
UNIT": units of frames of a grid or of more than 32 channels, or "grids": frames of taxels with known neighbours, before
what fits the unit, except labels of steps, as "foot_off", or "UNIT/": units of grids that begin so, before all else),
the encoder, or several as `encoders` by name, whether
labels are moved to what the sensor felt (`align`), what all neurons share (`learner`), what is a neuron's own
(`neurons`), which labels are `also` called otherwise, of which one chooses it as they lie `within` touches, and the
parameters of any `other` label, or whose they are;
without `other` it is for its neurons' labels alone. A new recipe is a new file in this folder.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from taxel._base.arguments import checked_path, shown, text
from taxel._base.documents import read_json, read_toml
from taxel._base.messages import counted
from taxel._core import FormatError, ProblemError
from taxel.events import Events
from taxel.frames import Frames

__all__ = ["chosen", "for_labels", "kinds", "names", "names_of", "neuron_of", "read", "spelling"]

#: The recipe of recordings that no other fits: its levels are shares of the running range, of any unit.
_ANY = "gait_channel"
#: More channels than these are many.
_MOST_CHANNELS = 32
#: Of more taxels the levels of each, 12 trains a taxel, are more inputs than a neuron may have.
_MOST_BY_TAXEL = 800
#: A label with one of these words is of a step, which begins and ends otherwise than a touch.
_OF_STEPS = {"foot", "footfall", "heel", "toe", "step", "stride"}
#: What gait laboratories call the ends of a step; a recipe without a neuron `foot_off` has it as `lift`, and the other
#: way round.
_ENDS = {
    **dict.fromkeys(
        ("heel_strike", "foot_strike", "strike", "foot_contact", "initial_contact", "touch_down"), "contact"
    ),
    **dict.fromkeys(("erstkontakt", "fersenkontakt", "fersenauftritt", "aufsetzen", "ic", "hs", "fc"), "contact"),
    **dict.fromkeys(("foot_off", "toe_off", "final_contact", "fo", "to"), "foot_off"),
    **dict.fromkeys(("zehenablösung", "zehenabloesung", "zehenabstoß", "zehenabstoss"), "foot_off"),
    **dict.fromkeys(("lift_off", "abheben"), "lift"),
}
_SAME_END = {"foot_off": "lift", "lift": "foot_off"}
#: What those names may begin with.
_SIDES = ("left", "right", "links", "rechts", "l", "r")


@cache
def names() -> tuple[str, ...]:
    """Return the names of all recipes.

    Examples
    --------
    >>> "gait_insole" in names()
    True
    """
    return tuple(sorted(file.stem for file in Path(__file__).parent.glob("*.toml")))


def chosen(source: Events | Frames, labels: Sequence[str] = (), *, rests: bool = True) -> tuple[str, str]:
    """Return the name of the recipe that fits a recording and its labels, and for what it is taken.

    Steps, as "foot_off", no labels, and of channels one label alone that is no end of a touch, or all without a rest,
    have the recipe of the unit. Where there is none, and for all other labels, it is that of touches, if each label is
    a kind of touch or alone at its end of a touch; else it is that of channels.

    Parameters
    ----------
    source : Events or Frames
    labels : sequence of str
        What is to be learnt.
    rests : bool
        Whether the rest of its taxels is known, from which touches of channels are distinguished.

    Examples
    --------
    >>> chosen(Frames([[[0.0] * 6] * 6], [0], unit="V"), ["soft", "hard"])
    ('touch', 'kinds of touch on a grid of 6 x 6 taxels')
    >>> grid = Frames([[[0.0, 0.0]] * 2], [0], unit="counts")
    >>> [chosen(grid, labels)[0] for labels in (["contact", "lift"], ["contact", "foot off"])]
    ['touch', 'gait_plate']
    >>> [chosen(Frames([[[0.0]]], [0], unit=unit))[0] for unit in ("N", "V")]
    ['gait_insole', 'gait_channel']
    >>> [chosen(Frames([[[0.0] * 40] * rows], [0], unit="N"), ["FC", "FO"])[0] for rows in (20, 21)]
    ['gait_insole', 'touch']
    >>> [chosen(Frames([[[0.0]]], [0], unit=unit), ["tap"])[0] for unit in ("V", "N")]
    ['touch', 'gait_insole']
    >>> chosen(Frames([[[0.0] * 6]], [0], unit="V"), ["lift", "slip"])
    ('grip', 'slip within touches on 6 channels')
    """
    recipes = {name: read(name) for name in names()}
    recipe_for = {kind: name for name, values in recipes.items() for kind in values.get("fits", ())}
    kind = f"{source.unit.partition('/')[0]}/" if isinstance(source, Frames) else "events"
    if not isinstance(source, Frames) or (kind in recipe_for and source.array._has_neighbours):
        subject = f"frames in {source.unit}" if isinstance(source, Frames) else "events of a board"
        return recipe_for.get(kind, _ANY), subject
    array, touch = source.array, recipe_for["grids"]
    is_grid = array.taxels > 1 and array._has_neighbours
    many = array.taxels > _MOST_CHANNELS
    ends = [neuron_of(touch, label) for label in labels]
    steps = [label for label in labels if _end(label) == "foot_off" or _OF_STEPS & set(spelling(label).split("_"))]
    are_apart = None not in ends and len(set(ends)) == len(ends)
    # The levels of `_ANY`, 22 trains a taxel, take minutes on many taxels.
    may_be_touches = bool(labels) and (is_grid or rests) and (not steps or are_apart or (is_grid and many))
    unit = f"many {source.unit}" if is_grid or many else source.unit
    unit = unit if unit in recipe_for else source.unit
    of_unit = bool(steps) or not labels or (not is_grid and len(labels) == 1 and ends != ["lift"])
    too_many = may_be_touches and unit == source.unit and array.taxels > _MOST_BY_TAXEL
    if (of_unit or not may_be_touches) and unit in recipe_for and not too_many:
        return recipe_for[unit], f"frames in {source.unit}"
    sensor = f"a grid of {array.rows} x {array.columns} taxels"
    if not is_grid:
        sensor = counted(array.taxels, "channel" if array.is_channels else "taxel")
    if may_be_touches and (inside := {spelling(label) for label in labels} & set(recipes["grip"]["within"])):
        return "grip", f"{', '.join(sorted(inside))} within touches on {sensor}"
    if not may_be_touches:
        return _ANY, f"{sensor} in {source.unit}"
    return touch, f"{'kinds of touch' if None in ends else ' and '.join(labels)} on {sensor}"


def read(recipe: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a recipe's plain values: one of `names`, or a TOML or JSON file, whose path holds a dot or a slash.

    Raises
    ------
    ProblemError : no recipe of this name
    FormatError : neither TOML nor JSON, or longer than 1 MiB
    FileNotFoundError : no such file

    Examples
    --------
    >>> read("gait_insole")["encoder"]["levels"]
    [5.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    """
    file = Path(checked_path("recipe", recipe))
    if isinstance(recipe, str) and not {".", "/", os.sep} & set(recipe):
        if recipe not in names():
            raise ProblemError(
                f"recipe {shown(recipe)}: must be one of {', '.join(names())}, or the path of a file, with a dot or a "
                "slash in it"
            )
        file = Path(__file__).parent / f"{recipe}.toml"
    values = read_json(file) if file.suffix.lower() == ".json" else read_toml(file)
    if not isinstance(values, dict):
        raise FormatError(f"{file}: must contain a recipe (values by name)")
    return values


def for_labels(values: dict[str, Any], labels: Sequence[str]) -> dict[str, Any]:
    """Return a recipe's values with one neuron a label, if it is one that is chosen by the recording (`fits`).

    "foot off", "Foot-off" and "foot_off" are one. A label in `also` has the parameters of the neuron that it names
    there, and so has what gait laboratories call the ends of a step, as "left toe off"; any other label than the
    recipe's own has those that `other` holds, or those of the neuron that it names. A recipe with neither `fits` nor
    `other` stays as it is. Where `other` is of kinds, a label that names an end of a step, or whose last word alone is
    known, as "grasp_end", is that neuron's if no other label is: "soft_press" and "hard_press" are kinds.

    Raises
    ------
    ProblemError : `other` is none of its neurons, or a label that the recipe is not for

    Examples
    --------
    >>> recipe = for_labels(read("gait_plate"), ["Heel-off", "step"])
    >>> {label: neuron["tau"] for label, neuron in recipe["neurons"].items()}
    {'Heel-off': 70.0, 'step': 10.0}
    """
    if not {"fits", "other"} & set(values):
        return values
    listed = values.get("neurons", {})
    rest = values.get("other")
    kinds = rest is None or isinstance(rest, Mapping)
    if not kinds:
        rest = listed[text("recipe: other", rest, listed)]
    known = {label: _neuron(values, text("label", label)) for label in labels}
    neurons = {}
    for label, (name, how) in known.items():
        alone = not kinds or sum(name == other for other, _ in known.values()) == 1
        neuron = listed.get(label, listed.get(name, rest) if how == "listed" or alone else rest)
        if neuron is None:
            raise ProblemError(
                f"recipe: is for {' and '.join(listed)}, not for {shown(label)}: leave this label out, or choose "
                f"another recipe; the recipes are {', '.join(names())}"
            )
        neurons[label] = dict(neuron)
    return {**values, "neurons": neurons}


def neuron_of(recipe: str, label: str) -> str | None:
    """Return the recipe's neuron that a label names, also as an end of a step; None of any other label.

    Examples
    --------
    >>> neuron_of("touch", "left toe off"), neuron_of("touch", "Grip"), neuron_of("touch", "ball")
    ('lift', 'contact', None)
    """
    name, how = _neuron(read(recipe), text("label", label))
    return None if how == "word" else name


def kinds(recipe: str, labels: Sequence[str]) -> tuple[str, ...]:
    """Return the labels that a recipe learns as kinds of touch, as it has neurons of ends of touches, but not of these.

    Examples
    --------
    >>> kinds("touch", ["grasp", "release", "slip"])
    ('slip',)
    """
    values = read(recipe)
    kind = values.get("other")
    if not isinstance(kind, Mapping) or not values.get("neurons"):
        return ()
    neurons = for_labels(values, labels)["neurons"]
    return tuple(label for label in labels if neurons[label] == dict(kind))


def names_of(recipe: str, end: str) -> str:
    """Return what the labels of a recipe's neuron may be called, as a list in words.

    Examples
    --------
    >>> names_of("touch", "lift")
    'lift, release, removal, end, stop, off'
    """
    return ", ".join((end, *(name for name, kind in read(recipe).get("also", {}).items() if kind == end)))


def _neuron(values: Mapping[str, Any], label: str) -> tuple[str | None, str]:
    """Return the name of the neuron that a recipe has for a label, and how it is known: "listed", "end" or "word"."""
    plain, end, also = spelling(label), _end(label), values.get("also", {})
    word = plain.rpartition("_")[2]
    known = {"listed": (plain, also.get(plain)), "end": (end, _SAME_END.get(end)), "word": (word, also.get(word))}
    found = ((name, how) for how, names in known.items() for name in names if name in values.get("neurons", {}))
    return next(found, (None, ""))


def _end(label: str) -> str:
    """Return which end of a step a label names, of a side or of none: "contact", "foot_off", or "lift" of any load."""
    plain = spelling(label)
    side, _, name = plain.partition("_")
    return _ENDS.get(plain) or _ENDS.get(name if side in _SIDES else "", "")


def spelling(label: str) -> str:
    """Return a label as recipes spell it: without capitals, blanks and hyphens.

    Examples
    --------
    >>> spelling("Foot off")
    'foot_off'
    """
    return label.lower().replace(" ", "_").replace("-", "_")
