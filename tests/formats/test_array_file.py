"""Arrays of other programs open where their times say which axis is the time; else layouts are printed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Literal

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import FormatError, Frames
from taxel._base.errors import Place
from taxel.formats.array_file import read_array_file
from taxel.formats.layout import Layout, of_layout

from .tables import Opened, opened_by


def opened(path: Path, layout: str | None = None) -> Opened:
    found = opened_by(read_array_file, path, layout)
    again = opened_by(read_array_file, path, of_layout(found.layout))
    assert again.sources == found.sources
    return found


def layouts(path: Path) -> list[str]:
    """Return the layouts of arrays that can be read in several ways; each must open them."""
    with pytest.raises(FormatError) as caught:
        read_array_file(path, Layout(path))
    printed = str(caught.value).partition("\n")[2]
    found = [part.partition("\n")[2] for part in re.split(r"(?m)^# \d+\. ", printed)[1:]]
    for layout in found:
        opened(path, layout)
    return found


def values(found: Opened, source: str = "") -> np.ndarray:
    table = found.sources[source]
    assert isinstance(table, Frames)
    return table.values


@given(
    shape=st.permutations([30, 4, 5]).map(tuple) | st.permutations([30, 6]).map(tuple),
    time=st.sampled_from(["time_ms", "t_s", "timestamp"]),
    kind=st.sampled_from(["?", "i1", ">u2", "i4", "u8", "f2", ">f4", "f8"]),
    order=st.sampled_from("CF"),
    ending=st.sampled_from([".npz", ".h5"]),
)
def test_the_axis_that_has_as_many_as_times_is_the_time(
    shape: tuple[int, ...],
    time: str,
    kind: str,
    order: Literal["C", "F"],
    ending: str,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    path = tmp_path_factory.mktemp("axes") / f"a{ending}"
    numbers = (np.arange(np.prod(shape)) % 97).reshape(shape).astype(kind, order)
    if numbers.dtype.kind == "f":
        numbers.flat[0] = np.nan
    steps = {"time_ms": 10, "t_s": 0.01, "timestamp": 10_000_000}[time]
    begin = 1_700_000_000_000_000_000 if time == "timestamp" else 0
    arrays = {"palm": numbers, time: begin + steps * np.arange(30)}
    if ending == ".npz":
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            file.update(arrays)
    found = opened(path)
    assert np.diff(found.sources[""].t).tolist() == [10_000] * 29
    assert f"axis {shape.index(30)} (30) is the time" in found.said
    expected = np.moveaxis(numbers, shape.index(30), 0)
    np.testing.assert_array_equal(values(found).reshape(expected.shape), expected)


@pytest.mark.parametrize(
    ("shape", "axes"), [((45, 450, 52), ["row time column", "time row column"]), ((90, 6), ["time taxel"])]
)
def test_without_times_the_longest_axis_is_suspected_and_none_is_taken(
    shape: tuple[int, ...], axes: list[str], tmp_path: Path
) -> None:
    np.save(tmp_path / "a.npy", np.zeros(shape))
    assert [re.findall('axes = "(.*)"', layout) for layout in layouts(tmp_path / "a.npy")] == [[each] for each in axes]


@pytest.mark.parametrize("named", ["row time column", "column row time", "time column row"])
def test_a_layout_says_any_order_of_axes(named: str, tmp_path: Path) -> None:
    numbers = np.arange(60.0, dtype=np.float32).reshape(5, 3, 4)
    order = [["time", "row", "column"].index(name) for name in named.split()]
    np.save(tmp_path / "a.npy", numbers.transpose(order))
    found = opened(tmp_path / "a.npy", f'rate_hz = 10\n[data]\naxes = "{named}"\n')
    np.testing.assert_array_equal(values(found), numbers)


def test_a_layout_of_the_unit_alone_leaves_the_times(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", pressure=np.ones((9, 2, 3)), time=0.01 * np.arange(9))
    found = opened(tmp_path / "a.npz", 'unit = "kPa"')
    assert found.layout.data is not None
    assert (found.layout.unit, found.layout.data.time, found.layout.data.time_unit) == ("kPa", "time", "s")


def test_each_trial_is_a_recording_and_each_axis_a_source(tmp_path: Path) -> None:
    numbers = np.arange(2 * 5 * 4 * 3, dtype=np.float32).reshape(2, 5, 4, 3)
    np.save(tmp_path / "a.npy", numbers)
    layout = tmp_path / "a.layout.toml"
    layout.write_text('axis = "all"\n[data]\naxes = "trial time taxel axis"\n')
    for k, recording in enumerate(taxel.open_all(tmp_path / "a.npy")):
        assert (recording.name, list(recording.sources)) == (f"trial{k + 1}", ["x", "y", "z"])
        np.testing.assert_array_equal(recording.sources["z"].frames().values[:, 0], numbers[k, :, :, 2])


@pytest.mark.parametrize("above", ["data/demo_", "episode", "runs/a/"])
def test_numbered_groups_are_trials(above: str, tmp_path: Path) -> None:
    """As robots' episodes are kept; also where one of them has more arrays, or more frames."""
    random = np.random.default_rng(1)
    of_each = {k: random.random((30 + k, 2, 3)).astype(np.float32) for k in (0, 2, 10)}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k, frames in of_each.items():
            file[f"{above}{k}/obs/tactile"], file[f"{above}{k}/obs/time_s"] = frames, np.arange(len(frames)) / 50
        file[f"{above}0/remark"] = np.zeros(3)
    with pytest.warns(UserWarning, match="its groups are trials: "):
        found = taxel.open_all(tmp_path / "a.h5")
    assert [each.name for each in found] == [f"{above.rpartition('/')[2]}{k}" for k in of_each]
    for recording, frames in zip(found, of_each.values(), strict=True):
        np.testing.assert_array_equal(recording.frames().values, frames)
        assert np.diff(recording.frames().t).tolist() == [20_000] * (len(frames) - 1)


def test_three_axes_at_the_end_are_asked(tmp_path: Path) -> None:
    numbers = np.random.default_rng(1).random((50, 4, 5, 3)).astype(np.float32)
    np.savez(tmp_path / "a.npz", skin=numbers, t_ms=np.arange(50) * 10)
    z, all_axes, shear, xyz = layouts(tmp_path / "a.npz")
    np.testing.assert_array_equal(values(opened(tmp_path / "a.npz", z)), numbers[..., 2])
    np.testing.assert_array_equal(values(opened(tmp_path / "a.npz", all_axes), "y"), numbers[..., 1])
    np.testing.assert_allclose(values(opened(tmp_path / "a.npz", shear)), np.hypot(numbers[..., 0], numbers[..., 1]))
    one = opened(tmp_path / "a.npz", xyz)
    np.testing.assert_array_equal(values(one), numbers.reshape(50, 1, 60))


def test_several_arrays_are_named_with_their_shapes(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", left=np.zeros((9, 4)), right=np.zeros((9, 5)), t_s=np.arange(9))
    with pytest.raises(FormatError, match=r"left \(9 x 4\), right \(9 x 5\)") as caught:
        opened(tmp_path / "a.npz")
    assert caught.value.place == Place(str(tmp_path / "a.npz"))
    found = opened(tmp_path / "a.npz", '[data]\narray = "right"\ntime = "t_s"\n')
    assert values(found).shape == (9, 1, 5)
    assert found.lost == ("other arrays of the file: left",)


@pytest.mark.parametrize("array", [np.array([["x"] * 6]), np.zeros((0, 3)), np.array([[1, None]], object)])
def test_what_holds_no_numbers_is_refused(array: np.ndarray, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", array)
    with refused(FormatError, place=Place("a.npy")):
        opened(tmp_path / "a.npy", "rate_hz = 1\n")


def test_an_object_of_matlab_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def whosmat(path: Path) -> None:
        raise TypeError("'NoneType' object is not iterable")

    (tmp_path / "a.mat").write_bytes(b"MATLAB 5.0 MAT-file")
    monkeypatch.setattr("scipy.io.whosmat", whosmat)
    with refused(FormatError, place=Place("a.mat")) as caught:
        taxel.open(tmp_path / "a.mat")
    assert "writetable" in str(caught.value)


def test_other_programs_files_are_told_what_to_save_instead(tmp_path: Path) -> None:
    for ending in (".xls", ".pkl", ".pt", ".tdms", ".c3d"):
        (tmp_path / f"a{ending}").write_bytes(b"\x80\x04\x95")
        with refused(FormatError, place=Place(f"a{ending}")) as caught:
            taxel.open(tmp_path / f"a{ending}")
        assert "save" in str(caught.value) or "export" in str(caught.value)
    (tmp_path / "a.zarr").mkdir()
    for opens in (taxel.open, taxel.open_all):
        with refused(FormatError, place=Place("a.zarr")):
            opens(tmp_path / "a.zarr")
    (tmp_path / "a.json").write_text('{\n "p": [1, 2]\n}\n')
    with refused(FormatError, place=Place("a.json")):
        taxel.open(tmp_path / "a.json")


@pytest.mark.parametrize("begin", [0.0, 1_700_000_000.0])
def test_times_that_are_a_column_of_the_array_are_asked(tmp_path: Path, begin: float) -> None:
    path, readings = tmp_path / "a.npy", np.random.default_rng(1).random((300, 4)).astype(np.float32)
    np.save(path, np.column_stack([begin + np.arange(300) / 50, readings]))
    of_time, _ = layouts(path)
    found = opened(path, of_time)
    np.testing.assert_array_equal(values(found)[:, 0], readings)
    assert found.sources[""].t.tolist() == [round(begin * 1e6) + 20_000 * k for k in range(300)]
    with pytest.raises(FormatError, match=r"time is 9, but the array has no such taxel"):
        opened(path, '[data]\naxes = "time taxel"\ntime = 9\n')


def test_a_last_axis_of_one_is_none(tmp_path: Path) -> None:
    frames = np.arange(480.0).reshape(30, 4, 4, 1)
    np.savez(tmp_path / "a.npz", film=frames, t_ms=np.arange(30) * 20)
    np.testing.assert_array_equal(values(opened(tmp_path / "a.npz")), frames[..., 0])


@pytest.mark.parametrize("ending", [".npy", ".npz", ".h5"])
@pytest.mark.filterwarnings("ignore:a")
def test_an_array_of_records_is_a_table_of_its_fields(tmp_path: Path, ending: str) -> None:
    kinds = [("t_ms", "<i8"), ("seq", "<u4"), ("state", "S4"), ("palm", [("N", "<f4", (2, 4))])]
    records, path = np.zeros(30, kinds), tmp_path / f"a{ending}"
    records["t_ms"], records["seq"], records["state"] = 10 * np.arange(30), np.arange(30), b"rest"
    records["palm"]["N"] = np.random.default_rng(1).random((30, 2, 4))
    if ending == ".h5":
        with h5py.File(path, "w") as file:
            file["run/walk"] = records
    else:
        np.save(path, records) if ending == ".npy" else np.savez(path, walk=records)
    found = taxel.open(path).frames()
    np.testing.assert_array_equal(found.values, records["palm"]["N"])
    assert found.t.tolist() == [10_000 * k for k in range(30)]


def test_numbered_parts_of_a_body_are_no_trials(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({f"finger{k}/p": np.zeros((30, 4)) for k in range(3)} | {"time_s": np.arange(30) / 50})
    with pytest.raises(FormatError, match="which array holds the frames"):
        taxel.open_all(tmp_path / "a.h5")


@pytest.mark.parametrize("has_numbers", [False, True])
def test_objects_of_matlab_are_no_arrays(has_numbers: bool, tmp_path: Path) -> None:
    """As version 7.3 has a table: a pointer, and what it points to."""
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["T"] = np.arange(6, dtype=np.uint32)[None]
        file["T"].attrs["MATLAB_object_decode"] = 3
        file["#refs#/a"] = np.zeros((4, 90))
        if has_numbers:
            file["p"], file["time_s"] = np.zeros((4, 90)), np.arange(90)[None] / 50
    if has_numbers:
        assert values(opened(tmp_path / "a.mat")).shape == (90, 1, 4)
        return
    with refused(FormatError, place=Place("a.mat")) as caught:
        opened(tmp_path / "a.mat")
    assert "writetable" in str(caught.value)
