"""How many times faster than real time the FA-1 afferents of 64 x 64 taxels are, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 60.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import FA1
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import compare, scene


def numpy_fa1(frames: Frames, theta_0: float) -> list[Any]:
    """Return (t, taxel, polarity) by equations 5.1 to 5.5; T 0.192 ms, the threshold falls by 5 % a sample."""
    spikes, shape = [], frames.values[0].shape
    jump, fall = 0.192 * 20 * theta_0, 0.05 * theta_0
    last = np.maximum(frames.values[0], 0).astype(np.float64) ** 0.7
    u, theta, fired = np.zeros(shape), np.full(shape, theta_0), np.zeros(shape, bool)
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        rho = np.maximum(frame, 0).astype(np.float64) ** 0.7
        theta = np.where(fired, theta + jump, np.where(theta > theta_0, theta - fall, theta_0))
        u += rho - last
        last = rho
        s = np.where(u > theta, 1, np.where(u < -theta, -1, 0))
        fired = s != 0
        u[fired] = 0
        spikes += [(t, taxel_, s.ravel()[taxel_]) for taxel_ in np.flatnonzero(fired)]
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"FA-1, ticks": 60, "FA-1, pressure": 60}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds, theta_0 = 0.25 if quick else 1.0, 150.0**0.7 / 1024
    ticks, pressure, *_ = scene(seconds)
    ours = {
        "FA-1, ticks": lambda: FA1(period_ms=0.192).encode(ticks),
        "FA-1, pressure": lambda: FA1(period_ms=0.192).encode(pressure),
    }
    numpy = {
        "FA-1, ticks": lambda: numpy_fa1(ticks, theta_0),
        "FA-1, pressure": lambda: numpy_fa1(pressure, theta_0),
    }
    return compare(__doc__, seconds, ours, numpy, quick=quick)
