"""Indentations sampled and coded: the grid against its course, rasters against the encoder, what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from taxel import Frames
from taxel.encode import FA1
from taxel_studies import contact, fig5_5, fig5_7, indented, load
from taxel_studies.fem import Course, Indentation, SamplingGrid, press
from taxel_studies.runner import Kept, Task
from taxel_studies.study import Row

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
    conditions = indented.table_of(p).conditions()
    asked = indented.courses_of(p)
    assert list(asked.values()) == [ASKED]
    grid, encoder = SamplingGrid(), FA1(range=5.0, period_ms=2.0, bits=3)
    kept = Kept(tmp_path, "0123abc")
    x = indented.rasters(conditions, asked, kept, grid=grid, encoder=encoder, samples=4, seed=7)
    assert x.shape == (8, 50 * 25)
    values = grid.draw(course, conditions[1].depth_mm, 2.0, 4, seed=15)
    t = np.arange(51) * 2000
    for sample in range(4):
        spikes = encoder.encode(Frames(values[sample][:, None, :], t, unit="kPa"))
        wanted = np.zeros((50, 25))
        for taxel in range(25):
            message = spikes.values[spikes.offsets[taxel] : spikes.offsets[taxel + 1]]
            wanted[np.round(spikes[taxel] / 2.0).astype(int) - 1, taxel] = message
        np.testing.assert_array_equal(x[4 + sample].reshape(50, 25), wanted)
    assert np.abs(x).max() > 1


def test_a_condition_that_was_not_reached_is_left_out_and_named(tmp_path):
    p = load("fig5.5").set("toy")
    rows = []
    for k, task in enumerate(fig5_5.tasks(p)):
        result = {"reached_mm": 0.3 if k == 0 else 0.5, "fault": "stopped at 0.3 mm" if k == 0 else "", "most_kpa": 4.0}
        rows.append(Row(task.params, task.seed, result))
    shared = indented.shared(p, rows)
    short = rows[0].params["course"]
    assert shared["left_out"] == [[short["diameter_mm"], short["modulus_kpa"], 0.5, short["angle_deg"]]]
    assert len(indented.reached(shared)) == 7


def test_a_course_without_equilibrium_is_said(tmp_path):
    """And no statement of Table 5.1 holds then."""
    p = load("contact").set("toy")
    one = {**p["drawn"], "fault": "stopped at 0.3 mm: no equilibrium", "asymmetry": 0.3, "unbalanced": 0.0}
    one |= {"factorisations": 40, "cuts": 9}
    drawn = {"times": [[1.0]], "least_change": 1.2}
    statement = contact.statements(p, {"paths": [one], "conditions": 2, "sampled": drawn})[0]
    assert statement.holds is False
    assert "stopped at 0.3 mm" in statement.why


def test_alpha_is_searched_at_long_periods_then_around_the_best_at_short_ones():
    """`then` is asked until it lists nothing new; here with results that put the best alpha at 0.4."""
    p = load("fig5.5").set()
    rows = [Row(t.params, t.seed, {"reached_mm": 2.0, "fault": "", "most_kpa": 9.0}) for t in fig5_5.tasks(p)]
    phases: list[list[Task]] = []
    known = [(r.params, r.seed) for r in rows]
    while wanted := [t for t in fig5_5.then(p, rows) if (t.params, t.seed) not in known]:
        phases.append(wanted)
        for t in wanted:
            known.append((t.params, t.seed))
            rows.append(Row(t.params, t.seed, {"bits": 5 - abs(t.params["alpha"] - 0.4)}))
    search, short, last = phases
    assert len(search) == 13 * 4
    assert {t.params["alpha"] for t in short} == {0.3, 0.4, 0.5, 0.7}
    assert {t.params["period_ms"] for t in short} == {0.5, 1.0}
    assert sorted(t.params["ask"] for t in last) == ["bits"] * 6 + ["detail"] * 6 + ["part"]
    assert {t.params["alpha"] for t in last} == {0.4}


@pytest.fixture(scope="module")
def courses(tmp_path_factory):
    return Kept(tmp_path_factory.mktemp("courses"), "0123abc")


def rows_of(study, p, courses) -> list[Row]:
    return [Row(t.params, t.seed, study.realise(t.params, t.seed, courses)) for t in study.tasks(p)]


def test_fig5_7_with_one_bit_an_event_is_fig5_5(courses):
    p, q = load("fig5.7").set("toy"), load("fig5.5").set("toy")
    rows = rows_of(load("fig5.7"), p, courses)
    mine = {t.params["period_ms"]: t for t in fig5_7.then(p, rows) if t.params["event_bits"] == 1}
    theirs = {t.params["period_ms"]: t for t in fig5_5.then(q, rows) if t.params["alpha"] == p["alpha"]}
    assert sorted(mine) == sorted(theirs) == [10.0, 20.0]
    for period, task in mine.items():
        other = theirs[period]
        assert fig5_7.realise(task.params, task.seed, courses) == fig5_5.realise(other.params, other.seed, courses)


def test_the_beginning_of_a_contact_is_told_as_of_the_whole_one(courses):
    """Bits until 20 ms are the same whether samples end there or go on."""
    p = load("fig5.5").set("toy")
    shared = indented.shared(p, rows_of(load("fig5.5"), p, courses))
    asked = {**shared, "period_ms": 5.0, "alpha": 0.7, "even_ms": 0.0, "samples": 12, "times_ms": [10.0, 20.0]}
    whole = fig5_5.realise({**asked, "ask": "detail"}, 1, courses)
    part = fig5_5.realise({**asked, "ask": "part", "until_ms": 20.0}, 1, courses)
    assert part["times"] == whole["times"]
    assert part["times"][-1][1] > 0.5
