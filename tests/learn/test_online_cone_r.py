"""A sliding window of patterns against fits to the same window from nothing."""

from __future__ import annotations

from unittest.mock import ANY

import numpy as np
import pytest
from making import made
from refusal import refused

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, OnlineConeR

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def stream(seed, count, trains=20, duration=120.0):
    """Patterns with one or two targets, some with none."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        times = [np.sort(random.uniform(0, duration, random.integers(1, 4))) for _ in range(trains)]
        targets = np.sort(random.uniform(30, duration, random.choice([0, 1, 1, 2])))
        if len(targets) == 2 and targets[1] - targets[0] < 8:
            targets = targets[:1]
        yield SpikeTrains.from_lists(times, stop=duration + 10), targets


OPTIONS = [
    {},
    {"after_spike": "reset", "divide_b_by": "targets", "lambdas": (0, 4, 100, 100, 80)},
    {"after_spike": "reset", "form_b": "sum"},
    {"norm": "square", "after_spike": "ignore", "margin": 0.01},
    {"lambdas": (4, 0, 100, 100, 80), "lb": -0.1, "ub": 0.4, "kernel": "double_exponential"},
]


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("window", [1, 4, 7])
def test_at_each_step_the_objective_is_that_of_a_fit_to_the_window_from_nothing(options, window):
    online = made(OnlineConeR, window=window, tau=12.0, tolerance=3e-7, **options)
    kept = []
    for pattern, targets in stream(window, 12):
        online.partial_fit(pattern, targets)
        kept = [*kept, (pattern, targets)][-window:]
        assert online.patterns_ == len(kept)
        assert online.status_ == "solved"
        if any(len(t) for _, t in kept):
            cold = made(ConeR, tau=12.0, tolerance=3e-7, **options).fit([p for p, _ in kept], [t for _, t in kept])
            assert online.objective_ == pytest.approx(cold.objective_, rel=1e-6, abs=1e-12)
            assert online.silent_rows_ == cold.silent_rows_
            assert online.unreachable_ == cold.unreachable_


def test_a_fit_at_once_is_the_fit_of_the_last_patterns_and_the_stream_goes_on_from_it():
    patterns = list(stream(4, 8))
    once = OnlineConeR(neuron=Neuron(tau=12.0), window=5).fit(
        [p for p, _ in patterns[:7]], [t for _, t in patterns[:7]]
    )
    steps = OnlineConeR(neuron=Neuron(tau=12.0), window=5)
    for pattern, targets in patterns[:7]:
        steps.partial_fit(pattern, targets)
    assert once.objective_ == pytest.approx(steps.objective_, rel=2e-6)
    once.partial_fit(*patterns[7])
    steps.partial_fit(*patterns[7])
    assert once.objective_ == pytest.approx(steps.objective_, rel=2e-6)


def test_a_pattern_that_makes_no_sense_is_named_and_leaves_the_window_as_it_was():
    online, same = OnlineConeR(neuron=Neuron(tau=12.0), window=3), OnlineConeR(neuron=Neuron(tau=12.0), window=3)
    patterns = list(stream(5, 6))
    for pattern, targets in patterns:
        online.partial_fit(pattern, targets)
        same.partial_fit(pattern, targets)
        for bad, at in (
            (SpikeTrains.from_lists([[1.0]], stop=5.0), [2.0]),
            (pattern, [30.0, 31.0]),
            (pattern, [float("nan")]),
            (SpikeTrains.from_lists([[]] * 20, stop=5.0), [2.0]),
        ):
            with refused():
                online.partial_fit(bad, at)
    assert online.objective_ == same.objective_
    assert np.array_equal(online.weights_, same.weights_)


@pytest.mark.parametrize("learner", [ConeR(), OnlineConeR(window=2)])
def test_more_trains_than_memory_holds_are_refused_in_one_line(learner):
    many = SpikeTrains.from_lists([[1.0]] * 10_001, stop=20.0)
    with refused(argument=ANY):
        learner.fit([many], [[10.0]])
    few = SpikeTrains.from_lists([[1.0], [4.0]], stop=20.0)
    assert learner.fit([few], [[10.0]]).weights_.shape == (2,)
