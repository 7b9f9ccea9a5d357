"""ReSuMe against its formula."""

import numpy as np
import pytest
from rule_examples import change_and_formula

from taxel_rules import ReSuMe

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}


@pytest.mark.parametrize(("a", "amplitude", "tau_w"), [(0.0, 1.0, None), (0.3, 2.0, 4.0), (-0.1, 0.5, 25.0)])
def test_the_change_is_the_window_before_targets_less_that_before_spikes(a, amplitude, tau_w):
    def window(s):
        return np.where(s > 0, amplitude * np.exp(-np.maximum(s, 0) / (tau_w or 10.0)), 0.0)

    learner = ReSuMe(a=a, amplitude=amplitude, tau_w=tau_w, **GIVEN)
    change, expected, _, fired = change_and_formula(learner, window)
    assert change == pytest.approx(expected + a * (3 - len(fired)), rel=1e-9, abs=1e-12)
