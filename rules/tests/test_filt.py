"""FILT against its formula, and its formula against the filter that it stands for."""

import numpy as np
import pytest
from rule_examples import change_and_formula, kernel, patterns

from taxel_rules import FILT, INST


def factor(s, tau_q=10.0):
    c_m, c_s = 10 / (10 + tau_q), 5 / (5 + tau_q)
    before = 4 * (c_m * np.exp(-np.maximum(s, 0) / 10) - c_s * np.exp(-np.maximum(s, 0) / 5))
    return np.where(s > 0, before, 4 * (c_m - c_s) * np.exp(np.minimum(s, 0) / tau_q))


@pytest.mark.parametrize("tau_q", [10.0, 3.0])
def test_the_change_is_the_filtered_kernel_at_targets_less_that_at_spikes(tau_q):
    change, expected, *_ = change_and_formula(FILT(tau_q=tau_q), lambda s: factor(s, tau_q))
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_the_kernel_is_the_integral_over_the_filtered_spike():
    r = np.linspace(0, 400, 4_000_001)  # 40 time constants of the filter
    for s in (-20.0, -3.0, 0.0, 0.5, 7.0, 40.0):
        filtered = np.trapezoid(np.exp(-r / 10.0) / 10.0 * kernel(s + r, 10.0, 5.0), r)
        assert factor(np.array(s)) == pytest.approx(filtered, abs=1e-6)


def test_a_filter_of_no_length_is_inst():
    (pattern,), (wanted,) = patterns(2, trains=60, count=1)
    weights = np.random.default_rng(2).uniform(-1, 4, 60)
    sharp, inst = FILT(tau_q=1e-9).change(weights, pattern, wanted), INST().change(weights, pattern, wanted)
    assert sharp[0] == pytest.approx(inst[0], abs=1e-6)
