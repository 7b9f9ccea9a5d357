"""Rates of frames: their periods and times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite
from taxel._base.limits import TIME_US
from taxel._core import ProblemError
from taxel.frames import Frames

#: The default rate of frames of a recording of events, Hz.
FRAMES_HZ = 100.0
#: So many frames show whether values repeat, and so many changes among them.
_LOOKS, _CHANGES = 10_000, 20


def period_us(name: str, rate_hz: float) -> int:
    """Return the period of a rate in whole us.

    Raises
    ------
    ProblemError : not from 1e-9 Hz, a frame in 31 years, to 1 MHz
    """
    return round(1e6 / finite(name, rate_hz, least=1e-9, most=1e6))


def times_at(number: NDArray[np.int64], rate_hz: float) -> NDArray[np.int64]:
    """Return the times of numbered frames at a rate, us.

    Raises
    ------
    ProblemError : a time that is not within 142 years of 0
    """
    us = number * (1e6 / rate_hz)
    if len(us) and np.abs(us).max() > TIME_US:
        raise ProblemError(
            f"rate_hz is {rate_hz:g}: the time of frame {number[-1]} would be {us[-1] / 1e6:.3g} s; must be within 142 "
            "years of 0"
        )
    t: NDArray[np.int64] = np.rint(us).astype(np.int64)
    return t


def value_us(frames: Frames) -> float:
    """Return how far apart frames with new values are, us: the median, or more where values are held and repeat.

    They are held where no two frames in a row have new values, and these differ by more than the least step, as a slow
    change alone does not.
    """
    values = frames.values[:_LOOKS].reshape(-1, frames.array.rows * frames.array.columns)
    step = float(np.median(np.diff(frames.t))) if len(frames) > 1 else 0.0
    steps = np.nan_to_num(np.abs(np.diff(values, axis=0)))
    at = np.flatnonzero((steps > 0).any(axis=1))
    apart = np.diff(at)
    if len(apart) < _CHANGES or np.quantile(apart, 0.05) < 2:
        return step
    moved = steps[at].max(axis=1)
    usual = apart[apart <= 1.5 * np.quantile(apart, 0.25)]
    return step * float(usual.mean()) if np.median(moved) > 2 * moved.min() else step
