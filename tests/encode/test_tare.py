"""The rest of taxels."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from taxel import Array, Frames, Tare
from taxel.encode import SA1, SA2

from .scenes import spikes_of, touch


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), start=st.sampled_from([None, 0, 1_234_567, 1_240_000]))
def test_rest_and_noise_are_mean_and_deviation_by_time_of_the_held_value(seed, start):
    rng = np.random.default_rng(seed)
    array = Array(3, 4)
    events = touch(rng, array, 100)
    stop = int(events.t[-1]) + 777
    begin = int(events.t[0]) if start is None else start
    assume(begin < stop)
    tare = Tare.take(events, start_us=start, stop_us=stop)
    for y in range(3):
        for x in range(4):
            at = events.present & (events.x == x) & (events.y == y)
            edges = np.maximum(np.append(events.t[at], stop), begin)
            time = np.diff(edges)
            if time.sum() == 0:
                assert np.isnan(tare.rest[y, x])
                assert np.isnan(tare.noise[y, x])
            else:
                rest = np.average(events.intensity[at], weights=time)
                assert tare.rest[y, x] == pytest.approx(rest)
                noise = np.sqrt(np.average((events.intensity[at] - rest) ** 2, weights=time))
                assert tare.noise[y, x] == pytest.approx(noise, abs=1e-9)


def test_noise_is_exact_far_from_0():
    frames = 3e7 + np.array([0, 2] * 5)[:, None, None] * np.ones((1, 2))
    assert Tare.take(Frames(frames, 100 * np.arange(10))).noise == pytest.approx(np.full((1, 2), 1.0), rel=0.01)


def test_a_taxel_that_does_not_exist_has_no_rest():
    array = Array(1, 2, exists=np.array([[True, False]]))
    tare = Tare.take(Frames(np.ones((2, 1, 2)), [0, 100], array=array))
    assert np.array_equal(tare.rest, [[1.0, np.nan]], equal_nan=True)
    assert repr(tare) == "Tare(1 of 1 taxel, 0 to 100 us)"


@pytest.mark.parametrize("encoder", [SA1(period_ms=0.5, threshold=0.01), SA2(threshold=0.01)])
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_held_pressure_counts_from_rest(encoder, seed):
    """As if the rest had been taken off the frames; of events, pieces, and of a taxel whose rest is not known."""
    rng = np.random.default_rng(seed)
    array = Array(4, 5, 2.67, rng.random((4, 5)) < 0.9)
    events = touch(rng, array, 400)
    first = int(events.t[events.present][0])
    tare = Tare.take(events, stop_us=first + 1 + rng.integers(0, int(events.t[-1]) - first))
    period_us = round(1000 * encoder.period_ms)
    frames = Frames.from_events(events, period_us)
    plain = encoder.encode(tare.off(frames))
    spikes = encoder.with_tare(tare).encode(frames)
    assert spikes == plain
    of_events = encoder.with_tare(tare).encode(events)
    for train in range(len(plain)):
        until = frames.t[-1] / 1000
        assert np.array_equal(of_events[train][of_events[train] <= until], plain[train][plain[train] <= until])
    cut = rng.integers(0, len(events))
    stream = encoder.with_tare(tare).stream(array)
    pieces = [stream.push(events[:cut]), stream.push(events[cut:]), stream.finish()]
    assert sorted(spike for piece in pieces for spike in spikes_of(piece)) == spikes_of(of_events)
