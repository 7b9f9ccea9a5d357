"""When a foot is on the ground: contacts and lifts of an insole's load, by a rule that sees the whole walk.

It has two stages. The first finds stances in the load's range of 20 s around; the second gives each swing a base of its
own, and takes as contact and lift the samples at stated levels above it (`Definition`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError

__all__ = ["DEFINITIONS", "Definition", "Stances", "find_stances"]

#: How long the window of the range is, and how often the range is taken, s.
_WINDOW_S, _EACH_S = 20.0, 1.0
#: The percentiles of the load that are 0 and 1 of the first stage; of a single channel the lower one is another.
_LOW, _LOW_OF_CHANNEL, _HIGH = 10.0, 15.0, 95.0
#: A stance begins at the first share of the range, and ends below the second.
_UP, _DOWN = 0.3, 0.2
#: A swing is shorter than this, s, or never falls below this share of the range: no swing.
_SWING_S, _SWING = 0.05, 0.15
#: A swing of which the recording's end cuts off a part shows its base if it is at least so long, s.
_PART_OF_SWING_S = 0.12
#: A stance is at least so long, s.
_STANCE_S = 0.1
#: A pause of the samples from which on nothing is known of what is between, s.
GAP_S = 0.1
#: The percentile of a swing that is its base; a single channel is noisy while it swings.
_BASE, _BASE_OF_CHANNEL = 25.0, 75.0
#: The contact of a single channel moves back while it rises by this share of the range in a time, at most so long, s.
_RISE, _RISE_S, _BACK_S = 0.0125, 1 / 300, 0.03


@dataclass(frozen=True)
class Definition:
    """Say at which load a foot's contact and lift are.

    Parameters
    ----------
    kind : {"percent", "newton"}
        What the numbers are: shares of the way from a swing's base to the range's upper end, or N of the foot's load.
    contact, lift : float, % or N
        Contact is the first sample after the last one of a swing below this; lift is a swing's first sample below it.

    Raises
    ------
    ProblemError : another kind; numbers that are not above 0; percents of 20 or more, where stances end

    Examples
    --------
    >>> str(Definition("percent", 5, 2.5))
    'percent:5,2.5'
    """

    kind: str
    contact: float
    lift: float

    def __post_init__(self) -> None:
        most = {"percent": 100 * _DOWN, "newton": np.inf}.get(self.kind)
        if most is None or not all(0 < level < most for level in (self.contact, self.lift)):
            raise ProblemError(
                f"definition {self}: must be percent:CONTACT,LIFT (above 0, below 20), newton:CONTACT,LIFT (above 0), "
                "or moticon"
            )

    @classmethod
    def of(cls, text: str) -> Definition:
        """Return the definition that a text states: ``percent:5,2.5``, ``newton:50,25`` or ``moticon``.

        Raises
        ------
        ProblemError : it states none

        Examples
        --------
        >>> Definition.of("moticon")
        Definition(kind='percent', contact=6.0, lift=10.0)
        """
        if text in DEFINITIONS:
            return DEFINITIONS[text]
        kind, _, numbers = text.partition(":")
        try:
            contact, lift = map(float, numbers.split(","))
        except ValueError:
            contact = lift = np.nan
        return cls(kind, contact, lift)

    @classmethod
    def usual(cls, *, is_channel: bool) -> Definition:
        """Return the definition of a foot of several sensors, or of a single channel."""
        return DEFINITIONS["channel" if is_channel else "insole"]

    def level(self, base: float, high: float, *, lift: bool) -> float:
        """Return the load of contact or lift, above a swing's base in the range that ends at `high`."""
        level = self.lift if lift else self.contact
        return level if self.kind == "newton" else base + level / 100 * (high - base)

    def __str__(self) -> str:
        return f"{self.kind}:{self.contact:g},{self.lift:g}"

    @property
    def words(self) -> str:
        """What it says, for the head of a table."""
        if self.kind == "newton":
            return f"contact at {self.contact:g} N, lift below {self.lift:g} N"
        of = "of the way from the swing's base to the 95th percentile of 20 s around"
        return f"contact at {self.contact:g} %, lift below {self.lift:g} % {of}"


#: Definitions by name: of several sensors a foot, of a single channel, and what Moticon's program comes near to.
DEFINITIONS = {
    "insole": Definition("percent", 5.0, 2.5),
    "channel": Definition("percent", 4.0, 3.0),
    "moticon": Definition("percent", 6.0, 10.0),
}


class Stances(NamedTuple):
    """Hold the stances of a foot, in the order of time.

    Parameters
    ----------
    contact, lift : int64, shape (n,)
        The first sample of each, and the first one after it.
    cut_at_contact, cut_at_lift : bool, shape (n,)
        Whether the recording, or a gap in it, cuts off its beginning or its end.
    """

    contact: NDArray[np.int64]
    lift: NDArray[np.int64]
    cut_at_contact: NDArray[np.bool_]
    cut_at_lift: NDArray[np.bool_]

    @classmethod
    def of(cls, rows: list[tuple[int, int, bool, bool]]) -> Stances:
        """Return stances of rows."""
        columns = list(zip(*rows, strict=True)) or [(), (), (), ()]
        return cls(*(np.array(columns[k], kind) for k, kind in enumerate((np.int64, np.int64, bool, bool))))


def find_stances(
    t: NDArray[np.float64], force: NDArray[np.float64], definition: Definition, *, is_channel: bool = False
) -> Stances:
    """Return the stances of a foot from its load over time.

    Parameters
    ----------
    t : float64, shape (n,), s
        Ascending; samples that are missing are left out.
    force : float64, shape (n,)
        The load of the whole foot, in any unit that rises with it; N for a definition in N.
    definition : Definition
    is_channel : bool
        Whether the load is that of a single sensor, whose noise in swing is larger.
    """
    if not len(t):
        return Stances.of([])
    low, high = _range(t, force, _LOW_OF_CHANNEL if is_channel else _LOW)
    share = (force - low) / np.where(high > low, high - low, np.inf)
    ends = np.flatnonzero(np.diff(t) > GAP_S) + 1
    rows = []
    for first, end in zip([0, *ends], [*ends, len(t)], strict=True):
        here = slice(first, end)
        part = _Part(t[here], force[here], low[here], high[here], share[here], definition, is_channel)
        rows += [(first + contact, first + lift, a, b) for contact, lift, a, b in part.stances()]
    return Stances.of(rows)


def _range(
    t: NDArray[np.float64], force: NDArray[np.float64], low: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and the upper end of the load's range at each sample."""
    centres = np.arange(t[0], t[-1] + _EACH_S, _EACH_S)
    firsts = np.searchsorted(t, centres - _WINDOW_S / 2)
    ends = np.searchsorted(t, centres + _WINDOW_S / 2, side="right")
    held = ends > firsts
    parts = [force[a:b] for a, b in zip(firsts[held], ends[held], strict=True)]
    found = np.array([np.percentile(part, (low, _HIGH)) for part in parts])
    return np.interp(t, centres[held], found[:, 0]), np.interp(t, centres[held], found[:, 1])


class _Part(NamedTuple):
    """A stretch without a gap."""

    t: NDArray[np.float64]
    force: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    share: NDArray[np.float64]
    definition: Definition
    is_channel: bool

    def stances(self) -> list[tuple[int, int, bool, bool]]:
        """Return contact, lift, and which of both is cut off, of each stance."""
        rough, n = self._rough(), len(self.t)
        # The swings before, between and after the stances; an empty one where the stretch begins or ends loaded.
        swings = [
            (before, after)
            for before, after in zip([0, *(end for _, end in rough)], [*(begin for begin, _ in rough), n], strict=True)
        ]
        edges = [self._edges(*swing) for swing in swings]
        rows, begin = [], edges[0][1]
        for k, (lift, contact) in enumerate(edges[1:], 1):
            is_last = k == len(edges) - 1
            # In N a swing may stay above the levels: then the foot has not left the ground.
            if lift is None and not is_last:
                continue
            rows.append((begin or 0, n if lift is None else lift, begin is None, lift is None))
            begin = contact
        return rows

    def _rough(self) -> list[tuple[int, int]]:
        """Return the stances of the first stage."""
        known = np.where(self.share >= _UP, 1, np.where(self.share < _DOWN, -1, 0))
        last = np.maximum.accumulate(np.where(known != 0, np.arange(len(known)), 0))
        loaded = known[last] > 0
        changes = np.flatnonzero(np.diff(np.concatenate([[False], loaded, [False]])))
        joined: list[list[int]] = []
        for begin, end in changes.reshape(-1, 2).tolist():
            if joined and self._is_no_swing(joined[-1][1], begin):
                joined[-1][1] = end
            else:
                joined.append([begin, end])
        return [(a, b) for a, b in joined if self.t[min(b, len(self.t) - 1)] - self.t[a] >= _STANCE_S]

    def _is_no_swing(self, begin: int, end: int) -> bool:
        return bool(self.t[end] - self.t[begin] < _SWING_S or self.share[begin:end].min() >= _SWING)

    def _edges(self, begin: int, end: int) -> tuple[int | None, int | None]:
        """Return the lift with which a swing begins, and the contact that ends it; None where it has none."""
        swing, n = self.force[begin:end], len(self.t)
        # Of a swing that the recording cuts too short nothing is known.
        if end <= begin or ((begin == 0 or end == n) and self.t[end - 1] - self.t[begin] < _PART_OF_SWING_S):
            return None, None
        base = float(np.percentile(swing, _BASE_OF_CHANNEL if self.is_channel else _BASE))
        ends = self.definition.level(base, self.high[max(begin - 1, 0)], lift=True)
        begins = self.definition.level(base, self.high[min(end, n - 1)], lift=False)
        off, on = np.flatnonzero(swing < ends), np.flatnonzero(swing < begins)
        lift = begin + int(off[0]) if len(off) and begin > 0 else None
        contact = begin + int(on[-1]) + 1 if len(on) and end < n else None
        if contact is not None and self.is_channel:
            contact = self._moved_back(contact)
        return lift, contact

    def _moved_back(self, contact: int) -> int:
        """Return where the steep rise to a contact began."""
        first = contact
        while (
            first > 0
            and self.t[contact] - self.t[first - 1] <= _BACK_S
            and self.force[first] - self.force[first - 1]
            > _RISE * (self.high[first] - self.low[first]) * (self.t[first] - self.t[first - 1]) / _RISE_S
        ):
            first -= 1
        return first
