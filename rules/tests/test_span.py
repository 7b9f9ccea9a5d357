"""SPAN against its closed form, and that against the integral of filtered trains."""

import numpy as np
import pytest
from rule_examples import change_and_formula

from taxel import SpikeTrains
from taxel_rules import SPAN

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}


def test_the_change_is_the_closed_form():
    def factor(s):
        return (np.e / 2) ** 2 * (np.abs(s) + 5.0) * np.exp(-np.abs(s) / 5.0)

    change, expected, *_ = change_and_formula(SPAN(tau_a=5.0, **GIVEN), factor)
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_the_closed_form_is_the_integral_of_input_times_target():
    tau = 5.0
    t = np.arange(0, 300, 0.001)

    def filtered(at):
        s = np.maximum(t - at, 0)
        return np.e / tau * s * np.exp(-s / tau)

    for apart in (-30.0, -4.0, 0.0, 2.0, 25.0):
        pattern = SpikeTrains.from_lists([[60.0 - apart]], stop=200.0)
        change = SPAN(tau_a=tau, **GIVEN).change([0.0], pattern, [60.0])[0]
        assert change[0] == pytest.approx(np.sum(filtered(60.0 - apart) * filtered(60.0)) * 0.001, rel=1e-6)
