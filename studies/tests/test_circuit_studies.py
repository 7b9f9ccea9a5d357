"""Figures 3.3, 3.5, 4.3, 4.6 and 4.7: statements hold, and assumptions of the thesis are not judged."""

from __future__ import annotations

import numpy as np
import pytest

from taxel_studies import fabric_array, load
from taxel_studies.study import Study


def found(study: Study, report) -> tuple[dict, dict]:
    section = study.run(report, size="toy", quiet=True)
    return section["said"], {s["says"]: s for s in section["statements"]}


def test_the_time_of_a_straight_ramp_is_proportional_and_that_of_an_rc_ramp_is_its_logarithm(tmp_path):
    summary, statements = found(load("fig4.3"), tmp_path)
    assert [s["holds"] for s in statements.values()] == [True, True, False, True]
    for shape, one in summary["shapes"].items():
        volts, elapsed = np.array(one["volts"]), np.array(one["elapsed_us"])
        trips = np.minimum(volts + 0.05, 3.0)  # half the hysteresis
        wanted = 0.5 * (trips / 3.0 if shape == "linear" else np.log(5 / (5 - trips)) / np.log(2.5))
        assert elapsed == pytest.approx(wanted, abs=1e-9)


def test_a_ramp_that_adapts_is_near_the_best_fixed_one_in_each_phase(tmp_path):
    summary, statements = found(load("adaptive_ramp"), tmp_path)
    assert [s["holds"] for s in statements.values()] == [True, True, True, None]
    ramps = summary["ramps"]
    own, gentle, steep = (ramps[name]["rms_mv"] for name in ("adaptive", "510", "38"))
    assert gentle["fine"] < steep["fine"]
    assert steep["gross"] < gentle["gross"]
    assert own["gross"] < gentle["gross"]
    # A gentle ramp's own error: a tick is uniform, 3 V / 510 on average and less where the RC curve is flat.
    assert gentle["fine"] == pytest.approx(1e3 * 3 / 510 / np.sqrt(12), rel=0.5)
    course = ramps["adaptive"]["course"]
    assert min(course["ramp"]) < 150 < max(course["ramp"]) == 510


@pytest.mark.slow
def test_an_asynchronous_array_tells_finer_times_of_the_same_touch(tmp_path):
    summary, statements = found(load("asynchronous"), tmp_path)
    costs = summary["costs"]
    assert next(iter(statements.values()))["holds"]
    assert costs["asynchronous"]["moments"] > costs["scanned"]["moments"]
    # A taxel that compares by itself sends each step that a scanned one skips, and as many steps of noise.
    assert costs["asynchronous"]["events"] >= costs["scanned"]["events"]
    assert all(0 <= one["first"][0] <= summary["most"] for bits in summary["bits"].values() for one in bits.values())


def test_a_lower_voltage_of_the_lines_trades_sensitivity_for_range(tmp_path):
    summary, statements = found(load("fig4.6"), tmp_path)
    high, low = summary["lines"]
    # By hand: V_trans R_f G above rest, of 1.64 uS.
    assert (high["gained_v"], low["gained_v"]) == pytest.approx((0.1002, 0.0385), abs=2e-4)
    assert high["least_n"] < low["least_n"]
    assert 0.8 < high["most_n"] < 1.6
    assert 7 < low["most_n"] < 14
    assert [s["holds"] for s in statements.values()] == [None, True, True, None]


def test_the_input_settles_in_time_unless_the_capacitors_lie_across_the_amplifiers(tmp_path):
    summary, statements = found(load("fig4.7"), tmp_path)
    # A value that is an assumption of ours, or chosen to fit, is not judged.
    assert [s["holds"] for s in statements.values()] == [None, None, None]
    plain, slow = summary["scans"]
    assert max(plain["settles_us"]) == pytest.approx(0.05 * np.log(50), abs=0.011)
    assert max(abs(t) for t in plain["left_ticks"]) < 0.05
    assert max(slow["left_ticks"]) > 3
    assert summary["impact"]["moved_us"] == pytest.approx(50, abs=1)


def test_a_pair_of_neurons_fires_once_for_each_step_that_lasts(tmp_path):
    summary, statements = found(load("fig3.3"), tmp_path)
    assert summary["steps"] == summary["spikes"]
    assert summary["wrong"] == 0
    assert summary["active"] > 20
    assert [s["holds"] for s in statements.values()] == [True]


def test_a_sphere_is_pressed_to_its_force_and_felt_by_the_taxels_beneath():
    """The pressure on the taxels carries the force; dividers read most where it is."""
    p = fabric_array.SENSOR
    depth = fabric_array.depth_of(65.0, 4.0, p["foam_kpa"], p["foam_mm"])
    depths, felt = fabric_array.pressed(p, 65.0, depth, 7.5, 0.0)
    assert felt[-1].sum() * 7.5**2 / 1000 == pytest.approx(4.0, rel=0.01)
    frames = fabric_array.read({**p, "noise_v": 0.0, "gain_spread": 0.0}, depths, felt, np.array([0.0, depth]), 1)
    taxel = np.unravel_index(frames.values[1].argmax(), (8, 8))
    assert taxel[0] in (3, 4)
    assert taxel[1] in (4, 5)
    assert frames.values[0].max() == pytest.approx(frames.values[0].min(), abs=1e-6)


def test_two_spheres_give_trials_of_both_and_errors_by_epoch(tmp_path):
    summary, statements = found(load("fig3.5"), tmp_path)
    (line,) = summary["forces"]
    assert min(line["counts"]) > 2
    assert all(0 <= e <= 1 for e in line["error"])
    (other,) = summary["others"]
    assert (other["reading"], other["force_n"]) == ("foam of 30 kPa", 1.0)
    assert other["spikes"] > 1.5 * line["spikes"]  # softer foam: more taxels under the same force
    assert [s["holds"] for s in statements.values()] == [None, None, None]
