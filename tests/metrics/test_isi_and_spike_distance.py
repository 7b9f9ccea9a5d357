"""ISI and SPIKE distances: PySpike's values, edges included, and what is true of them."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import STOP, times
from hypothesis import example, given
from refusal import refused

from taxel import SpikeTrains
from taxel.metrics import isi_distance, spike_distance

WINDOW = (0.0, STOP)


def pyspike_of(a, b, name):
    pyspike = pytest.importorskip("pyspike")
    return getattr(pyspike, name)(*(pyspike.SpikeTrain(t, WINDOW) for t in (a, b)))


@given(a=times, b=times)
@example([], [])
@example([0.0], [])
@example([0.0], [10.0])
@example([0.0, 0.0], [STOP])
@example([0.0, STOP], [7.0])
@example([250.0], [250.0, 250.0])
@example([3.0, 9.0], [0.0])
def test_pyspike_has_the_same_values(a, b):
    for mine, name in ((isi_distance, "isi_distance"), (spike_distance, "spike_distance")):
        with np.errstate(all="ignore"):
            theirs = pyspike_of(a, b, name)
        if np.isnan(theirs):  # lone spikes at the window's end: an interval of no length over one of no length
            assert a[-1:] == b[-1:] == [STOP]
        else:
            assert mine(a, b, window=WINDOW) == pytest.approx(theirs, abs=1e-9)


def test_lone_spikes_at_the_windows_end_differ_in_nothing_where_pyspike_has_nan():
    for metric in (isi_distance, spike_distance):
        assert metric([STOP], [STOP], window=WINDOW) == 0
        assert metric([], [], window=(5.0, 5.0)) == 0


@given(a=times, b=times, c=times)
def test_what_is_true_of_a_metric_but_for_spikes_triangle(a, b, c):
    for metric in (isi_distance, spike_distance):
        ab = metric(a, b, window=WINDOW)
        assert metric(a, a, window=WINDOW) == 0
        assert metric(b, a, window=WINDOW) == pytest.approx(ab, abs=1e-12)
        assert 0 <= ab <= 1 + 1e-12
    ab, bc, ac = (isi_distance(x, y, window=WINDOW) for x, y in ((a, b), (b, c), (a, c)))
    assert ac <= ab + bc + 1e-9


def test_patterns_use_their_widest_window_and_add_up_over_trains():
    a = SpikeTrains.from_lists([[1.0, 5.0], [3.0]], 0.0, 10.0)
    b = SpikeTrains.from_lists([[2.0, 7.0], []], -5.0, 8.0)
    for metric in (isi_distance, spike_distance):
        trains = [metric(x, y, window=(-5.0, 10.0)) for x, y in zip(a, b, strict=True)]
        assert metric(a, b) == pytest.approx(sum(trains))
        assert metric(a, b, window=(-5.0, 20.0)) != metric(a, b)


def test_windows_that_make_no_sense_are_one_clear_error_each():
    for a, window, argument in (
        ([1.0], None, "window"),
        ([1.0], (2.0, 5.0), None),
        ([1.0], (5.0, 2.0), "window"),
    ):
        for metric in (isi_distance, spike_distance):
            with refused(argument=argument):
                metric(a, [3.0], window=window)
