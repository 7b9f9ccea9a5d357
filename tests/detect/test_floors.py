"""One noise floor of several sensors: the median, so that one bad foot does not hide the small loads of all others."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import Array, Frames, Tare
from taxel.detect import Example
from taxel.detect.floors import floor_of, measured_floor


def foot(noise: float, seed: int) -> Example:
    values = np.random.default_rng(seed).normal(100, noise, (400, 4, 4))
    values[300:310] += 20
    frames = Frames(values, 10_000 * np.arange(400), unit="counts", array=Array(4, 4))
    return Example(frames, {}, Tare.take(frames, stop_us=2_900_000))


@pytest.mark.parametrize("noises", [[1.0], [1.0, 1.1, 30.0], [0.9, 1.0, 1.0, 1.1, 50.0, 70.0]])
def test_one_foot_that_is_far_noisier_does_not_raise_the_floor_of_all(noises: list[float]) -> None:
    feet = [foot(noise, seed) for seed, noise in enumerate(noises)]
    assert floor_of(feet) == pytest.approx(6.0, rel=0.25)
    assert measured_floor([example._replace(tare=None) for example in feet]) is None
