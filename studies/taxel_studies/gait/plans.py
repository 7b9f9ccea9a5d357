"""The fits of the study: every row of every protocol, in every fold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taxel_studies.gait import protocols, sources
from taxel_studies.gait.protocols import PROTOCOLS, Protocol, Scope
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
from taxel_studies.gait.sources import SOURCES, fingerprint, one_of
from taxel_studies.study import Parameters, Task

__all__ = [
    "PARAMETERS",
    "SIZES",
    "Plan",
    "chooses",
    "each",
    "plans",
    "tasks",
    "unread",
]

PARAMETERS: dict[str, Any] = {
    "sources": list(SOURCES),  # those that are absent are skipped, and listed
    "protocols": [],  # all
    "events": 0,  # all; else so many of the first
    "points": 0,  # to choose from: all; else so many of the first
    "search": "listed",  # "full": on the plate, people left out, also the 528 settings of 6.5.2
    "test": "",  # another folder of other people: trained on all of the data, judged there, instead of by folds
}
SIZES = {"toy": {"protocols": ["people left out"], "events": 1, "points": 2}}


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
    folds: list[dict[str, Any]]
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

    def neuron(self, scope: Scope, left_out: list[int], event: str, row: str) -> Task:
        """Return the fit of a row's neuron in a fold, with the points that are tried inside the training groups."""
        points = _points(self, event, row)
        placed = "others" if row == "others" else "own"
        params: dict[str, Any] = {"kind": "neuron", "left_out": left_out, "event": event, "points": points}
        params |= {"placed": placed, "train": dict(self.protocol.train), "scope": scope.name}
        if chooses(row):
            inner = self._third(scope, left_out) if row in FULL else self._each(scope, left_out)
            params |= {"inner": inner, "search": {"count": 20} if row in FULL else dict(self.protocol.search)}
        return Task(self.common | params, seed=1)

    def _each(self, scope: Scope, left_out: list[int]) -> list[list[int]]:
        """Return folds that test on each of the other groups, trained on the rest."""
        return [[g] for g in range(len(scope.groups)) if g not in left_out]

    def _third(self, scope: Scope, left_out: list[int]) -> list[list[int]]:
        """Return one fold that tests on a third of the other groups, trained on the rest."""
        after = max(left_out, default=-1) + 1
        groups = len(scope.groups)
        others = [g for g in ((after + k) % groups for k in range(groups)) if g not in left_out]
        return [sorted(others[: max(1, len(others) // 3 + (len(others) % 3 > 1))])]

    def task(self, scope: Scope, left_out: list[int], event: str, row: str) -> Task:
        """Return the task of a row in a fold."""
        if row.startswith("rule: "):
            return self.rule(scope, left_out, event, row.removeprefix("rule: "))
        return self.neuron(scope, left_out, event, row)

    def rule(self, scope: Scope, left_out: list[int], event: str, rule: str) -> Task:
        """Return the task that chooses the numbers of a plain rule in a fold."""
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
    files = sources.unread(data, p["sources"])
    if p["test"]:
        other = Path(p["test"])
        files |= {f"{other.name}/{file}": why for file, why in sources.unread(other, p["sources"]).items()}
    return files


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
        plain = protocols.to_json(scopes, protocols.names(folder, name))
        digest = hashlib.sha256(json.dumps(plain).encode()).hexdigest()[:16]
        yield Plan(
            name,
            protocol,
            scopes,
            common | {"protocol": protocol.name, "folds": digest},
            testing,
            SOURCES[name].events[: p["events"] or None],
            slice(p["points"] or None),
            plain,
            p["search"] == "full" and (name, protocol.name) == ("plate", "people left out"),
        )


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List the fits of every row in every fold, ordered so that one encoding serves many of them in turn."""
    listed = [
        plan.task(scope, left_out, event, row)
        for plan in plans(p, data)
        for scope, event, row in each(plan)
        for left_out in plan.outer(scope)
    ]
    return sorted({key(t): t for t in listed}.values(), key=_by_encoder)


def _by_encoder(task: Task) -> str:
    encoder = task.params["encoder"] if task.params["kind"] == "rule" else task.params["points"][0]["encoder"]
    return json.dumps([task.params["source"], task.params["placed"], encoder, task.params["event"]])


def _points(plan: Plan, event: str, row: str) -> list[Point]:
    """Return the points of a row: one, or those that it may choose from."""
    if row in FULL:
        return [
            changed(FULL[row][event], tau=tau, kappa=kappa, lambdas=[l1, round(4 - l1, 1), *_rest(FULL[row][event])])
            for tau in SETTINGS["tau"][plan.few]
            for kappa in SETTINGS["kappa"][plan.few]
            for l1 in SETTINGS["lambda_1"][plan.few]
        ]
    if row == "chosen":
        return SEARCH[plan.source][event][plan.few]
    if row.startswith("encoder: "):
        return ENCODERS[row.removeprefix("encoder: ")][event][plan.few]
    return [{"notes": NOTES, "others": NOTES, "printed": PRINTED, "tonic": TONIC}[row][plan.source][event]]


def _rest(point: Point) -> list[float]:
    """Return the lambdas of a point after the first two."""
    rest: list[float] = point["learner"]["lambdas"][2:]
    return rest


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


def each(plan: Plan) -> Iterator[tuple[Scope, str, str]]:
    """Give every scope, event and row of a plan."""
    for event in plan.events:
        for row in _rows(plan, event):
            for scope in plan.scopes:
                yield scope, event, row


def key(task: Task) -> str:
    """Return what a realisation is told apart by."""
    return json.dumps([task.params, task.seed], sort_keys=True)
