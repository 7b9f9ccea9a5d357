"""Counts of events in a file with more noise than in training: noise floors are of what the file holds at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Array, Events, Frames, Neuron, ProblemError, Readout, Tare
from taxel.detect import PlainRule, run
from taxel.encode import LocalLoad
from taxel.tasks.detect import detect

SHAPE, BURSTS, WINDOW_US = (40, 50), 12, 20_000
UNIT = "events/20 ms"


def counts(mean: float, seed: int, unit: str = UNIT) -> tuple[Frames, np.ndarray]:
    """Draw Poisson noise of a mean in each taxel and window, with a burst a second from the third one on."""
    random = np.random.default_rng(seed)
    values = random.poisson(mean, (50 * (BURSTS + 3), *SHAPE))
    frames = 50 * np.arange(2, 2 + BURSTS) + random.integers(0, 25, BURSTS)
    for frame in frames:
        y, x = random.integers(2, 37), random.integers(2, 47)
        values[frame, y - 1 : y + 2, x - 1 : x + 2] += random.poisson(4 * np.sqrt(mean) + 8, (3, 3))
    times = WINDOW_US * np.arange(len(values))
    return Frames(values.astype(float), times, unit=unit, array=Array(*SHAPE)), WINDOW_US * frames


def readout(floor: float, unit: str = UNIT) -> Readout:
    """Return a readout of a level of the largest sum, of training at a noise floor."""
    encoder = LocalLoad(levels=[3.0], release=0.5, noise_floor=floor, least_noise=floor / 10)
    return Readout(encoder, {"burst": (Neuron(tau=2.0, refractory=50.0), [1.0, 0.0])})._with(unit=unit)


@pytest.mark.parametrize("more", [1.0, 2.0, 4.0, 8.0, 30.0])
@pytest.mark.parametrize("mean", [0.05, 0.3])
def test_a_readout_finds_bursts_in_more_noise_than_in_training(mean: float, more: float) -> None:
    floor = 6 * np.sqrt(mean)
    frames, truth = counts(mean * more, seed=3)
    tare = Tare.take(frames, stop_us=500_000)
    found = run(readout(floor), frames, tare=tare)
    assert len(found) == BURSTS
    assert np.abs(found.t - truth).max() <= 2 * WINDOW_US
    pieces = readout(floor).stream(frame_us=WINDOW_US, tare=tare)
    streamed = pieces.push(frames[:300]) + pieces.push(frames[300:]) + pieces.advance(int(frames.t[-1]) + 100_000)
    assert streamed.t.tolist() == found.t.tolist()


def test_what_is_no_count_of_the_training_is_refused_before_its_rest(tmp_path: Path) -> None:
    rule = PlainRule("area", 2, unit="on events/5 ms")
    camera = Events([0, 10, 400_000], [1, 2, 3], [0, 1, 1], [True, False, True], array=Array(4, 5))
    taxel.convert(camera, tmp_path / "camera.npz")
    with pytest.raises(
        ProblemError, match=r"camera.npz: these are events, not counts, .* on events/5 ms: write count_ms = 5 in"
    ):
        detect(rule, taxel.open(tmp_path / "camera.npz"))
    # Never quiet, and in another unit.
    values = np.random.default_rng(1).integers(0, 500, (100, 4, 5)).astype(float)
    taxel.convert(Frames(values, 20_000 * np.arange(100), unit=UNIT, array=Array(4, 5)), tmp_path / "loud.npz")
    with pytest.raises(
        ProblemError, match=r"loud.npz: values are in events/20 ms, but the plain rule was trained on on events/5 ms"
    ):
        detect(rule, taxel.open(tmp_path / "loud.npz"))
