"""Drawn touches on grids of taxels, and when each begins and ends."""

from __future__ import annotations

import numpy as np

from taxel import Array, Frames


def pressed(
    seed: int, count: int = 10, *, begin_s: float = 1.0, kinds: float = 0.0, still: bool = False
) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return presses on 6 x 6 taxels at 100 Hz, `still` at one place; hard ones are harder by the share `kinds`."""
    random = np.random.default_rng(seed)
    begins = np.rint(100 * (begin_s + np.cumsum(random.uniform(0.6, 1.4, count)))).astype(int)
    ends, values = begins + random.integers(12, 35, count), random.normal(50, 0.5, (int(begins[-1]) + 150, 6, 6))
    hard = np.arange(count) % 2 == 1
    for begin, end, more in zip(begins, ends, kinds * hard, strict=True):
        y, x = (2, 2) if still else random.integers(0, 5, 2)
        values[begin:end, y : y + 2, x : x + 2] += random.uniform(40, 50) * (1 + more)
    t = 10_000 * np.arange(len(values))
    labels = {"soft": t[begins[~hard]], "hard": t[begins[hard]]} if kinds else {"contact": t[begins], "lift": t[ends]}
    return Frames(values, t, unit="counts", array=Array(6, 6)), labels


def of_two_sizes(
    seed: int, rate: float, jitter: float = 0.0, rise_s: float = 0.02, start_us: int = 0
) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return frames of 16 touches by two sizes of ball on 7 x 7 taxels, and when which began; stamps may vary."""
    random = np.random.default_rng(seed)
    begins = 1.5 + 0.9 * np.arange(16) + random.uniform(0, 0.2, 16)
    large = random.permutation(np.arange(16) % 2).astype(bool)
    t = (np.arange(round(16.5 * rate)) + random.uniform(-jitter, jitter, round(16.5 * rate))) / rate
    y, x = np.mgrid[:7, :7]
    values = random.normal(0.2, 0.01, (7, 7)) + random.normal(0, 0.002, (len(t), 7, 7))
    for begin, wide in zip(begins, large, strict=True):
        at = random.uniform(2, 4, 2)
        shape = np.exp(-((y - at[0]) ** 2 + (x - at[1]) ** 2) / (6.5 if wide else 2.0))
        force = np.clip((t - begin) / rise_s, 0, 1) * (t < begin + 0.5) * random.uniform(0.4, 0.6)
        values += force[:, None, None] * shape
    times = start_us + np.rint(1e6 * begins).astype(np.int64)
    frames = Frames(values, start_us + np.rint(1e6 * (t - t[0])).astype(np.int64), unit="mV", array=Array(7, 7))
    return frames, {"small": times[~large], "large": times[large]}
