"""Targets with an inhibitory input at them or just behind: rounding leaves no potential below the threshold there."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from exact import excess, reaches
from sklearn.base import clone
from test_solved_simulated import LAMBDAS, drawn_neuron

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_gap, check_solution

#: Further problems are tried by `pytest -m slow`.
QUICK, ALL = 60, 2500


def beside(seed):
    """Graded patterns with inputs at targets and up to 1e-8 ms behind them."""
    random = np.random.default_rng([61, seed])
    trains, lists, wanted = int(random.integers(8, 60)), [], []
    decades = float(random.choice([0.5, 1.0, 3.0, 6.0]))
    for _ in range(int(random.integers(1, 4))):
        own = np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        stop = float(own[-1]) + 20
        times = [list(random.uniform(0, stop - 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 7), replace=False):
            times[n].append(float(random.choice(own)) + float(random.choice([0.0, 1e-12, 1e-10, 1e-9, 1e-8])))
        values = [random.choice([-1, 1], len(one)) * 10 ** random.uniform(-decades, decades, len(one)) for one in times]
        times = [np.sort(one) for one in times]
        lists.append(SpikeTrains.from_lists(times, stop=stop, values=values, kind="graded"))
        wanted.append(own.tolist())
    bound = float(random.choice([0.3, 2.0, 100.0]))
    neuron, lambdas = drawn_neuron(random), LAMBDAS[random.integers(4)]
    return ConeX(neuron=neuron, lambdas=lambdas, lb=-bound, ub=bound), lists, wanted


def turned_down(cone, patterns, targets):
    """The targets, as pattern and number, at which an inhibitory input lies, or up to 1e-8 ms behind."""
    found = []
    for p, (pattern, own) in enumerate(zip(patterns, targets, strict=True)):
        effects = np.repeat(cone.weights_, pattern.counts) * pattern.values
        for k, t in enumerate(own):
            if (effects[(pattern.times >= t) & (pattern.times <= t + 1e-8)] < 0).any():
                found.append((p, k))
    return found


def fitted(seed, **options):
    cone, patterns, targets = beside(seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cone.set_params(**options).fit(patterns, targets), patterns, targets


def judged(seeds):
    """Fit; hold every such target against the exact potential; return their number."""
    there = 0
    for seed in seeds:
        cone, patterns, targets = fitted(seed)
        if cone.status_ not in ("solved", "feasible"):
            continue
        for p, k in turned_down(cone, patterns, targets):
            pattern, own = patterns[p], targets[p]
            assert reaches(cone.neuron_, cone.weights_, pattern, own, k), f"seed {seed}, pattern {p}, target {k}"
            early = excess(cone.neuron_, cone.weights_, pattern, own[k] - 1e-6, own[:k])
            assert early < 0, f"seed {seed}, pattern {p}, target {k}: {early} mV, 1e-6 ms before"
            there += 1
    return there


def test_the_exact_potential_reaches_the_threshold_where_an_inhibitory_input_lies_at_the_target():
    assert judged(range(QUICK)) > QUICK / 2


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_exact_potential_reaches_the_threshold_in_thousands_of_problems():
    assert judged(range(QUICK, ALL)) > ALL / 2


def test_the_verdict_the_rows_and_their_checks_know_nothing_of_it():
    """The problem states the threshold itself, and the weights meet it to rounding."""
    seen = set()
    for seed in range(20):
        cone, patterns, targets = fitted(seed)
        if cone.status_ != "solved" or not turned_down(cone, patterns, targets):
            continue
        seen.add(cone.lambdas)
        for p, own in enumerate(targets):
            for k in range(len(own)):
                coefficients, threshold = cone.problem_.target(p, k)
                size = np.abs(coefficients) @ np.abs(cone.weights_)
                if max(abs(patterns[p].values)) < 20:
                    assert abs(coefficients @ cone.weights_ - threshold) <= 1e-12 + 1e-13 * size
        assert ((cone.weights_ >= cone.lb) & (cone.weights_ <= cone.ub)).all()
        assert check_solution(cone, patterns, targets), f"seed {seed}"
        # B alone is solved where nearly nothing of it is left, whatever share of that the gap is.
        if cone.lambdas[2] == 0:
            assert check_gap(cone, patterns, targets) <= cone.tolerance + 1e-9
        assert min(cone.margin_) >= 0.499 * min(cone.problem_.margin)
    assert len(seen) > 2


def test_weights_that_l1_makes_0_remain_0():
    zeros = 0
    for seed in range(40):
        cone, patterns, targets = fitted(seed, lambdas=(1, 0, 0))
        if cone.status_ == "solved" and turned_down(cone, patterns, targets):
            assert not (abs(cone.weights_[cone.weights_ != 0]) < 1e-13 * abs(cone.weights_).max()).any(), f"seed {seed}"
            zeros += int((cone.weights_ == 0).sum())
    assert zeros > 100


@pytest.mark.parametrize("factor", [2.0**-40, 2.0**20])
def test_another_unit_of_potentials_gives_the_same_bits(factor):
    for seed in range(10):
        cone, _, _ = fitted(seed)
        plain = cone.neuron_
        neuron = clone(plain).set_params(theta_0=factor * plain.theta_0, theta_plus=factor * plain.theta_plus)
        other, _, _ = fitted(seed, neuron=neuron, lb=factor * cone.lb, ub=factor * cone.ub)
        assert np.array_equal(other.weights_, factor * cone.weights_, equal_nan=True), f"seed {seed}"


def beside_one_that_cannot_be_raised(seed, count):
    """A pattern of targets with inhibitory inputs, and one whose only excitatory input has its largest weight."""
    random = np.random.default_rng([62, seed])
    trains = 8 * count
    own = 60.0 + 40 * np.arange(count) + random.uniform(0, 3, count)
    stop = float(own[-1]) + 20
    times = [list(random.uniform(0, stop, max(1, int(stop / 30)))) for _ in range(trains)]
    for t in own:
        for n in random.choice(trains, 3, replace=False):
            times[n].append(float(t))
    values = [random.choice([-1, 1], len(one)) * random.uniform(0.3, 3, len(one)) for one in times]
    many = [[], [], *map(np.sort, times)]
    first = SpikeTrains.from_lists(many, stop=stop, values=[[], [], *values], kind="graded")
    alone = [[10.0], [15.0], *[[]] * trains]
    second = SpikeTrains.from_lists(alone, stop=60.0, values=[[1.0], [-1.0], *[[]] * trains], kind="graded")
    kernel = 0.5 * np.exp(-0.5)
    largest = 0.3 / kernel
    while largest * kernel < 0.3:
        largest = np.nextafter(largest, 9)
    lower, upper = np.full(trains + 2, -1.0), np.full(trains + 2, 1.0)
    upper[0], lower[1] = largest, 0.5
    neuron = Neuron(tau=10.0, theta_plus=0.2, refractory=3.0)
    cone = ConeX(neuron=neuron, lambdas=(0, 1, 0), lb=lower, ub=upper, margin=1e-6)
    return cone, [first, second], [own.tolist(), [15.0]]


@pytest.mark.parametrize("count", [2, 5, 12])
def test_one_row_that_cannot_be_raised_leaves_none_of_the_others(count):
    there = 0
    for seed in range(4):
        cone, patterns, targets = beside_one_that_cannot_be_raised(seed, count)
        cone.fit(patterns, targets)
        if cone.status_ != "solved":
            continue
        turned = turned_down(cone, patterns, targets)
        assert (1, 0) in turned
        for k in (k for p, k in turned if p == 0):
            there += 1
            assert reaches(cone.neuron_, cone.weights_, patterns[0], targets[0], k), f"seed {seed}, target {k}"
        assert check_solution(cone, patterns, targets), f"seed {seed}"
    assert there > count
