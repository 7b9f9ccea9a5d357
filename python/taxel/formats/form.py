"""How lines of numbers are read, of a table or of a live source: their cells, and what each column is."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from taxel._base.arguments import shown
from taxel._base.limits import VALUE
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.formats.layout import Table
from taxel.formats.line_fits import Fit
from taxel.formats.lines import MISSING, OTHER, WITH_TEXT, WITH_THOUSANDS, is_number, number_of, read_line
from taxel.formats.roles import Role
from taxel.formats.times import ISO, UNITS_US, is_time, seconds_of


class Columns(NamedTuple):
    """Say which column is what, by its place.

    Times are two columns where they are seconds and nanoseconds, and a taxel is named by two where they are its row and
    its column.
    """

    times: tuple[int, ...]
    taxel: tuple[int, ...]
    label: int | None
    by: int | None
    taxels: tuple[int, ...]


@dataclass(frozen=True)
class Form:
    """Hold how lines are read; each is read by itself.

    Parameters
    ----------
    table : Table
        Complete.
    names : tuple of str
        Of all columns; "" for one without a name.
    first : int
        The number of the first line of numbers, from 0.
    said : tuple of str
        What was understood beyond what is stated, a text each, for people.
    own : tuple of str
        The names of the cells that lines have themselves, in whose order they are put; empty if they have none.
    lines : int
        Number of lines of a frame, 0 if only an empty line, or one of text, shows it.
    roles : sequence of Role
        Of each column.
    fit : Fit, optional
        The cells of the lines that show it.
    """

    table: Table
    names: tuple[str, ...]
    first: int = 0
    said: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    lines: int = 1
    roles: Sequence[Role] = ()
    fit: Fit | None = None

    def called(self, column: int) -> str:
        """Return the name of a column, or its number if it has none."""
        return self.names[column] or f"column {column + 1}"

    @cached_property
    def columns(self) -> Columns:
        """Which column is what.

        Raises
        ------
        ProblemError : columns that are not there, or one that is two things
        """
        how, names = self.table, self.names
        times, taxel = (
            places_of(names, key, getattr(how, key)) if getattr(how, key) else ()
            for key in ("time_column", "taxel_column")
        )
        label, by = (
            place_of(names, key, getattr(how, key)) if getattr(how, key) else None for key in ("label_column", "by")
        )
        left = left_out(names, how)
        twice = next((k for k in times if k in left), None)
        if twice is not None:
            raise ProblemError(f"column {shown(names[twice])} is the time_column, but is also in leave_out")
        others = {*left, *times, *taxel, label, by}
        taxels = (k for k in range(len(names)) if k not in others)
        kept = tuple(k for k in taxels if how.keeps(names[k]))
        return Columns(times, taxel, label, by, kept)

    @property
    def taxels(self) -> tuple[int, ...]:
        """The columns with values."""
        return self.columns.taxels

    @property
    def clocks(self) -> tuple[tuple[int, float], ...]:
        """The columns whose sum is the time, each with its unit, us; texts of times are read as seconds."""
        times = self.columns.times
        if len(times) > 1:
            return tuple(zip(times, (UNITS_US["s"], UNITS_US["ms" if self._texts else "ns"]), strict=True))
        return tuple((k, UNITS_US["s" if self.table.time_unit == ISO else self.table.time_unit]) for k in times)

    @property
    def unit_of_times(self) -> str:
        """The unit of times as they are read."""
        of_sum = "ns" if len(self.columns.times) > 1 and not self._texts else self.table.time_unit
        return self.table.frame_time or of_sum

    @cached_property
    def missing(self) -> frozenset[str]:
        """Cells without a value."""
        return frozenset((*MISSING, *self.table.missing_texts))

    @cached_property
    def _texts(self) -> frozenset[int]:
        """The column whose texts are times; milliseconds may be in the next one."""
        return frozenset(self.columns.times[:1] if self.table.time_unit == ISO else ())

    @cached_property
    def _numbers(self) -> frozenset[int]:
        """The columns of numbers, those of times included; others may hold anything."""
        return frozenset((*self.columns.taxels, *self.columns.times)) - self._texts

    def cells(self, line: str) -> tuple[list[str], str]:
        """Return the cells of a line, and what is odd about it; "" if nothing is.

        Examples
        --------
        >>> form = Form(Table(), ("a", "b"))
        >>> form.cells("1,2")[1], form.cells("1")[1], form.cells("1,b")[1], form.cells("Ready")[1]
        ('', 'with too few cells', 'with a cell that is no number', 'of text')
        """
        parsed = read_line(line, self.table.lines, self.table.separator, self.table.decimal)
        parsed = parsed.in_order(self.own) if parsed is not None and self.own else parsed
        cells = list(parsed.cells) if parsed is not None else []
        while len(cells) > len(self.names) and not cells[-1]:
            cells.pop()
        return cells, self._odd(cells)

    def values(self, line: str) -> tuple[list[float], str]:
        """Return the numbers of a line, times of texts in s, NaN for other cells, and what is odd about it.

        Of a line in which a reading is no number, but most are, it returns the others too.

        Examples
        --------
        >>> table = Table(separator=";", decimal=",", time_column=1, time_unit="iso")
        >>> Form(table, ("t", "a", "b")).values("00:00:01;2,5;-")
        ([1.0, 2.5, nan], '')
        """
        count = len(self.names)
        if len(self._numbers) == count and self.table.decimal == "." and line.isascii() and "_" not in line:
            parsed = read_line(line, self.table.lines, self.table.separator)
            if parsed is not None and len(parsed.cells) == count and not self.own:
                with suppress(ValueError):
                    found = list(map(float, parsed.cells))
                    if max(found) <= VALUE and min(found) >= -VALUE and not math.isnan(sum(found)):
                        return found, ""
        cells, odd = self.cells(line)
        if odd and (odd != WITH_TEXT or self.table.events):
            return [], odd
        found = list(map(self._value, range(count), cells))
        if odd and 2 * sum(map(math.isnan, found)) > count:
            return [], odd
        return (found, odd) if all(not abs(value) > VALUE for value in found) else ([], "with a number out of range")

    def _value(self, column: int, cell: str) -> float:
        if column in self._texts:
            return seconds_of(cell.strip("\"'"))
        marks = self.table.decimal, self.table.thousands
        if column not in self._numbers or not is_number(cell, *marks):
            return math.nan
        return number_of(cell, *marks)

    def _odd(self, cells: Sequence[str]) -> str:
        """Return what is odd about the cells of a line; "" if nothing is."""
        marks = decimal, thousands = self.table.decimal, self.table.thousands
        if not any(is_number(cell, *marks) or is_time(cell) for cell in cells):
            return "of text"
        if len(cells) != len(self.names):
            return "with too few cells" if len(cells) < len(self.names) else "with too many cells"
        for k in self._numbers:
            # A reading may be missing, a time may not.
            if not is_number(cells[k], *marks) and (cells[k] not in self.missing or k in self.columns.times):
                has_thousands = thousands is None and is_number(cells[k], decimal, OTHER[decimal])
                of_time = "with a time that is no number" if k in self.columns.times else WITH_TEXT
                return WITH_THOUSANDS if has_thousands else of_time
        return "" if all(is_time(cells[k]) for k in self._texts) else "without a time"


def left_out(names: Sequence[str], how: Table) -> set[int]:
    """Return the places of the columns that a table leaves out.

    Raises
    ------
    ProblemError : there is no such column
    """
    counts = Counter(names)
    at = {name: k for k, name in enumerate(names) if counts[name] == 1}
    return {at[column] if column in at else place_of(names, "leave_out", column) for column in how.leave_out}


def place_of(names: Sequence[str], key: str, column: str | int) -> int:
    """Return the place of a column that a key states by its name, or by its number from 1.

    Raises
    ------
    ProblemError : there is no such column
    """
    if isinstance(column, str) and names.count(column) == 1:
        return names.index(column)
    if isinstance(column, int) or column.isdecimal():
        if not 1 <= int(column) <= len(names):
            raise ProblemError(f"{key} is {column}, but there are {counted(len(names), 'column')}")
        return int(column) - 1
    problem = "is missing" if column not in names else "appears twice; name it by its number"
    there = ", ".join(name or str(k) for k, name in enumerate(names[:20], 1)) + ", ..." * (len(names) > 20)
    raise ProblemError(f"column {shown(column)} of {key} {problem}; the columns are {there}")


def places_of(names: Sequence[str], key: str, column: str | int) -> tuple[int, ...]:
    """Return the place of a column, or of the two of "A+B"."""
    is_one = isinstance(column, int) or column in names or "+" not in column
    return tuple(place_of(names, key, part) for part in ([column] if is_one else str(column).split("+", 1)))
