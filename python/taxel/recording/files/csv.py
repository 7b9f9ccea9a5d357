"""Tables of text that taxel writes and reads: a .csv of events or of frames.

A .csv has either the columns ``t_us,x,y,p[,intensity][,repaired]`` (an empty intensity is an absent one), or ``t_us``
and a column a taxel, named ``x3y5``. A spreadsheet may have saved it: with semicolons or tabs, then with decimal commas
too, and in UTF-16. A table with other columns behind ``t_us`` is one of another program.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen_whole
from taxel._base.errors import unreadable
from taxel._base.header_table import separator_of
from taxel._base.limits import COLUMNS, TAXELS
from taxel._base.messages import counted
from taxel._base.table_text import Text
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.form import Form
from taxel.formats.layout import Table
from taxel.formats.lines import odd_lines
from taxel.formats.table import Rows, around, events_of, read_rows
from taxel.formats.times import in_order
from taxel.frames import Frames
from taxel.reading import Facts, InMemory

#: Columns of events: those that a table must have, and those that may follow.
EVENTS = ("t_us", "x", "y", "p")
MORE = ("intensity", "repaired")
#: Number of frames that are written at once.
_FRAMES = 4096
_TAXEL = re.compile(r"x([0-9]{1,5})y([0-9]{1,5})")


def read_csv(path: Path, array: Array | None = None) -> InMemory:
    """Read a .csv of events or of frames.

    Lines that are none are left out and counted, and times of frames are repaired, as those of other tables are.

    Raises
    ------
    FormatError : another header, or an invalid value (names line and column)
    """
    text = Text(path)
    names, separator = head_of(text)
    is_comma = separator != "," and any("," in line for line in text.head[1:])
    how = Table(separator=separator, decimal="," if is_comma else ".", time_column=1, time_unit="us")
    how = replace(how, events=tuple(names[:4]) == EVENTS)
    form = Form(how, tuple(names), 1)
    if any(line.strip() for line in text.head[1:]):
        rows = read_rows(text, form, ends_empty=names[-1] == "intensity")
    else:
        rows = Rows.none(len(names) - 1)
    lost = odd_lines(rows.odd)
    try:
        if tuple(names[:4]) == EVENTS:
            table: Events | Frames = events_of(path, form, names[1:], rows, array)
        else:
            table = _frames(path, names[1:], rows, array, lost)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None
    return InMemory(Facts(path=path, array=table.array, kind="csv", lost=tuple(lost)), table)


def names_in(line: str) -> tuple[list[str], str]:
    """Return the cells of a first line, without blanks around them, and what separates them."""
    separator = separator_of(line)
    return [name.strip() for name in line.split(separator)], separator


def first_line_of(path: Path) -> str | None:
    """Return the first line of a text, "" of an empty one; None of what is no text, as its reader then says."""
    try:
        return next(iter(Text(path).lines()), "")
    except FormatError:
        return None


def is_of_taxel(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do: t_us,x,y,p or t_us,x0y0."""
    names, _ = names_in(first_line_of(path) or "")
    return tuple(names[:4]) == EVENTS or (names[0] == EVENTS[0] and any(map(_TAXEL.fullmatch, names[1:2])))


def head_of(text: Text) -> tuple[list[str], str]:
    """Return the names of the columns in the first line, and what separates the cells.

    Raises
    ------
    FormatError : none of a recording
    """
    path = text.path
    names, separator = names_in(next(iter(text.head), ""))
    if len(names) > COLUMNS:
        raise unreadable(f"{len(names)} columns; must have at most {COLUMNS}", path, line=1)
    if tuple(names[:4]) == EVENTS and names[4:] != [name for name in MORE if name in names[4:]]:
        more = shown(",".join(names[4:]))
        raise unreadable(f"{more} after p: only intensity and repaired may follow", path, line=1)
    repeated = next((name for name, n in Counter(names).items() if n > 1), None)
    if repeated is not None:
        raise unreadable(f"column {shown(repeated)} appears twice", path, line=1)
    return names, separator


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


def _frames(path: Path, names: Sequence[str], rows: Rows, array: Array | None, said: list[str]) -> Frames:
    places = _places(path, names, array)
    x, y = np.array(places).T
    height, width = (int(y.max()) + 1, int(x.max()) + 1) if array is None else array.shape
    if array is None and height * width > min(TAXELS, max(1 << 16, 16 * len(places))):
        size = f"{counted(len(places), 'column')} for {height} x {width} taxels"
        raise unreadable(f"{size}: most are missing", path, line=1)
    if x.max() >= width or y.max() >= height:
        k = int(np.flatnonzero((x >= width) | (y >= height))[0])
        raise unreadable(f"column {names[k]!r} is outside {height} x {width} taxels", path, line=1)
    sensor = sensor_of(x, y) if array is None else array
    t, order = in_order(path, rows.times, "us", said)
    values = rows.values if order is None else rows.values[order]
    if np.array_equal(y * width + x, np.arange(height * width)):
        return Frames(frozen_whole(values.reshape(-1, height, width)), t, array=sensor)
    frames = np.zeros((len(values), height, width), np.float32)
    frames[:, y, x] = values
    return Frames(frozen_whole(frames), t, array=sensor)


def array_in_csv(table: Events | Frames) -> Array:
    """Return the sensor that a reader of the .csv assumes: the file holds neither name nor pitch."""
    if isinstance(table, Events):
        return around(table.x, table.y)
    return sensor_of(*np.array(_existing(table.array)).reshape(-1, 2).T)


def write_csv(file: BinaryIO, table: Events | Frames) -> None:
    """Write a .csv."""
    if isinstance(table, Frames):
        places = _existing(table.array)
        names = ",".join(["t_us", *(f"x{x}y{y}" for x, y in places)])
        file.write(names.encode() + b"\n")
        x, y = np.array(places).T
        for k in range(0, len(table), _FRAMES):
            values = table.values[k : k + _FRAMES, y, x]
            # Each value is written once; as bits, because 0 equals -0.
            bits, positions = np.unique(values.view(np.uint32), return_inverse=True)
            # str of a float32 is the shortest text that reads back as the same value; -0 would read back as a whole 0.
            texts = np.array([re.sub(r"(?<!^-0)\.0$", "", str(value)) for value in bits.view(np.float32)], object)
            rows = texts[positions.reshape(values.shape)].tolist()
            times = table.t[k : k + _FRAMES].tolist()
            file.writelines(f"{t},{','.join(row)}\n".encode() for t, row in zip(times, rows, strict=True))
        return
    import pandas as pd  # noqa: PLC0415  takes long

    columns: dict[str, Any] = dict(zip(EVENTS, (table.t, table.x, table.y, table.p.astype(np.uint8)), strict=True))
    if table.intensity is not None and table.present is not None:
        columns["intensity"] = pd.arrays.IntegerArray(table.intensity.copy(), ~table.present)
    if table.repaired is not None:
        columns["repaired"] = table.repaired.astype(np.uint8)
    pd.DataFrame(columns).to_csv(file, index=False, lineterminator="\n")


def _existing(array: Array) -> list[tuple[int, int]]:
    """Return column and row of each taxel that exists, row by row."""
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    return [(int(x), int(y)) for y, x in np.argwhere(exists)]
