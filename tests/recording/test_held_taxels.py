"""A taxel that sticks is named with its value and since when; rows and columns of bad taxels are named whole."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel.recording.analysis.health import health, whole_lines
from taxel.recording.analysis.preload import standing

HZ = 50


def walked(seed: int, shape: tuple[int, int], *, noise: float = 0.5, step: float = 0.25) -> taxel.Frames:
    """Return 12 s in N, touched again and again on all taxels, in steps of the sensor, cut off at 0."""
    random = np.random.default_rng(seed)
    values = noise * random.standard_normal((12 * HZ, *shape))
    for begin in range(HZ // 2, 12 * HZ - HZ, HZ):
        values[begin : begin + HZ // 2] += random.uniform(20, 60, shape)
    t = np.arange(len(values)) * (1_000_000 // HZ)
    return taxel.Frames(np.maximum(step * np.round(values / step), 0), t, unit="N", array=taxel.Array(*shape))


def changed(frames: taxel.Frames, part: slice, y: int, x: int, value: float) -> taxel.Frames:
    values = frames.values.copy()
    values[part, y, x] = value
    return taxel.Frames(values, frames.t, unit=frames.unit, array=frames.array)


@pytest.mark.parametrize("shape", [(1, 8), (6, 6)])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_taxel_that_sticks_is_named_with_its_value_and_since_when(seed: int, shape: tuple[int, int]) -> None:
    random = np.random.default_rng(seed)
    y, x = int(random.integers(shape[0])), int(random.integers(shape[1]))
    since, value = int(random.integers(2 * HZ, 7 * HZ)), float(random.integers(30, 150))
    frames = walked(seed, shape)
    [held] = health(changed(frames, slice(since, None), y, x, value)).held
    assert (held.x, held.y, held.value) == (x, y, value)
    assert held.t == frames.t[since]
    assert held.text(frames) == f"column {x}, row {y}, reads {value:g} N from {since / HZ:.1f} s to the end"
    assert health(changed(frames, slice(since, None), y, x, value)).stuck.sum() == 1
    back = health(changed(frames, slice(since, -50), y, x, value)).held
    assert [each.text(frames).endswith(f" to {frames.t[-51] / 1e6:.1f} s") for each in back] == [True]


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.5])
@pytest.mark.parametrize("shape", [(1, 8), (6, 6)])
def test_neither_rest_nor_loads_that_stay_are_stuck(shape: tuple[int, int], noise: float) -> None:
    frames = walked(3, shape, noise=noise)
    assert health(frames).held == ()
    # At rest, in steps of the sensor; touched by its neighbours' feet alone.
    assert health(changed(frames, slice(3 * HZ, None), 0, 1, 0.0)).held == ()
    values, random = frames.values.copy(), np.random.default_rng(4)
    values[3 * HZ :, 0, 1] = np.round(40 + random.normal(0, 0.5, len(values) - 3 * HZ), 1)
    assert health(taxel.Frames(values, frames.t, unit="N", array=frames.array)).held == ()
    # All stand still from then on.
    values = frames.values.copy()
    values[3 * HZ :] = 40
    assert health(taxel.Frames(values, frames.t, unit="N", array=frames.array)).held == ()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_and_columns_of_bad_taxels_are_named_whole(seed: int) -> None:
    random = np.random.default_rng(seed)
    shape = tuple(random.integers(4, 12, 2))
    row, array = int(random.integers(shape[0])), taxel.Array(*map(int, shape))
    dead, unchanging = np.zeros((2, *shape), bool)
    unchanging[row] = True
    dead[row, :2], unchanging[row, :2] = True, False
    dead[(row + 2) % shape[0], 0] = True
    texts, within = whole_lines({"dead": dead, "unchanging": unchanging}, array)
    assert texts == [f"row {row}: {shape[1]} of its {shape[1]} taxels are dead or unchanging"]
    assert within.sum() == shape[1]
    texts, _ = whole_lines({"dead": dead.T}, taxel.Array(*map(int, shape[::-1])))
    assert texts == []
    texts, _ = whole_lines({"dead": (dead | unchanging).T}, taxel.Array(*map(int, shape[::-1])))
    assert texts == [f"column {row}: {shape[1]} of its {shape[1]} taxels are dead"]


@pytest.mark.parametrize("seed", [1, 2])
def test_what_lies_on_a_mat_from_beginning_to_end_is_found(seed: int) -> None:
    frames = walked(seed, (8, 10))
    assert standing(frames) == ""
    random, values = np.random.default_rng(seed), frames.values.copy()
    values[:, 1:4, 5:9] += random.uniform(8, 12, (3, 4))
    lying = taxel.Frames(values, frames.t, unit="N", array=frames.array)
    assert standing(lying).startswith("rows 1 to 3, columns 5 to 8 (up to 1")
    assert standing(lying).endswith(" N in every frame)")


@pytest.mark.parametrize("noise", [1.5, 0.0])
def test_a_taxel_that_freezes_at_rest_is_stuck_if_it_had_noise(noise: float) -> None:
    rng = np.random.default_rng(4)
    values = 1000.0 + rng.normal(0.0, noise, (1500, 4, 4))
    for begin in range(100, 1400, 100):
        values[begin : begin + 30] += 300.0
    values[600:, 1, 2] = 1000.0
    frames = taxel.Frames(np.round(values, 1), 10_000 * np.arange(1500), unit="counts", array=taxel.Array(4, 4))
    found = health(frames)
    assert [(each.x, each.y) for each in found.held] == ([(2, 1)] if noise else [])
    assert found.stuck.sum() == len(found.held)
