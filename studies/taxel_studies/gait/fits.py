"""One realisation: train on some groups, test on another. A pure function of parameters and seed."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError
from taxel.detect import Example, Fold, Judged, Part, Recipe, Score, judge, score
from taxel.detections import Detections
from taxel.encode import Encoder
from taxel.learn import ConeR
from taxel.spikes import to_ms, to_us
from taxel_rules import SKIM
from taxel_studies.gait import insole, protocols, rules
from taxel_studies.gait.pieces import Piece, Signal, joined
from taxel_studies.gait.protocols import Scope
from taxel_studies.gait.sources import SOURCES, Encoded, encoded
from taxel_studies.runner import noted

#: Detections count up to so far from a reference event, ms (thesis 6.5.2).
WINDOW_MS = 50.0


def realise(params: dict[str, Any], seed: int, *, data: Path) -> dict[str, Any]:
    """Train without the group ``left_out``, test on it.

    Parameters
    ----------
    params : dict
        ``kind`` ("neuron", "search", "skim" or "rule"), ``source``, ``protocol``, ``scope``, ``left_out`` (a group's
        number), ``event``, ``train`` (``seconds`` a piece, or ``count`` footfalls a person); of a neuron its
        ``points``, and of several how much trains in the folds in which one is chosen, ``search``; of SKIM a
        ``point`` and its own options ``skim``; of a rule ``rule`` and ``encoder``.
    seed : int
        Draws the footfalls and their order in the training row.
    data : Path
        Holds the sources' folders.

    Returns
    -------
    dict
        ``tested``: by row the detections (of SKIM these ``by_setting``); ``point``: a neuron's, or a rule's numbers;
        of a search ``searched``: counts by point.
    """
    source, left_out = params["source"], params["left_out"]
    folder = data / SOURCES[source].folder
    scope = next(s for s in protocols.scopes(folder, source, params["protocol"]) if s.name == params["scope"])

    def rows(encoder: Mapping[str, Any]) -> _Rows:
        return _Rows(source, params["event"], scope, encoded(folder, source, encoder), seed)

    if params["kind"] == "neuron":
        return _neuron(rows, params["points"], left_out, params)
    if params["kind"] == "search":
        return _searched(rows(params["points"][0]["encoder"]), params["points"], left_out, params["train"])
    if params["kind"] == "skim":
        return _skim(rows(params["point"]["encoder"]), params["point"], left_out, params)
    return _rule(rows(params["encoder"]), params["rule"], left_out, params["train"])


@dataclass(frozen=True)
class _Rows:
    """The rows of one event that train or are tested, by group."""

    source: str
    event: str
    scope: Scope
    encoding: Encoded
    seed: int

    def pieces(self, group: int) -> list[Piece]:
        """Return the pieces, or stretches of them, of a group."""
        pieces = self.encoding.pieces
        return [
            pieces[n] if np.isinf(stop) else pieces[n].between(float(to_ms(start)), float(to_ms(stop)))
            for n, start, stop in self.scope.groups[group]
        ]

    def rows(self, pieces: list[Piece]) -> list[Piece]:
        """Return the rows of pieces: footfalls of a person joined to one row, recordings as they are."""
        if SOURCES[self.source].by_minute:
            return pieces
        return [joined([p for p in pieces if p.person == one]) for one in dict.fromkeys(p.person for p in pieces)]

    def training(self, without: Sequence[int], size: Mapping[str, int]) -> list[Piece]:
        """Return the training pieces, cut down to so many seconds a piece or footfalls a person."""
        pieces = [p for g in range(len(self.scope.groups)) if g not in without for p in self.pieces(g)]
        if "seconds" in size:
            return [
                p.between(p.scored[0], min(p.scored[0] + 1000.0 * size["seconds"], p.scored[1]))
                for p in pieces
                if p.scored[1] > p.scored[0]
            ]
        counts = Counter[str]()
        chosen = []
        for k in np.random.default_rng([self.seed, 1]).permutation(len(pieces)):
            counts[pieces[k].person] += 1
            if counts[pieces[k].person] <= size["count"]:
                chosen.append(pieces[k])
        return chosen

    def patterns(self, without: Sequence[int], size: Mapping[str, int]) -> list[Piece]:
        """Return the training rows: footfalls in one row, in random order; recordings as they are."""
        patterns = self.training(without, size)
        if not SOURCES[self.source].by_minute:
            order = np.random.default_rng([self.seed, 2]).permutation(len(patterns))
            patterns = [joined([patterns[k] for k in order])]
        patterns = [p for p in patterns if len(p.truth[self.event]) and len(p.spikes.times)]
        if not patterns:
            raise ProblemError(f"{self.source}, {self.event}: no event with a spike in what should train")
        return patterns


def _neuron(
    rows: Callable[[Mapping[str, Any]], _Rows], points: list[Any], left_out: int, params: Mapping[str, Any]
) -> dict[str, Any]:
    """Train and test a point; of several the one with the best rank inside the folds, of equal ones the first."""
    inside: dict[int, tuple[float, float]] = {}
    for n, point in enumerate(points) if "search" in params else ():
        here = rows(point["encoder"])
        folds = [(sorted([left_out, g]), g) for g in range(len(here.scope.groups)) if g != left_out]
        # One after the first that cannot be learnt, as where two labels are within its refractory time, is left out.
        with suppress(*([ProblemError] if n else [])):
            inside[n] = _judged(here, point, folds, params["search"]).together.rank
    point = points[min(inside, key=lambda n: inside[n], default=0)]
    here = rows(point["encoder"])
    judged = _judged(here, point, [([left_out], left_out)], params["train"])
    tested = zip(judged.scores, here.rows(here.pieces(left_out)), strict=True)
    return {"tested": {row.name: _plain(one, row) for one, row in tested}, "point": point}


def _searched(
    rows: _Rows, points: Sequence[Mapping[str, Any]], left_out: int, size: Mapping[str, int]
) -> dict[str, Any]:
    """Train and test every point in the same fold; count events, missed, false, and false within 50 ms of an event."""
    tested, counted = rows.rows(rows.pieces(left_out)), []
    for point in points:
        scores = _judged(rows, point, [([left_out], left_out)], size).scores
        units = [_plain(one, piece) for one, piece in zip(scores, tested, strict=True)]
        counts = {name: sum(unit[name] for unit in units) for name in ("events", "false", "false_near")}
        counted.append(counts | {"missed": counts["events"] - sum(len(unit["errors"]) for unit in units)})
    return {"searched": counted}


def _judged(
    rows: _Rows, point: Mapping[str, Any], folds: Sequence[tuple[list[int], int]], size: Mapping[str, int]
) -> Judged:
    """Train a point once for each group that is tested, without some groups."""
    pieces: list[Piece] = []
    parts = []
    for without, group in folds:
        training, tested = rows.patterns(without, size), rows.rows(rows.pieces(group))
        first, last = len(pieces), len(pieces) + len(training)
        pieces += [*training, *tested]
        scored = [to_us(np.array(piece.scored)) for piece in tested]
        test = [Part(last + n, float(start), float(stop) + 1) for n, (start, stop) in enumerate(scored)]
        parts.append(Fold([Part(n) for n in range(first, last)], test))
    event = rows.event
    examples = [Example(p.spikes, {event: np.rint(to_us(p.truth[event])).astype(np.int64)}) for p in pieces]
    recipe = Recipe(Encoder.from_json(json.dumps(point["encoder"])), {}, {event: point["learner"]})
    judged = judge(examples, recipe, parts, window_ms=WINDOW_MS)
    for cone in (learner for trained in judged.trained for learner in trained.learners.values()):
        if isinstance(cone, ConeR):
            noted(cone)
    return judged


def _skim(rows: _Rows, point: Mapping[str, Any], left_out: int, params: Mapping[str, Any]) -> dict[str, Any]:
    """Train SKIM as 6.5.4 does: the neuron's kernel; every width and height of the pulse and every threshold tested.

    Least squares make the output proportional to the height, so a height divides the threshold.
    """
    event, later = rows.event, rows.encoding.latency_ms + point["learner"]["delay_ms"]
    patterns = rows.patterns([left_out], params["train"])
    step_ms = point["learner"]["step_ms"]
    tested: dict[str, dict[str, Any]] = {}
    for pulse_ms in params["skim"]["pulses_ms"]:
        skim = SKIM(tau=point["learner"]["tau"], step_ms=step_ms, pulse_ms=pulse_ms)
        skim.fit([p.spikes for p in patterns], [p.truth[event] + later for p in patterns])
        levels = sorted({t / height for t in skim.thresholds for height in params["skim"]["heights"]})
        for p in rows.rows(rows.pieces(left_out)):
            output = skim.output(p.spikes)
            for level in levels:
                above = output >= level
                rises = above & ~np.concatenate([[False], above[:-1]])
                for spikes, fired in (("units", above), ("crossings", rises)):
                    times = p.spikes.start + step_ms * np.flatnonzero(fired)
                    key = f"{spikes}, {pulse_ms:g} ms, {level:.4g}"
                    tested.setdefault(key, {})[p.name] = _scored(times, p, event, later)
    return {"by_setting": tested}


def _scored(spikes: NDArray[np.float64], piece: Piece, event: str, later: float) -> dict[str, Any]:
    """Score the spikes of one row: `later` is the encoder's latency and the trained delay together."""
    t = spikes - later
    inside = (t >= piece.scored[0]) & (t <= piece.scored[1])
    micros = (np.rint(to_us(x[inside])).astype(np.int64) for x in (t, spikes))
    truth = piece.truth[event]
    truth = np.rint(to_us(truth[(truth >= piece.scored[0]) & (truth <= piece.scored[1])])).astype(np.int64)
    return _plain(score(Detections([event] * int(inside.sum()), *micros), {event: truth}, WINDOW_MS), piece)


def _plain(result: Score, piece: Piece) -> dict[str, Any]:
    return {
        "person": piece.person,
        "group": piece.group,
        "events": result.events,
        "false": result.false,
        "false_near": result.false_near,
        "minutes": round((piece.scored[1] - piece.scored[0]) / 60_000, 4),
        "errors": [round(float(e), 1) for e in result.errors_ms],
        "delays": [round(float(d), 1) for d in result.delays_ms],
    }


def _rule(rows: _Rows, rule: str, left_out: int, size: Mapping[str, int]) -> dict[str, Any]:
    """Choose a rule's numbers and offset on the training pieces, by missed + false first, then by error."""
    event, pieces = rows.event, rows.training([left_out], size)
    learned, tested = rows.rows(pieces), rows.rows(rows.pieces(left_out))
    on = np.arange(len(pieces[0].spikes) // 2).reshape(-1, rows.encoding.levels)
    if event == "heel_off":
        on = on[insole.HEEL]

    def signals(of: Sequence[Piece]) -> list[Signal]:
        return [rules.count_of(piece, on.ravel()) if rule == "count" else piece.load for piece in of]

    def times(of: Sequence[Signal], edges: tuple[float, float]) -> list[NDArray[np.float64]]:
        # Contact shows in counts that rise, the others in counts that fall.
        return [rules.detected(signal, *edges, rising=event == "contact") for signal in of]

    heard = signals(learned)
    most = on.size if rule == "count" else max(float(load.max()) for _, load in heard)
    tried: list[tuple[tuple[float, float], dict[str, float], tuple[float, float], float]] = []
    for numbers, on_at, off_at in rules.grid(rule, most):
        found = times(heard, (on_at, off_at))
        offset = _offset(found, learned, event)
        scored = [_scored(t, p, event, offset) for t, p in zip(found, learned, strict=True)]
        wrong = sum(f["events"] - len(f["errors"]) + f["false"] for f in scored)
        errors = np.concatenate([np.empty(0), *(f["errors"] for f in scored)])
        rank = float(wrong), float(np.sqrt(np.mean(errors**2))) if len(errors) else np.inf
        tried.append((rank, numbers, (on_at, off_at), offset))
    _, numbers, edges, offset = min(tried, key=lambda one: one[0])
    judged = zip(times(signals(tested), edges), tested, strict=True)
    units = {p.name: _scored(t, p, event, offset) for t, p in judged}
    return {"tested": units, "point": numbers | {"offset_ms": round(offset, 2)}}


def _offset(times: list[NDArray[np.float64]], pieces: list[Piece], event: str) -> float:
    """Return the median distance from each reference event to the nearest detection within 0.15 s."""
    near = [np.empty(0)]
    for found, piece in zip(times, pieces, strict=True):
        truth = piece.truth[event]
        if len(found):
            k = np.searchsorted(found, truth)
            left, right = (found[np.clip(at, 0, len(found) - 1)] - truth for at in (k - 1, k))
            near.append(np.where(np.abs(left) < np.abs(right), left, right))
    distances = np.concatenate(near)
    distances = distances[np.abs(distances) <= 150]
    return float(np.median(distances)) if len(distances) else 0.0
