"""Moments against NumPy and SciPy: area, total, peak and the way of the centre, through levels in equal ratios."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import Array, Frames
from taxel.encode import Moments

from . import oracles, scenes
from .scenes import rest, some_tare, spikes_of, wander

ARRAY = Array(3, 4, 2.0)
RANGES = {"area": (1, 12), "total": (3.0, 400.0), "peak": (2.0, 90.0), "displacement_mm": (0.1, 5.0)}


REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "moments": Moments(levels=3, **RANGES, tare=rest(scenes.ARRAY)),
    "moments, crossings of two": Moments(
        levels=4,
        area=(1, 12),
        total=None,
        peak=None,
        displacement_mm=(0.1, 3),
        tonic_ms=None,
        period_ms=0.3,
        tare=rest(scenes.ARRAY),
    ),
    "moments, graded": Moments(
        levels=2,
        **RANGES | {"displacement_mm": None},
        tonic_ms=0.7,
        graded=True,
        ages_ms=[0.0, 0.4, 2.0],
        period_ms=0.3,
        tare=rest(scenes.ARRAY),
    ),
}


def turned(encoder):
    """The trains as they stand on an array that is turned by half a turn: right is left and down is up."""
    ways = sum(getattr(encoder, name) is not None for name in ("area", "total", "peak"))
    order = [*range(ways), ways + 1, ways, ways + 3, ways + 2]
    order = order if encoder.displacement_mm else order[:ways]
    trains, levels = np.arange(encoder.trains(scenes.ARRAY)), len(order) * encoder.levels
    parts = trains[: levels * (3 if encoder.tonic_ms else 2)].reshape(-1, len(order), encoder.levels)
    # The sampled moments and ages of the examples do not depend on directions.
    return np.concatenate([parts[:, order].ravel(), trains[parts.size :]])


@settings(deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    levels=st.sampled_from([0, 1, 3, 7]),
    left_out=st.sets(st.sampled_from(sorted(RANGES)), max_size=3),
    floor=st.sampled_from([0.0, 3.0, 7.5]),
    tonic=st.sampled_from([None, 300, 7000]),
    graded=st.booleans(),
    centre=st.booleans(),
    ages=st.lists(st.integers(0, 30_000), max_size=6, unique=True).map(sorted),
)
def test_moments_and_ages_are_those_of_numpy_and_scipy(seed, levels, left_out, floor, tonic, graded, centre, ages):
    if not (graded or ages or levels):
        ages = [0]
    rng = np.random.default_rng(seed)
    array = Array(5, 7, 2.67)
    tare = some_tare(rng, array, 0.0, 0.1)
    t = 77 + np.cumsum(rng.choice([192, 100, 3333], 150))
    frames = wander(rng, 150, 35).reshape(150, 5, 7).astype(np.float32)
    frames[rng.random(150) < 0.1] = 40  # touches end and new ones begin
    ranges = {name: None if name in left_out else of for name, of in RANGES.items()}
    options = {"levels": levels, "tonic_ms": None if tonic is None else tonic / 1000, "tare": tare, **ranges}
    centre = centre and graded
    sampled = {"graded": graded, "centre": centre, "ages_ms": [age / 1000 for age in ages] or None}
    encoder = Moments(noise_floor=floor, **sampled, **options)
    spikes = encoder.encode(Frames(frames, t, unit="ticks", array=array))
    assert spikes.kind == encoder.kind == ("graded" if graded else "unsigned")
    every = oracles.moment_levels(levels, **ranges)
    first = len(every) * (2 if tonic is None else 3)
    shown = [n for n, name in enumerate(["area", "total", "peak", *["displacement_mm"] * 2]) if ranges[name] and graded]
    assert len(spikes) == encoder.trains(array) == first + len(shown) + 4 * centre + len(ages)
    values = oracles.moment_values(frames, tare.rest, floor, 2.67)
    places = oracles.centre_places(frames, tare.rest, floor) if centre else None
    wanted = oracles.sampled_moments(t.tolist(), values, shown, ages, first, places)
    assert [spike for spike in spikes_of(spikes) if spike[1] < first] == oracles.moments(
        t.tolist(), frames, tare.rest, int(t[-1]), floor, 2.67, every, tonic
    )
    found = sorted(spike for spike in spikes_of(spikes) if spike[1] >= first)
    assert [spike[:2] for spike in found] == [spike[:2] for spike in sorted(wanted)]
    assert np.allclose([s[2] for s in found], [s[2] for s in sorted(wanted)], rtol=1e-6, atol=0)
    assert spikes_of(spikes)


def test_moments_of_events_are_sampled_every_period_from_the_first_stamp_on():
    tare = rest(Array(1, 3, 1.0), 50)
    events = taxel.Events(
        [1000, 1000, 1000, 1750, 1750, 4100, 4100],
        [0, 1, 2, 0, 1, 0, 1],
        [0] * 7,
        [True] * 5 + [False] * 2,
        intensity=[50, 50, 50, 60, 57, 50, 50],
        array=Array(1, 3, 1.0),
    )
    options = {"levels": 0, "area": None, "peak": None, "displacement_mm": None, "period_ms": 0.5}
    spikes = Moments(**options, graded=True, ages_ms=[0.5, 1.2], tare=tare).encode(events)
    assert [train.tolist() for train in spikes] == [[2.0, 2.5, 3.0, 3.5, 4.0], [2.5, 3.0], [3.5, 4.0]]
    assert spikes.values.tolist() == pytest.approx([np.log1p(17)] * 5 + [1.0] * 4)
    unsigned = Moments(**options, ages_ms=[0.5, 1.2], tare=tare).encode(events)
    assert (unsigned.kind, list(map(len, unsigned))) == ("unsigned", [2, 2])
