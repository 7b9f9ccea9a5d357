"""MATLAB files of arrays, as SciPy writes them, and as MATLAB does with -v7.3: by the axes that MATLAB shows."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

import taxel
from taxel import FormatError
from taxel._base.arrays import shapes
from taxel.recorded import recorded

TIMED = 'unit = "kPa"\n[data]\narray = "pressure"\ntime = "time_s"\ntime_unit = "s"\n'


def save(place: Path, arrays: dict[str, NDArray[np.generic]], how: str) -> None:
    if how != "-v7.3":
        savemat(place, arrays, do_compression=how == "-v7")
        return
    with h5py.File(place, "w", userblock_size=512) as file:
        for name, values in arrays.items():
            file[name] = values.T
    with place.open("r+b") as begun:
        begun.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


@pytest.mark.parametrize(
    ("how", "dtype"),
    [*(("-v7", dtype) for dtype in ("f8", "f4", "u1", "i2", ">f8", "u8")), ("-v6", "f8"), ("-v7.3", "f8")],
)
@pytest.mark.parametrize("is_last", [False, True])
@pytest.mark.parametrize("shape", [(4, 6), (24,), (1,), (1, 1)])
def test_frames_are_those_that_were_saved(
    how: str, is_last: bool, dtype: str, shape: tuple[int, ...], tmp_path: Path
) -> None:
    random = np.random.default_rng(1)
    values = random.integers(0, 200, (50, *shape)).astype(dtype)
    t = np.arange(50.0) / 25
    place = tmp_path / "walk.mat"
    stored = np.moveaxis(values, 0, -1) if is_last else values
    save(place, {"pressure": stored, "time_s": t[:, None], "left": np.array(3.0)}, how)
    # Without a layout, the times say which axis counts frames.
    inner = "row column" if len(shape) > 1 else "taxel"
    for text in ("", TIMED + (f'axes = "{inner} time"\n' if is_last else "")):
        if text:
            (tmp_path / "walk.layout.toml").write_text(text)
        read = recorded(taxel.open(place))
        assert isinstance(read, taxel.Frames)
        assert np.array_equal(read.values.reshape(values.shape), values.astype(np.float32))
        assert np.array_equal(read.t, 40_000 * np.arange(50))


def test_what_is_no_array_of_numbers_is_named_or_left_out(tmp_path: Path) -> None:
    place = tmp_path / "walk.mat"
    savemat(place, {"trial": {"pressure": np.ones((5, 2))}, "name": "walk"})
    assert shapes(place) == {}
    with pytest.raises(
        FormatError,
        match=r"if the data are in a struct, save its fields: save\('FILE.mat', ",
    ):
        taxel.open(place)
    place.write_bytes(b"5, 6\n7, 8\n" * 30)
    with pytest.raises(FormatError):
        taxel.open(place)
