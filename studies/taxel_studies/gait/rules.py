"""The plain rules that each neuron is compared with: a count of trains that are on, and a threshold on a sum.

Every rule has few numbers; they and its offset are chosen in the training folds, as the neuron's weights are.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from taxel_studies.gait.pieces import Piece, Signal

RULES = {
    "count": "plain rule: sensors (and levels) that are on now, counted, with memory",
    "labels' own rule": "a threshold on the sum of the sensors whose threshold the labels are",
}
#: A rule detects nothing for so long after an event, ms.
DEAD_MS = 250.0


def grid(rule: str, most: float) -> list[tuple[dict[str, float], float, float]]:
    """List the numbers that a rule may take, and the values at which it is on and off.

    Parameters
    ----------
    rule : one of `RULES`
    most : float
        How many trains count; or the largest value of the sum in training.
    """
    if rule == "count":
        counts = [n for n in (1, 2, 3, 4, 6, 8, 12, 16) if n <= most]
        pairs = [(n, r) for n in counts for r in sorted({0, n // 4, n // 2}) if r < n]
        return [({"count": n, "release": r}, n, r + 1) for n, r in pairs]
    shares = product((0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2), (1.0, 0.5))
    return [({"threshold": most * s, "release": most * s * r}, most * s, most * s * r) for s, r in shares]


def count_of(piece: Piece, on: NDArray[np.int64]) -> Signal:
    """Return how many of these trains are on; the trains of a piece are all ON, then all OFF in the same order."""
    half = len(piece.spikes) // 2
    which = np.zeros(2 * half, bool)
    which[on] = which[half + on] = True
    train = np.repeat(np.arange(2 * half), piece.spikes.counts)
    keep = which[train]
    t, sign = piece.spikes.times[keep], np.where(train[keep] < half, 1, -1)
    order = np.argsort(t, kind="stable")
    t, sign = t[order], sign[order]
    # On when the piece began were those trains whose OFF comes before any ON.
    offsets, times = piece.spikes.offsets, np.append(piece.spikes.times, np.inf)
    first_on = np.where(offsets[on] < offsets[on + 1], times[offsets[on]], np.inf)
    first_off = np.where(offsets[half + on] < offsets[half + on + 1], times[offsets[half + on]], np.inf)
    at_first = int(np.count_nonzero(first_off < first_on))
    last = np.append(t[1:] > t[:-1], [True] * (len(t) > 0))  # changes of one instant are one change
    return np.append(-np.inf, t[last]), np.append(at_first, at_first + np.cumsum(sign)[last])


def detected(signal: Signal, on: float, off: float, *, rising: bool, dead_ms: float = DEAD_MS) -> NDArray[np.float64]:
    """Return when a value comes to `on` after having been below `off`, or falls below `off` after `on`, ms.

    After a detection there is none for `dead_ms`.
    """
    t, values = signal
    state = (values >= on).astype(np.int64) - (values < off)
    place = np.maximum.accumulate(np.where(state != 0, np.arange(len(state)), -1))
    above = np.where(place >= 0, state[place] > 0, False)
    edges = np.diff(above.astype(np.int64), prepend=int(above[0]) if len(above) else 0)
    crossings, kept, k = t[edges == (1 if rising else -1)], [], 0
    while k < len(crossings):
        kept.append(crossings[k])
        k = max(k + 1, int(np.searchsorted(crossings, crossings[k] + dead_ms, side="left")))
    return np.array(kept)
