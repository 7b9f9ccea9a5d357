"""Reads tables of text and arrays of other programs, as a layout file says."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import hdf5, read_arrays, shapes
from taxel._base.columns import frozen_whole
from taxel._base.limits import VALUE
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.checks import ascending, whole_us
from taxel.formats.checks import table as limited
from taxel.formats.layout import Data, Layout, as_size
from taxel.formats.times import UNITS_US
from taxel.frames import Frames
from taxel.reading import Facts, InMemory
from taxel.recording.readers.table import Readings, frames_hint, read_events, read_table

#: The endings of files of arrays.
ARRAYS = (".npy", ".npz", ".h5", ".hdf5", ".mat")
#: Characters of the name of an array that errors show; a path in a .h5 may have thousands.
_NAME = 60
#: Bytes of frames that are compared at once, and times that are converted at once.
_PIECE, _TIMES_AT_ONCE = 1 << 22, 1 << 16


def is_lone_array(path: Path) -> bool:
    """Return whether a file of another program holds one array only, of the shape of frames."""
    found = shapes(path) if path.suffix.lower() in ARRAYS else {}
    return len(found) == 1 and all(len(shape) in (2, 3) for shape in found.values())


def read_foreign(path: Path, layout: Layout, array: Array | None = None) -> InMemory:
    """Read a file whose layout says how.

    Parameters
    ----------
    path : Path
        A table of text, or a file of arrays.
    layout : Layout
    array : Array, optional
        The sensor of events, where the layout does not say it; default: one large enough for them.

    Returns
    -------
    InMemory
        Readings as they are in the file: `taxel.recording.layout.apply_layout` turns those that fall. Without a time
        column and a rate the time of a frame is its number in us: 0, 1, 2 ...

    Raises
    ------
    FormatError : another number of columns than the layout's taxels, a cell that is not a number (names line and
        column), an array that is not there
    """
    is_table = path.suffix.lower() not in ARRAYS
    if is_table and layout.table is not None and layout.table.events:
        return read_events(path, layout, array)
    read = read_table(path, layout) if is_table else _data(path, layout.data or Data())
    values, t = read.values, np.arange(len(read.values)) if read.t is None else ascending(path.name, read.t, read.line)
    try:
        taxels = math.prod(values.shape[1:])
        if layout.rows is not None and layout.columns is not None and taxels != layout.rows * layout.columns:
            hint = frames_hint(layout, taxels) if is_table else ""
            raise FormatError(
                f"{path}: contains {read.size}; {layout.path} states {layout.rows} x {layout.columns} taxels{hint}"
            )
        grid = Array(values.shape[1], values.shape[2], name=path.stem) if values.ndim == 3 else None
        # More channels than a sensor may have columns are a grid by the layout.
        grid = grid or (None if taxels <= 65_535 else layout.grid())
        names = read.names if any(read.names or ()) else None
        array = layout.array(taxels, grid or Array(1, taxels, name=path.stem, names=names))
        shaped = values.astype(np.float32, copy=False).reshape(-1, *array.shape)
        frames = Frames(frozen_whole(shaped), frozen_whole(t), array=array)
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    limited(path, frames)
    kind = "table" if is_table else "arrays"
    facts = Facts(path=path, array=frames.array, kind=kind, timed=read.t is not None, lost=tuple(read.lost))
    return InMemory(facts, frames)


def list_arrays(shapes: Mapping[str, tuple[int, ...]]) -> str:
    """Return the names and shapes of the first arrays, those that could hold frames before the others."""
    first = sorted(shapes.items(), key=lambda entry: len(entry[1]) not in (2, 3))[:8]
    names = [f"{_short(name) or 'an array'} ({' x '.join(map(str, shape)) or 'one number'})" for name, shape in first]
    return (", ".join(names) or "no numbers") + " ..." * (len(shapes) > 8)


def _short(name: str) -> str:
    """Return the name of an array, or the end of a long one."""
    return name if len(name) <= _NAME else f"...{name[3 - _NAME :]}"


def _data(path: Path, how: Data) -> Readings:
    if path.suffix.lower() == ".npy":
        key = next((key for key in ("array", "time") if getattr(how, key) is not None), None)
        if key is not None:
            size = as_size(getattr(how, key))
            right = f"to state a size, write {size}" if size else f"remove {key}"
            raise FormatError(
                f"{path}: the file has one array, without a name, but the layout states [data] {key}; {right}"
            )
        stored_names = [""]
        wanted = stored_names
    else:
        stored_shapes = shapes(path)
        stored_names = list(stored_shapes)
        if how.array is None and len(stored_names) != 1:
            raise FormatError(
                f"{path}: contains {list_arrays(stored_shapes)}; name one of these arrays in the layout file: [data] "
                "array"
            )
        # A path within a .h5 may begin at its root.
        named = [
            name if name in stored_shapes else name.strip("/") for name in (how.array, how.time) if name is not None
        ]
        wanted = [stored_names[0], *named] if how.array is None else named
        missing = next((name for name in wanted if name not in stored_names), None)
        if missing is not None:
            size = as_size(missing)
            hint = f"; to state a size, write {size}" if size else ""
            raise FormatError(f"{path}: contains no array {missing}; its arrays are {list_arrays(stored_shapes)}{hint}")
        along = -1 if how.frames == "last" else 0
        frames = math.prod(stored_shapes[wanted[0]][along : along + 1 or None])
        # MATLAB's times are a column or a row.
        if len(wanted) > 1 and [n for n in stored_shapes[wanted[1]] if n != 1] != [n for n in (frames,) if n != 1]:
            count = math.prod(stored_shapes[wanted[1]])
            raise FormatError(
                f"{path}, {wanted[1]}: {counted(count, 'time')} for {counted(frames, 'frame')}; must be as many "
                f"times as frames"
            )
    arrays = read_arrays(path, wanted, {wanted[0]: np.float32})
    values = arrays[wanted[0]]
    if how.frames == "last" and values.ndim > 1:
        values = np.ascontiguousarray(np.moveaxis(values, -1, 0))
    unread = ", ".join(name for name in stored_names if name not in wanted)
    lost = (f"other arrays of the file: {unread}",) if unread else ()
    if values.dtype.kind not in "uifb" or values.ndim not in (2, 3) or 0 in values.shape:
        shape = " x ".join(map(str, values.shape))
        raise FormatError(
            f"{path}, {wanted[0] or 'the array'}: contains {values.dtype} of shape {shape}; must contain numbers of "
            "shape frames x rows x columns, or frames x taxels"
        )
    large = _too_large(values)
    if large is not None:
        frame, *indices = large
        at = f"row {indices[0]}, column {indices[1]}" if len(indices) == 2 else f"taxel {indices[0]}"
        raise FormatError(
            f"{path}, {wanted[0] or 'the array'}, frame {frame}, {at}: the value is {values[large]}; must fit "
            "32 bits, or be NaN if it is missing"
        )
    size = f"frames of {' x '.join(map(str, values.shape[1:]))} values"
    if len(wanted) == 1:
        return Readings(values, None, size, lost=lost)
    return Readings(values, _times(path, wanted[1], arrays[wanted[1]].reshape(-1), how), size, lost=lost)


def _times(path: Path, name: str, times: NDArray[Any], how: Data) -> NDArray[np.int64]:
    """Return times in us; their memory may become that of the result."""
    if times.dtype.kind not in "uif":
        raise FormatError(f"{path}, {name}: contains {times.dtype}; must contain times as numbers")
    # Nobody else has the times, which take more memory than the readings of a single taxel.
    t = (
        times.view(np.int64)
        if times.dtype.itemsize == 8 and times.flags.c_contiguous and times.flags.writeable
        else np.empty(len(times), np.int64)
    )
    for begin in range(0, len(times), _TIMES_AT_ONCE):
        block = slice(begin, begin + _TIMES_AT_ONCE)
        t[block] = whole_us(path.name, times[block].astype(np.float64) * UNITS_US[how.time_unit] / 1e6, begin)
    return t


def _too_large(values: NDArray[Any]) -> tuple[int, ...] | None:
    """Return the place of the first value that 32 bits do not hold; None if there is none."""
    step = max(1, _PIECE // values[:1].nbytes)
    for begin in range(0, len(values), step):
        # VALUE is no number of 16 bits.
        large = np.abs(values[begin : begin + step]) > np.float64(VALUE)
        if large.any():
            first, *rest = np.unravel_index(int(np.argmax(large)), large.shape)
            return (begin + int(first), *map(int, rest))
    return None


def facts_of(path: Path, array: str, named: re.Pattern[str]) -> dict[str, float | str]:
    """Return the single numbers and short texts of some names that a file states beside an array of frames.

    In a .h5 they are attributes of the array, of its groups and of the file, nearest first, or data sets.
    """
    found: dict[str, Any] = {}
    if path.suffix.lower() in (".h5", ".hdf5"):
        with hdf5(path) as h5:
            groups = [array.rsplit("/", k)[0] for k in range(array.count("/") + 1)]
            for entry in (*groups, "/"):
                for name, value in h5[entry].attrs.items():
                    if named.fullmatch(name):
                        found.setdefault(name, value)
    names = [name for name in shapes(path, with_texts=True) if named.fullmatch(name)]
    found = {**read_arrays(path, names), **found}
    facts = {name: np.asarray(value).item() for name, value in found.items() if np.size(value) == 1}
    texts = {name: value.decode(errors="replace") for name, value in facts.items() if isinstance(value, bytes)}
    return {name: value for name, value in (facts | texts).items() if isinstance(value, float | int | str)}
