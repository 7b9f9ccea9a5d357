"""Reads tables of text: a .csv of events or of frames.

A .csv has either the columns ``t_us,x,y,p[,intensity][,repaired]`` (an empty intensity is an absent one), or ``t_us``
and a column a taxel, named ``x3y5``, or, of channels, as they are called. A spreadsheet may have saved it: with
semicolons or tabs, then with decimal commas too, and in UTF-16.
"""

from __future__ import annotations

import io
import re
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import Growing
from taxel._base.encodings import as_utf_8
from taxel._base.header_table import separator_of
from taxel._base.limits import COLUMNS, LINE, TAXELS, VALUE
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import around
from taxel.formats.checks import table as limited
from taxel.formats.layout import advice
from taxel.frames import Frames
from taxel.reading import Facts, InMemory

#: Columns of events: those that a table must have, and those that may follow.
EVENTS = ("t_us", "x", "y", "p")
MORE = ("intensity", "repaired")
#: The first column, and what separates it from the second.
_FIRST = re.compile(rb" *t_us *([,;\t])")
_TAXEL = re.compile(r"x([0-9]{1,5})y([0-9]{1,5})")
#: Columns of events: the least and the largest number in the file, and the type in memory. -1 is an absent intensity.
_LIMITS: dict[str, tuple[int, int, type[Any]]] = {
    "p": (0, 1, np.bool_),
    "x": (0, 65_535, np.uint16),
    "y": (0, 65_535, np.uint16),
    "intensity": (-1, 65_535, np.uint16),
    "repaired": (0, 1, np.bool_),
}
#: Bytes of the first line, whose columns are counted for the error.
_HEAD = 1 << 26
#: Bytes of a table that are read at once.
_AT_ONCE = 1 << 22
#: The number of a table's line, and whole lines from there on.
_Block = tuple[int, bytes]


def read_csv(path: Path, array: Array | None = None) -> InMemory:
    """Read a .csv of events or of frames.

    Raises
    ------
    FormatError : another header, or an invalid value (names line and column)
    """
    table = limited(path, _table(path, array))
    return InMemory(Facts(path=path, array=table.array, kind="csv"), table)


def check_head(path: Path) -> None:
    """Refuse a table whose first line is none of a recording.

    Raises
    ------
    FormatError : another header
    """
    with open(path, "rb") as file:
        _head(path, as_utf_8(str(path), file))


def _head(path: Path, file: BinaryIO) -> tuple[list[str], bytes]:
    """Return the names of the columns, and what separates the cells."""
    head = file.readline(_HEAD + 1)
    if len(head) > _HEAD:
        raise FormatError(f"{path}, line 1: the line has more than {_HEAD} bytes; must have at most {_HEAD}")
    return _names(path, head), _separator(head)


def _table(path: Path, array: Array | None) -> Events | Frames:
    with open(path, "rb") as raw:
        file = as_utf_8(str(path), raw)
        names, separator = _head(path, file)
        if tuple(names[:4]) == EVENTS:
            return _csv_events(path, names, _blocks(path, file, separator), array)
        return _csv_frames(path, names, _blocks(path, file, separator), array)


def _names(path: Path, head: bytes) -> list[str]:
    """Return the names of the columns in the first line."""
    columns = head.count(_separator(head)) + 1
    if columns > COLUMNS:
        raise FormatError(f"{path}, line 1: {columns} columns; must have at most {COLUMNS}")
    names = names_in(head)
    if names[0] != "t_us" or len(names) < 2:
        begin = repr(_text_of(head)[:40].decode("utf-8", "replace"))
        raise FormatError(
            f"{path}, line 1: {begin}: must be t_us,x,y,p[,intensity][,repaired], or t_us and a column for each taxel; "
            + advice(path, "describe a table of another program")
        )
    if tuple(names[:4]) == EVENTS:
        if names[4:] != [name for name in MORE if name in names[4:]]:
            raise FormatError(
                f"{path}, line 1: {shown(','.join(names[4:]))} after p: only intensity and repaired may follow"
            )
        return names
    repeated = next((name for name, n in Counter(names).items() if n > 1), None)
    if repeated is not None:
        raise FormatError(f"{path}, line 1: column {shown(repeated)} appears twice")
    return names


def names_in(head: bytes) -> list[str]:
    """Return the cells of a first line, without blanks around them."""
    try:
        text = _text_of(head).decode()
    except UnicodeDecodeError:
        # As in other tables of text.
        text = _text_of(head).decode("latin-1")
    return [name.strip() for name in text.split(_separator(head).decode())]


def _separator(head: bytes) -> bytes:
    """Return what separates the cells of a table by its first line, in which other names may hold it too."""
    first = _FIRST.match(_text_of(head))
    return separator_of(head.decode("latin-1")).encode() if first is None else first[1]


def _text_of(head: bytes) -> bytes:
    """Return a first line without the mark of UTF-8 and without its end."""
    return head.removeprefix(b"\xef\xbb\xbf").rstrip(b"\r\n")


def _blocks(path: Path, file: BinaryIO, separator: bytes) -> Iterator[_Block]:
    """Yield whole lines below the header, and the number of the first of them: a large table is not in memory twice.

    Cells are separated by commas in them, and decimal commas are points.
    """
    first = 2
    while block := file.read(_AT_ONCE):
        block += (end := file.readline(LINE + 1))
        if len(end) > LINE:
            line = first + block.count(b"\n")
            raise FormatError(f"{path}, line {line}: the line has more than {LINE} bytes; must have at most {LINE}")
        if separator != b",":
            block = block.replace(b",", b".").replace(separator, b",")
        yield first, block.replace(b"\r\n", b"\n")
        first += block.count(b"\n")


def _csv_events(path: Path, names: list[str], blocks: Iterator[_Block], array: Array | None) -> Events:
    kinds = {name: _LIMITS[name][2] for name in names if name in _LIMITS}
    kinds |= {"t_us": np.int64} | ({"present": np.bool_} if "intensity" in names else {})
    read = Growing(str(path), **{name: ((), kind) for name, kind in kinds.items()})
    for first, block in blocks:
        # An empty intensity means none; -1 represents it while numbers are read.
        body = re.sub(rb",[ \t]*(?=,|\n|$)", b",-1", block) if "intensity" in names else block
        columns = dict(zip(names, _numbers(path, names, first, body, np.int64).T, strict=True))
        for name, (low, high, _) in _LIMITS.items():
            if name in columns:
                _within(path, first, body, name, columns[name], low, high)
        if "intensity" in columns:
            columns["present"] = columns["intensity"] >= 0
            columns["intensity"] = np.maximum(columns["intensity"], 0)
        read.add(**columns)
    t, x, y, p = (read.column(name) for name in EVENTS)
    extra: dict[str, Any] = {name: read.column(name) for name in (*MORE, "present") if name in kinds}
    try:
        return Events(t, x, y, p, array=array or around(x, y), **extra)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def sensor_of(x: NDArray[np.int64], y: NDArray[np.int64], names: list[str] | None = None) -> Array:
    """Return the sensor whose taxels are these columns and rows."""
    exists = np.zeros((int(y.max()) + 1, int(x.max()) + 1), bool)
    exists[y, x] = True
    return Array(*exists.shape, exists=None if exists.all() else exists, names=names)


def _places(path: Path, names: list[str], array: Array | None) -> tuple[list[tuple[int, int]], list[str] | None]:
    """Return column and row of each taxel, and their names where those do not say them."""
    matches = [_TAXEL.fullmatch(name) for name in names]
    if all(matches):
        places = [(int(m[1]), int(m[2])) for m in matches if m is not None]
        if array is not None and array.rows > 1 and places == [(k, 0) for k in range(array.rows * array.columns)]:
            # A row of as many channels.
            places = [(k % array.columns, k // array.columns) for k in range(len(places))]
        return places, None
    if any(matches):
        odd = names[matches.index(None)]
        raise FormatError(f"{path}, line 1: column {shown(odd)} must be named like x3y5, as the other taxels are")
    rows, columns = (1, len(names)) if array is None else array.shape
    if rows * columns != len(names):
        raise FormatError(
            f"{path}, line 1: {counted(len(names), 'column')} for taxels; must have {rows * columns}, for "
            f"{rows} x {columns} taxels"
        )
    return [(k % columns, k // columns) for k in range(len(names))], names


def _csv_frames(path: Path, names: list[str], blocks: Iterator[_Block], array: Array | None) -> Frames:
    places, called = _places(path, names[1:], array)
    x, y = np.array(places).T
    rows, columns = (int(y.max()) + 1, int(x.max()) + 1) if array is None else array.shape
    sparse = f"{path}, line 1: {counted(len(places), 'column')} for {rows} x {columns} taxels: most are missing"
    if array is None:
        if rows * columns > TAXELS:
            raise FormatError(sparse)
        try:
            sensor = sensor_of(x, y, called)
        except ProblemError as error:
            raise FormatError(f"{path}, line 1: {error}") from None
    elif x.max() >= columns or y.max() >= rows:
        k = int(np.flatnonzero((x >= columns) | (y >= rows))[0])
        raise FormatError(f"{path}, line 1: column {names[k + 1]!r} is outside {rows} x {columns} taxels")
    else:
        sensor = array if called is None else replace(array, names=called)
    read = Growing(str(path), t=((), np.int64), values=((rows, columns), np.float32))
    # A line may be about many taxels that do not exist.
    at_once = max(1, _AT_ONCE // (rows * columns))
    for first, body in blocks:
        table = _numbers(path, names, first, body, np.float64)
        _check_values(path, names, first, body, table)
        t = _whole(path, first, body, table[:, 0])
        n = len(read) + len(table)
        if array is None and n * rows * columns > max(1 << 24, 16 * n * len(names)):
            raise FormatError(sparse)
        for k in range(0, len(table), at_once):
            block = table[k : k + at_once]
            frames = np.zeros((len(block), rows, columns), np.float32)
            frames[:, y, x] = block[:, 1:]
            read.add(t=t[k : k + at_once], values=frames)
    try:
        return Frames(read.column("values"), read.column("t"), array=sensor)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def _numbers(path: Path, names: list[str], first: int, body: bytes, dtype: type[Any]) -> NDArray[Any]:
    """Read rows, whose first line has a number; an error names line and column."""
    if not body.strip():
        return np.empty((0, len(names)), dtype)
    try:
        with warnings.catch_warnings():
            # Older NumPy, as 2.1, cuts a decimal to a whole number with no more than this warning.
            warnings.simplefilter("error", DeprecationWarning)
            table = np.loadtxt(io.BytesIO(body), dtype=dtype, delimiter=",", comments=None, ndmin=2)
    except (ValueError, OverflowError) as error:
        match = re.search(r"at row (\d+)(?:, column (\d+))?", str(error))
        # NumPy counts rows from 0 in one of its messages, and from 1 in the other.
        row = 0 if match is None else int(match[1]) - ("changed" in str(error))
        where = "" if match is None else f", line {first + _line_number(body, row)}"
        if match is not None and match[2] is not None and int(match[2]) <= len(names):
            where += f", column {names[int(match[2]) - 1]}"
        reason = re.sub(r" at row .*|; use `usecols`.*", "", first_line(error))
        raise FormatError(f"{path}{where}: {reason}; must be {len(names)} numbers per line") from None
    if table.shape[1] != len(names):
        raise FormatError(
            f"{path}, line {first + _line_number(body, 0)}: {table.shape[1]} numbers; must be {len(names)} numbers per "
            "line"
        )
    return table


def _check_values(path: Path, names: list[str], first: int, body: bytes, table: NDArray[np.float64]) -> None:
    """Refuse a value that 32 bits do not hold, in lines of which the first has a number."""
    large = np.argwhere(np.abs(table[:, 1:]) > VALUE)
    if len(large):
        k, c = large[0]
        line = first + _line_number(body, k)
        raise FormatError(f"{path}, line {line}, column {names[c + 1]}: is {table[k, c + 1]:g}; must fit 32 bits")


def _whole(path: Path, first: int, body: bytes, times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the times of some lines as whole us; the first line has a number."""
    with np.errstate(invalid="ignore"):
        t = times.astype(np.int64)
    broken = np.flatnonzero(t != times)
    if len(broken):
        k = int(broken[0])
        line = first + _line_number(body, k)
        raise FormatError(f"{path}, line {line}, column t_us: is {times[k]:g}; must be a whole number of us")
    return t


def _line_number(body: bytes, row: int) -> int:
    """Return the number of the line, counted from 0, of a row of numbers; empty lines are not rows."""
    rows = -1
    for k, line in enumerate(body.split(b"\n")):
        rows += bool(line.strip())
        if rows == row:
            return k
    return row


def _within(path: Path, first: int, body: bytes, name: str, column: NDArray[Any], low: int, high: int) -> None:
    wrong = np.flatnonzero((column < low) | (column > high))
    if len(wrong):
        k = int(wrong[0])
        line = first + _line_number(body, k)
        raise FormatError(f"{path}, line {line}, column {name}: is {column[k]}; must be from {max(0, low)} to {high}")
