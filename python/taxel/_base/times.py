"""Times as people read them: those that count from 1970, as in a ROS bag, from the recording's beginning on.

Files, JSON and Python have the times themselves.
"""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

#: Times from here on are taken to count from 1970, us: it is 2001-09-09. The page of the panel has the same number.
SINCE_1970_US = 10**15


def beginning_us(t: NDArray[np.int64]) -> int:
    """Return the time (us) that text counts from: the earliest if times count from 1970, else 0."""
    first = int(t.min()) if len(t) else 0
    return first if first >= SINCE_1970_US else 0


def begun(begin_us: int) -> str:
    """Return date and time of a beginning, to the millisecond; "" for 0, which is not a date."""
    if not begin_us:
        return ""
    begin = datetime(1970, 1, 1) + timedelta(microseconds=begin_us)
    return f"{begin.isoformat(' ', 'milliseconds')} UTC"
