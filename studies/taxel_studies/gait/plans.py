"""The fits of the study: every row of every protocol, in every fold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from taxel_studies.gait import protocols, sources
from taxel_studies.gait.protocols import PROTOCOLS, Protocol, Scope
from taxel_studies.gait.recipes import PRINTED, RECIPE, RULE_ENCODERS, SEARCH
from taxel_studies.gait.rules import RULES
from taxel_studies.gait.sources import SOURCES, fingerprint, one_of
from taxel_studies.study import Parameters, Task

__all__ = ["PARAMETERS", "SIZES", "Fit", "Plan", "key", "plans", "tasks", "unread"]

PARAMETERS: dict[str, Any] = {
    "sources": list(SOURCES),  # those that are absent are skipped, and listed
    "protocols": [],  # all
    "events": 0,  # all; else so many of the first
    "points": 0,  # to choose from: all; else so many of the first
}
SIZES = {"toy": {"protocols": ["people left out"], "events": 1, "points": 2}}


class Fit(NamedTuple):
    """One fit of a plan: its event and row, the group that it leaves out, and its realisation."""

    event: str
    row: str
    left_out: int
    task: Task


@dataclass(frozen=True)
class Plan:
    """Everything that one source and protocol ask for."""

    source: str
    protocol: Protocol
    scopes: tuple[Scope, ...]
    common: dict[str, Any]
    events: tuple[str, ...]
    few: slice
    folds: list[dict[str, Any]]

    @property
    def can_choose(self) -> bool:
        """Whether a group is left to train on when a fold leaves one out and the choice inside it another."""
        return min(len(scope.groups) for scope in self.scopes) > 2

    def fits(self) -> Iterator[Fit]:
        """Give every fit: the neuron or the rule of a row, in every fold of every scope."""
        for event in self.events:
            for row in self.protocol.rows:
                if (row != "chosen" or self.can_choose) and (row != "labels' own rule" or self._sum(event)):
                    for scope in self.scopes:
                        for left_out in range(len(scope.groups)):
                            yield Fit(event, row, left_out, self._task(scope, left_out, event, row))

    def _sum(self, event: str) -> bool:
        return event in SOURCES[self.source].sums

    def _task(self, scope: Scope, left_out: int, event: str, row: str) -> Task:
        """Return the realisation of a row in a fold, with the points that are tried inside the training groups."""
        params = self.common | {"scope": scope.name, "left_out": [left_out], "event": event}
        params["train"] = dict(self.protocol.train)
        if row in RULES:
            return Task(params | {"kind": "rule", "rule": row, "encoder": RULE_ENCODERS[self.source][event]}, seed=1)
        if row != "chosen":
            point = {"recipe": RECIPE, "printed": PRINTED}[row][self.source][event]
            return Task(params | {"kind": "neuron", "points": [point]}, seed=1)
        inner = [[g] for g in range(len(scope.groups)) if g != left_out]
        params |= {"inner": inner, "search": dict(self.protocol.search)}
        return Task(params | {"kind": "neuron", "points": SEARCH[self.source][event][self.few]}, seed=1)


def unread(p: Parameters, data: Path) -> dict[str, str]:
    """Return which files of the sources cannot be read, and why.

    Raises
    ------
    FormatError : none of the sources is there, or can be read
    """
    return sources.unread(data, p["sources"])


def plans(p: Parameters, data: Path) -> list[Plan]:
    """List what is run on each source that can be read.

    Raises
    ------
    ProblemError : a source or protocol that is none
    """
    known = tuple(dict.fromkeys(protocol.name for listed in PROTOCOLS.values() for protocol in listed))
    wanted = [one_of("protocols", name, known) for name in p["protocols"]] or known
    listed = []
    for name, folder in sources.readable(data, p["sources"]).items():
        for protocol in PROTOCOLS[name]:
            scopes = protocols.scopes(folder, name, protocol.name)
            if protocol.name in wanted and scopes:
                plain = protocols.to_json(scopes, protocols.names(folder, name))
                digest = hashlib.sha256(json.dumps(plain).encode()).hexdigest()[:16]
                common = {"source": name, "data": fingerprint(folder, name), "protocol": protocol.name, "folds": digest}
                events = SOURCES[name].events[: p["events"] or None]
                listed.append(Plan(name, protocol, scopes, common, events, slice(p["points"] or None), plain))
    return listed


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List the fits of every row in every fold, ordered so that one encoding serves many of them in turn."""
    return sorted((fit.task for plan in plans(p, data) for fit in plan.fits()), key=_by_encoder)


def _by_encoder(task: Task) -> str:
    encoder = task.params["encoder"] if task.params["kind"] == "rule" else task.params["points"][0]["encoder"]
    return json.dumps([task.params["source"], encoder, task.params["event"]])


def key(task: Task) -> str:
    """Return what a realisation is told apart by."""
    return json.dumps([task.params, task.seed], sort_keys=True)
