"""Indentations sampled and coded: the grid against its course, rasters against the encoder, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from taxel import Frames
from taxel.encode import FA1
from taxel_studies import indented
from taxel_studies.fem import Course, Indentation, SamplingGrid, press
from taxel_studies.runner import Kept

ASKED = Indentation(
    diameter_mm=3, modulus_kpa=50, angle_deg=10, depth_mm=0.5, mesh_mm=0.4, step_um=10, base_mesh_mm=0.4
)


@pytest.fixture(scope="module")
def course() -> Course:
    return press(ASKED)


def test_a_grid_that_does_not_move_reads_the_course_at_its_steps_and_nodes(course):
    """A speed of 10 um a sample, so that samples fall on steps of the path, and taxels on nodes of the base."""
    grid = SamplingGrid(taxels=1, shift_mm=0.0, duration_ms=50.0)
    values = grid.draw(course, 0.5, 1.0, 200, seed=3)
    assert values.shape == (200, 51, 1)
    assert not values[:, 0].any()
    middle = course.pressure_kpa[:, len(course.x_mm) // 2]
    phases = np.random.default_rng(3).uniform(0, 1.0, 200)
    for k, phase in enumerate(phases):
        low, high = middle[:50], middle[1:51]
        assert np.all(values[k, 1:, 0] >= np.minimum(low, high) - 1e-5)
        assert np.all(values[k, 1:, 0] <= np.maximum(low, high) + 1e-5)
        np.testing.assert_allclose(values[k, 1:, 0], low + phase * (high - low), atol=0.01 * middle.max())


def test_a_shift_moves_the_grid_over_the_base(course):
    grid = SamplingGrid(taxels=7, shift_mm=0.3, duration_ms=50.0)
    values = grid.draw(course, 0.5, 50.0, 60, seed=5)
    random = np.random.default_rng(5)
    phase, shift = random.uniform(0, 50.0, 60), random.uniform(-0.15, 0.15, 60)
    for k in range(60):
        at = phase[k] / 50.0 * 0.5
        pressure = np.array([np.interp(at, course.path_mm, column) for column in course.pressure_kpa.T])
        wanted = CubicSpline(course.x_mm, pressure)(grid.places_mm() + shift[k])
        np.testing.assert_allclose(values[k, 1], wanted, atol=0.01 * course.pressure_kpa.max())


def test_rasters_are_the_encoders_spikes(tmp_path, course):
    p = {**indented.TOY, "diameters_mm": [3.0], "angles_deg": [10.0], "step_um": 10.0}
    contacts = indented.contacts(p, Kept(tmp_path, "0123abc"))
    assert [course.indentation for course in contacts.courses.values()] == [ASKED]
    encoder = FA1(range=5.0, period_ms=2.0, bits=3)
    x = indented.rasters(contacts, encoder, samples=4, seed=7)
    assert x.shape == (8, 50 * 25)
    values = SamplingGrid().draw(course, contacts.conditions[1].depth_mm, 2.0, 4, seed=15)
    t = np.arange(51) * 2000
    for sample in range(4):
        spikes = encoder.encode(Frames(values[sample][:, None, :], t, unit="kPa"))
        wanted = np.zeros((50, 25))
        for taxel in range(25):
            message = spikes.values[spikes.offsets[taxel] : spikes.offsets[taxel + 1]]
            wanted[np.round(spikes[taxel] / 2.0).astype(int) - 1, taxel] = message
        np.testing.assert_array_equal(x[4 + sample].reshape(50, 25), wanted)
    assert np.abs(x).max() > 1
