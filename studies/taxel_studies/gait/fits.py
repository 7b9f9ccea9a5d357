"""One realisation: train on some groups, test on others. A pure function of parameters and seed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError
from taxel.detect import Example, Fold, Part, Recipe, Score, judge, score
from taxel.detections import Detections
from taxel.encode import Encoder
from taxel.learn import ConeR
from taxel.spikes import to_ms, to_us
from taxel_rules import SKIM
from taxel_studies.gait import insole, protocols, rules
from taxel_studies.gait.pieces import Piece, joined
from taxel_studies.gait.protocols import Scope
from taxel_studies.gait.sources import SOURCES, Encoded, encoded

__all__ = ["realise"]

#: Detections count up to so far from a reference event, ms (thesis 6.5.2).
WINDOW_MS = 50.0
#: A plain rule detects nothing for so long after an event, ms.
DEAD_MS = 250.0


def realise(params: dict[str, Any], seed: int, *, data: Path) -> dict[str, Any]:
    """Train without the groups ``left_out``, test on each of them.

    Parameters
    ----------
    params : dict
        ``kind`` ("neuron", "skim" or "rule"), ``source``, ``protocol``, ``scope``, ``left_out`` (numbers of groups),
        ``event``, ``train`` (``seconds`` a piece, or ``count`` footfalls a person); of a neuron its ``points``, and of
        several the folds to choose in: ``inner`` (the groups that each of them tests) and ``search`` (how much trains
        there); of SKIM a ``point`` and its own options ``skim``; of a rule ``rule`` and ``encoder``.
    seed : int
        Draws the footfalls and their order in the training row.
    data : Path
        Holds the sources' folders.

    Returns
    -------
    dict
        ``tested``: by group and unit the detections (of SKIM these ``by_threshold``); ``fit``: the attributes of the
        learner, or the rule's numbers; of a neuron also its ``point``, and the result of that ``inside`` the folds.
    """
    source = params["source"]
    folder = data / SOURCES[source].folder
    scope = next(s for s in protocols.scopes(folder, source, params["protocol"]) if s.name == params["scope"])
    if params["kind"] == "neuron":
        return _neuron(params, scope, folder, seed)
    encoder = params["encoder"] if params["kind"] == "rule" else params["point"]["encoder"]
    encoding = encoded(folder, source, encoder)
    training = _training(scope, params["left_out"], params["train"], encoding, seed)
    rows = _tested(params, scope, encoding)
    if params["kind"] == "skim":
        return _skim(params, encoding, training, rows, seed)
    return _rule(params, encoding, training, rows)


def _tested(params: Mapping[str, Any], scope: Scope, encoding: Encoded) -> dict[str, list[Piece]]:
    """Return the rows that are tested, by group."""
    return {str(g): _rows(_pieces(scope.groups[g], encoding), params["source"]) for g in params["left_out"]}


def _pieces(parts: Sequence[Part], encoding: Encoded) -> list[Piece]:
    """Return the pieces, or stretches of them, that parts stand for."""
    pieces = list(encoding.pieces.values())
    return [
        pieces[n] if np.isinf(stop) else pieces[n].between(float(to_ms(start)), float(to_ms(stop)))
        for n, start, stop in parts
    ]


def _training(
    scope: Scope, left_out: Sequence[int], size: Mapping[str, int], encoding: Encoded, seed: int
) -> list[Piece]:
    """Return the training pieces, cut down to so many seconds a piece or footfalls a person."""
    pieces = _pieces([p for g, group in enumerate(scope.groups) if g not in left_out for p in group], encoding)
    if "seconds" in size:
        length = 1000.0 * size["seconds"]
        return [
            p.between(p.scored[0], min(p.scored[0] + length, p.scored[1])) for p in pieces if p.scored[1] > p.scored[0]
        ]
    rng = np.random.default_rng([seed, 1])
    order = [pieces[k] for k in rng.permutation(len(pieces))]
    counts: dict[str, int] = {}
    chosen = []
    for piece in order:
        counts[piece.person] = counts.get(piece.person, 0) + 1
        if counts[piece.person] <= size["count"]:
            chosen.append(piece)
    return chosen


def _rows(pieces: list[Piece], source: str) -> list[Piece]:
    """Return the rows that are tested: footfalls of a person joined to one row, recordings as they are."""
    if SOURCES[source].by_minute:
        return pieces
    units = dict.fromkeys(p.unit for p in pieces)
    return [joined([p for p in pieces if p.unit == unit], unit) for unit in units]


def _neuron(params: Mapping[str, Any], scope: Scope, folder: Path, seed: int) -> dict[str, Any]:
    """Train the neuron of the best point, and test it; the points of each encoder are one recipe."""
    encoders = {json.dumps(point["encoder"], sort_keys=True): point["encoder"] for point in params["points"]}
    tries = [
        _recipe(params, scope, folder, encoder, [p for p in params["points"] if p["encoder"] == encoder], seed)
        for encoder in encoders.values()
    ]
    return min(tries, key=lambda one: one[0])[1]


def _recipe(
    params: Mapping[str, Any], scope: Scope, folder: Path, encoder: dict[str, Any], points: list[Any], seed: int
) -> tuple[tuple[float, float], dict[str, Any]]:
    """Train and test the best of points with one encoder; return the rank that it has inside, and the result."""
    event = params["event"]
    encoding = encoded(folder, params["source"], encoder)
    rows = [(g, row) for g, group in _tested(params, scope, encoding).items() for row in group]
    pieces = [row for _, row in rows]

    def fold(left_out: Sequence[int], size: str, tested: Sequence[Piece]) -> Fold:
        """Add the pieces of a fold to the examples, and return it."""
        training = _patterns(params, _training(scope, left_out, params[size], encoding, seed), seed)
        first, last = len(pieces), len(pieces) + len(training)
        pieces.extend([*training, *tested])
        scored = [to_us(np.array(piece.scored)) for piece in tested]
        test = [Part(last + n, float(start), float(stop) + 1) for n, (start, stop) in enumerate(scored)]
        return Fold([Part(n) for n in range(first, last)], test)

    inner = [
        fold(
            sorted([*params["left_out"], *groups]),
            "search",
            [row for g in groups for row in _rows(_pieces(scope.groups[g], encoding), params["source"])],
        )
        for groups in params.get("inner", [])
    ]
    outer = fold(params["left_out"], "train", [row for _, row in rows])
    examples = [Example(p.spikes, {event: np.rint(to_us(p.truth[event])).astype(np.int64)}) for p in pieces]
    plans = [Recipe(Encoder.from_json(json.dumps(dict(encoder))), {}, {event: point["learner"]}) for point in points]
    chosen, inside = _best(plans, examples, inner) if inner else (plans[0], None)
    judged = judge(examples, chosen, [outer], window_ms=WINDOW_MS)
    learner = judged.trained[0].learners[event]
    assert isinstance(learner, ConeR)  # spike trains have no plain rule
    tested: dict[str, dict[str, Any]] = {g: {} for g, _ in rows}
    for (g, row), result in zip(rows, judged.scores, strict=True):
        tested[g][row.unit] = _plain(result, row)
    inside_figures = (
        {"missed": inside.missed, "false": inside.false, "rms_ms": _finite(inside.rank[1])} if inside else None
    )
    point = {"encoder": encoder, "learner": dict(chosen.neurons[event])}
    found = {"tested": tested, "fit": _fit_figures(learner, [pieces[n] for n, *_ in outer.train], event)}
    return inside.rank if inside else (0, 0.0), found | {"point": point, "inside": inside_figures}


def _best(plans: Sequence[Recipe], examples: Sequence[Example], folds: Sequence[Fold]) -> tuple[Recipe, Score]:
    """Return the recipe with the best rank in folds, and its score; of equal ones the first.

    One after the first that cannot be learnt, as where two labels are within its refractory time, is left out.
    """
    scored = [(plans[0], judge(examples, plans[0], folds, window_ms=WINDOW_MS).together)]
    for plan in plans[1:]:
        with suppress(ProblemError):
            scored.append((plan, judge(examples, plan, folds, window_ms=WINDOW_MS).together))
    return min(scored, key=lambda one: one[1].rank)


def _finite(value: float) -> float | None:
    return round(value, 3) if np.isfinite(value) else None


def _patterns(params: Mapping[str, Any], training: list[Piece], seed: int) -> list[Piece]:
    """Return the training rows: footfalls in one row, in random order; recordings as they are."""
    event, patterns = params["event"], training
    if not SOURCES[params["source"]].by_minute:
        rng = np.random.default_rng([seed, 2])
        patterns = [joined([training[k] for k in rng.permutation(len(training))])]
    patterns = [p for p in patterns if len(p.truth[event]) and len(p.spikes.times)]
    if not patterns:
        raise ProblemError(f"{params['source']}, {event}: no event with a spike in what should train")
    return patterns


def _skim(
    params: Mapping[str, Any], data: Encoded, training: list[Piece], rows: dict[str, list[Piece]], seed: int
) -> dict[str, Any]:
    """Train SKIM as 6.5.4 does: the neuron's kernel, and every threshold tested."""
    point, event = params["point"], params["event"]
    later = data.latency_ms + point["learner"]["delay_ms"]
    patterns = _patterns(params, training, seed)
    neuron = {name: point["learner"][name] for name in ("tau", "step_ms")}
    skim = SKIM(**neuron, within_ms=WINDOW_MS, **params["skim"])
    skim.fit([p.spikes for p in patterns], [p.truth[event] + later for p in patterns])
    tested = {
        f"{threshold:g}": {
            g: {p.unit: _scored(skim.predict([p.spikes], threshold=threshold)[0], p, event, later) for p in pieces}
            for g, pieces in rows.items()
        }
        for threshold in skim.thresholds
    }
    return {"by_threshold": tested, "fit": {"rows": skim.rows_, "residual": round(skim.residual_, 3)}}


def _fit_figures(cone: ConeR, patterns: list[Piece], event: str) -> dict[str, Any]:
    return {
        "targets": int(sum(len(p.truth[event]) for p in patterns)),
        "seconds_of_walking": round(sum(p.duration for p in patterns) / 1000, 1),
        "inputs": len(cone.weights_),
        "silent_rows": cone.silent_rows_,
        "rounds": cone.rounds_,
        "rows": cone.rows_,
        "status": cone.status_,
        "gap": float(f"{cone.gap_:.2g}"),
        "unreachable": len(cone.unreachable_),
    }


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
        "minutes": round((piece.scored[1] - piece.scored[0]) / 60_000, 4),
        "errors": [round(float(e), 1) for e in result.errors_ms],
        "delays": [round(float(d), 1) for d in result.delays_ms],
    }


def _rule(
    params: Mapping[str, Any], data: Encoded, training: list[Piece], rows: dict[str, list[Piece]]
) -> dict[str, Any]:
    """Choose a rule's numbers and offset on the training pieces, by missed + false first, then by error."""
    event, rule, source = params["event"], params["rule"], SOURCES[params["source"]]
    options: dict[str, Any] = {
        "levels": data.levels,
        "channels": {"heel_off": insole.HEEL}.get(event) if source.name == "plate" else None,
        "sum_name": source.sums.get(event, ""),
        "dead_ms": DEAD_MS,
    }
    first = training[0]
    largest = (
        max((float(p.sums[options["sum_name"]][1].max()) for p in training), default=0.0) if rule != "count" else 0.0
    )
    channels = len(first.spikes) // 2 // data.levels if options["channels"] is None else len(options["channels"])
    best: tuple[tuple[float, float], dict[str, Any], float] | None = None
    learned = _rows(training, source.name)
    for numbers in rules.grid(rule, data.levels, channels, largest):
        times = [rules.detection_times(rule, numbers, p, event, **options) for p in learned]
        offset = _offset(times, learned, event)
        scored = [_scored(t, p, event, offset) for t, p in zip(times, learned, strict=True)]
        wrong = sum(f["events"] - len(f["errors"]) + f["false"] for f in scored)
        errors = np.concatenate([np.empty(0), *(f["errors"] for f in scored)])
        quality = (float(wrong), float(np.sqrt(np.mean(errors**2))) if len(errors) else np.inf)
        if best is None or quality < best[0]:
            best = (quality, numbers, offset)
    assert best is not None
    _, numbers, offset = best
    tested = {
        g: {
            p.unit: _scored(rules.detection_times(rule, numbers, p, event, **options), p, event, offset) for p in pieces
        }
        for g, pieces in rows.items()
    }
    return {"tested": tested, "fit": numbers | {"offset_ms": round(offset, 2)}}


def _offset(times: list[NDArray[np.float64]], pieces: list[Piece], event: str) -> float:
    """Return the median distance from each reference event to the nearest detection within 0.15 s."""
    near = []
    for detected, piece in zip(times, pieces, strict=True):
        truth = piece.truth[event]
        if len(detected) and len(truth):
            k = (
                np.clip(np.searchsorted(detected, truth), 1, len(detected) - 1)
                if len(detected) > 1
                else np.zeros(len(truth), int)
            )
            left = detected[np.maximum(k - 1, 0)] - truth
            right = detected[k] - truth
            near.append(np.where(np.abs(left) < np.abs(right), left, right))
    distances = np.concatenate([np.empty(0), *near])
    distances = distances[np.abs(distances) <= 150]
    return float(np.median(distances)) if len(distances) else 0.0
