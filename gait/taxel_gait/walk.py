"""The steps of a walk: bouts, standing, turns; stride, stance, swing, step and double support of each.

A step is a stance of a foot. Times of both feet belong together only within a bout: a bout ends where a person stands,
at a gap of the recording, and at two contacts of the same foot in a row.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel_gait.feet import Foot
from taxel_gait.stances import GAP_S, Stances

__all__ = ["USED", "Step", "steps_of"]

#: A person stands while both feet are loaded together for longer than this, s.
STANDING_S = 1.0
#: A stride is unusual beyond so many robust standard deviations, and this share, of the median of so many strides.
_DEVIATIONS, _SHARE, _STRIDES = 3.0, 0.08, 11
#: The standard deviation of a normal distribution by its median absolute deviation.
_ROBUST = 1.4826
#: Two unusual strides of either foot within this time are a turn, s.
_TURN_S = 2.5

#: What the column `used` says; only steps with the first are in means.
USED = ("yes", "first", "last", "turn", "turn or unusual", "cut", "by hand")


@dataclass(frozen=True)
class Step:
    """Hold the times of one step, s; NaN where they are not known.

    Parameters
    ----------
    foot : int
        Its foot, by its number in the walk.
    number : int
        From 1, by foot.
    bout : int
        From 1.
    used : str
        One of `USED`.
    first, end : int
        The samples of its stance: ``first <= k < end``.
    contact_s, lift_s : float
    times : dict from str to float
        `stance_s`, `swing_s`, `stride_s`, `step_s` (from the other foot's contact to this one's), `stance_pct` (of the
        stride), `single_support_s`, `double_support_initial_s` (until the other foot's lift),
        `double_support_terminal_s` (from the other foot's contact), `double_support_s` (their sum), and `cadence`
        (steps a minute: two in each stride).
    """

    foot: int
    number: int
    bout: int
    used: str
    first: int
    end: int
    contact_s: float
    lift_s: float
    times: dict[str, float] = field(default_factory=dict)


def steps_of(feet: Sequence[Foot], stances: Sequence[Stances], by_hand: Sequence[NDArray[np.bool_]]) -> list[Step]:
    """Return the steps of a walk in the order of their stances.

    Parameters
    ----------
    feet : sequence of Foot
        One or two.
    stances : sequence of Stances
        Of each foot.
    by_hand : sequence of bool, shape (n,)
        Which stances of each foot a person has taken out.
    """
    edges = [_edges(foot, found) for foot, found in zip(feet, stances, strict=True)]
    breaks = np.array(sorted(_breaks(feet, edges)))
    bouts = [np.searchsorted(breaks, begin, side="right") for _, _, begin, _ in edges]
    times = [_times(k, edges, bouts) for k in range(len(feet))]
    unusual = _unusual(edges, [[one["stride_s"] for one in of_foot] for of_foot in times])
    # Only bouts that have a stance are counted.
    numbers = {bout: k for k, bout in enumerate(sorted({*np.concatenate([*bouts, np.empty(0, np.int64)])}), 1)}
    steps = [
        Step(
            k,
            i + 1,
            numbers[bouts[k][i]],
            _used(i, bouts[k], by_hand[k], found, unusual[k]),
            int(found.contact[i]),
            int(found.lift[i]),
            float(edges[k][0][i]),
            float(edges[k][1][i]),
            times[k][i],
        )
        for k, found in enumerate(stances)
        for i in range(len(found.contact))
    ]
    return sorted(steps, key=lambda step: feet[step.foot].t[step.first])


_Edges = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def _edges(foot: Foot, found: Stances) -> _Edges:
    """Return contacts and lifts, NaN where they are cut off, and the first and the last known moment of stances, s."""
    last = np.minimum(found.lift, len(foot.t) - 1)
    begin, end = foot.t[found.contact], foot.t[last]
    return np.where(found.cut_at_contact, np.nan, begin), np.where(found.cut_at_lift, np.nan, end), begin, end


def _breaks(feet: Sequence[Foot], edges: Sequence[_Edges]) -> set[float]:
    """Return the times at which bouts end."""
    found = set[float]()
    for foot, (_, _, begin, _) in zip(feet, edges, strict=True):
        gaps = np.flatnonzero(np.diff(foot.t) > GAP_S)
        found |= {float(t) for t in foot.t[gaps + 1]}
        if len(feet) > 1:
            (other,) = (one for one in edges if one[2] is not begin)
            between = np.searchsorted(other[2], begin[1:]) - np.searchsorted(other[2], begin[:-1])
            found |= {float(t) for t in begin[1:][between == 0]}
    if len(feet) > 1:
        (_, _, begins, ends), (_, _, others, other_ends) = edges
        for begin, end in zip(begins, ends, strict=True):
            for k in range(int(np.searchsorted(other_ends, begin)), int(np.searchsorted(others, end))):
                if min(end, other_ends[k]) - max(begin, others[k]) > STANDING_S:
                    found.add(float(min(end, other_ends[k])))
    return found


def _times(k: int, edges: Sequence[_Edges], bouts: Sequence[NDArray[np.int64]]) -> list[dict[str, float]]:
    """Return the times of the steps of a foot (`Step.times`)."""
    contact, lift, _, _ = edges[k]
    if not len(contact):
        return []
    same = np.append(bouts[k][1:] == bouts[k][:-1], False)
    # Where two contacts follow each other within a bout.
    following = np.where(same, np.append(contact[1:], np.nan), np.nan)
    stance, stride = lift - contact, following - contact
    columns = {
        "stance_s": stance,
        "swing_s": following - lift,
        "stride_s": stride,
        "step_s": np.full_like(stance, np.nan),
        "stance_pct": 100 * stance / stride,
        "single_support_s": np.full_like(stance, np.nan),
        "double_support_initial_s": np.full_like(stance, np.nan),
        "double_support_terminal_s": np.full_like(stance, np.nan),
        "double_support_s": np.full_like(stance, np.nan),
        "cadence": 120 / stride,
    }
    if len(edges) > 1:
        other_contact, other_lift, other_begin, _ = edges[1 - k]
        before = np.searchsorted(other_begin, contact) - 1
        after, n = before + 1, len(other_begin)

        def at(values: NDArray[np.float64], index: NDArray[np.int64]) -> NDArray[np.float64]:
            """Return what the other foot has there, in the same bout."""
            if not n:
                return np.full_like(stance, np.nan)
            known = (index >= 0) & (index < n)
            safe = np.where(known, index, 0)
            return np.where(known & (bouts[1 - k][safe] == bouts[k]), values[safe], np.nan)

        columns["step_s"] = contact - at(other_contact, before)
        initial = np.maximum(at(other_lift, before) - contact, 0.0)
        terminal = np.maximum(lift - at(other_contact, after), 0.0)
        columns["double_support_initial_s"], columns["double_support_terminal_s"] = initial, terminal
        columns["double_support_s"] = initial + terminal
        columns["single_support_s"] = stance - initial - terminal
    return [{name: float(column[i]) for name, column in columns.items()} for i in range(len(contact))]


def _unusual(edges: Sequence[_Edges], strides: Sequence[list[float]]) -> list[list[str]]:
    """Return for each step of each foot "turn" or "turn or unusual"; "" for the others."""
    marked = []
    for (contact, lift, _, _), stride in zip(edges, strides, strict=True):
        marked.append(_apart(np.array(stride)) | _apart(lift - contact))
    times = np.sort(np.concatenate([begin[mark] for (_, _, begin, _), mark in zip(edges, marked, strict=True)]))
    named = []
    for (_, _, begin, _), mark in zip(edges, marked, strict=True):
        near = np.searchsorted(times, begin + _TURN_S, "right") - np.searchsorted(times, begin - _TURN_S)
        named.append(
            [("turn" if count > 1 else "turn or unusual") * bool(m) for m, count in zip(mark, near, strict=True)]
        )
    return named


def _apart(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which values are far from the median of those around them."""
    known = np.flatnonzero(~np.isnan(values))
    found = np.zeros(len(values), bool)
    if len(known) < 3:
        return found
    some = values[known]
    half = _STRIDES // 2
    medians = np.array([np.median(some[max(0, k - half) : k + half + 1]) for k in range(len(some))])
    off = np.abs(some - medians)
    deviation = _ROBUST * np.median(off)
    found[known] = (off > _DEVIATIONS * deviation) & (off > _SHARE * medians)
    return found


def _used(i: int, bouts: NDArray[np.int64], by_hand: NDArray[np.bool_], found: Stances, unusual: Sequence[str]) -> str:
    """Return what the column `used` says of a step of a foot."""
    if by_hand[i]:
        return "by hand"
    if found.cut_at_contact[i] or found.cut_at_lift[i]:
        return "cut"
    if i == 0 or bouts[i - 1] != bouts[i]:
        return "first"
    if i == len(bouts) - 1 or bouts[i + 1] != bouts[i]:
        return "last"
    return unusual[i] or "yes"
