"""The rest of counts of events: chance is quiet, whatever its rate, and short touches are none."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import Array, Frames, Tare
from taxel.recording.analysis.quiet import TOUCH, touched
from taxel.recording.analysis.rest import of_frames

SHAPES = [(1, 1), (1, 4), (1, 16), (4, 4), (10, 12), (60, 80)]
WINDOWS_US = [5000, 20_000]


def drawn(shape: tuple[int, int], mean: float, seed: int, window_us: int) -> Frames:
    """Draw 300 frames of Poisson noise."""
    values = np.random.default_rng(seed).poisson(mean, (300, *shape)).astype(float)
    return Frames(values, window_us * np.arange(300), unit=f"events/{window_us / 1000:g} ms", array=Array(*shape))


@pytest.mark.parametrize("window_us", WINDOWS_US)
@pytest.mark.parametrize("mean", [0.01, 0.05, 0.2, 1.0, 7.0, 50.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_noise_is_quiet_and_no_touch_at_any_rate(shape: tuple[int, int], mean: float, window_us: int) -> None:
    for seed in range(1 if shape[0] > 20 else 4):
        frames = drawn(shape, mean, seed, window_us)
        rest = of_frames(frames)
        assert (rest.source, rest.falls, rest.preload_at) == ("quiet", False, "")
        for count in (25, 115, 250):
            tare = Tare.take(frames, stop_us=window_us * count)
            assert touched(frames, tare) < TOUCH
