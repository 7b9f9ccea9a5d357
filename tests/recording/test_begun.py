"""A recording that begins in mid-stream is encoded and read out as what it is: the second half of a whole one."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Array, Events, SpikeTrains, _core
from taxel.encode import ChangeEvents, ContactArea, Encoder, LevelCrossing, Moments

ARRAY = Array(5, 4, pitch_mm=2.0, name="small")
STEP_US, REST = 1000, 48.0


def walk(seed: int) -> Events:
    """All taxels told at rest; then presses that come and go, each stamp a whole ms."""
    random = np.random.default_rng(seed)
    taxel_of = np.r_[np.arange(20), random.integers(0, 20, 3000)]
    t = np.r_[np.zeros(20, int), STEP_US * np.sort(random.integers(20, 800, 3000))]
    ticks = np.full(len(t), int(REST))
    held = np.full(20, int(REST))
    for n in range(20, len(t)):
        lifted = random.random() < 0.4
        held[taxel_of[n]] = REST if lifted else np.clip(held[taxel_of[n]] + random.integers(-30, 61), 40, 400)
        ticks[n] = held[taxel_of[n]]
    return Events(t, taxel_of % 4, taxel_of // 4, random.random(len(t)) < 0.5, array=ARRAY, intensity=ticks)


def begun(events: Events, at: int, place: Path) -> taxel.Recording:
    """Write what comes from a time on, as a recorder that is begun then does: what the taxels hold, then what comes."""
    header = {"array": ARRAY._geometry()}
    writer = _core.RecordingWriter(place, json.dumps(header), "none", True)
    held = np.full(ARRAY.shape, 65_535, np.uint16)
    for event in events[events.t < at]:
        held[event.y, event.x] = event.intensity
    writer.held(1_700_000_000_000_000_000, None, held.reshape(-1))
    later = events[events.t >= at]
    for k, t in enumerate(np.unique(later.t)):
        writer.datagram(1_700_000_000_000_000_000 + int(t) * 1000, k, taxel.wire.encode(later[later.t == t]))
    writer.finish("{}")
    return taxel.open(place)


def after(spikes: SpikeTrains, t_us: int) -> list[tuple[float, int, float]]:
    numbers = np.repeat(np.arange(len(spikes)), np.diff(spikes.offsets))
    values = np.ones(len(numbers)) if spikes.values is None else spikes.values
    all_of_them = zip(spikes.times.round(6).tolist(), numbers.tolist(), values.tolist(), strict=True)
    return sorted(spike for spike in all_of_them if spike[0] > t_us / 1000)


def tare() -> taxel.Tare:
    return taxel.Tare.take(walk(0), stop_us=STEP_US)


#: Encoders whose state is the taxels' values alone; others have more (a displacement since a touch began, an
#: adaptation).
ENCODERS = [
    ChangeEvents(),
    LevelCrossing([60.0, 90.0, 120.0]),
    ContactArea(tare=tare()),
    Moments(displacement_mm=None, tonic_ms=None, tare=tare()),
]


@pytest.mark.parametrize("kind", ["file", "slice", "cut"])
@pytest.mark.parametrize("encoder", ENCODERS, ids=lambda encoder: encoder.name)
def test_from_its_first_stamp_on_the_spikes_are_those_of_the_whole(encoder: Encoder, kind: str, tmp_path: Path) -> None:
    events = walk(1)
    at = int(events.t[len(events) // 3])
    taxel.convert(events, tmp_path / "whole.mcap")
    whole = taxel.open(tmp_path / "whole.mcap")
    if kind == "file":
        later = begun(events, at, tmp_path / "later.mcap")
    else:
        later = whole.between(at, 1e12)
        if kind == "cut":
            taxel.convert(later, tmp_path / "later.mcap")
            later = taxel.open(tmp_path / "later.mcap")
    want = after(encoder.encode(whole), at)
    assert len(want) > 20
    assert after(encoder.encode(later), at) == want
    # The events alone do not contain the initial values.
    assert after(encoder.encode(later.events), at) != want
