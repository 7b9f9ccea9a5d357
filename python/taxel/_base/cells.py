"""Meaning of the cells of tables of text: names of times with their units, and times."""

from __future__ import annotations

import re

from taxel import _core

#: Units of time as people write them.
_UNITS_OF_TIME = {
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden"),
    "ms": ("ms", "msec", "millis", "milliseconds", "millisekunden"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanoseconds", "nsecs"),
}
_UNIT_OF_TIME = "|".join(word for words in _UNITS_OF_TIME.values() for word in words)
#: What people call times, in some languages.
_TIME = (
    r"t|ts|(?:%|rel|abs|host|device|sample|frame|recv|unix|epoch|system|header)?[ ._]*(?:time|stamp|time[ _]?stamp)s?"
    r"|elapsed(?:[ _]time)?|(?:mess|uhr|system)?zeit(?:stempel|punkt)?|temps|tiempo|tempo|tijd|tid"
    r"|datetime|date[ _]time|clock|millis|micros|ms|msec|us|usec|secs?|seconds|sekunden"
)
#: Names of columns that hold times, with or without a unit: time, timestamp_us, Time (ms), t [s].
_TIMES = re.compile(
    rf"(?:{_TIME})"
    rf"(?:[ _.]*[\[(/] *(?P<within>{_UNIT_OF_TIME}) *[\])]?|(?:, *(?:in )?| in |[ _.]+)(?P<after>{_UNIT_OF_TIME}))?",
    re.IGNORECASE,
)


def time_unit(name: str) -> str | None:
    """Return the unit of time that the name of a column or an array states, "" if none; None of another name.

    Examples
    --------
    >>> time_unit("Time (ms)"), time_unit("run1/time"), time_unit("Time[secs]"), time_unit("palm"), time_unit("%time")
    ('ms', '', 's', None, '')
    """
    found = _TIMES.fullmatch(last_part(name))
    if found is None:
        return None
    word = (found["within"] or found["after"] or name.strip("\"' ")).lower()
    return next((unit for unit, words in _UNITS_OF_TIME.items() if word in words), "")


def last_part(name: str) -> str:
    """Return the last part of a path within a file or a message: header.seq, run1/time."""
    return re.split(r"[/.](?=[^\W\d])", name.strip("\"' "))[-1]


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
