"""How many times faster than real time loads that are apart are told, beside SciPy.

Peer: SciPy's labels of connected taxels, grown by each gap. Unit: times real time, on one core. Goal: 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy import ndimage

from taxel import Frames, Tare
from taxel.encode import SeparateLoads
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, compare, loaded, scene

GAPS = (1, 2, 4, 8)
AROUND = np.ones((3, 3), bool)


def scipy_loads(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of the begins and ends of loads by each gap."""
    spikes, before = [], np.zeros(frames.values.shape[1:], bool)
    loaded_from = tare.rest + FLOOR + 0.5
    for t, frame in zip(frames.t, frames.values, strict=True):
        now = loaded(frame, loaded_from)
        if (now != before).any():
            for k, gap in enumerate(GAPS):
                # Taxels are at most a gap apart if the squares of that side around them overlap or touch.
                grown = ndimage.maximum_filter(now | before, size=gap, origin=0)
                load, count = ndimage.label(grown, AROUND)
                of_now, of_before = (np.bincount(load[state], minlength=count + 1) > 0 for state in (now, before))
                edges = ((k, of_now & ~of_before), (len(GAPS) + k, of_before & ~of_now))
                spikes += [(t, train) for train, begun in edges if begun.any()]
        before = now
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"separate loads": 5}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, tare, events = scene(seconds)
    ours = {"separate loads": lambda: SeparateLoads(noise_floor=FLOOR, gaps=GAPS, tare=tare).encode(ticks)}
    peer = {"separate loads": lambda: scipy_loads(ticks, tare)}
    return compare(__doc__, seconds, ours, peer, quick=quick, events=len(events))
