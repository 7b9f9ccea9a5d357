"""Recipes by name, one data file each: where none is named, `taxel train` chooses the one that fits the recording.

A recipe's file says `about` what it is, its `source`, which recordings it `fits` ("events", units of frames, or "many
UNIT": units of frames of a grid or of more than 32 channels, or "grids": frames of taxels with known neighbours, before
what fits the unit, except labels of steps, as "foot_off", or "UNIT/": units of grids that begin so, before all else),
the encoder, or several as `encoders` by name, whether
labels are moved to what the sensor felt (`align`), what all neurons share (`learner`), what is a neuron's own
(`neurons`), which labels are `also` called otherwise, and the parameters of any `other` label, or whose they are;
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

__all__ = [
    "chosen",
    "fitting",
    "for_labels",
    "kinds",
    "knows",
    "names",
    "names_of",
    "neuron_of",
    "read",
    "spelling",
]

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


def fitting(source: Events | Frames, labels: Sequence[str] = (), *, rests: bool = True) -> str:
    """Return the name of the recipe that fits a recording, by what it holds, and its labels.

    Parameters
    ----------
    source : Events or Frames
    labels : sequence of str
        What is to be learnt. Contact, lift and kinds of touch have one recipe whatever the unit; steps, as "foot_off",
        no labels, and of channels a contact or one kind alone have that of the unit. Where there is none, contact and
        foot off of a grid have that of touches, if each is of one label, and so have those of channels, and one kind of
        them; all else that of channels.
    rests : bool
        Whether the rest of its taxels is known, from which touches of channels are distinguished.

    Examples
    --------
    >>> grid = Frames([[[0.0, 0.0]] * 2], [0], unit="counts")
    >>> fitting(grid, ["contact", "lift"]), fitting(grid, ["contact", "foot off"])
    ('touch', 'gait_plate')
    >>> fitting(Frames([[[0.0] * 6] * 6], [0], unit="kPa"), ["Initial Contact", "Toe Off"])
    'touch'
    >>> fitting(Frames([[[0.0]]], [0], unit="N")), fitting(Frames([[[0.0]]], [0], unit="V"))
    ('gait_insole', 'gait_channel')
    >>> [fitting(Frames([[[0.0] * 40] * rows], [0], unit="N"), ["FC", "FO"]) for rows in (20, 21)]
    ['gait_insole', 'touch']
    >>> [fitting(Frames([[[0.0] * 6] * rows], [0], unit="V"), ["soft", "hard"]) for rows in (1, 6)]
    ['touch', 'touch']
    >>> [fitting(Frames([[[0.0]]], [0], unit=unit), ["tap"]) for unit in ("V", "N")]
    ['touch', 'gait_insole']
    """
    return chosen(source, labels, rests=rests)[0]


def chosen(source: Events | Frames, labels: Sequence[str] = (), *, rests: bool = True) -> tuple[str, str]:
    """Return the name of the recipe that fits a recording and its labels, as `fitting`, and for what it is taken.

    Examples
    --------
    >>> chosen(Frames([[[0.0] * 6] * 6], [0], unit="V"), ["soft", "hard"])
    ('touch', 'kinds of touch on a grid of 6 x 6 taxels')
    """
    recipes = {name: read(name) for name in names()}
    recipe_for = {kind: name for name, values in recipes.items() for kind in values.get("fits", ())}
    kind = f"{source.unit.partition('/')[0]}/" if isinstance(source, Frames) else "events"
    if not isinstance(source, Frames) or (kind in recipe_for and source.array._has_neighbours):
        subject = f"frames in {source.unit}" if isinstance(source, Frames) else "events of a board"
        return recipe_for.get(kind, _ANY), subject
    array, grids = source.array, recipe_for.get("grids")
    known, steps = False, None
    if array.taxels < 2 or not array._has_neighbours:
        sensor = counted(array.taxels, "channel" if array.is_channels else "taxel")
        # A contact without its lift may be that of a step, and so may one unknown label, in a unit of steps.
        kinds = {_listed(recipes[grids], label) for label in labels} if grids is not None else set()
        ends = [] if grids is None else [_own(recipes[grids], label) for label in labels]
        if "lift" in kinds and None not in kinds:
            return str(grids), f"{' and '.join(labels)} on {sensor}"
        others = [label for label, end in zip(labels, ends, strict=False) if end is None]
        of_steps = (_is_of_step(label) or _is_known(recipes, label) for label in others)
        if rests and others and (len(labels) > 1 or source.unit not in recipe_for) and not any(of_steps):
            return str(grids), f"kinds of touch on {sensor}"
        if rests and ends and None not in ends and len(set(ends)) == len(ends):
            steps = str(grids), f"{' and '.join(labels)} on {sensor}"
        grids = None
    elif grids is None or not labels:
        grids, sensor = None, counted(array.taxels, "taxel")
    else:
        sensor = f"a grid of {array.rows} x {array.columns} taxels"
        others = [label for label in labels if _listed(recipes[grids], label) is None]
        known = any(_is_known(recipes, label) for label in others)
        ends = [_own(recipes[grids], label) for label in labels]
        subject = f"{'kinds of touch' if None in ends else ' and '.join(labels)} on {sensor}"
        if not known and not any(map(_is_of_step, others)):
            return grids, subject
        if None not in ends and len(set(ends)) == len(ends):
            steps = grids, subject
    many = array.taxels > _MOST_CHANNELS
    for unit in (f"many {source.unit}",) * (many or not array.is_channels) + (source.unit,):
        by_taxel = unit == source.unit
        if unit in recipe_for and not (steps and by_taxel and array.taxels > _MOST_BY_TAXEL):
            return recipe_for[unit], f"frames in {source.unit}"
    if steps is None and grids is not None and many and not known:
        # The levels of `_ANY`, 22 trains a taxel, take minutes.
        steps = grids, sensor
    return steps or (_ANY, f"{sensor} in {source.unit}")


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
    {'Heel-off': 70.0, 'step': 40.0}
    """
    if not {"fits", "other"} & set(values):
        return values
    listed = values.get("neurons", {})
    rest = values.get("other")
    kinds = rest is None or isinstance(rest, Mapping)
    if not kinds:
        rest = listed[text("recipe: other", rest, listed)]
    named = {label: _listed(values, text("label", label)) for label in labels}
    last = {label: _own(values, label) or _listed(values, spelling(label).rpartition("_")[2]) for label in labels}
    neurons = {}
    for label in labels:
        alone = not kinds or sum(last[label] in (named[kind], last[kind]) for kind in labels) == 1
        neuron = listed.get(label, listed.get(named[label] or (last[label] if alone else None), rest))
        if neuron is None:
            raise ProblemError(
                f"recipe: is for {' and '.join(listed)}, not for {shown(label)}: leave this label out, or choose "
                f"another recipe; the recipes are {', '.join(names())}"
            )
        neurons[label] = dict(neuron)
    return {**values, "neurons": neurons}


def knows(recipe: str, label: str) -> bool:
    """Return whether a recipe itself names a label, as a neuron or in `also`; names of steps are not names of touches.

    Examples
    --------
    >>> knows("touch", "Lift"), knows("touch", "foot_off")
    (True, False)
    """
    return _listed(read(recipe), text("label", label)) is not None


def neuron_of(recipe: str, label: str) -> str | None:
    """Return the recipe's neuron that a label names, also as an end of a step; None of any other label.

    Examples
    --------
    >>> neuron_of("touch", "left toe off"), neuron_of("touch", "Grip"), neuron_of("touch", "ball")
    ('lift', 'contact', None)
    """
    return _own(read(recipe), text("label", label))


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


def _listed(values: Mapping[str, Any], label: str) -> str | None:
    """Return the name of the neuron that a recipe itself lists for a label, or None."""
    plain = spelling(label)
    name = values.get("also", {}).get(plain, plain)
    return name if name in values.get("neurons", {}) else None


def _is_known(recipes: Mapping[str, Mapping[str, Any]], label: str) -> bool:
    """Whether any of some recipes lists a label."""
    return any(_listed(values, label) for values in recipes.values())


def _own(values: Mapping[str, Any], label: str) -> str | None:
    """Return the name of the recipe's neuron for a label: that it lists, or that of an end of a step; or None."""
    end = _end(label)
    names = (_listed(values, label), end, _SAME_END.get(end or ""))
    return next((name for name in names if name in values.get("neurons", {})), None)


def _end(label: str) -> str | None:
    """Return which end of a step a label names, of a side or of none: "contact", "foot_off", or "lift" of any load."""
    plain = spelling(label)
    side, _, name = plain.partition("_")
    return _ENDS.get(plain) or (_ENDS.get(name) if side in _SIDES else None)


def _is_of_step(label: str) -> bool:
    return _end(label) == "foot_off" or bool(_OF_STEPS & set(spelling(label).split("_")))


def spelling(label: str) -> str:
    """Return a label as recipes spell it: without capitals, blanks and hyphens.

    Examples
    --------
    >>> spelling("Foot off")
    'foot_off'
    """
    return label.lower().replace(" ", "_").replace("-", "_")
