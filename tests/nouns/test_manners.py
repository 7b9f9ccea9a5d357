"""Python's manners: nouns are iterated, indexed and added."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import taxel
from taxel import Array, Detections, Events, Frames
from taxel._core import ProblemError

mpl.use("Agg")
GRID = Array(3, 4, 2.0)


def drawn(seed: int, n: int, *, ticks: bool = True) -> Events:
    rng = np.random.default_rng(seed)
    more = {"intensity": rng.integers(0, 99, n), "present": rng.random(n) < 0.7} if ticks else {}
    markers = [(int(t), bool(t % 2)) for t in np.sort(rng.integers(0, 50, 3))]
    t = np.sort(rng.integers(0, 50, n))
    return Events(
        t, rng.integers(0, 4, n), rng.integers(0, 3, n), rng.random(n) < 0.5, array=GRID, markers=markers, **more
    )


def found(seed: int, n: int, *, said: bool = False) -> Detections:
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 50, n))
    label = rng.choice(["contact", "lift"], n) if n else []
    return Detections(label, t, t + rng.integers(0, 5, n), rng.random(n), t + 9 if said else None)


seeds, sizes = st.integers(0, 10**6), st.integers(0, 30)


@given(seeds, sizes, st.booleans())
def test_what_is_iterated_is_what_the_columns_hold(seed: int, n: int, other: bool) -> None:
    events = drawn(seed, n, ticks=other)
    for k, event in enumerate(events):
        assert [event, events[k - n], events[np.int64(k)]] == [event] * 3
        assert (event.t, event.x, event.y, event.p) == (events.t[k], events.x[k], events.y[k], events.p[k])
        there = other and events.present[k]
        assert event.intensity == (events.intensity[k] if there else None)
    detections = found(seed, n, said=other)
    for k, one in enumerate(detections):
        assert [one, detections[k - n], detections[np.int64(k)]] == [one] * 3
        assert (one.label, one.t, one.known, one.slope) == tuple(
            getattr(detections, name)[k] for name in ("label", "t", "known", "slope")
        )
        assert one.reported == (one.t + 9 if other else None)
    assert (len(list(events)), len(list(detections))) == (n, n)
    for noun in (events, detections):
        for outside in (n, -n - 1, 10**30):
            with pytest.raises(IndexError, match=f": there are only {n}"):
                noun[outside]
        with pytest.raises(ProblemError):
            noun[True]


@given(seeds, sizes, sizes, st.tuples(st.booleans(), st.booleans()))
def test_events_of_both_are_merged_by_time_and_nothing_is_lost(
    seed: int, n: int, m: int, ticks: tuple[bool, bool]
) -> None:
    a, b = drawn(seed, n, ticks=ticks[0]), drawn(seed + 1, m, ticks=ticks[1])
    both = a + b
    assert (np.diff(both.t) >= 0).all()
    assert list(both) == sorted([*a, *b], key=lambda event: event.t)
    assert list(both.markers) == sorted([*a.markers, *b.markers], key=lambda marker: marker[0])
    assert (both.intensity is not None) == any(ticks)
    assert a + Events([], [], [], [], array=GRID) == a
    assert n == 0 or a[: n // 2] + a[n // 2 :] == a


def test_encoders_tares_health_and_detections_take_a_recording(tmp_path: Any) -> None:
    for source in (drawn(6, 30), Frames(np.arange(60.0).reshape(5, 3, 4), np.arange(5) * 1000)):
        path = tmp_path / f"{type(source).__name__}.npz"
        taxel.convert(source, path)
        rec = taxel.open(path)
        encoder = taxel.encode.LevelCrossing([30.0, 50.0])
        assert encoder.encode(rec) == encoder.encode(source)
        assert taxel.Tare.take(rec) == taxel.Tare.take(source)
        assert repr(taxel.health(rec)) == repr(taxel.health(source))
        readout = taxel.Readout(encoder, {"a": (taxel.Neuron(), np.ones(48))})
        assert taxel.detect.run(readout, rec) == taxel.detect.run(readout, source)


def test_plots_are_named_where_they_are_not_loaded() -> None:
    assert "plot" in dir(taxel)
    with pytest.raises(AttributeError, match="no attribute 'plots'"):
        getattr(taxel, "plots")  # noqa: B009  a name that is not there
