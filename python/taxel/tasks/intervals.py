"""Detections of what lasts, scored by intervals: whether there is one in each, beside what chance would have."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.detect.scoring import in_spans

#: By so many even parts of a recording its detections are turned, to see what chance would have.
_TURNS = 100


class ByIntervals(NamedTuple):
    """How detections and intervals of one label fit together.

    Attributes
    ----------
    intervals, found, outside : int, 0 or more
        How many intervals there are, how many have a detection, and how many detections are in none.
    f1, by_chance : float
        Twice the found, divided by twice the found, the missed and those outside; and that of the same detections
        turned within their recordings, at the mean.
    """

    intervals: int
    found: int
    outside: int
    f1: float
    by_chance: float

    def __repr__(self) -> str:
        counts = f"{self.found} of {self.intervals} found, {self.outside} detections outside"
        return f"by intervals {counts}: F1 {self.f1:.2f}, by chance {self.by_chance:.2f}"


#: Detections (us), begin and end of intervals (us), and from when to when the recording lasts, us.
Lasting = tuple[NDArray[np.int64], NDArray[np.int64], tuple[int, int]]


def by_intervals(each: Iterable[Lasting]) -> ByIntervals:
    """Return the score of detections by intervals over several recordings.

    Examples
    --------
    >>> by_intervals([(np.array([15, 18, 90]), np.array([[10, 20], [50, 60]]), (0, 100))])
    by intervals 1 of 2 found, 1 detections outside: F1 0.50, by chance 0.19
    """
    recordings = list(each)

    def counted(part: float) -> tuple[int, int]:
        found = outside = 0
        for t, spans, (first, last) in recordings:
            turned = first + (t - first + round(part * (last - first))) % max(last - first, 1)
            ordered = np.sort(turned)
            begins, ends = np.searchsorted(ordered, spans.reshape(-1, 2)).T
            found += int(np.count_nonzero(ends > begins))
            outside += int(np.count_nonzero(~in_spans(turned, spans)))
        return found, outside

    total = sum(len(spans) for _, spans, _ in recordings)

    def f1(found: int, outside: int) -> float:
        return 2.0 * found / max(found + total + outside, 1)

    by_chance = float(np.mean([f1(*counted(turn / _TURNS)) for turn in range(1, _TURNS)]))
    found, outside = counted(0.0)
    return ByIntervals(total, found, outside, f1(found, outside), by_chance)
