"""Reads tables of text and arrays of somebody else, as a layout file says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.archive import read_arrays, stored_names
from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.h5_file import H5File
from taxel._base.limits import COLUMNS, VALUE, unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending_us
from taxel.formats.checks import table as limited
from taxel.formats.layout import UNITS_US, Data, Layout, Table
from taxel.frames import Frames
from taxel.recording.contents import Contents
from taxel.recording.h5 import is_ours

__all__ = ["is_foreign", "read_foreign"]

#: The endings of tables of text, also compressed by gzip, and of files of arrays.
_TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc")
_DATA = (".npy", ".npz", ".h5", ".hdf5")


def is_foreign(path: Path) -> bool:
    """Return whether a file is a table or holds arrays that taxel did not write; false for a file that is not there."""
    ending = Path(path.name.removesuffix(".gz")).suffix.lower()
    if not path.is_file() or ending not in (*_TABLES, *_DATA):
        return False
    if ending == ".npz":
        return not {"t", "about"} & set(stored_names(path))
    if ending == ".h5":
        return not is_ours(path)
    if ending == ".csv":
        with path.open("rb") as table:
            return not table.read(16).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"t_us")
    return True


def read_foreign(path: Path, layout: Layout) -> Contents:
    """Read a file whose layout says how.

    Parameters
    ----------
    path : Path
        A table of text, or a file of arrays.
    layout : Layout

    Returns
    -------
    Contents
        Readings as they are in the file: `taxel.recording.layout.laid_out` turns those that fall. Without a time column
        and a rate the time of a picture is its number in us: 0, 1, 2 ...

    Raises
    ------
    FormatError : another number of columns than the layout's taxels, a cell that is not a number (names line and
        column), an array that is not there
    """
    is_table = path.suffix.lower() not in _DATA
    if is_table:
        values, seconds, first = _table(path, layout.table or Table())
    else:
        values, seconds = _data(path, layout.data or Data())
        first = 0
    t = np.arange(len(values)) if seconds is None else ascending_us(path.name, seconds, first)
    try:
        taxels = math.prod(values.shape[1:])
        if layout.rows is not None and layout.columns is not None and taxels != layout.rows * layout.columns:
            what = f"{taxels} columns" if is_table else f"pictures of {' x '.join(map(str, values.shape[1:]))}"
            raise FormatError(f"{path}: {what}; {layout.place} says {layout.rows} x {layout.columns} taxels")
        grid = Array(values.shape[1], values.shape[2], name=path.stem) if values.ndim == 3 else None
        array = layout.array(taxels, grid or Array(1, taxels, name=path.stem))
        unpacked(str(path), 4 * values.size)
        frames = Frames(frozen(values.astype(np.float32).reshape(-1, *array.shape)), t, array=array)
    except ProblemError as error:
        raise FormatError(f"{layout.place}: {first_line(error)}") from None
    limited(path, frames)
    kind = "table" if is_table else "arrays"
    return Contents(path, path.name, kind, array, frames=frames)


def _table(path: Path, how: Table) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, int]:
    """Return the readings, the times in s, and the number of the first line of numbers."""
    lines = text.lines(path)[how.skip_lines :]
    first = how.skip_lines + 1
    rows = [_cells(line, how) for line in lines if line.strip()]
    if not rows:
        raise FormatError(f"{path.name}, line {first}: no line after {how.skip_lines} skipped ones")
    if len(rows[0]) > COLUMNS:
        raise FormatError(f"{path.name}, line {first}: {len(rows[0])} columns; at most {COLUMNS} are read")
    named = not all(_is_number(cell, how) for cell in rows[0])
    names = rows.pop(0) if named else [f"column {k}" for k in range(1, len(rows[0]) + 1)]
    first += named
    column = _time_column(path, how, names, named)
    if how.missing is not None:
        rows = [["nan" if cell == how.missing else cell for cell in row] for row in rows]
        values = _with_missing(rows, path, first, names)
    else:
        values = text.numbers(rows, path, first, names)
    if column is None:
        return values, None, first
    seconds = values[:, column] * UNITS_US[how.time_unit] / 1e6
    if np.isnan(seconds).any():
        line = first + int(np.flatnonzero(np.isnan(seconds))[0])
        raise FormatError(f"{path.name}, line {line}: {names[column]} is missing; every picture has a time")
    return np.delete(values, column, axis=1), seconds, first


def _cells(line: str, how: Table) -> list[str]:
    cells = line.split() if how.separator == " " else line.split(how.separator)
    return [cell.strip() for cell in cells]


def _is_number(cell: str, how: Table) -> bool:
    try:
        float(cell)
    except ValueError:
        return cell == how.missing
    return True


def _time_column(path: Path, how: Table, names: Sequence[str], named: bool) -> int | None:
    column = how.time_column
    if column is None:
        return None
    if isinstance(column, int):
        if column > len(names):
            raise FormatError(f"{path.name}: {len(names)} columns; time_column is {column}")
        return column - 1
    if column not in names:
        there = ", ".join(names[:8]) + " ..." * (len(names) > 8) if named else "no names, so give its number from 1"
        raise FormatError(f"{path.name}: no column {shown(column)} of times; there are {there}")
    return names.index(column)


def _with_missing(rows: list[list[str]], path: Path, first: int, names: Sequence[str]) -> NDArray[np.float64]:
    """Return a block of numbers in which a cell may be missing, NaN."""
    there = [["0" if cell == "nan" else cell for cell in row] for row in rows]
    values = text.numbers(there, path, first, names)
    values[np.array([[cell == "nan" for cell in row] for row in rows]).reshape(values.shape)] = np.nan
    return values


def _data(path: Path, how: Data) -> tuple[NDArray[Any], NDArray[np.float64] | None]:
    """Return the pictures, and the times in s."""
    if path.suffix.lower() == ".npy":
        try:
            arrays = {"": np.load(path, allow_pickle=False)}
        except (ValueError, EOFError) as error:
            raise FormatError(f"{path}: {first_line(error)}; must be a NumPy array of numbers") from None
        wanted: list[str] = [""]
    else:
        there = _names(path)
        if how.array is None and len(there) != 1:
            raise FormatError(f"{path}: holds {', '.join(there) or 'nothing'}; say which in the layout: [data] array")
        wanted = [there[0] if how.array is None else how.array, *([] if how.time is None else [how.time])]
        missing = next((name for name in wanted if name not in there), None)
        if missing is not None:
            raise FormatError(f"{path}: holds no array {missing}; there are {', '.join(there)}")
        arrays = _arrays(path, wanted)
    values = arrays[wanted[0]]
    if values.dtype.kind not in "uif" or values.ndim not in (2, 3) or 0 in values.shape:
        shape = " x ".join(map(str, values.shape))
        raise FormatError(
            f"{path}, {wanted[0] or 'the array'}: {values.dtype} of shape {shape}; must be numbers of shape "
            "pictures x rows x columns, or pictures x taxels"
        )
    if values.dtype.kind == "f" and (np.abs(np.nan_to_num(values, posinf=np.inf)) > VALUE).any():
        raise FormatError(f"{path}, {wanted[0] or 'the array'}: a value does not fit 32 bits")
    if len(wanted) == 1:
        return values, None
    times = arrays[wanted[1]].astype(np.float64)
    if times.shape != values.shape[:1]:
        raise FormatError(f"{path}, {wanted[1]}: {times.size} times for {len(values)} pictures")
    return values, times * UNITS_US[how.time_unit] / 1e6


def _names(path: Path) -> list[str]:
    if path.suffix.lower() == ".npz":
        return list(stored_names(path))
    with H5File(path) as h5:
        return [name for name, entry in h5.entries.items() if entry.is_numbers]


def _arrays(path: Path, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    if path.suffix.lower() == ".npz":
        return read_arrays(path, names)
    with H5File(path) as h5:
        return {name: h5.numbers(name) for name in names}
