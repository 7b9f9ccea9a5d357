"""How many times faster than real time the local load is, beside the obvious NumPy.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20; with two running means 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames, Tare
from taxel.encode import LocalLoad
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import FLOOR, PERIOD_US, compare, scene

LEAST = 0.3


def noisy(tare: Tare) -> Tare:
    """Return the tare of the scene's taxels with the noise that they have in it."""
    rng = np.random.default_rng(192)
    frames = np.rint(tare.rest + rng.normal(0, 0.5, (250, *tare.array.shape)))
    return Tare.take(Frames(frames, np.arange(250) * PERIOD_US, unit="ticks", array=tare.array))


def around(values: Any) -> Any:
    """Return the sums over 3 x 3 places."""
    wide = np.pad(values, 1)
    rows = wide[:-2] + wide[1:-1] + wide[2:]
    return rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]


def numpy_load(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, quantity, log(1 + value)) of the quantities above the tracked rest, where they are not 0."""
    sigma = np.maximum(tare.noise, LEAST)
    s = np.sqrt(sigma**2 + FLOOR**2 / 4)
    of_sum, far = np.sqrt(around(s**2)), np.maximum(FLOOR + 0.5, 5 * sigma)
    least = np.maximum(FLOOR + 0.5, 3 * sigma)
    near_step, far_step = -np.expm1(-PERIOD_US / 1e6), -np.expm1(-PERIOD_US / 20e6)
    baseline, above = tare.rest.copy(), np.zeros(frames.array.shape)
    now = np.empty((len(frames), 4))
    spikes = []
    for k, (t, frame) in enumerate(zip(frames.t, frames.values, strict=True)):
        baseline += np.where(np.abs(above) < far, near_step, far_step) * above
        above = frame - baseline
        sums = around(np.clip(above, -3 * s, 3 * s)) / of_sum
        there = above >= least
        area = np.count_nonzero(there & (around(there.astype(np.uint8)) > 1))
        now[k] = area, sums.max(), np.count_nonzero(sums > 4), above[above >= 5 * sigma].sum()
        ages = t - frames.t[: k + 1]
        windows = [
            now[: k + 1][(ages >= a) & (ages < b)] for a, b in ((0, 3000), (2000, 10_000), (0, 10_000), (0, 50_000))
        ]
        means = [window.mean(0) if len(window) else now[0] for window in windows]
        values = np.log1p(np.concatenate([now[k], *means, [1.0]]))
        spikes += [(t, quantity, values[quantity]) for quantity in np.flatnonzero(values)]
    return spikes


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"local load": 20, "local load, two running means": 5}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, still, events = scene(seconds)
    tare = noisy(still)
    load = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, tare=tare)
    local = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, local_ms=(50.0, 300.0), tare=tare)
    ours = {
        "local load": lambda: load.encode(ticks),
        "local load, two running means": lambda: local.encode(ticks),
        "local load, events": lambda: load.encode(events),
    }
    numpy = {"local load": lambda: numpy_load(ticks, tare)}
    return compare(__doc__, seconds, ours, numpy, quick=quick, events=len(events))
