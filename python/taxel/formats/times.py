"""Times of files: cells of tables as whole us, and one repair of times that repeat, swap, wrap or begin again."""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.errors import unreadable
from taxel._base.limits import TIME_US
from taxel._base.messages import counted

#: So many odd lines, or times, are left out or repaired in any file, and of longer ones this share.
FEW_ODD, ODD = 2, 0.1
#: Rates of usual sensors, and those that may be, Hz.
_USUAL_HZ, _POSSIBLE_HZ = (5.0, 500.0), (0.5, 20_000.0)
#: Years 2001 to 2065 since 1970, in s.
_EPOCH = (1e9, 3e9)
#: Times in units of these, us: those in which they may be found to be, and others that a name states.
FOUND_US = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
UNITS_US = {**FOUND_US, "min": 60e6, "h": 3600e6, "d": 86_400e6}
#: Days of which a time of today has so many, and day 0 of which is 1970: those of spreadsheets and of MATLAB.
_DAYS = {25_569: (3e4, 6.6e4), 719_529: (7.2e5, 7.7e5)}
#: The unit of times that are texts: dates with times, or times of a day.
ISO = "iso"

_MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
#: The year first; the day first, with points (DIN 5008), or with an English month as MATLAB has it.
DATE = (
    r"\d{4}-\d\d-\d\d|\d{4}/\d{1,2}/\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4}"
    rf"|\d{{1,2}}-(?i:{'|'.join(_MONTHS)})-\d{{4}}"
)
#: A date, with slashes and the month first only before a clock of twelve hours, and a clock; either alone too.
_WHEN = re.compile(
    rf"(?:(?:({DATE})|(\d{{1,2}}/\d{{1,2}}/\d{{4}})(?=.*[AP]\.?M\.?$),?)(?:$|T| +))?"
    r"(?:(\d{1,2}):(\d\d)(?::(\d\d))?(?:(?:[.,]|(?<=:\d\d:\d\d):(?=\d{3}(?!\d)))(\d+))?"
    r"(?: ?([AP])\.?M\.?|(Z|[+-]\d\d:?\d\d))?)?",
    re.ASCII | re.IGNORECASE,
)
_SIX_DIGITS = re.compile(r"\d{6}(?:[.,+Z-].*)?", re.ASCII)
_DAY_US = 86_400_000_000
#: Characters of a date: 1.5.2024. Most cells are shorter, and to look takes long.
_SHORTEST_DATE = 8
#: A counter of times that is full begins at 0 again: its values, in the unit of the file.
_WRAPS = (1 << 16, 1 << 32)
#: A step over a wrap, or to a line out of order, is at most so many usual ones.
_NEAR = 64
#: So many times are not all the same.
_MANY = 20
#: So many lines one after the other that are earlier than the line before them begin the times again.
_AGAIN = 3


def is_time(cell: str) -> bool:
    """Return whether a text is a date with a time, or a time of a day.

    Examples
    --------
    >>> is_time("2024-05-01T10:00:00.25"), is_time("01.05.2024 10:00:00,25"), is_time("10:00:00"), is_time("10.5")
    (True, True, True, False)
    """
    return ":" in cell and _WHEN.fullmatch(cell) is not None


def is_day(cell: str) -> bool:
    """Return whether a text is a date without a time."""
    return len(cell) >= _SHORTEST_DATE and ":" not in cell and _WHEN.fullmatch(cell) is not None


def seconds_of(cell: str) -> float:
    """Return the seconds since 1970, or of the day, of a text of ISO 8601 or a day with points; NaN of any other text.

    Days with points are day, month and year (DIN 5008). Days with slashes are read where the year is first, or where AM
    or PM follows, as month, day and year: else their order differs by country. Without a zone a time is of UTC. Six
    digits of a fraction count.

    Examples
    --------
    >>> seconds_of("1970-01-02T00:00:00.5"), seconds_of("1970-01-01 01:00:00+01:00"), seconds_of("00:01:00.25")
    (86400.5, 0.0, 60.25)
    >>> seconds_of("02.01.1970 00:00:00,5"), seconds_of("1:02.5"), seconds_of("01/02/1970 00:00")
    (86400.5, 62.5, nan)
    >>> seconds_of("1/2/1970 12:00:30 AM"), seconds_of("01.01.1970 1:00:00.5 PM"), seconds_of("1:00 am")
    (86430.0, 46800.5, 3600.0)
    >>> seconds_of("1970/1/2 00:00:00.5"), seconds_of("02-Jan-1970 00:00:01")
    (86400.5, 86401.0)
    """
    try:
        # What is of ISO 8601 is read soonest so; six digits are a time of a day.
        if cell[4:5] == cell[7:8] == "-" or not (found := _WHEN.fullmatch(cell)) or not cell:
            at = datetime.fromisoformat(f"1970-01-01T{cell}" if _SIX_DIGITS.fullmatch(cell) else cell)
            return at.replace(tzinfo=at.tzinfo or UTC).timestamp()
        day, by_month, *clock, fraction, half, zone = found.groups()
        midnight = _midnight((day or by_month).lower(), by_month is not None) if day or by_month else 0.0
    except ValueError:
        return math.nan
    # Two numbers before a fraction are minutes and seconds.
    clock = [None, *clock[:2]] if fraction and not clock[2] else clock
    hour, minute, second = (int(part or 0) for part in clock)
    if half:
        hour = hour % 12 + 12 * (half in "Pp")
    if hour > 23 or minute > 59 or second > 59:
        return math.nan
    ahead = int(f"{zone[0]}1") * (3600 * int(zone[1:3]) + 60 * int(zone[-2:])) if zone and zone not in "Zz" else 0
    return midnight + 3600 * hour + 60 * minute + second + (float(f".{fraction:.6}") if fraction else 0.0) - ahead


@lru_cache(1000)
def _midnight(date: str, by_month: bool) -> float:
    """Return the seconds since 1970 at the begin of a day, of few in a file."""
    first, second, third = re.split("[-/.]", date)
    year, month, day = (first, second, third) if len(first) > len(third) else (third, second, first)
    month, day = (day, month) if by_month else (month, day)
    of_year = _MONTHS.index(month) + 1 if month in _MONTHS else int(month)
    return datetime(int(year), of_year, int(day), tzinfo=UTC).timestamp()


def epoch_of(numbers: NDArray[np.float64]) -> str:
    """Return the unit in which numbers are times since 1970; "" if none."""
    steps = np.diff(numbers)
    if _day_0(numbers) and len(steps) and steps.max() < 0.01:
        return "d"
    first, last = (1e6 * edge for edge in _EPOCH)
    return next((u for u, us in FOUND_US.items() if ((numbers * us > first) & (numbers * us < last)).all()), "")


def _day_0(days: NDArray[np.float64]) -> int:
    """Return the day of 1970 where days are those of a spreadsheet or of MATLAB; else 0."""
    return next((day for day, (least, most) in _DAYS.items() if ((days > least) & (days < most)).all()), 0)


def unit_of_times(times: NDArray[np.float64]) -> tuple[str, dict[str, float]]:
    """Return the unit of times by the years since 1970 or usual rates; if two fit about equally, the rate by each."""
    if since_1970 := epoch_of(times[np.isfinite(times)]):
        return since_1970, {}
    steps = np.diff(times)
    steps = steps[steps > 0]
    if not len(steps):
        return "s", {}
    rates = {unit: 1e6 / (us * float(np.median(steps))) for unit, us in FOUND_US.items()}
    usual, possible = (
        [unit for unit, hz in rates.items() if least <= hz <= most] for least, most in (_USUAL_HZ, _POSSIBLE_HZ)
    )
    if len(usual) == 1 or len(possible) == 1:
        return (usual if len(usual) == 1 else possible)[0], {}
    possible = possible or sorted(rates, key=lambda unit: abs(np.log(rates[unit] / 100.0)))
    return possible[0], {unit: rates[unit] for unit in possible[:2]}


def us_of(column: Any, unit: str) -> NDArray[Any]:
    """Return a column of times (a pandas Series) as us; NaN for a cell that is no time, and whole us if all are.

    Parameters
    ----------
    column : Series
    unit : str
        One of `UNITS_US`, or `ISO`: dates are of UTC where they state no zone; times of a day count from midnight.
    """
    import pandas as pd  # noqa: PLC0415  takes long

    if unit == ISO:
        seconds = column.astype(str).str.strip().map(seconds_of).to_numpy(np.float64)
        us: NDArray[np.float64] = np.rint(seconds * 1e6)
        return us if np.isnan(us).any() else us.astype(np.int64)
    values = column.to_numpy()
    if values.dtype.kind in "iu" and unit in ("us", "ns"):
        exact: NDArray[np.int64] = values.astype(np.int64)
        return exact if unit == "us" else (exact + 500) // 1000
    times = pd.to_numeric(column, errors="coerce").to_numpy(np.float64)
    times = (times - (_day_0(times) if unit == "d" and len(times) else 0)) * UNITS_US[unit]
    sound = np.abs(times) <= TIME_US
    return np.rint(times).astype(np.int64) if sound.all() else np.where(sound, np.rint(times), np.nan)


@dataclass(frozen=True, eq=False)
class Repaired:
    """Hold times that ascend, the line of each, and what was repaired, a text for each kind of repair."""

    t: NDArray[np.int64]
    order: NDArray[np.intp] | None
    said: tuple[str, ...]
    #: How many times were wrong, of those that repeat apart.
    wrong: int = 0


def repaired(t: NDArray[np.int64], unit_us: float = 1.0, *, of_day: bool = False) -> Repaired:
    """Return times in us that ascend.

    A counter of 16 or 32 bits that was full, and midnight of times of a day, go on; times that begin again follow one
    usual step after the line before; lines that were swapped are sorted; single wrong times lie evenly between their
    neighbours; times that repeat, as rounded ones do, are spread evenly up to the next.

    Parameters
    ----------
    t : int64, us
    unit_us : float, us
        The unit of the file, for counters that wrap.
    of_day : bool
        Whether they are times of a day.

    Examples
    --------
    >>> repaired(np.array([0, 10, 10, 30])).t.tolist(), repaired(np.array([65530, 65535, 4, 9])).t.tolist()
    ([0, 10, 20, 30], [65530, 65535, 65540, 65545])
    >>> again = repaired(np.array([0, 10, 20, 0, 10, 20]))
    >>> again.t.tolist(), again.said
    ([0, 10, 20, 30, 40, 50], ('times begin again 1 time',))
    """
    if len(t) < 2 or bool((t[1:] > t[:-1]).all()):
        return Repaired(t, None, ())
    t, said = t.copy(), list[str]()
    steps = np.diff(t)
    usual = int(np.median(steps[steps > 0])) if (steps > 0).any() else 1
    turns = [round(turn * unit_us) for turn in _WRAPS] + [_DAY_US] * of_day
    wraps = restarts = 0
    for k in (np.flatnonzero(steps < 0) + 1).tolist():
        if t[k] >= t[k - 1]:
            continue
        turn = next((turn for turn in turns if 0 < t[k] + turn - t[k - 1] <= _NEAR * usual), None)
        if turn is not None and _begins_again(t, k):
            t[k:] += turn
            wraps += 1
        elif _begins_again(t, k):
            t[k:] += t[k - 1] + usual - t[k]
            restarts += 1
    said += [f"times wrap {counted(wraps, 'time')}"] * (wraps > 0)
    said += [f"times begin again {counted(restarts, 'time')}"] * (restarts > 0)
    order, wrong = None, 0
    if (np.diff(t) < 0).any():
        order, t, swapped, replaced = _in_order(t, usual)
        said += [f"{counted(swapped, 'line')} out of order, sorted by time"] * (swapped > 0)
        said += [f"{counted(replaced, 'time')} replaced, which did not fit those around"] * (replaced > 0)
        wrong = swapped + replaced
    repeats = int(np.count_nonzero(np.diff(t) == 0))
    if repeats:
        t = _spread(t, usual)
        said.append(f"{counted(repeats, 'time')} repeated, spread evenly")
    return Repaired(t, order, tuple(said), wrong)


def in_order(
    path: Path, column: Any, unit: str, said: list[str], noun: str = "the times"
) -> tuple[NDArray[np.int64], NDArray[np.intp] | None]:
    """Return times of a file in us that ascend, and the order of its frames, if it is another.

    Parameters
    ----------
    path : Path
    column : Series
        As of `us_of`.
    unit : str
    said : list of str
        What was repaired is added to it.
    noun : str
        The name of the times in errors.

    Raises
    ------
    FormatError : a time is missing or farther from 0 than 142 years, or many are out of order
    """
    us = us_of(column, unit)
    different = np.unique(us[:: 1 + len(us) // 1000])
    least, most = (1e6 / hz for hz in reversed(_POSSIBLE_HZ))
    few, is_rate = len(different) < _AGAIN, len(different) > 1 and least < np.ptp(us) * 2 / len(us) < most
    if len(us) >= _MANY and few and not is_rate:
        right = "save all their digits, or write time_column = 0 and rate_hz in a layout file"
        raise unreadable(
            f"{noun}: only {len(different)} different of {len(us)}, as where digits are lost; {right}", path
        )
    if us.dtype.kind == "f":
        bad = int(np.flatnonzero(np.isnan(us))[0])
        right = "must be like 2024-05-01T10:00:00.25" if unit == ISO else "must be within 142 years of 0"
        raise unreadable(f"{noun}: that of frame {bad} is {shown(str(column.iloc[bad]))}; {right}", path)
    is_of_day = unit == ISO and bool((us >= 0).all() and (us < _DAY_US).all())
    found = repaired(us, UNITS_US.get(unit, 1.0), of_day=is_of_day)
    if found.wrong > max(FEW_ODD, ODD * len(us)):
        raise unreadable(f"{noun}: {found.wrong} of {len(us)} are out of order: {'; '.join(found.said)}", path)
    said += found.said
    return found.t, found.order


def _begins_again(t: NDArray[np.int64], k: int) -> bool:
    """Return whether times go on from an earlier one, for some lines or to the end; a single line is a swapped one."""
    after = t[k : k + _AGAIN]
    to_end = k + len(after) == len(t)
    from_start = t[k] <= t[0]
    ascends = bool((np.diff(after) >= 0).all() and (after <= t[k - 1]).all())
    return ascends and (len(after) == _AGAIN or (to_end and from_start))


def _in_order(t: NDArray[np.int64], usual: int) -> tuple[NDArray[np.intp], NDArray[np.int64], int, int]:
    """Return the order of lines by time, their times, and how many were swapped or had a wrong time."""
    sound = np.zeros(len(t), bool)
    sound[_ascending(t.tolist())] = True
    places = np.flatnonzero(sound)
    odd = np.flatnonzero(~sound)
    # A line that was swapped has a time near those around it.
    near = np.abs(t[odd] - np.interp(odd, places, t[places])) <= _NEAR * usual
    replaced = odd[~near]
    t = t.copy()
    t[replaced] = np.rint(np.interp(replaced, np.setdiff1d(np.arange(len(t)), replaced), np.delete(t, replaced)))
    order = np.argsort(t, kind="stable")
    return order, t[order], int(near.sum()), len(replaced)


def _ascending(times: Sequence[int]) -> list[int]:
    """Return the places of the most times that never fall; of several such choices the one of the latest times."""
    # From the end, as in patience sorting: for each length the place where the best choice of that length begins.
    begins: list[int] = []
    falling: list[int] = []
    after = [-1] * len(times)
    for k in reversed(range(len(times))):
        at = bisect_right(falling, -times[k])
        after[k] = begins[at - 1] if at else -1
        begins[at : at + 1], falling[at : at + 1] = [k], [-times[k]]
    chosen = begins[-1:]
    while chosen and after[chosen[-1]] >= 0:
        chosen.append(after[chosen[-1]])
    return chosen


def _spread(t: NDArray[np.int64], usual: int) -> NDArray[np.int64]:
    """Return times in which those that repeat are spread evenly up to the next one."""
    each, begins, counts = np.unique(t, return_index=True, return_counts=True)
    last = each[-1] + round(usual * counts[-1] / float(np.median(counts)))
    within = np.arange(len(t)) - np.repeat(begins, counts)
    # A pause after a time that repeats is none between its lines.
    own = np.diff(each, append=last) / counts
    gaps = np.repeat(np.minimum(own, np.median(own)), counts)
    spread = t + np.floor(within * gaps).astype(np.int64)
    # Fewer us than lines between two times.
    steps = np.arange(len(t))
    return np.maximum.accumulate(spread - steps) + steps
