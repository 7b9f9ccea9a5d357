"""The results of the study: every foot, summed up by row, event, person and group."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from taxel_studies.gait import insole, sources
from taxel_studies.gait.plans import Plan, key, plans
from taxel_studies.gait.protocols import ROWS
from taxel_studies.gait.recipes import RECIPE, SEARCH
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import SOURCES
from taxel_studies.study import Parameters, Row, Summary, Task

__all__ = ["EVENTS", "Outcome", "Unit", "figures", "summarise"]

EVENTS = {"contact": "contact", "heel_off": "heel-off", "foot_off": "foot-off"}


class Known:
    """The results of realisations, by their tasks."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows = {key(row): row for row in rows}

    def __getitem__(self, task: Task) -> Any:
        """Return a task's result."""
        return self._rows[key(task)].result

    def seconds(self, tasks: Sequence[Task]) -> float:
        """Return the CPU seconds that tasks took."""
        return sum(self._rows[key(task)].seconds for task in tasks)


@dataclass(frozen=True)
class Unit:
    """The result at one foot in one fold."""

    name: str
    person: str
    group: str
    events: int
    false: int
    minutes: float
    errors: tuple[float, ...]
    delays: tuple[float, ...]


@dataclass
class Outcome:
    """One row of the study: an event, a row's name, and every foot.

    Attributes
    ----------
    points : list
        The parameters of each fold, where they were chosen inside.
    seconds : float
        CPU time of the folds' fits, the choice inside them included.
    """

    event: str
    row: str
    units: list[Unit] = field(default_factory=list)
    points: list[Any] = field(default_factory=list)
    seconds: float = 0.0


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
    """Put all outcomes into plain values, with the folds, so that other learners can be judged on the same."""
    known, listed = Known(rows), plans(p, data)
    there = {plan.source for plan in listed}
    present = sources.readable(data, p["sources"])
    skipped = [SOURCES[name].folder for name in SOURCES if name in p["sources"] and name not in present]
    skipped += [f"{SOURCES[n].folder} (too few people or recordings)" for n in present if n not in there]
    skipped += [
        f"{plan.source}, {plan.protocol.name}: chosen inside (too few people)" for plan in listed if not plan.can_choose
    ]
    return {
        "skipped": skipped,
        "search_points": {s: {e: len(points) for e, points in events.items()} for s, events in SEARCH.items()},
        "sources": [
            {
                "source": name,
                "title": SOURCES[name].title,
                "truth": SOURCES[name].truth,
                "shows": SOURCES[name].shows,
                "by_minute": SOURCES[name].by_minute,
                "protocols": [_protocol(plan, known) for plan in listed if plan.source == name],
            }
            for name in SOURCES
            if name in there
        ],
        "folds": {f"{plan.source}/{plan.protocol.name}": plan.folds for plan in listed},
        "conversion": _conversion(data) if "plate" in there else None,
    }


def _protocol(plan: Plan, known: Known) -> dict[str, Any]:
    rows = [_row(outcome) for outcome in _outcomes(plan, known)]
    return {
        "protocol": plan.protocol.name,
        "title": plan.protocol.title,
        "train": dict(plan.protocol.train),
        "search": dict(plan.protocol.search),
        "rows": rows,
        "beside": _beside(rows),
    }


def _conversion(data: Path) -> dict[str, Any]:
    """Return pressure and spikes of one footfall of the plate: what figures 6.12 and 6.13 draw."""
    folder, encoder = data / SOURCES["plate"].folder, RECIPE["plate"]["contact"]["encoder"]
    cut = sources.cuts(folder, "plate")[0]
    piece = sources.encoded(folder, "plate", encoder).pieces[cut.name]
    begins = float(piece.truth["contact"][0])
    peak = cut.values.max(axis=0)
    first = np.concatenate([[0], np.cumsum(insole.CELLS)])
    loudest = {
        name: int(first[row] + np.argmax(peak[first[row] : first[row + 1]]))
        for name, row in (("heel", 1), ("ball", 8), ("toes", 13))
    }
    return {
        "footfall": cut.name,
        "peak": [float(v) for v in peak],
        "frame_ms": 2.0,
        "felt": {name: [float(v) for v in cut.values[:, n]] for name, n in loudest.items()},
        "threshold": encoder["levels"][0],
        "spikes_ms": [[round(float(t), 3) for t in train - begins] for train in piece.spikes],
        "truth_ms": {event: [float(t) for t in times - begins] for event, times in piece.truth.items()},
    }


def _unit(name: str, unit: Mapping[str, Any]) -> Unit:
    return Unit(
        name,
        unit["person"],
        unit["group"],
        unit["events"],
        unit["false"],
        unit["minutes"],
        tuple(unit["errors"]),
        tuple(unit["delays"]),
    )


def _outcomes(plan: Plan, known: Known) -> list[Outcome]:
    outcomes: dict[tuple[str, str], Outcome] = {}
    for event, row, left_out, task in plan.fits():
        outcome = outcomes.setdefault((event, row), Outcome(event, row))
        result = known[task]
        if row == "chosen" or row in RULES:
            outcome.points.append(result["point" if row == "chosen" else "fit"])
        outcome.units += [_unit(name, unit) for name, unit in result["tested"][str(left_out)].items()]
        outcome.seconds += known.seconds([task])
    return list(outcomes.values())


def _row(outcome: Outcome) -> dict[str, Any]:
    people = sorted({u.person for u in outcome.units})
    return {
        "event": outcome.event,
        "row": outcome.row,
        "about": ROWS[outcome.row],
        "figures": figures(outcome.units),
        "by_person": {p: figures([u for u in outcome.units if u.person == p]) for p in people},
        "chosen": _counted(outcome.points),
        "cpu_seconds": round(outcome.seconds, 1),
    }


def _counted(points: Sequence[Any]) -> list[dict[str, Any]]:
    """Return each different point once, with the number of folds that chose it, the most frequent first."""
    times: dict[str, int] = {}
    for point in points:
        text = json.dumps(point, sort_keys=True)
        times[text] = times.get(text, 0) + 1
    return [{"folds": n, "point": json.loads(text)} for text, n in sorted(times.items(), key=lambda item: -item[1])]


def _beside(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Compare the neuron with the count, event by event: by missed + false."""
    lines = []
    for event in dict.fromkeys(row["event"] for row in rows):
        wrong = {
            row["row"]: row["figures"]["missed"] + row["figures"]["false"] for row in rows if row["event"] == event
        }
        if "count" in wrong:
            neuron = wrong.get("chosen", wrong["recipe"])
            lines.append(f"{EVENTS[event]}: the neuron has {neuron} missed and false, the count {wrong['count']}.")
    return lines
