"""Codes of a population: values written as spikes are read back as far as the code carries them, and no further."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel_studies.spike_codes import bits, firsts, latency, rate, relative_latency

#: A difference larger than rounding errors, so that a comparison is reliable.
values = st.lists(st.integers(0, 1000), min_size=1, max_size=30).map(lambda v: np.array(v) / 1000)
windows = st.floats(0.1, 1e4)


def spikes(v, window):
    """Write each value above 0 as one spike, the sooner the larger it is."""
    return [[(1.0 - value) * window] if value > 0 else [] for value in v]


@given(values, windows)
def test_latencies_are_read_back_from_one_spike_a_train(v, window):
    assert latency(firsts([spikes(v, window)]), window)[0] == pytest.approx(v, abs=1e-9)


@given(values, windows)
def test_a_rate_is_read_back_to_within_half_a_spike(v, window):
    # Each spike lies in the middle of its share of the window, so none lies at the window's edges.
    trial = [(np.arange(n) + 0.5) * window / max(1, n) for n in np.rint(50 * v).astype(int)]
    assert np.abs(rate([trial], window, 50_000 / window)[0] - v).max() <= 0.5 / 50 + 1e-12


@given(values, windows, st.floats(0, 50))
def test_relative_codes_need_no_reference(v, window, late):
    first = firsts([spikes(v, window)])
    assert relative_latency(first + late, window) == pytest.approx(relative_latency(first, window), abs=1e-6)
    if (v > 0).any():
        assert relative_latency(first, window)[0][v > 0] == pytest.approx((v + 1 - v.max())[v > 0], abs=1e-9)


def test_what_comes_after_the_window_is_not_heard():
    trial = [[2.0], [15.0], []]
    assert latency(firsts([trial]), 10.0).tolist() == [[0.8, 0.0, 0.0]]
    assert rate([trial], 10.0, 100.0).tolist() == [[1.0, 0.0, 0.0]]
    for code in (latency, relative_latency):
        assert code(firsts([[[], []]]), 5.0).tolist() == [[0.0, 0.0]]


def order(label, random):
    times = np.sort(random.uniform(1, 40, 6))
    return [[t] for t in (times if label else times[::-1])]


def count(label, random):
    return [[t, *np.linspace(20, 40, 3 + 3 * label)] for t in random.uniform(1, 5, 6)]


def late(label, random):
    return [[t] for t in 3.0 + 20.0 * label + random.uniform(0, 2, 6)]


@pytest.mark.parametrize(
    ("tell", "heard", "deaf"),
    [(order, ["relative"], ["rate"]), (count, ["rate"], ["first", "relative"]), (late, ["first"], ["relative"])],
    ids=["order", "count", "common latency"],
)
def test_what_lies_in_one_property_of_the_spikes_is_lost_to_a_code_without_it(tell, heard, deaf):
    random, labels = np.random.default_rng(3), np.repeat([0, 1], 40)
    trials = [tell(label, random) for label in labels]
    first = firsts(trials)
    codes = {
        "rate": rate(trials, 50.0, 200.0),
        "first": latency(first, 50.0),
        "relative": relative_latency(first, 50.0),
    }
    known = {name: bits(code, labels).bits for name, code in codes.items()}
    assert min(known[name] for name in heard) > 0.9
    assert max(known[name] for name in deaf) < 0.2
