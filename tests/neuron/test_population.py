"""Many neurons: each one's own spikes, one train a neuron, and an error for nonsense."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import Neuron, SpikeTrains


@pytest.mark.parametrize("time", ["grid", "continuous"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_each_neuron_fires_as_it_does_by_itself(time: str, dtype: type) -> None:
    rng = np.random.default_rng(3)
    trains = SpikeTrains.from_lists([np.sort(rng.uniform(-5, 500.0, 10)) for _ in range(100)], -5.0, 500.0)
    weights = rng.normal(0.02, 0.1, (40, 100)).astype(dtype)
    neuron = Neuron(time=time)
    many = neuron.run_many(weights, trains, threshold=0.9)
    assert (len(many), many.start, many.stop) == (40, trains.start, trains.stop)
    assert (many.counts > 0).sum() > 20
    for row, fired in zip(weights, many, strict=True):
        assert np.array_equal(fired, neuron.run(row, trains, threshold=0.9))
