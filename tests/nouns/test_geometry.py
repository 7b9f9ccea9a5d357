"""How far apart taxels are, or where: what needs mm refuses without them."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import Array, Calibration, Events, Frames, Places, ProblemError, Readout, Tare, _core
from taxel.calibration import Load

PLATE = Array(4, 3, (7.62, 5.08), name="plate")
FOOT = Array(1, 3, name="foot", places=Places([0.0, 10.0, 4.0], [0.0, 2.0, 8.0], [4.0, 9.0, 1.0], "mm"))
VAGUE = Array(1, 3, name="vague", places=Places([0.0, 10.0, 4.0], [0.0, 2.0, 8.0]))


@st.composite
def arrays(draw: st.DrawFn) -> Array:
    """Draw a sensor of any kind of geometry."""
    rows, columns = draw(st.integers(1, 5)), draw(st.integers(1, 5))
    exists = draw(st.none() | st.lists(st.booleans(), min_size=rows * columns, max_size=rows * columns))
    grid = None if exists is None else np.array(exists).reshape(rows, columns)
    if grid is not None:
        grid[0, 0] = True
    length = st.floats(1e-6, 1e6) | st.just(1.0)
    pitch = draw(st.none() | length | st.tuples(length, length))
    places = None
    if pitch is None and draw(st.booleans()):
        where = st.lists(st.floats(-1e9, 1e9), min_size=rows * columns, max_size=rows * columns)
        area = draw(st.none() | st.lists(st.floats(1e-9, 1e9), min_size=rows * columns, max_size=rows * columns))
        places = Places(draw(where), draw(where), area, draw(st.none() | st.just("mm")))
    names = draw(st.none() | st.lists(st.text(max_size=8), min_size=rows * columns, max_size=rows * columns))
    return Array(rows, columns, pitch, grid, draw(st.text(max_size=8)), places, names)


@given(arrays())
def test_files_and_the_compiled_part_keep_all_of_a_sensor(array: Array) -> None:
    assert Array._from_geometry(json.loads(json.dumps(array._geometry()))) == array
    compiled = _core.PanelRecording.of_events(Events([], [], [], [], array=array), None, 0, ".", 0)
    assert Array._from_geometry(compiled.array()) == array


@given(array=arrays())
@settings(max_examples=6, deadline=None)
@pytest.mark.parametrize("ending", [".npz", ".h5"])
def test_converted_files_keep_all_of_a_sensor(
    array: Array, ending: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    place = tmp_path_factory.mktemp("kept") / f"one{ending}"
    taxel.convert(Frames(np.zeros((2, *array.shape)), [0, 1000], array=array), place)
    assert taxel.open(place).array == array


def test_area_and_centre_use_both_pitches_and_each_place() -> None:
    values = np.zeros((1, 4, 3))
    values[0, 2, 1], values[0, 0, 0] = 3.0, 1.0
    of = Frames(values, [0], array=PLATE)
    np.testing.assert_allclose(of.area(), [2 * 7.62 * 5.08])
    np.testing.assert_allclose(of.centre(), [[0.75 * 5.08, 0.75 * 2 * 7.62]])
    weights = np.array([[[1.0, 2.0, 5.0]]])
    for array in (FOOT, VAGUE):
        np.testing.assert_allclose(Frames(weights, [0], array=array).centre(), [[40 / 8, 44 / 8]])
    np.testing.assert_allclose(Frames(weights, [0], array=FOOT).area(above=1.5), [10.0])
    assert Frames(weights, [0], array=VAGUE).loaded(above=1.5).tolist() == [2]


@pytest.mark.parametrize(
    "work",
    [
        lambda: _moments(Array(4, 4, name="mat"), displacement_mm=(1.0, 9.0)),
        lambda: _moments(Array(1, 4, name="foot"), displacement_mm=(1.0, 9.0)),
        lambda: _moments(Array(1, 4, name="foot"), area=(1.0, 9.0), graded=True, centre=True),
        lambda: _encode(taxel.encode.ContactArea, Array(1, 4, name="foot")),
        lambda: _encode(taxel.encode.LocalLoad, Array(1, 4, name="foot")),
        lambda: taxel.simulate.Layer(array=Array(8, 8, name="mat")),
        lambda: taxel.simulate.Layer(array=Array(8, 8, (2.0, 3.0), name="mat")),
        lambda: taxel.metrics.van_rossum_spatial(_trains(), _trains(), array=Array(2, 2, name="mat")),
    ],
)
def test_what_needs_mm_or_neighbours_refuses_by_name(work: Callable[[], object]) -> None:
    with pytest.raises((ProblemError, taxel.SceneError)):
        work()


def _trains() -> taxel.SpikeTrains:
    return taxel.SpikeTrains.from_lists([[1.0], [], [], []])


def _moments(array: Array, **levels: Any) -> None:
    frames = Frames(np.ones((3, *array.shape)), [0, 1000, 2000], array=array)
    taxel.encode.Moments(tare=Tare.take(frames), **levels).encode(frames)


def _encode(encoder: Any, array: Array) -> None:
    frames = Frames(np.ones((3, *array.shape)), [0, 1000, 2000], array=array)
    encoder(tare=Tare.take(frames)).encode(frames)


@pytest.mark.parametrize(
    ("array", "weights"), [(PLATE, np.full((4, 3), 7.62 * 5.08)), (FOOT, np.array([[4.0, 9.0, 1.0]]))]
)
def test_newtons_from_kpa_use_each_taxel_s_area(array: Array, weights: np.ndarray) -> None:
    pressed = np.arange(1.0, 1.0 + array.rows * array.columns).reshape(1, *array.shape)
    load = float((10.0 * pressed[0] * weights).sum() * 1e-3)
    fitted = Calibration.fit([Load(Frames(pressed, [0], array=array), load, "N")], unit="kPa", exponent=1.0)
    np.testing.assert_allclose(fitted.apply(Frames(pressed, [0], array=array)).values, 10.0 * pressed, rtol=1e-6)
    without = Array(*array.shape, name="flat")
    with refused():
        Calibration.fit([Load(Frames(pressed, [0], array=without), load, "N")], unit="kPa")


def test_another_pitch_is_said_and_never_refused() -> None:
    values = np.arange(1.0, 13.0).reshape(1, 4, 3).repeat(3, 0)
    t = [0, 1000, 2000]
    here, there = Frames(values, t, array=PLATE), Frames(values, t, array=Array(4, 3, 5.08, name="old"))
    calibration = Calibration.fit([Load(there, 3.0)], exponent=1.0)
    with pytest.warns(
        UserWarning, match=r"plate has taxels rows 7.62 mm and columns 5.08 mm apart, but old has taxels 5.08 mm apart"
    ):
        of_here = calibration.apply(here)
    assert np.array_equal(of_here.values, calibration.apply(there).values)
    with pytest.warns(UserWarning, match="plate has taxels"):
        Tare.take(there).off(here)
    encoder = taxel.encode.LevelCrossing([2.0])
    readout = Readout(encoder, {"contact": (taxel.Neuron(), np.zeros(24), 0.0)}, array=there.array)
    with pytest.warns(UserWarning, match="plate has taxels"):
        taxel.detect.run(readout, here)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for unknown in (Array(4, 3), Array(4, 3, exists=np.ones((4, 3), bool), name="any")):
            calibration.apply(Frames(values, t, array=unknown))
            taxel.detect.run(readout, Frames(values, t, array=unknown))
    for others in (Array(3, 4), Array(4, 3, exists=np.eye(4, 3, dtype=bool))):
        frames = Frames(np.zeros((1, *others.shape)), [0], array=others)
        for work in (calibration.apply, Tare.take(there).off):
            with pytest.raises(ProblemError):
                work(frames)
        with pytest.raises(ProblemError):
            taxel.detect.run(readout, frames)


def test_names_of_taxels_go_with_them_and_are_never_grounds_to_refuse(tmp_path: Path) -> None:
    called, other, nameless = Array(2, 2, names=["a", "b", "c", "d"]), Array(2, 2, names="efgh"), Array(2, 2)
    with refused(argument="names"):
        Array(2, 2, names=["a", "b", "c"])
    assert called.fits(other)
    assert called.fits(nameless)
    frames = {array: Frames(np.ones((4, 2, 2)), np.arange(4), array=array) for array in (called, other, nameless)}
    for k, array in enumerate((called, other, nameless)):
        taxel.convert(frames[array], tmp_path / f"{k}.mcap")
    opened = [taxel.open(tmp_path / f"{k}.mcap") for k in range(3)]
    assert [one.array.names for one in opened] == [tuple("abcd"), tuple("efgh"), None]
    assert opened[0].frames().region(slice(1, 2), slice(0, 2)).array.names == ("b", "d")
    one = taxel.merge(opened, gap_us=1)
    assert one.array.names == tuple("abcd")
    assert one.lost == ("how 1.mcap describes the sensor otherwise",)
    [lost] = taxel.convert(opened[0], tmp_path / "a.csv")
    assert "the sensor" in lost


def test_a_region_keeps_its_part_of_places_and_both_pitches() -> None:
    values = np.arange(12.0).reshape(1, 4, 3)
    assert Frames(values, [0], array=PLATE).region(slice(0, 2), slice(1, 3)).array.pitch_mm == (7.62, 5.08)
    y, x = np.indices((4, 3), dtype=float)
    part = Frames(values, [0], array=Array(4, 3, places=Places(x, y))).region(slice(1, 3), slice(2, 4)).array
    assert part.places == Places(x[2:4, 1:3], y[2:4, 1:3])


@given(
    st.lists(st.tuples(st.integers(1, 4), st.integers(1, 4), st.booleans()), min_size=1, max_size=4), st.integers(0, 2)
)
def test_arrays_side_by_side_are_the_parts_of_one(sizes: list[tuple[int, int, bool]], gap: int) -> None:
    draw = np.random.default_rng(len(sizes))
    arrays = []
    for rows, columns, named in sizes:
        exists = draw.random((rows, columns)) < 0.7
        exists[0, 0] = True
        names = [f"{k}" for k in range(rows * columns)] if named else None
        arrays.append(Array(rows, columns, 2.0, exists, "a", names=names))
    beside, lefts = Array._beside(arrays, gap)
    assert beside.taxels == sum(array.taxels for array in arrays)
    assert beside.columns == sum(array.columns for array in arrays) + gap * (len(arrays) - 1)
    for left, array in zip(lefts, arrays, strict=True):
        part = beside._part(slice(left, left + array.columns), slice(0, array.rows))
        assert part.fits(array)
        assert (part.pitch_mm, part.name) == (2.0, "a")
        assert part.names in (array.names, ("",) * array.rows * array.columns)
