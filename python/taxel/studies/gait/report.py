"""What the study comes to: one JSON and one HTML page."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from taxel import __version__
from taxel.studies.gait.protocols import ROWS, Outcome, Protocol, Unit
from taxel.studies.gait.recipes import SEARCH
from taxel.studies.gait.sources import SOURCES

__all__ = ["GOALS", "figures", "summary", "write_report"]

EVENTS = {"contact": "contact", "heel_off": "heel-off", "foot_off": "foot-off"}

#: What "parameters chosen inside" has to reach, people left out: missed and false, sd (ms); or % found, false a minute
#: and foot, % of found within 10 ms.
GOALS: dict[str, dict[str, dict[str, float]]] = {
    "plate": {
        "contact": {"missed": 0, "false": 0, "sd_ms": 6.7},
        "heel_off": {"missed": 0, "false": 0},
        "foot_off": {"missed": 0, "false": 0, "sd_ms": 17.0},
    },
    "gaitpdb": {
        "contact": {"found_percent": 98.0, "false_per_minute": 2.5, "within_10_ms_percent": 92.0},
        "foot_off": {"found_percent": 97.0, "false_per_minute": 2.5, "within_10_ms_percent": 85.0},
    },
    "gaitndd": {
        "contact": {"found_percent": 94.0, "false_per_minute": 2.0, "within_10_ms_percent": 94.0},
        "foot_off": {"found_percent": 95.0, "false_per_minute": 3.0, "within_10_ms_percent": 75.0},
    },
}


def figures(units: Sequence[Unit]) -> dict[str, Any]:
    """Sum up feet.

    Parameters
    ----------
    units : sequence of Unit

    Returns
    -------
    dict
        Events, found, missed, false; percent found; false a minute (of walking and foot); percent of found within
        10 ms and within 3.4 ms (one sample at 300 Hz); errors of `t` and delays to `known`: mean, sd, median, 2.5th
        and 97.5th percentile, ms. None where nothing is known.
    """
    events = sum(u.events for u in units)
    errors = np.array([e for u in units for e in u.errors])
    delays = np.array([d for u in units for d in u.delays])
    false = sum(u.false for u in units)
    minutes = sum(u.minutes for u in units)
    return {
        "events": events,
        "found": len(errors),
        "missed": events - len(errors),
        "false": false,
        "minutes": round(minutes, 2),
        "found_percent": round(100 * len(errors) / events, 2) if events else None,
        "false_per_minute": round(false / minutes, 3) if minutes else None,
        "within_10_ms_percent": _share(errors, 10.0),
        "within_3.4_ms_percent": _share(errors, 3.4),
        "error_ms": _spread(errors),
        "known_ms": _spread(delays),
    }


def _share(errors: np.ndarray[Any, Any], within: float) -> float | None:
    return round(100 * float(np.mean(np.abs(errors) <= within)), 2) if len(errors) else None


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


def summary(
    outcomes: Sequence[Outcome],
    *,
    plans: Sequence[tuple[str, Protocol]],
    full_search: Sequence[dict[str, Any]],
    skipped: Sequence[str],
    unread: Mapping[str, str],
    size: str,
    test: bool,
    cpu_seconds: float,
) -> dict[str, Any]:
    """Put all outcomes into plain values, as ``gait.json`` holds them; `cpu_seconds` is that of every single fit."""
    sources = []
    for name in dict.fromkeys(source for source, _ in plans):
        source = SOURCES[name]
        protocols = []
        for protocol in (p for s, p in plans if s == name):
            rows = [o for o in outcomes if (o.source, o.protocol) == (name, protocol.name)]
            protocols.append(
                {
                    "protocol": protocol.name,
                    "title": "trained on one folder, judged on the other" if test else protocol.title,
                    "train": dict(protocol.train),
                    "search": dict(protocol.search),
                    "rows": (said := [_row(o, protocol, test) for o in rows]),
                    "beside": _beside(said),
                }
            )
        sources.append(
            {
                "source": name,
                "title": source.title,
                "truth": source.truth,
                "shows": source.shows,
                "by_minute": source.by_minute,
                "protocols": protocols,
            }
        )
    return {
        "study": "gait",
        "size": size,
        "judged": "on another folder" if test else "by folds",
        "skipped": list(skipped),
        "unread": dict(unread),
        "taxel": __version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpu_seconds": round(cpu_seconds, 1),
        "search_points": {s: {e: len(points) for e, points in events.items()} for s, events in SEARCH.items()},
        "full_search": list(full_search),
        "sources": sources,
    }


def _row(outcome: Outcome, protocol: Protocol, test: bool) -> dict[str, Any]:
    all_feet = figures(outcome.units)
    groups = sorted({u.group for u in outcome.units if u.group})
    feet = [{"foot": name, **figures([u for u in outcome.units if u.name == name])} for name in _names(outcome.units)]
    worst = sorted(feet, key=lambda f: (-(f["missed"] + f["false"]), -(f["error_ms"] or {"sd": 0.0})["sd"]))
    people = sorted({u.person for u in outcome.units})
    row: dict[str, Any] = {
        "event": outcome.event,
        "row": outcome.row,
        "about": ROWS[outcome.row],
        "figures": all_feet,
        "by_group": {g: figures([u for u in outcome.units if u.group == g]) for g in groups},
        "by_person": {p: figures([u for u in outcome.units if u.person == p]) for p in people},
        "worst_feet": worst[:5],
        "feet": {
            "all": len(feet),
            "below_95_percent_found": sum((f["found_percent"] or 100.0) < 95.0 for f in feet),
            "over_3_false_per_minute": sum((f["false_per_minute"] or 0.0) > 3.0 for f in feet),
        },
        "chosen": _counted(outcome.points),
        "cpu_seconds": round(outcome.seconds, 1),
    }
    goal = GOALS.get(outcome.source, {}).get(outcome.event)
    if goal and outcome.row == "chosen" and (protocol.split == "people" or test):
        row["goal"] = goal
        row["goal_met"] = _met(all_feet, goal)
    return row


def _counted(points: Sequence[Any]) -> list[dict[str, Any]]:
    """Return each different point once, with the number of folds that chose it, the most frequent first."""
    times: dict[str, int] = {}
    for point in points:
        said = json.dumps(point, sort_keys=True)
        times[said] = times.get(said, 0) + 1
    return [{"folds": n, "point": json.loads(said)} for said, n in sorted(times.items(), key=lambda item: -item[1])]


def _beside(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Say, event by event, how the neuron stands beside the plain rules: by missed + false, then by % within 10 ms."""
    said = []
    for event in dict.fromkeys(row["event"] for row in rows):
        here = {row["row"]: row["figures"] for row in rows if row["event"] == event}
        neuron = here.get("chosen", here.get("notes"))
        rules = {name.removeprefix("rule: "): f for name, f in here.items() if name.startswith("rule: ")}
        if neuron is None or not rules:
            continue
        wrong = neuron["missed"] + neuron["false"]
        ahead = [f"{n} ({f['missed'] + f['false']})" for n, f in rules.items() if f["missed"] + f["false"] < wrong]
        behind = [f"{n} ({f['missed'] + f['false']})" for n, f in rules.items() if f["missed"] + f["false"] >= wrong]
        said.append(
            f"{EVENTS[event]}: the neuron has {wrong} missed and false; "
            + (f"better than it: {', '.join(ahead)}" if ahead else "no plain rule is better")
            + (f"; not better: {', '.join(behind)}." if behind else ".")
        )
    return said


def _names(units: Sequence[Unit]) -> list[str]:
    return list(dict.fromkeys(u.name for u in units))


def _met(found: dict[str, Any], goal: dict[str, float]) -> bool:
    at_least = {"found_percent", "within_10_ms_percent"}
    for name, value in goal.items():
        is_ = found["error_ms"] and found["error_ms"]["sd"] if name == "sd_ms" else found[name]
        if is_ is None or (is_ < value if name in at_least else is_ > value):
            return False
    return True


def write_report(folder: Path, said: dict[str, Any]) -> None:
    """Write ``gait.json`` and ``gait.html``, each whole or not at all."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("taxel.studies.gait", "."), autoescape=True, undefined=jinja2.StrictUndefined
    )
    page = environment.get_template("gait.html.j2").render(study=said, events=EVENTS)
    for name, text in (("gait.json", json.dumps(said, indent=1) + "\n"), ("gait.html", page)):
        part = folder / f"{name}.part"
        part.write_text(text, encoding="utf-8")
        part.replace(folder / name)
