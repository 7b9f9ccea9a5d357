"""Reads tables of text of other programs as a layout file says: frames, of a line or several each, or events."""

from __future__ import annotations

import json
import math
from array import array
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import short, shown
from taxel._base.cells import (
    are_units,
    cells,
    ends_in_separator,
    seconds_of,
    times_of,
    unquote,
)
from taxel._base.columns import Growing
from taxel._base.limits import COLUMNS
from taxel._base.messages import counted, first_line
from taxel._base.number_text import float_of
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats import text
from taxel.formats.checks import in_s, whole_us
from taxel.formats.checks import table as limited
from taxel.formats.layout import Layout, Table
from taxel.formats.times import ISO, UNITS_US
from taxel.reading import Facts, InMemory
from taxel.recording.readers.columns import around


@dataclass(frozen=True, eq=False)
class Readings:
    """Hold what a file of another program says: readings, times in us, and the names of the taxels and of the rest."""

    values: NDArray[Any]
    t: NDArray[np.int64] | None
    #: What a frame is in the file, for errors.
    size: str
    #: The number of a frame's first line, or of the frame.
    line: Callable[[int], int] = int
    names: Sequence[str] | None = None
    lost: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Head:
    """Hold the lines above the numbers of a table, and how its lines are read."""

    path: Path
    how: Table
    #: The number of the first line of numbers, and the number of lines above it that are not empty.
    first: int
    above: int
    #: The names of all columns, and whether the table has them.
    names: Sequence[str]
    named: bool
    #: The places of the columns that are left out.
    left: Collection[int]
    #: Whether each line of numbers ends in a separator, after which there is no column.
    all_end: bool
    #: The rows at which there is an empty line, as the lines are read.
    blanks: array[int] = field(default_factory=lambda: array("q"))

    @classmethod
    def read(cls, path: Path, how: Table, taxels: int | None) -> _Head:
        """Read the lines above the numbers; `taxels` are those of a line, if the layout states them.

        Raises
        ------
        FormatError : it is not what the layout says (names the line)
        """
        skipped, lines = _beginning(path, how)
        if not lines:
            raise FormatError(
                f"{path.name}, line {how.skip_lines + 1}: no line follows the {how.skip_lines} skipped lines"
            )
        (first, text_of_first), *_ = lines
        names = cells(text_of_first, how.separator)
        if len(names) > COLUMNS:
            raise FormatError(f"{path.name}, line {first}: {len(names)} columns; must have at most {COLUMNS}")
        separator = next((mark for mark in ",;\t " if all(mark in line.strip() for _, line in lines[:2])), None)
        is_decimal = separator == how.decimal
        if len(names) == 1 and separator is not None and not is_decimal:
            raise FormatError(
                f"{path.name}, line {first}: the separator {shown(how.separator)} gives one column, which contains "
                f"{shown(separator)}; write the right separator in the layout file: [table] separator"
            )
        _refuse_skipped(path, how, skipped, len(names))
        named = not how.columns and not _are_of_frame(names, how)
        below = [cells(line, how.separator) for _, line in lines[named:]]
        # A line of units may be between names and numbers.
        units = below[0] if named and len(below) > 1 else []
        in_units = are_units(names, units) and (how.missing is None or unquote(how.missing) not in units)
        above = named + in_units
        begin = lines[above][1] if len(lines) > above else None
        if begin is not None:
            first = lines[above][0]
        # A last column may be empty everywhere, as of a taxel that is dead.
        others = len(how.leave_out) + (how.time_column is not None)
        is_whole = begin is not None and taxels is not None and len(cells(begin, how.separator)) == taxels + others
        all_end = not is_whole and begin is not None and _all_end(names if named else None, begin, path, how, above)
        if all_end and begin is not None:
            names = names[: len(cells(begin.rstrip(" ").removesuffix(how.separator), how.separator))]
        if how.columns and len(how.columns) != len(names):
            stated = counted(len(how.columns), "name")
            raise FormatError(
                f"{path.name}, line {first}: {counted(len(names), 'column')}, but the layout states {stated}"
            )
        names = list(how.columns) or (names if named else [f"column {k}" for k in range(1, len(names) + 1)])
        is_named = named or bool(how.columns)
        time = None if how.time_column is None else _column(path, "time_column", how.time_column, names, is_named)
        left = {_column(path, "leave_out", column, names, is_named) for column in how.leave_out}
        if time in left:
            raise FormatError(
                f"{path.name}: column {shown(names[time or 0])} is the time_column, but is also in leave_out; "
                f"remove it from one of them"
            )
        times = times_of([name if k not in left else "" for k, name in enumerate(names)])
        if time is None and times:
            name, at = names[times[0]], lines[0][0]
            raise FormatError(
                f"{path.name}, line {at}: column {shown(name)} contains times, as its name shows; write in the layout "
                f"file: [table] time_column = {json.dumps(name, ensure_ascii=False)}, and time_unit if the unit is not "
                f"s; or, if the column is a taxel, skip the names: skip_lines = {first - 1}"
            )
        return cls(path, how, first, above, names, is_named, left, all_end)

    @property
    def kept(self) -> list[str]:
        """The names of the columns that are not left out."""
        return [name for k, name in enumerate(self.names) if k not in self.left]

    @property
    def time(self) -> int | None:
        """Which of the columns that are kept holds the times."""
        if self.how.time_column is None:
            return None
        time = _column(self.path, "time_column", self.how.time_column, self.names, self.named)
        return time - sum(k < time for k in self.left)

    @property
    def lost(self) -> tuple[str, ...]:
        """The line of what is lost that names the columns that are left out."""
        names = ", ".join(self.names[k] or f"column {k + 1}" for k in sorted(self.left))
        return (f"columns that are not taxels: {names}",) if names else ()

    def line(self, row: int) -> int:
        """Return the number of the line of a row, after all were read."""
        return self.first + row + bisect_right(self.blanks, row)

    def rows(self) -> Iterator[list[str] | None]:
        """Yield the cells of each line of numbers that are kept, with decimal points; None for an empty line."""
        how, time, row = self.how, self.time, 0
        # Between frames, a line of separators alone is an empty one of a spreadsheet, if no cell may be empty.
        empty = how.separator if how.has_lines and how.missing != "" else ""
        for number, line in enumerate(islice(text.stream(self.path), self.first - 1, None), self.first):
            if how.is_between(line) or (empty and not line.strip(f" {empty}")):
                self.blanks.append(row)
                yield None
                continue
            texts = cells(line.rstrip(" ").removesuffix(how.separator) if self.all_end else line, how.separator)
            if self.left:
                texts = _without(texts, self.left, len(self.names), self.path, number)
            at = texts[time] if time is not None and time < len(texts) and how.time_unit == ISO else None
            if how.decimal == ",":
                texts = _with_points(texts, time if at is not None else None, self.kept, self.path, number)
            if at is not None and time is not None:
                texts[time] = _seconds(at, self.path, number)
            row += 1
            yield texts


def read_table(path: Path, layout: Layout) -> Readings:
    """Read a table of frames as its layout says.

    Raises
    ------
    FormatError : it differs from the layout, or a cell is not a number (names line and column)
    """
    how = layout.table or Table()
    taxels = None if layout.rows is None or layout.columns is None else layout.rows * layout.columns
    head = _Head.read(path, how, None if taxels is None else taxels // (how.frame_lines or 1))
    names, time = head.kept, head.time
    values, t = _read(head, how)
    width, rows = values.shape[1], len(values)
    lines = _lines_of_frame(head, rows, None if taxels is None else taxels // width)
    names_of_taxels = [name for k, name in enumerate(names) if k != time] if head.named and lines == 1 else None
    lost, end = head.lost, rows // lines * lines
    if end < rows:
        lost = (*lost, f"lines at the end that are not a whole frame: {rows - end} of {lines}")
    size = counted(width, "column") if lines == 1 else f"{lines} lines of {counted(width, 'column')} per frame"
    if how.has_lines:
        values = values[:end].reshape(-1, lines, width)
        t = None if t is None else t[:end:lines].copy()
    return Readings(values, t, size, lambda frame: head.line(frame * lines), names_of_taxels, lost)


def frames_hint(layout: Layout, taxels: int) -> str:
    """Return what a layout could say of a table whose lines are parts of frames, as the end of an error."""
    how, lines = layout.table or Table(), (layout.rows or 0) * (layout.columns or 0) // taxels
    if how.has_lines or lines < 2 or lines * taxels != (layout.rows or 0) * (layout.columns or 0):
        return ""
    return f"; if {lines} lines are a frame, write in the layout file: [table] frame_lines = {lines}"


def read_events(path: Path, layout: Layout, array: Array | None) -> InMemory:
    """Read a table of events as its layout says.

    Raises
    ------
    FormatError : no columns of events, a value that none has, or a time before the last one (names the line)
    """
    how = layout.table or Table()
    head = _Head.read(path, how, None)
    columns = [name for k, name in enumerate(head.kept) if k != head.time]
    if sorted(columns) != ["p", "x", "y"]:
        raise FormatError(
            f"{path}: the columns other than the time are {', '.join(columns)}; must be x, y, p for events"
        )
    read = Growing(str(path), t=((), np.int64), x=((), np.uint16), y=((), np.uint16), p=((), np.bool_))
    last = -(1 << 62)
    for line, block in text.blocks(head.rows(), path, head.first, head.kept, frozenset()):
        by_name = dict(zip(head.kept, block.T, strict=True))
        assert head.time is not None  # a layout of events names the column
        t = _us(block[:, head.time], head.kept[head.time], how, path, line)
        for name, least, most in (("x", 0, 65_534), ("y", 0, 65_534), ("p", -1, 1)):
            column = by_name[name]
            wrong = np.flatnonzero((column != np.rint(column)) | (column < least) | (column > most))
            if len(wrong):
                right = "0 or 1, or -1 or 1" if name == "p" else f"a whole number from 0 to {most}"
                at = int(wrong[0])
                raise FormatError(f"{path.name}, line {line + at}: {name} is {column[at]:g}; must be {right}")
        back = np.flatnonzero(np.diff(t, prepend=last) < 0)
        if len(back):
            at = int(back[0])
            before = in_s(last if at == 0 else t[at - 1])
            raise FormatError(
                f"{path.name}, line {line + at}: time {in_s(t[at])} s is before {before} s, the time of the line above"
            )
        last = int(t[-1])
        read.add(t=t, x=by_name["x"], y=by_name["y"], p=by_name["p"] > 0)
    t, x, y, p = (read.column(name) for name in ("t", "x", "y", "p"))
    try:
        events = Events(t, x, y, p, array=(array or around(x, y)) if layout.rows is None else layout.array(1))
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    limited(path, events)
    return InMemory(Facts(path=path, array=events.array, kind="table", lost=tuple(head.lost)), events)


def _lines_of_frame(head: _Head, rows: int, needed: int | None) -> int:
    """Return how many lines a frame has, which the empty lines of the table may not contradict.

    `needed` are those that hold all taxels, if the layout says how many there are.

    Raises
    ------
    FormatError : an empty line within a frame, or frames of several sizes (names the line)
    """
    how = head.how
    if not how.has_lines:
        return 1
    ends = [row for row in dict.fromkeys(head.blanks) if 0 < row < rows]
    if how.frame_lines is not None:
        wrong = next((row for row in ends if row % how.frame_lines), None)
        if wrong is not None:
            raise FormatError(
                f"{head.path.name}, line {head.line(wrong - 1) + 1}: an empty line follows "
                f"{counted(wrong % how.frame_lines, 'line')} of a frame, but frame_lines is {how.frame_lines}"
            )
        return how.frame_lines
    lines = ends[0] if ends else max(rows, 1)
    starts = [0, *ends]
    # The last frame may end with the file.
    for begin, end in pairwise(starts):
        if end - begin != (needed or lines):
            raise FormatError(
                f"{head.path.name}, line {head.line(begin)}: the frame has {counted(end - begin, 'line')}; must "
                f"have {needed or lines}" + ", like the first frame" * (needed is None)
            )
    if rows - starts[-1] > (needed or lines):
        raise FormatError(
            f"{head.path.name}, line {head.line(starts[-1])}: the frame has {counted(rows - starts[-1], 'line')}; "
            f"must have {needed or lines}"
        )
    return needed or lines


def _beginning(path: Path, how: Table) -> tuple[tuple[int, str] | None, list[tuple[int, str]]]:
    """Return the last line that the layout skips and the first three below it, those that are not empty, by number."""
    skipped, lines = None, list[tuple[int, str]]()
    for number, line in enumerate(text.stream(path), 1):
        if how.is_between(line):
            continue
        if number <= how.skip_lines:
            skipped = number, line
            continue
        lines.append((number, line))
        if len(lines) == 3:
            break
    return skipped, lines


def _refuse_skipped(path: Path, how: Table, skipped: tuple[int, str] | None, columns: int) -> None:
    """Refuse a layout that skips a line with a time, as those of frames have."""
    if skipped is None or how.time_unit != ISO or not isinstance(how.time_column, int):
        return
    number, line = skipped
    texts = cells(line, how.separator)
    if len(texts) == columns and how.time_column <= columns and not math.isnan(seconds_of(texts[how.time_column - 1])):
        raise FormatError(
            f"{path.name}, line {number}: the layout skips the frame at {shown(texts[how.time_column - 1])}: "
            f"skip_lines is {how.skip_lines}; must be at most {number - 1}"
        )


def _are_of_frame(texts: Sequence[str], how: Table) -> bool:
    """Return whether the cells of a line are those of a frame, not names; those that are left out may be texts."""
    # An empty cell, as at the end of a line that ends in a separator, makes no name of the others.
    there = {k: cell for k, cell in enumerate(texts, 1) if cell and k not in how.leave_out}
    if isinstance(how.time_column, int) and how.time_unit == ISO:
        time = there.pop(how.time_column, "")
        return not math.isnan(seconds_of(time))
    return bool(there) and all(_is_number(cell, how) for cell in there.values())


def _read(head: _Head, how: Table) -> tuple[NDArray[np.float32], NDArray[np.int64] | None]:
    """Return the readings of a table, a row a line, and its times, us."""
    path, names, time = head.path, head.kept, head.time
    missing = frozenset() if how.missing is None else frozenset({unquote(how.missing), "nan"})
    read = Growing(str(path), values=((len(names) - (time is not None),), np.float32), t=((), np.int64))
    for line, block in text.blocks(head.rows(), path, head.first, names, missing, unmarked=how.missing is None):
        if time is None:
            read.add(values=block, t=np.zeros(len(block)))
        else:
            t = _us(block[:, time], names[time], how, path, line)
            read.add(values=np.delete(block, time, axis=1), t=t)
    return read.column("values"), None if time is None else read.column("t")


def _all_end(names: Sequence[str] | None, begin: str, path: Path, how: Table, above: int) -> bool:
    """Return whether each line of numbers ends in a separator (`ends_in_separator`), of which `begin` is the first."""
    if not ends_in_separator(names, [begin], how.separator):
        return False
    lines = (line for line in islice(text.stream(path), how.skip_lines, None) if line.strip())
    return all(line.rstrip(" ").endswith(how.separator) for line in islice(lines, above, None))


def _us(times: NDArray[np.float64], name: str, how: Table, path: Path, first: int) -> NDArray[np.int64]:
    """Return the times of some lines in us; `first` is the number of the first."""
    missing = np.flatnonzero(np.isnan(times))
    if len(missing):
        raise FormatError(
            f"{path.name}, line {first + missing[0]}: {short(name)} is missing; every frame must have a time"
        )
    return whole_us(path.name, times * UNITS_US.get(how.time_unit, UNITS_US["s"]) / 1e6, first)


def _seconds(cell: str, path: Path, line: int) -> str:
    """Return the time that the cell of a line holds as a text of ISO 8601 as a number."""
    seconds = seconds_of(cell)
    if math.isnan(seconds):
        raise FormatError(
            f"{path.name}, line {line}: time is {shown(cell)}; must be like 2024-05-01T10:00:00.25, or 10:00:00.25"
        )
    return repr(seconds)


def _with_points(texts: list[str], time: int | None, names: Sequence[str], path: Path, line: int) -> list[str]:
    """Return the cells of a line with points for decimal commas, except a time that is a text."""
    texts = list(texts)
    if time is not None:
        texts[time] = ""
    joined = "\0".join(texts)
    if "." in joined:
        k = next(k for k, cell in enumerate(texts) if "." in cell)
        name = short(names[k]) if k < len(names) else "a cell"
        raise FormatError(
            f"{path.name}, line {line}: {name} is {shown(texts[k])}; must be without a point, because decimal is ','"
        )
    return joined.replace(",", ".").split("\0")


def _without(row: list[str], left: Collection[int], columns: int, path: Path, line: int) -> list[str]:
    """Return the cells of a line but those of columns that are left out."""
    if len(row) != columns:
        raise FormatError(f"{path.name}, line {line}: {len(row)} cells; must have {columns}")
    return [cell for k, cell in enumerate(row) if k not in left]


def _is_number(cell: str, how: Table) -> bool:
    try:
        # A decimal comma that the layout does not say makes no name of a number.
        float_of(cell.replace(",", ".", 1))
    except ValueError:
        return how.missing is not None and cell == unquote(how.missing)
    return True


def _column(path: Path, key: str, column: str | int, names: Sequence[str], named: bool) -> int:
    """Return the place of a column that a layout names."""
    if isinstance(column, int):
        if column > len(names):
            raise FormatError(f"{path.name}: {key} is {column}, but the table has {counted(len(names), 'column')}")
        return column - 1
    # Quotes are no part of a name.
    name = column.strip("\"'")
    if name not in names:
        known_names = (
            f"the columns are {', '.join(map(short, names[:8]))}" + " ..." * (len(names) > 8)
            if named
            else "the columns have no names, so give the number of the column, counted from 1"
        )
        kind = " of times" if key == "time_column" else ""
        raise FormatError(f"{path.name}: column {shown(name)}{kind} is missing; {known_names}")
    return names.index(name)
