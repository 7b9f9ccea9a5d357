"""Refuses a table or arrays of another program that no layout file describes, with the lines of one that reads them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.limits import TIME_US
from taxel._base.messages import counted
from taxel._base.number_text import float_of
from taxel._core import FormatError
from taxel.formats import text
from taxel.formats.layout import ISO, UNITS_US, advice
from taxel.recording.readers.foreign import (
    ARRAYS,
    MISSING,
    are_units,
    arrays_of,
    cells,
    ends_in_separator,
    list_arrays,
    seconds_of,
    shapes_of,
    times_of,
    unit_of,
)

#: A column without a name is one of times if it ascends for so many lines.
_ASCENDS = 20
_NO_RATE = "# rate_hz = 100  # frames a second: the file does not say it, and without it frames are numbered"


def refuse_without_layout(path: Path) -> None:
    """Refuse a table or arrays of another program with the layout that reads them; a text without a table is none.

    The lines of the layout hold what the file says; what it does not say is a comment.

    Raises
    ------
    FormatError : it holds a table or arrays, or is damaged
    """
    if path.suffix.lower() not in ARRAYS:
        lines = text.beginning(path)
        found = _TextTable.find(lines, texts=False)
        if found is None:
            _refuse_decimal_commas(path, lines)
            found = _TextTable.find(lines, texts=True)
        if found is None:
            return
        holds, lines = _of_table(found)
        says = "says how to read it"
    else:
        shapes = shapes_of(path)
        name = next((name for name, shape in shapes.items() if len(shape) in (2, 3)), None)
        if name is None:
            raise FormatError(
                f"{path}: holds {list_arrays(shapes)}; must be t, x, y, p (events), values, t (frames), or, with a "
                "layout file, an array of frames x rows x columns or frames x taxels (docs/files.md)"
            )
        holds, lines = list_arrays(shapes), _of_arrays(path, name, shapes)
        says = "says which are the frames" if len(shapes) > 1 else "or rate_hz, says what it is"
    raise FormatError(f"{path}: holds {holds}, not written by taxel; {advice(path, says)}:", "\n".join(lines))


def _of_arrays(path: Path, name: str, shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the layout of the array of a name."""
    count, *shape = shapes[name]
    time = next((name for name, shape_of in shapes.items() if shape_of == (count,) and unit_of(name) is not None), None)
    times = [] if time is None else [f"time = {_quote(time)}", *_unit(time, arrays_of(path, [time])[time])]
    data = [f"array = {_quote(name)}"] * bool(name) + times
    return [*_size(shape), *([_NO_RATE] if time is None else []), *(["[data]", *data] if data else [])]


@dataclass(frozen=True)
class _TextTable:
    """Hold the parts of a table: the cells of its names (none), of its units (none) and of its lines of numbers."""

    separator: str
    skipped: int
    names: Sequence[str]
    units: Sequence[str]
    body: Sequence[Sequence[str]]
    #: Which columns hold numbers; the others hold texts.
    numeric: Sequence[bool]

    @classmethod
    def find(cls, lines: Sequence[str], *, texts: bool) -> _TextTable | None:
        """Find the parts; None of a text that does not end in lines of numbers, with `texts` beside texts."""
        there = [(k, line) for k, line in enumerate(lines) if line.strip()]
        # The separator that makes most columns of numbers.
        rows_by = {mark: [cells(line, mark) for _, line in there] for mark in (",", ";", "\t", " ")}
        fits = {mark: numeric for mark, rows in rows_by.items() if (numeric := _numeric(rows, texts=texts))}
        if not fits:
            return None
        separator = max(fits, key=lambda mark: sum(fits[mark]))
        rows, numeric = rows_by[separator], fits[separator]
        first = next(k for k, row in enumerate(rows) if _fits(row, numeric))
        in_units = first > 1 and are_units(rows[first - 2], rows[first - 1])
        head = first - 1 - in_units
        below, columns = [line for _, line in there[first:]], len(numeric)
        ends = ends_in_separator(None, below, separator)
        names = rows[head] if head >= 0 and len(rows[head]) in {columns, columns - ends} else []
        columns -= ends_in_separator(names or None, below, separator)
        units = rows[first - 1] if names and in_units else []
        body = [row[:columns] for row in rows[first:] if len(row) >= columns]
        skipped = there[head if names else first][0]
        return cls(separator, skipped, names[:columns], units, body, numeric[:columns])

    def numbers(self, column: int) -> NDArray[np.float64]:
        return np.array([_number(row[column]) for row in self.body])

    def called(self, column: int) -> str:
        """Return how a layout names a column: by its name, or by its number from 1 without one of its own."""
        name = self.names[column] if self.names else ""
        return _quote(name) if name and list(self.names).count(name) == 1 else str(column + 1)

    def time(self) -> tuple[int | None, list[str]]:
        """Return which column holds the times, and the lines that say so."""
        named = next(iter(times_of(self.names)), None)
        if named is not None and self.numeric[named]:
            unit = f"{self.names[named]} {self.units[named].strip('[]()')}" if self.units else self.names[named]
            unit = unit if unit_of(unit) else self.names[named]
            return named, [f"time_column = {_quote(self.names[named])}", *_unit(unit, self.numbers(named))]
        for column in (k for k, is_numeric in enumerate(self.numeric) if not is_numeric):
            seconds = np.array([seconds_of(row[column]) for row in self.body])
            if np.isfinite(seconds).all() and (np.diff(seconds) > 0).all():
                return column, [f"time_column = {self.called(column)}", f"time_unit = {_quote(ISO)}"]
        if self._ascends and len(self.numeric) > 1:
            lines = ["time_column = 1  # it ascends; leave this out if it is a taxel"]
            return 0, [*lines, *_unit("", self.numbers(0))]
        return None, []

    @property
    def _ascends(self) -> bool:
        """Whether a first column without a name ascends."""
        unnamed = not self.names or not self.names[0]
        return unnamed and len(self.body) >= _ASCENDS and bool((np.diff(self.numbers(0)) > 0).all())

    def left_out(self, time: int | None) -> list[int]:
        """Return which columns are no taxels: those of texts and of other times, and one that numbers the lines."""
        times = [] if time is None else times_of(self.names)
        left = [k for k, is_numeric in enumerate(self.numeric) if k != time and (not is_numeric or k in times)]
        counts = time and self.names and self._ascends and bool((np.diff(self.numbers(0)) == 1).all())
        return sorted({0, *left}) if counts else left


def _of_table(found: _TextTable) -> tuple[str, list[str]]:
    """Return what a table holds, and its layout."""
    time, of_time = found.time()
    left = found.left_out(time)
    taxels = [k for k in range(len(found.numeric)) if k not in left and k != time]
    table = [f"separator = {_quote(found.separator)}"] * (found.separator != ",")
    table += [f"skip_lines = {found.skipped}"] * (found.skipped > 0)
    table += of_time
    table += [f"leave_out = [{', '.join(map(found.called, left))}]"] * bool(left)
    missing = {row[k] for row in found.body for k in taxels if row[k] in MISSING}
    table += [f"missing = {_quote(cell)}" for cell in sorted(missing - {"nan"} or missing)[-1:]]
    units = {found.units[k].strip("[]()") for k in taxels} if found.units else set()
    unit = [f"unit = {_quote(name)}" for name in units if name and len(units) == 1]
    rate = [_NO_RATE] if time is None else []
    holds = f"a table of {counted(len(found.numeric), 'column')}"
    return holds, [*_size([len(taxels)]), *unit, *rate, *(["[table]", *table] if table else [])]


def _numeric(rows: Sequence[Sequence[str]], *, texts: bool) -> list[bool]:
    """Return which columns hold numbers; none if others hold texts, which `texts` allows."""
    alike = [row for row in rows if len(row) == len(rows[-1])]
    numeric = [_holds_numbers(column) for column in zip(*alike, strict=True)]
    if not rows or not _fits(rows[-1], numeric):
        return []
    # A line of prose may hold a number, too.
    return numeric if all(numeric) or (texts and len(rows) > 1 and _fits(rows[-2], numeric)) else []


def _holds_numbers(column: Sequence[str]) -> bool:
    """Return whether a column holds a number somewhere, or is empty below its name and unit."""
    below = column[2:] or column[-1:]
    return any(math.isfinite(_number(cell)) for cell in column) or all(cell in MISSING for cell in below)


def _fits(row: Sequence[str], numeric: Sequence[bool]) -> bool:
    """Whether a row has as many cells, with numbers where they are."""
    return len(row) == len(numeric) and _are_numbers(
        [c for c, is_number in zip(row, numeric, strict=True) if is_number]
    )


def _refuse_decimal_commas(path: Path, lines: Sequence[str]) -> None:
    """Refuse a table with a line that would hold numbers if its commas were decimal points."""
    for number, line in enumerate(lines, 1):
        for mark in (";", "\t", " "):
            row = cells(line, mark)
            if len(row) > 1 and _are_numbers([cell.replace(",", ".", 1) for cell in row]):
                for k, cell in enumerate(row, 1):
                    if cell not in MISSING:
                        text.number(cell, path, number, f"column {k}")


def _size(shape: Sequence[int]) -> list[str]:
    """Return the lines that say rows and columns, of frames of rows x columns, or of so many taxels."""
    if len(shape) == 2:
        return [f"rows = {shape[0]}", f"columns = {shape[1]}"]
    taxels = shape[0]
    return ["rows = 1", f"columns = {taxels}  # if they are a grid row by row: its rows and columns"]


def _unit(name: str, times: NDArray[np.float64]) -> list[str]:
    """Return the line that says the unit of times: that in their name, else the largest that fits, and their rate."""
    stated = (unit_of(name) or "").replace("µ", "u")
    most = float(np.nanmax(np.abs(times), initial=0.0))
    unit = stated if stated in UNITS_US else next((u for u in UNITS_US if most * UNITS_US[u] <= TIME_US), "us")
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    notes = [f"{1e6 / (step * UNITS_US[unit]):.4g} frames/s"] if step > 0 else []
    notes += [" ".join(f"or {_quote(unit_name)}" for unit_name in UNITS_US if unit_name != unit)] * (not stated)
    return [f"time_unit = {_quote(unit)}" + "  # " * bool(notes) + ", ".join(notes)]


def _are_numbers(cells: Sequence[str]) -> bool:
    """Whether cells are numbers, at least one of them, or marks of missing values."""
    finite = [math.isfinite(_number(cell)) for cell in cells]
    return any(finite) and all(is_finite or cell in MISSING for is_finite, cell in zip(finite, cells, strict=True))


def _number(cell: str) -> float:
    try:
        return float_of(cell)
    except ValueError:
        return math.nan


def _quote(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)
