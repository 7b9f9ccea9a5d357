"""How lines are cells: the kinds of lines, separators and decimal marks that fit them, best first."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel.formats.column_names import UNIT_BEHIND
from taxel.formats.layout import Layout
from taxel.formats.lines import MISSING, THOUSANDS, Line, has_marks, is_number, number_of, read_line
from taxel.formats.times import epoch_of, is_day, is_time

#: Forms that are tried: kind of line, separator, decimal mark.
_FORMS = [
    ("json", ",", "."),
    *(("plain", separator, decimal) for decimal in ".," for separator in ",;\t| " if separator != decimal),
    # Numbers with decimal commas in quotes, which a comma does not split.
    ("plain", ",", ","),
    ("marked", ",", "."),
    ("marked", ";", ","),
]
#: A column is of numbers, or of times, if this share of its cells are; a reading must fit this share of all cells.
_MOST, FITS = 0.6, 0.5
#: What a program quotes, as for the comma in it: a number with a decimal comma, or with thousands.
_QUOTED = re.compile(r'"([^"]*)"')
#: A cell of digits with marks between them.
_MARKED = re.compile(rf"[-+]?\d[\d{''.join(THOUSANDS)}]*", re.ASCII)
#: A number that may have thousands, or three decimals.
THOUSAND = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
_HEX = re.compile(r"(?:0x)?(?:[0-9A-Fa-f]{2})+")
_HEX_LETTER = re.compile(r"(?<![\w.])(?:0x)?[0-9]*[A-Fa-f][0-9A-Fa-f]*(?![\w.])")


@dataclass(frozen=True, eq=False)
class Fit:
    """Hold the lines of a text as one form reads them."""

    kind: str
    separator: str
    decimal: str
    thousands: str | None
    #: Of each line that is not empty, its number from 0 and its cells.
    lines: Sequence[tuple[int, Line]]
    #: The places in `lines` of those that are frames.
    body: Sequence[int]
    #: What each column holds: "number", "time", "day", "text" or "empty".
    types: Sequence[str]
    #: The share of cells that fit, from the first frame on, and less where few of all lines are frames.
    purity: float
    score: float
    #: The cells of lines over the rest of the file.
    spread: Sequence[Sequence[str]] = ()

    @property
    def count(self) -> int:
        """The number of columns."""
        return len(self.types)

    @property
    def first(self) -> int:
        """The number of the first line of numbers, from 0."""
        return self.lines[self.body[0]][0]

    @property
    def own(self) -> tuple[str, ...]:
        """The names that cells of its lines have themselves, in the order of the columns; empty if they have none."""
        names = self.lines[self.body[0]][1].names
        return names if self.kind in ("marked", "json") and any(names) else ()

    @cached_property
    def _columns(self) -> list[tuple[str, ...]]:
        return list(zip(*(self.lines[k][1].cells for k in self.body), strict=True))

    @cached_property
    def _numbers(self) -> dict[int, NDArray[np.float64]]:
        return {}

    def cells(self, column: int) -> tuple[str, ...]:
        """Return the cells of a column in the lines that are frames."""
        return self._columns[column]

    def numbers(self, column: int) -> NDArray[np.float64]:
        """Return the numbers of a column; NaN for other cells."""
        if column not in self._numbers:
            self._numbers[column] = np.array(list(map(self.number, self.cells(column))))
        return self._numbers[column]

    def wide(self, column: int) -> NDArray[np.float64]:
        """Return the numbers of a column, and of it over the rest of the file; NaN for other cells."""
        more = [self.number(cells[column]) for cells in self.spread]
        return np.concatenate([self.numbers(column), np.array(more, np.float64)])

    def number(self, cell: str) -> float:
        """Return the number that a cell states; NaN if none."""
        marks = self.decimal, self.thousands
        return number_of(cell, *marks) if is_number(cell, *marks) else np.nan

    def over(self, lines: Iterable[str]) -> Fit:
        """Return the same with lines over the rest of the file."""
        return replace(self, spread=[*self.cells_in(lines)])

    def cells_in(self, lines: Iterable[str]) -> Iterator[tuple[str, ...]]:
        """Yield the cells of lines over the rest of the file, those that have as many."""
        read = (read_line(line, self.kind, self.separator, self.decimal) for line in lines)
        whole = (line.in_order(self.own).cells for line in read if line is not None)
        yield from (cells for cells in whole if len(cells) == self.count)

    def ascends(self, column: int) -> bool:
        """Return whether a column ascends as times do, of which some may repeat, wrap or be out of order."""
        if self.types[column] != "number":
            return self.types[column] == "time"
        steps = np.diff(self.numbers(column))
        steps = steps[np.isfinite(steps)]
        rises = int((steps > 0).sum())
        return len(steps) > 0 and bool((steps >= 0).mean() >= 0.8) and (rises >= 0.2 * len(steps) or rises > 1)

    def counts(self, column: int) -> bool:
        """Return whether a column counts lines."""
        return bool((np.diff(self.numbers(column)) == 1).all())

    def epoch(self, column: int) -> str:
        """Return the unit in which a column is of times since 1970, "" if it is not."""
        return epoch_of(self.numbers(column)) if self.types[column] == "number" else ""


def fits_in(
    lines: Sequence[str],
    all_lines: Callable[[], Iterable[str]],
    wanted: int | None = None,
    stated: Layout | None = None,
) -> tuple[list[Fit], bool]:
    """Return the forms that fit lines, and whether they may as well be hexadecimal numbers, as `all_lines` do not say.

    Of a number of columns that is `wanted`, where any line has it, and in the form that a layout states.
    """
    how = stated.table if stated is not None else None
    if stated is None or how is None or stated.stated.isdisjoint(("separator", "lines", "decimal")):
        in_hex, is_sure = _hex(all_lines, lines)
        if is_sure and in_hex is not None:
            return [in_hex], False
        missing = () if how is None else how.missing_texts
        return list(fits_of(lines, _FORMS, missing, wanted)), in_hex is not None
    keys = {"lines": 0, "separator": 1, "decimal": 2}
    forms = [
        form for form in _FORMS if all(form[k] == getattr(how, key) for key, k in keys.items() if key in stated.stated)
    ]
    if not forms or ("lines" not in stated.stated and "separator" in stated.stated):
        forms = [form for form in forms if form[0] == "plain"] or [(how.lines, how.separator, how.decimal)]
    is_said = not stated.stated.isdisjoint(("decimal", "thousands"))
    return list(fits_of(lines, forms, how.missing_texts, wanted, how.thousands, is_said=is_said)), False


def fits_of(
    lines: Sequence[str],
    forms: Sequence[tuple[str, str, str]],
    missing: Sequence[str] = (),
    wanted: int | None = None,
    thousands: str | None = None,
    *,
    is_said: bool = False,
) -> Iterator[Fit]:
    """Yield each form that makes columns of numbers of the lines, as many as are wanted where any line has them.

    Each finds its mark between thousands, unless that is said.
    """
    there = [(k, line) for k, line in enumerate(lines) if line.strip(" \t\r,;")]
    few = [line for _, line in there[-40:]]
    for kind, separator, decimal in forms:
        marked = separator in (",", ";") if kind != "plain" else separator == " "
        if len(forms) > 1 and (
            (not marked and separator != "," and not any(separator in line for line in few))
            or (separator == decimal and not _are_quoted(few, ",."))
            or (kind == "marked" and (2 * sum(map(has_marks, few)) < len(few) or _are_quoted(few, ",.", ".,")))
            or (kind == "marked" and decimal == "." and _have_units_behind_decimals(few))
            or (kind == "json" and not any(line.lstrip()[:1] in "{[" for line in few))
        ):
            continue
        parsed = [(k, read_line(line, kind, separator, decimal)) for k, line in there]
        cells = [(k, line) for k, line in parsed if line is not None and line.cells]
        if kind != "plain" and cells:
            names = Counter(line.names for _, line in cells).most_common(1)[0][0]
            cells = [(k, line.in_order(names)) for k, line in cells]
        mark = _thousands(cells, decimal) if kind == "plain" and not is_said else thousands
        fit = _fit((kind, separator, decimal), mark, cells, len(there), {*MISSING, *missing}, wanted)
        if fit is not None:
            yield fit


def _are_quoted(lines: Sequence[str], *marks: str) -> bool:
    """Return whether all quoted cells with a comma are numbers by some marks of decimals and of thousands."""
    quoted = [cell for line in lines for cell in _QUOTED.findall(line) if "," in cell]
    return bool(quoted) and all(any(is_number(cell, *pair) for pair in marks) for cell in quoted)


def _thousands(lines: Sequence[tuple[int, Line]], decimal: str) -> str | None:
    """Return the mark between thousands that lines are sure to have; None where another may be right."""
    widths = Counter(len(line.cells) for _, line in lines)
    most = max(widths, key=lambda width: widths[width], default=0)
    rows = [line.cells for _, line in lines if len(line.cells) == most]
    columns = [
        [cell for cell in column if _MARKED.fullmatch(cell) and not is_day(cell)] for column in zip(*rows, strict=True)
    ]
    cells = [cell for column in columns for cell in column]
    has_decimals = any(decimal in cell and is_number(cell, decimal) and not THOUSAND.fullmatch(cell) for cell in cells)
    for mark in THOUSANDS:
        with_mark = [[cell for cell in column if mark in cell] for column in columns] if mark != decimal else []
        fits = [[cell for cell in column if is_number(cell, decimal, mark)] for column in with_mark]
        # A column of which some numbers have thousands has them in all.
        if any(fits) and all(fit in ([], column) for fit, column in zip(fits, with_mark, strict=True)):
            alone = all(THOUSAND.fullmatch(cell) for column in fits for cell in column)
            return mark if has_decimals or not alone else None
    return None


def _have_units_behind_decimals(lines: Sequence[str]) -> bool:
    """Return whether a decimal comma is in the numbers that have a unit behind them, between other separators."""
    behind = ((line, unit.start()) for line in lines for unit in UNIT_BEHIND.finditer(line))
    found = [re.split(r"[;\s]", line[:end])[-1] for line, end in behind if ";" in line or "\t" in line]
    return any("," in number for number in found) and not any("." in number for number in found)


def _fit(
    form: tuple[str, str, str],
    thousands: str | None,
    lines: Sequence[tuple[int, Line]],
    total: int,
    missing: set[str],
    wanted: int | None = None,
) -> Fit | None:
    """Return lines as one form reads them; None without a column of numbers. `total` lines are not empty."""

    def type_of(cell: str) -> str:
        if cell in missing:
            return ""
        if is_number(cell, form[2], thousands):
            return "number"
        return "time" if is_time(cell) else "day" if is_day(cell) else "text"

    types = [[type_of(cell) for cell in line.cells] for _, line in lines]
    has_values = [any(each in ("number", "time") for each in row) for row in types]
    counts = Counter(len(row) for row, has in zip(types, has_values, strict=True) if has)
    if not counts:
        return None
    most = max(counts.values())
    count = max(size for size, times in counts.items() if times == most)
    if wanted is not None and wanted in counts:
        count = wanted
    same = [row for row, has in zip(types, has_values, strict=True) if has and len(row) == count]
    columns = [Counter(filter(None, column)) for column in zip(*same, strict=True)]
    named = [
        "empty"
        if not found
        else next((t for t in ("number", "time", "day") if found[t] >= _MOST * found.total()), "text")
        for found in columns
    ]
    numeric = [k for k, each in enumerate(named) if each in ("number", "time")]
    body = [
        k
        for k, (row, has) in enumerate(zip(types, has_values, strict=True))
        if has and len(row) == count and all(row[c] in ("", named[c]) for c in numeric)
    ]
    if not numeric or not body:
        return None
    below = len(lines) - body[0]
    purity = sum(each in ("number", "time", "empty") for each in named) / count * len(body) / below
    return Fit(*form, thousands, lines, body, named, purity, purity * len(body) / total)


def _hex(all_lines: Callable[[], Iterable[str]], lines: Sequence[str]) -> tuple[Fit | None, bool]:
    """Return the lines as hexadecimal numbers, if all have as many digits, and whether any has one from A to F."""
    there = [(k, line) for k, line in enumerate(lines) if line.strip()]
    for separator in " ,;\t":
        rows = [found.cells for _, line in there if (found := read_line(line, "plain", separator)) and found.cells]
        whole = [cells for cells in rows if all(map(_HEX.fullmatch, cells))]
        digits = [cell.removeprefix("0x") for cells in whole for cell in cells]
        if not digits or len(whole) < 0.9 * len(rows) or len(set(map(len, digits))) > 1:
            continue
        has_letters = any(not cell.isdecimal() for cell in digits)
        if not has_letters and not any(cell.startswith("0") for cell in digits):
            return None, False
        has_letters = has_letters or any(_HEX_LETTER.search(line) for line in all_lines())
        return next(fits_of(lines, [("hex", separator, ".")]), None), has_letters
    return None, False
