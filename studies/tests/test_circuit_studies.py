"""Figures 3.3, 3.5, 4.3, 4.6 and 4.7: claims hold, and assumptions of the thesis are not judged."""

from __future__ import annotations

import numpy as np
import pytest

from taxel_studies import load
from taxel_studies.study import Study


def found(study: Study, report) -> tuple[dict, dict]:
    section = study.run(report, size="toy", quiet=True)
    return section["said"], {(j["claim"], j["reading"]): j["holds"] for j in section["judgements"]}


def test_the_time_of_a_straight_ramp_is_proportional_and_that_of_an_rc_ramp_is_its_logarithm(tmp_path):
    summary, holds = found(load("fig4.3"), tmp_path)
    assert [holds[claim, ramp] for claim in (10, 11) for ramp in ("RC ramp", "linear ramp")] == [
        True,
        True,
        False,
        True,
    ]
    for shape, one in summary["shapes"].items():
        volts, elapsed = np.array(one["volts"]), np.array(one["elapsed_us"])
        trips = np.minimum(volts + 0.05, 3.0)  # half the hysteresis
        wanted = 0.5 * (trips / 3.0 if shape == "linear" else np.log(5 / (5 - trips)) / np.log(2.5))
        assert elapsed == pytest.approx(wanted, abs=1e-9)


@pytest.mark.slow
def test_an_asynchronous_array_tells_finer_times_of_the_same_touch(tmp_path):
    summary, holds = found(load("asynchronous"), tmp_path)
    costs = summary["costs"]
    assert holds[108, ""]
    assert costs["asynchronous"]["moments"] > costs["scanned"]["moments"]
    # A taxel that compares by itself sends each step that a scanned one skips, and as many steps of noise.
    assert costs["asynchronous"]["events"] >= costs["scanned"]["events"]
    assert all(0 <= one["first"][0] <= summary["most"] for bits in summary["bits"].values() for one in bits.values())


def test_a_pair_of_neurons_fires_once_for_each_step_that_lasts(tmp_path):
    summary, holds = found(load("fig3.3"), tmp_path)
    assert [line["steps"] for line in summary["lines"]] == 2 * [summary["spikes"]]
    assert [line["wrong"] for line in summary["lines"]] == [0, 0]
    assert summary["active"] > 20
    assert list(holds.values()) == [True, True]
