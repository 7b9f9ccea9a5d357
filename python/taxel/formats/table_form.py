"""The form of a table that no layout describes: how its lines are read, and what each column is, by its first lines.

Where two readings fit about equally, or nothing says when a line was, both layouts are printed and none is taken.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise
from typing import NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import unreadable
from taxel._base.messages import counted
from taxel.formats.column_names import (
    are_units,
    axes_of,
    is_counter,
    is_force,
    is_key,
    is_label,
    is_other,
    places_of,
    time_unit,
    unit_of,
)
from taxel.formats.layout import Layout, Table, advice
from taxel.formats.layout_text import of_layout
from taxel.formats.lines import MISSING, Line, has_marks, is_number, read_line
from taxel.formats.table_text import Text
from taxel.formats.times import ISO, UNITS_US, is_day, is_time

__all__ = ["Form", "guess", "unit_of_times"]

#: Forms that are tried: kind of line, separator, decimal mark.
_FORMS = [
    ("json", ",", "."),
    *(("plain", separator, decimal) for decimal in ".," for separator in ",;\t| " if separator != decimal),
    ("marked", ",", "."),
    ("marked", ";", ","),
]
#: A column is of numbers, or of times, if this share of its cells are; a reading must fit this share of all cells.
_MOST, _FITS = 0.6, 0.5
#: Two readings fit about equally if one fits this share of the other.
_EQUALLY = 0.999
#: So many lines show that an unnamed column ascends as times do, and that one counts lines.
_ASCENDS, _COUNTS = 8, 20
#: Rates of usual sensors, and those that may be, Hz.
_USUAL_HZ, _POSSIBLE_HZ = (5.0, 500.0), (0.5, 20_000.0)
#: Years 2001 to 2065 since 1970, in s.
_EPOCH = (1e9, 3e9)
#: So many different texts are names of sensors, not remarks.
_KEYS = 16
#: A line above a frame: a word and the frame's number, or its time, or both.
_ABOVE_FRAME = re.compile(
    r"\s*(?P<word>[^\W\d_]+)[ \t:=#.]*\d+(?:[.,]\d+)?[ \t]*(?P<unit>[mun]?s)?"
    r"(?:[ \t,;:@(\[]+(?:t|time)?[ \t=:]*(?P<time>\d+(?:[.,]\d+)?)[ \t]*(?P<time_unit>[mun]?s)?[)\]]?)?[ \t,;]*",
    re.IGNORECASE,
)
_HEX = re.compile(r"(?:0x)?(?:[0-9A-Fa-f]{2})+")
_HEX_LETTER = re.compile(r"(?<![\w.])(?:0x)?[0-9]*[A-Fa-f][0-9A-Fa-f]*(?![\w.])")
#: A comment, and how a layout is changed for it.
_Choice: TypeAlias = tuple[str, Callable[[Layout], Layout]]
_RATE_NOT_SAID = "# rate_hz = 100  # frames per second, which the file does not state"


@dataclass(frozen=True)
class Form:
    """Hold a complete layout, and what was understood beyond it, a text each; none if the layout said it."""

    layout: Layout
    said: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Fit:
    """Hold the lines of a text as one form reads them."""

    kind: str
    separator: str
    decimal: str
    #: Of each line that is not empty, its number from 0 and its cells.
    lines: Sequence[tuple[int, Line]]
    #: The places in `lines` of those that are frames.
    body: Sequence[int]
    #: What each column holds: "number", "time", "day", "text" or "empty".
    types: Sequence[str]
    #: The share of cells that fit, from the first frame on, and less where few of all lines are frames.
    purity: float
    score: float

    @property
    def count(self) -> int:
        return len(self.types)

    def cells(self, column: int) -> list[str]:
        """Return the cells of a column in the lines that are frames."""
        return [self.lines[k][1].cells[column] for k in self.body]

    def numbers(self, column: int) -> NDArray[np.float64]:
        """Return the numbers of a column; NaN for other cells."""
        cells = [cell.replace(",", ".") if self.decimal == "," else cell for cell in self.cells(column)]
        return np.array([float(cell) if is_number(cell) else np.nan for cell in cells])


@dataclass
class _Reading:
    """Hold what is understood of a table as it is looked at: its layout, what was left out and why, what is open."""

    table: Table
    names: tuple[str, ...]
    units: tuple[str, ...]
    left: dict[int, str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    #: What two layouts differ in, with a comment for each.
    asked: list[tuple[str, list[_Choice]]] = field(default_factory=list)

    def called(self, column: int) -> str | int:
        """Return how a layout names a column: by its name, or, without a name of its own, by its number from 1."""
        name = self.names[column]
        return name if name and self.names.count(name) == 1 else column + 1

    def ask(self, why: str, *choices: _Choice) -> None:
        self.asked.append((why, list(choices)))


def guess(text: Text, layout: Layout) -> Form:
    """Return how a table is read: as its layout says, or, if it says nothing of the table, as its first lines look.

    Raises
    ------
    FormatError : no table of numbers, or two readings fit about equally (prints the layout of each)
    """
    if layout.table is not None:
        return Form(layout)
    lines = text.head
    if text.path.suffix.lower() == ".json" and not any(read_line(line, "json") for line in lines[:3]):
        raise unreadable("is one document of JSON; save a line of JSON per frame, or a .csv", text.path)
    begin, time_of_begin = _begin_of_frames(lines)
    is_begin = [bool(begin) and line.lstrip().startswith(begin) for line in lines]
    shown = ["" if above else line for line, above in zip(lines, is_begin, strict=True)]
    size = (layout.rows or 0) * (layout.columns or 0)
    in_hex, is_sure = _hex(text, shown)
    found = [in_hex] if is_sure and in_hex is not None else _fits(shown)
    fits = sorted(found, key=lambda fit: (-fit.score, bool(size) and fit.count != size))
    fits = [fit for fit in fits if fit.purity >= _FITS]
    if not fits:
        why = "contains no table of numbers; if it has one, describe it in [table] of a layout file (docs/files.md)"
        is_empty = not any(line.strip() for line in lines)
        raise unreadable("the file is empty; must be a recording" if is_empty else why, text.path)
    fit = fits[0]
    reading = _reading(fit, shown)
    for other in fits[1:]:
        is_equal = other.purity >= _EQUALLY * fit.purity and len(other.body) >= len(fit.body)
        if is_equal and other.count != fit.count != size and other.kind == fit.kind == "plain":
            _decide(reading, fit, other, shown)
            break
    if in_hex is not None and not is_sure:
        reading.ask(
            "decimal or hexadecimal numbers",
            ("decimal numbers", _same),
            ("hexadecimal numbers", lambda full: replace(full, table=replace(full.table or Table(), lines="hex"))),
        )
    _frames(reading, fit, lines, is_begin, begin, time_of_begin)
    stated = layout.rows is not None or layout.rate_hz is not None or layout.path != text.path
    time = _time(reading, fit, is_stated=stated)
    if time is None and reading.table.frame_time is None and not stated:
        _without_times(reading, fit, text)
    taxels = _taxels(reading, fit, time)
    if not taxels:
        raise unreadable("contains no column of readings", text.path)
    left = [k for k in range(fit.count) if k in reading.left]
    table = replace(reading.table, leave_out=[reading.called(k) for k in left])
    if _are_events(reading, fit, taxels):
        table = replace(table, events=True)
        _unit_of_events(reading, fit, time)
    full = replace(layout, table=table)
    if not table.events:
        _maybe_events(reading, fit)
        full = _with_size(full, reading, taxels)
    if reading.asked and not (stated and reading.asked[0][0].startswith("the first line")):
        _refuse(text, full, reading)
    return Form(full, (*_said(reading, fit, time), *reading.said))


def _fits(lines: Sequence[str]) -> Iterator[_Fit]:
    """Yield each form that makes columns of numbers of the lines."""
    there = [(k, line) for k, line in enumerate(lines) if line.strip(" \t\r,;")]
    for kind, separator, decimal in _FORMS:
        marked = separator in (",", ";") if kind != "plain" else separator == " "
        few = [line for _, line in there[-40:]]
        if not marked and separator != "," and not any(separator in line for line in few):
            continue
        if kind == "marked" and 2 * sum(map(has_marks, few)) < len(few):
            continue
        if kind == "json" and not any(line.lstrip()[:1] in "{[" for line in few):
            continue
        parsed = [(k, read_line(line, kind, separator, decimal)) for k, line in there]
        cells = [(k, line) for k, line in parsed if line is not None and line.cells]
        if kind != "plain" and cells:
            names = Counter(line.names for _, line in cells).most_common(1)[0][0]
            cells = [(k, line.in_order(names)) for k, line in cells]
        fit = _fit(kind, separator, decimal, cells, len(there))
        if fit is not None:
            yield fit


def _fit(kind: str, separator: str, decimal: str, lines: Sequence[tuple[int, Line]], total: int) -> _Fit | None:
    """Return lines as one form reads them; None without a column of numbers. `total` lines are not empty."""

    def type_of(cell: str) -> str:
        if cell in MISSING:
            return ""
        if is_number(cell, decimal):
            return "number"
        return "time" if is_time(cell) else "day" if is_day(cell) else "text"

    types = [[type_of(cell) for cell in line.cells] for _, line in lines]
    has_values = [any(each in ("number", "time") for each in row) for row in types]
    counts = Counter(len(row) for row, has in zip(types, has_values, strict=True) if has)
    if not counts:
        return None
    most = max(counts.values())
    count = max(size for size, times in counts.items() if times == most)
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
    return _Fit(kind, separator, decimal, lines, body, named, purity, purity * len(body) / total)


def _reading(fit: _Fit, lines: Sequence[str]) -> _Reading:
    """Return the names above a table, and how its lines are read."""
    first = fit.body[0]
    at = fit.lines[first][0]
    above = [(k, list(line.cells)) for k, line in fit.lines[:first]]
    table = Table(separator=fit.separator, decimal=fit.decimal, lines=fit.kind, skip_lines=at)
    if fit.kind != "plain":
        table = replace(table, separator=fit.separator if fit.kind == "hex" else ",")
        own = fit.lines[first][1].names
        names = own if any(own) else _names_above_marks(fit, lines)
        if not any(own) and any(names):
            table = replace(table, columns=list(names))
        return _Reading(table, names, ("",) * fit.count)
    real = fit.count
    while real > 1 and fit.types[real - 1] == "empty":
        real -= 1
    head = [
        (k, _padded(cells, fit.count)) for k, cells in above[-3:] if _width(cells) == real or len(cells) == fit.count
    ]
    none = ("",) * fit.count
    if not head or head[-1][0] < above[-1][0]:
        return _without_names(fit, table, none)
    units = head[-1][1] if len(head) > 1 and are_units(head[-2][1], head[-1][1]) and head[-1][0] > head[-2][0] else None
    rest = head[:-1] if units is not None else head
    at_names, names = rest[-1]
    if not any(names) or all(not name or is_number(name, fit.decimal) for name in names):
        return _without_names(fit, table, none)
    upper = rest[-2][1] if len(rest) > 1 and len(set(filter(None, names))) < len(list(filter(None, names))) else None
    if upper is not None and any(upper):
        together = tuple(f"{a} {b}".strip() for a, b in zip(upper, names, strict=True))
        found = _Reading(replace(table, columns=list(together[: _width(together)])), together, none)
        return replace(found, units=tuple(map(unit_of, names)))
    table = replace(table, skip_lines=at_names)
    stripped = tuple(unit.strip("[]()") for unit in units) if units is not None else tuple(map(unit_of, names))
    return _Reading(table, tuple(names), stripped)


def _without_names(fit: _Fit, table: Table, none: tuple[str, ...]) -> _Reading:
    """Return a table without names; a first line that numbers the columns is no frame."""
    first = fit.lines[fit.body[0]][1].cells
    numbers = [float(cell) for cell in first if is_number(cell)]
    counts = len(numbers) == fit.count >= 4 and bool(np.all(np.diff(numbers) == 1)) and numbers[0] in (0.0, 1.0)
    reading = _Reading(table, none, none)
    if counts and len(fit.body) > 1:
        below = fit.lines[fit.body[1]][0]

        def skipped(layout: Layout) -> Layout:
            return replace(layout, table=replace(layout.table or Table(), skip_lines=below))

        reading.ask("the first line is 1, 2, 3 ...", ("a frame", _same), ("numbers of columns", skipped))
    return reading


def _names_above_marks(fit: _Fit, lines: Sequence[str]) -> tuple[str, ...]:
    """Return names for cells with marks between them; a name may be above several: t,p above 0.1,"[1, 2]"."""
    at = fit.lines[fit.body[0]][0]
    above = next((lines[k] for k in reversed(range(at)) if lines[k].strip()), "")
    for separator in sorted(";\t,", key=above.count, reverse=True):
        names, groups = read_line(above, "plain", separator), read_line(lines[at], "plain", separator)
        if names is None or groups is None or not above or len(names.cells) != len(groups.cells):
            continue
        inner = [read_line(cell, "marked", ",", fit.decimal) for cell in groups.cells]
        sizes = [0 if line is None else len(line.cells) for line in inner]
        if sum(sizes) == fit.count and not any(is_number(name) for name in names.cells):
            pairs = zip(names.cells, sizes, strict=True)
            return tuple(f"{name}[{k}]" if size > 1 else name for name, size in pairs for k in range(size))
    return ("",) * fit.count


def _padded(cells: Sequence[str], count: int) -> tuple[str, ...]:
    return tuple(
        cell.strip("\"'# ") if k == 0 else cell.strip("\"'") for k, cell in enumerate([*cells, *[""] * count][:count])
    )


def _width(cells: Sequence[str]) -> int:
    return max((k for k, cell in enumerate(cells, 1) if cell), default=0)


def _decide(reading: _Reading, fit: _Fit, other: _Fit, lines: Sequence[str]) -> None:
    """Ask which of two readings is right, unless the names above the numbers say it."""
    if any(reading.names) and len(list(filter(None, reading.names))) == fit.count:
        return
    also = _reading(other, lines)
    if any(also.names):
        reading.table, reading.names, reading.units = also.table, also.names, also.units

    def change(layout: Layout) -> Layout:
        table = Table(also.table.separator, also.table.decimal, also.table.skip_lines, lines=also.table.lines)
        return replace(layout, table=table)

    first, second = (counted(each.count, "column") for each in (fit, other))
    reading.ask(f"{first} or {second}", (first, _same), (second, change))


def _same(layout: Layout) -> Layout:
    return layout


def _hex(text: Text, lines: Sequence[str]) -> tuple[_Fit | None, bool]:
    """Return the lines as hexadecimal numbers, if all have as many digits, and whether any has one from A to F."""
    there = [(k, line) for k, line in enumerate(lines) if line.strip()]
    for separator in " ,;\t":
        rows = [
            (k, cells) for k, line in there if (found := read_line(line, "plain", separator)) and (cells := found.cells)
        ]
        whole = [(k, cells) for k, cells in rows if all(map(_HEX.fullmatch, cells))]
        sizes = Counter(len(cell) for _, cells in whole for cell in cells)
        if not sizes or len(whole) < 0.9 * len(rows) or len(sizes) > 1:
            continue
        digits = [cell.removeprefix("0x") for _, cells in whole for cell in cells]
        has_letters = any(not cell.isdecimal() for cell in digits)
        if not has_letters and not any(cell.startswith("0") for cell in digits):
            return None, False
        has_letters = has_letters or any(_HEX_LETTER.search(line) for line in text.lines())
        parsed = [(k, read_line(line, "hex", separator)) for k, line in there]
        fit = _fit("hex", separator, ".", [(k, line) for k, line in parsed if line is not None], len(there))
        return fit, has_letters
    return None, False


def _begin_of_frames(lines: Sequence[str]) -> tuple[str, str | None]:
    """Return the word that begins a line above every few lines, and the unit of the time in it, None without one."""
    found: dict[str, list[tuple[int, re.Match[str]]]] = {}
    for k, line in enumerate(line for line in lines if line.strip(" \t,;")):
        if above := _ABOVE_FRAME.fullmatch(line):
            found.setdefault(above["word"], []).append((k, above))
    for word, places in found.items():
        steps = np.diff([k for k, _ in places])
        if len(steps) and steps[0] > 1 and Counter(steps.tolist()).most_common(1)[0][1] > 0.5 * len(steps):
            units = {above["time_unit"] or (above["unit"] if above["time"] is None else None) for _, above in places}
            unit = units.pop() if len(units) == 1 else None
            return word, None if unit is None else unit.lower()
    return "", None


def _frames(
    reading: _Reading, fit: _Fit, lines: Sequence[str], is_begin: Sequence[bool], begin: str, time: str | None
) -> None:
    """Say how many lines a frame has: those between lines of text, or between empty lines."""
    if begin:
        first = is_begin.index(True)
        reading.table = replace(
            reading.table, frame_begin=begin, frame_time=time, skip_lines=min(first, fit.lines[fit.body[0]][0])
        )
        reading.said.append(f"frames begin at lines {begin!r}")
        return
    numbers = [fit.lines[k][0] for k in fit.body]
    empty = {k for k, line in enumerate(lines) if not line.strip(" \t\r,;")}
    groups, size = list[int](), 1
    for before, after in pairwise(numbers):
        if any(k in empty for k in range(before + 1, after)):
            groups.append(size)
            size = 0
        size += 1
    if len(groups) > 1 and groups[0] > 1 and len(set(groups)) == 1:
        reading.table = replace(reading.table, frame_end="blank")
        reading.said.append(f"{groups[0]} lines per frame, between empty lines")


def _time(reading: _Reading, fit: _Fit, *, is_stated: bool) -> int | None:
    """Return the column of times, and say its unit; None without one.

    Where a layout states the sensor or the rate, a column is one of times by its name or its cells alone.
    """
    names, table = reading.names, reading.table
    ascending = [k for k in range(fit.count) if fit.types[k] == "number" and _ascends(fit.numbers(k))]
    named = [k for k in range(fit.count) if time_unit(names[k]) is not None and fit.types[k] in ("number", "time")]
    # A letter may be the name of a taxel too: it is the time where it comes first, or ascends.
    named = [k for k in named if k == 0 or len(names[k]) > 1 or k in ascending]
    named.sort(key=lambda k: (fit.types[k] == "number" and k not in ascending, k))
    column = named[0] if named else next((k for k in range(fit.count) if fit.types[k] == "time"), None)
    for k in named[1:]:
        reading.left[k] = "another time"
    if column is None and table.frame_time is None:
        column = _unnamed_time(reading, fit, ascending, is_stated=is_stated)
    if column is None:
        return None
    unit = ISO if fit.types[column] == "time" else _unit_of_time(reading, fit, column)
    reading.table = replace(reading.table, time_column=reading.called(column), time_unit=unit)
    _lines_of_same_time(reading, fit, column)
    return column


def _ascends(numbers: NDArray[np.float64]) -> bool:
    """Return whether numbers ascend as times do, of which some may repeat, wrap or be out of order."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    return (
        len(steps) > 0 and bool((steps >= 0).mean() >= 0.8) and bool((steps > 0).mean() >= 0.2 or (steps > 0).sum() > 1)
    )


def _is_epoch(numbers: NDArray[np.float64]) -> str:
    """Return the unit in which numbers are times since 1970, "" if none."""
    for unit, us in UNITS_US.items():
        if bool(((numbers * us > _EPOCH[0] * 1e6) & (numbers * us < _EPOCH[1] * 1e6)).all()):
            return unit
    return ""


def _counts(numbers: NDArray[np.float64]) -> bool:
    """Return whether numbers count lines."""
    return bool((np.diff(numbers) == 1).all())


def _unnamed_time(reading: _Reading, fit: _Fit, ascending: Sequence[int], *, is_stated: bool) -> int | None:
    """Return a column of times that no name says: of times since 1970, or the only one that ascends in like steps."""
    strict = [k for k in ascending if bool((np.diff(fit.numbers(k)) > 0).mean() >= 0.9)]
    since_1970 = [k for k in strict if _is_epoch(fit.numbers(k)) and fit.count > 1]
    if since_1970:
        return since_1970[0]
    even = [k for k in strict if not reading.names[k] and _is_even(fit.numbers(k)) and not is_counter(reading.names[k])]
    few = len(fit.body) < _ASCENDS
    if (
        is_stated
        or fit.kind == "hex"
        or len(fit.body) < 3
        or fit.count < (3 if few else 2)
        or not even
        or len(even) > 2
    ):
        return None
    times = [k for k in even if not _counts(fit.numbers(k))]
    if len(times) == 1 and not few and len(even) == 1:
        reading.said.append(f"column {times[0] + 1} ascends")
        return times[0]
    column = (times or even)[0]

    def without(layout: Layout) -> Layout:
        table = layout.table or Table()
        return replace(
            layout, table=replace(table, time_column=None, time_unit="s", leave_out=[*table.leave_out, column + 1])
        )

    reading.ask(f"column {column + 1} may be the time", ("the time", _same), ("not the time, and not a taxel", without))
    return column


def _is_even(numbers: NDArray[np.float64]) -> bool:
    steps = np.diff(numbers)
    return bool(len(steps) and np.median(steps) > 0 and steps.max() <= 20 * np.median(steps))


def _unit_of_time(reading: _Reading, fit: _Fit, column: int) -> str:
    """Return the unit of a column of times: as its name or unit says, by the years since 1970, or by usual rates."""
    of_units = time_unit(f"t {reading.units[column]}") if reading.units[column] else None
    stated = time_unit(reading.names[column]) or of_units
    if stated:
        return stated
    unit, possible = unit_of_times(fit.numbers(column))
    if not possible:
        return unit
    numbers = fit.numbers(column)
    step = float(np.median(np.diff(numbers)[np.diff(numbers) > 0]))

    def in_unit(unit: str) -> Callable[[Layout], Layout]:
        return lambda layout: replace(layout, table=replace(layout.table or Table(), time_unit=unit))

    reading.ask(
        "the unit of the time",
        *((f"{each}: {1e6 / (UNITS_US[each] * step):.4g} frames/s", in_unit(each)) for each in possible),
    )
    return unit


def unit_of_times(times: NDArray[np.float64]) -> tuple[str, list[str]]:
    """Return the unit of times by the years since 1970, or by usual rates; and, if two fit about equally, both."""
    if since_1970 := _is_epoch(times[np.isfinite(times)]):
        return since_1970, []
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return "s", []
    rates = {unit: 1e6 / (us * float(np.median(steps))) for unit, us in UNITS_US.items()}
    possible = [unit for unit, hz in rates.items() if _POSSIBLE_HZ[0] <= hz <= _POSSIBLE_HZ[1]]
    usual = [unit for unit, hz in rates.items() if _USUAL_HZ[0] <= hz <= _USUAL_HZ[1]]
    if len(usual) == 1 or len(possible) == 1:
        return (usual if len(usual) == 1 else possible)[0], []
    possible = possible or sorted(rates, key=lambda unit: abs(np.log(rates[unit] / 100.0)))
    return possible[0], possible[:2]


def _lines_of_same_time(reading: _Reading, fit: _Fit, column: int) -> None:
    """Ask whether lines of the same time, always as many, are one frame."""
    if reading.table.has_lines:
        return
    cells = fit.cells(column)
    begins = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
    sizes = set(np.diff(begins).tolist())
    if len(begins) < 3 or len(sizes) != 1 or (size := sizes.pop()) < 2:
        return

    def together(layout: Layout) -> Layout:
        return replace(layout, table=replace(layout.table or Table(), frame_lines=size))

    reading.ask(f"{size} lines have the same time", ("rounded times", _same), ("lines of one frame", together))


def _without_times(reading: _Reading, fit: _Fit, text: Text) -> None:
    """Ask what lines without times are: frames one after the other, or the rows of one frame."""
    count = sum(1 for line in text.lines() if line.strip(" \t\r,;")) - fit.body[0]
    count -= len(fit.lines) - fit.body[0] - len(fit.body)

    def together(layout: Layout) -> Layout:
        return replace(layout, table=replace(layout.table or Table(), frame_lines=count, frame_end=None))

    if reading.table.has_lines or count < 2:
        reading.ask("it has no times", ("frames without times", _same))
    else:
        reading.ask(
            f"{counted(count, 'line')}, no times",
            ("a frame per line, without times", _same),
            (f"rows of one frame: frame_lines = {count}", together),
        )


def _taxels(reading: _Reading, fit: _Fit, time: int | None) -> list[int]:
    """Return the columns of readings, and say why the others are none."""
    names, left = reading.names, reading.left
    for k in range(fit.count):
        if k == time or k in left:
            continue
        kind = fit.types[k]
        if kind == "text":
            _text(reading, fit, k)
        elif kind in ("time", "day"):
            left[k] = "a date" if kind == "day" else "another time"
        elif kind == "number" and names[k]:
            _named(reading, fit, k)
        elif kind == "number" and k == (time == 0) and len(fit.body) >= _COUNTS and _counts(fit.numbers(k)):
            left[k] = "a counter"
    taxels = [k for k in range(fit.count) if k != time and k not in left]
    if not taxels:
        # A sensor may have one taxel, and its name be that of a state.
        taxels = [k for k in left if left[k].startswith("labels") or left[k] == "another quantity"]
        for k in taxels:
            del left[k]
    return _of_one_unit(reading, taxels)


def _named(reading: _Reading, fit: _Fit, column: int) -> None:
    """Say why a column of numbers is no taxel, if its name, or times since 1970, say it."""
    name, numbers, left = reading.names[column], fit.numbers(column), reading.left
    whole = bool((numbers[np.isfinite(numbers)] % 1 == 0).all())
    few = len(set(fit.cells(column))) <= _KEYS
    if (time_unit(name) is not None and len(name) > 1) or (_ascends(numbers) and _is_epoch(numbers)):
        left[column] = "another time"
    elif is_counter(name) and whole:
        left[column] = "a counter"
    elif is_label(name) and few:
        left[column] = f"labels; label_column = {reading.called(column)!r} reads them"
    elif is_key(name) and whole and few:
        _key(reading, fit, column)
    elif is_other(name):
        left[column] = "another quantity"


def _text(reading: _Reading, fit: _Fit, column: int) -> None:
    """Say what a column of texts is: the sensor of each line, which is asked, labels, or remarks."""
    name = reading.names[column]
    if time_unit(name) is not None and len(name) > 1:
        reading.left[column] = "times in a form that taxel does not read"
        return
    cells = [cell for cell in fit.cells(column) if cell not in MISSING]
    changes = sum(a != b for a, b in pairwise(cells))
    few = 1 < len(set(cells)) <= _KEYS and len(cells) == len(fit.body)
    if few and (is_key(name) or 3 * changes > len(cells)) and not is_label(name):
        _key(reading, fit, column)
    else:
        reads = f"; label_column = {reading.called(column)!r} reads them" if len(set(cells)) > 1 else ""
        reading.left[column] = f"texts{reads}"


def _key(reading: _Reading, fit: _Fit, column: int) -> None:
    """Ask whether a column names the sensor of each line."""
    keys = sorted(set(fit.cells(column)))
    reading.left[column] = "by"
    called = reading.called(column)
    before = column - 1
    if before >= 0 and fit.types[before] == "number" and not reading.names[before] and _follows(fit, before, column):
        reading.left[before] = "the same as the column that names the sensor"
    if len(keys) == 1:
        reading.left[column] = f"always {keys[0]}"
        return

    def split(layout: Layout) -> Layout:
        table = layout.table or Table()
        return replace(layout, table=replace(table, by=called, leave_out=[c for c in table.leave_out if c != called]))

    shown = ", ".join(keys[:4]) + ", ..." * (len(keys) > 4)
    choices: list[_Choice] = [(f"a source for each: by = {called!r}", split), ("all lines are of one sensor", _same)]
    reading.asked.insert(0, (f"column {called} is {shown} in turn", choices))


def _follows(fit: _Fit, column: int, key: int) -> bool:
    """Return whether a column has one value for each key."""
    pairs = set(zip(fit.cells(column), fit.cells(key), strict=True))
    return len(pairs) == len(set(fit.cells(key))) == len(set(fit.cells(column))) and len(pairs) > 1


def _of_one_unit(reading: _Reading, taxels: list[int]) -> list[int]:
    """Return the columns in the unit of most, of a force or pressure if there is one; leave out those of others."""
    units = Counter(reading.units[k] for k in taxels if reading.units[k])
    forces = Counter({unit: count for unit, count in units.items() if is_force(unit)})
    (unit, count), *others = (forces or units).most_common() or [("", 0)]
    if not unit:
        return taxels
    if others and others[0][1] == count:
        other = others[0][0]

        def swapped(layout: Layout) -> Layout:
            table = layout.table or Table()
            moved = [reading.called(k) for k in taxels if reading.units[k] == unit]
            kept = [reading.called(k) for k in taxels if reading.units[k] == other]
            left = [column for column in table.leave_out if column not in kept]
            return replace(layout, unit=other, table=replace(table, leave_out=[*left, *moved]))

        reading.ask(f"readings in {unit} or in {other}", (unit, _same), (other, swapped))
    for k in taxels:
        if reading.units[k] not in ("", unit):
            reading.left[k] = f"in {reading.units[k]}"
    return [k for k in taxels if k not in reading.left]


def _are_events(reading: _Reading, fit: _Fit, taxels: Sequence[int]) -> bool:
    """Return whether the columns are those of events, a line each."""
    names = {"col": "x", "column": "x", "row": "y", "pol": "p", "polarity": "p", "on": "p"}
    called = [names.get(reading.names[k].lower(), reading.names[k].lower()) for k in taxels]
    if sorted(called) != ["p", "x", "y"] or reading.table.time_column is None:
        return False
    x, y, p = (fit.numbers(taxels[called.index(name)]) for name in "xyp")
    are_places = all(bool((axis >= 0).all() and (axis % 1 == 0).all()) for axis in (x, y))
    return are_places and (set(p.tolist()) <= {0.0, 1.0} or set(p.tolist()) <= {-1.0, 1.0})


def _maybe_events(reading: _Reading, fit: _Fit) -> None:
    """Ask whether four columns without names are events, in one of the orders that programs write."""
    if any(reading.names) or fit.count != 4:
        return
    for order in ("txyp", "xypt"):
        t, x, y, p = (fit.numbers(order.index(name)) for name in "txyp")
        whole = all(bool((axis % 1 == 0).all() and (axis >= 0).all()) for axis in (x, y))
        if not whole or not bool((np.diff(t) >= 0).all()) or set(p.tolist()) not in ({0.0, 1.0}, {-1.0, 1.0}):
            continue
        of_events = replace(
            reading.table, columns=list(order), time_column="t", time_unit="us", leave_out=[], events=True
        )
        break
    else:
        return

    def as_events(layout: Layout) -> Layout:
        return replace(layout, table=of_events)

    reading.asked.insert(0, ("frames or events", [("frames of taxels", _same), ("events, in us", as_events)]))


def _unit_of_events(reading: _Reading, fit: _Fit, time: int | None) -> None:
    """Ask for the unit of times of events that no name says: their rate says nothing, as that of frames does."""
    reading.asked = [each for each in reading.asked if not each[0].startswith("the unit of the time")]
    numbers = fit.numbers(time or 0)
    if time is None or time_unit(f"{reading.names[time]}") or fit.types[time] == "time" or _is_epoch(numbers):
        return

    def in_unit(unit: str) -> Callable[[Layout], Layout]:
        return lambda layout: replace(layout, table=replace(layout.table or Table(), time_unit=unit))

    units = ("us", "ms") if bool((numbers % 1 == 0).all()) else ("s", "ms")
    reading.ask("the unit of the time of the events", *((unit, in_unit(unit)) for unit in units))


def _with_size(layout: Layout, reading: _Reading, taxels: Sequence[int]) -> Layout:
    """Return the layout with its unit, its axes (which are asked), and rows and columns that the names state."""
    unit = next((reading.units[k] for k in taxels if reading.units[k]), "")
    full = replace(layout, unit=layout.unit or unit or None)
    names = [reading.names[k] for k in taxels]
    if any(names) and axes_of(names) is not None:
        if layout.axis is None:
            reading.ask(
                "taxels with the axes x, y and z",
                ('axis = "z"; or "x", "y"', lambda each: replace(each, axis="z")),
                ('axis = "all": each axis a source', lambda each: replace(each, axis="all")),
                ('axis = "shear": the length of x and y', lambda each: replace(each, axis="shear")),
            )
        return full
    places = places_of(names) if any(names) and not layout.rows else None
    if places is not None and min(places) > 1:
        full = replace(full, rows=places[0], columns=places[1])
    # Lines that are parts of a frame whose size is known.
    table, size = full.table or Table(), (layout.rows or 0) * (layout.columns or 0)
    if size > len(taxels) and size % len(taxels) == 0 and not table.has_lines:
        full = replace(full, table=replace(table, frame_lines=size // len(taxels)))
    return full


def _said(reading: _Reading, fit: _Fit, time: int | None) -> Iterator[str]:
    """Yield how lines and columns were read, and which columns were left out and why."""
    table = reading.table
    marks = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks", "|": "bars"}
    kinds = {"marked": "marks and names between cells", "json": "lines of JSON", "hex": "hexadecimal"}
    yield kinds.get(table.lines, f"separated by {marks.get(table.separator, table.separator)}")
    if table.decimal == ",":
        yield "decimal commas"
    if time is not None:
        yield f"time {reading.called(time)!r} in {table.time_unit}"
    elif table.frame_time is not None:
        yield f"time in {table.frame_time} above each frame"
    else:
        yield "no times"
    units = sorted({reading.units[k] for k in range(fit.count) if k not in reading.left and k != time} - {""})
    if units:
        yield f"unit {units[0]}"
    reasons: dict[str, list[str]] = {}
    for k, why in sorted(reading.left.items()):
        reasons.setdefault(why, []).append(reading.names[k] or f"column {k + 1}")
    for why, names in reasons.items():
        shown = ", ".join(islice(names, 8)) + ", ..." * (len(names) > 8)
        yield f"{shown} left out: {why}"


def _refuse(text: Text, layout: Layout, reading: _Reading) -> NoReturn:
    """Refuse a table that can be read in two ways, with the layout of each."""
    why, choices = reading.asked[0]
    lines = list[str]()
    for number, (name, change) in enumerate(choices, 1):
        changed = change(layout)
        lines.append(f"# {number}. {name}")
        written = of_layout(changed)
        table = changed.table or Table()
        timed = table.time_column is not None or table.frame_time is not None or changed.rate_hz is not None
        lines += [*([] if timed else [_RATE_NOT_SAID]), written.rstrip("\n"), ""]
    also = "".join(f"; also open: {other}" for other, _ in reading.asked[1:])
    unread = [reading.names[k] for k, why in reading.left.items() if why.startswith("times in")]
    also += "".join(f"; {name} has times in a form that taxel does not read" for name in unread)
    ways = f"can be read in {len(choices)} ways ({why})" if len(choices) > 1 else why
    right = advice(text.path, f"write {'one of these' if len(choices) > 1 else 'this'}")
    error = unreadable(f"{ways}{also}; {right}:", text.path)
    error.args = (*error.args, "\n".join(lines).rstrip())
    raise error
