"""PSD against its formula."""

import pytest
from rule_examples import change_and_formula, kernel

from taxel_rules import PSD

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "theta_0": 2.0}


@pytest.mark.parametrize("options", [{}, {"tau_1": 8.0, "tau_2": 3.0}, {"tau_s": 5.0, "after_spike": "subtract"}])
def test_the_change_is_the_current_at_targets_less_that_at_spikes(options):
    tau_1, tau_2 = options.get("tau_1", 10.0), options.get("tau_2", 2.5)
    learner = PSD(**GIVEN, **options)
    change, expected, *_ = change_and_formula(learner, lambda s: kernel(s, tau_1, tau_2), weights=(-0.5, 2))
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)
