"""Rates of frames: their periods and times."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import number
from taxel._base.errors import refused
from taxel._base.limits import TIME_US
from taxel._core import ProblemError

#: The default rate of frames of a recording of events, Hz.
FRAMES_HZ = 100.0


def period_us(name: str, rate_hz: float) -> int:
    """Return the period of a rate in whole us.

    Raises
    ------
    ProblemError : not above 0, or above 1 MHz
    """
    rate = number(name, rate_hz)
    if not 0 < rate <= 1e6:
        raise refused(name, f" is {rate}: must be above 0, at most 1000000")
    if rate < 1e-9:
        raise refused(name, f" is {rate}: must be 1e-9 (a frame in 31 years) or more")
    return round(1e6 / rate)


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
