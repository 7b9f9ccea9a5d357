"""Matrices: each entry is its function's value, whatever the threads and the order."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import pattern, poisson

import taxel.metrics
from taxel import Array, SpikeTrains
from taxel.metrics import pairwise

ARRAY = Array(2, 3, pitch_mm=1.0)
METRICS = {
    "victor_purpura": {"q": 0.05},
    "van_rossum": {"tau": 20.0},
    "van_rossum_spatial": {"array": ARRAY, "tau": 5.0},
}


def several(seed, count, spikes=5.0):
    random = np.random.default_rng(seed)
    return [pattern(random, 6, spikes) for _ in range(count)]


@pytest.mark.parametrize("metric", METRICS)
def test_threads_change_no_bit(metric):
    a = several(3, 9)
    one = pairwise(metric, a, threads=1, **METRICS[metric])
    for threads in (2, 5, None):
        assert np.array_equal(pairwise(metric, a, threads=threads, **METRICS[metric]), one)


@pytest.mark.parametrize("tau", [0.05, 0.4, 20.0, 5000.0])
def test_a_matrix_of_van_rossum_gives_the_value_of_one_pair(tau):
    """Trains of many spikes and of none, of other lengths, long beside tau, equal ones, near ones, with ties."""
    random = np.random.default_rng(23)
    trains = [t for spikes in (0.3, 5, 60) for t in poisson(random, 8, spikes, stop=700.0)]
    trains += [trains[12], trains[20] + 1e-9, np.round(trains[21]), np.round(trains[22]), np.array([0.0, 512.0 * 0.4])]
    found = pairwise("van_rossum", trains, tau=tau)
    expected = [[taxel.metrics.van_rossum(x, y, tau=tau) for y in trains] for x in trains]
    assert np.allclose(found, expected, rtol=1e-9, atol=0)
    assert found[12, 24] == 0
    across = pairwise("van_rossum", trains[:7], trains[5:], tau=tau)
    assert np.allclose(across, np.asarray(expected)[:7, 5:], rtol=1e-9, atol=0)


def test_trains_may_stand_alone_in_lists_or_in_spike_trains():
    lists = poisson(np.random.default_rng(0), 5, 12)
    together = SpikeTrains.from_lists(lists, 0.0, 1000.0)
    alone = [SpikeTrains.from_lists([t], 0.0, 1000.0) for t in lists]
    for metric in ("victor_purpura", "van_rossum"):
        parameters = METRICS[metric]
        expected = pairwise(metric, lists, **parameters)
        assert np.array_equal(pairwise(metric, together, **parameters), expected)
        assert np.array_equal(pairwise(metric, alone, **parameters), expected)
    assert pairwise("van_rossum", [], tau=1.0).shape == (0, 0)
    assert pairwise("van_rossum", lists, [], tau=1.0).shape == (5, 0)
    assert pairwise("van_rossum", [SpikeTrains.from_lists([])] * 2, tau=1.0).tolist() == [[0, 0], [0, 0]]


def test_progress_ends_at_all_pairs_and_may_raise():
    heard = []
    pairwise("van_rossum", several(1, 20), tau=1.0, threads=1, progress=lambda done, every: heard.append((done, every)))
    assert heard[-1] == (190, 190)
    assert heard == sorted(heard)

    def refuse(*_):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        pairwise("van_rossum", several(1, 20), tau=1.0, progress=refuse)
