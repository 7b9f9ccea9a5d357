"""How many times faster than real time encoders are, beside the obvious NumPy.

One core. Frames: 64 x 64 taxels at 5208 Hz (192 us), every taxel with half a tick of noise, a press that comes and
goes; in ticks, and as pressure with fractions. Events: what a board with noise floor 3 sends of that scene. Izhikevich:
92 channels at 500 Hz, 184 neurons, steps of 0.1 ms, all of which the baseline takes as one vector.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from _rounds import measure, ratio, stamp
from numpy.typing import NDArray

import taxel
from taxel import Array, Events, Frames, SpikeTrains, Tare
from taxel.encode import FA1, ChangeEvents, ContactArea, LevelCrossing, ThresholdIzhikevich

PERIOD_US, FLOOR, LEVELS = 192, 3.0, (2, 4, 8, 16, 32)

#: Times real time that an encoder must reach on one core.
GOALS = {
    "change events": 20,
    "contact area": 20,
    "FA-1, ticks": 20,
    "FA-1, pressure": 5,
    "Izhikevich, 184 neurons": 100,
}

Picture = NDArray[np.float32]


def scene(seconds: float, rng: np.random.Generator) -> tuple[Frames, Frames, Tare]:
    """Return pictures in ticks, pictures of pressure, and the tare of the taxels at rest."""
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
    return ticks, Frames(0.37 * values, t, unit="kPa", array=array), Tare.take(Frames(at_rest, [0, 1], array=array))


def numpy_change(frames: Frames) -> list[Any]:
    """Return (t, taxel, rise or fall) of changes above the floor since the last sent value."""
    said, last = [], frames.values[0].copy()
    for t, picture in zip(frames.t[1:], frames.values[1:], strict=True):
        moved = picture - last
        there = np.abs(moved) > FLOOR
        if there.any():
            said += [(t, taxel_, np.sign(moved.ravel()[taxel_])) for taxel_ in np.flatnonzero(there)]
            last[there] = picture[there]
    return said


def numpy_area(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of rises and falls of the number of loaded taxels with a loaded neighbour."""
    said, before = [], 0
    loaded_from, wide = tare.rest + FLOOR + 0.5, np.zeros((66, 66), bool)
    for t, picture in zip(frames.t, frames.values, strict=True):
        loaded = wide[1:-1, 1:-1]
        np.greater_equal(picture, loaded_from, out=loaded)
        rows = wide[:-2] | wide[1:-1] | wide[2:]
        beside = rows[:, :-2] | rows[:, 2:] | wide[:-2, 1:-1] | wide[2:, 1:-1]
        area = int(np.count_nonzero(loaded & beside))
        if area != before:
            said += [(t, k) for k, level in enumerate(LEVELS) if before < level <= area]
            said += [(t, 5 + k) for k, level in enumerate(LEVELS) if area < level <= before]
            before = area
    return said


def numpy_fa1(frames: Frames, theta_0: float) -> list[Any]:
    """Return (t, taxel, polarity) by equations 5.1 to 5.5; T 0.192 ms."""
    said = []
    jump, fall = 0.192 * 20 * theta_0, 0.05 * theta_0
    last = np.maximum(frames.values[0], 0).astype(np.float64) ** 0.7
    u, theta, fired = np.zeros((64, 64)), np.full((64, 64), theta_0), np.zeros((64, 64), bool)
    for t, picture in zip(frames.t[1:], frames.values[1:], strict=True):
        rho = np.maximum(picture, 0).astype(np.float64) ** 0.7
        theta = np.where(fired, theta + jump, np.where(theta > theta_0, theta - fall, theta_0))
        u += rho - last
        last = rho
        s = np.where(u > theta, 1, np.where(u < -theta, -1, 0))
        fired = s != 0
        u[fired] = 0
        said += [(t, taxel_, s.ravel()[taxel_]) for taxel_ in np.flatnonzero(fired)]
    return said


def numpy_izhikevich(frames: Frames) -> list[Any]:
    """Return (step, neuron) of a pair a channel; first all ON neurons, then all OFF neurons."""
    said, steps = [], 20
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
                said += [(k * steps + step, neuron) for neuron in np.flatnonzero(fired)]
                v[fired] = c
                u[fired] += d
    return said


def gait(seconds: float, rng: np.random.Generator) -> Frames:
    """Return 92 channels at 500 Hz that go on and off as the sensors of an insole do."""
    t = np.arange(round(seconds * 500), dtype=np.int64) * 2000
    begin, length = rng.uniform(0, 0.3, 92), rng.uniform(0.1, 0.5, 92)
    within = t[:, None] / 1e6 % 1.1
    on = (within >= begin) & (within < begin + length)
    return Frames(on[:, None, :].astype(np.float32), t, unit="counts")


def board_events(frames: Frames) -> Events:
    """Return what a board with the floor sends: the first picture, then changes against the last sent value."""
    spikes = ChangeEvents(noise_floor=FLOOR).encode(frames)
    times, taxels = spikes.to_numpy()
    k = np.rint(times * 1000 / PERIOD_US).astype(int)
    order = np.lexsort((taxels, k))
    k, taxels = np.concatenate([np.zeros(4096, int), k[order]]), np.concatenate([np.arange(4096), taxels[order]])
    ticks = frames.values.reshape(len(frames), -1)[k, taxels].astype(np.uint16)
    return Events(frames.t[k], taxels % 64, taxels // 64, np.ones(len(k), bool), array=frames.array, intensity=ticks)


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, real-time factors and ratios."""
    seconds, rounds = (0.25, 2) if quick else (1.0, 7)
    rng = np.random.default_rng(5208)
    ticks, pressure, tare = scene(seconds, rng)
    steps = gait(seconds, rng)
    events = board_events(ticks)
    ours: dict[str, Callable[[], SpikeTrains]] = {
        "change events": lambda: ChangeEvents(noise_floor=FLOOR).encode(ticks),
        "contact area": lambda: ContactArea(noise_floor=FLOOR, tare=tare).encode(ticks),
        "FA-1, ticks": lambda: FA1(period_ms=0.192).encode(ticks),
        "FA-1, pressure": lambda: FA1(period_ms=0.192).encode(pressure),
        "Izhikevich, 184 neurons": lambda: ThresholdIzhikevich([0.5]).encode(steps),
        "level crossing": lambda: LevelCrossing([60.0, 80.0], release_share=0.9).encode(ticks),
        "contact area, events": lambda: ContactArea(noise_floor=FLOOR, tare=tare).encode(events),
        "change events, events": lambda: ChangeEvents(noise_floor=2 * FLOOR).encode(events),
    }
    theta_0 = 150.0**0.7 / 1024
    numpy: dict[str, Callable[[], list[Any]]] = {
        "change events": lambda: numpy_change(ticks),
        "contact area": lambda: numpy_area(ticks, tare),
        "FA-1, ticks": lambda: numpy_fa1(ticks, theta_0),
        "FA-1, pressure": lambda: numpy_fa1(pressure, theta_0),
        "Izhikevich, 184 neurons": lambda: numpy_izhikevich(steps),
    }
    for name, baseline in numpy.items():
        mine, theirs = len(ours[name]().times), len(baseline())
        # Izhikevich: encoders hold the last sample for their latency, the baseline ends with it.
        if mine != theirs and not (name.startswith("Izhikevich") and 0 <= mine - theirs <= 92):
            raise taxel.Error(f"{name}: {mine} spikes, the NumPy version has {theirs}")
    runs = {f"taxel, {name}": call for name, call in ours.items()} | {f"numpy, {name}": c for name, c in numpy.items()}
    results = measure(runs, rounds=rounds, work=seconds)
    ratios = {f"taxel / numpy, {name}": ratio(results, f"taxel, {name}", f"numpy, {name}") for name in numpy}
    ratios |= {f"{name}, times real time": result["rate"] for name, result in results.items()}
    ratios["contact area, million events/s"] = (
        len(events) / seconds * results["taxel, contact area, events"]["rate"] / 1e6
    )
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp(),
        "seconds": seconds,
        "events": len(events),
        "goals, times real time": GOALS,
        "reached": {name: bool(results[f"taxel, {name}"]["rate"] >= goal) for name, goal in GOALS.items()},
        "results": results,
        "ratios": ratios,
        "stable": all(result["stable"] for result in results.values()),
    }
