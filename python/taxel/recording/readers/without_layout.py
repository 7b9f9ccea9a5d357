"""Refuses a table or arrays of another program that no layout file describes, with the lines of one that reads them."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import read_arrays, shapes
from taxel._base.cells import MISSING, are_units, cells, ends_in_separator, seconds_of, times_of, unit_of
from taxel._base.limits import LINE, TIME_US
from taxel._base.messages import counted
from taxel._base.number_text import float_of
from taxel._core import FormatError
from taxel.formats import text
from taxel.formats.layout import advice
from taxel.formats.times import ISO, UNITS_US
from taxel.recording.readers.foreign import ARRAYS, facts_of, list_arrays

#: A column is one of times, if its name does not say so, if it ascends for so many lines.
_ASCENDS = 20
#: A grid is guessed where its longer side has at most so many times the taxels of the other.
_FLATTEST = 2
#: The fewest columns that may be a square grid, also with names that are numbered, and a grid of other sides.
_GRID, _NAMED_GRID, _LARGE = 9, 25, 64
#: The fewest columns, less one, that may be numbered in a line above them.
_FEWEST = 3
#: Fewer lines than these are not enough to see where frames end, and how much of a text is then read.
_FEW, _MORE = 200, 1 << 20
#: What a time column's unit is guessed by: the rate and the duration of a usual recording, Hz and s.
_USUAL_HZ, _USUAL_S = 100.0, 30.0
#: A line above a frame: a word and the frame's number, or its time.
_ABOVE_FRAME = re.compile(r"([^\W\d_]+)[ \t:=#.]*\d+(?:[.,]\d+)?[ \t]*(?:m?s)?[ \t]*")
#: Names of columns that number the lines.
_COUNTS = re.compile(
    r"(frames?|index|idx|samples?|records?|no|nr|num|number|count|#|bild|lfd)[ ._]*(nr|no|number|#|id)?\.?",
    re.IGNORECASE,
)
#: Names of columns with a number each, as taxels of a grid have, and no words.
_NUMBERED = re.compile(r"[^\W\d]{0,12}[ _\-\[(.]*\d+[\])]?", re.UNICODE)
#: A unit of a force, a pressure or a voltage ...
_FORCE_UNIT = r"([mk]?N|kgf?|gf?|[hkM]?Pa|m?bar|psi|N/(?:cm|mm|m)[²2]|mmHg|[mµu]?V)"
#: ... that ends a column's name: Heel [N], toe (kPa), thumb_mN, mV.
_UNIT_IN_NAME = re.compile(rf"(?:[\[(]{_FORCE_UNIT}[\])]|(?:^|(?<=_)){_FORCE_UNIT})$")
#: ... that a line above a table states: Einheit;kPa, Unit of pressure: N/cm2, Druck [kPa], Force in N, or only [kPa].
_UNIT_ABOVE = re.compile(
    r"(?:\b(?i:(?:mess|druck|kraft)?einheit(?:en)?|units?)\b(?:[^:;=\t,\[(]*[:;=\t,\[(])?"
    r"|\b(?i:druck|kraft|pressure|force)\b[^\[(\d]*?(?:[:;=\t,\[(]|\bin\b)|^\W*[\[(])"
    rf"[ \t\"':;=,\[(]*{_FORCE_UNIT}(?![\w/²])"
)
#: What lines above a table state of its rate: rate 120 Hz, Abtastrate: 0,5 kHz, fs = 50 ...
_RATE_ABOVE = re.compile(
    r"(?i:\b(?:(?:sampling|sample|frame|scan)?[ _-]?(?:rate|frequency)|abtastrate|(?:abtast|mess)?frequenz|fs|fps)\b"
    r"[^\d\n]{0,12}?(\d+(?:[.,]\d+)?)[ \t]*(khz)?)"
)
#: ... and of its rows and columns: rows 24 columns 40, Zeilen: 24; or 24 x 40.
_ROWS_ABOVE = re.compile(r"\b(?:rows?|zeilen)\b\W{0,4}(\d+)", re.IGNORECASE)
_COLUMNS_ABOVE = re.compile(r"\b(?:columns?|cols?|spalten)\b\W{0,4}(\d+)", re.IGNORECASE)
_GRID_ABOVE = re.compile(r"\b(\d+) ?[xX×] ?(\d+)\b")
#: What ends a column's name in brackets: its unit, of which there may be others, as Battery [%].
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\s\d\[\]()]{1,8})\s*[\])]$")
#: What the names of two feet or hands begin with.
_SIDE = re.compile(r"(left|right|links|rechts|l|r)(?![^\W\d_])", re.IGNORECASE)
_SIDES = ({"left", "right"}, {"links", "rechts"}, {"l", "r"})
#: Names under which a file of arrays states its rate, Hz, and its unit.
_RATE = re.compile(
    r"(?i:(?:(?:sampling|samples?|frame|scan)[ _-]?)?(?:rate|freq|frequency)|fs|fps|hz)(?i:[ _-]?[\[(]?hz[\])]?)?"
)
_UNITS = re.compile(r"(?i:(?:[a-z]+[ _-])?units?)")
_FACTS = re.compile(f"{_RATE.pattern}|{_UNITS.pattern}")
_NO_RATE = "# rate_hz = 100  # frames per second, which the file does not state; without it, frames have no times"
_NO_UNIT = (
    '# unit = "kPa"  # of the readings, which the file does not state; without this line, the readings are counts'
)
#: Names of the columns of events in the orders that programs write without names.
_EVENTS = (("x", "y", "p", "t"), ("t", "x", "y", "p"))
_EVENT_NAMES: dict[str, Callable[[str], bool]] = {
    "x": lambda name: name.lower() in ("x", "col", "column"),
    "y": lambda name: name.lower() in ("y", "row"),
    "p": lambda name: name.lower() in ("p", "pol", "polarity", "on"),
    "t": lambda name: unit_of(name) is not None or name.lower() in ("ts", "timestamp"),
}


def refuse_without_layout(path: Path) -> None:
    """Refuse a table or arrays of another program with the layout that reads them; a text without a table is none.

    The lines of the layout hold what the file says; what it does not say is a comment.

    Raises
    ------
    FormatError : it holds a table or arrays, or is damaged
    """
    if path.suffix.lower() not in ARRAYS:
        lines = _beginning(path)
        begin = _begin_of_frames(lines)
        found = _TextTable.find([line if not begin or not line.startswith(begin) else "" for line in lines])
        if found is None or not (found.events() or found.taxels()):
            return
        # Compressed texts are several times larger.
        size = path.stat().st_size * (4 if path.suffix.lower() == ".gz" else 1)
        holds, lines = _of_table(found, max(1.0, size / sum(len(line) + 1 for line in lines)), begin)
        says = "describe it"
    else:
        arrays = shapes(path)
        name = next((name for name, shape in arrays.items() if len(shape) in (2, 3)), None)
        if name is None:
            raise FormatError(
                f"{path}: contains {list_arrays(arrays)}; must contain the arrays t, x, y and p (events) or the arrays "
                "values and t (frames); with a layout file, one array of frames x rows x columns or frames x taxels "
                "(docs/files.md)"
                + "; if the data are in a struct, save its fields: save('FILE.mat', '-struct', 'NAME')"
                * path.name.endswith(".mat")
            )
        holds, lines = list_arrays(arrays), _of_arrays(path, name, arrays)
        says = "name the array of frames" if len(arrays) > 1 else "give rate_hz, or describe it"
    raise FormatError(f"{path}: contains {holds}, not written by taxel; {advice(path, says)}:", "\n".join(lines))


def _beginning(path: Path) -> list[str]:
    """Return the first lines of a text, 64 KiB of them, and more where these are few lines."""
    lines = text.beginning(path)
    if len(lines) < _FEW:
        lines = text.beginning(path, _MORE)
    return lines or text.beginning(path, LINE + 1)


def _begin_of_frames(lines: Sequence[str]) -> str:
    """Return the word that begins a line above every few lines, and a number behind it, as of "Frame 1"; else ""."""
    at: dict[str, list[int]] = {}
    for k, line in enumerate(line for line in lines if line.strip()):
        if found := _ABOVE_FRAME.fullmatch(line):
            at.setdefault(found[1], []).append(k)
    steps = {word: np.diff(places) for word, places in at.items() if len(places) > 1}
    return next((word for word, each in steps.items() if each[0] > 1 and (each == each[0]).all()), "")


def _of_arrays(path: Path, name: str, shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the layout of the array of a name."""
    of_times = {name: max(shape, default=0) for name, shape in shapes.items() if unit_of(name) is not None}
    of_times = {name: count for name, count in of_times.items() if math.prod(shapes[name]) == count}
    first, *inner, last = shapes[name]
    # MATLAB's frames are often along the last axis; NumPy's are along the first.
    longest_last = path.suffix.lower() == ".mat" and last > max([first, *inner])
    timed = set(of_times.values())
    is_last = last in timed if (first in timed) != (last in timed) else longest_last
    count, shape = (last, [first, *inner]) if is_last else (first, [*inner, last])
    time = next((name for name, times in of_times.items() if times == count), None)
    times = []
    if time is not None:
        times = [f"time = {_quote(time)}", *_unit(time, read_arrays(path, [time])[time].ravel(), count)]
    facts = facts_of(path, name, _FACTS)
    data = [f"array = {_quote(name)}"] * bool(name) + ['frames = "last"'] * is_last + times
    # An array of frames x rows x columns says its size, and others of the folder may have another.
    size = [] if len(shape) == 2 else _size(shape[0], ())
    rate = [_stated_rate(facts)] if time is None else []
    return [*size, _stated_unit(facts), *rate, *(["[data]", *data] if data else [])]


def _stated_rate(facts: Mapping[str, float | str]) -> str:
    """Return the line of the rate that a file states, or that it states none."""
    for name, value in facts.items():
        if _RATE.fullmatch(name) and not isinstance(value, str) and 1e-9 <= value <= 1e6:
            return f"rate_hz = {value:.10g}  # {name} of the file"
    return _NO_RATE


def _stated_unit(facts: Mapping[str, float | str]) -> str:
    """Return the line of the unit that a file states, or that it states none."""
    for name, value in facts.items():
        if _UNITS.fullmatch(name) and isinstance(value, str) and re.fullmatch(f"{_FORCE_UNIT}|counts", value):
            return f"unit = {_quote(value)}  # {name} of the file"
    return _NO_UNIT


@dataclass(frozen=True)
class _TextTable:
    """Hold the parts of a table: the cells of its names (none), of its units (none) and of its lines of numbers."""

    separator: str
    decimal: str
    skipped: int
    names: Sequence[str]
    units: Sequence[str]
    body: Sequence[Sequence[str]]
    #: Which columns hold numbers; the others hold texts.
    numeric: Sequence[bool]
    #: The lines above, which may state the unit, the rate and the size.
    above: Sequence[str]
    #: Lines a frame, if empty lines are between frames, else 1.
    between_empty: int

    @classmethod
    def find(cls, lines: Sequence[str]) -> _TextTable | None:
        """Find the parts; None of a text that does not end in lines of numbers, or of numbers beside texts."""
        for texts in (False, True):
            marks = [(mark, decimal) for decimal in ".," for mark in ",;\t " if mark != decimal]
            fits = [fit for mark, decimal in marks if (fit := _Fit.find(lines, mark, decimal, texts=texts)) is not None]
            if fits:
                return cls._of(max(fits, key=lambda fit: fit.score))
        return None

    @classmethod
    def _of(cls, fit: _Fit) -> _TextTable:
        rows, numeric, separator = fit.rows, fit.numeric, fit.separator
        first = next(k for k, row in enumerate(rows) if _fits(row, numeric, fit.decimal))
        is_numbered = _numbers_columns(rows[max(first - 1, 0) :], numeric, fit.decimal, below=first > 0)
        first += is_numbered
        in_units = first > 1 and are_units(rows[first - 2], rows[first - 1])
        head = first - 1 - in_units
        below, columns = [fit.lines[number] for number in fit.numbers[first:]], len(numeric)
        ends = ends_in_separator(None, below, separator)
        names = rows[head] if head >= 0 and len(rows[head]) in {columns, columns - ends} else []
        columns -= ends_in_separator(names or None, below, separator)
        units = rows[first - 1] if names and in_units else []
        body = [row[:columns] for row in rows[first:] if len(row) >= columns]
        skipped = fit.numbers[head if names else first]
        if is_numbered:
            # Read as numbers they would be a frame.
            names, skipped = [""] * columns, fit.numbers[first - 1] + 1
        between = _between_empty(fit.numbers[first:])
        return cls(
            separator,
            fit.decimal,
            skipped,
            names[:columns],
            units,
            body,
            numeric[:columns],
            fit.lines[:skipped],
            between,
        )

    @property
    def unit_above(self) -> str:
        """The unit that the lines above state, "" if none or several."""
        units = {found[1] for line in self.above if (found := _UNIT_ABOVE.search(line))}
        return units.pop() if len(units) == 1 else ""

    @property
    def rate_above(self) -> float | None:
        """The rate that the lines above state, Hz; None if none or several."""
        stated = {found.groups() for line in self.above if (found := _RATE_ABOVE.search(line))}
        rates = [
            float(rate.replace(",", ".")) * (1000.0 if (unit or "").lower() == "khz" else 1.0) for rate, unit in stated
        ]
        return rates[0] if len(rates) == 1 and rates[0] > 0.0 else None

    def size_above(self, taxels: int) -> tuple[int, int] | None:
        """Return the rows and columns that the lines above state, if they have so many taxels."""
        text = "\n".join(self.above)
        sizes = [(int(rows), int(columns)) for rows, columns in _GRID_ABOVE.findall(text)]
        rows, columns = _ROWS_ABOVE.search(text), _COLUMNS_ABOVE.search(text)
        sizes += [(int(rows[1]), int(columns[1]))] if rows and columns else []
        return next((size for size in sizes if size[0] * size[1] == taxels), None)

    def numbers(self, column: int) -> NDArray[np.float64]:
        return np.array([_number(row[column], self.decimal) for row in self.body])

    def called(self, column: int) -> str:
        """Return how a layout names a column: by its name, or, without a name, by its number from 1."""
        name = self.names[column] if self.names else ""
        return _quote(name) if name and list(self.names).count(name) == 1 else str(column + 1)

    def events(self) -> list[str]:
        """Return the names of the columns if they are those of events, else none; "" is one that is none of theirs."""
        orders: Sequence[Sequence[str]] = _EVENTS
        if self.names:
            orders = [[next((e for e, found in _EVENT_NAMES.items() if found(name)), "") for name in self.names]]
        for order in orders:
            if len(order) == len(self.numeric) and sorted(filter(None, order)) == ["p", "t", "x", "y"]:
                t, x, y, p = (self.numbers(order.index(name)) for name in "txyp")
                are_places = all((axis >= 0).all() and (axis == np.rint(axis)).all() for axis in (x, y))
                if are_places and (set(p) <= {0, 1} or set(p) <= {-1, 1}) and len(t) > 1 and (np.diff(t) >= 0).all():
                    return list(order)
        return []

    def time(self) -> int | None:
        """Return which column holds the times."""
        named = next(iter(times_of(self.names)), None)
        if named is not None and self.numeric[named]:
            return named
        for column in (k for k, is_numeric in enumerate(self.numeric) if not is_numeric):
            seconds = np.array([seconds_of(row[column]) for row in self.body])
            if np.isfinite(seconds).all() and (np.diff(seconds[:: self.lines_of(seconds)]) > 0).all():
                return column
        return 0 if self._ascends and not self.counts and len(self.numeric) > 1 else None

    def unit(self, column: int) -> str:
        """Return the unit of a column, by the line of units or by its name (Heel [N]); "" if none is stated."""
        if self.units:
            return self.units[column].strip("[]()")
        within = _UNIT_IN_NAME.search(self.names[column]) if self.names else None
        return (within[1] or within[2]) if within else ""

    def of_time(self, column: int, longer: float) -> list[str]:
        """Return the lines that say which column holds the times; the file is `longer` than what was read of it."""
        lines = [f"time_column = {self.called(column)}"]
        if not self.numeric[column]:
            return [*lines, f"time_unit = {_quote(ISO)}"]
        name = self.names[column] if self.names else ""
        if unit_of(name) is None and not self._is_unit_of_time(column):
            lines = [f"{lines[0]}  # this column ascends; if it is a taxel, remove this line"]
        unit = f"{name} {self.units[column].strip('[]()')}" if self.units else name
        times = self.numbers(column)
        times = times[:: self.lines_of(times)]
        return [*lines, *_unit(unit if unit_of(unit) or not unit_of(name) else name, times, len(times) * longer)]

    def _is_unit_of_time(self, column: int) -> bool:
        return bool(self.units) and unit_of(f"t {self.units[column].strip('[]()')}") not in (None, "")

    def lines_of(self, times: NDArray[np.float64]) -> int:
        """Return how many lines a frame has: those between empty lines, or those of the same time."""
        if self.between_empty > 1 or len(times) < 2:
            return self.between_empty
        begins = np.flatnonzero(np.diff(times, prepend=np.nan) != 0)
        steps = np.diff(begins)
        return int(steps[0]) if len(steps) and (steps == steps[0]).all() and len(times) - begins[-1] <= steps[0] else 1

    @property
    def _ascends(self) -> bool:
        """Whether a first column of numbers ascends, one without a name, or else in like steps."""
        if not self.numeric[0]:
            return False
        times = self.numbers(0)
        steps = np.diff(times[:: self.lines_of(times)])
        is_ascending = len(self.body) >= _ASCENDS and bool(len(steps) and (steps > 0).all())
        unnamed = not self.names or not self.names[0]
        return is_ascending and (unnamed or bool(steps.max() <= 3 * np.median(steps)))

    @property
    def counts(self) -> bool:
        """Whether a first column, of names that are none of a time, numbers the lines."""
        if not self._ascends or not self.names or not (not self.names[0] or _COUNTS.fullmatch(self.names[0])):
            return False
        numbers = self.numbers(0)
        return bool((np.diff(numbers[:: self.lines_of(numbers)]) == 1).all())

    def taxels(self) -> list[int]:
        """Return the columns of readings."""
        time = self.time()
        left = self.left_out(time)
        return [k for k in range(len(self.numeric)) if k not in left and k != time]

    def left_out(self, time: int | None) -> list[int]:
        """Return which columns are not taxels: texts, other times, another unit than most, and numbers of lines."""
        times = [] if time is None else times_of(self.names)
        left = {k for k, is_numeric in enumerate(self.numeric) if not is_numeric or k in times or self._is_empty(k)}
        left |= {0} if self.counts else set()
        units = {k: self.unit(k) or self._in_brackets(k) for k in range(len(self.numeric)) if k not in {*left, time}}
        unit, count = Counter(units.values()).most_common(1)[0] if units else ("", 0)
        others = {k for k, stated in units.items() if stated and unit and stated != unit}
        return sorted((left | (others if 2 * count > len(units) else set())) - {time})

    def unread_times(self, left: Sequence[int]) -> str:
        """Return the comment on columns that are left out, if one of them holds times; else ""."""
        for column in left:
            if np.isfinite([seconds_of(row[column]) for row in self.body]).all():
                return f"  # {self.called(column)} contains times that do not ascend"
        named = [column for column in times_of(self.names) if column in left]
        return f"  # {self.called(named[0])} contains times in a form that taxel does not read" if named else ""

    def _in_brackets(self, column: int) -> str:
        within = _IN_BRACKETS.search(self.names[column]) if self.names else None
        return within[1] if within else ""

    def _is_empty(self, column: int) -> bool:
        """Whether a column of a name in words holds nothing, as remarks do; a taxel may lack all its values too."""
        name = self.names[column] if self.names else ""
        is_word = bool(name) and not _NUMBERED.fullmatch(name) and not self.unit(column)
        return is_word and all(not row[column] for row in self.body)

    def two_sides(self, taxels: Sequence[int], left: Sequence[int]) -> list[str]:
        """Return comments that say how each of two sides is read alone, where names begin with them; else none."""
        found = [_SIDE.match(self.names[k]) if self.names else None for k in taxels]
        sides: dict[str, list[int]] = {}
        for k, side in zip(taxels, found, strict=True):
            sides.setdefault("" if side is None else side[1].lower(), []).append(k)
        if set(sides) not in _SIDES or len({len(columns) for columns in sides.values()}) > 1 or len(taxels) < 4:
            return []
        lines = []
        for name, columns in sides.items():
            others = sorted({*left, *taxels} - set(columns))
            lines.append(
                f"# to read only the {name} side: columns = {len(columns)}, leave_out = {[k + 1 for k in others]}"
            )
        return lines

    def form(self) -> list[str]:
        """Return the lines that say how its lines are read."""
        lines = [f"separator = {_quote(self.separator)}"] * (self.separator != ",")
        lines += [f"decimal = {_quote(self.decimal)}"] * (self.decimal != ".")
        return lines + [f"skip_lines = {self.skipped}"] * (self.skipped > 0)


@dataclass(frozen=True)
class _Fit:
    """Hold the cells of lines by a separator and a decimal mark, which make columns of numbers."""

    separator: str
    decimal: str
    lines: Sequence[str]
    #: The places of the lines that are not empty, and their cells.
    numbers: Sequence[int]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[bool]

    @classmethod
    def find(cls, lines: Sequence[str], separator: str, decimal: str, *, texts: bool) -> _Fit | None:
        """Return the cells; None if they make no columns of numbers, `texts`: beside others of texts."""
        there = [(k, row) for k, line in enumerate(lines) if line.strip() and any(row := cells(line, separator))]
        rows = [row for _, row in there]
        numeric = _numeric(rows, decimal, texts=texts)
        return cls(separator, decimal, lines, [k for k, _ in there], rows, numeric) if numeric else None

    @property
    def score(self) -> tuple[int, int]:
        """How many columns hold numbers, and, less, how many hold texts with a separator within them."""
        last = self.rows[-1]
        within = [k for k, cell in enumerate(last) if not self.numeric[k] and (";" in cell or "\t" in cell)]
        return sum(self.numeric), -len(within)


def _numbers_columns(rows: Sequence[Sequence[str]], numeric: Sequence[bool], decimal: str, *, below: bool) -> bool:
    """Return whether the first line of numbers numbers the columns, from 0 as programs do; `below`: another line."""
    first, *rest = rows[below:]
    cells = [cell for cell in first if cell]
    if not rest or not _FEWEST < len(cells) >= len(numeric) - 1 or cells != [str(k) for k in range(len(cells))]:
        return False
    if below and len(rows[0]) == len(numeric):
        return False
    # A time may begin with 0.
    ascending = [_number(row[0], decimal) for row in (first, *rest) if row]
    return not first[0] or not bool((np.diff(ascending) > 0).all())


def _between_empty(numbers: Sequence[int]) -> int:
    """Return how many lines are between two empty ones, if it is a number of them everywhere; else 1."""
    breaks = np.flatnonzero(np.diff(np.array(numbers)) > 1) + 1
    sizes = np.diff(breaks, prepend=0)
    if not len(sizes) or (sizes != sizes[0]).any():
        return 1
    # The last ones may be the beginning of a frame.
    rest = len(numbers) - breaks[-1]
    return int(sizes[0]) if rest == sizes[0] or (rest < sizes[0] and len(sizes) > 1) else 1


def _of_table(found: _TextTable, longer: float, begin: str) -> tuple[str, list[str]]:
    """Return what a table holds, and its layout; the file is `longer` than what was read, `begin` is above frames."""
    if events := found.events():
        return _of_events(found, events)
    time, taxels = found.time(), found.taxels()
    left = found.left_out(time)
    table = found.form()
    lines = found.between_empty
    if lines > 1:
        table.append(f"frame_begin = {_quote(begin)}" if begin else 'frame_end = "blank"')
    elif time is not None:
        times = found.numbers(time) if found.numeric[time] else np.array([seconds_of(row[time]) for row in found.body])
        lines = found.lines_of(times)
        table += [f"frame_lines = {lines}"] * (lines > 1)
    table += [] if time is None else found.of_time(time, longer)
    unread = found.unread_times(left) if time is None else ""
    table += [f"leave_out = [{', '.join(map(found.called, left))}]{unread}"] * bool(left)
    table += found.two_sides(taxels, left) if lines == 1 else []
    missing = {row[k] for row in found.body for k in taxels if row[k] in MISSING}
    table += [f"missing = {_quote(cell)}" for cell in sorted(missing - {"nan"} or missing)[-1:]]
    units = {found.unit(k) for k in taxels}
    # Columns of several units have none in common.
    name = units.pop() if len(units) == 1 else None
    unit = (
        [] if name is None else [f"unit = {_quote(name or found.unit_above)}" if name or found.unit_above else _NO_UNIT]
    )
    stated = found.rate_above
    rate = (
        [_NO_RATE if stated is None else f"rate_hz = {stated:.10g}  # stated above the table"] if time is None else []
    )
    holds = f"a table of {counted(len(found.numeric), 'column')}" + f", {lines} lines per frame" * (lines > 1)
    names = [found.names[k] for k in taxels] if found.names else []
    grid = found.size_above(len(taxels)) if lines == 1 else (lines, len(taxels))
    size = _size(len(taxels), names) if grid is None else [f"rows = {grid[0]}", f"columns = {grid[1]}"]
    return holds, [*size, *unit, *rate, *(["[table]", *table] if table else [])]


def _of_events(found: _TextTable, order: Sequence[str]) -> tuple[str, list[str]]:
    """Return that a table holds events, and its layout; `order` are the names of the columns of events."""
    at = order.index("t")
    name = found.names[at] if found.names else ""
    times = found.numbers(at)
    unit = unit_of(name) or ("us" if (times == np.rint(times)).all() else "s")
    columns = [event or f"column {k}" for k, event in enumerate(order, 1)]
    left = [k for k, event in enumerate(order, 1) if not event]
    skipped = replace(found, skipped=found.skipped + (1 + bool(found.units)) * bool(found.names))
    table = [
        *skipped.form(),
        f"columns = [{', '.join(map(_quote, columns))}]",
        'time_column = "t"',
        f"time_unit = {_quote(unit)}" + "  # if the unit is another, change it here" * (not unit_of(name)),
        *([f"leave_out = [{', '.join(map(str, left))}]"] if left else []),
        "events = true",
    ]
    x, y = (int(found.numbers(order.index(axis)).max()) + 1 for axis in "xy")
    size = (
        f"# write the rows and columns of the sensor (at least rows = {y}, columns = {x}): the file does not state them"
    )
    return f"a table of events ({', '.join(filter(None, order))})", [size, "[table]", *table]


def _numeric(rows: Sequence[Sequence[str]], decimal: str, *, texts: bool) -> list[bool]:
    """Return which columns hold numbers; none if others hold texts, which `texts` allows."""
    alike = [row for row in rows if len(row) == len(rows[-1])]
    numeric = [_holds_numbers(column, decimal) for column in zip(*alike, strict=True)]
    if not rows or not _fits(rows[-1], numeric, decimal):
        return []
    # A line of prose may hold a number, too.
    return numeric if all(numeric) or (texts and len(rows) > 1 and _fits(rows[-2], numeric, decimal)) else []


def _holds_numbers(column: Sequence[str], decimal: str) -> bool:
    """Return whether a column holds a number somewhere, or is empty below its name and unit."""
    below = column[2:] or column[-1:]
    return any(math.isfinite(_number(cell, decimal)) for cell in column) or all(cell in MISSING for cell in below)


def _fits(row: Sequence[str], numeric: Sequence[bool], decimal: str) -> bool:
    """Whether a row has as many cells, with numbers where they are."""
    if len(row) != len(numeric):
        return False
    return _are_numbers([cell for cell, is_number in zip(row, numeric, strict=True) if is_number], decimal)


def _size(taxels: int, names: Sequence[str]) -> list[str]:
    """Return the lines that state rows and columns of so many taxels, a grid only where their names are not words."""
    words = any(names) and not all(_NUMBERED.fullmatch(name) for name in names)
    rows = next(rows for rows in range(math.isqrt(taxels), 0, -1) if not taxels % rows)
    columns = taxels // rows
    is_grid = rows == columns if taxels < _LARGE else columns <= _FLATTEST * rows
    if words or not is_grid or taxels < (_NAMED_GRID if any(names) else _GRID):
        note = "" if words or taxels < 2 else "  # if the taxels are a grid, row by row, write its rows and columns"
        return ["rows = 1", f"columns = {taxels}{note}"]
    guess = f"  # a guess from {taxels} taxels: if the grid is another, or a row, write its rows and columns"
    return [f"rows = {rows}{guess}", f"columns = {columns}"]


def _unit(name: str, times: NDArray[np.float64], count: float) -> list[str]:
    """Return the line that says the unit of times: that in their name, else that of the most usual rate and duration.

    `count` are the frames of the recording, of which `times` may be the first.
    """
    stated = unit_of(name)
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    most = float(np.nanmax(np.abs(times), initial=0.0))
    fitting = [unit for unit in UNITS_US if most * UNITS_US[unit] <= TIME_US]

    def unlike(unit: str) -> float:
        """Return how far rate and duration by a unit are from usual ones, in powers of ten."""
        step_s = step * UNITS_US[unit] / 1e6
        return abs(math.log10(step_s * _USUAL_HZ)) + abs(math.log10(max(count - 1, 1) * step_s / _USUAL_S))

    unit = stated or (min(fitting, key=unlike) if step > 0 and fitting else fitting[0] if fitting else "us")
    steps = np.diff(times)
    # Stamps are rounded, so that a rate follows from all steps, without those of gaps.
    regular = steps[(steps > 0.5 * step) & (steps < 1.5 * step)]
    notes = [f"{1e6 / (regular.mean() * UNITS_US[unit]):.4g} frames/s"] if step > 0 else []
    others = [_quote(name) for name in UNITS_US if name != unit]
    notes += [f"a guess; or {', '.join(others[:-1])} or {others[-1]}"] * (not stated)
    return [f"time_unit = {_quote(unit)}" + "  # " * bool(notes) + ", ".join(notes)]


def _are_numbers(cells: Sequence[str], decimal: str) -> bool:
    """Whether cells are numbers, at least one of them, or marks of missing values."""
    finite = [math.isfinite(_number(cell, decimal)) for cell in cells]
    return any(finite) and all(is_finite or cell in MISSING for is_finite, cell in zip(finite, cells, strict=True))


def _number(cell: str, decimal: str) -> float:
    """Return the number of a cell with a decimal mark; NaN of one that is none."""
    if decimal == ",":
        cell = "" if "." in cell else cell.replace(",", ".")
    try:
        return float_of(cell)
    except ValueError:
        return math.nan


def _quote(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)
