"""Matrices: each entry is its function's value, whatever the threads, the instructions and the order."""

from __future__ import annotations

import _thread
import threading
import time

import numpy as np
import pytest
from drawing import pattern, poisson

import taxel.metrics
from taxel import Array, ProblemError, SpikeTrains
from taxel.metrics import pairwise

ARRAY = Array(2, 3, pitch_mm=1.0)
WINDOW = (0.0, 1000.0)
METRICS = {
    "victor_purpura": {"q": 0.05},
    "victor_purpura_multi_unit": {"q": 0.05, "k": 0.5},
    "van_rossum": {"tau": 20.0},
    "van_rossum_absolute": {"tau": 20.0},
    "van_rossum_spatial": {"array": ARRAY, "tau": 5.0},
    "van_rossum_spatial_absolute": {"array": ARRAY, "tau": 5.0},
    "isi_distance": {"window": WINDOW},
    "spike_distance": {"window": WINDOW},
}


def several(seed, count, spikes=5.0):
    random = np.random.default_rng(seed)
    return [pattern(random, 6, spikes) for _ in range(count)]


@pytest.mark.parametrize("metric", METRICS)
def test_each_entry_is_what_the_function_gives(metric):
    a, b = several(1, 7), several(2, 4)
    function, parameters = getattr(taxel.metrics, metric), METRICS[metric]
    across, among = pairwise(metric, a, b, **parameters), pairwise(metric, a, **parameters)
    assert across.shape == (7, 4)
    assert np.allclose(across, [[function(x, y, **parameters) for y in b] for x in a], rtol=1e-9, atol=1e-12)
    assert np.allclose(among, [[function(x, y, **parameters) for y in a] for x in a], rtol=1e-9, atol=1e-12)
    assert np.array_equal(among, among.T)
    assert not among.diagonal().any()


@pytest.mark.parametrize("metric", METRICS)
def test_threads_change_no_bit(metric):
    a = several(3, 9)
    one = pairwise(metric, a, threads=1, **METRICS[metric])
    for threads in (2, 5, None):
        assert np.array_equal(pairwise(metric, a, threads=threads, **METRICS[metric]), one)


def test_trains_may_stand_alone_in_lists_or_in_spike_trains():
    lists = poisson(np.random.default_rng(0), 5, 12)
    together = SpikeTrains.from_lists(lists, 0.0, 1000.0)
    alone = [SpikeTrains.from_lists([t], 0.0, 1000.0) for t in lists]
    for metric in ("victor_purpura", "van_rossum", "isi_distance"):
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


def test_ctrl_c_ends_a_long_matrix_at_once():
    long = [np.sort(np.random.default_rng(n).uniform(0, 1e4, 10_000)) for n in range(40)]
    pressed = []

    def press():
        time.sleep(0.3)
        pressed.append(time.perf_counter())
        _thread.interrupt_main()

    threading.Thread(target=press).start()
    with pytest.raises(KeyboardInterrupt):
        pairwise("victor_purpura", long, long, q=1e-4)
    assert time.perf_counter() - pressed[0] < 5


def test_arguments_that_make_no_sense_are_one_clear_error_each():
    trains = [[1.0], [2.0]]
    for call, said in (
        (lambda: pairwise("spike_sync", trains), "metric is 'spike_sync': must be one of 'victor_purpura'"),
        (lambda: pairwise("van_rossum", trains, q=1.0), "q: van_rossum takes normalisation, tau"),
        (lambda: pairwise("van_rossum", trains), "metric: missing field `tau`"),
        (lambda: pairwise("van_rossum", [[1.0], [2.0, 1.0]], tau=1.0), r"train a\[1\], spike 1: 1 ms comes after 2 ms"),
        (lambda: pairwise("van_rossum", trains, [[np.inf]], tau=1.0), r"train b\[0\], spike 0: time is inf"),
        (lambda: pairwise("van_rossum", trains, threads=0, tau=1.0), "threads is 0: must be a whole number from 1"),
        (
            lambda: pairwise("van_rossum", [*several(1, 1), [1.0]], tau=1.0),
            r"a\[1\] is \[1.0\]: must be a taxel.SpikeT",
        ),
        (
            lambda: pairwise("van_rossum", [SpikeTrains.from_lists([[]] * n) for n in (2, 3)], tau=1.0),
            r"a\[1\] has 3 trains, a\[0\] has 2: must be equally many",
        ),
        (lambda: pairwise("van_rossum", several(1, 2), trains, tau=1.0), "a has 6 trains, b has 1: must be equally"),
        (
            lambda: pairwise("van_rossum_spatial", several(1, 2), array=Array(2, 2)),
            "a has 6 trains, the array 4 taxels",
        ),
    ):
        with pytest.raises(ProblemError, match=said):
            call()
