"""What is not read of a file of arrays: values of other files, objects, and more than there is memory for."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from refusal import refused
from tests.formats.making import elsewhere

import taxel
from taxel import FormatError
from taxel._base import limits
from taxel._base.arrays import read_arrays, shapes
from taxel._base.errors import Place

from .making import record, some_events, some_frames


@pytest.mark.parametrize("values", [np.array([1, "x"], object), np.zeros(3, "M8[s]"), np.zeros(3, complex)])
@pytest.mark.parametrize("ending", [".npy", ".npz"])
def test_only_numbers_are_read_and_no_object_is_made(ending: str, values: Any, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    save: Any = np.save if ending == ".npy" else np.savez
    save(path, values)
    with refused(FormatError, place=Place(path.name)):
        read_arrays(path, shapes(path) or ["", "arr_0"], {"": np.float32, "arr_0": np.float32})
    path.with_suffix(".layout.toml").write_text("rate_hz = 10\n")
    with pytest.raises(FormatError):
        taxel.open(path)


def huge_npz(path: Path) -> None:
    np.savez_compressed(path, pressure=np.zeros((1 << 18, 4, 4)))


def huge_h5(path: Path) -> None:
    with h5py.File(path, "w") as h5:
        h5.create_dataset("pressure", (1 << 40, 4, 4), "f8", chunks=(1024, 4, 4))


def huge_npy(path: Path) -> None:
    with path.open("wb") as file:
        shape = {"descr": "<f8", "fortran_order": False, "shape": (1 << 40, 4, 4)}
        np.lib.format.write_array_header_1_0(file, shape)


@pytest.mark.parametrize(("name", "write"), [("a.npz", huge_npz), ("a.h5", huge_h5), ("a.npy", huge_npy)])
def test_an_array_larger_than_the_memory_is_refused_with_both_sizes(
    name: str, write: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "available", lambda: (1 << 24) + 1)
    write(tmp_path / name)
    (tmp_path / "layout.toml").write_text("rate_hz = 10\n")
    with refused(FormatError, place=Place(name)) as caught:
        taxel.open(tmp_path / name)
    size, there = map(int, re.findall(r"\d+", caught.value.args[0]))
    assert size > there == 16_777_217


def test_a_recording_larger_than_the_memory_is_refused_with_both_sizes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    record(path, some_events(5000))
    monkeypatch.setattr("taxel.recording.files.mcap.available", lambda: 1000)
    with pytest.raises(FormatError) as caught:
        len(taxel.open(path).events)
    assert caught.value.place == Place(str(path))
    size, there = map(int, re.findall(r"\d+", caught.value.args[0]))
    assert size > there == 1000


@pytest.mark.parametrize("how", ["external", "virtual"])
@pytest.mark.parametrize("name", ["stranger.h5", "taxel.h5", "matlab.mat"])
def test_no_byte_of_another_file_is_read_by_a_hdf5_file_or_handed_on(how: str, name: str, tmp_path: Path) -> None:
    path, out = tmp_path / name, tmp_path / "out.npz"
    if name == "taxel.h5":
        taxel.convert(some_frames(20), path)
    else:
        with h5py.File(path, "w", userblock_size=512) as h5:
            h5["values"], h5["t_s"] = np.random.default_rng(1).random((20, 5, 6)), np.arange(20.0)
        if name.endswith(".mat"):
            with path.open("r+b") as begun:
                begun.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    taxel.convert(taxel.open(path), out)
    out.unlink()
    with h5py.File(path, "r+") as h5:
        elsewhere(h5, "values", how)
    with refused(FormatError, place=Place(name)) as caught:
        taxel.open(path).frames()
    assert "data set values" in caught.value.args[0]
    with pytest.raises(FormatError):
        taxel.convert(taxel.open(path), out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("column", "value"), [("t", 0.5), ("x", 65_536), ("y", -1), ("x", np.nan), ("p", 2), ("intensity", 1e300)]
)
@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_a_value_that_a_column_of_events_does_not_hold_is_refused_with_its_place(
    column: str, value: float, kind: str, tmp_path: Path
) -> None:
    columns = {"t": np.arange(200.0), **{name: np.ones(200) for name in ("x", "y", "p", "intensity", "present")}}
    columns[column][149] = value
    path = tmp_path / f"a.{kind}"
    if kind == "npz":
        np.savez(path, **columns)
    else:
        with h5py.File(path, "w") as h5:
            h5.attrs["taxel"] = 1
            for name, values in columns.items():
                h5[name] = values
    with refused(FormatError, place=Place(path.name)) as caught:
        taxel.open(path)
    assert f"{column}[149]" in caught.value.args[0]


@pytest.mark.parametrize("name", ["a.json", "a.jsonl", "a.csv"])
@pytest.mark.parametrize(("begin", "end"), ["[]", ('{"a":', "}")])
def test_json_of_any_depth_is_refused(name: str, begin: str, end: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(f"{begin * 20_000}1{end * 20_000}\n" * 3)
    with pytest.raises(FormatError):
        taxel.open(tmp_path / name)


@pytest.mark.parametrize("save", [np.save, np.savez])
def test_labels_of_an_array_without_records_are_refused(save: Any, tmp_path: Path) -> None:
    name = "a.npy" if save is np.save else "a.npz"
    save(tmp_path / name, np.arange(3))
    with refused(FormatError, place=Place(name)):
        taxel.Labels(tmp_path / name)
