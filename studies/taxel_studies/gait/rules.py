"""The plain rules that each neuron is compared with: a count of trains that are on, and a threshold on a sum.

Every rule has few numbers; they and its offset are chosen in the training folds, as the neuron's weights are.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel_studies.gait.pieces import Piece

__all__ = ["RULES", "detection_times", "grid"]

#: Rising events show in ON spikes and counts that rise, the others by OFF spikes and counts that fall.
RISING = {"contact"}

RULES = {
    "count": "plain rule: sensors (and levels) that are on now, counted, with memory",
    "labels' own rule": "a threshold on the sum of the sensors whose threshold the labels are",
}


def grid(rule: str, levels: int, channels: int, largest: float) -> list[dict[str, Any]]:
    """List the numbers that a rule may take.

    Parameters
    ----------
    rule : one of `RULES`
    levels, channels : int
        Of the encoder whose spikes are its input.
    largest : float
        The largest value of the sum in training, for thresholds of the labels' own rule.
    """
    counts = [n for n in (1, 2, 3, 4, 6, 8, 12, 16) if n <= channels * levels]
    if rule == "count":
        return [{"count": n, "release": r} for n in counts for r in sorted({0, n // 4, n // 2}) if r < n]
    return [
        {"threshold": largest * s, "release": largest * s * r}
        for s, r in product((0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2), (1.0, 0.5))
    ]


def detection_times(
    rule: str,
    numbers: dict[str, Any],
    piece: Piece,
    event: str,
    *,
    levels: int,
    channels: NDArray[np.int64] | None,
    sum_name: str,
    dead_ms: float,
) -> NDArray[np.float64]:
    """Return when a rule detects the event in a piece, ms.

    Parameters
    ----------
    rule, numbers
        One of `RULES` and one point of its `grid`.
    levels : int
        Of the encoder; its trains are all ON, then all OFF, each channel by channel and level by level.
    channels : int array or None
        The sensors that count; all where None.
    sum_name : str
        The sum that the labels' own rule compares with its threshold.
    dead_ms : float
        After a detection there is none for so long.
    """
    rising = event in RISING
    if rule != "count":
        t, values = piece.sums[sum_name]
        return _apart(_crossings(t, values, numbers["threshold"], numbers["release"], rising), dead_ms)
    on = np.arange(len(piece.spikes) // 2).reshape(-1, levels)[slice(None) if channels is None else channels].ravel()
    t, sign = _changes(piece, on)
    at_first = _on_at_first(piece, on)
    last = np.append(t[1:] > t[:-1], [True] * (len(t) > 0))  # changes of one instant are one change
    t, count = np.append(-np.inf, t[last]), np.append(at_first, at_first + np.cumsum(sign)[last])
    return _apart(_crossings(t, count, numbers["count"], numbers["release"] + 1, rising), dead_ms)


def _crossings(
    t: NDArray[np.float64], values: NDArray[np.int64] | NDArray[np.float64], on: float, off: float, rising: bool
) -> NDArray[np.float64]:
    """Return when a value comes to `on` after having been below `off`, or falls below `off` after `on`."""
    state = (values >= on).astype(np.int64) - (values < off)
    place = np.maximum.accumulate(np.where(state != 0, np.arange(len(state)), -1))
    above = np.where(place >= 0, state[place] > 0, False)
    edges = np.diff(above.astype(np.int64), prepend=int(above[0]) if len(above) else 0)
    wanted: NDArray[np.float64] = t[edges == (1 if rising else -1)]
    return wanted


def _changes(piece: Piece, on: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return all ON (+1) and OFF (-1) spikes of ON trains, and of the OFF trains half of all trains behind them."""
    half = len(piece.spikes) // 2
    which = np.zeros(2 * half, bool)
    which[on] = which[half + on] = True
    train = np.repeat(np.arange(2 * half), piece.spikes.counts)
    keep = which[train]
    t, sign = piece.spikes.times[keep], np.where(train[keep] < half, 1, -1)
    order = np.argsort(t, kind="stable")
    return t[order], sign[order]


def _on_at_first(piece: Piece, on: NDArray[np.int64]) -> int:
    """Count the trains that were on when the piece began: those whose OFF comes before any ON."""
    half = len(piece.spikes) // 2
    offsets, times = piece.spikes.offsets, np.append(piece.spikes.times, np.inf)
    first_on = np.where(offsets[on] < offsets[on + 1], times[offsets[on]], np.inf)
    first_off = np.where(offsets[half + on] < offsets[half + on + 1], times[offsets[half + on]], np.inf)
    return int(np.count_nonzero(first_off < first_on))


def _apart(t: NDArray[np.float64], dead_ms: float) -> NDArray[np.float64]:
    """Keep the first of times and every next one that lies `dead_ms` or more after the last one kept."""
    kept = []
    k = 0
    while k < len(t):
        kept.append(t[k])
        k = max(k + 1, int(np.searchsorted(t, t[k] + dead_ms, side="left")))
    return np.array(kept)
