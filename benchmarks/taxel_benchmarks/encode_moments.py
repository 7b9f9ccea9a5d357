"""How many times faster than real time moments are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames, Tare
from taxel.encode import Moments
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, compare, loaded, scene

RANGES = {"area": (2.0, 500.0), "total": (8.0, 20_000.0), "peak": (4.0, 120.0), "displacement_mm": (0.2, 20.0)}
LEVELS = 20


def numpy_moments(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train of a level that is reached or left) of area, total, peak and the displacement of the centre."""
    spaced = [np.geomspace(*RANGES[name], LEVELS) for name in ("area", "total", "peak", "displacement_mm")]
    which = np.repeat([0, 1, 2, 3, 3, 4, 4], LEVELS)
    levels = np.concatenate([*spaced, -spaced[3], spaced[3], -spaced[3]])
    loaded_from, pitch = tare.rest + FLOOR + 0.5, frames.array.column_mm
    y, x = np.mgrid[: frames.array.rows, : frames.array.columns]
    spikes, before, origin = [], None, None
    for t, frame in zip(frames.t, frames.values, strict=True):
        there = loaded(frame, loaded_from)
        moments = np.zeros(5)
        if there.any():
            above = np.where(there, frame - tare.rest, 0.0)
            total = above.sum()
            centre = np.array([(above * x).sum(), (above * y).sum()]) / total
            origin = centre if origin is None else origin
            moments[:] = there.sum(), total, above.max(), *(pitch * (centre - origin))
        else:
            origin = None
        reached = np.where(levels > 0, moments[which] >= levels, moments[which] <= levels)
        if before is not None and (reached != before).any():
            spikes += [
                (t, level if reached[level] else len(levels) + level) for level in np.flatnonzero(reached != before)
            ]
        before = reached
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"moments": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, tare, events = scene(seconds)
    crossings = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tonic_ms=None, tare=tare)
    tonic = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tare=tare)
    ours = {
        "moments": lambda: crossings.encode(ticks),
        "moments, with tonic spikes": lambda: tonic.encode(ticks),
        "moments, events": lambda: tonic.encode(events),
    }
    numpy = {"moments": lambda: numpy_moments(ticks, tare)}
    return compare(__doc__, seconds, ours, numpy, quick=quick, events=len(events))
