"""Events: laws of slicing and of conversions, and an error for every nonsense."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taxel import Array, Events, Frames

mpl.use("Agg")
GRID = Array(8, 12, 2.0, name="grid")


@st.composite
def some(draw: st.DrawFn) -> Events:
    """Any events on the grid, in any order of time, with or without intensities."""
    n = draw(st.integers(0, 40))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    ticks = {}
    if draw(st.booleans()):
        ticks = {"intensity": rng.integers(0, 65_536, n), "present": rng.random(n) < 0.5}
    if draw(st.booleans()):
        ticks["repaired"] = rng.random(n) < draw(st.sampled_from([0.05, 0.5]))
    markers = [(int(t), bool(t % 2)) for t in np.sort(rng.integers(-(10**6), 10**6, draw(st.integers(0, 3))))]
    t = rng.integers(-(10**6), 10**6, n)
    x, y, p = rng.integers(0, 12, n), rng.integers(0, 8, n), rng.random(n) < 0.5
    return Events(t, x, y, p, array=GRID, markers=markers, **ticks)


@given(some())
def test_records_give_the_same_events_back(events: Events) -> None:
    back = Events.from_numpy(events.to_numpy(), GRID)
    events.markers = ()
    assert back == events
    assert repr(back) == repr(events)


@given(some(), some())
def test_what_is_repaired_stays_so_through_slices_order_and_merging(a: Events, b: Events) -> None:
    def marked(events: Events) -> list[tuple[object, ...]]:
        return [(e.t, e.x, e.y, e.p, e.intensity, e.repaired) for e in events]

    assert marked(a[::-1]) == marked(a)[::-1]
    assert sorted(marked(a.sorted()), key=repr) == sorted(marked(a), key=repr)
    assert sorted(marked(a + b), key=repr) == sorted(marked(a) + marked(b), key=repr)
    inside = a.between(-1000, 1000)
    assert marked(inside) == [e for e in marked(a) if -1000 <= e[0] < 1000]
    none = a[np.zeros(len(a), bool)]
    assert none.repaired is None


@given(some(), st.integers(-(10**6), 10**6), st.integers(-(10**6), 10**6))
def test_a_cut_in_time_gives_two_parts_that_make_the_whole(events: Events, start: int, stop: int) -> None:
    start, stop = sorted((start, stop))
    inside = events.between(start, stop)
    assert ((inside.t >= start) & (inside.t < stop)).all()
    before, after = events.between(-np.inf, start), events.between(stop, np.inf)
    assert len(before) + len(inside) + len(after) == len(events)
    assert len(before.markers) + len(inside.markers) + len(after.markers) == len(events.markers)
    assert inside.between(start, stop) == inside


@given(some())
def test_sorted_events_are_the_same_in_order(events: Events) -> None:
    ordered = events.sorted()
    assert (np.diff(ordered.t) >= 0).all()
    assert ordered.markers == tuple(sorted(events.markers, key=lambda marker: marker[0]))
    rows = np.argsort(events.t, kind="stable")
    assert np.array_equal(ordered.to_numpy(), events.to_numpy()[rows])
    assert ordered.sorted() == ordered


@given(some())
def test_equal_events_are_equal_and_changed_ones_are_not(events: Events) -> None:
    assert events == events[:]
    assert events != events.to_numpy
    if not len(events):
        return
    for name, other in (("t", 7), ("x", 11), ("y", 7), ("p", False)):
        changed = events[:]
        column = getattr(changed, name).copy()
        column[0] = other if column[0] != other else (True if name == "p" else 0)
        setattr(changed, name, column)
        assert changed != events


def test_what_did_not_come_has_no_value() -> None:
    a = Events([0], [1], [2], [True], array=GRID, intensity=[5], present=[False])
    b = Events([0], [1], [2], [True], array=GRID, intensity=[9], present=[False])
    assert a == b
    assert a != Events([0], [1], [2], [True], array=GRID)


def test_held_intensities_are_the_last_that_came_at_each_time() -> None:
    events = Events(
        [0, 100, 100, 250], [1, 1, 2, 1], [0, 0, 0, 0], [1, 1, 1, 0], array=GRID, intensity=[5, 6, 7, 0],
        present=[True, True, True, False],
    )  # fmt: skip
    frames = Frames.from_events(events, 100)
    assert frames.t.tolist() == [0, 100, 200]
    assert frames.values[:, 0, 1].tolist() == [5, 6, 6]
    assert frames.values[:, 0, 2].tolist() == [0, 7, 7]
    assert Frames.from_events(events, 100, 50, 350).t.tolist() == [50, 150, 250]
