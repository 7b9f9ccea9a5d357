"""How many times faster than real time touches are told as they end, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames, Tare
from taxel.encode import TouchEnds
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, compare, scene
from taxel_benchmarks.encode_local_load import around


def numpy_ends(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, quantity, log(1 + value)) of each touch when it ends."""
    begin, largest, spikes = None, np.zeros(3), []
    for t, frame in zip(frames.t, frames.values, strict=True):
        above = frame - tare.rest
        loaded = above > FLOOR + 0.5
        counts = loaded & (around(loaded.astype(np.uint8)) > 1)
        if counts.any():
            begin = t if begin is None else begin
            largest = np.maximum(largest, [counts.sum(), above[counts].sum(), above[counts].max()])
        elif begin is not None:
            values = np.log1p([(t - begin) / 1000, *largest])
            spikes += [(t, train, value) for train, value in enumerate([*values, 1.0])]
            begin, largest = None, np.zeros(3)
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"touch ends": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, tare, events = scene(seconds)
    ours = {"touch ends": lambda: TouchEnds(tare=tare).encode(ticks)}
    return compare(
        __doc__, seconds, ours, {"touch ends": lambda: numpy_ends(ticks, tare)}, quick=quick, events=len(events)
    )
