"""`check_gap` against the least objective that a cone solver finds: what it proves holds, whatever the multipliers."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
import pytest
import stated
from draws import seeds
from making import made
from refusal import refused
from relaxed import drawn, sizes
from stated import grid_rows, shares, terms
from stated import least as least_of

from taxel import NotFittedError, ProblemError, SpikeTrains
from taxel.learn import ConeR, ConeX, OnlineConeR, Row, check_gap

pytest.importorskip("clarabel")
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

#: How far, relative to the objective, the checked gap of a fit may be above its `gap_`.
ROUNDING = 1e-8


def with_others(cone, weights=None, **proof):
    """The fit with other weights, or with a proof that differs."""
    other = copy.copy(cone)
    other.weights_ = cone.weights_ if weights is None else weights
    other.multipliers_ = replace(cone.multipliers_, **proof)
    return other


def spoilt(random, proof):
    """What may be wrong with a proof."""
    rows, values, pull = proof.rows, proof.values, proof.pull
    n = len(values)
    yield {"values": random.uniform(0, 3) * values}
    yield {"values": values + random.normal(0, 0.1, n) * np.abs(values).max(initial=0.0)}
    yield {"values": -values}
    yield {"values": random.permutation(values)}
    yield {"values": 1e9 * random.normal(0, 1, n)}
    yield {"rows": rows + rows, "values": np.append(values, values)}
    yield {"pull": random.normal(0, 1, len(pull)) * np.linalg.norm(pull)}
    yield {"pull": 3 * pull}
    yield {"rows": [], "values": np.zeros(0), "pull": 0 * pull}
    if n:
        keep = np.arange(n) != random.integers(n)
        yield {"rows": [row for row, kept in zip(rows, keep, strict=True) if kept], "values": values[keep]}


@pytest.mark.parametrize("part", seeds(8, quick=1))
def test_what_is_proven_holds_whatever_the_multipliers_and_the_weights(part):
    closed = 0
    for seed in range(12 * part, 12 * part + 12):
        cone, patterns, targets, silence = drawn(seed)
        random, trains = np.random.default_rng([78, seed]), len(patterns[0])
        rows = grid_rows(cone, patterns, targets, silence)
        factors = shares(cone, sizes(cone, patterns, targets, silence, rows))

        def objective(weights, cone=cone, rows=rows, factors=factors):
            return factors @ terms(cone, rows, weights)

        least = min(least_of(cone, rows, factors), cone.objective_)
        at_zero = objective(np.clip(np.zeros(trains), cone.lb, cone.ub))
        # An objective this far below that of zero weights counts as 0; one near that holds more of its terms' rounding.
        least += 1e-10 * at_zero + 1e-12 * least
        rounding = ROUNDING + (1e-13 * at_zero / cone.objective_ if cone.objective_ > 0 else 0.0)

        def proven(other, patterns=patterns, targets=targets, silence=silence, objective=objective):
            gap = check_gap(other, patterns, targets, silence=silence)
            return objective(other.weights_) * (1 - gap), gap

        bound, gap = proven(cone)
        # The fit's bound is over weights that its best objective allows, before rounding made that larger.
        assert gap <= 1.001 * cone.gap_ + rounding, f"seed {seed}: {gap} of {cone.gap_}"
        assert bound <= least, f"seed {seed}"
        closed += gap <= cone.tolerance + ROUNDING
        for number, wrong in enumerate(spoilt(random, cone.multipliers_)):
            assert proven(with_others(cone, **wrong))[0] <= least, f"seed {seed}, proof {number}"
        for scale in (0.0, 0.9, 1.0):
            off = scale * cone.weights_ + 0.1 * scale * random.normal(0, np.abs(cone.weights_).max(), trains)
            bound, gap = proven(with_others(cone, np.clip(off, cone.lb, cone.ub)))
            assert bound <= least, f"seed {seed}, weights {scale}"
    assert closed >= 9


def small(**options):
    """A fit with rows of all kinds, and its examples."""
    examples = stated.examples(4, first=20.0, whole_ms=True)
    cone = made(ConeR, tau=12.0, lambdas=(4, 2, 100, 100, 8), **options).fit(*examples)
    assert cone.status_ == "solved"
    return cone, examples


def gap_unless_refused(*arguments, **silence):
    """The checked gap; infinite where a multiplier belongs to a row that the problem does not have."""
    try:
        return check_gap(*arguments, **silence)
    except ProblemError:
        return np.inf


@pytest.mark.parametrize("options", [{}, {"norm": "square"}])
def test_every_multiplier_is_needed(options):
    cone, examples = small(**options)
    proof, gap = cone.multipliers_, check_gap(cone, *examples)
    assert gap <= cone.tolerance
    assert {row.kind for row in proof.rows} == {"silence", "target", "behind"}
    assert len(set(proof.rows)) == len(proof.rows)
    for k, row in enumerate(proof.rows):
        for wrong in (0.0, 0.9, -1.0):
            values = proof.values.copy()
            values[k] *= wrong
            assert check_gap(with_others(cone, values=values), *examples) > gap, row
    assert check_gap(with_others(cone, pull=0 * proof.pull), *examples) > gap + 1e-3
    # A multiplier of another silent point or of the other target proves less.
    gaps = []
    for k, row in enumerate(proof.rows):
        other = row._replace(at=row.at - 2 if row.kind == "silence" else 1 - row.at)
        rows = [*proof.rows[:k], other, *proof.rows[k + 1 :]]
        gaps.append(gap_unless_refused(with_others(cone, rows=rows), *examples))
    assert min(gaps) > gap
    assert np.isfinite(gaps).mean() > 0.8


def test_other_weights_other_examples_and_other_parameters_have_a_larger_gap():
    cone, (patterns, targets) = small()
    gap = check_gap(cone, patterns, targets)
    for train in np.flatnonzero(np.abs(cone.weights_) > 0.01):
        weights = cone.weights_.copy()
        weights[train] *= 0.9
        assert check_gap(with_others(cone, weights), patterns, targets) > gap + 1e-6
    assert check_gap(with_others(cone, cone.weights_ + 1), patterns, targets) == np.inf
    assert check_gap(with_others(cone, np.full(20, np.nan)), patterns, targets) == np.inf
    assert gap_unless_refused(cone, patterns, [t + 1 for t in targets]) > 1e-3
    assert gap_unless_refused(cone, patterns[::-1], targets[::-1]) > 1e-3
    shifted = [SpikeTrains(p.times + 1, p.offsets, p.start, p.stop + 1) for p in patterns]
    assert check_gap(cone, shifted, targets) > 1e-3
    assert check_gap(copy.copy(cone).set_params(kappa=1.3), patterns, targets) > 1e-4
    assert gap_unless_refused(cone, patterns, targets, silence=[[(0.0, 1.0)], None]) > 1e-3
    assert check_gap(cone, patterns, targets, silence=[[(0.0, 130.0)], None]) < gap + ROUNDING


def test_a_window_of_online_cone_r_is_checked_from_its_oldest_pattern_on():
    patterns, targets = stated.examples(6, trains=12, patterns=5, first=20.0)
    online = OnlineConeR(window=3, lb=-1.0, ub=1.0)
    for k in range(5):
        silence = [(0.0, 60.0)] if k == 3 else None
        online.partial_fit(patterns[k], targets[k], silence=silence)
        window = slice(max(0, k - 2), k + 1)
        asked = [[(0.0, 60.0)] if n == 3 else None for n in range(5)]
        gap = check_gap(online, patterns[window], targets[window], silence=asked[window])
        assert gap <= online.gap_ + ROUNDING, k


def test_what_cannot_be_checked_is_one_clear_error():
    cone, (patterns, targets) = small()
    with refused(NotFittedError):
        check_gap(ConeR(), patterns, targets)
    signed = SpikeTrains.from_lists([[5.0]] * 20, stop=60.0, values=[[-1.0]] * 20)
    for given in (
        (patterns[:1], targets),
        (patterns, targets[:1]),
        ([p.select([0, 1]) for p in patterns], targets),
        ([signed, signed], [[50.0], []]),
    ):
        with refused():
            check_gap(cone, *given)
    at_target = targets[0][0]
    for row in (
        ("silence", 0, at_target),
        ("silence", 9, 5.0),
        ("silence", 0, 5.25),
        ("slope", 0, 0),
        ("target", 0, 7),
    ):
        wrong = with_others(cone, rows=[Row(*row)], values=np.ones(1))
        with refused():
            check_gap(wrong, patterns, targets)


@pytest.mark.parametrize(("lambdas", "order"), [((1, 0, 0), 1), ((0, 1, 0), 2)])
def test_what_is_proven_of_a_cone_x_is_no_more_than_the_least_objective(lambdas, order):
    """Whatever the multipliers and the weights: the objective less the gap is not above the best one."""
    for seed in range(3):
        patterns, targets = stated.examples(seed, trains=40, patterns=3, targets=1)
        cone = ConeX(lambdas=lambdas, lb=-2.0, ub=2.0).fit(patterns, targets)
        assert cone.status_ == "solved"
        random, proof = np.random.default_rng(seed), cone.multipliers_
        others = [cone.weights_, ConeX(lambdas=(1, 1, 100), lb=-2.0, ub=2.0).fit(patterns, targets).weights_]
        proven = []
        for weights in others:
            length = np.linalg.norm(weights, order) / np.linalg.norm(cone.weights_, order)
            noise = [random.normal(0, 1, len(proof.values)) * np.abs(proof.values).max() for _ in range(4)]
            values = [proof.values + scale * one for one in noise for scale in (0.0, 1e-6, 1e-2, 1.0, 1e3)]
            for one in [*values, 0.5 * proof.values, -proof.values, 2 * proof.values]:
                gap = check_gap(with_others(cone, weights, values=one), patterns, targets)
                proven.append(length * (1 - gap))
                assert proven[-1] <= 1 + 1e-9
        assert max(proven) >= 1 - 1e-6
        assert min(proven) < 0.5


def test_of_a_fit_that_ended_early_the_gap_is_proven():
    patterns, targets = stated.examples(6, trains=120, patterns=20, targets=2, duration=200.0)
    cone = ConeX(lambdas=(1, 0, 0), lb=-1, ub=1, max_seconds=1e-9).fit(patterns, targets)
    assert cone.status_ == "stopped"
    assert check_gap(cone, patterns, targets) <= max(cone.gap_, 1e-6) * (1 + 1e-6)
    with refused(argument="silence"):
        check_gap(cone, patterns, targets, silence=[None] * 20)
