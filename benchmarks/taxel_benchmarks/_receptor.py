"""The common part of the benchmarks of SA-1, SA-2 and FA-2: 64 x 64 taxels, and a straightforward NumPy version."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taxel import Frames
from taxel.encode import FA2, SA1, SA2
from taxel_benchmarks._touch import compare, scene


def low_pass(tau: float, period: float) -> Callable[[Any, Any, Any], Any]:
    """Return a first-order low pass over one sample, exact for straight lines."""
    keep, mean = np.exp(-period / tau), (1 - np.exp(-period / tau)) * tau / period
    return lambda last, before, now: keep * last + (mean - keep) * before + (1 - mean) * now


def filter_of(encoder: SA1 | SA2 | FA2, x: Any) -> Callable[[Any], Any]:
    """Return a function from the next frame to the potential."""
    period, state = encoder.period_ms, {"x": x}
    if isinstance(encoder, FA2):
        corner, membrane = low_pass(encoder.corner_ms, period), low_pass(encoder.membrane_ms, period)
        state |= {"first": x} | dict.fromkeys(("once", "second", "twice", "u"), np.zeros_like(x))

        def fast(now: Any) -> Any:
            first = corner(state["first"], state["x"], now)
            once = now - first
            second = corner(state["second"], state["once"], once)
            twice = once - second
            u = membrane(state["u"], state["twice"], twice)
            state.update(x=now, first=first, once=once, second=second, twice=twice, u=u)
            return u

        return fast
    recent, long, membrane = (low_pass(tau, period) for tau in (encoder.onset_ms, encoder.loss_ms, encoder.membrane_ms))
    state |= dict.fromkeys(("recent", "long"), x) | dict.fromkeys(("drive", "u"), (1 - encoder.loss) * x)

    def slow(now: Any) -> Any:
        r, z = recent(state["recent"], state["x"], now), long(state["long"], state["x"], now)
        drive = (1 + encoder.onset) * now - encoder.onset * r - encoder.loss * z
        u = membrane(state["u"], state["drive"], drive)
        state.update(x=now, recent=r, long=z, drive=drive, u=u)
        return u

    return slow


def numpy_afferents(encoder: SA1 | SA2 | FA2, frames: Frames) -> list[Any]:
    """Return (t, taxel) of all spikes."""
    spikes, period = [], encoder.period_ms
    x = np.maximum(frames.values[0], 0).astype(np.float64).ravel() / encoder.range
    step = filter_of(encoder, x)
    u = 0 * x if isinstance(encoder, FA2) else (1 - encoder.loss) * x
    raised, wait = np.maximum(u - encoder.threshold, 0), np.zeros_like(x)
    keep = np.exp(-period / encoder.recovery_ms)
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        below = encoder.threshold + raised - u
        u = step(np.maximum(frame, 0).astype(np.float64).ravel() / encoder.range)
        raised = raised * keep
        fired = np.flatnonzero((u >= encoder.threshold + raised) & (wait < period))
        above = u[fired] - encoder.threshold - raised[fired]
        crossed = np.where(below[fired] > 0, period * below[fired] / np.maximum(below[fired] + above, 1e-300), 0)
        since = period - np.maximum(crossed, wait[fired])
        wait = np.maximum(wait - period, 0)
        raised[fired] += encoder.jump * np.exp(-since / encoder.recovery_ms)
        wait[fired] = np.maximum(encoder.refractory_ms - since, 0)
        spikes += [(t, taxel) for taxel in fired.tolist()]
    return spikes


def benchmark(about: str | None, name: str, encoder: SA1 | SA2 | FA2, *, quick: bool) -> dict[str, Any]:
    """Measure a receptor on ticks with noise and on the board's events; return times, factors and ratios."""
    seconds = 0.25 if quick else 1.0
    ticks, _, _, events = scene(seconds)
    ours = {f"{name}, noisy frames": lambda: encoder.encode(ticks), f"{name}, events": lambda: encoder.encode(events)}
    numpy = {f"{name}, noisy frames": lambda: numpy_afferents(encoder, ticks)}
    return compare(about, seconds, ours, numpy, quick=quick)
