"""The fits of the study in two phases, and what the first chooses for the second."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from taxel import ProblemError
from taxel_studies.gait import folds, protocols, sources
from taxel_studies.gait.folds import Scope
from taxel_studies.gait.protocols import PROTOCOLS, Protocol
from taxel_studies.gait.recipes import (
    ENCODERS,
    FULL,
    NOTES,
    PRINTED,
    RULE_ENCODERS,
    SEARCH,
    SETTINGS,
    TONIC,
    Point,
    changed,
)
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import SOURCES, fingerprint
from taxel_studies.runner import Task, one_of
from taxel_studies.study import Parameters, Row

__all__ = [
    "PARAMETERS",
    "TOY",
    "Known",
    "Plan",
    "chooses",
    "chosen",
    "each",
    "fixed",
    "plans",
    "searched",
    "tasks",
    "then",
    "unread",
]

PARAMETERS: dict[str, Any] = {
    "sources": list(SOURCES),  # those that are absent are skipped and said
    "protocols": [],  # all
    "events": 0,  # all; else so many of the first
    "points": 0,  # to choose from: all; else so many of the first
    "search": "listed",  # "full": on the plate, people left out, also the 528 settings of 6.5.2
    "test": "",  # another folder of other people: trained on all of the data, judged there, instead of by folds
}
TOY: dict[str, Any] = {"protocols": ["people left out"], "events": 1, "points": 2}


class Known:
    """Look up what realisations gave, by their tasks."""

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows = {Task(row.params, row.seed).key(""): row for row in rows}

    def __getitem__(self, task: Task) -> Any:
        """Return a task's result."""
        return self._rows[task.key("")].result

    def seconds(self, tasks: Sequence[Task]) -> float:
        """Return the CPU seconds that tasks took."""
        return sum(self._rows[task.key("")].seconds for task in tasks)


@dataclass(frozen=True)
class Plan:
    """Everything that one source and protocol ask for."""

    source: str
    protocol: Protocol
    scopes: tuple[Scope, ...]
    common: dict[str, Any]
    testing: bool
    events: tuple[str, ...]
    few: slice
    full: bool = False

    @property
    def can_choose(self) -> bool:
        """Whether a group is left to train on when a fold leaves one out and the choice inside it another."""
        return min(len(scope.groups) for scope in self.scopes) > (1 if self.testing else 2)

    def outer(self, scope: Scope) -> Iterator[list[int]]:
        """Give the groups that each fold leaves out; none where another folder is judged."""
        if self.testing:
            yield []
        else:
            yield from ([g] for g in range(len(scope.groups)))

    def inner(self, scope: Scope, left_out: list[int]) -> list[tuple[int, list[int]]]:
        """List what chooses inside a fold: the group that is looked at, and what its fit leaves out."""
        others = [g for g in range(len(scope.groups)) if g not in left_out]
        return [(g, sorted([*left_out, g])) for g in others]

    def neuron(self, scope: Scope, left_out: list[int], event: str, point: Point, *, inside: bool = False) -> Task:
        """Name a neuron's fit."""
        train = self.protocol.search if inside else self.protocol.train
        params = {"kind": "neuron", "left_out": left_out, "event": event, "point": point, "train": dict(train)}
        return Task(self.common | params | {"scope": scope.name, "placed": "own"}, seed=1)

    def searches(self, scope: Scope, left_out: list[int], event: str, row: str) -> list[Task]:
        """Name the search of all settings inside a fold: a third of the other groups judge what the rest trained."""
        after = max(left_out, default=-1) + 1
        groups = len(scope.groups)
        others = [g for g in ((after + k) % groups for k in range(groups)) if g not in left_out]
        judged = sorted(others[: max(1, len(others) // 3 + (len(others) % 3 > 1))])
        params = {
            "kind": "search",
            "left_out": sorted([*left_out, *judged]),
            "judged": judged,
            "event": event,
            "lambda_1": list(SETTINGS["lambda_1"][self.few]),
            "train": {"count": 20},
            "scope": scope.name,
            "placed": "own",
        }
        return [
            Task(self.common | params | {"point": changed(FULL[row][event], tau=tau, kappa=kappa)}, seed=1)
            for tau in SETTINGS["tau"][self.few]
            for kappa in SETTINGS["kappa"][self.few]
        ]

    def rule(self, scope: Scope, left_out: list[int], event: str, rule: str) -> Task:
        """Name a plain rule's choice."""
        encoder = RULE_ENCODERS[self.source][event]
        params = {"kind": "rule", "left_out": left_out, "event": event, "rule": rule, "encoder": encoder}
        train = dict(self.protocol.train)
        return Task(self.common | params | {"scope": scope.name, "placed": "own", "train": train}, seed=1)


def unread(p: Parameters, data: Path) -> dict[str, str]:
    """Return which files of the sources cannot be read, and why.

    Raises
    ------
    FormatError : none of the sources is there, or can be read
    """
    found = sources.unread(data, p["sources"])
    if p["test"]:
        other = Path(p["test"])
        found |= {f"{other.name}/{file}": why for file, why in sources.unread(other, p["sources"]).items()}
    return found


def plans(p: Parameters, data: Path) -> list[Plan]:
    """List what is run on each source that can be read.

    Raises
    ------
    ProblemError : a source, protocol or search that is none
    """
    one_of("search", p["search"], ("listed", "full"))
    known = tuple(dict.fromkeys(protocol.name for listed in PROTOCOLS.values() for protocol in listed))
    for name in p["protocols"]:
        one_of("protocols", name, known)
    folders = sources.readable(data, p["sources"])
    others = sources.readable(Path(p["test"]), p["sources"]) if p["test"] else folders
    return [
        plan
        for name in SOURCES
        if name in folders and name in others
        for plan in _plans(p, name, folders[name], others[name])
    ]


def _plans(p: Parameters, name: str, folder: Path, other: Path) -> Iterator[Plan]:
    testing = bool(p["test"])
    common = {"source": name, "data": [fingerprint(folder, name)]}
    if testing:
        common |= {"data": [fingerprint(folder, name), fingerprint(other, name)], "test": p["test"]}
    for protocol in PROTOCOLS[name]:
        if (testing and protocol.split not in {"people", "pieces"}) or protocol.name not in (
            p["protocols"] or [protocol.name]
        ):
            continue
        scopes = protocols.scopes(folder, name, protocol.name, 1 if testing else 2)
        if not scopes:
            continue
        digest = hashlib.sha256(json.dumps(folds.to_json(scopes)).encode()).hexdigest()[:16]
        yield Plan(
            name,
            protocol,
            scopes,
            common | {"protocol": protocol.name, "folds": digest},
            testing,
            SOURCES[name].events[: p["events"] or None],
            slice(p["points"] or None),
            p["search"] == "full" and (name, protocol.name) == ("plate", "people left out"),
        )


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List everything that needs no choice: fixed rows, and the fits inside the folds."""
    return [task for plan in plans(p, data) for task in _first(plan)]


def then(p: Parameters, rows: Sequence[Row], *, data: Path) -> list[Task]:
    """List the folds' own fits with what was chosen inside."""
    known = Known(rows)
    return [task for plan in plans(p, data) for task in _second(plan, known)]


def _points(plan: Plan, event: str, row: str) -> list[Point]:
    """Return the points of a row: one, or those that it may choose from."""
    if row == "chosen":
        return SEARCH[plan.source][event][plan.few]
    if row.startswith("encoder: "):
        return ENCODERS[row.removeprefix("encoder: ")][event][plan.few]
    return [{"notes": NOTES, "others": NOTES, "printed": PRINTED, "tonic": TONIC}[row][plan.source][event]]


def _rows(plan: Plan, event: str) -> list[str]:
    rows: list[str] = []
    for row in plan.protocol.rows:
        if chooses(row) and not plan.can_choose:
            continue
        if row == "rules":
            rows += [f"rule: {r}" for r in RULES if r != "sum" or event in SOURCES[plan.source].sums]
        elif row == "encoders":
            rows += [f"encoder: {name}" for name in ENCODERS]
        elif row != "tonic" or event in TONIC.get(plan.source, {}):
            rows.append(row)
    if plan.full and plan.can_choose:
        rows += [row for row, points in FULL.items() if event in points]
    return rows


def chooses(row: str) -> bool:
    """Whether a row's parameters are chosen inside the folds."""
    return row == "chosen" or row.startswith("encoder") or row in FULL


def fixed(plan: Plan, scope: Scope, left_out: list[int], event: str, row: str) -> Task:
    """Name the task of a row that chooses nothing between neurons."""
    if row.startswith("rule: "):
        return plan.rule(scope, left_out, event, row.removeprefix("rule: "))
    task = plan.neuron(scope, left_out, event, _points(plan, event, row)[0])
    return Task(task.params | {"placed": "others"}, task.seed) if row == "others" else task


def each(plan: Plan) -> Iterator[tuple[Scope, str, str]]:
    """Give every scope, event and row of a plan."""
    for event in plan.events:
        for row in _rows(plan, event):
            for scope in plan.scopes:
                yield scope, event, row


def _first(plan: Plan) -> list[Task]:
    """List everything that needs no choice: fixed rows, and the fits inside the folds."""
    tasks = []
    for scope, event, row in each(plan):
        for left_out in plan.outer(scope):
            if not chooses(row):
                tasks.append(fixed(plan, scope, left_out, event, row))
                continue
            if row in FULL:
                tasks += plan.searches(scope, left_out, event, row)
                continue
            for point in _points(plan, event, row):
                tasks += [plan.neuron(scope, out, event, point, inside=True) for _, out in plan.inner(scope, left_out)]
    return sorted({t.key(""): t for t in tasks}.values(), key=_by_encoder)


def _by_encoder(task: Task) -> str:
    """Order tasks so that one encoding serves many of them in a row."""
    encoder = task.params["encoder"] if task.params["kind"] == "rule" else task.params["point"]["encoder"]
    return json.dumps([task.params["placed"], encoder, task.params["event"]])


def _second(plan: Plan, known: Known) -> list[Task]:
    """List the folds' own fits with what was chosen inside."""
    tasks = [
        plan.neuron(scope, left_out, event, chosen(plan, scope, left_out, event, row, known))
        for scope, event, row in each(plan)
        if chooses(row)
        for left_out in plan.outer(scope)
    ]
    return sorted({t.key(""): t for t in tasks}.values(), key=_by_encoder)


def chosen(plan: Plan, scope: Scope, left_out: list[int], event: str, row: str, known: Known) -> Point:
    """Choose by missed + false inside the training folds first, then by root mean square error."""
    if row in FULL:
        return searched(plan, scope, left_out, event, row, known)[0]
    best: tuple[tuple[float, float], Point] | None = None
    for point in _points(plan, event, row):
        wrong, errors = 0, []
        for group, out in plan.inner(scope, left_out):
            tested = known[plan.neuron(scope, out, event, point, inside=True)]["tested"]
            for unit in tested[str(group)].values():
                wrong += unit["events"] - len(unit["errors"]) + unit["false"]
                errors += unit["errors"]
        quality = (float(wrong), float(np.sqrt(np.mean(np.square(errors)))) if errors else float("inf"))
        if best is None or quality < best[0]:
            best = (quality, point)
    if best is None:
        raise ProblemError(f"{plan.source}, {event}: no point to choose from")
    return best[1]


def searched(
    plan: Plan, scope: Scope, left_out: list[int], event: str, row: str, known: Known
) -> tuple[Point, dict[str, Any]]:
    """Return the best of all settings that a fold searched, and what was found of it inside."""
    tries = [
        (task.params["point"], tried)
        for task in plan.searches(scope, left_out, event, row)
        for tried in known[task]["tried"]
    ]
    unknown = float("inf")
    point, best = min(
        tries, key=lambda t: (t[1]["missed"] + t[1]["false"], unknown if t[1]["rms_ms"] is None else t[1]["rms_ms"])
    )
    return changed(point, lambdas=best["lambdas"]), best
