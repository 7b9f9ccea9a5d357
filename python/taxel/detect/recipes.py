"""The gait recipes of the trials, for readouts: what `taxel train` starts from where nothing else is asked for."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from taxel._arguments import several, text

__all__ = ["GAIT", "fitting", "gait"]

#: The recordings that each was found on, by name.
GAIT = {
    "plate": "an insole of many taxels, in counts: threshold and Izhikevich pairs at four levels, reset after a spike",
    "gaitpdb": "few force sensors under a foot, in N: crossings of six levels, a threshold that rises tenfold",
    "gaitndd": "any other scale: crossings of levels in shares of the running range",
}

#: Of the frames that a recipe's levels are meant for.
_UNITS = {"counts": "plate", "N": "gaitpdb"}

#: The recipe's event whose encoder all its neurons share: the one with the most levels.
_ENCODER = {"plate": "foot_off", "gaitpdb": "contact", "gaitndd": "contact"}


def fitting(unit: str) -> str:
    """Return the name of the recipe whose levels fit frames of this unit (events have none: "").

    Examples
    --------
    >>> fitting("N"), fitting("")
    ('gaitpdb', 'gaitndd')
    """
    return _UNITS.get(unit, "gaitndd")


def gait(name: str, labels: Iterable[str]) -> dict[str, Any]:
    """Return a gait recipe as plain values, as `Recipe.from_dict` takes them.

    Parameters
    ----------
    name : {"plate", "gaitpdb", "gaitndd"}
        Of `GAIT`.
    labels : sequence of str
        What is to be learnt. "contact", "heel_off" and "foot_off" have parameters of their own; any other label has
        those of contact.

    Raises
    ------
    ProblemError : another name

    Examples
    --------
    >>> recipe = gait("gaitpdb", ["contact", "foot off"])
    >>> recipe["encoder"]["levels"], recipe["neurons"]["foot off"]["delta_t_ms"]
    ([5.0, 10.0, 20.0, 30.0, 40.0, 50.0], 10.0)
    """
    from taxel.studies.gait.recipes import NOTES  # noqa: PLC0415  the study loads slowly
    from taxel.studies.gait.sources import encoder_of  # noqa: PLC0415

    points = NOTES[text("name", name, GAIT)]
    neurons = {}
    for label in several("labels", labels):
        event = text("label", label).lower().replace(" ", "_").replace("-", "_")
        point = points.get(event, points["contact"])
        neurons[label] = point["neuron"] | point["learn"] | {"step_ms": 1.0, "delay_ms": point["delay_ms"]}
    encoder = json.loads(encoder_of(points[_ENCODER[name]]["encoder"]).to_json())
    return {"encoder": encoder, "learner": {}, "neurons": neurons}
