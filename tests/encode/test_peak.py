"""The peak against NumPy, written from the definition: the largest deviation in units of each taxel's own noise."""

from __future__ import annotations

import json

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel import Array, Frames, Tare
from taxel.encode import Peak

from . import scenes
from .scenes import rest

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "peak": Peak(tare=rest(scenes.ARRAY)),
    "peak, of larger noise": Peak(levels=(0.5, 1.5, 9.0), release=1.0, least_noise=2.0, tare=rest(scenes.ARRAY)),
}


def turned(encoder):
    """The trains as they stand on an array that is turned by half a turn: no quantity depends on the position."""
    return np.arange(2 * len(encoder.levels))


def peaks(frames, tare, least):
    """The peak of each frame."""
    known = ~np.isnan(tare.rest)
    noise = np.where(known, np.maximum(np.nan_to_num(tare.noise), least), np.inf)
    waiting = np.logical_and.accumulate(frames == 0, axis=0)
    rest, found = np.where(known, tare.rest, 0.0), []
    for k, frame in enumerate(frames):
        above = np.where(waiting[k], 0.0, np.float32(frame - rest))
        units = above / noise
        found.append(max(0.0, units.max(), np.sqrt((units[units >= 4] ** 2).sum())))
    return np.array(found)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.sampled_from([(1, 1), (1, 7), (2, 2), (5, 9), (16, 16)]),
    noise=st.sampled_from([0.0, 0.3, 2.0]),
    loaded=st.integers(1, 3),
)
def test_the_peak_is_numpys(seed, shape, noise, loaded):
    rng, t = np.random.default_rng(seed), np.arange(80) * 10_000
    array = Array(*shape)
    level = rng.uniform(40, 60, shape)
    frames = level + rng.normal(0, noise, (80, *shape))
    for k in (20, 50):
        places = rng.choice(array.rows * array.columns, min(loaded, array.rows * array.columns), replace=False)
        frames[k : k + 10].reshape(10, -1)[:, places] += rng.uniform(1, 20, len(places))
    frames = np.float32(frames)
    tare = json.loads(Tare.take(Frames(frames[:20], t[:20], array=array)).to_json())
    if array.taxels > 4:
        tare["rest"][2] = tare["noise"][2] = None
    tare = Tare.from_json(json.dumps(tare))
    wanted = peaks(frames.astype(float), tare, 0.3)
    # Levels between peaks, so that rounding in single precision crosses none.
    steps = np.unique(wanted)
    apart = np.flatnonzero(np.diff(steps) > 1e-3 * steps[1:])[:: max(1, len(steps) // 8)]
    if not len(apart):
        return
    levels = ((steps[apart] + steps[apart + 1]) / 2).tolist()
    spikes = Peak(levels=levels, release=1.0, tare=tare).encode(Frames(frames, t, array=array))
    for level, rises, falls in zip(levels, spikes, list(spikes)[len(levels) :], strict=False):
        moves = np.diff((wanted >= level).astype(int), prepend=int(wanted[0] >= level))
        assert np.rint(rises * 1000).astype(int).tolist() == t[moves == 1].tolist()
        assert np.rint(falls * 1000).astype(int).tolist() == t[moves == -1].tolist()
