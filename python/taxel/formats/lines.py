"""Lines of numbers as programs print them, of files and live sources: cells, their names, and lines that are odd.

Brackets, quotes, arrows and ``NAME:`` separate cells; a line of JSON has the names of its keys; hex has no names.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

from taxel._base.messages import counted
from taxel.formats.column_names import UNIT_BEHIND
from taxel.formats.times import DATE

#: How the cells of a line are found: between separators; where marks and names are between them too; JSON; hex.
KINDS = ("plain", "marked", "json", "hex")
#: Cells that tables hold where a value is missing: the usual ones, and those of spreadsheets and of overflows.
USUAL = ("", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "-", "--", "null", "NULL", "None")
MISSING = (
    *USUAL,
    *("?", "OVF", "OVR", "OL", "inf", "-inf", "+inf", "Inf", "-Inf", "INF", "-INF"),
    *("#N/A", "#NA", "#DIV/0!", "#VALUE!", "#REF!", "#NUM!", "#NV"),
)

#: Marks between the thousands of a number, as countries have them.
THOUSANDS = (".", ",", "'", "’", " ", "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}")
OTHER = {".": ",", ",": "."}
#: What is odd about a line with thousands where none are known.
WITH_THOUSANDS = "with a number with thousands"
#: What is odd about a line of which a reading is no number; the others may be read.
WITH_TEXT = "with a cell that is no number"

#: A minus may be that of texts.
_MINUS = "\N{MINUS SIGN}"
_SIGN = rf"[+\-{_MINUS}]?"
_NUMBERS = {
    ".": re.compile(rf"{_SIGN}(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII),
    ",": re.compile(rf"{_SIGN}(?:\d+(?:,\d+)?|,\d+)(?:[eE][+-]?\d+)?", re.ASCII),
}
_LAST = re.compile(r"[-+]?\d+(?:[.,]\d+)?")
_ARROW = re.compile(r"[-=~]+>|:=|(?<=\d):(?=\s)")
_MARKS = str.maketrans(dict.fromkeys("[](){}<>|\"'", " "))
_BETWEEN = {".": re.compile(r"[\s,;]+"), ",": re.compile(r"[\s;]+")}
#: A name before a number or a bracket, which a colon or an equals sign ends.
_NAME = re.compile(r"(?<![\w.])[\"']?([^\W\d][\w.%/-]*(?:\[\d+\])*)[\"']?\s*[:=]\s*(?=[-+.\d\[({\"'])")
#: The blank between a day and a time, which separates no cells.
_DAY = re.compile(rf"({DATE}) +(?=\d\d?:\d\d)", re.ASCII)


def has_marks(line: str) -> bool:
    """Return whether brackets, quotes, an arrow or a name separate cells of a line, or units are behind its numbers.

    Examples
    --------
    >>> [has_marks(line) for line in ("1,2", "10:00:00 PM,2", "0.1 [2, 3]", "1 -> 2", "a: 3", "1,2.5N")]
    [False, False, True, True, True, True]
    """
    is_marked = any(mark in line for mark in "[](){}<>\"'") or _ARROW.search(line) or _NAME.search(line)
    return bool(is_marked) or (_may_have_units(line) and UNIT_BEHIND.search(line) is not None)


def _may_have_units(text: str) -> bool:
    """Return whether a text has a letter or a per cent sign, as most lines of numbers have not: to look takes long."""
    return text.lower() != text.upper() or "%" in text


@dataclass(frozen=True)
class Line:
    """Hold the cells of a line, and the name of each, "" without one."""

    cells: tuple[str, ...]
    names: tuple[str, ...]

    def in_order(self, names: tuple[str, ...]) -> Line:
        """Return the same cells in the order of names, if it has just these; else the line itself.

        Examples
        --------
        >>> read_line("b:4,a:3").in_order(("a", "b")).cells
        ('3', '4')
        """
        if self.names == names or len(self.names) != len(names) or {*self.names} != {*names}:
            return self
        by_name = dict(zip(self.names, self.cells, strict=True))
        return Line(tuple(by_name[name] for name in names), names)


def odd_lines(odd: Sequence[tuple[str, int]]) -> list[str]:
    """Return a text for each kind of lines that are no frame; each line is its kind and its number.

    Examples
    --------
    >>> odd_lines([("of text", 3), ("of text", 7)])
    ['2 lines of text (first: line 3)']
    """
    first, counts = dict(reversed(odd)), Counter(kind for kind, _ in odd)
    return [
        f"{counted(count, 'line')} {kind} ({'line' if count == 1 else 'first: line'} {first[kind]})"
        for kind, count in counts.items()
    ]


def is_number(cell: str, decimal: str = ".", thousands: str | None = None) -> bool:
    """Return whether a cell states a number.

    Examples
    --------
    >>> is_number("-1.5e3"), is_number("1,5"), is_number("1,5", ","), is_number("1,", ","), is_number("1_000")
    (True, False, True, False, False)
    >>> is_number("1.234,5", ",", "."), is_number("0.234", ",", "."), is_number("1.23", ",", ".")
    (True, False, False)
    """
    if _NUMBERS[decimal].fullmatch(cell) is not None:
        return True
    return thousands is not None and _grouped(decimal, thousands).fullmatch(cell) is not None


@cache
def _grouped(decimal: str, thousands: str) -> re.Pattern[str]:
    """Return the pattern of a number with marks between all of its thousands."""
    behind, between = map(re.escape, (decimal, thousands))
    return re.compile(rf"{_SIGN}[1-9]\d{{0,2}}(?:{between}\d{{3}})+(?:{behind}\d+)?", re.ASCII)


def number_of(cell: str, decimal: str, thousands: str | None) -> float:
    """Return the number that a cell states.

    Examples
    --------
    >>> number_of("1.234,5", ",", "."), number_of("-1,234", ".", ",")
    (1234.5, -1234.0)
    """
    bare = (cell if thousands is None else cell.replace(thousands, "")).replace(_MINUS, "-")
    return float(bare.replace(",", ".") if decimal == "," else bare)


def last_number(text: str) -> float:
    """Return the last number in a text; NaN without one.

    Examples
    --------
    >>> last_number("Frame 1 (2.5 ms)"), last_number("Frame")
    (2.5, nan)
    """
    found = _LAST.findall(text)
    return float(found[-1].replace(",", ".")) if found else math.nan


def read_line(line: str, kind: str = "marked", separator: str = ",", decimal: str = ".") -> Line | None:
    """Return the cells of a line; None of one that is not of this kind.

    Parameters
    ----------
    line : str
    kind : str
        One of `KINDS`.
    separator, decimal : str
        As of `taxel.formats.layout.Table`.

    Examples
    --------
    >>> read_line('0.01,"[3, 9]"').cells, read_line("12:30:00.5 -> 3,4").cells
    (('0.01', '3', '9'), ('12:30:00.5', '3', '4'))
    >>> read_line("0 ms, 2.5N").cells
    ('0', '2.5')
    >>> read_line("a:3,b:4")
    Line(cells=('3', '4'), names=('a', 'b'))
    >>> read_line('{"t": 0, "p": [[1, 2], [3, 4]]}', "json")
    Line(cells=('0', '1', '2', '3', '4'), names=('t', 'p[0][0]', 'p[0][1]', 'p[1][0]', 'p[1][1]'))
    >>> read_line("01 1E 0A", "hex", " ").cells
    ('1', '30', '10')
    """
    if kind == "plain":
        found = _split(line, separator)
        return Line(found, ("",) * len(found))
    if kind == "json":
        return _of_json(line)
    if kind == "hex":
        digits = _split(line, separator)
        if len(digits) == 1:
            # Bytes without a separator.
            whole = digits[0].removeprefix("0x")
            digits = tuple(whole[k : k + 2] for k in range(0, len(whole), 2))
        try:
            numbers = tuple(str(int(cell, 16)) for cell in digits)
        except ValueError:
            return None
        return Line(numbers, ("",) * len(numbers)) if len({len(cell) for cell in digits}) == 1 else None
    cells, names = list[str](), list[str]()
    first, *pairs = _NAME.split(_DAY.sub(r"\1T", _ARROW.sub(" ", line)))
    for name, text in zip(["", *pairs[::2]], [first, *pairs[1::2]], strict=True):
        bare: str = UNIT_BEHIND.sub("", text) if _may_have_units(text) else text
        found = tuple(filter(None, _BETWEEN[decimal].split(bare.translate(_MARKS))))
        cells += found
        names += [f"{name}[{k}]" if name and len(found) > 1 else name for k in range(len(found))]
    return Line(tuple(cells), tuple(names))


def _split(line: str, separator: str) -> tuple[str, ...]:
    """Return the cells between separators; by " " any number of blanks is between."""
    if separator == " ":
        return tuple(line.split())
    if '"' in line:
        with suppress(csv.Error, StopIteration):
            return tuple(map(str.strip, next(csv.reader([line], delimiter=separator, skipinitialspace=True))))
    return tuple(map(str.strip, line.split(separator)))


def _of_json(line: str) -> Line | None:
    """Return the leaves of an object or a list of JSON by their paths."""
    try:
        content = json.loads(line, parse_float=str, parse_int=str, parse_constant=str)
    except (ValueError, RecursionError):
        return None
    if not isinstance(content, dict | list):
        return None
    cells, names = list[str](), list[str]()
    waiting: list[tuple[str, object]] = [("", content)]
    while waiting:
        name, value = waiting.pop()
        if isinstance(value, dict):
            waiting += reversed([(f"{name}.{key}".lstrip("."), inner) for key, inner in value.items()])
        elif isinstance(value, list):
            waiting += reversed([(f"{name}[{k}]", inner) for k, inner in enumerate(value)])
        else:
            cells.append("" if value is None else str(value).replace("\t", " ").replace("\n", " "))
            names.append(name)
    return Line(tuple(cells), tuple(names))
