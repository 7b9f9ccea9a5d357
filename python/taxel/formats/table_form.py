"""The form of a table: how its lines are read, and what each column is, by its first lines and what a layout says.

Where two readings fit about equally, or nothing says when a line was, both layouts are printed and none is taken.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import islice, pairwise
from typing import Any, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import unreadable
from taxel._base.limits import COLUMNS
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.formats import column_names
from taxel.formats.column_names import time_unit
from taxel.formats.layout import Layout, PrintedFrames, Table
from taxel.formats.layout_text import refuse_to_choose
from taxel.formats.lines import MISSING, Line, LineShape, has_marks, is_number, read_line
from taxel.formats.table_text import Text
from taxel.formats.times import FEW_ODD, ISO, ODD, UNITS_US, is_day, is_time

__all__ = ["EVENT_COLUMNS", "Form", "LineForm", "form_of", "form_of_lines", "stated_count", "unit_of_times"]

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
#: What a program quotes because of the comma in it: a number with a decimal comma, or with thousands.
_QUOTED = re.compile(r'"([^"]*)"')
_DECIMAL, _THOUSANDS = re.compile(r"[-+]?\d+,\d+"), re.compile(r"[-+]?\d{1,3}(?:[,.]\d{3})+(?:[,.]\d+)?")
_PLACE_IN_LIST = re.compile(r"\[\d+\]")
_HEX = re.compile(r"(?:0x)?(?:[0-9A-Fa-f]{2})+")
_HEX_LETTER = re.compile(r"(?<![\w.])(?:0x)?[0-9]*[A-Fa-f][0-9A-Fa-f]*(?![\w.])")
#: Names of the columns of events.
EVENT_COLUMNS = {"col": "x", "column": "x", "row": "y", "pol": "p", "polarity": "p", "on": "p"}
#: What is changed in a layout: keys of it or of its table; `left` and `read` are columns more to leave out, or fewer.
_Changes: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class Form:
    """Hold how a table is read.

    Parameters
    ----------
    layout : Layout
        Complete.
    names : tuple of str
        Of all columns; "" for one without a name.
    is_named : bool
        Whether the lines of the table have these names.
    first : int
        The number of the first line of numbers, from 0.
    said : tuple of str
        What was understood beyond the given layout, a text each.
    """

    layout: Layout
    names: tuple[str, ...]
    is_named: bool
    first: int
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

    @property
    def first(self) -> int:
        """The number of the first line of numbers, from 0."""
        return self.lines[self.body[0]][0]

    def cells(self, column: int) -> list[str]:
        """Return the cells of a column in the lines that are frames."""
        return [self.lines[k][1].cells[column] for k in self.body]

    def numbers(self, column: int) -> NDArray[np.float64]:
        """Return the numbers of a column; NaN for other cells."""
        cells = [cell.replace(",", ".") if self.decimal == "," else cell for cell in self.cells(column)]
        return np.array([float(cell) if is_number(cell) else np.nan for cell in cells])

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
        return _epoch(self.numbers(column)) if self.types[column] == "number" else ""


@dataclass
class _Reading:
    """Hold what is understood of a table as it is looked at: its layout, what was left out and why, what is open."""

    fit: _Fit
    table: Table
    names: tuple[str, ...]
    units: tuple[str, ...]
    left: dict[int, str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    #: What two layouts differ in, and how, with a comment for each.
    asked: list[tuple[str, Mapping[str, _Changes]]] = field(default_factory=list)

    def called(self, column: int) -> str | int:
        """Return how a layout names a column: by its name, or, without a name of its own, by its number from 1."""
        name = self.names[column]
        return name if name and self.names.count(name) == 1 else column + 1

    def set(self, **keys: Any) -> None:
        """Set keys of the table."""
        self.table = replace(self.table, **keys)


def form_of(text: Text, layout: Layout, label_column: str | int | None = None) -> Form:
    """Return how a table is read: as its layout says, or, if it says nothing of the table, as its first lines look.

    Parameters
    ----------
    text : Text
    layout : Layout
    label_column : str or int, optional
        As of `taxel.formats.layout.Table`.

    Raises
    ------
    FormatError : no table of numbers, one that the layout does not fit, or two readings that fit about equally (prints
        the layout of each)
    """
    if layout.table is not None:
        how = layout.table if label_column is None else replace(layout.table, label_column=label_column)
        return _stated(text, replace(layout, table=how), how)
    lines = text.head
    if text.path.suffix.lower() == ".json" and not any(read_line(line, "json") for line in lines[:3]):
        raise unreadable("is one document of JSON; save a line of JSON per frame, or a .csv", text.path)
    begin, time_of_begin = _begin_of_frames(lines)
    is_begin = [bool(begin) and line.lstrip().startswith(begin) for line in lines]
    shown = ["" if above else line for line, above in zip(lines, is_begin, strict=True)]
    size = (layout.rows or 0) * (layout.columns or 0)
    in_hex, is_sure = _hex(text.lines, shown)
    found = [in_hex] if is_sure and in_hex is not None else list(_fits(shown, _FORMS))
    fits = [fit for fit in found if fit.purity >= _FITS]
    fits.sort(key=lambda fit: (-fit.score, bool(size) and fit.count != size))
    if not fits:
        why = "contains no table of numbers; if it has one, describe it in [table] of a layout file (docs/files.md)"
        raise unreadable(why, text.path)
    _refuse_lines_above(text, fits[0])
    reading = _reading(fits[0], shown)
    other = next((fit for fit in fits[1:] if _fits_as_well(fit, fits[0], size)), None)
    if other is not None:
        reading = _decided(reading, _reading(other, shown))
    fit = reading.fit
    if in_hex is not None and not is_sure:
        reading.asked.append(
            ("decimal or hexadecimal numbers", {"decimal numbers": {}, "hexadecimal numbers": {"lines": "hex"}})
        )
    _frames(reading, lines, is_begin, begin, time_of_begin)
    stated = layout.rows is not None or layout.rate_hz is not None or layout.path != text.path
    reading.set(label_column=label_column)
    time = _time(reading, is_stated=stated)
    if time is None and reading.table.frame_time is None and not stated:
        _without_times(reading, text)
    taxels = _taxels(reading, time)
    if not taxels:
        raise unreadable("contains no column of readings", text.path)
    reading.set(leave_out=[reading.called(k) for k in sorted(reading.left)])
    if _are_events(reading, taxels):
        reading.set(events=True)
        _unit_of_events(reading, time)
        full = replace(layout, table=reading.table)
    else:
        _maybe_events(reading)
        full = _with_size(replace(layout, table=reading.table), reading, taxels)
    if reading.asked and not (stated and reading.asked[0][0].startswith("the first line")):
        _refuse(text, full, reading)
    return Form(full, reading.names, any(reading.names), fit.first, (*_said(reading, time), *reading.said))


@dataclass(frozen=True)
class LineForm:
    """Hold how lines that are read as they arrive make frames, or rows of numbers.

    Parameters
    ----------
    shape : LineShape
    columns : tuple of str
        The names of all columns; "" for one without a name.
    clocks : tuple of (int, float)
        The columns whose sum is the time, each with its unit, us; none: the time of arrival.
    taxels : tuple of int
        The columns with values.
    lines : int
        Number of lines of a frame, 0 if only an empty line shows it.
    ends_blank : bool
        Whether an empty line ends a frame.
    keys : dict
        What was understood beyond what is stated, as keys of a source.
    said : tuple of str
        The same for people, with what was left out and why, a text each.
    """

    shape: LineShape
    columns: tuple[str, ...]
    clocks: tuple[tuple[int, float], ...]
    taxels: tuple[int, ...]
    lines: int
    ends_blank: bool
    keys: Mapping[str, str]
    said: tuple[str, ...]


def form_of_lines(
    lines: Sequence[str],
    stated: PrintedFrames,
    size: int | None,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    *,
    are_frames: bool = True,
) -> LineForm | None:
    """Return how lines of a live source are read: as is stated, and else as the first ones look; None if none is read.

    Parameters
    ----------
    lines : sequence of str
        The first ones.
    stated : PrintedFrames
    size : int, optional
        Number of taxels, if it is stated: then all columns of that number are taxels.
    unit_of : callable
        Returns the unit of a column of times (and the lines that these are of) by the arrival of lines; "" if it does
        not show.
    are_frames : bool
        Whether columns are taxels; else they are quantities, each with a name.

    Raises
    ------
    ProblemError : columns that are not there, or lines that can be read in two ways
    """
    reading = _reading_of_lines(lines, stated, size)
    if reading is None:
        return None
    fit = reading.fit
    places = {name: k for k, name in reversed([*enumerate(reading.names)]) if name}
    left = {_place("leave_out", column, places, fit.count) for column in stated.leave_out}
    clocks = _stated_clocks(reading, stated.time, places, unit_of)
    keys, per_frame = dict[str, str](), stated.frame_lines or 1
    ends_blank = stated.frame_end is not None
    of_line = None if size is None else size // per_frame
    is_whole = fit.count - len(left | {k for k, _ in clocks}) == of_line and not any(map(time_unit, reading.names))
    if not ends_blank and stated.frame_lines is None and not is_whole and (group := _between_blanks(fit, lines)) > 1:
        per_frame, ends_blank, keys["frame_end"] = group, True, "blank"
        reading.said.append(f"{group} lines per frame, between empty lines")
    elif ends_blank:
        per_frame = 0
    if not clocks and not is_whole:
        time = _time(reading, is_stated=not are_frames)
        if time is not None and time not in left:
            clocks = _found_clock(reading, time, unit_of, keys, is_sure=not are_frames)
    at = {k for k, _ in clocks}
    if is_whole or stated.leave_out or stated.columns or not are_frames:
        reading.asked.clear()
        reading.left.update((k, "texts") for k, kind in enumerate(fit.types[: len(reading.names)]) if kind == "text")
        taxels = [k for k in range(len(reading.names)) if k not in {*left, *at, *reading.left}]
    else:
        taxels = [k for k in _taxels(reading, next(iter(at), None)) if k not in left]
    if not taxels:
        raise ProblemError("lines have no column of values, only times and columns that are left out")
    if reading.asked:
        raise ProblemError(f"{reading.asked[0][0]}: state what it is by time=COLUMN:UNIT, leave_out= or frame_lines=")
    gone = sorted(set(reading.left) - left - at - set(taxels))
    if gone and are_frames:
        keys["leave_out"] = ":".join([*map(str, stated.leave_out), *(str(k + 1) for k in gone)])
    dated = frozenset(k for k in at if fit.types[k] == "time")
    numeric = frozenset((*taxels, *(at - dated)))
    own = reading.fit.lines[reading.fit.body[0]][1].names if fit.kind in ("marked", "json") else ()
    clock = next(iter(at - dated), None)
    names = own if any(own) else ()
    shape = LineShape(fit.count, numeric, dated, fit.kind, fit.separator, fit.decimal, clock, frozenset(MISSING), names)
    said = tuple(_said(reading, next(iter(at), None)))
    return LineForm(shape, reading.names, clocks, tuple(taxels), per_frame, ends_blank, keys, said)


def _reading_of_lines(lines: Sequence[str], stated: PrintedFrames, size: int | None) -> _Reading | None:
    """Return lines as the form reads them that fits best, with the stated names of columns; None if none fits."""
    in_hex, is_sure = _hex(lambda: lines, lines)
    wanted = stated_count(stated, size)
    found = [in_hex] if is_sure and in_hex is not None else list(_fits(lines, _FORMS, (), wanted))
    fits = sorted(found, key=lambda fit: (wanted is not None and fit.count != wanted, -fit.score))
    if not fits or fits[0].purity < _FITS * (not stated.leave_out):
        return None
    reading = _reading(fits[0], lines)
    if stated.columns:
        if len(stated.columns) != len(reading.names):
            here = f"lines have {counted(len(reading.names), 'column')}"
            raise ProblemError(f"columns={':'.join(map(str, stated.columns))}: {here}; must be as many")
        reading.names = tuple(map(str, stated.columns))
    reading.asked.clear()
    return reading


def _between_blanks(fit: _Fit, lines: Sequence[str]) -> int:
    """Return how many lines of numbers are between two empty lines, 0 if that differs or none are."""
    empty = np.cumsum([not line.strip() for line in lines])
    of_line = Counter(empty[[fit.lines[k][0] for k in fit.body]].tolist())
    # What is before the first empty line, and behind the last, may be a part.
    whole = {count for after, count in of_line.items() if 0 < after < empty[-1]}
    return whole.pop() if len(whole) == 1 else 0


def stated_count(stated: PrintedFrames, size: int | None) -> int | None:
    """Return how many columns lines have, if what is stated of them says it."""
    if stated.columns:
        return len(stated.columns)
    if size is None or stated.frame_end is not None:
        return None
    clocks = 0 if stated.time is None else 2 if "+" in stated.time else 1
    return size // (stated.frame_lines or 1) + clocks + len(stated.leave_out)


def _place(key: str, column: str | int, places: Mapping[str, int], count: int) -> int:
    """Return the place of a column that is stated by its name, or its number from 1."""
    if column in places:
        return places[str(column)]
    if not str(column).isdecimal():
        names = f"; the columns are {', '.join(places)}" * bool(places)
        raise ProblemError(f"{key}={column}: this column is missing{names}")
    if not 1 <= int(column) <= count:
        raise ProblemError(f"{key}={column}: lines have {counted(count, 'column')}")
    return int(column) - 1


def _stated_clocks(
    reading: _Reading,
    time: str | None,
    places: Mapping[str, int],
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
) -> tuple[tuple[int, float], ...]:
    """Return the columns of the time that is stated, with their units, us; without a unit it is found."""
    fit = reading.fit
    if time is None:
        return ()
    if "+" in time:
        seconds, nanoseconds = (_place("time", column, places, fit.count) for column in time.split("+", 1))
        return ((seconds, UNITS_US["s"]), (nanoseconds, UNITS_US["ns"]))
    column, _, unit = time.partition(":")
    place = _place("time", column, places, fit.count)
    if unit == ISO or (not unit and fit.types[place] == "time"):
        return ((place, UNITS_US["s"]),)
    if not unit:
        unit = time_unit(reading.names[place]) or unit_of(fit.numbers(place), [fit.lines[k][0] for k in fit.body])
    if unit not in UNITS_US:
        known = ", ".join((*UNITS_US, ISO))
        raise ProblemError(f"time={time}: the unit must be one of {known}, for example time={column}:ms")
    return ((place, UNITS_US[unit]),)


def _found_clock(
    reading: _Reading,
    time: int,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    keys: dict[str, str],
    *,
    is_sure: bool,
) -> tuple[tuple[int, float], ...]:
    """Return the column of times that was found, with its unit, us: by its name, by arrival, or as it looks."""
    fit, unit = reading.fit, reading.table.time_unit
    if unit != ISO and not time_unit(reading.names[time]):
        by_arrival = unit_of(fit.numbers(time), [fit.lines[k][0] for k in fit.body])
        if by_arrival or is_sure:
            unit = by_arrival or unit
            reading.asked = [each for each in reading.asked if not each[0].startswith("the unit of the time")]
    reading.set(time_unit=unit)
    keys["time"] = f"{reading.called(time)}:{unit}"
    return ((time, UNITS_US["s" if unit == ISO else unit]),)


def _refuse_lines_above(text: Text, fit: _Fit) -> None:
    """Refuse a table above which are many lines of numbers in another number of columns."""
    rows = [line.cells for _, line in fit.lines[: fit.body[0]]]
    odd = sum(len(cells) > 1 and 2 * sum(is_number(cell, fit.decimal) for cell in cells) > len(cells) for cells in rows)
    if odd > max(FEW_ODD, ODD * len(fit.body)):
        why = f"{odd} lines above have numbers in another number of columns than the {len(fit.body)} from here on"
        raise unreadable(why, text.path, line=fit.first + 1)


def _stated(text: Text, layout: Layout, how: Table) -> Form:
    """Return the names of the columns of a table that a layout describes, and its first line of numbers."""
    shown = ["" if k < how.skip_lines or how.is_between(line) else line for k, line in enumerate(text.head)]
    missing = () if how.missing is None else (how.missing,)
    fit = next(_fits(shown, [(how.lines, how.separator, how.decimal)], missing), None)
    line = how.skip_lines + 1
    if fit is None:
        why = f"no line of numbers between separators {how.separator!r}; write what is right in [table] of the layout"
        raise unreadable(why, text.path, line=line if any(shown) else None)
    reading = _reading(fit, shown)
    names = tuple(how.columns) or reading.names
    if fit.count > COLUMNS:
        raise unreadable(f"{fit.count} columns; must have at most {COLUMNS}", text.path, line=line)
    if how.columns and not len(reading.names) <= len(names) <= fit.count:
        wrong = f"{counted(len(names), 'name')} for {counted(len(reading.names), 'column')}"
        raise unreadable(wrong, text.path, line=line)
    return Form(layout, names, any(names), fit.first)


def _fits(
    lines: Sequence[str], forms: Sequence[tuple[str, str, str]], missing: Sequence[str] = (), wanted: int | None = None
) -> Iterator[_Fit]:
    """Yield each form that makes columns of numbers of the lines, as many as are wanted where any line has them."""
    there = [(k, line) for k, line in enumerate(lines) if line.strip(" \t\r,;")]
    few = [line for _, line in there[-40:]]
    for kind, separator, decimal in forms:
        marked = separator in (",", ";") if kind != "plain" else separator == " "
        if len(forms) > 1 and (
            (not marked and separator != "," and not any(separator in line for line in few))
            or (separator == decimal and not _are_quoted_decimals(few))
            or (kind == "marked" and (2 * sum(map(has_marks, few)) < len(few) or _are_quoted_numbers(few)))
            or (kind == "json" and not any(line.lstrip()[:1] in "{[" for line in few))
        ):
            continue
        parsed = [(k, read_line(line, kind, separator, decimal)) for k, line in there]
        cells = [(k, line) for k, line in parsed if line is not None and line.cells]
        if kind != "plain" and cells:
            names = Counter(line.names for _, line in cells).most_common(1)[0][0]
            cells = [(k, line.in_order(names)) for k, line in cells]
        fit = _fit(kind, separator, decimal, cells, len(there), {*MISSING, *missing}, wanted)
        if fit is not None:
            yield fit


def _with_comma(lines: Sequence[str]) -> list[str]:
    """Return the quoted cells in which a comma is."""
    return [cell for line in lines for cell in _QUOTED.findall(line) if "," in cell]


def _are_quoted_numbers(lines: Sequence[str]) -> bool:
    """Return whether all that is quoted is one number with a comma each, which a comma does not split."""
    quoted = _with_comma(lines)
    return bool(quoted) and all(_DECIMAL.fullmatch(cell) or _THOUSANDS.fullmatch(cell) for cell in quoted)


def _are_quoted_decimals(lines: Sequence[str]) -> bool:
    """Return whether these have decimal commas: 1,234 alone may be a thousand."""
    quoted = _with_comma(lines)
    return all(map(_DECIMAL.fullmatch, quoted)) and not all(map(_THOUSANDS.fullmatch, quoted))


def _fit(
    kind: str,
    separator: str,
    decimal: str,
    lines: Sequence[tuple[int, Line]],
    total: int,
    missing: set[str],
    wanted: int | None = None,
) -> _Fit | None:
    """Return lines as one form reads them; None without a column of numbers. `total` lines are not empty."""

    def type_of(cell: str) -> str:
        if cell in missing:
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
    return _Fit(kind, separator, decimal, lines, body, named, purity, purity * len(body) / total)


def _fits_as_well(other: _Fit, fit: _Fit, size: int) -> bool:
    """Return whether another reading fits about equally, in another number of columns."""
    fits = other.purity >= _EQUALLY * fit.purity and len(other.body) >= len(fit.body)
    return fits and other.count != fit.count != size and other.kind == fit.kind == "plain"


def _decided(reading: _Reading, other: _Reading) -> _Reading:
    """Return the reading of two that the names above the numbers say; ask if they say none."""
    if all(reading.names):
        return reading
    if any(other.names):
        return other
    first, second = (counted(each.fit.count, "column") for each in (reading, other))
    keys = ("separator", "decimal", "skip_lines", "lines")
    changes = {key: getattr(other.table, key) for key in keys} | {"time_column": None, "leave_out": []}
    reading.asked.append((f"{first} or {second}", {first: {}, second: changes}))
    return reading


def _reading(fit: _Fit, lines: Sequence[str]) -> _Reading:
    """Return the names above a table, and how its lines are read."""
    above = [(k, list(line.cells)) for k, line in fit.lines[: fit.body[0]]]
    table = Table(separator=fit.separator, decimal=fit.decimal, lines=fit.kind, skip_lines=fit.first)
    if fit.kind != "plain":
        table = replace(table, separator=fit.separator if fit.kind == "hex" else ",")
        own = fit.lines[fit.body[0]][1].names
        # The places in a list are no names.
        own = () if all(map(_PLACE_IN_LIST.fullmatch, own)) else own
        names = own if any(own) else _names_above_marks(fit, lines)
        if not any(own) and any(names):
            table = replace(table, columns=list(names))
        return _Reading(fit, table, names, ("",) * fit.count)
    real = fit.count
    while real > 1 and fit.types[real - 1] == "empty":
        real -= 1
    head = [
        (
            k,
            tuple(
                cell.strip("\"'# " if not n else "\"'") for n, cell in enumerate([*cells, *[""] * real][: fit.count])
            ),
        )
        for k, cells in above[-3:]
        if _width(cells) == real or len(cells) == fit.count
    ]
    unnamed = _Reading(fit, table, ("",) * real, ("",) * real)
    if not head or head[-1][0] < above[-1][0]:
        return _numbered(unnamed)
    has_units = len(head) > 1 and column_names.are_units(head[-2][1], head[-1][1]) and head[-1][0] > head[-2][0]
    units = head[-1][1] if has_units else ()
    at_names, names = head[-2 if has_units else -1]
    upper = head[-3 if has_units else -2][1] if len(head) > 1 + has_units else ()
    if all(not name or is_number(name, fit.decimal) for name in names):
        return _numbered(unnamed)
    names = names[: max(real, _width(names))]
    named = [name for name in names if name]
    if len(set(named)) < len(named) and any(upper):
        names = tuple(f"{a} {b}".strip() for a, b in zip(upper, names, strict=False))
        return _Reading(fit, replace(table, columns=list(names)), names, tuple(map(column_names.unit_of, names)))
    stripped = tuple(unit.strip("[]()") for unit in units[: len(names)]) or tuple(map(column_names.unit_of, names))
    return _Reading(fit, replace(table, skip_lines=at_names), names, stripped)


def _numbered(reading: _Reading) -> _Reading:
    """Return a table without names; whether a first line that numbers the columns is a frame is asked."""
    fit = reading.fit
    first = [float(cell) for cell in fit.lines[fit.body[0]][1].cells if is_number(cell)]
    counts = len(first) == fit.count >= 4 and bool(np.all(np.diff(first) == 1)) and first[0] in (0.0, 1.0)
    if counts and len(fit.body) > 1:
        below = {"skip_lines": fit.lines[fit.body[1]][0]}
        reading.asked.append(("the first line is 1, 2, 3 ...", {"a frame": {}, "numbers of columns": below}))
    return reading


def _names_above_marks(fit: _Fit, lines: Sequence[str]) -> tuple[str, ...]:
    """Return names for cells with marks between them; a name may be above several: t,p above 0.1,"[1, 2]"."""
    above = next((lines[k] for k in reversed(range(fit.first)) if lines[k].strip()), "")
    for separator in sorted(";\t,", key=above.count, reverse=True):
        names, groups = read_line(above, "plain", separator), read_line(lines[fit.first], "plain", separator)
        if names is None or groups is None or not above or len(names.cells) != len(groups.cells):
            continue
        inner = [read_line(cell, "marked", ",", fit.decimal) for cell in groups.cells]
        sizes = [0 if line is None else len(line.cells) for line in inner]
        if sum(sizes) == fit.count and not any(is_number(name) for name in names.cells):
            pairs = zip(names.cells, sizes, strict=True)
            return tuple(f"{name}[{k}]" if size > 1 else name for name, size in pairs for k in range(size))
    return ("",) * fit.count


def _width(cells: Sequence[str]) -> int:
    return max((k for k, cell in enumerate(cells, 1) if cell), default=0)


def _hex(all_lines: Callable[[], Iterable[str]], lines: Sequence[str]) -> tuple[_Fit | None, bool]:
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
        return next(_fits(lines, [("hex", separator, ".")]), None), has_letters
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


def _frames(reading: _Reading, lines: Sequence[str], is_begin: Sequence[bool], begin: str, time: str | None) -> None:
    """Say how many lines a frame has: those between lines of text, or between empty lines."""
    fit = reading.fit
    if begin:
        reading.set(frame_begin=begin, frame_time=time, skip_lines=min(is_begin.index(True), fit.first))
        reading.said.append(f"frames begin at lines {begin!r}")
        return
    numbers = [fit.lines[k][0] for k in fit.body]
    empty = np.cumsum([not line.strip(" \t\r,;") for line in lines])
    ends = [k for k, (before, after) in enumerate(pairwise(numbers), 1) if empty[after] > empty[before]]
    groups = {after - before for before, after in pairwise([0, *ends])}
    if len(ends) > 1 and len(groups) == 1 and (size := groups.pop()) > 1:
        reading.set(frame_end="blank")
        reading.said.append(f"{size} lines per frame, between empty lines")


def _time(reading: _Reading, *, is_stated: bool) -> int | None:
    """Return the column of times that fits best, and say its unit; None without one.

    Where a layout states the sensor or the rate, a column is one of times by its name or its cells alone.
    """
    fit, names = reading.fit, reading.names
    scores: dict[int, int] = {}
    for k in range(len(names)):
        if fit.types[k] not in ("number", "time"):
            continue
        # A letter may be the name of a taxel too: it is the time where it comes first, or ascends.
        if time_unit(names[k]) is not None and (k == 0 or len(names[k]) > 1 or fit.ascends(k)):
            scores[k] = 4 + 2 * fit.ascends(k)
        elif fit.types[k] == "time":
            scores[k] = 3
        elif reading.table.frame_time is None and fit.count > 1 and _rises(fit, k) and fit.epoch(k):
            scores[k] = 2
    column = max(scores, key=lambda k: (scores[k], -k), default=None)
    reading.left.update(dict.fromkeys((k for k in scores if k != column and scores[k] >= 4), "another time"))
    if column is None and reading.table.frame_time is None and not is_stated and fit.kind != "hex":
        column = _unnamed_time(reading)
    if column is None:
        return None
    unit = ISO if fit.types[column] == "time" else _unit_of_time(reading, column)
    reading.set(time_column=reading.called(column), time_unit=unit)
    cells = fit.cells(column)
    begins = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
    sizes = set(np.diff(begins).tolist())
    if len(begins) > 2 and len(sizes) == 1 and (size := sizes.pop()) > 1 and not reading.table.has_lines:
        frames: dict[str, _Changes] = {"rounded times": {}, "lines of one frame": {"frame_lines": size}}
        reading.asked.append((f"{size} lines have the same time", frames))
    return column


def _rises(fit: _Fit, column: int) -> bool:
    """Return whether nearly every cell of a column of numbers is above the one before."""
    steps = np.diff(fit.numbers(column)) if fit.types[column] == "number" else np.empty(0)
    return len(steps) > 0 and bool((steps > 0).mean() >= 0.9)


def _unnamed_time(reading: _Reading) -> int | None:
    """Return a column of times that no name says: the only one that ascends in like steps; in few lines, ask."""
    fit = reading.fit
    if len(fit.body) < 3 or fit.count < 2:
        return None
    even = [
        k for k in range(len(reading.names)) if not reading.names[k] and _rises(fit, k) and _is_even(fit.numbers(k))
    ]
    times = [k for k in even if not fit.counts(k)]
    few = len(fit.body) < _ASCENDS
    if len(times) == len(even) == 1 and not few:
        reading.said.append(f"column {times[0] + 1} ascends")
        return times[0]
    if not even or len(even) > 2 or (few and fit.count < 3):
        return None
    column = (times or even)[0]
    no_time = {"time_column": None, "time_unit": "s", "left": [column + 1]}
    reading.asked.append(
        (f"column {column + 1} may be the time", {"the time": {}, "not the time, and not a taxel": no_time})
    )
    return column


def _is_even(numbers: NDArray[np.float64]) -> bool:
    steps = np.diff(numbers)
    return bool(np.median(steps) > 0 and steps.max() <= 20 * np.median(steps))


def _epoch(numbers: NDArray[np.float64]) -> str:
    """Return the unit in which numbers are times since 1970; "" if none."""
    first, last = (1e6 * edge for edge in _EPOCH)
    return next((u for u, us in UNITS_US.items() if ((numbers * us > first) & (numbers * us < last)).all()), "")


def _unit_of_time(reading: _Reading, column: int) -> str:
    """Return the unit of a column of times: as its name or unit says, by the years since 1970, or by usual rates."""
    own = reading.units[column]
    if stated := time_unit(reading.names[column]) or (time_unit(f"t {own}") if own else None):
        return stated
    unit, possible = unit_of_times(reading.fit.numbers(column))
    if possible:
        choices = {f"{each}: {hz:.4g} frames/s": {"time_unit": each} for each, hz in possible.items()}
        reading.asked.append(("the unit of the time", choices))
    return unit


def unit_of_times(times: NDArray[np.float64]) -> tuple[str, dict[str, float]]:
    """Return the unit of times by the years since 1970 or usual rates; if two fit about equally, the rate by each."""
    if since_1970 := _epoch(times[np.isfinite(times)]):
        return since_1970, {}
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return "s", {}
    rates = {unit: 1e6 / (us * float(np.median(steps))) for unit, us in UNITS_US.items()}
    usual, possible = (
        [unit for unit, hz in rates.items() if least <= hz <= most] for least, most in (_USUAL_HZ, _POSSIBLE_HZ)
    )
    if len(usual) == 1 or len(possible) == 1:
        return (usual if len(usual) == 1 else possible)[0], {}
    possible = possible or sorted(rates, key=lambda unit: abs(np.log(rates[unit] / 100.0)))
    return possible[0], {unit: rates[unit] for unit in possible[:2]}


def _without_times(reading: _Reading, text: Text) -> None:
    """Ask what lines without times are: frames one after the other, or the rows of one frame."""
    fit = reading.fit
    odd = len(fit.lines) - len(fit.body)
    count = sum(1 for line in text.lines() if line.strip(" \t\r,;")) - odd
    if reading.table.has_lines or count < 2:
        reading.asked.append(("it has no times", {"frames without times": {}}))
        return
    together = {f"rows of one frame: frame_lines = {count}": {"frame_lines": count, "frame_end": None}}
    reading.asked.append((f"{counted(count, 'line')}, no times", {"a frame per line, without times": {}, **together}))


def _taxels(reading: _Reading, time: int | None) -> list[int]:
    """Return the columns of readings, and say why the others are none."""
    fit, names, left, label = reading.fit, reading.names, reading.left, reading.table.label_column
    known = {time, names.index(label) if label in names else label - 1 if isinstance(label, int) else None}
    for k in range(len(names)):
        why = "" if k in known or k in left else next(filter(None, _reasons(reading, k, first=int(time == 0))), "")
        if why:
            left[k] = why
    taxels = [k for k in range(len(names)) if k not in known and k not in left]
    if not taxels:
        # A sensor may have one taxel, and its name be that of a state.
        taxels = [k for k in left if fit.types[k] == "number" and left[k].startswith(("labels", "another quantity"))]
        for k in taxels:
            del left[k]
    return _of_one_unit(reading, taxels)


def _reasons(reading: _Reading, column: int, first: int) -> Iterator[str]:
    """Yield why a column is no taxel, by its cells, or by its name; the first that is not "" counts."""
    fit, name = reading.fit, reading.names[column]
    kind, cells = fit.types[column], [cell for cell in fit.cells(column) if cell not in MISSING]
    few, reads = len(set(cells)) <= _KEYS, f"; label_column = {reading.called(column)!r} reads them"
    is_time = time_unit(name) is not None and len(name) > 1
    if kind == "day":
        yield "a date"
    if kind == "text":
        in_turn = 3 * sum(a != b for a, b in pairwise(cells)) > len(cells)
        is_key = 1 < len(set(cells)) <= _KEYS and len(cells) == len(fit.body) and not column_names.is_label(name)
        yield "times in a form that taxel does not read" * is_time
        yield _key(reading, column) if is_key and (column_names.is_key(name) or in_turn) else ""
        yield f"texts{reads * (len(set(cells)) > 1)}"
    yield "times in a form that taxel does not read" * column_names.is_slow_time(name)
    if kind == "time" or is_time or (name and fit.ascends(column) and fit.epoch(column)):
        yield "another time"
    numbers = fit.numbers(column)
    whole = bool((numbers[np.isfinite(numbers)] % 1 == 0).all())
    # An unnamed column that counts lines, among columns with names or in many lines.
    is_sure = len(fit.body) >= (2 if any(reading.names) else _COUNTS)
    counts = not name and column == first and is_sure and kind == "number" and fit.counts(column)
    if counts or (column_names.is_counter(name) and whole):
        yield "a counter"
    yield f"labels{reads}" * (column_names.is_label(name) and few)
    if column_names.is_key(name) and whole:
        yield _key(reading, column) if few else "a counter"
    yield "another quantity" * column_names.is_other(name)


def _key(reading: _Reading, column: int) -> str:
    """Ask whether a column names the sensor of each line; return why it is no taxel."""
    fit, called = reading.fit, reading.called(column)
    keys = sorted(set(fit.cells(column)))
    before = column - 1
    if before >= 0 and fit.types[before] == "number" and not reading.names[before]:
        pairs = set(zip(fit.cells(before), fit.cells(column), strict=True))
        if len(pairs) == len(keys) == len(set(fit.cells(before))) > 1:
            reading.left[before] = "the same as the column that names the sensor"
    if len(keys) == 1:
        return f"always {keys[0]}"
    shown = ", ".join(keys[:4]) + ", ..." * (len(keys) > 4)
    each: dict[str, _Changes] = {f"a source for each: by = {called!r}": {"by": called, "read": [called]}}
    reading.asked.insert(0, (f"column {called} is {shown} in turn", {**each, "all lines are of one sensor": {}}))
    return "by"


def _of_one_unit(reading: _Reading, taxels: list[int]) -> list[int]:
    """Return the columns in the unit of most, of a force or pressure if there is one; leave out those of others."""
    units = Counter(reading.units[k] for k in taxels if reading.units[k])
    forces = Counter({unit: count for unit, count in units.items() if column_names.is_force(unit)})
    (unit, count), *others = (forces or units).most_common() or [("", 0)]
    if not unit:
        return taxels
    if others and others[0][1] == count:
        other = others[0][0]
        moved, kept = ([reading.called(k) for k in taxels if reading.units[k] == each] for each in (unit, other))
        choices: dict[str, _Changes] = {unit: {}, other: {"unit": other, "left": moved, "read": kept}}
        reading.asked.append((f"readings in {unit} or in {other}", choices))
    reading.left.update({k: f"in {reading.units[k]}" for k in taxels if reading.units[k] not in ("", unit)})
    return [k for k in taxels if k not in reading.left]


def _are_events(reading: _Reading, taxels: Sequence[int]) -> bool:
    """Return whether the columns are those of events, a line each."""
    names = [reading.names[k].lower() for k in taxels]
    called = [EVENT_COLUMNS.get(name, name) for name in names]
    is_so = sorted(called) == ["p", "x", "y"] and reading.table.time_column is not None
    return is_so and _are_places(reading.fit, *(taxels[called.index(name)] for name in "xyp"))


def _are_places(fit: _Fit, x: int, y: int, p: int) -> bool:
    """Return whether columns hold places, and polarities."""
    places = np.concatenate([fit.numbers(x), fit.numbers(y)])
    return bool((places >= 0).all() and (places % 1 == 0).all()) and set(fit.numbers(p).tolist()) in (
        *({0.0}, {1.0}, {-1.0}, {0.0, 1.0}, {-1.0, 1.0}),
    )


def _maybe_events(reading: _Reading) -> None:
    """Ask whether four columns without names are events, in one of the orders that programs write."""
    fit = reading.fit
    for order in ("txyp", "xypt") if fit.count == 4 and not any(reading.names) else ():
        t, (x, y, p) = fit.numbers(order.index("t")), (order.index(name) for name in "xyp")
        if _are_places(fit, x, y, p) and len(set(fit.numbers(p).tolist())) == 2 and bool((np.diff(t) >= 0).all()):
            events = {"columns": list(order), "time_column": "t", "time_unit": "us", "leave_out": [], "events": True}
            reading.asked.insert(0, ("frames or events", {"frames of taxels": {}, "events, in us": events}))
            return


def _unit_of_events(reading: _Reading, time: int | None) -> None:
    """Ask for the unit of times of events that no name says: their rate says nothing, as that of frames does."""
    reading.asked = [each for each in reading.asked if not each[0].startswith("the unit of the time")]
    fit = reading.fit
    if time is None or time_unit(reading.names[time]) or fit.types[time] == "time" or fit.epoch(time):
        return
    units = ("us", "ms") if bool((fit.numbers(time) % 1 == 0).all()) else ("s", "ms")
    reading.asked.append(("the unit of the time of the events", {unit: {"time_unit": unit} for unit in units}))


def _with_size(layout: Layout, reading: _Reading, taxels: Sequence[int]) -> Layout:
    """Return the layout with its unit, its axes (which are asked), and rows and columns that the names state."""
    unit = next((reading.units[k] for k in taxels if reading.units[k]), "")
    full = replace(layout, unit=layout.unit or unit or None)
    names = [reading.names[k] for k in taxels]
    if any(names) and column_names.axes_of(names) is not None:
        if layout.axis is None:
            choices: dict[str, _Changes] = {
                'axis = "z"; or "x", "y"': {"axis": "z"},
                'axis = "all": each axis a source': {"axis": "all"},
                'axis = "shear": the length of x and y': {"axis": "shear"},
            }
            reading.asked.append(("taxels with the axes x, y and z", choices))
        return full
    places = column_names.places_of(names) if any(names) and not layout.rows else None
    if places is not None and min(places) > 1:
        full = replace(full, rows=places[0], columns=places[1])
    # Lines that are parts of a frame whose size is known; a line with a time of its own is a frame.
    size, is_part = (layout.rows or 0) * (layout.columns or 0), reading.table.time_column is None
    if is_part and size > len(taxels) and size % len(taxels) == 0 and not reading.table.has_lines:
        full = replace(full, table=replace(reading.table, frame_lines=size // len(taxels)))
    return full


def _said(reading: _Reading, time: int | None) -> Iterator[str]:
    """Yield how lines and columns were read, and which columns were left out and why."""
    table = reading.table
    marks = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks", "|": "bars"}
    kinds = {"marked": "marks and names between cells", "json": "lines of JSON", "hex": "hexadecimal"}
    yield kinds.get(table.lines, f"separated by {marks.get(table.separator, table.separator)}")
    if table.decimal == ",":
        yield "decimal commas"
    if time is not None:
        yield f"time {reading.called(time)!r} in {table.time_unit}"
    else:
        yield "no times" if table.frame_time is None else f"time in {table.frame_time} above each frame"
    if table.label_column is not None:
        yield f"labels {table.label_column!r}"
    used = [reading.units[k] for k in range(len(reading.units)) if k not in reading.left and k != time]
    yield from (f"unit {unit}" for unit in sorted(filter(None, used))[:1])
    reasons: dict[str, list[str]] = {}
    for k, why in sorted(reading.left.items()):
        reasons.setdefault(why, []).append(reading.names[k] or f"column {k + 1}")
    for why, names in reasons.items():
        shown = ", ".join(islice(names, 8)) + ", ..." * (len(names) > 8)
        yield f"{shown} left out: {why}"


def _refuse(text: Text, layout: Layout, reading: _Reading) -> NoReturn:
    """Refuse a table that can be read in two ways, with the layout of each."""
    why, choices = reading.asked[0]
    also = "".join(f"; also open: {other}" for other, _ in reading.asked[1:])
    unread = [reading.names[k] for k, why in reading.left.items() if why.startswith("times in")]
    also += "".join(f"; {name} has times in a form that taxel does not read" for name in unread)
    ways = f"can be read in {len(choices)} ways ({why})" if len(choices) > 1 else why
    refuse_to_choose(text.path, f"{ways}{also}", {name: _changed(layout, each) for name, each in choices.items()})


def _changed(layout: Layout, changes: _Changes) -> Layout:
    """Return a layout with other keys, of its own or of its table."""
    table = layout.table or Table()
    known = {each.name for each in fields(Table)}
    left = [column for column in table.leave_out if column not in changes.get("read", ())]
    of_table = {"leave_out": [*left, *changes.get("left", ())], **{k: v for k, v in changes.items() if k in known}}
    own = {key: value for key, value in changes.items() if key not in (*known, "left", "read")}
    return replace(layout, table=replace(table, **of_table), **own)
