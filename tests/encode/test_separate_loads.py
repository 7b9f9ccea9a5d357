"""Separate loads against components of a graph of all taxels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused
from scipy import ndimage
from scipy.sparse.csgraph import connected_components

from taxel import Array, Frames, Tare
from taxel.encode import ContactArea, SeparateLoads

from .scenes import ARRAY, rest, spikes_of

REPAIRED = "read"
AROUND = np.ones((3, 3), int)
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {"separate loads": SeparateLoads(tare=rest(ARRAY), gaps=[1, 2, 3])}


def turned(encoder):
    """The trains in their order on an array that is turned by half a turn: no place is in them."""
    return np.arange(2 * len(encoder.gaps))


def plainly(t, loaded, gaps):
    """The spikes of frames of which it is known where they are loaded, as (t, train, 1)."""
    before, spikes = np.zeros_like(loaded[0]), []
    for at, now in zip(t, loaded, strict=True):
        places = np.argwhere(before | now)
        apart = np.abs(places[:, None] - places).max(axis=2)
        for k, gap in enumerate(gaps):
            count, load = connected_components(apart <= gap)
            members = [places[load == n] for n in range(count)]
            is_now, was = ([state[tuple(of_load.T)].any() for of_load in members] for state in (now, before))
            if any(n and not w for n, w in zip(is_now, was, strict=True)):
                spikes.append((at, k, 1))
            if any(w and not n for n, w in zip(is_now, was, strict=True)):
                spikes.append((at, len(gaps) + k, 1))
        before = now
    return sorted(spikes)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 9),
    columns=st.integers(2, 20),
    share=st.sampled_from([0.02, 0.1, 0.3, 0.6]),
    gaps=st.lists(st.integers(1, 12), min_size=1, max_size=4, unique=True).map(sorted),
)
def test_loads_are_components_of_what_is_loaded_now_and_before(seed, rows, columns, share, gaps):
    rng = np.random.default_rng(seed)
    array = Array(rows, columns, 1.0)
    tare = Tare.take(Frames(np.full((2, rows, columns), 50.0), [0, 1000], array=array))
    patterns = rng.random((8, rows, columns)) < share
    loaded = patterns[rng.integers(0, 8, 40)] | (rng.random((40, rows, columns)) < 0.02)
    counts = [frame & (ndimage.convolve(frame.astype(int), AROUND, mode="constant") > 1) for frame in loaded]
    frames = Frames(50.0 + 20.0 * loaded, np.arange(40) * 192, array=array)
    spikes = SeparateLoads(gaps=gaps, tare=tare).encode(frames)
    assert spikes_of(spikes) == plainly(frames.t, counts, gaps)


def test_a_gap_as_long_as_the_array_is_the_first_level_of_the_area():
    rng = np.random.default_rng(3)
    array = Array(6, 9, 1.0)
    tare = Tare.take(Frames(np.full((2, 6, 9), 50.0), [0, 1000], array=array))
    frames = Frames(50.0 + 20.0 * (rng.random((200, 6, 9)) < 0.03), np.arange(200) * 1000, array=array)
    area = ContactArea(levels=[1], tare=tare).encode(frames)
    separate = SeparateLoads(gaps=[1, 9], tare=tare).encode(frames)
    assert [separate[1].tolist(), separate[3].tolist()] == [area[0].tolist(), area[1].tolist()]
    assert len(separate[0]) > 0


@pytest.mark.parametrize("gaps", [[], [0, 2], [2, 2], [4, 1]])
def test_gaps_ascend_from_1(gaps):
    with refused(argument="gaps"):
        SeparateLoads(gaps=gaps)
