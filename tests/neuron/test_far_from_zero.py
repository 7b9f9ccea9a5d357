"""A neuron on a grid far from time 0, where `start + k * step` is rounded by more than a potential may be off."""

from __future__ import annotations

import numpy as np
import pytest
from draws import mixed
from simulator import kernel

from taxel import Neuron, SpikeTrains


def touching(seed, start, step, after_spike="reset"):
    """A neuron whose weights bring its potential exactly to the threshold at a grid point, while it rises."""
    random = np.random.default_rng([41, seed])
    tau = float(random.uniform(8, 15))
    neuron = Neuron(tau=tau, time="grid", step_ms=step, after_spike=after_spike, refractory=100.0)
    inputs = int(random.integers(1, 5))
    first = int(random.integers(1, 30))
    points = first + random.uniform(0, 3 / step, inputs)
    if random.random() < 0.3:
        points = points.round()
    times = np.sort(start + points * step)
    k = int(np.ceil(points.max())) + int(random.integers(1, max(2, 3 / step)))
    trains = SpikeTrains.from_lists([[t] for t in times], start=start, stop=start + (k + 60) * step)
    at = start + k * step
    weights = random.uniform(0.2, 1.0, inputs)
    return neuron, trains, weights, at, k


@pytest.mark.parametrize(("start", "step"), mixed([0.0, -1e5, 1e5, 1e7], [0.1, 0.3, 1.0, 0.192]))
def test_a_potential_that_comes_up_to_the_threshold_fires_there(start, step):
    for seed in range(300):
        neuron, trains, weights, at, _ = touching(seed, start, step)
        once = neuron.potential(weights, trains, [at])[0]
        by_sum = weights @ kernel(neuron, at - np.array([t[0] for t in trains]))
        for reached in (once, by_sum):
            scaled = weights * (neuron.theta_0 / reached)
            assert neuron.potential(scaled, trains, [at])[0] == pytest.approx(neuron.theta_0, abs=1e-7)
            fired = neuron.run(scaled, trains)
            assert len(fired), f"seed {seed}"
            assert fired[0] == at, f"seed {seed}: fires at {fired[0]!r}, its potential is the threshold at {at!r}"


@pytest.mark.parametrize("start", [-1e5, 1e5, 1e7])
def test_potential_and_spikes_agree_at_every_point(start):
    for seed in range(60):
        neuron, trains, weights, at, k = touching(seed, start, 0.1)
        scaled = weights * (neuron.theta_0 / neuron.potential(weights, trains, [at])[0])
        points = start + np.arange(k + 60) * 0.1
        potential = neuron.potential(scaled, trains, points)
        slopes = np.gradient(potential, 0.1)
        below = potential < neuron.theta_0 - 1e-12 - 1e-8 * np.abs(slopes)
        fired = neuron.run(scaled, trains)
        assert not below[np.searchsorted(points, fired[0])]
        assert below[: np.searchsorted(points, fired[0])].all()


#: A potential of this draw crosses the threshold 1e-6 ms after a grid point. At 2^33 ms neighbouring times are 1.9e-6
#: ms apart, so that the crossing is at the point itself.
BELOW_RESOLUTION = 42


@pytest.mark.parametrize("start", [-1e5, 1e5, 2.0**23, 2.0**33])
def test_a_neuron_far_from_0_fires_as_one_at_0(start):
    """Times that are whole numbers of 2^-10 ms: shifted without rounding."""
    for seed in range(60):
        if start == 2.0**33 and seed == BELOW_RESOLUTION:
            continue
        random = np.random.default_rng([42, seed])
        lists = [np.sort(random.integers(0, 100 * 1024, random.integers(1, 9))) / 1024 for _ in range(30)]
        neuron = Neuron(tau=8.0, time="grid", step_ms=0.1, after_spike=str(random.choice(["keep", "ignore", "reset"])))
        weights = random.uniform(-0.2, 0.4, 30)
        here = neuron.run(weights, SpikeTrains.from_lists(lists, stop=120.0))
        there = neuron.run(weights, SpikeTrains.from_lists([start + t for t in lists], start=start, stop=start + 120.0))
        assert np.abs((there - start) - here).max(initial=0) <= 4 * np.spacing(abs(start)), f"seed {seed}"
