"""Frames: laws of slicing, equality, and an error for every nonsense."""

from __future__ import annotations

import warnings

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from taxel import Array, Events, Frames

mpl.use("Agg")


@st.composite
def some(draw: st.DrawFn) -> Frames:
    n, rows, columns = draw(st.integers(0, 6)), draw(st.integers(1, 4)), draw(st.integers(1, 5))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    t = np.cumsum(rng.integers(1, 1000, n)) - 500
    exists = rng.random((rows, columns)) < 0.8 if draw(st.booleans()) else None
    return Frames(rng.normal(size=(n, rows, columns)), t, unit="kPa", array=Array(rows, columns, exists=exists))


@given(some(), st.floats(0, 1), st.integers(0, 10**6))
def test_a_missing_value_is_the_last_one_of_its_taxel(frames: Frames, share: float, seed: int) -> None:
    values = frames.values.copy()
    values[np.random.default_rng(seed).random(values.shape) < share] = np.nan
    full = Frames(values, frames.t, unit=frames.unit, array=frames.array)
    assert full.missing == np.count_nonzero(np.isnan(values))
    held = full.held()
    assert (held.unit, held.array, held.missing) == (full.unit, full.array, 0)
    for y, x in np.ndindex(values.shape[1:]):
        own = values[:, y, x]
        last = next((v for v in own if not np.isnan(v)), np.float32(0))
        for k, value in enumerate(own):
            last = last if np.isnan(value) else value
            assert held.values[k, y, x] == last
    assert held.held() is held


@given(some(), st.integers(-1000, 6000), st.integers(-1000, 6000))
def test_a_cut_in_time_gives_parts_that_make_the_whole(frames: Frames, start: int, stop: int) -> None:
    start, stop = sorted((start, stop))
    parts = [frames.between(-np.inf, start), frames.between(start, stop), frames.between(stop, np.inf)]
    assert np.array_equal(np.concatenate([p.t for p in parts]), frames.t)
    assert ((parts[1].t >= start) & (parts[1].t < stop)).all()
    assert frames[:] == frames


@given(some())
def test_changed_frames_are_not_equal(frames: Frames) -> None:
    assert frames != Frames(frames.values, frames.t, unit="N", array=frames.array)
    assert frames != 3
    if len(frames):
        assert frames != Frames(frames.values + 1, frames.t, unit="kPa", array=frames.array)
        assert frames != Frames(frames.values, frames.t + 1, unit="kPa", array=frames.array)


def test_what_was_not_measured_is_equal_to_itself() -> None:
    values = np.full((1, 2, 2), np.nan)
    assert Frames(values, [0]) == Frames(values, [0])


def test_pandas_gets_a_column_a_taxel_by_its_name_or_place() -> None:
    values = np.arange(12.0).reshape(2, 2, 3)
    exists = np.array([[True, False, True], [True, True, True]])
    table = Frames(values, [5, 1005], array=Array(2, 3, exists=exists)).to_pandas()
    assert (table.index.name, table.index.tolist()) == ("t_us", [5, 1005])
    assert table.to_dict("list") == {"x0y0": [0, 6], "x2y0": [2, 8], "x0y1": [3, 9], "x1y1": [4, 10], "x2y1": [5, 11]}
    named = Frames(values, [5, 1005], array=Array(2, 3, names=["heel", *["toe"] * 5])).to_pandas()
    assert named["heel"].tolist() == [0, 6]


@pytest.mark.parametrize("window", [(0.5, 2.5), (3, 900), (0, 4)])
@pytest.mark.parametrize("table", [Frames, Events])
def test_a_window_that_may_be_stated_in_s_or_ms_is_told(
    table: type[Frames | Events], window: tuple[float, float]
) -> None:
    t = np.arange(5000, 10_000_000, 1000)
    frames = Frames(np.zeros((len(t), 1, 1)), t)
    data = frames if table is Frames else Events(t, 0 * t, 0 * t, t > 0, array=Array(1, 1))
    with pytest.warns(UserWarning, match="between takes us"):
        assert len(data.between(*window)) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(data.between(0, 6000)) == 1
        assert len(data.between(20_100, 20_900)) == len(data.between(-5, -1)) == 0


def drawn(seed: int) -> Frames:
    rng = np.random.default_rng(seed)
    values = rng.normal(1, 4, (6, 5, 7)) * (rng.random((6, 5, 7)) < 0.5)
    values[2] = 0
    array = Array(5, 7, pitch_mm=2.5)
    return Frames(values, np.arange(6), unit="N", array=array)


@given(st.integers(0, 10**6), st.sampled_from([0.0, 1.5]))
def test_area_peak_sum_and_centre_are_scipy_s(seed: int, above: float) -> None:
    frames = drawn(seed)
    for k, frame in enumerate(frames.values.astype(np.float64)):
        loaded = frame > above
        assert frames.area(above)[k] == loaded.sum() * 6.25
        assert frames.peak()[k] == frame.max()
        assert frames.total()[k] == pytest.approx(frame.sum(), abs=1e-9)
        if not loaded.any():
            assert np.isnan(frames.centre(above)[k]).all()
        else:
            y, x = ndimage.center_of_mass(np.where(loaded, frame, 0.0))
            np.testing.assert_allclose(frames.centre(above)[k], [2.5 * x, 2.5 * y], 1e-9, 1e-9)
