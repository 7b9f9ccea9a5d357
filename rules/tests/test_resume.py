"""ReSuMe against its formula."""

import numpy as np
import pytest
from rule_examples import patterns, right_sides

from taxel_rules import ReSuMe

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}


@pytest.mark.parametrize(("a", "amplitude", "tau_w"), [(0.0, 1.0, None), (0.3, 2.0, 4.0), (-0.1, 0.5, 25.0)])
def test_the_change_is_the_window_before_targets_less_that_before_spikes(a, amplitude, tau_w):
    (pattern,), (wanted,) = patterns(1, trains=60, count=1, targets=3, spikes=3)
    weights = np.random.default_rng(1).uniform(-1, 4, 60)
    change, fired = ReSuMe(a=a, amplitude=amplitude, tau_w=tau_w, **GIVEN).change(weights, pattern, wanted)

    def window(s):
        return np.where(s > 0, amplitude * np.exp(-np.maximum(s, 0) / (tau_w or 10.0)), 0.0)

    assert len(fired) > 0
    expected = right_sides(pattern, wanted, fired, window) + a * (3 - len(fired))
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)
