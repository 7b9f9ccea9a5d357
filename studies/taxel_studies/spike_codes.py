"""Spike codes of a population (thesis 2.3.2): rate, first-spike and relative latency; and the drops that they read.

A trial has the times of each train's spikes since contact, ms, ascending. A code reads a value of 0 to 1 from each
train, 0 from one that is silent in the window.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import Frames, SpikeTrains, Tare
from taxel.information import Estimate, estimate, nested_predictions
from taxel.simulate import Act, Scene, Silence, play, truth
from taxel_studies.study import Parameters, Row, Task

#: Taxels along a side of the region under the impact, and the period of the afferents: whole frames of 192 us.
SIDE = 20
PERIOD_US = 192

Trial = Sequence[Sequence[float]]


def rate(trials: Sequence[Trial], window_ms: float, most_hz: float) -> NDArray[np.float64]:
    """Read values from the number of spikes within the window; `most_hz` is the rate of a value of 1."""
    counts = np.array([[bisect_left(train, window_ms) for train in trial] for trial in trials])
    return np.asarray(np.minimum(counts / (most_hz * 1e-3 * window_ms), 1.0))


def firsts(trials: Sequence[Trial]) -> NDArray[np.float64]:
    """Return when each train's first spike comes, ms, trial by trial; infinite where there is none."""
    return np.array([[train[0] if len(train) else np.inf for train in trial] for trial in trials])


def latency(first_ms: NDArray[np.float64], window_ms: float) -> NDArray[np.float64]:
    """Read values from how soon the first spike comes."""
    return np.asarray(np.where(first_ms < window_ms, 1.0 - first_ms / window_ms, 0.0))


def relative_latency(first_ms: NDArray[np.float64], window_ms: float) -> NDArray[np.float64]:
    """Read values from how long after the population's first spike a train's own first comes: no reference is needed.

    What is read is relative to the largest value, which reads 1.
    """
    with np.errstate(invalid="ignore"):  # a trial without spikes
        return latency(first_ms - first_ms.min(axis=1, keepdims=True), window_ms)


def bits(values: NDArray[np.float64], labels: ArrayLike, *, folds: int = 10, seed: int = 0) -> Estimate:
    """Estimate how many bits about the trials' labels a code's values carry.

    Linear discriminants classify each trial by its values, trained on the other folds; the bits are those of the
    confusion matrix (`taxel.information.estimate`).
    """
    vary = max(1, int(np.count_nonzero(np.ptp(values, axis=0) > 0)))
    nested = nested_predictions([values @ values.T], [vary], labels, count=folds, seed=seed)
    return estimate(labels, nested.responses, seed=seed)


def drop_tasks(p: Parameters, *, apart: int = 100, **shared: Any) -> list[Task]:
    """List one drop a task; the seeds of two kinds of drop lie this far apart, or a multiple of it."""
    shared |= {"listen_ms": max(p["windows_ms"])}
    return [
        Task({**shared, "radius_mm": r, "drop_mm": d}, 10_000 * p["seed"] + apart * (3 * i + j) + k)
        for i, r in enumerate(p["radii_mm"])
        for j, d in enumerate(p["drops_mm"])
        for k in range(p["trials"])
    ]


def kinds_of(rows: Sequence[Row]) -> list[str]:
    """Return the kind of drop of each realisation: which ball, from which height."""
    return [f"{r.params['radius_mm']:g} mm from {r.params['drop_mm']:g} mm" for r in rows]


def drop(radius_mm: float, drop_mm: float, listen_ms: float, seed: int) -> tuple[Frames, float]:
    """Return what the taxels under an impact read above rest, a frame each 192 us, and when the ball touches, us.

    Frames begin before contact, so that afferents have settled.
    """
    random = np.random.default_rng([seed, 232])
    x, y = (32 * 2.67 + random.uniform(-2.67, 2.67, 2)).tolist()
    ball: dict[str, Any] = {"shape": {"sphere": {"radius_mm": radius_mm}}, "x_mm": x, "y_mm": y}
    scene = Scene.draw(seed).body(**ball, motion={"dropped": {"height_mm": drop_mm}})
    acts: list[Act] = [Silence(60.0), scene]
    contact = truth(acts)[0][0].start_us
    events = play(acts, seed=seed).events
    tare = Tare.take(events, stop_us=events.markers[0][0])
    start = int(contact) - 50 * PERIOD_US
    stop = int(contact + 1000.0 * (listen_ms + 2.0))
    frames = tare.off(Frames.from_events(events, PERIOD_US, start, stop))
    middle = 32 - SIDE // 2
    return frames.region(slice(middle, middle + SIDE), slice(middle, middle + SIDE)), contact


def since_contact(trains: SpikeTrains, contact_us: float, listen_ms: float) -> list[list[float]]:
    """Return the times of each train's spikes within so long after contact, ms."""
    since = [times - contact_us * 1e-3 for times in trains]
    return [[round(float(t), 4) for t in times[(times >= 0) & (times < listen_ms)]] for times in since]
