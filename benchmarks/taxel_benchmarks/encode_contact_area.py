"""How many times faster than real time the contact area is, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames, Tare
from taxel.encode import ContactArea
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, compare, loaded, scene

LEVELS = (2, 4, 8, 16, 32)


def numpy_area(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of rises and falls of the number of loaded taxels with a loaded neighbour."""
    spikes, before = [], 0
    loaded_from = tare.rest + FLOOR + 0.5
    for t, frame in zip(frames.t, frames.values, strict=True):
        area = int(np.count_nonzero(loaded(frame, loaded_from)))
        if area != before:
            spikes += [(t, k) for k, level in enumerate(LEVELS) if before < level <= area]
            spikes += [(t, 5 + k) for k, level in enumerate(LEVELS) if area < level <= before]
            before = area
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"contact area": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, tare, events = scene(seconds)
    ours = {
        "contact area": lambda: ContactArea(noise_floor=FLOOR, tare=tare).encode(ticks),
        "contact area, events": lambda: ContactArea(noise_floor=FLOOR, tare=tare).encode(events),
    }
    numpy = {"contact area": lambda: numpy_area(ticks, tare)}
    found = compare(__doc__, seconds, ours, numpy, quick=quick, events=len(events))
    rate = found["results"]["taxel, contact area, events"]["rate"]
    found["ratios"]["contact area, million events/s"] = len(events) / seconds * rate / 1e6
    return found
