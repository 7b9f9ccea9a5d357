"""How many times faster than real time change events are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import ChangeEvents
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, compare, scene


def numpy_change(frames: Frames) -> list[Any]:
    """Return (t, taxel, rise or fall) of changes above the floor since the last sent value."""
    spikes, last = [], frames.values[0].copy()
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        moved = frame - last
        there = np.abs(moved) > FLOOR
        if there.any():
            spikes += [(t, taxel_, np.sign(moved.ravel()[taxel_])) for taxel_ in np.flatnonzero(there)]
            last[there] = frame[there]
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"change events": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, _, events = scene(seconds)
    ours = {
        "change events": lambda: ChangeEvents(noise_floor=FLOOR).encode(ticks),
        "change events, events": lambda: ChangeEvents(noise_floor=2 * FLOOR).encode(events),
    }
    numpy = {"change events": lambda: numpy_change(ticks)}
    return compare(__doc__, seconds, ours, numpy, quick=quick, events=len(events))
