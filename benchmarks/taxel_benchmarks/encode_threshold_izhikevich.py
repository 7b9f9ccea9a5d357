"""How many times faster than real time pairs of Izhikevich neurons are, beside the obvious NumPy.

92 channels at 500 Hz, 184 neurons, steps of 0.1 ms; the baseline steps all neurons as one vector.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 100.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import ThresholdIzhikevich
from taxel_benchmarks._goals import Goal, times_real_time
from taxel_benchmarks._instructions import beside_avx2
from taxel_benchmarks._touch import compare


def numpy_izhikevich(frames: Frames) -> list[Any]:
    """Return (t, channel, ON or OFF) of a pair a channel; first all ON neurons, then all OFF neurons."""
    spikes, steps = [], 20
    a, b, c, d, gain, dt = 0.005, 0.25, -65.0, 6.0, 0.6, 0.1
    values = frames.values.reshape(len(frames), -1)
    first = gain * np.concatenate([values[0] >= 0.5, values[0] < 0.5])
    v = (-(5 - b) - np.sqrt((5 - b) ** 2 - 0.16 * (140 + first))) / 0.08
    u = b * v
    for k, value in enumerate(values):
        on = value >= 0.5
        current = gain * np.concatenate([on, ~on])
        for step in range(steps):
            v, u = v + dt * (0.04 * v * v + 5.0 * v + 140.0 - u + current), u + dt * a * (b * v - u)
            fired = v >= 30
            if fired.any():
                t = 100 * (k * steps + step + 1)
                spikes += [(t, neuron % 92, 1 if neuron < 92 else -1) for neuron in np.flatnonzero(fired)]
                v[fired] = c
                u[fired] += d
    return spikes


def gait(seconds: float, rng: np.random.Generator) -> Frames:
    """Return 92 channels at 500 Hz that are loaded and unloaded as the sensors of an insole are."""
    t = np.arange(round(seconds * 500), dtype=np.int64) * 2000
    begin, length = rng.uniform(0, 0.3, 92), rng.uniform(0.1, 0.5, 92)
    within = t[:, None] / 1e6 % 1.1
    on = (within >= begin) & (within < begin + length)
    return Frames(on[:, None, :].astype(np.float32), t, unit="counts")


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return times_real_time({"Izhikevich, 184 neurons": 100}, result)


@beside_avx2
def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds, name = 0.25 if quick else 1.0, "Izhikevich, 184 neurons"
    steps = gait(seconds, np.random.default_rng(5208))
    ours = {name: lambda: ThresholdIzhikevich([0.5]).encode(steps)}
    numpy = {name: lambda: numpy_izhikevich(steps)}
    return compare(__doc__, seconds, ours, numpy, quick=quick)
