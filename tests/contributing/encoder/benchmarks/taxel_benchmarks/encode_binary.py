"""How many times faster than real time the binary encoder is, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import Binary
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import compare, scene


def numpy_binary(frames: Frames) -> list[Any]:
    """Return (t, taxel, rise or fall)."""
    moved = np.diff((frames.values.reshape(len(frames), -1) >= 20.0).astype(int), axis=0)
    return [(frames.t[k + 1], taxel, moved[k, taxel]) for k, taxel in np.argwhere(moved)]


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"binary": 20}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, _, events = scene(seconds)
    ours = {"binary": lambda: Binary(level=20.0).encode(ticks)}
    numpy = {"binary": lambda: numpy_binary(ticks)}
    return compare(__doc__, seconds, ours, numpy, quick=quick, events=len(events))
