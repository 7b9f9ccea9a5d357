"""Measures of drawn loads against closed forms."""

import numpy as np
import pytest

import taxel
from taxel_gait.feet import Foot, load_of
from taxel_gait.measures import curve_of, loading_rate, measures_of, peaks_of
from taxel_gait.tables import SYMMETRIES, curves, means_of, summary, symmetry
from taxel_gait.walk import Step

#: Two humps of 900 and 700 N at 20 and 80 % of a stance of 1 s, and 300 N at 50 %: straight lines between.
CORNERS = np.array([0.0, 0.2, 0.5, 0.8, 1.0]), np.array([0.0, 900.0, 300.0, 700.0, 0.0])
T = np.linspace(0.0, 1.0, 1001)
FORCE = np.interp(T, *CORNERS)


def foot(values, unit="N", array=None):
    values = np.asarray(values, np.float32)
    frames = taxel.Frames(values, np.rint(1e6 * T).astype(np.int64)[: len(values)], unit=unit, array=array)
    force, load_unit = load_of(frames)
    return Foot("left", "left", frames, frames.t / 1e6, force, load_unit)


STANCE = Step(0, 1, 1, "yes", 0, 1000, 0.0, 1.0)


def test_peaks_and_valley():
    found = peaks_of(T, FORCE)
    assert found == pytest.approx(
        {
            "first_peak": 900.0,
            "first_peak_pct": 20.0,
            "valley": 300.0,
            "valley_pct": 50.0,
            "second_peak": 700.0,
            "second_peak_pct": 80.0,
        }
    )


def test_a_load_that_only_falls_after_its_first_peak_has_no_second_one():
    found = peaks_of(T, np.interp(T, [0, 0.3, 1], [0, 800, 0]))
    assert found["first_peak"] == pytest.approx(800)
    assert np.isnan([found["valley"], found["second_peak"]]).all()


def test_loading_rate_is_the_slope_of_a_straight_rise():
    assert loading_rate(T, FORCE) == pytest.approx(900 / 0.2, rel=1e-6)
    # Sampled at 25 Hz, of which no sample is at 20 or 80 %, it is the same.
    assert loading_rate(T[::40], FORCE[::40]) == pytest.approx(900 / 0.2, rel=1e-6)


def test_loading_rate_of_a_load_that_begins_at_its_top_is_not_known():
    assert np.isnan(loading_rate(T, 900 - 800 * T))


def test_force_impulse_and_peaks_of_a_step():
    found = measures_of(foot(FORCE[:, None, None]), STANCE, above=0.0, saturation=None, weight_kg=900 / 9.80665)
    assert found["max_force_N"] == pytest.approx(900)
    assert found["impulse_N_s"] == pytest.approx(np.trapezoid(CORNERS[1], CORNERS[0]), rel=1e-5)
    assert found["mean_force_N"] == pytest.approx(np.trapezoid(CORNERS[1], CORNERS[0]), rel=2e-3)
    assert found["max_force_pct_weight"] == pytest.approx(100)
    assert "contact_area_cm2" not in found


def test_pressure_on_a_known_area_is_force():
    # 4 cells of 10 x 5 mm at p kPa: 200 mm2 x p kPa = 0.2 p N.
    array = taxel.Array(2, 2, (10.0, 5.0))
    values = np.broadcast_to(FORCE[:, None, None], (1001, 2, 2))
    own = foot(values, "kPa", array)
    assert own.unit == "N"
    assert own.force == pytest.approx(0.2 * FORCE, rel=1e-5)
    found = measures_of(own, STANCE, above=450.0, saturation=900.0, weight_kg=None)
    assert found["max_force_N"] == pytest.approx(180)
    assert found["peak_pressure_kPa"] == pytest.approx(900)
    assert found["contact_area_cm2"] == pytest.approx(2.0)
    assert found["saturated_cells"] == 4


def test_pressure_on_an_unknown_area_is_a_sum_in_its_unit():
    own = foot(FORCE[:, None, None], "kPa")
    assert own.unit == "kPa"
    assert "max_sum_kPa" in measures_of(own, STANCE, above=0.0, saturation=None, weight_kg=70.0)


def test_the_path_of_a_centre_that_moves_steadily():
    # From the first of two cells to the other, 100 mm away.
    share = np.linspace(0, 1, 1001)
    array = taxel.Array(2, 1, 100.0)
    values = 500 * np.stack([1 - share, share], axis=1)[:, :, None]
    found = measures_of(foot(values, "N", array), STANCE, above=0.0, saturation=None, weight_kg=None)
    assert found["cop_length_mm"] == pytest.approx(100, rel=2e-3)
    assert found["cop_speed_mm_per_s"] == pytest.approx(100, rel=1e-3)


def test_a_curve_has_101_points_of_stance():
    curve = curve_of(foot(FORCE[:, None, None]), STANCE)
    assert curve == pytest.approx(np.interp(np.linspace(0, 1, 101), *CORNERS), abs=0.01)


def test_symmetries_as_published():
    # 2 (L - R) / (L + R), L/R, 100 ln(L/R), (45 - atan(L/R)) / 90 and (L - R) / max, of 103 and 100.
    found = {name: of(103.0, 100.0) for name, of in SYMMETRIES.items()}
    assert found["symmetry_index_robinson_pct"] == pytest.approx(2.9557, abs=1e-4)
    assert found["ratio_left_to_right"] == pytest.approx(1.03)
    assert found["symmetry_log_ratio_pct"] == pytest.approx(2.9559, abs=1e-4)
    assert found["symmetry_angle_zifchock_pct"] == pytest.approx(-0.9407, abs=1e-4)
    assert found["symmetry_of_larger_pct"] == pytest.approx(2.9126, abs=1e-4)
    assert all(of(7.0, 7.0) == (name == "ratio_left_to_right") for name, of in SYMMETRIES.items())


ROWS = [
    {"recording": "a", "person": "x", "condition": "", "foot": side, "step": k, "used": "yes" if k else "first", "m": m}
    for side, values in (("left", [50.0, 1.0, 2.0, 3.0]), ("right", [50.0, 4.0, 4.0, None]))
    for k, m in enumerate(values)
]


def test_a_summary_is_of_the_steps_that_are_used():
    left, right = summary(ROWS)
    assert (*left.means, left.means.cv_pct) == (3, 2.0, 1.0, 50.0)
    assert right.means == (2, 4.0, 0.0)
    (row,) = symmetry([left, right])
    assert row["ratio_left_to_right"] == 0.5


def test_mean_and_sd_of_curves():
    over_stance = [[9.0] * 101, [1.0] * 101, [2.0] * 101, None] * 2
    found = curves(ROWS, over_stance)
    n, mean, sd = found["x", "", "left"]
    assert (n, mean[50], sd[50]) == (2, 1.5, pytest.approx(np.std([1, 2], ddof=1)))


def test_means_of_nothing():
    n, mean, sd = means_of([None])
    assert n == 0
    assert np.isnan([mean, sd]).all()
