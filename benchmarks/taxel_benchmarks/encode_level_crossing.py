"""How many times faster than real time level crossings are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import LevelCrossing
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import compare, scene


def numpy_crossing(frames: Frames, levels: list[float], share: float) -> list[Any]:
    """Return (t, train, rise or fall) of crossings with a release."""
    spikes = []
    on_at = np.array(levels, np.float32)[:, None, None]
    off_at = np.array([share * level for level in levels], np.float32)[:, None, None]
    above = frames.values[0] >= on_at
    train = np.arange(above.size).reshape(-1, len(levels)).T.reshape(above.shape)  # taxel by taxel, level by level
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        now = frame >= np.where(above, off_at, on_at)
        if (now != above).any():
            spikes += [(t, train[place], 1 if now[place] else -1) for place in map(tuple, np.argwhere(now != above))]
            above = now
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"level crossing": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, *_ = scene(seconds)
    ours = {"level crossing": lambda: LevelCrossing([60.0, 80.0], release_share=0.9).encode(ticks)}
    numpy = {"level crossing": lambda: numpy_crossing(ticks, [60.0, 80.0], 0.9)}
    return compare(__doc__, seconds, ours, numpy, quick=quick)
