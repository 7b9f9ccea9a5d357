"""How many times faster than real time encoders are: `encode_fa1`, `encode_moments` ...

One core. Frames: 64 x 64 taxels at 5208 Hz (192 us), every taxel with half a tick of noise, a press and its release; in
ticks, and as pressure with fractions. Events: those that a board with noise floor 3 sends of that scene. Pairs of
Izhikevich neurons: 92 channels at 500 Hz, 184 neurons, steps of 0.1 ms. What the spikes must be, the tests say.
TAXEL_INSTRUCTIONS=avx2 before the command measures without AVX-512, as most laboratory computers are.

Peer: real time. Unit: times real time, on one core. Goal: 20; FA-1 60, pairs of Izhikevich neurons 100, the local load
with two running means 5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
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
from taxel_benchmarks._rounds import measured

PERIOD_US, FLOOR = 192, 3.0
#: Levels of the peak, and of each moment within its range.
PEAKS, LEVELS = (5.0, 6.0, 8.0, 12.0, 20.0), 20
RANGES = {"area": (2.0, 500.0), "total": (8.0, 20_000.0), "peak": (4.0, 120.0), "displacement_mm": (0.2, 20.0)}
#: The least noise of a taxel, ticks.
LEAST = 0.3

#: What is measured, by name.
Runs = dict[str, Callable[[], SpikeTrains]]


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


def noisy(tare: Tare) -> Tare:
    """Return the tare of the scene's taxels with the noise that they have in it."""
    rng = np.random.default_rng(192)
    frames = np.rint(tare.rest + rng.normal(0, 0.5, (250, *tare.array.shape)))
    return Tare.take(Frames(frames, np.arange(250) * PERIOD_US, unit="ticks", array=tare.array))


def gait(seconds: float, rng: np.random.Generator) -> Frames:
    """Return 92 channels at 500 Hz that are loaded and unloaded as the sensors of an insole are."""
    t = np.arange(round(seconds * 500), dtype=np.int64) * 2000
    begin, length = rng.uniform(0, 0.3, 92), rng.uniform(0.1, 0.5, 92)
    within = t[:, None] / 1e6 % 1.1
    on = (within >= begin) & (within < begin + length)
    return Frames(on[:, None, :].astype(np.float32), t, unit="counts")


def of_change_events(seconds: float) -> Runs:
    ticks, _, _, events = scene(seconds)
    return {
        "change events": lambda: ChangeEvents(noise_floor=FLOOR).encode(ticks),
        "change events, events": lambda: ChangeEvents(noise_floor=2 * FLOOR).encode(events),
    }


def of_contact_area(seconds: float) -> Runs:
    ticks, _, tare, events = scene(seconds)
    area = ContactArea(noise_floor=FLOOR, tare=tare)
    return {"contact area": lambda: area.encode(ticks), "contact area, events": lambda: area.encode(events)}


def of_fa1(seconds: float) -> Runs:
    frames = dict(zip(("FA-1, ticks", "FA-1, pressure"), scene(seconds)[:2], strict=True))
    return {name: lambda of=of: FA1(period_ms=0.192).encode(of) for name, of in frames.items()}


def of_level_crossing(seconds: float) -> Runs:
    ticks = scene(seconds).ticks
    return {"level crossing": lambda: LevelCrossing([60.0, 80.0], release_share=0.9).encode(ticks)}


def of_local_load(seconds: float) -> Runs:
    ticks, _, still, events = scene(seconds)
    tare = noisy(still)
    load = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, tare=tare)
    local = LocalLoad(noise_floor=FLOOR, least_noise=LEAST, local_ms=(50.0, 300.0), tare=tare)
    return {
        "local load": lambda: load.encode(ticks),
        "local load, two running means": lambda: local.encode(ticks),
        "local load, events": lambda: load.encode(events),
    }


def of_moments(seconds: float) -> Runs:
    ticks, _, tare, events = scene(seconds)
    crossings = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tonic_ms=None, tare=tare)
    tonic = Moments(noise_floor=FLOOR, levels=LEVELS, **RANGES, tare=tare)
    return {
        "moments": lambda: crossings.encode(ticks),
        "moments, with tonic spikes": lambda: tonic.encode(ticks),
        "moments, events": lambda: tonic.encode(events),
    }


def of_peak(seconds: float) -> Runs:
    ticks, tare = scene(seconds).ticks, noisy(scene(seconds).tare)
    return {"peak": lambda: Peak(levels=PEAKS, tare=tare).encode(ticks)}


def of_receptor(name: str, encoder: SA1 | SA2 | FA2) -> Callable[[float], Runs]:
    def runs(seconds: float) -> Runs:
        ticks, _, _, events = scene(seconds)
        return {
            f"{name}, noisy frames": lambda: encoder.encode(ticks),
            f"{name}, events": lambda: encoder.encode(events),
        }

    return runs


def of_izhikevich(seconds: float) -> Runs:
    steps = gait(seconds, np.random.default_rng(5208))
    return {"Izhikevich, 184 neurons": lambda: ThresholdIzhikevich([0.5]).encode(steps)}


@dataclass(frozen=True)
class EncoderBenchmark:
    """The benchmark of one encoder: what it encodes, the runs on so many seconds, and goals in times real time."""

    what: str
    runs: Callable[[float], Runs]
    limits: Mapping[str, float]

    @property
    def about(self) -> str:
        """Its question."""
        return f"How many times faster than real time {self.what}."

    def goals(self, result: Mapping[str, Any]) -> list[Goal]:
        """Return the goals with what a result reached."""
        fast = {f"taxel, {name}, times real time": limit for name, limit in self.limits.items()}
        return at_least(fast, result["ratios"])

    def run(self, *, quick: bool) -> dict[str, Any]:
        """Measure; return seconds and times real time."""
        seconds = 0.25 if quick else 1.0
        runs = {f"taxel, {name}": call for name, call in self.runs(seconds).items()}
        found = measured(runs, rounds=2 if quick else 7, work=seconds)
        found["ratios"] = {f"{name}, times real time": one["rate"] for name, one in found["results"].items()}
        return found | {"seconds": seconds}


#: The benchmarks of this module.
BENCHMARKS = {
    "encode_change_events": EncoderBenchmark("change events are", of_change_events, {"change events": 20}),
    "encode_contact_area": EncoderBenchmark("the contact area is", of_contact_area, {"contact area": 20}),
    "encode_fa1": EncoderBenchmark(
        "the FA-1 afferents of 64 x 64 taxels are", of_fa1, {"FA-1, ticks": 60, "FA-1, pressure": 60}
    ),
    "encode_level_crossing": EncoderBenchmark("level crossings are", of_level_crossing, {"level crossing": 20}),
    "encode_local_load": EncoderBenchmark(
        "the local load is", of_local_load, {"local load": 20, "local load, two running means": 5}
    ),
    "encode_moments": EncoderBenchmark("moments are", of_moments, {"moments": 20}),
    "encode_peak": EncoderBenchmark("the peak is", of_peak, {"peak": 20}),
    "encode_threshold_izhikevich": EncoderBenchmark(
        "pairs of Izhikevich neurons are", of_izhikevich, {"Izhikevich, 184 neurons": 100}
    ),
    **{
        f"encode_{name.lower().replace('-', '')}": EncoderBenchmark(
            f"the {name} afferents of 64 x 64 taxels are",
            of_receptor(name, encoder),
            {f"{name}, noisy frames": 20, f"{name}, events": 20},
        )
        for name, encoder in (
            ("FA-2", FA2(period_ms=0.192)),
            ("SA-1", SA1(period_ms=0.192)),
            ("SA-2", SA2(period_ms=0.192)),
        )
    },
}
