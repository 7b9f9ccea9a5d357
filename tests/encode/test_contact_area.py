"""Contact area against a plain count."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel import Array, Frames, Tare
from taxel.encode import ContactArea

from . import oracles
from .scenes import ARRAY, rest, spikes_of, touch

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {"area": ContactArea(tare=rest(ARRAY), levels=[1, 2, 4, 8])}


def turned(encoder):
    """The trains in their order on an array that is turned by half a turn: no place is in them."""
    return np.arange(2 * len(encoder.levels))


@settings(max_examples=40, deadline=None)
@given(seed=seeds, rows=st.integers(1, 9), columns=st.integers(1, 12), floor=st.sampled_from([0.0, 3.0]))
def test_contact_area_counts_loaded_taxels_with_loaded_neighbours(seed, rows, columns, floor):
    rng = np.random.default_rng(seed)
    array = Array(rows, columns, 1.0)
    level = rng.choice([50.0, 56.0, 60.0], (rows, columns))
    tare = Tare.take(Frames([level, level], [0, 1000], array=array))
    lift = np.repeat(rng.integers(0, 12, 12), 5)[:, None, None]
    frames = np.rint(level + lift * rng.random((60, rows, columns)))
    t = np.arange(60) * 192
    encoder = ContactArea(noise_floor=floor, levels=[1, 2, 4, 8, 16, 32], tare=tare)
    wanted = oracles.contact_area(t, frames, level, floor, (1, 2, 4, 8, 16, 32))
    assert spikes_of(encoder.encode(Frames(frames, t, array=array))) == wanted


@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_contact_area_of_events_is_reckoned_once_a_stamp(seed):
    rng = np.random.default_rng(seed)
    array = Array(6, 7)
    events = touch(rng, array)
    held, frames, stamps = np.full((6, 7), -np.inf), [], []
    for k, at in enumerate(events.t):
        if events.present[k]:
            held[events.y[k], events.x[k]] = events.intensity[k]
        if k + 1 == len(events) or events.t[k + 1] != at:
            frames.append(held.copy())
            stamps.append(at)
    wanted = oracles.contact_area(stamps, frames, np.full((6, 7), 55.0), before=0)
    spikes = ContactArea(tare=rest(array)).encode(events)
    assert len(spikes) == 10
    assert spikes_of(spikes) == wanted


def test_a_noise_floor_of_0_is_of_whole_numbers_alone():
    values = np.zeros((4, 2, 2), np.float32)
    values[2:] = 1.0
    frames = Frames(values, [0, 1000, 2000, 3000], unit="N")
    encoder = ContactArea(noise_floor=0, levels=[2], tare=Tare.take(frames, stop_us=2000))
    assert len(encoder.encode(frames).times) == 1
    values[3] = 0.4
    with refused(argument="noise_floor"):
        encoder.encode(Frames(values, frames.t, unit="N"))
