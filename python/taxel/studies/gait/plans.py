"""The study itself: its fits in two phases, what they choose, and what they come to."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from taxel import _arguments as arguments
from taxel import encode, formats, learn
from taxel._core import FormatError, ProblemError
from taxel.studies.gait import folds, insole, pieces, rules, sources
from taxel.studies.gait import realise as realisation
from taxel.studies.gait.folds import Scope
from taxel.studies.gait.protocols import PROTOCOLS, Outcome, Protocol, Unit
from taxel.studies.gait.realise import TEST, Setting, realise
from taxel.studies.gait.recipes import (
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
from taxel.studies.gait.rules import RULES
from taxel.studies.gait.sources import SOURCES, encoded, fingerprint, present
from taxel.studies.runner import HERE, Results, Task, Workers, code_digest, run
from taxel.studies.study import refuse

__all__ = ["study"]

#: What a realisation uses.
_CODE = (sources, insole, pieces, folds, realisation, rules, formats, encode, learn)


@dataclass(frozen=True)
class _Plan:
    """Everything that one source and protocol ask for."""

    source: str
    protocol: Protocol
    scopes: list[Scope]
    common: dict[str, Any]
    testing: bool
    events: tuple[str, ...]
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

    def searches(self, scope: Scope, left_out: list[int], event: str, row: str, size: str) -> list[Task]:
        """Name the search of all settings inside a fold: a third of the other groups judge what the rest trained."""
        after = max(left_out, default=-1) + 1
        groups = len(scope.groups)
        others = [g for g in ((after + k) % groups for k in range(groups)) if g not in left_out]
        judged = sorted(others[: max(1, len(others) // 3 + (len(others) % 3 > 1))])
        few = slice(2) if size == "toy" else slice(None)
        params = {
            "kind": "search",
            "left_out": sorted([*left_out, *judged]),
            "judged": judged,
            "event": event,
            "lambda_1": list(SETTINGS["lambda_1"][few]),
            "train": {"count": 20},
            "scope": scope.name,
            "placed": "own",
        }
        return [
            Task(self.common | params | {"point": changed(FULL[row][event], tau=tau, kappa=kappa)}, seed=1)
            for tau in SETTINGS["tau"][few]
            for kappa in SETTINGS["kappa"][few]
        ]

    def rule(self, scope: Scope, left_out: list[int], event: str, rule: str) -> Task:
        """Name a plain rule's choice."""
        encoder = RULE_ENCODERS[self.source][event]
        params = {"kind": "rule", "left_out": left_out, "event": event, "rule": rule, "encoder": encoder}
        train = dict(self.protocol.train)
        return Task(self.common | params | {"scope": scope.name, "placed": "own", "train": train}, seed=1)


def study(
    data: Path,
    test: Path | None = None,
    *,
    size: str = "full",
    search: str = "listed",
    workers: Workers = HERE,
    report: Path,
    only: Sequence[str] = (),
    strict: bool = False,
    quiet: bool = False,
) -> dict[str, Any]:
    """Run the gait study on a folder of recordings; what is in `report` from before is not run again.

    Parameters
    ----------
    data : Path
        Holds any of the sources' folders; those that are absent are skipped and said.
    test : Path, optional
        Other people: everything is trained on `data` and judged there, instead of by folds.
    size : {"full", "toy"}
        Toy: people left out only, the first event only, two points to choose from.
    search : {"listed", "full"}
        Full: on the plate, people left out, also all 528 settings of 6.5.2 for contact and foot-off, all else once as
        printed and once as in the notes' recipe; chosen by one split of the training people.
    workers : Workers
    report : Path
        Folder for results (JSON lines), folds, and the report.
    only : sequence of str
        Sources to run; all that are there where it is empty.
    strict : bool
        A file that cannot be read ends the study before it begins; else it is left out, and said.
    quiet : bool
        No progress lines.

    Returns
    -------
    dict
        As `report.summary` gives it, and as ``gait.json`` holds it.

    Raises
    ------
    FormatError : `data` or `test` holds no source, or none that can be read (one that cannot, with `strict`)
    ProblemError : a size or source that is none
    """
    from taxel.studies.gait.report import figures, summary, write_report  # noqa: PLC0415  jinja2 and matplotlib load slowly

    data, report = Path(arguments.path("data", data)), Path(arguments.path("report", report))
    test = None if test is None else Path(arguments.path("test", test))
    arguments.text("size", size, ("full", "toy"))
    arguments.text("search", search, ("listed", "full"))
    only = [arguments.text("only", name, SOURCES) for name in arguments.several("only", only)]
    folders, unread = _sources(data, only, strict)
    tests: dict[str, Path] = {}
    if test is not None:
        tests, others = _sources(test, only, strict)
        unread |= others
    wanted = [name for name in SOURCES if name in folders and (test is None or name in tests)]
    report.mkdir(parents=True, exist_ok=True)
    plans = [plan for name in wanted for plan in _plans(name, folders[name], tests.get(name), size, search)]
    _write_folds(report / "folds.json", plans)
    setting = Setting(folders, tests, {f"{p.source}/{p.protocol.name}": p.scopes for p in plans})
    results = Results(report / "results.jsonl", code_digest(_CODE))
    call = partial(realise, setting=setting)
    outcomes, seconds = [], 0.0
    full: list[dict[str, Any]] = []
    for plan in plans:
        title = f"{plan.source}, {plan.protocol.name}"
        first = _first(plan, size)
        run(call, first, results, workers=workers, title=title, quiet=quiet)
        second = _second(plan, size, results)
        run(call, second, results, workers=workers, title=f"{title}: chosen", quiet=quiet)
        outcomes += _outcomes(plan, size, results)
        full += _full_search(plan, size, results, figures)
        seconds += results.seconds([*first, *second])
    skipped = [SOURCES[n].folder for n in SOURCES if n not in wanted and (not only or n in only)]
    skipped += [
        f"{SOURCES[n].folder} (too few people or recordings)" for n in wanted if n not in {p.source for p in plans}
    ]
    skipped += [
        f"{p.source}, {p.protocol.name}: chosen inside (too few people)"
        for p in plans
        if not p.can_choose and any(_chooses(row) for row in p.protocol.rows)
    ]
    said = summary(
        outcomes,
        plans=[(p.source, p.protocol) for p in plans],
        full_search=full,
        skipped=skipped,
        unread=unread,
        size=size,
        test=test is not None,
        cpu_seconds=seconds,
    )
    write_report(report, said)
    return said


def _sources(folder: Path, only: Sequence[str], strict: bool) -> tuple[dict[str, Path], dict[str, str]]:
    """Return the sources of a folder that can be read, and the files that cannot."""
    if not folder.is_dir():
        raise FileNotFoundError(2, "No such folder", str(folder))
    found = {name: place for name, place in present(folder).items() if not only or name in only}
    if not found:
        names = ", ".join(SOURCES[name].folder for name in (only or SOURCES))
        raise FormatError(f"{folder}: holds no recordings; must have one or more of the folders {names}")
    unread = sources.unread(found.items())
    readable = {name: place for name, place in found.items() if sources.readings(place, name).trials}
    refuse(unread, strict=strict or not readable)
    return readable, unread


def _plans(name: str, folder: Path, test: Path | None, size: str, search: str) -> Iterator[_Plan]:
    encoder = next(iter(NOTES[name].values()))["encoder"]
    all_pieces = list(encoded(folder, name, encoder).pieces.values())
    data = [fingerprint(folder, name)] + ([fingerprint(test, name)] if test else [])
    for protocol in PROTOCOLS[name]:
        if test and protocol.split not in {"people", "pieces"}:
            continue
        if size == "toy" and protocol.name != "people left out":
            continue
        scopes = [s for s in protocol.scopes(all_pieces) if len(s.groups) > (0 if test else 1)]
        plain = json.dumps(folds.to_json(scopes))
        common = {
            "source": name,
            "protocol": protocol.name,
            "data": data,
            "folds": hashlib.sha256(plain.encode()).hexdigest()[:16],
        }
        if not scopes:
            continue
        events = SOURCES[name].events[: 1 if size == "toy" else None]
        full = search == "full" and (name, protocol.name) == ("plate", "people left out")
        yield _Plan(name, protocol, scopes, common, test is not None, events, full)


def _write_folds(path: Path, plans: Sequence[_Plan]) -> None:
    """Write who is trained on and tested, so that other learners can be judged on the same."""
    said = {f"{p.source}/{p.protocol.name}": folds.to_json(p.scopes) for p in plans}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(said, indent=1) + "\n", encoding="utf-8")
    part.replace(path)


def _points(plan: _Plan, event: str, row: str, size: str) -> list[Point]:
    """Return the points of a row: one, or those that it may choose from."""
    few = slice(2) if size == "toy" else slice(None)
    if row == "chosen":
        return SEARCH[plan.source][event][few]
    if row.startswith("encoder: "):
        return ENCODERS[row.removeprefix("encoder: ")][event][few]
    return [{"notes": NOTES, "others": NOTES, "printed": PRINTED, "tonic": TONIC}[row][plan.source][event]]


def _rows(plan: _Plan, event: str) -> list[str]:
    rows: list[str] = []
    for row in plan.protocol.rows:
        if _chooses(row) and not plan.can_choose:
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


def _chooses(row: str) -> bool:
    return row == "chosen" or row.startswith("encoder") or row in FULL


def _fixed(plan: _Plan, scope: Scope, left_out: list[int], event: str, row: str, size: str) -> Task:
    """Name the task of a row that chooses nothing between neurons."""
    if row.startswith("rule: "):
        return plan.rule(scope, left_out, event, row.removeprefix("rule: "))
    task = plan.neuron(scope, left_out, event, _points(plan, event, row, size)[0])
    return Task(task.params | {"placed": "others"}, task.seed) if row == "others" else task


def _each(plan: _Plan) -> Iterator[tuple[Scope, str, str]]:
    for event in plan.events:
        for row in _rows(plan, event):
            for scope in plan.scopes:
                yield scope, event, row


def _first(plan: _Plan, size: str) -> list[Task]:
    """List everything that needs no choice: fixed rows, and the fits inside the folds."""
    tasks = []
    for scope, event, row in _each(plan):
        for left_out in plan.outer(scope):
            if not _chooses(row):
                tasks.append(_fixed(plan, scope, left_out, event, row, size))
                continue
            if row in FULL:
                tasks += plan.searches(scope, left_out, event, row, size)
                continue
            for point in _points(plan, event, row, size):
                tasks += [plan.neuron(scope, out, event, point, inside=True) for _, out in plan.inner(scope, left_out)]
    return sorted({t.key(""): t for t in tasks}.values(), key=_by_encoder)


def _by_encoder(task: Task) -> str:
    """Order tasks so that one encoding serves many of them in a row."""
    encoder = task.params["encoder"] if task.params["kind"] == "rule" else task.params["point"]["encoder"]
    return json.dumps([task.params["placed"], encoder, task.params["event"]])


def _second(plan: _Plan, size: str, results: Results) -> list[Task]:
    """List the folds' own fits with what was chosen inside."""
    tasks = [
        plan.neuron(scope, left_out, event, _chosen(plan, scope, left_out, event, row, size, results))
        for scope, event, row in _each(plan)
        if _chooses(row)
        for left_out in plan.outer(scope)
    ]
    return sorted({t.key(""): t for t in tasks}.values(), key=_by_encoder)


def _chosen(plan: _Plan, scope: Scope, left_out: list[int], event: str, row: str, size: str, results: Results) -> Point:
    """Choose by missed + false inside the training folds first, then by root mean square error."""
    if row in FULL:
        return _searched(plan, scope, left_out, event, row, size, results)[0]
    best: tuple[tuple[float, float], Point] | None = None
    for point in _points(plan, event, row, size):
        wrong, errors = 0, []
        for group, out in plan.inner(scope, left_out):
            tested = results[plan.neuron(scope, out, event, point, inside=True)]["tested"]
            for unit in tested[str(group)].values():
                wrong += unit["events"] - len(unit["errors"]) + unit["false"]
                errors += unit["errors"]
        quality = (float(wrong), float(np.sqrt(np.mean(np.square(errors)))) if errors else float("inf"))
        if best is None or quality < best[0]:
            best = (quality, point)
    if best is None:
        raise ProblemError(f"{plan.source}, {event}: no point to choose from")
    return best[1]


def _searched(
    plan: _Plan, scope: Scope, left_out: list[int], event: str, row: str, size: str, results: Results
) -> tuple[Point, dict[str, Any]]:
    """Return the best of all settings that a fold searched, and what was found of it inside."""
    tries = [
        (task.params["point"], tried)
        for task in plan.searches(scope, left_out, event, row, size)
        for tried in results[task]["tried"]
    ]
    unknown = float("inf")
    point, best = min(
        tries, key=lambda t: (t[1]["missed"] + t[1]["false"], unknown if t[1]["rms_ms"] is None else t[1]["rms_ms"])
    )
    return changed(point, lambdas=best["lambdas"]), best


def _full_search(plan: _Plan, size: str, results: Results, figures: Any) -> Iterator[dict[str, Any]]:
    """List what each fold chose of the 528 settings, what it had found of it inside, and what it came to."""
    for scope, event, row in _each(plan):
        for left_out in plan.outer(scope) if row in FULL else ():
            point, inside = _searched(plan, scope, left_out, event, row, size, results)
            tested = results[plan.neuron(scope, left_out, event, point)]["tested"]
            units = [_unit(name, unit) for group in tested.values() for name, unit in group.items()]
            found = figures(units)
            yield {
                "event": event,
                "all_else": row.removeprefix("528: "),
                "left_out": ", ".join(sorted({u.person for u in units})),
                "tau": point["learner"]["tau"],
                "kappa": point["learner"]["kappa"],
                "lambda_1": point["learner"]["lambdas"][0],
                "lambda_2": point["learner"]["lambdas"][1],
                "inside": inside,
                **{name: found[name] for name in ("missed", "false", "error_ms")},
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


def _outcomes(plan: _Plan, size: str, results: Results) -> list[Outcome]:
    found: dict[tuple[str, str], Outcome] = {}
    for scope, event, row in _each(plan):
        units, points, tasks = [], [], []
        for left_out in plan.outer(scope):
            if _chooses(row):
                point = _chosen(plan, scope, left_out, event, row, size, results)
                points.append(point)
                task = plan.neuron(scope, left_out, event, point)
            else:
                task = _fixed(plan, scope, left_out, event, row, size)
                if row.startswith("rule: "):
                    points.append(results[task]["fit"])
            tasks.append(task)
            for group in [TEST] if plan.testing else [str(g) for g in left_out]:
                units += [_unit(name, unit) for name, unit in results[task]["tested"][group].items()]
        before = found.get((event, row))
        found[event, row] = Outcome(
            plan.source,
            plan.protocol.name,
            event,
            row,
            (*(before.units if before else ()), *units),
            [*(before.points if before else []), *points],
            (before.seconds if before else 0.0) + results.seconds(tasks),
        )
    return list(found.values())
