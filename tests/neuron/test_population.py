"""Many neurons at once: each one's own spikes, on a grid and in continuous time, and an error for nonsense."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel import Neuron, SpikeTrains

NEURONS = 70  # more than two blocks


@st.composite
def problems(draw: st.DrawFn) -> tuple[Neuron, np.ndarray, SpikeTrains, float]:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    inputs, length = draw(st.integers(1, 30)), draw(st.sampled_from([30.0, 200.0, 3000.0]))
    time = draw(st.sampled_from(["grid", "continuous"]))
    kernels = ["alpha", "double_exponential"] + ["exponential"] * (time == "grid")
    after_spike = draw(st.sampled_from(["keep", "ignore", "reset"]))
    neuron = Neuron(
        time=time,
        kernel=draw(st.sampled_from(kernels)),
        after_spike=after_spike,
        first_threshold=draw(st.sampled_from(["theta_0", "printed"])),
        tau=draw(st.sampled_from([2.0, 15.0, 80.0])),
        theta_plus=draw(st.sampled_from([0.0, 0.2])),
        refractory=draw(st.sampled_from([3.0, 0.7, 0.0] if after_spike == "reset" else [3.0, 0.7])),
        step_ms=draw(st.sampled_from([1.0, 0.3])),
        rearm=draw(st.sampled_from([None, 1.0, 0.3])) if time == "grid" else None,
    )
    lists = [np.sort(rng.uniform(-5.0, length, rng.poisson(length / 50))) for _ in range(inputs)]
    if draw(st.booleans()):  # on grid points, many at a time
        lists = [np.clip(np.round(times), -5.0, length) for times in lists]
    trains = SpikeTrains.from_lists(lists, -5.0, length)
    weights = rng.normal(draw(st.sampled_from([0.0, 0.3])), 0.8, (NEURONS, inputs))
    return neuron, weights, trains, draw(st.sampled_from([1.0, 0.6]))


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(problems())
def test_each_neuron_fires_as_it_does_by_itself(problem: tuple[Neuron, np.ndarray, SpikeTrains, float]) -> None:
    neuron, weights, trains, threshold = problem
    many = neuron.run_many(weights, trains, threshold=threshold)
    assert (len(many), many.start, many.stop) == (NEURONS, trains.start, trains.stop)
    for row, fired in zip(weights, many, strict=True):
        alone = neuron.run(row, trains, threshold=threshold)
        assert len(fired) == len(alone)
        # On a grid both count points; in continuous time the roots agree to rounding.
        assert np.abs(fired - alone).max(initial=0.0) <= (0.0 if neuron.time == "grid" else 1e-9)


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_something_fires_in_what_is_compared(time: str) -> None:
    rng = np.random.default_rng(3)
    trains = SpikeTrains.from_lists([np.sort(rng.uniform(0, 1000.0, 20)) for _ in range(100)], stop=1000.0)
    many = Neuron(time=time).run_many(rng.normal(0.02, 0.1, (64, 100)), trains)
    assert 1000 < len(many.times) < 20_000
    assert (many.counts > 0).sum() > 50


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_single_precision_is_read_as_it_stands(time: str) -> None:
    rng = np.random.default_rng(4)
    trains = SpikeTrains.from_lists([np.sort(rng.uniform(0, 500.0, 10)) for _ in range(50)], stop=500.0)
    weights = rng.normal(0.05, 0.1, (40, 50)).astype(np.float32)
    neuron = Neuron(time=time)
    assert neuron.run_many(weights, trains) == neuron.run_many(weights.astype(np.float64), trains)
    assert neuron.run_many(np.asfortranarray(weights), trains) == neuron.run_many(weights, trains)


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_a_trained_touch_counts_in_a_population_too(time: str) -> None:
    # The weight raises the maximum, at tau, exactly to the threshold, as a learner's equality does.
    neuron = Neuron(tau=10.0, time=time, theta_0=0.3)
    trains = SpikeTrains.from_lists([[0.0]], stop=50.0)
    many = neuron.run_many([[0.3 * np.e], [0.299 * np.e]], trains)
    assert np.allclose(many[0], neuron.run([0.3 * np.e], trains), rtol=0, atol=1e-6)
    assert [len(t) for t in many] == [1, 0]


def test_a_touch_at_an_input_that_turns_the_potential_down_counts_too() -> None:
    neuron = Neuron(tau=10.0, theta_0=0.3, after_spike="reset")
    trains = SpikeTrains.from_lists([[0.0], [9.9]], stop=50.0)
    slope = 9.9 / 10.0 * np.exp(-0.99)
    weights = [[0.3 / slope * (1 + relative), -2.0] for relative in (-1e-13, 0.0, 1e-13, -1e-8)]
    many = neuron.run_many(weights, trains)
    for row, fired in zip(weights, many, strict=True):
        assert np.array_equal(fired, neuron.run(row, trains))
    assert [len(fired) for fired in many] == [1, 1, 1, 0]


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_nothing_gives_nothing(time: str) -> None:
    neuron = Neuron(time=time)
    nothing = SpikeTrains.from_lists([[], []], stop=100.0)
    assert neuron.run_many(np.ones((3, 2)), nothing).counts.tolist() == [0, 0, 0]
    assert len(neuron.run_many(np.ones((0, 2)), nothing)) == 0
    assert len(neuron.run_many(np.ones((5, 0)), SpikeTrains.from_lists([], stop=10.0))) == 5
    assert len(neuron.run_many(np.ones((1, 1)), SpikeTrains.from_lists([[0.0]], 0.0, 0.0)).times) == 0


TRAINS = SpikeTrains.from_lists([[1.0], [2.0]], stop=10.0)


@pytest.mark.parametrize(
    ("weights", "argument"),
    [
        ([1.0, 2.0], "weights"),
        ([[1.0, 2.0, 3.0]], "weights"),
        ([[1.0, 2.0]] * 40 + [[1.0, np.nan]], None),
        (np.array([[1.0, 2.0], [np.inf, 0.0]], np.float32), None),
        ([[1.0], [2.0, 3.0]], "weights"),
        (None, "weights"),
    ],
)
def test_weights_that_make_no_sense_are_one_error(weights: object, argument: str) -> None:
    for time in ("grid", "continuous"):
        with refused(argument=argument):
            Neuron(time=time).run_many(weights, TRAINS)


def test_other_arguments_that_make_no_sense_are_one_error() -> None:
    for threshold in (0.0, -1.0, float("nan"), "a"):
        with refused(argument="threshold"):
            Neuron().run_many([[1.0, 2.0]], TRAINS, threshold=threshold)
    with refused(argument="trains"):
        Neuron().run_many([[1.0]], SpikeTrains.from_lists([[1.0]], values=[[1.0]]))
    with refused(argument="trains"):
        Neuron().run_many([[1.0]], [[1.0]])
