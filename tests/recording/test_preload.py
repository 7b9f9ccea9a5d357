"""What lies on a mat from beginning to end is found."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel.recording.analysis.quiet import standing

HZ = 50


def walked(seed: int, shape: tuple[int, int], *, noise: float = 0.5, step: float = 0.25) -> taxel.Frames:
    """Return 12 s in N, touched again and again on all taxels, in steps of the sensor, cut off at 0."""
    random = np.random.default_rng(seed)
    values = noise * random.standard_normal((12 * HZ, *shape))
    for begin in range(HZ // 2, 12 * HZ - HZ, HZ):
        values[begin : begin + HZ // 2] += random.uniform(20, 60, shape)
    t = np.arange(len(values)) * (1_000_000 // HZ)
    return taxel.Frames(np.maximum(step * np.round(values / step), 0), t, unit="N", array=taxel.Array(*shape))


@pytest.mark.parametrize("seed", [1, 2])
def test_what_lies_on_a_mat_from_beginning_to_end_is_found(seed: int) -> None:
    frames = walked(seed, (8, 10))
    assert standing(frames) == ""
    random, values = np.random.default_rng(seed), frames.values.copy()
    values[:, 1:4, 5:9] += random.uniform(8, 12, (3, 4))
    lying = taxel.Frames(values, frames.t, unit="N", array=frames.array)
    assert standing(lying).startswith("rows 1 to 3, columns 5 to 8 (up to 1")
    assert standing(lying).endswith(" N in every frame)")
