"""The results of the study: every foot, summed up by row, event, person and group."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from taxel_studies.gait import insole, sources
from taxel_studies.gait.fits import TEST
from taxel_studies.gait.plans import Plan, chooses, each, key, plans
from taxel_studies.gait.protocols import ROWS, Protocol
from taxel_studies.gait.recipes import FULL, NOTES, SEARCH
from taxel_studies.gait.sources import SOURCES
from taxel_studies.study import Parameters, Row, Summary, Task

__all__ = ["EVENTS", "GOALS", "Outcome", "Unit", "figures", "summarise"]

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


@dataclass(frozen=True)
class Outcome:
    """One row of the study: a source, a protocol, an event, a row's name, and every foot.

    Attributes
    ----------
    points : list
        The parameters of each fold, where they were chosen inside.
    seconds : float
        CPU time of the folds' fits, the choice inside them included.
    """

    source: str
    protocol: str
    event: str
    row: str
    units: tuple[Unit, ...]
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
    present = set(sources.readable(data, p["sources"]))
    if p["test"]:
        present &= set(sources.readable(Path(p["test"]), p["sources"]))
    skipped = [SOURCES[name].folder for name in SOURCES if name in p["sources"] and name not in present]
    skipped += [
        f"{SOURCES[n].folder} (too few people or recordings)" for n in SOURCES if n in present and n not in there
    ]
    skipped += [
        f"{plan.source}, {plan.protocol.name}: chosen inside (too few people)"
        for plan in listed
        if not plan.can_choose and any(chooses(row) for row in plan.protocol.rows)
    ]
    return {
        "judged": "on another folder" if p["test"] else "by folds",
        "skipped": skipped,
        "search_points": {s: {e: len(points) for e, points in events.items()} for s, events in SEARCH.items()},
        "full_search": [one for plan in listed for one in _full_search(plan, known)],
        "sources": [
            _source(name, [plan for plan in listed if plan.source == name], known) for name in SOURCES if name in there
        ],
        "folds": {f"{plan.source}/{plan.protocol.name}": plan.folds for plan in listed},
        "conversion": _conversion(data) if "plate" in there else None,
    }


def _source(name: str, listed: Sequence[Plan], known: Known) -> dict[str, Any]:
    source = SOURCES[name]
    judged = []
    for plan in listed:
        rows = [_row(outcome, plan.protocol, plan.testing) for outcome in _outcomes(plan, known)]
        judged.append(
            {
                "protocol": plan.protocol.name,
                "title": "trained on one folder, judged on the other" if plan.testing else plan.protocol.title,
                "train": dict(plan.protocol.train),
                "search": dict(plan.protocol.search),
                "rows": rows,
                "beside": _beside(rows),
            }
        )
    return {
        "source": name,
        "title": source.title,
        "truth": source.truth,
        "shows": source.shows,
        "by_minute": source.by_minute,
        "protocols": judged,
    }


def _conversion(data: Path) -> dict[str, Any]:
    """Return pressure and spikes of one footfall of the plate: what figures 6.12 and 6.13 draw."""
    folder, encoder = data / SOURCES["plate"].folder, NOTES["plate"]["contact"]["encoder"]
    cut = sources.cuts(folder, "plate", "own")[0]
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


def _full_search(plan: Plan, known: Known) -> Iterator[dict[str, Any]]:
    """List the setting of the 528 that each fold chose, its errors inside the training groups and in the test."""
    for scope, event, row in each(plan):
        for left_out in plan.outer(scope) if row in FULL else ():
            fitted = known[plan.task(scope, left_out, event, row)]
            point = fitted["point"]
            units = [_unit(name, unit) for group in fitted["tested"].values() for name, unit in group.items()]
            result = figures(units)
            yield {
                "event": event,
                "all_else": row.removeprefix("528: "),
                "left_out": ", ".join(sorted({u.person for u in units})),
                "tau": point["learner"]["tau"],
                "kappa": point["learner"]["kappa"],
                "lambda_1": point["learner"]["lambdas"][0],
                "lambda_2": point["learner"]["lambdas"][1],
                "inside": fitted["inside"],
                **{name: result[name] for name in ("missed", "false", "error_ms")},
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
    for scope, event, row in each(plan):
        units, points, tasks = [], [], []
        for left_out in plan.outer(scope):
            task = plan.task(scope, left_out, event, row)
            if chooses(row) or row.startswith("rule: "):
                points.append(known[task]["point" if chooses(row) else "fit"])
            tasks.append(task)
            for group in [TEST] if plan.testing else [str(g) for g in left_out]:
                units += [_unit(name, unit) for name, unit in known[task]["tested"][group].items()]
        before = outcomes.get((event, row))
        outcomes[event, row] = Outcome(
            plan.source,
            plan.protocol.name,
            event,
            row,
            (*(before.units if before else ()), *units),
            [*(before.points if before else []), *points],
            (before.seconds if before else 0.0) + known.seconds(tasks),
        )
    return list(outcomes.values())


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
        row["goal_met"] = _reaches(all_feet, goal)
    return row


def _counted(points: Sequence[Any]) -> list[dict[str, Any]]:
    """Return each different point once, with the number of folds that chose it, the most frequent first."""
    times: dict[str, int] = {}
    for point in points:
        text = json.dumps(point, sort_keys=True)
        times[text] = times.get(text, 0) + 1
    return [{"folds": n, "point": json.loads(text)} for text, n in sorted(times.items(), key=lambda item: -item[1])]


def _beside(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Compare the neuron with the plain rules, event by event: by missed + false, then by % within 10 ms."""
    lines = []
    for event in dict.fromkeys(row["event"] for row in rows):
        here = {row["row"]: row["figures"] for row in rows if row["event"] == event}
        neuron = here.get("chosen", here.get("notes"))
        rules = {name.removeprefix("rule: "): f for name, f in here.items() if name.startswith("rule: ")}
        if neuron is None or not rules:
            continue
        wrong = neuron["missed"] + neuron["false"]
        ahead = [f"{n} ({f['missed'] + f['false']})" for n, f in rules.items() if f["missed"] + f["false"] < wrong]
        behind = [f"{n} ({f['missed'] + f['false']})" for n, f in rules.items() if f["missed"] + f["false"] >= wrong]
        lines.append(
            f"{EVENTS[event]}: the neuron has {wrong} missed and false; "
            + (f"better than it: {', '.join(ahead)}" if ahead else "no plain rule is better")
            + (f"; not better: {', '.join(behind)}." if behind else ".")
        )
    return lines


def _names(units: Sequence[Unit]) -> list[str]:
    return list(dict.fromkeys(u.name for u in units))


def _reaches(result: dict[str, Any], goal: dict[str, float]) -> bool:
    at_least = {"found_percent", "within_10_ms_percent"}
    for name, value in goal.items():
        is_ = result["error_ms"] and result["error_ms"]["sd"] if name == "sd_ms" else result[name]
        if is_ is None or (is_ < value if name in at_least else is_ > value):
            return False
    return True
