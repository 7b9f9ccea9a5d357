"""Limits of what a file of another program may hold, and the array of events that state none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.limits import TAXELS, TIME_US
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames


def check_table(location: Path | str, data: Events | Frames) -> None:
    """Refuse events or frames of a file whose sensor or times are beyond the limits.

    Raises
    ------
    FormatError : too many taxels, or a time farther from 0 than 142 years
    """
    rows, columns = data.array.shape
    if rows * columns > TAXELS:
        raise FormatError(f"{location}: the sensor has {rows} x {columns} taxels; must have at most {TAXELS}")
    far = np.flatnonzero((data.t < -TIME_US) | (data.t > TIME_US))
    if len(far):
        k = int(far[0])
        raise FormatError(f"{location}, time {k}: {data.t[k]} us; times must be within {TIME_US} us (142 years) of 0")


def around(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Return the thesis' array, or a larger array if events are outside it."""
    thesis = Array.thesis()
    if not len(x):
        return thesis
    if min(x.min(), y.min()) < 0 or max(x.max(), y.max()) >= 65_535:
        raise ProblemError("x and y: must be from 0 to 65534")
    rows, columns = max(thesis.rows, int(y.max()) + 1), max(thesis.columns, int(x.max()) + 1)
    return thesis if (rows, columns) == thesis.shape else Array(rows, columns)
