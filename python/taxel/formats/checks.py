"""Checks that readers of files share: that there are files, the size of a sensor, the range and the order of times."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path
from taxel._base.limits import TAXELS, TIME_US
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames

__all__ = ["around", "ascending", "candidates", "files_at", "in_s", "sensor", "table", "whole_us"]

#: Times that are converted at once, so that little memory is taken beside them.
_PIECE = 1 << 16
#: Half a day, us.
_NOON_US = 43_200_000_000


def candidates(path: Path, *patterns: str) -> list[Path]:
    """Return the files of a folder that patterns fit, in the order of their names; for a file, the file itself."""
    return sorted(file for pattern in patterns for file in path.glob(pattern)) if path.is_dir() else [path]


def files_at(path: str | Path, files: Callable[[Path], list[Path]], noun: str) -> list[Path]:
    """Return the files of a format at a path, of which there must be one or more.

    Raises
    ------
    FormatError : there is none (names them by `noun`)
    ProblemError : `path` is not a path
    """
    file = Path(checked_path("path", path))
    found = files(file)
    if not found:
        raise FormatError(f"{file}: contains no {noun}")
    return found


def sensor(location: str, array: Array) -> Array:
    """Return the sensor that a file describes, if it is within the limits.

    Raises
    ------
    FormatError : more taxels than a file's sensor may have
    """
    if array.rows * array.columns > TAXELS:
        raise FormatError(
            f"{location}: the sensor has {array.rows} x {array.columns} taxels; must have at most {TAXELS}"
        )
    return array


def table(location: Path | str, data: Events | Frames) -> Events | Frames:
    """Return events or frames of a file, if their sensor and their times are within the limits.

    Raises
    ------
    FormatError : too many taxels, or a time farther from 0 than 142 years
    """
    sensor(str(location), data.array)
    far = np.flatnonzero((data.t < -TIME_US) | (data.t > TIME_US))
    if len(far):
        k = int(far[0])
        raise FormatError(f"{location}, time {k}: {data.t[k]} us; times must be within {TIME_US} us (142 years) of 0")
    return data


def whole_us(location: str, seconds: NDArray[np.float64], first_line: int = 1) -> NDArray[np.int64]:
    """Return a file's times in s as whole us.

    Raises
    ------
    FormatError : a time farther from 0 than 142 years (names the line)
    """
    t = np.empty(len(seconds), np.int64)
    for begin in range(0, len(t), _PIECE):
        part = slice(begin, begin + _PIECE)
        wrong = np.flatnonzero(~(np.abs(seconds[part]) <= TIME_US * 1e-6))
        if len(wrong):
            k = begin + int(wrong[0])
            raise FormatError(
                f"{location}, line {first_line + k}: time {seconds[k]:g} s; must be within 142 years of 0"
            )
        t[part] = np.rint(seconds[part] * 1e6)
    return t


def ascending(location: str, t: NDArray[np.int64], first_line: int | Callable[[int], int] = 1) -> NDArray[np.int64]:
    """Return a file's times in us, which must ascend.

    Parameters
    ----------
    location : str
    t : int64, us
    first_line : int, or function of int
        The line of the first time, if each time is in a line; or a function that gives the line of each.

    Raises
    ------
    FormatError : a time that does not ascend (names the line)
    """
    back = np.flatnonzero(t[1:] <= t[:-1])
    if len(back):
        k = int(back[0]) + 1
        line = first_line(k) if callable(first_line) else first_line + k
        is_midnight = 0 <= t[k] < _NOON_US < t[k - 1] <= 2 * _NOON_US
        hint = "; times of day begin again at midnight, so the file must also have dates" if is_midnight else ""
        raise FormatError(
            f"{location}, line {line}: time {in_s(t[k])} s is not after {in_s(t[k - 1])} s, the time before it{hint}"
        )
    return t


def around(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Return the thesis' array, or a larger array if events are outside it."""
    thesis = Array.thesis()
    if not len(x):
        return thesis
    if min(x.min(), y.min()) < 0 or max(x.max(), y.max()) >= 65_535:
        raise ProblemError("x and y: must be from 0 to 65534")
    rows, columns = max(thesis.rows, int(y.max()) + 1), max(thesis.columns, int(x.max()) + 1)
    return thesis if (rows, columns) == thesis.shape else Array(rows, columns)


def in_s(us: int | np.int64) -> str:
    """Return a time in s with all digits of its us, as times since 1970 differ in the last ones.

    Examples
    --------
    >>> in_s(1_714_562_289_754_000), in_s(-20_000), in_s(0)
    ('1714562289.754', '-0.02', '0')
    """
    return f"{us / 1e6:.6f}".rstrip("0").rstrip(".")
