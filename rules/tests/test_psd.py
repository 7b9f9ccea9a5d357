"""PSD against its formula."""

import numpy as np
import pytest
from rule_examples import kernel, patterns, right_sides

from taxel_rules import PSD

GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", "theta_0": 2.0}


@pytest.mark.parametrize("options", [{}, {"tau_1": 8.0, "tau_2": 3.0}, {"tau_s": 5.0, "after_spike": "subtract"}])
def test_the_change_is_the_current_at_targets_less_that_at_spikes(options):
    (pattern,), (wanted,) = patterns(1, trains=60, count=1, targets=3, spikes=3)
    weights = np.random.default_rng(1).uniform(-0.5, 2, 60)
    change, fired = PSD(**GIVEN, **options).change(weights, pattern, wanted)
    tau_1, tau_2 = options.get("tau_1", 10.0), options.get("tau_2", 2.5)
    assert len(fired) > 0
    expected = right_sides(pattern, wanted, fired, lambda s: kernel(s, tau_1, tau_2))
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)
