"""Indentations sampled and coded: the grid against its course, rasters against the encoder, what is left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from taxel import Frames
from taxel.encode import FA1
from taxel_studies import contact, fig5_5, fig5_7, indented, load
from taxel_studies.fem import Condition, Course, Indentation, SamplingGrid, press
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


def test_deeper_is_faster_along_one_course(course):
    """Half the depth in the same time: the same values at twice the time, if every sample comes at the same phase."""
    grid = SamplingGrid(shift_mm=0.0, duration_ms=40.0)
    deep, shallow = grid.draw(course, 0.5, 40.0, 3, seed=1), grid.draw(course, 0.25, 40.0, 3, seed=1)
    assert np.all(shallow[:, 1].max(-1) < deep[:, 1].max(-1))


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


def test_a_condition_that_was_not_reached_is_left_out_and_named(monkeypatch, course):
    p = load("fig5.5").set("toy")
    courses = [replace(course, fault="stopped at 0.3 mm", path_mm=np.array([0.0, 0.3])), *[course] * 3]
    monkeypatch.setattr(indented, "pressed", lambda *_: courses.pop(0))
    contacts = indented.contacts(p, Kept(Path(), ""))
    assert contacts.left_out == [Condition(2.0, 50.0, 0.5, 0.0)]
    assert len(contacts.conditions) == 7


def test_a_course_without_equilibrium_is_said(tmp_path):
    """And no statement of Table 5.1 holds then."""
    p = load("contact").set("toy")
    one = {**p["drawn"], "fault": "stopped at 0.3 mm: no equilibrium", "asymmetry": 0.3, "unbalanced": 0.0}
    one |= {"factorisations": 40, "cuts": 9}
    drawn = {"times": [[1.0]], "least_change": 1.2}
    statement = next(contact.statements(p, {"paths": [one], "conditions": 2, "sampled": drawn}))
    assert statement.holds is False
    assert "stopped at 0.3 mm" in statement.why


def test_alpha_is_searched_at_long_periods_then_around_the_best_at_short_ones():
    """Here the best alpha is 0.4."""
    p = load("fig5.5").set()
    assert len([t for t in fig5_5.tasks(p) if t.params["alpha"] is not None]) == 13 * 4
    by_period = {period: fig5_5.searched(p, period, lambda _, alpha: 5 - abs(alpha - 0.4)) for period in (0.5, 2.0)}
    assert list(by_period[0.5]) == [0.3, 0.4, 0.5, 0.7]
    assert list(by_period[2.0]) == p["alphas"]


@pytest.fixture(scope="module")
def courses(tmp_path_factory):
    return Kept(tmp_path_factory.mktemp("courses"), "0123abc")


def test_fig5_7_with_one_bit_an_event_is_fig5_5(courses):
    p, q = load("fig5.7").set("toy"), load("fig5.5").set("toy")
    for task in fig5_7.tasks(p | {"event_bits": [1]}):
        asked = q | {"period_ms": task.params["period_ms"], "alpha": p["alpha"], "part": False}
        theirs = fig5_5.realise(asked, 0, courses)
        assert fig5_7.realise(task.params, task.seed, courses) == theirs | {"conditions": 8}


def test_the_beginning_of_a_contact_is_told_as_of_the_whole_one(courses):
    """Bits until 20 ms are the same whether samples end there or go on."""
    p = load("fig5.5").set("toy", times_ms=[10.0, 20.0], periods_ms=[5.0, 10.0], alphas=[0.7], part_period_ms=5.0)
    *_, whole, _, part = (fig5_5.realise(task.params, 0, courses) for task in fig5_5.tasks(p))
    assert part["times"] == whole["times"]
    assert part["times"][-1][1] > 0.5
