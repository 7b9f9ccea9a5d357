"""How many times faster than real time encoders are, beside the obvious NumPy: `encode_fa1`, `encode_moments` ...

One core. Frames: 64 x 64 taxels at 5208 Hz (192 us), every taxel with half a tick of noise, a press and its release; in
ticks, and as pressure with fractions. Events: those that a board with noise floor 3 sends of that scene. Pairs of
Izhikevich neurons: 92 channels at 500 Hz, 184 neurons, steps of 0.1 ms; NumPy steps all neurons as one vector.

Where the machine has wider instructions than AVX2, the widest of most laboratory computers, all is measured again with
AVX2 alone, peers too.

Peer: the obvious NumPy. Unit: times real time, on one core. Goal: 20; FA-1 60, pairs of Izhikevich neurons 100, the
local load with two running means 5.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

from taxel import Array, Events, Frames, SpikeTrains, Tare
from taxel.encode import (
    FA1,
    FA2,
    SA1,
    SA2,
    ChangeEvents,
    ContactArea,
    LevelCrossing,
    LocalLoad,
    Moments,
    Peak,
    ThresholdIzhikevich,
)
from taxel_benchmarks._goals import Goal, at_least
from taxel_benchmarks._rounds import alone, compared, measure, stamp

PERIOD_US, FLOOR = 192, 3.0
#: Levels of the number of loaded taxels, of the peak, and of each moment within its range.
AREAS, PEAKS, LEVELS = (2, 4, 8, 16, 32), (5.0, 6.0, 8.0, 12.0, 20.0), 20
RANGES = {"area": (2.0, 500.0), "total": (8.0, 20_000.0), "peak": (4.0, 120.0), "displacement_mm": (0.2, 20.0)}
#: The least noise of a taxel, ticks.
LEAST = 0.3
#: How the rows begin that were measured with AVX2 alone.
AVX2 = "AVX2: "

#: What is measured of ours and of NumPy, by name. NumPy's spikes are (t in us, train) or (t, train, value).
Runs = tuple[dict[str, Callable[[], SpikeTrains]], dict[str, Callable[[], list[Any]]]]


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


def numpy_change(frames: Frames) -> list[Any]:
    """Return (t, taxel, rise or fall) of changes above the floor since the last sent value."""
    spikes, last = [], frames.values[0].copy()
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        moved = frame - last
        there = np.abs(moved) > FLOOR
        if there.any():
            spikes += [(t, taxel_, np.sign(moved.ravel()[taxel_])) for taxel_ in np.flatnonzero(there)]
            last[there] = frame[there]
    return spikes


def numpy_area(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of rises and falls of the number of loaded taxels with a loaded neighbour."""
    spikes, before = [], 0
    loaded_from = tare.rest + FLOOR + 0.5
    for t, frame in zip(frames.t, frames.values, strict=True):
        area = int(np.count_nonzero(loaded(frame, loaded_from)))
        if area != before:
            spikes += [(t, k) for k, level in enumerate(AREAS) if before < level <= area]
            spikes += [(t, len(AREAS) + k) for k, level in enumerate(AREAS) if area < level <= before]
            before = area
    return spikes


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


def numpy_crossing(frames: Frames, levels: list[float], share: float) -> list[Any]:
    """Return (t, train, rise or fall) of crossings with a release."""
    spikes = []
    on_at = np.array(levels, np.float32)[:, None, None]
    off_at = np.array([share * level for level in levels], np.float32)[:, None, None]
    above = frames.values[0] >= on_at
    train = np.arange(above.size).reshape(-1, len(levels)).T.reshape(above.shape)  # taxel by taxel, level by level
    for t, frame in zip(frames.t[1:], frames.values[1:], strict=True):
        now = frame >= np.where(above, off_at, on_at)
        if (now != above).any():
            spikes += [(t, train[place], 1 if now[place] else -1) for place in map(tuple, np.argwhere(now != above))]
            above = now
    return spikes


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


def numpy_moments(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train of a level that is reached or left) of area, total, peak and the displacement of the centre."""
    spaced = [np.geomspace(*RANGES[name], LEVELS) for name in ("area", "total", "peak", "displacement_mm")]
    which = np.repeat([0, 1, 2, 3, 3, 4, 4], LEVELS)
    levels = np.concatenate([*spaced, -spaced[3], spaced[3], -spaced[3]])
    loaded_from, pitch = tare.rest + FLOOR + 0.5, frames.array.column_mm
    y, x = np.mgrid[: frames.array.rows, : frames.array.columns]
    spikes, before, origin = [], None, None
    for t, frame in zip(frames.t, frames.values, strict=True):
        there = loaded(frame, loaded_from)
        moments = np.zeros(5)
        if there.any():
            above = np.where(there, frame - tare.rest, 0.0)
            total = above.sum()
            centre = np.array([(above * x).sum(), (above * y).sum()]) / total
            origin = centre if origin is None else origin
            moments[:] = there.sum(), total, above.max(), *(pitch * (centre - origin))
        else:
            origin = None
        reached = np.where(levels > 0, moments[which] >= levels, moments[which] <= levels)
        if before is not None and (reached != before).any():
            spikes += [
                (t, level if reached[level] else len(levels) + level) for level in np.flatnonzero(reached != before)
            ]
        before = reached
    return spikes


def numpy_peak(frames: Frames, tare: Tare) -> list[Any]:
    """Return (t, train) of the peak above the tracked rest: rises to each level, then falls below it."""
    sigma = np.maximum(tare.noise, LEAST)
    near_step, far_step = -np.expm1(-PERIOD_US / 1e6), -np.expm1(-PERIOD_US / 20e6)
    baseline, above = tare.rest.copy(), np.zeros(frames.array.shape)
    levels, reached, spikes = np.array(PEAKS), np.zeros(len(PEAKS), bool), []
    for t, frame in zip(frames.t, frames.values, strict=True):
        baseline += np.where(np.abs(above) < 5 * sigma, near_step, far_step) * above
        above = frame - baseline
        units = above / sigma
        peak = np.float32(max(units.max(), np.sqrt(np.square(units[units >= 4]).sum())))
        now = np.where(reached, peak >= 0.7 * levels, peak >= levels)
        spikes += [(t, level if now[level] else len(PEAKS) + level) for level in np.flatnonzero(now != reached)]
        reached = now
    return spikes


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


def of_change_events(seconds: float) -> Runs:
    ticks, _, _, events = scene(seconds)
    ours = {
        "change events": lambda: ChangeEvents(noise_floor=FLOOR).encode(ticks),
        "change events, events": lambda: ChangeEvents(noise_floor=2 * FLOOR).encode(events),
    }
    return ours, {"change events": lambda: numpy_change(ticks)}


def of_contact_area(seconds: float) -> Runs:
    ticks, _, tare, events = scene(seconds)
    area = ContactArea(noise_floor=FLOOR, tare=tare)
    ours = {"contact area": lambda: area.encode(ticks), "contact area, events": lambda: area.encode(events)}
    return ours, {"contact area": lambda: numpy_area(ticks, tare)}


def of_fa1(seconds: float) -> Runs:
    frames = dict(zip(("FA-1, ticks", "FA-1, pressure"), scene(seconds)[:2], strict=True))
    ours = {name: lambda of=of: FA1(period_ms=0.192).encode(of) for name, of in frames.items()}
    return ours, {name: lambda of=of: numpy_fa1(of, 150.0**0.7 / 1024) for name, of in frames.items()}


def of_level_crossing(seconds: float) -> Runs:
    ticks = scene(seconds).ticks
    ours = {"level crossing": lambda: LevelCrossing([60.0, 80.0], release_share=0.9).encode(ticks)}
    return ours, {"level crossing": lambda: numpy_crossing(ticks, [60.0, 80.0], 0.9)}


def of_local_load(seconds: float) -> Runs:
    ticks, _, still, events = scene(seconds)
    tare = noisy(still)
    load = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, tare=tare)
    local = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, local_ms=(50.0, 300.0), tare=tare)
    ours = {
        "local load": lambda: load.encode(ticks),
        "local load, two running means": lambda: local.encode(ticks),
        "local load, events": lambda: load.encode(events),
    }
    return ours, {"local load": lambda: numpy_load(ticks, tare)}


def of_moments(seconds: float) -> Runs:
    ticks, _, tare, events = scene(seconds)
    crossings = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tonic_ms=None, tare=tare)
    tonic = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tare=tare)
    ours = {
        "moments": lambda: crossings.encode(ticks),
        "moments, with tonic spikes": lambda: tonic.encode(ticks),
        "moments, events": lambda: tonic.encode(events),
    }
    return ours, {"moments": lambda: numpy_moments(ticks, tare)}


def of_peak(seconds: float) -> Runs:
    ticks, tare = scene(seconds).ticks, noisy(scene(seconds).tare)
    ours = {"peak": lambda: Peak(levels=PEAKS, tare=tare).encode(ticks)}
    return ours, {"peak": lambda: numpy_peak(ticks, tare)}


def of_receptor(name: str, encoder: SA1 | SA2 | FA2, seconds: float) -> Runs:
    ticks, _, _, events = scene(seconds)
    ours = {f"{name}, noisy frames": lambda: encoder.encode(ticks), f"{name}, events": lambda: encoder.encode(events)}
    return ours, {f"{name}, noisy frames": lambda: numpy_afferents(encoder, ticks)}


def of_izhikevich(seconds: float) -> Runs:
    steps, name = gait(seconds, np.random.default_rng(5208)), "Izhikevich, 184 neurons"
    return {name: lambda: ThresholdIzhikevich([0.5]).encode(steps)}, {name: lambda: numpy_izhikevich(steps)}


@dataclass(frozen=True)
class EncoderBenchmark:
    """The benchmark of one encoder: what it encodes, the runs on so many seconds, and goals in times real time."""

    name: str
    what: str
    runs: Callable[[float], Runs]
    limits: Mapping[str, float]

    @property
    def about(self) -> str:
        """Its question."""
        return f"How many times faster than real time {self.what}, beside the obvious NumPy."

    def goals(self, result: Mapping[str, Any]) -> list[Goal]:
        """Return the goals with what a result reached: speed, and NumPy's spikes; and of AVX2 alone."""
        ratios, equal = result["ratios"], result.get("equal spikes", {})
        fast = {f"taxel, {name}, times real time": limit for name, limit in self.limits.items()}
        capped = {AVX2 + name: limit for name, limit in fast.items() if AVX2 + name in ratios}
        same = {f"{name}: spikes as NumPy's, share": one for name, one in equal.items()}
        return at_least(fast, ratios) + at_least(dict.fromkeys(same, 1.0), same) + at_least(capped, ratios)

    def run(self, *, quick: bool) -> dict[str, Any]:
        """Measure; return seconds, real-time factors and ratios."""
        result = self._measured(quick=quick) | {"instructions": widest()}
        if result["instructions"] in ("plain", "avx2"):
            return result
        capped = alone(self.name, quick=quick, environment={"TAXEL_INSTRUCTIONS": "avx2"})
        result["avx2"] = {part: capped[part] for part in ("results", "stable")}
        for of in ("ratios", "spread"):
            result[of] |= {AVX2 + name: one for name, one in capped[of].items()}
        return result

    def _measured(self, *, quick: bool) -> dict[str, Any]:
        seconds = 0.25 if quick else 1.0
        ours, numpy = self.runs(seconds)
        calls: dict[str, Callable[[], Any]] = {f"taxel, {name}": call for name, call in ours.items()}
        calls |= {f"numpy, {name}": call for name, call in numpy.items()}
        results = measure(calls, rounds=2 if quick else 7, work=seconds)
        pairs = {f"taxel / numpy, {name}": (f"taxel, {name}", f"numpy, {name}") for name in numpy}
        ratios, spread = compared(results, pairs)
        ratios |= {f"{name}, times real time": result["rate"] for name, result in results.items()}
        return {
            "question": self.about,
            **stamp(),
            "seconds": seconds,
            "equal spikes": {name: shared(ours[name](), baseline()) for name, baseline in numpy.items()},
            "results": results,
            "ratios": ratios,
            "spread": spread,
            "stable": all(result["stable"] for result in results.values()),
        }


def widest() -> str:
    """Return the widest vector instructions that taxel uses here: it refuses to load with any that are wider."""
    named = os.environ.get("TAXEL_INSTRUCTIONS")
    return named or next(name for name in ("avx512", "avx2", "plain") if _is_there(name))


def _is_there(instructions: str) -> bool:
    environment = os.environ | {"TAXEL_INSTRUCTIONS": instructions}
    load = [sys.executable, "-P", "-c", "import taxel"]
    return subprocess.run(load, env=environment, capture_output=True, check=False).returncode == 0


def _receptor(name: str, encoder: SA1 | SA2 | FA2) -> EncoderBenchmark:
    of = f"encode_{name.lower().replace('-', '')}"
    limits = {f"{name}, noisy frames": 20, f"{name}, events": 20}
    what = f"the {name} afferents of 64 x 64 taxels are"
    return EncoderBenchmark(of, what, partial(of_receptor, name, encoder), limits)


#: The benchmarks of this module.
BENCHMARKS = {
    one.name: one
    for one in (
        EncoderBenchmark("encode_change_events", "change events are", of_change_events, {"change events": 20}),
        EncoderBenchmark("encode_contact_area", "the contact area is", of_contact_area, {"contact area": 20}),
        EncoderBenchmark(
            "encode_fa1",
            "the FA-1 afferents of 64 x 64 taxels are",
            of_fa1,
            {"FA-1, ticks": 60, "FA-1, pressure": 60},
        ),
        _receptor("FA-2", FA2(period_ms=0.192)),
        EncoderBenchmark("encode_level_crossing", "level crossings are", of_level_crossing, {"level crossing": 20}),
        EncoderBenchmark(
            "encode_local_load",
            "the local load is",
            of_local_load,
            {"local load": 20, "local load, two running means": 5},
        ),
        EncoderBenchmark("encode_moments", "moments are", of_moments, {"moments": 20}),
        EncoderBenchmark("encode_peak", "the peak is", of_peak, {"peak": 20}),
        _receptor("SA-1", SA1(period_ms=0.192)),
        _receptor("SA-2", SA2(period_ms=0.192)),
        EncoderBenchmark(
            "encode_threshold_izhikevich",
            "pairs of Izhikevich neurons are",
            of_izhikevich,
            {"Izhikevich, 184 neurons": 100},
        ),
    )
}
