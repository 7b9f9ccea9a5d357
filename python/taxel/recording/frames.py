"""Times of frames: their rates and periods, when values are new, and gaps, where frames are missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite
from taxel._base.limits import TIME_US
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.frames import Frames
from taxel.verdict import Verdict

#: The default rate of frames of a recording of events, Hz.
FRAMES_HZ = 100.0
#: So many frames show whether values repeat, and so many changes among them.
_LOOKS, _CHANGES = 10_000, 20
#: Reading: frames are apart by a gap if by so many median intervals.
_INTERVALS = 2.5


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


@dataclass(frozen=True)
class Gaps:
    """Hold how many gaps there are, and how long.

    Parameters
    ----------
    count : int
    total_us, longest_us : int, us
        From the last frame before a gap to the first one after it.
    t_us : int, us
        When the longest begins.
    begin_us : int, us
        The time that text counts from (`taxel._base.times`).
    """

    count: int
    total_us: int
    longest_us: int
    t_us: int
    begin_us: int = 0

    def __str__(self) -> str:
        longest = f"{_time(self.longest_us)} at {(self.t_us - self.begin_us) / 1e6:.1f} s"
        if self.count == 1:
            return f"1 gap of {longest}"
        return f"{self.count} gaps, {_time(self.total_us)} together, the longest {longest}"

    def to_dict(self) -> dict[str, Any]:
        """Return text and numbers as JSON values."""
        numbers = {"count": self.count, "total_us": self.total_us}
        return {"text": str(self)} | numbers | {"longest_us": self.longest_us, "t_us": self.t_us}


def _time(us: int) -> str:
    return f"{us / 1e6:.1f} s" if us >= 1_000_000 else f"{us / 1e3:.3g} ms"


def gaps_of(t: NDArray[np.int64]) -> Gaps | None:
    """Return the gaps of frames at these times (us); None without any."""
    apart = np.diff(t)
    at = np.flatnonzero(apart > _INTERVALS * np.median(apart)) if len(apart) else apart
    if not len(at):
        return None
    longest = int(at[apart[at].argmax()])
    return Gaps(len(at), int(apart[at].sum()), int(apart[longest]), int(t[longest]), beginning_us(t[:1]))


def with_gaps(verdict: Verdict, named: Mapping[str, Gaps | None]) -> Verdict:
    """Return a verdict that notes the gaps of each source, or of the only one, where it does not know what was lost."""
    found: dict[str, tuple[str, Gaps]] = {}
    for name, gaps in named.items():
        if gaps is not None:
            found.setdefault(str(gaps), (name, gaps))
    # A recording that counts what was lost has the verdict that it had live, with its silences.
    if not found or verdict.status != "unknown":
        return verdict
    # Sources of one clock have the same gaps.
    are_alike = len(found) == 1 and all(gaps is not None for gaps in named.values())
    texts = [text if are_alike else f"{name}: {text}" for text, (name, _) in found.items()]
    each = [gaps for _, gaps in found.values()]
    return verdict._noting(
        texts, {"gaps": sum(gaps.count for gaps in each), "gaps_us": sum(gaps.total_us for gaps in each)}
    )
