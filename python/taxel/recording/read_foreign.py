"""Reads tables of text and arrays of other programs, as a layout file says."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.archive import read_arrays, shapes, stored_names
from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.h5_file import H5File
from taxel._base.limits import COLUMNS, VALUE, unpacked
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending_us
from taxel.formats.checks import table as limited
from taxel.formats.layout import UNITS_US, Data, Layout, Table, as_size
from taxel.frames import Frames
from taxel.recording.contents import Contents
from taxel.recording.h5 import is_ours
from taxel.recording.kinds import is_label_table, is_own_table

__all__ = [
    "ARRAYS",
    "arrays_of",
    "is_foreign",
    "is_lone_array",
    "listed",
    "read_foreign",
    "shapes_of",
    "time_of",
    "unit_of",
]

#: The endings of tables of text, also compressed by gzip, and of files of arrays.
_TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc")
ARRAYS = (".npy", ".npz", ".h5", ".hdf5")

_UNIT = "s|secs?|seconds?|ms|us|µs|ns"

#: Names of columns that hold times, with or without a unit: time, timestamp_us, Time (ms), t [s].
_TIMES = re.compile(
    rf"(t|time|timestamps?)([ _.]*[\[(/] *(?P<within>{_UNIT}) *[\])]?|[ _.]+(?P<after>{_UNIT}))?", re.IGNORECASE
)


def is_foreign(path: Path) -> bool:
    """Return whether a file is a table or holds arrays that taxel did not write; false for a file that is not there."""
    ending = Path(path.name.removesuffix(".gz")).suffix.lower()
    if not path.is_file() or ending not in (*_TABLES, *ARRAYS):
        return False
    if ending == ".npz":
        names = set(stored_names(path))
        # Other programs name their times t too.
        return "about" not in names and not ("t" in names and names & {"x", "y", "p", "values"})
    if ending == ".h5":
        return not is_ours(path)
    if ending == ".csv":
        return not (is_own_table(path) or is_label_table(path))
    return True


def is_lone_array(path: Path) -> bool:
    """Return whether a file that taxel did not write holds one array only, of the shape of pictures."""
    if path.suffix.lower() not in ARRAYS or not is_foreign(path):
        return False
    there = shapes_of(path)
    return len(there) == 1 and all(len(shape) in (2, 3) for shape in there.values())


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
    is_table = path.suffix.lower() not in ARRAYS
    first, unread = 0, ""
    if is_table:
        values, seconds, first = _table(path, layout.table or Table())
    else:
        values, seconds, unread = _data(path, layout.data or Data())
    t = np.arange(len(values)) if seconds is None else ascending_us(path.name, seconds, first)
    try:
        taxels = math.prod(values.shape[1:])
        if layout.rows is not None and layout.columns is not None and taxels != layout.rows * layout.columns:
            what = counted(taxels, "column") if is_table else f"pictures of {' x '.join(map(str, values.shape[1:]))}"
            raise FormatError(f"{path}: {what}; {layout.place} says {layout.rows} x {layout.columns} taxels")
        grid = Array(values.shape[1], values.shape[2], name=path.stem) if values.ndim == 3 else None
        array = layout.array(taxels, grid or Array(1, taxels, name=path.stem))
        unpacked(str(path), 4 * values.size)
        frames = Frames(frozen(values.astype(np.float32).reshape(-1, *array.shape)), t, array=array)
    except ProblemError as error:
        raise FormatError(f"{layout.place}: {first_line(error)}") from None
    limited(path, frames)
    kind = "table" if is_table else "arrays"
    lost = (f"other arrays of the file: {unread}",) if unread else ()
    return Contents(path, path.name, kind, array, frames=frames, untimed=seconds is None, lost=lost)


def time_of(names: Sequence[str]) -> int | None:
    """Return which column holds times by its name; None of none."""
    # A letter may be the name of a taxel too: t is the time only where it comes first.
    return next((k for k, name in enumerate(names) if unit_of(name) is not None and (k == 0 or len(name) > 1)), None)


def unit_of(name: str) -> str | None:
    """Return the unit that the name of a column or an array of times states, "" if none; None of another name.

    Examples
    --------
    >>> unit_of("Time (ms)"), unit_of("run1/time"), unit_of("palm")
    ('ms', '', None)
    """
    found = _TIMES.fullmatch(name.strip("\"'").rpartition("/")[2])
    return None if found is None else (found["within"] or found["after"] or "").lower()


def listed(there: Mapping[str, tuple[int, ...]]) -> str:
    """Return the names and shapes of the first arrays, those that could hold pictures before the others."""
    first = sorted(there.items(), key=lambda one: len(one[1]) not in (2, 3))[:8]
    shown = [f"{name or 'an array'} ({' x '.join(map(str, shape)) or 'one number'})" for name, shape in first]
    return (", ".join(shown) or "no numbers") + " ..." * (len(there) > 8)


def _table(path: Path, how: Table) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, int]:
    """Return the readings, the times in s, and the number of the first line of numbers."""
    first = how.skip_lines + 1
    lines = [line for line in text.lines(path)[how.skip_lines :] if line.strip()]
    if not lines:
        raise FormatError(f"{path.name}, line {first}: no line after {how.skip_lines} skipped ones")
    names = _cells(lines[0], how)
    if len(names) > COLUMNS:
        raise FormatError(f"{path.name}, line {first}: {len(names)} columns; at most {COLUMNS} are read")
    other = next((mark for mark in ",;\t " if all(mark in line.strip() for line in lines[:2])), None)
    if len(names) == 1 and other is not None:
        raise FormatError(
            f"{path.name}, line {first}: one column by the separator {shown(how.separator)}, and {shown(other)} within "
            "it; say in the layout which it is: [table] separator"
        )
    named = not all(_is_number(cell, how) for cell in names)
    names = names if named else [f"column {k}" for k in range(1, len(names) + 1)]
    first += named
    column = _time_column(path, how, names, named)
    if column is None and (place := time_of(names)) is not None:
        time = names[place]
        raise FormatError(
            f"{path.name}, line {first - 1}: column {shown(time)} holds times by its name; say in the layout: [table] "
            f"time_column = {json.dumps(time, ensure_ascii=False)}, and time_unit if not s; or, if it is a taxel, skip "
            f"the names: skip_lines = {first - 1}"
        )
    missing = frozenset() if how.missing is None else frozenset({how.missing, "nan"})
    rows = (_cells(line, how) for line in islice(lines, int(named), None))
    values = text.numbers(rows, path, first, names, missing, unmarked=how.missing is None)
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
            raise FormatError(f"{path.name}: {counted(len(names), 'column')}; time_column is {column}")
        return column - 1
    if column not in names:
        there = ", ".join(names[:8]) + " ..." * (len(names) > 8) if named else "no names, so give its number from 1"
        raise FormatError(f"{path.name}: no column {shown(column)} of times; there are {there}")
    return names.index(column)


def _data(path: Path, how: Data) -> tuple[NDArray[Any], NDArray[np.float64] | None, str]:
    """Return the pictures, the times in s, and the names of the arrays that are not read."""
    if path.suffix.lower() == ".npy":
        key = next((key for key in ("array", "time") if getattr(how, key) is not None), None)
        if key is not None:
            size = as_size(getattr(how, key))
            right = f"a size is said by {size}" if size else "leave it out"
            raise FormatError(f"{path}: one array without a name; the layout says [data] {key}: {right}")
        try:
            arrays = {"": np.load(path, allow_pickle=False)}
        except (ValueError, EOFError) as error:
            raise FormatError(f"{path}: {first_line(error)}; must be a NumPy array of numbers") from None
        there: list[str] = [""]
        wanted = there
    else:
        every = shapes_of(path)
        there = list(every)
        if how.array is None and len(there) != 1:
            raise FormatError(f"{path}: holds {listed(every)}; say which in the layout: [data] array")
        # A path within a .h5 may begin at its root.
        named = [name if name in every else name.strip("/") for name in (how.array, how.time) if name is not None]
        wanted = [there[0], *named] if how.array is None else named
        missing = next((name for name in wanted if name not in there), None)
        if missing is not None:
            size = as_size(missing)
            hint = f"; a size is said by {size}" if size else ""
            raise FormatError(f"{path}: holds no array {missing}; there are {listed(every)}{hint}")
        arrays = arrays_of(path, wanted)
    values, unread = arrays[wanted[0]], ", ".join(name for name in there if name not in wanted)
    if values.dtype.kind not in "uifb" or values.ndim not in (2, 3) or 0 in values.shape:
        shape = " x ".join(map(str, values.shape))
        raise FormatError(
            f"{path}, {wanted[0] or 'the array'}: {values.dtype} of shape {shape}; must be numbers of shape "
            "pictures x rows x columns, or pictures x taxels"
        )
    # VALUE is no number of 16 bits.
    large = np.argwhere(np.abs(values) > np.float64(VALUE))
    if len(large):
        picture, *place = map(int, large[0])
        at = f"row {place[0]}, column {place[1]}" if len(place) == 2 else f"taxel {place[0]}"
        raise FormatError(
            f"{path}, {wanted[0] or 'the array'}, picture {picture}, {at}: {values[tuple(large[0])]}; must fit 32 "
            "bits, or be NaN where it is missing"
        )
    if len(wanted) == 1:
        return values, None, unread
    times = arrays[wanted[1]].astype(np.float64)
    if times.shape != values.shape[:1]:
        raise FormatError(f"{path}, {wanted[1]}: {counted(times.size, 'time')} for {counted(len(values), 'picture')}")
    return values, times * UNITS_US[how.time_unit] / 1e6, unread


def shapes_of(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of numbers by name; the one of a .npy has the name ""."""
    if path.suffix.lower() in (".npy", ".npz"):
        return shapes(path)
    with H5File(path) as h5:
        return {name: entry.shape for name, entry in h5.entries.items() if entry.is_numbers}


def arrays_of(path: Path, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Read the arrays of these names of a .npz or .h5."""
    if path.suffix.lower() == ".npz":
        return read_arrays(path, names)
    with H5File(path) as h5:
        return {name: h5.numbers(name) for name in names}
