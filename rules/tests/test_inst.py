"""INST against its formula."""

import numpy as np
import pytest
from rule_examples import change_and_formula, kernel, patterns

from taxel_rules import INST


@pytest.mark.parametrize("targets", [1, 3])
def test_the_change_is_the_potential_of_inputs_at_targets_less_that_at_spikes(targets):
    change, expected, *_ = change_and_formula(INST(), lambda s: kernel(s, 10.0, 5.0), targets)
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_defaults_are_those_of_gardner_and_gruning():
    """Peak 1 mV at 7 ms; eta 600/(N n_s p), weights from 0 to 200/N."""
    (pattern,), _ = patterns(2, trains=1, count=1)
    change = INST().change([0.0], pattern, [pattern[0][0] + 6.93])[0]
    assert change == pytest.approx([1.0], abs=1e-4)
    shown, wanted = patterns(3, trains=50, count=4, targets=2)
    weights = np.array([INST(epochs=0, seed=s).fit(shown, wanted).weights_ for s in range(40)])
    assert 0 <= weights.min() < 0.01
    assert 3.99 < weights.max() <= 4.0
    start = weights[0]
    trained = INST(epochs=1, until_right=False).fit(shown, wanted, start=start)
    same = INST(epochs=1, until_right=False, eta=600 / (50 * 2 * 4)).fit(shown, wanted, start=start)
    assert trained.weights_.tobytes() == same.weights_.tobytes()
