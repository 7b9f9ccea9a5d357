"""The common part of the benchmarks of encoders: scenes, and the comparison with a straightforward NumPy version.

One core. Frames: 64 x 64 taxels at 5208 Hz (192 us), every taxel with half a tick of noise, a press and its
release; in ticks, and as pressure with fractions. Events: those that a board with noise floor 3 sends of that scene.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from taxel import Array, Events, Frames, SpikeTrains, Tare
from taxel.encode import ChangeEvents
from taxel_benchmarks._rounds import compared, measure, stamp

PERIOD_US, FLOOR = 192, 3.0


class Scene(NamedTuple):
    """Frames in ticks, frames of pressure, the tare of the taxels at rest, and the board's events."""

    ticks: Frames
    pressure: Frames
    tare: Tare
    events: Events


@cache
def scene(seconds: float) -> Scene:
    """Return the scene of the benchmarks."""
    rng = np.random.default_rng(5208)
    n = round(seconds * 1e6 / PERIOD_US)
    array, t = Array(64, 64, 2.67), np.arange(n, dtype=np.int64) * PERIOD_US
    y, x = np.mgrid[:64, :64]
    press = 60 * np.exp(-((x - 30) ** 2 + (y - 33) ** 2) / 30.0)
    rest = rng.normal(50, 3, (64, 64))
    values = np.empty((n, 64, 64), np.float32)
    for k in range(n):
        values[k] = rest + max(0.0, np.sin(24 * k / n)) * press + rng.normal(0, 0.5, (64, 64))
    ticks = Frames(np.clip(np.rint(values), 0, 150), t, unit="ticks", array=array)
    at_rest = np.broadcast_to(rest, (2, 64, 64))
    tare = Tare.take(Frames(at_rest, [0, 1], array=array))
    return Scene(ticks, Frames(0.37 * values, t, unit="kPa", array=array), tare, board_events(ticks))


def board_events(frames: Frames) -> Events:
    """Return the events of a board with the floor: the first frame, then changes against the last sent value."""
    spikes = ChangeEvents(noise_floor=FLOOR).encode(frames)
    times, taxels = spikes.to_numpy()
    k = np.rint(times * 1000 / PERIOD_US).astype(int)
    order = np.lexsort((taxels, k))
    k, taxels = np.concatenate([np.zeros(4096, int), k[order]]), np.concatenate([np.arange(4096), taxels[order]])
    ticks = frames.values.reshape(len(frames), -1)[k, taxels].astype(np.uint16)
    return Events(frames.t[k], taxels % 64, taxels // 64, np.ones(len(k), bool), array=frames.array, intensity=ticks)


def loaded(frame: Any, loaded_from: Any) -> Any:
    """Return which taxels are loaded and have a loaded neighbour."""
    wide = np.pad(frame >= loaded_from, 1)
    rows = wide[:-2] | wide[1:-1] | wide[2:]
    beside = rows[:, :-2] | rows[:, 2:] | wide[:-2, 1:-1] | wide[2:, 1:-1]
    return wide[1:-1, 1:-1] & beside


def shared(ours: SpikeTrains, theirs: list[Any]) -> float:
    """Return the share of all spikes that both have: time to the us, train, and value within a part in 100 000.

    Ours that are later than all of the NumPy version do not count: encoders hold the last sample for their latency.
    """
    last = max(row[0] for row in theirs)
    (times, trains), values = ours.to_numpy(), ours.values
    rows = zip(times * 1000, trains, np.ones(len(times)) if values is None else values, strict=True)
    mine = {(round(t), int(train)): float(value) for t, train, value in rows if round(t) <= last}
    equal = sum(
        abs(mine.get((round(t), int(train)), np.nan) - one) <= 1e-5 * max(1.0, abs(one))
        for t, train, *value in theirs
        for one in (float(value[0]) if value else 1.0,)
    )
    return equal / max(len(mine), len(theirs))


def compare(
    about: str | None,
    seconds: float,
    ours: Mapping[str, Callable[[], SpikeTrains]],
    numpy: Mapping[str, Callable[[], list[Any]]],
    *,
    quick: bool,
    **facts: Any,
) -> dict[str, Any]:
    """Measure an encoder beside NumPy; return seconds, real-time factors, ratios and the share of equal spikes.

    `about` describes the benchmark. NumPy's spikes are (t in us, train) or (t, train, value).
    """
    runs = {f"taxel, {name}": call for name, call in ours.items()} | {f"numpy, {name}": c for name, c in numpy.items()}
    results = measure(runs, rounds=2 if quick else 7, work=seconds)
    pairs = {f"taxel / numpy, {name}": (f"taxel, {name}", f"numpy, {name}") for name in numpy}
    ratios, spread = compared(results, pairs)
    ratios |= {f"{name}, times real time": result["rate"] for name, result in results.items()}
    return {
        "question": (about or "").splitlines()[0],
        **stamp(),
        "seconds": seconds,
        **facts,
        "equal spikes": {name: shared(ours[name](), baseline()) for name, baseline in numpy.items()},
        "results": results,
        "ratios": ratios,
        "spread": spread,
        "stable": all(result["stable"] for result in results.values()),
    }
