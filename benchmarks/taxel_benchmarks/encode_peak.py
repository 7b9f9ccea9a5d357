"""How many times faster than real time the peak is, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames, Tare
from taxel.encode import Peak
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import PERIOD_US, compare, scene
from taxel_benchmarks.encode_local_load import LEAST, noisy

LEVELS = (5.0, 6.0, 8.0, 12.0, 20.0)


def numpy_peak(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of the peak above the tracked rest: rises to each level, then falls below it."""
    sigma = np.maximum(tare.noise, LEAST)
    near_step, far_step = -np.expm1(-PERIOD_US / 1e6), -np.expm1(-PERIOD_US / 20e6)
    baseline, above = tare.rest.copy(), np.zeros(frames.array.shape)
    levels, reached, spikes = np.array(LEVELS), np.zeros(len(LEVELS), bool), []
    for t, frame in zip(frames.t, frames.values, strict=True):
        baseline += np.where(np.abs(above) < 5 * sigma, near_step, far_step) * above
        above = frame - baseline
        units = above / sigma
        peak = np.float32(max(units.max(), np.sqrt(np.square(units[units >= 4]).sum())))
        now = np.where(reached, peak >= 0.7 * levels, peak >= levels)
        spikes += [(t, level if now[level] else len(LEVELS) + level) for level in np.flatnonzero(now != reached)]
        reached = now
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"peak": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, tare, events = scene(seconds)
    tare = noisy(tare)
    ours = {"peak": lambda: Peak(levels=LEVELS, tare=tare).encode(ticks)}
    return compare(__doc__, seconds, ours, {"peak": lambda: numpy_peak(ticks, tare)}, quick=quick, events=len(events))
