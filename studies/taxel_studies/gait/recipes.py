"""The study's parameters: its own recipe, what may be chosen inside, Table 6.2 as printed, rules' encoders.

All of them are data, in ``recipes.toml`` beside this file. A point is a recipe for one neuron, in the notation of
`taxel.detect.Recipe`: an encoder, and a learner's parameters with the delay.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

#: An encoder, and the parameters of a learner.
Point = dict[str, Any]

_FILE = tomllib.loads(Path(__file__).with_name("recipes.toml").read_text(encoding="utf-8"))
_EVENTS: dict[str, dict[str, Any]] = {name: source.get("events", {}) for name, source in _FILE["sources"].items()}
#: The encoder of Table 6.2 by source and event: that of the recipe, on the plate one level (6.5.1), or its own.
_PRINTED = {
    source: _FILE["sources"][source].get("printed")
    or {name: "one" if source == "plate" else event["encoder"] for name, event in events.items()}
    for source, events in _EVENTS.items()
}


def _point(encoder: str, *learner: dict[str, Any]) -> Point:
    """Return a point; of a parameter that several tables have the last one counts."""
    merged = dict(_FILE["learner"])
    for table in learner:
        merged |= table
    return {"encoder": _FILE["encoders"][merged.pop("encoder", encoder)], "learner": merged}


def _tried(source: str, event: dict[str, Any]) -> list[Point]:
    """Return an event's recipe, and the same with each of the changes that may be chosen."""
    shared = _FILE["sources"][source]["learner"]
    return [_point(event["encoder"], shared, event["learner"], change) for change in ({}, *event["search"])]


#: What may be chosen inside the training folds, 24 points an event at most.
SEARCH: dict[str, dict[str, list[Point]]] = {
    source: {name: _tried(source, event) for name, event in events.items()} for source, events in _EVENTS.items()
}
#: The recipes of the trials.
RECIPE = {source: {name: points[0] for name, points in events.items()} for source, events in SEARCH.items()}


def _of_table(**changes: Any) -> dict[str, dict[str, Point]]:
    shared = _FILE["printed"]["learner"]
    return {
        source: {name: _point(encoder, shared, _FILE["printed"][name], changes) for name, encoder in events.items()}
        for source, events in _PRINTED.items()
    }


#: Table 6.2 as printed, and with B squared.
PRINTED = _of_table()
SQUARED = _of_table(**_FILE["squared"])
#: The encoders that give the plain rules their input.
RULE_ENCODERS = {
    source: {name: _FILE["encoders"][event["rule"]] for name, event in events.items()}
    for source, events in _EVENTS.items()
}
