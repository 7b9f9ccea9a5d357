"""Tables of text: a .csv of events or of pictures.

A .csv has either the columns ``t_us,x,y,p[,intensity][,repaired]`` (an empty intensity is an absent one), or ``t_us``
and a column a taxel, named ``x3y5``.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.limits import COLUMNS, TAXELS, VALUE, unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import table as limited
from taxel.frames import Frames
from taxel.recording.contents import Contents
from taxel.recording.npz import around

__all__ = ["array_in_csv", "read_csv", "write_csv"]

_EVENTS = ("t_us", "x", "y", "p")
_MORE = ("intensity", "repaired")
_TAXEL = re.compile(r"x(\d{1,5})y(\d{1,5})")


def array_in_csv(table: Events | Frames) -> Array:
    """Return the sensor that a reader of the .csv assumes: the file holds neither name nor pitch."""
    if isinstance(table, Events):
        return around(table.x, table.y)
    x, y = np.array(_places(table.array)).reshape(-1, 2).T
    rows, columns = int(y.max()) + 1, int(x.max()) + 1
    exists = np.zeros((rows, columns), bool)
    exists[y, x] = True
    return Array(rows, columns, exists=None if exists.all() else exists)


def write_csv(file: BinaryIO, contents: Contents) -> None:
    """Write a .csv."""
    table = contents.table
    if isinstance(table, Frames):
        places = _places(table.array)
        names = ",".join(["t_us", *(f"x{x}y{y}" for x, y in places)])
        file.write(names.encode() + b"\n")
        for t, picture in zip(table.t, table.values, strict=True):
            # repr of a float32 is the shortest text that reads back as the same value.
            values = (_shortest(picture[y, x]) for x, y in places)
            file.write(",".join([str(t), *values]).encode() + b"\n")
        return
    columns: list[NDArray[Any]] = [table.t, table.x, table.y, table.p.astype(np.uint8)]
    more = [name for name in _MORE if getattr(table, name) is not None]
    file.write(",".join([*_EVENTS, *more]).encode() + b"\n")
    block = 1 << 16
    for k in range(0, len(table), block):
        rows = [column[k : k + block].astype(str) for column in columns]
        if table.intensity is not None and table.present is not None:
            ticks = table.intensity[k : k + block].astype(str)
            rows.append(np.where(table.present[k : k + block], ticks, ""))
        if table.repaired is not None:
            rows.append(table.repaired[k : k + block].astype(np.uint8).astype(str))
        file.write("\n".join(map(",".join, zip(*(r.tolist() for r in rows), strict=True))).encode() + b"\n")


def read_csv(path: Path, array: Array | None) -> Contents:
    """Read a .csv of events or of pictures.

    Raises
    ------
    FormatError : another header, or an invalid value (names line and column)
    """
    table = limited(path, _table(path, array))
    events, frames = (table, None) if isinstance(table, Events) else (None, table)
    return Contents(path, path.name, "csv", table.array, events=events, frames=frames)


def _table(path: Path, array: Array | None) -> Events | Frames:
    raw = path.read_bytes().replace(b"\r\n", b"\n").removeprefix(b"\xef\xbb\xbf")
    head, _, body = raw.partition(b"\n")
    columns = head.count(b",") + 1
    if columns > COLUMNS:
        raise FormatError(f"{path}, line 1: {columns} columns; at most {COLUMNS} are read")
    try:
        names = [name.strip() for name in head.decode().split(",")]
    except UnicodeDecodeError:
        names = []
    if not names or names[0] != "t_us" or len(names) < 2:
        begin = repr(head[:40].decode("utf-8", "replace"))
        raise FormatError(
            f"{path}, line 1: {begin}: must be t_us,x,y,p[,intensity][,repaired], or t_us and a column a taxel"
        )
    if tuple(names[:4]) == _EVENTS:
        if names[4:] != [name for name in _MORE if name in names[4:]]:
            raise FormatError(
                f"{path}, line 1: {shown(','.join(names[4:]))} after p: only intensity and repaired may follow"
            )
        return _csv_events(path, names, body, array)
    repeated = next((name for name, n in Counter(names).items() if n > 1), None)
    if repeated is not None:
        raise FormatError(f"{path}, line 1: column {shown(repeated)} stands there twice")
    return _csv_frames(path, names, body, array)


def _csv_events(path: Path, names: list[str], body: bytes, array: Array | None) -> Events:
    if "intensity" in names:
        # An empty intensity is an absent one; -1 stands for it while numbers are read.
        body = re.sub(rb",[ \t]*(?=,|\n|$)", b",-1", body)
    table = _numbers(path, names, body, np.int64)
    t, x, y, p = table[:, :4].T
    _within(path, "p", p, 0, 1)
    for name, column in (("x", x), ("y", y)):
        _within(path, name, column, 0, 65_535)
    extra: dict[str, Any] = {}
    if "intensity" in names:
        ticks = table[:, names.index("intensity")]
        _within(path, "intensity", ticks, -1, 65_535)
        extra = {"intensity": np.maximum(ticks, 0), "present": ticks >= 0}
    if "repaired" in names:
        repaired = table[:, names.index("repaired")]
        _within(path, "repaired", repaired, 0, 1)
        extra["repaired"] = repaired.astype(bool)
    try:
        return Events(t, x, y, p.astype(bool), array=array or around(x, y), **extra)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def _csv_frames(path: Path, names: list[str], body: bytes, array: Array | None) -> Frames:
    table = _numbers(path, names, body, np.float64)
    matches = [_TAXEL.fullmatch(name) for name in names[1:]]
    if all(matches):
        places = [(int(m[1]), int(m[2])) for m in matches if m is not None]
    elif any(matches):
        odd = next(name for name, m in zip(names[1:], matches, strict=True) if m is None)
        raise FormatError(f"{path}, line 1: column {shown(odd)} among taxels: must be named like x3y5")
    else:
        shape = (1, len(names) - 1) if array is None else array.shape
        if shape[0] * shape[1] != len(names) - 1:
            raise FormatError(
                f"{path}, line 1: {len(names) - 1} columns for an array of {shape[0]} x {shape[1]} taxels"
            )
        places = [(k % shape[1], k // shape[1]) for k in range(len(names) - 1)]
    x, y = np.array(places).T
    if array is None:
        rows, columns = int(y.max()) + 1, int(x.max()) + 1
        if rows * columns > TAXELS or len(table) * rows * columns > max(1 << 24, 16 * table.size):
            raise FormatError(f"{path}, line 1: {len(places)} columns for {rows} x {columns} taxels: most are missing")
        exists = np.zeros((rows, columns), bool)
        exists[y, x] = True
        array = Array(rows, columns, exists=None if exists.all() else exists)
    elif x.max() >= array.columns or y.max() >= array.rows:
        k = int(np.flatnonzero((x >= array.columns) | (y >= array.rows))[0])
        raise FormatError(f"{path}, line 1: column {names[k + 1]!r} lies outside {array.rows} x {array.columns} taxels")
    large = np.argwhere(np.abs(table[:, 1:]) > VALUE)
    if len(large):
        k, c = large[0]
        raise FormatError(f"{path}, line {k + 2}, column {names[c + 1]}: {table[k, c + 1]:g}; must fit 32 bits")
    unpacked(str(path), 4 * len(table) * array.rows * array.columns)
    values = np.zeros((len(table), *array.shape), np.float32)
    values[:, y, x] = table[:, 1:]
    try:
        return Frames(frozen(values), table[:, 0], array=array)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def _numbers(path: Path, names: list[str], body: bytes, dtype: type[Any]) -> NDArray[Any]:
    """Read the rows below the header; an error names line and column."""
    if not body.strip():
        return np.empty((0, len(names)), dtype)
    try:
        table = np.loadtxt(io.BytesIO(body), dtype=dtype, delimiter=",", comments=None, ndmin=2)
    except (ValueError, OverflowError) as error:
        place = re.search(r"at row (\d+)(?:, column (\d+))?", str(error))
        # NumPy counts rows from 0 in one of its messages, and from 1 in the other.
        row = 0 if place is None else int(place[1]) - ("changed" in str(error))
        where = "" if place is None else f", line {_line_number(body, row)}"
        if place is not None and place[2] is not None and int(place[2]) <= len(names):
            where += f", column {names[int(place[2]) - 1]}"
        reason = re.sub(r" at row .*|; use `usecols`.*", "", first_line(error))
        raise FormatError(f"{path}{where}: {reason}; must be {len(names)} numbers a line") from None
    if table.shape[1] != len(names):
        raise FormatError(f"{path}, line 2: {table.shape[1]} numbers; must be {len(names)} numbers a line")
    return table


def _line_number(body: bytes, row: int) -> int:
    """Return the line number of a row of numbers; empty lines are not rows."""
    rows = -1
    for k, line in enumerate(body.split(b"\n")):
        rows += bool(line.strip())
        if rows == row:
            return k + 2
    return row + 2


def _within(path: Path, name: str, column: NDArray[Any], low: int, high: int) -> None:
    wrong = np.flatnonzero((column < low) | (column > high))
    if len(wrong):
        k = int(wrong[0])
        raise FormatError(f"{path}, line {k + 2}, column {name}: is {column[k]}; must be {max(0, low)} to {high}")


def _places(array: Array) -> list[tuple[int, int]]:
    """Return column and row of each taxel that exists, row by row."""
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    return [(int(x), int(y)) for y, x in np.argwhere(exists)]


def _shortest(value: np.float32) -> str:
    text = str(value)
    return text.removesuffix(".0")
