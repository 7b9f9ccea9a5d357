"""Touches as they end, against NumPy: how long each lasted, and how large it was."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel import Array, Frames, Tare
from taxel.encode import TouchEnds

from . import oracles, scenes
from .scenes import rest

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {"touch ends": TouchEnds(tare=rest(scenes.ARRAY))}


def turned(_encoder):
    """The trains as they stand on an array that is turned by half a turn: no quantity depends on the position."""
    return np.arange(5)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), rate_hz=st.sampled_from([25, 60, 100, 5000]))
def test_each_touch_is_told_when_it_ends_with_its_duration(seed, rate_hz):
    rng = np.random.default_rng(seed)
    t = (np.arange(120) * 1e6 / rate_hz).astype(np.int64)
    level = rng.uniform(40, 60, (5, 6))
    frames = np.repeat(level[None], 120, axis=0)
    loaded = np.zeros(120, bool)
    for begin in (10, 40, 80):
        end = begin + int(rng.integers(1, 25))
        frames[begin:end, 1:3, 2:4] += rng.uniform(10, 80, (end - begin, 2, 2))
        loaded[begin:end] = True
    loaded[115:] = held = bool(rng.integers(2))
    frames[115:, 1:3, 2:4] += 20.0 * held
    frames = np.float32(frames)
    tare = Tare.take(Frames(frames[:10], t[:10], array=Array(5, 6)))
    spikes = TouchEnds(tare=tare).encode(Frames(frames, t, array=Array(5, 6)))
    begins, ends = (np.flatnonzero(np.diff(np.concatenate([[0], loaded.astype(int)])) == step) for step in (1, -1))
    assert [len(train) for train in spikes] == [len(ends)] * 5
    values = spikes.values.reshape(5, -1)
    for k, (begin, end) in enumerate(zip(begins, ends, strict=False)):
        assert round(spikes[0][k] * 1000) == t[end]
        moments = oracles.moment_values(frames[begin:end].astype(float), tare.rest, 3.0, 1.0)
        largest = [np.expm1(values[n, k]) for n in range(4)]
        np.testing.assert_allclose(largest[0], (t[end] - t[begin]) / 1000, rtol=2e-6)
        np.testing.assert_allclose(largest[1:], np.max(moments, axis=0)[:3], rtol=1e-5)
    assert (values[4] == 1.0).all()


def test_it_needs_a_tare():
    with refused(argument="tare"):
        TouchEnds().encode(Frames(np.zeros((2, 2, 2)), [0, 1000]))


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(1, 1), (1, 2), (1, 6), (21, 1)]),
    floor=st.sampled_from([0.01, 5.0]),
)
def test_a_channel_counts_alone_from_six_times_its_noise_until_half_of_that(seed, shape, floor):
    rng = np.random.default_rng(seed)
    array = Array(*shape)
    values = rng.normal(50.0, rng.uniform(0.2, 3.0, array.taxels), (300, array.taxels))
    for begin in range(100, 280, 40):
        values[begin : begin + 20, rng.integers(array.taxels)] += rng.uniform(1.0, 40.0)
    frames = Frames(values.reshape(300, *shape), np.arange(300) * 10_000, array=array)
    tare = Tare.take(frames, stop_us=900_000)
    enough = np.maximum(6.0 * tare.noise.ravel(), floor)
    loaded, begun, expected = np.zeros(array.taxels, bool), None, []
    for k, above in enumerate(frames.values.reshape(300, -1).astype(np.float64) - tare.rest.ravel()):
        loaded = above >= np.where(loaded, 0.5 * enough, enough)
        if loaded.any() and begun is None:
            begun = k
        elif not loaded.any() and begun is not None:
            expected.append((10.0 * k, np.float32(np.log1p(10.0 * (k - begun)))))
            begun = None
    spikes = TouchEnds(noise_floor=floor, tare=tare).encode(frames)
    assert list(zip(spikes[0].tolist(), spikes.values[: len(spikes[0])], strict=True)) == expected


def test_a_channel_that_reads_one_value_is_never_loaded():
    values = np.full((50, 1, 3), 512.0)
    values[20:30, 0, 1] += 1.0
    frames = Frames(values, np.arange(50) * 10_000, array=Array(1, 3))
    spikes = TouchEnds(noise_floor=0.0, tare=Tare.take(frames, stop_us=100_000)).encode(frames)
    assert spikes[0].tolist() == [300.0]
