"""Codes of a population: values written as spikes are read back as far as the code carries them, and no further."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import SpikeTrains
from taxel_studies.spike_codes import FirstSpikeLatency, RateCode, RelativeLatency, compare_codes

#: A difference larger than rounding errors, so that a comparison is reliable.
values = st.lists(st.integers(0, 1000), min_size=1, max_size=30).map(lambda v: np.array(v) / 1000)
windows = st.floats(0.1, 1e4)
onsets = st.floats(-1e4, 1e4)


def latencies(v, window, onset=0.0):
    """Write each value above 0 as one spike, the sooner the larger it is."""
    lists = [[onset + (1.0 - value) * window] if value > 0 else [] for value in v]
    return SpikeTrains.from_lists(lists, start=onset, stop=onset + window)


@given(values, windows, onsets)
def test_latencies_are_read_back_from_one_spike_a_train(v, window, onset):
    assert FirstSpikeLatency(window_ms=window).decode(latencies(v, window, onset), onset) == pytest.approx(
        v, abs=1e-9 * (1 + abs(onset) / window * 1e3)
    )


@given(values, windows)
def test_a_rate_is_read_back_to_within_half_a_spike(v, window):
    code = RateCode(window_ms=window, most_hz=50_000 / window)
    # Each spike lies in the middle of its share of the window, so none lies at the window's edges.
    lists = [(np.arange(n) + 0.5) * window / max(1, n) for n in np.rint(50 * v).astype(int)]
    assert np.abs(code.decode(SpikeTrains.from_lists(lists, start=0.0, stop=window), 0.0) - v).max() <= 0.5 / 50 + 1e-12


@given(values, windows, onsets, st.floats(0, 50))
def test_relative_codes_need_no_reference_and_latency_does(v, window, onset, late):
    relative = RelativeLatency(window_ms=window)
    trains = latencies(v, window, onset)
    assert relative.decode(trains, onset - late) == pytest.approx(relative.decode(trains, onset), abs=1e-12)
    if (v > 0).any():
        slip = 1e-9 * (1 + abs(onset) / window * 1e3)
        assert relative.decode(trains, onset)[v > 0] == pytest.approx((v + 1 - v.max())[v > 0], abs=slip)


def test_what_comes_before_the_reference_or_after_the_window_is_not_heard():
    trains = SpikeTrains.from_lists([[1.0, 12.0], [25.0], []], start=0.0, stop=30.0)
    assert FirstSpikeLatency(window_ms=10.0).decode(trains, 10.0).tolist() == [0.8, 0.0, 0.0]
    assert RateCode(window_ms=10.0, most_hz=100.0).decode(trains, 10.0).tolist() == [1.0, 0.0, 0.0]
    silent = SpikeTrains.from_lists([[], []], start=0.0, stop=5.0)
    for code in (RelativeLatency(window_ms=5.0), FirstSpikeLatency(window_ms=5.0)):
        assert code.decode(silent, 0.0).tolist() == [0.0, 0.0]


def trials(tell):
    """Return 80 trials of 6 trains and their labels; `tell` says a trial's spikes from its label and noise."""
    random = np.random.default_rng(3)
    labels = np.repeat([0, 1], 40)
    return [SpikeTrains.from_lists(tell(label, random), start=0.0, stop=50.0) for label in labels], labels


CODES = {
    "rate": RateCode(window_ms=50.0, most_hz=200.0),
    "first": FirstSpikeLatency(window_ms=50.0),
    "relative": RelativeLatency(window_ms=50.0),
}


def test_what_lies_in_the_order_alone_is_lost_to_a_rate():
    def order(label, random):
        times = np.sort(random.uniform(1, 40, 6))
        return [[t] for t in (times if label else times[::-1])]

    bits = {name: one.bits for name, one in compare_codes(*trials(order), CODES).items()}
    assert bits["relative"] > 0.9
    assert bits["rate"] < 0.1


def test_what_lies_in_the_counts_alone_is_lost_to_latencies():
    def count(label, random):
        first = random.uniform(1, 5, 6)
        return [[t, *np.linspace(20, 40, 3 + 3 * label)] for t in first]

    bits = {name: one.bits for name, one in compare_codes(*trials(count), CODES).items()}
    assert bits["rate"] > 0.9
    assert max(bits["first"], bits["relative"]) < 0.2


def test_what_lies_in_the_common_latency_alone_is_lost_without_a_reference():
    def late(label, random):
        return [[t] for t in 3.0 + 20.0 * label + random.uniform(0, 2, 6)]

    bits = {name: one.bits for name, one in compare_codes(*trials(late), CODES).items()}
    assert bits["first"] > 0.9
    assert bits["relative"] < 0.2
