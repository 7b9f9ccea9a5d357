"""Gaps in a recording, where frames are missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.times import beginning_us
from taxel.verdict import Verdict

#: Reading: frames are apart by a gap if by so many median intervals.
_INTERVALS = 2.5


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
