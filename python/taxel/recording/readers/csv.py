"""Reads tables of text: a .csv of events or of frames.

A .csv has either the columns ``t_us,x,y,p[,intensity][,repaired]`` (an empty intensity is an absent one), or ``t_us``
and a column a taxel, named ``x3y5``. A spreadsheet may have saved it: with semicolons or tabs, then with decimal commas
too, and in UTF-16. A table with other columns behind ``t_us`` is one of another program.
"""

from __future__ import annotations

import io
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen_whole
from taxel._base.errors import unreadable
from taxel._base.limits import COLUMNS, TAXELS, VALUE
from taxel._base.messages import counted
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import around
from taxel.formats.table_text import Text, beginning
from taxel.frames import Frames
from taxel.reading import Facts, InMemory

#: Columns of events: those that a table must have, and those that may follow.
EVENTS = ("t_us", "x", "y", "p")
MORE = ("intensity", "repaired")
_TAXEL = re.compile(r"x([0-9]{1,5})y([0-9]{1,5})")
_OURS = re.compile(r" *t_us *[,;\t] *(?:x *[,;\t] *y *[,;\t] *p *(?:[,;\t\r\n]|$)|x\d{1,5}y\d{1,5} *(?:[,;\t\r\n]|$))")
#: Columns of events: the least and the largest number in the file, and the type in memory.
_LIMITS: dict[str, tuple[int, int, type[Any]]] = {
    "t_us": (-(1 << 62), 1 << 62, np.int64),
    "x": (0, 65_535, np.uint16),
    "y": (0, 65_535, np.uint16),
    "p": (0, 1, np.bool_),
    "intensity": (0, 65_535, np.uint16),
    "repaired": (0, 1, np.bool_),
}
#: An empty cell.
_EMPTY = re.compile(r",[ \t]*(?=,|\n|$)")
#: Characters of a table that are converted at once.
_AT_ONCE = 1 << 22


def read_csv(path: Path, array: Array | None = None) -> InMemory:
    """Read a .csv of events or of frames.

    Raises
    ------
    FormatError : another header, or an invalid value (names line and column)
    """
    text = Text(path)
    names, separator = _head(path, text)
    read = _events if tuple(names[:4]) == EVENTS else _frames
    try:
        table = read(text, names, separator, array)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None
    return InMemory(Facts(path=path, array=table.array, kind="csv"), table)


def check_head(path: Path) -> None:
    """Refuse a table whose first line is none of a recording.

    Raises
    ------
    FormatError : another header
    """
    _head(path, Text(path))


def names_in(line: str) -> tuple[list[str], str]:
    """Return the cells of a first line, without blanks around them, and what separates them: t_us is the first."""
    first = re.match(r" *t_us *([,;\t])", line)
    separator = first[1] if first else max(",;\t", key=line.count)
    return [name.strip() for name in line.split(separator)], separator


def is_of_taxel(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do: t_us,x,y,p or t_us,x0y0."""
    head = beginning(path, 64)
    is_utf_16 = head.startswith((b"\xff\xfe", b"\xfe\xff"))
    text = head[: len(head) // 2 * 2].decode("utf-16", "ignore") if is_utf_16 else head.decode("utf-8-sig", "ignore")
    return _OURS.match(text) is not None


def _head(path: Path, text: Text) -> tuple[list[str], str]:
    """Return the names of the columns in the first line, and what separates the cells."""
    line = next(iter(text.head), "")
    names, separator = names_in(line)
    if len(names) > COLUMNS:
        raise unreadable(f"{len(names)} columns; must have at most {COLUMNS}", path, line=1)
    if tuple(names[:4]) == EVENTS and names[4:] != [name for name in MORE if name in names[4:]]:
        more = shown(",".join(names[4:]))
        raise unreadable(f"{more} after p: only intensity and repaired may follow", path, line=1)
    repeated = next((name for name, n in Counter(names).items() if n > 1), None)
    if repeated is not None:
        raise unreadable(f"column {shown(repeated)} appears twice", path, line=1)
    return names, separator


def _blocks(text: Text, names: Sequence[str], separator: str, kind: type[Any]) -> Iterator[NDArray[Any]]:
    """Yield the numbers of some lines after the others; an empty intensity is -1."""
    for k, lines in enumerate(text.blocks(_AT_ONCE)):
        block = lines.partition("\n")[2] if k == 0 else lines
        if separator != ",":
            block = block.replace(",", ".").replace(separator, ",")
        if "intensity" in names:
            block = _EMPTY.sub(",-1", block)
        if not block.strip():
            continue
        try:
            read = np.loadtxt(io.StringIO(block), kind, delimiter=",", comments=None, ndmin=2)
        except (ValueError, OverflowError):
            _refuse_line(text, names, separator)
        if read.shape[1] != len(names):
            _refuse_line(text, names, separator)
        yield read


def _refuse_line(text: Text, names: Sequence[str], separator: str) -> NoReturn:
    """Refuse the first line below the names that is not a number for each."""
    for number, line in enumerate(text.lines(), 1):
        cells = [cell.strip() for cell in line.split(separator)]
        if number == 1 or not line.strip():
            continue
        if len(cells) != len(names):
            raise unreadable(f"{len(cells)} cells; must be {len(names)} numbers per line", text.path, line=number)
        for name, cell in zip(names, cells, strict=True):
            right = _right(name, cell if separator == "," else cell.replace(",", "."), names)
            if right:
                raise unreadable(f"column {name}: is {shown(cell)}; {right}", text.path, line=number)
    raise unreadable("must be a number for each column in each line", text.path)


def _right(name: str, cell: str, names: Sequence[str]) -> str:
    """Return what a cell must be, "" if it is so."""
    are_events = tuple(names[:4]) == EVENTS
    try:
        value = float(cell)
    except ValueError:
        return "" if cell == "" and are_events and name == "intensity" else "must be a number"
    if name != "t_us" and not are_events:
        return "" if math.isnan(value) or abs(value) <= VALUE else "must fit 32 bits"
    low, high, _ = _LIMITS[name]
    if value.is_integer() and low <= value <= high:
        return ""
    return "must be a whole number of us" if name == "t_us" else f"must be from {low} to {high}"


def _events(text: Text, names: Sequence[str], separator: str, array: Array | None) -> Events:
    read = np.concatenate([*_blocks(text, names, separator, np.int64), np.empty((0, len(names)), np.int64)])
    columns: dict[str, Any] = dict(zip(names, read.T, strict=True))
    if "intensity" in columns:
        present = columns["intensity"] != -1
        columns |= {"present": present, "intensity": np.where(present, columns["intensity"], 0)}
    for name in names:
        low, high, kind = _LIMITS[name]
        if ((columns[name] < low) | (columns[name] > high)).any():
            _refuse_line(text, names, separator)
        columns[name] = columns[name].astype(kind)
    t, x, y, p = (columns.pop(name) for name in EVENTS)
    return Events(t, x, y, p, array=array or around(x, y), **columns)


def sensor_of(x: NDArray[np.int64], y: NDArray[np.int64]) -> Array:
    """Return the sensor whose taxels are these columns and rows."""
    exists = np.zeros((int(y.max()) + 1, int(x.max()) + 1), bool)
    exists[y, x] = True
    return Array(*exists.shape, exists=None if exists.all() else exists)


def _places(path: Path, names: Sequence[str], array: Array | None) -> list[tuple[int, int]]:
    """Return column and row of each taxel."""
    matches = [_TAXEL.fullmatch(name) for name in names]
    if not all(matches):
        odd = names[matches.index(None)]
        raise unreadable(f"column {shown(odd)} must be named like x3y5, as the other taxels are", path, line=1)
    places = [(int(m[1]), int(m[2])) for m in matches if m is not None]
    if array is not None and array.rows > 1 and places == [(k, 0) for k in range(array.rows * array.columns)]:
        # A row of as many channels.
        places = [(k % array.columns, k // array.columns) for k in range(len(places))]
    return places


def _frames(text: Text, names: Sequence[str], separator: str, array: Array | None) -> Frames:
    path, places = text.path, _places(text.path, names[1:], array)
    x, y = np.array(places).T
    rows, columns = (int(y.max()) + 1, int(x.max()) + 1) if array is None else array.shape
    if array is None and rows * columns > min(TAXELS, max(1 << 16, 16 * len(places))):
        size = f"{counted(len(places), 'column')} for {rows} x {columns} taxels"
        raise unreadable(f"{size}: most are missing", path, line=1)
    if x.max() >= columns or y.max() >= rows:
        k = int(np.flatnonzero((x >= columns) | (y >= rows))[0])
        raise unreadable(f"column {names[k + 1]!r} is outside {rows} x {columns} taxels", path, line=1)
    sensor = sensor_of(x, y) if array is None else array
    times, values = list[NDArray[np.int64]](), list[NDArray[np.float32]]()
    for block in _blocks(text, names, separator, np.float64):
        if (np.abs(block[:, 1:]) > VALUE).any() or (block[:, 0] % 1 != 0).any():
            _refuse_line(text, names, separator)
        frames = np.zeros((len(block), rows, columns), np.float32)
        frames[:, y, x] = block[:, 1:]
        times.append(block[:, 0].astype(np.int64))
        values.append(frames)
    t = np.concatenate([*times, np.empty(0, np.int64)])
    together = np.concatenate([*values, np.empty((0, rows, columns), np.float32)])
    return Frames(frozen_whole(together), t, array=sensor)
