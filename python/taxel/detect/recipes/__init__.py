"""Recipes by name, one data file each: where none is named, `taxel train` chooses the one that fits the recording.

A recipe's file says `about` what it is, its `source`, which recordings it `fits` ("events", or units of frames), the
encoder, or several as `encoders` by name, whether labels are moved to what the sensor felt (`align`), what all neurons
share (`learner`), what is a neuron's own (`neurons`), and the parameters of any `other` label, or whose they are;
without `other` it is for its neurons' labels alone. A new recipe is a new file in this folder.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from taxel._base.arguments import path as checked_path
from taxel._base.arguments import shown, text
from taxel._core import FormatError, ProblemError
from taxel.events import Events
from taxel.frames import Frames

__all__ = ["fitting", "for_labels", "names", "read"]

#: The recipe of recordings that no other fits: its levels are shares of the running range, of any unit.
_ANY = "gait_channel"


@cache
def names() -> tuple[str, ...]:
    """Return the names of all recipes.

    Examples
    --------
    >>> "gait_insole" in names()
    True
    """
    return tuple(sorted(file.stem for file in Path(__file__).parent.glob("*.toml")))


def fitting(source: Events | Frames) -> str:
    """Return the name of the recipe that fits a recording, by what it holds (events, or the frames' unit).

    Examples
    --------
    >>> fitting(Frames([[[0.0]]], [0], unit="N")), fitting(Frames([[[0.0]]], [0], unit="V"))
    ('gait_insole', 'gait_channel')
    """
    kind = source.unit if isinstance(source, Frames) else "events"
    return next((name for name in names() if kind in read(name).get("fits", ())), _ANY)


def read(recipe: str | os.PathLike[str]) -> dict[str, Any]:
    """Read a recipe's plain values: one of `names`, or a TOML or JSON file, whose path holds a dot or a slash.

    Raises
    ------
    ProblemError : no recipe of this name
    FormatError : neither TOML nor JSON
    FileNotFoundError : no such file

    Examples
    --------
    >>> read("gait_insole")["encoder"]["levels"]
    [5.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    """
    place = Path(checked_path("recipe", recipe))
    if isinstance(recipe, str) and not {".", "/", os.sep} & set(recipe):
        if recipe not in names():
            raise ProblemError(
                f"recipe {shown(recipe)}: there are {', '.join(names())}; the path of a file holds a dot or a slash"
            )
        place = Path(__file__).parent / f"{recipe}.toml"
    try:
        content = place.read_text(encoding="utf-8-sig")
        values = json.loads(content) if place.suffix.lower() == ".json" else tomllib.loads(content)
    except (UnicodeDecodeError, json.JSONDecodeError, tomllib.TOMLDecodeError) as error:
        kind = "JSON" if place.suffix.lower() == ".json" else "TOML"
        raise FormatError(f"{place}: not {kind}: {error}") from None
    if not isinstance(values, dict):
        raise FormatError(f"{place}: holds no recipe, which is values by name")
    return values


def for_labels(values: dict[str, Any], labels: Sequence[str]) -> dict[str, Any]:
    """Return a recipe's values with one neuron a label, if it is one that is chosen by the recording (`fits`).

    "foot off", "Foot-off" and "foot_off" are one. Any other label than the recipe's own has the parameters that `other`
    holds, or those of the neuron that it names. A recipe with neither `fits` nor `other` stays as it is.

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
    own = values.get("neurons", {})
    other = values.get("other")
    if other is not None and not isinstance(other, Mapping):
        other = own[text("recipe: other", other, own)]
    neurons = {}
    for label in labels:
        neuron = own.get(label, own.get(_plain(text("label", label)), other))
        if neuron is None:
            raise ProblemError(
                f"recipe: it is for {' and '.join(own)}, not for {shown(label)}: leave that label out, or choose "
                f"another recipe: there are {', '.join(names())}"
            )
        neurons[label] = dict(neuron)
    return {**values, "neurons": neurons}


def _plain(label: str) -> str:
    return label.lower().replace(" ", "_").replace("-", "_")
