"""Figures 4.3, 4.6 and 4.7: what the thesis says of the circuit comes out, and what is taken over is not judged."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.studies import fig4_3, fig4_6, fig4_7
from taxel.studies.study import Study


def found(study: Study, report) -> tuple[dict, dict]:
    section = study.run(report, size="toy", quiet=True)
    return section["said"], {s["says"]: s for s in section["statements"]}


def test_the_time_of_a_straight_ramp_is_proportional_and_that_of_an_rc_ramp_is_its_logarithm(tmp_path):
    said, statements = found(fig4_3.STUDY, tmp_path)
    assert [s["holds"] for s in statements.values()] == [True, True, False, True]
    for shape, one in said["shapes"].items():
        volts, elapsed = np.array(one["volts"]), np.array(one["elapsed_us"])
        trips = np.minimum(volts + 0.05, 3.0)  # half the hysteresis
        wanted = 0.5 * (trips / 3.0 if shape == "linear" else np.log(5 / (5 - trips)) / np.log(2.5))
        assert elapsed == pytest.approx(wanted, abs=1e-9)


def test_a_lower_voltage_of_the_lines_trades_sensitivity_for_range(tmp_path):
    said, statements = found(fig4_6.STUDY, tmp_path)
    high, low = said["lines"]
    # By hand: V_trans R_f G above rest, of 1.64 uS.
    assert (high["gained_v"], low["gained_v"]) == pytest.approx((0.1002, 0.0385), abs=2e-4)
    assert high["least_n"] < low["least_n"]
    assert 0.8 < high["most_n"] < 1.6
    assert 7 < low["most_n"] < 14
    assert [s["holds"] for s in statements.values()] == [None, True, True, None]


def test_the_input_settles_in_time_unless_the_capacitors_lie_across_the_amplifiers(tmp_path):
    said, statements = found(fig4_7.STUDY, tmp_path)
    assert [s["holds"] for s in statements.values()] == [None, True, None]
    plain, slow = said["scans"]
    assert max(plain["settles_us"]) == pytest.approx(0.05 * np.log(50), abs=0.011)
    assert max(abs(t) for t in plain["left_ticks"]) < 0.05
    assert max(slow["left_ticks"]) > 3
    assert said["impact"]["moved_us"] == pytest.approx(50, abs=1)
