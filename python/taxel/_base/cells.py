"""Meaning of the cells of tables of text: names, units, times, marks of missing values."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from contextlib import suppress

from taxel import _core

#: A cell that says a unit, as N, [kPa] or (m/s^2).
_UNITS = re.compile(r"[\[(]?[^\d\s\[\]()]{0,8}[²³2]?[\])]?")
#: Cells that tables hold where a value is missing.
MISSING = ("", "nan", "NaN", "NA", "-", "null")

#: Units of time as people write them.
_UNITS_OF_TIME = {
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden"),
    "ms": ("ms", "msec", "millis", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds"),
}
_UNIT = "|".join(word for words in _UNITS_OF_TIME.values() for word in words)
#: What people call times, in some languages.
_TIME = "t|time|timestamps?|elapsed|elapsed[ _]time|(mess|uhr)?zeit|zeit(stempel|punkt)|temps|tiempo|tempo|tijd|tid"

#: Names of columns that hold times, with or without a unit: time, timestamp_us, Time (ms), t [s].
_TIMES = re.compile(
    rf"({_TIME})([ _.]*[\[(/] *(?P<within>{_UNIT}) *[\])]?|(, *(in )?| in |[ _.]+)(?P<after>{_UNIT}))?", re.IGNORECASE
)


def times_of(names: Sequence[str]) -> list[int]:
    """Return which columns hold times by their names."""
    # A letter may be the name of a taxel too: t is the time only where it comes first.
    return [k for k, name in enumerate(names) if unit_of(name) is not None and (k == 0 or len(name) > 1)]


def unit_of(name: str) -> str | None:
    """Return the unit that the name of a column or an array of times states, "" if none; None of another name.

    Examples
    --------
    >>> unit_of("Time (ms)"), unit_of("run1/time"), unit_of("palm")
    ('ms', '', None)
    """
    found = _TIMES.fullmatch(name.strip("\"'").rpartition("/")[2])
    if found is None:
        return None
    word = (found["within"] or found["after"] or "").lower()
    return next((unit for unit, words in _UNITS_OF_TIME.items() if word in words), "")


def cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without blanks and quotes around them; by " " any number of blanks is between."""
    texts = line.split() if separator == " " else line.split(separator)
    if '"' in line and separator != " ":
        with suppress(csv.Error):
            texts = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    stripped = list(map(str.strip, texts))
    return [unquote(text) for text in stripped] if '"' in line or "'" in line else stripped


def unquote(cell: str) -> str:
    """Return a cell without the quotes around it."""
    return cell.strip("\"'")


def are_units(names: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether the cells below names say units: as many, each of a name, none a number or the name of times.

    Examples
    --------
    >>> are_units(["time", "thumb"], ["[ms]", "N"]), are_units(["time", "thumb"], ["2024-05-01", "0.5"])
    (True, False)
    >>> are_units(["Trial 1", ""], ["time", "thumb"])
    False
    """
    are_texts = any(cell not in MISSING for cell in below) and all(_UNITS.fullmatch(cell) for cell in below)
    of_names = len(below) == len(names) and all(name for name, cell in zip(names, below, strict=True) if cell)
    return are_texts and of_names and not times_of(below)


def ends_in_separator(names: Sequence[str] | None, lines: Sequence[str], separator: str) -> bool:
    """Return whether each line of numbers ends in a separator, after which there is no column."""
    if separator == " " or not lines or not all(line.rstrip(" ").endswith(separator) for line in lines):
        return False
    return names is None or not names[-1] or len(names) < len(cells(lines[0], separator))


def seconds_of(cell: str) -> float:
    """Return the seconds since 1970, or of the day, of a text of ISO 8601 or a day with points; NaN of any other text.

    Days with points are day, month and year (DIN 5008). Days with slashes are none: their order differs by country.

    Examples
    --------
    >>> seconds_of("1970-01-02T00:00:00.5"), seconds_of("1970-01-01 01:00:00+01:00"), seconds_of("00:01:00.25")
    (86400.5, 0.0, 60.25)
    >>> seconds_of("02.01.1970 00:00:00,5"), seconds_of("01/02/1970 00:00")
    (86400.5, nan)
    """
    return _core.seconds_of(cell)
