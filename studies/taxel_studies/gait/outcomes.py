"""What is run, and its results: every foot, summed up by row, event and person."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from taxel import ProblemError
from taxel_studies.gait import insole, search, sources
from taxel_studies.gait.protocols import PROTOCOLS, ROWS, Protocol, scopes
from taxel_studies.gait.recipes import PRINTED, RECIPE, RULE_ENCODERS, SEARCH, SQUARED
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import SOURCES, fingerprint
from taxel_studies.study import Parameters, Row, Summary, Task

EVENTS = {"contact": "contact", "heel_off": "heel-off", "foot_off": "foot-off"}
PARAMETERS: dict[str, Any] = {
    "sources": list(SOURCES),  # those that are absent are skipped, and listed
    "protocols": [],  # all
    "events": 0,  # all; else so many of the first
    "points": 0,  # to choose from: all; else so many of the first
    "rows": [],  # all
    "grid": search.GRID,
}
SIZES = {
    "toy": {"protocols": ["people left out"], "events": 1, "points": 2},
    "search": {"sources": [search.SOURCE], "rows": ["searched"]},
}


def folds(folder: Path, source: str, protocol: Protocol) -> Iterator[dict[str, Any]]:
    """Give what names each fold of a protocol, and how much trains in it."""
    common = {"source": source, "data": fingerprint(folder, source), "protocol": protocol.name}
    for scope in scopes(folder, source, protocol.name):
        for left_out in range(len(scope.groups)):
            yield common | {"scope": scope.name, "left_out": left_out, "train": dict(protocol.train)}


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List the fits of every row in every fold, ordered so that one encoding serves many of them in turn.

    Raises
    ------
    ProblemError : a source or protocol that is none
    """
    known = dict.fromkeys(protocol.name for listed in PROTOCOLS.values() for protocol in listed)
    if unknown := [name for name in p["protocols"] if name not in known]:
        raise ProblemError(f"protocols is {unknown[0]!r}: must be one of {', '.join(map(repr, known))}")
    listed = []
    for name, folder in sources.present(data, p["sources"]).items():
        for protocol in PROTOCOLS[name]:
            if protocol.name in (p["protocols"] or known):
                groups = min((len(scope.groups) for scope in scopes(folder, name, protocol.name)), default=0)
                for event in SOURCES[name].events[: p["events"] or None]:
                    for row in (row for row in protocol.rows if row in (p["rows"] or ROWS)):
                        # A choice inside a fold leaves out a group more; some labels are no threshold of a sum.
                        if (row != "chosen" or groups > 2) and (
                            row != "labels' own rule" or event in SOURCES[name].by_threshold
                        ):
                            for asked in _asked(name, event, row, protocol, p):
                                listed += [Task(fold | asked, seed=1) for fold in folds(folder, name, protocol)]
    return sorted(listed, key=_by_encoder)


def _asked(source: str, event: str, row: str, protocol: Protocol, p: Parameters) -> Iterator[dict[str, Any]]:
    """Give what a row asks for in every fold of a protocol: a rule, or a neuron's points."""
    asked = {"row": row, "event": event}
    if row == "searched":
        if event in search.EVENTS:
            yield from (asked | {"kind": "search", "points": points} for points in search.points(p["grid"], event))
    elif row in RULES:
        yield asked | {"kind": "rule", "rule": row, "encoder": RULE_ENCODERS[source][event]}
    elif row == "chosen":
        tried = SEARCH[source][event][: p["points"] or None]
        yield asked | {"kind": "neuron", "points": tried, "search": dict(protocol.search)}
    else:
        point = {"recipe": RECIPE, "printed": PRINTED, "squared": SQUARED}[row][source][event]
        yield asked | {"kind": "neuron", "points": [point]}


def _by_encoder(task: Task) -> str:
    encoder = task.params["encoder"] if task.params["kind"] == "rule" else task.params["points"][0]["encoder"]
    return json.dumps([task.params["source"], encoder, task.params["event"]])


def figures(units: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Sum up feet: what `fits.realise` gives as tested.

    Returns
    -------
    dict
        Events, found, missed, false, and false within 50 ms of an event (6.5.2); percent found; false a minute (of
        walking and foot); percent of found within 10 ms and within 3.4 ms (one sample at 300 Hz); errors of `t` and
        delays to `known`: mean, sd, median, 2.5th and 97.5th percentile, ms. None where nothing is known.
    """
    counted = ("events", "false", "false_near", "minutes")
    events, false, near, minutes = (sum(u[name] for u in units) for name in counted)
    errors, delays = (np.array([e for u in units for e in u[name]]) for name in ("errors", "delays"))
    return {
        "events": events,
        "found": len(errors),
        "missed": events - len(errors),
        "false": false,
        "false_near": near,
        "minutes": round(minutes, 2),
        "found_percent": round(100 * len(errors) / events, 2) if events else None,
        "false_per_minute": round(false / minutes, 3) if minutes else None,
        "within_10_ms_percent": _percent_within(errors, 10.0),
        "within_3.4_ms_percent": _percent_within(errors, 3.4),
        "error_ms": _spread(errors),
        "known_ms": _spread(delays),
    }


def _percent_within(errors: np.ndarray[Any, Any], distance_ms: float) -> float | None:
    return round(100 * float(np.mean(np.abs(errors) <= distance_ms)), 2) if len(errors) else None


def _spread(values: np.ndarray[Any, Any]) -> dict[str, float] | None:
    if not len(values):
        return None
    low, high = np.percentile(values, [2.5, 97.5])
    spread = {
        "mean": values.mean(),
        "sd": values.std(ddof=1) if len(values) > 1 else 0.0,
        "median": np.median(values),
        "low": low,
        "high": high,
    }
    return {name: round(float(value), 2) for name, value in spread.items()}


def summarise(p: Parameters, rows: Sequence[Row], *, data: Path) -> Summary:
    """Put all outcomes into plain values."""
    ran: dict[str, dict[str, list[Row]]] = {}
    searched = [row for row in rows if row.params["row"] == "searched"]
    for row in (row for row in rows if row.params["row"] != "searched"):
        ran.setdefault(row.params["source"], {}).setdefault(row.params["protocol"], []).append(row)
    here = sources.present(data, p["sources"])
    skipped = [SOURCES[name].folder for name in SOURCES if name in p["sources"] and name not in here]
    asked = {name for name in here if {one.name for one in PROTOCOLS[name]} & {*p["protocols"]} or not p["protocols"]}
    skipped += [
        f"{SOURCES[name].folder} (too few people or recordings)"
        for name in here
        if name in asked - ran.keys() and not searched
    ]
    listed: list[dict[str, Any]] = []
    for name in (name for name in SOURCES if name in ran):
        source = SOURCES[name]
        about = {key: getattr(source, key) for key in ("title", "truth", "shows", "by_minute")}
        listed.append({"source": name, **about, "protocols": []})
        for protocol in (one for one in PROTOCOLS[name] if one.name in ran[name]):
            listed[-1]["protocols"].append(_protocol(protocol, ran[name][protocol.name]))
            if "chosen" not in {row.params["row"] for row in ran[name][protocol.name]}:
                skipped.append(f"{name}, {protocol.name}: chosen inside (too few people)")
    return {
        "skipped": skipped,
        "search_points": {
            s: {e: len(points) for e, points in events.items()} for s, events in SEARCH.items() if events
        },
        "sources": listed,
        "searched": search.summarise(searched),
        "conversion": _conversion(here["plate"]) if "plate" in ran else None,
    }


def _protocol(protocol: Protocol, ran: Sequence[Row]) -> dict[str, Any]:
    return {
        "protocol": protocol.name,
        "title": protocol.title,
        "train": dict(protocol.train),
        "search": dict(protocol.search),
        "rows": [
            _row(event, row, here)
            for event in EVENTS
            for row in protocol.rows
            if (here := [r for r in ran if (r.params["event"], r.params["row"]) == (event, row)])
        ],
    }


def _row(event: str, row: str, ran: Sequence[Row]) -> dict[str, Any]:
    units = [unit for one in ran for unit in one.result["tested"].values()]
    # Each different point once, with the number of folds that chose it, the most frequent first.
    points = Counter(json.dumps(one.result["point"], sort_keys=True) for one in ran if row in ("chosen", *RULES))
    return {
        "event": event,
        "row": row,
        "about": ROWS[row],
        "figures": figures(units),
        "by_person": {
            person: figures([unit for unit in units if unit["person"] == person])
            for person in sorted({unit["person"] for unit in units})
        },
        "by_scope": {
            scope: figures([unit for one in here for unit in one.result["tested"].values()])
            for scope in dict.fromkeys(one.params["scope"] for one in ran)
            if (here := [one for one in ran if one.params["scope"] == scope])
        },
        "chosen": [{"folds": folds, "point": json.loads(point)} for point, folds in points.most_common()],
        "cpu_seconds": round(sum(one.seconds for one in ran), 1),
    }


def _conversion(folder: Path) -> dict[str, Any]:
    """Return pressure and spikes of one footfall of the plate: what figures 6.12 and 6.13 draw."""
    encoder = RECIPE["plate"]["contact"]["encoder"]
    cut = sources.cuts(folder, "plate")[0]
    piece = next(one for one in sources.encoded(folder, "plate", encoder).pieces if one.name == cut.name)
    begins = float(piece.truth["contact"][0])
    values = cut.frames.values[:, 0]
    peak = values.max(axis=0)
    first = np.concatenate([[0], np.cumsum(insole.CELLS)])
    loudest = {
        name: int(first[row] + np.argmax(peak[first[row] : first[row + 1]]))
        for name, row in (("heel", 1), ("ball", 8), ("toes", 13))
    }
    return {
        "footfall": cut.name,
        "peak": [float(v) for v in peak],
        "frame_ms": 2.0,
        "felt": {name: [float(v) for v in values[:, n]] for name, n in loudest.items()},
        "threshold": encoder["levels"][0],
        "spikes_ms": [[round(float(t), 3) for t in train - begins] for train in piece.spikes],
        "truth_ms": {event: [float(t) for t in times - begins] for event, times in piece.truth.items()},
    }
