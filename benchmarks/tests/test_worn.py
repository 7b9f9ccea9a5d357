"""What becomes of taxels after a tare: held values that drift, taxels that stick or flicker."""

import numpy as np
import pytest

from taxel import Events, Frames
from taxel.simulate import Scene, Silence, play
from taxel_benchmarks._worn import worn

SINCE = 50_300


@pytest.fixture(scope="module")
def played() -> Events:
    return play([Silence(100.0), Scene.draw(seed=5)], seed=5).events


def held(events: Events, t_us: int) -> np.ndarray:
    return Frames.from_events(events, 1, t_us, t_us + 1).values[0]


def test_every_taxel_drifts_steadily_by_its_own_rate(played: Events) -> None:
    moved = worn(played, SINCE, seed=1, drift=60.0, age_min=0.25)
    before = played.t < SINCE
    assert np.array_equal(moved.t[: before.sum()], played.t[before])
    assert np.array_equal(moved.intensity[: before.sum()], played.intensity[before])
    first, last = (held(moved, t) - held(played, t) for t in (SINCE + 100, int(played.t[-1]) - 1))
    # 60 ticks a minute for .25 minutes, and then for the length of the recording.
    assert 13 < first.std() < 17
    minutes = 0.25 + (played.t[-1] - SINCE) / 60e6
    free = held(moved, int(played.t[-1]) - 1) > 0
    assert np.abs(last - first * minutes / 0.25)[free].max() <= 1 + minutes / 0.25
    assert np.abs(np.diff(moved.t)).min() >= 0


def test_bad_taxels_are_as_many_as_asked_and_no_others_change(played: Events) -> None:
    bad = worn(played, SINCE, seed=3, stuck=3, flickering=2, pairs=1)
    times = range(SINCE + 100, int(played.t[-1]), 20_000)
    frames = np.array([held(bad, t) for t in times])
    differ = frames != np.array([held(played, t) for t in times])
    places = np.nonzero(differ.any(axis=0))
    count = [len(np.unique(frames[:, y, x])) for y, x in zip(*places, strict=True)]
    assert (count.count(1), count.count(2), len(count)) == (3, 4, 7)
    flickering = [(y, x) for y, x, n in zip(*places, count, strict=True) if n == 2]
    pairs = [(y, x) for y, x in flickering if (y, x + 1) in flickering]
    up = frames > frames.min(axis=0)
    assert any(np.array_equal(up[:, y, x], up[:, y, x + 1]) for y, x in pairs)


def test_a_seed_gives_the_same_again_and_another_gives_another(played: Events) -> None:
    how = {"drift": 1.0, "age_min": 10.0, "stuck": 1, "flickering": 1, "pairs": 1}
    assert worn(played, SINCE, seed=7, **how) == worn(played, SINCE, seed=7, **how)
    assert worn(played, SINCE, seed=7, **how) != worn(played, SINCE, seed=8, **how)
