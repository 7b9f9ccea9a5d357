"""Scenes for the encoders, and spikes as the oracles give them."""

import json

import numpy as np

from taxel import Array, Events, Frames, Tare

#: The array for the laws that every encoder must satisfy.
ARRAY = Array(3, 4, pitch_mm=1.0)


def spikes_of(trains):
    """Spikes as sorted (t us, train, value)."""
    times, numbers = trains.to_numpy()
    values = np.ones(len(times)) if trains.values is None else trains.values
    return sorted(zip(np.rint(times * 1000).astype(int).tolist(), numbers.tolist(), values.tolist(), strict=True))


def frames_of(t, values, array=None):
    """Frames of channels in one row."""
    values = np.asarray(values, np.float32)
    return Frames(values[:, None, :], t, unit="ticks", array=array or Array(1, values.shape[1]))


def wander(rng, samples=300, channels=5, ticks=True):
    """Values that wander, rest and jump."""
    moves = rng.choice([0.0, 0.0, 1.0, -1.0, 4.0, -4.0, 30.0, -30.0], (samples, channels))
    values = np.clip(60 + np.cumsum(moves * (rng.random((samples, channels)) < 0.4), axis=0), 0, 150)
    return values if ticks else values * 0.731


def touch(rng, array, n=300, absent=0.3, late=0.0, repaired=0.0):
    """Events of taxels that go up and down: several a stamp, silences, some without intensity, late, or repaired."""
    steps = rng.choice([0, 100, 200, 1500, 30_000], n, p=[0.6, 0.2, 0.14, 0.05, 0.01])
    t = 1_234_500 + np.cumsum(steps)
    behind = rng.random(n) < late
    t[behind] -= 100 * rng.integers(1, 20, behind.sum())
    x, y = rng.integers(0, array.columns, n), rng.integers(0, array.rows, n)
    ticks = np.clip(rng.normal(60, 12, n), 0, 150).astype(np.uint16)
    more = {"intensity": ticks, "present": rng.random(n) > absent, "repaired": rng.random(n) < repaired}
    return Events(t, x, y, rng.random(n) > 0.5, array=array, **more)


def ended(events, ticks=55):
    """The same events, after which all taxels rest."""
    y, x = (places.ravel() for places in np.indices(events.array.shape))
    last, n = events.t.max() + 1000, len(x)
    more = {
        "intensity": np.concatenate([events.intensity, np.full(n, ticks, np.uint16)]),
        "present": np.concatenate([events.present, np.ones(n, bool)]),
        "repaired": np.concatenate([events.repaired, np.zeros(n, bool)]),
    }
    t, p = np.concatenate([events.t, np.full(n, last)]), np.concatenate([events.p, np.zeros(n, bool)])
    return Events(t, np.concatenate([events.x, x]), np.concatenate([events.y, y]), p, array=events.array, **more)


def at_times(events, t):
    """The same events at other times."""
    more = {"intensity": events.intensity, "present": events.present, "repaired": events.repaired}
    return Events(t, events.x, events.y, events.p, array=events.array, **more)


def rest(array, ticks=55):
    """A tare of an array whose taxels all rest at the same value."""
    frames = np.full((2, array.rows, array.columns), ticks, np.float32)
    return Tare.take(Frames(frames, [0, 1000], unit="ticks", array=array))


def smooth(rng, n, period):
    """A pressure that begins at 0 and wanders smoothly, some of it below 0, ms and ticks."""
    t = np.arange(n) * period
    waves = rng.uniform(0.5, 60, 4), rng.uniform(0, 2 * np.pi, 4), rng.uniform(5, 30, 4)
    x = 45 + sum(a * np.sin(2 * np.pi * f * t / 1000 + phase) for f, phase, a in zip(*waves, strict=True))
    return t, (x * np.minimum(t / 20, 1)).astype(np.float32)


def of(encoder, t, x):
    return encoder.encode(frames_of(np.rint(t * 1000).astype(int), np.asarray(x)[:, None]))[0]


def some_tare(rng, array, noise, holes):
    """A tare with noise of its own for each taxel, 0 for some; of some taxels nothing is known."""
    of_each = noise * rng.random(array.shape) * (rng.random(array.shape) < 0.8)
    readings = rng.normal(rng.uniform(40, 60, array.shape), of_each, (20, *array.shape))
    there = np.ones(array.shape, bool) if array.exists is None else array.exists
    readings = np.where(there, readings, 0)
    tare = json.loads(Tare.take(Frames(readings, 192 * np.arange(20), unit="ticks", array=array)).to_json())
    unknown = rng.random(there.size) < holes
    for name in ("rest", "noise"):
        tare[name] = [None if hole else value for hole, value in zip(unknown, tare[name], strict=True)]
    return Tare.from_json(json.dumps(tare))
