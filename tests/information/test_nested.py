"""Nested predictions: what they choose inside the folds and what they refuse."""

import numpy as np
import pytest
from refusal import refused

from taxel.information import nested_predictions


@pytest.mark.parametrize("scale", [1e-100, 1.0, 1e100])
@pytest.mark.parametrize("ridge", [5e-324, 1e-310, 1e-200, 1e-17])
def test_a_ridge_that_rounding_loses_is_named(ridge, scale):
    x, y = np.random.default_rng(3).normal(size=(30, 4)), np.repeat([0, 1, 2], 10)
    with refused(argument="ridge"):
        nested_predictions([scale * (x @ x.T)], [4], y, ridges=[1.0, ridge])


def test_a_class_that_a_training_set_lacks_is_said():
    y = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2, 2])
    groups = np.array([0, 1, 2, 0, 1, 2, 3, 3, 3, 4])
    random = np.random.default_rng(1)
    x = random.normal(size=(10, 30)) + np.eye(3, 30)[y]
    found = nested_predictions([x @ x.T], [30], y, groups=groups, count=2, inner=2)
    assert found.missing == ()
    assert set(found.responses) <= {0, 1, 2}
    one = np.array([0] * 6 + [1] * 6 + [2] * 6)
    apart_ = np.array([0, 1, 2, 3, 4, 5] * 2 + [6, 6, 6, 7, 7, 7])
    x = random.normal(size=(18, 30)) + 3 * np.eye(3, 30)[one]
    both = nested_predictions([x @ x.T], [30], one, groups=apart_, count=2, inner=2)
    assert isinstance(both.missing, tuple)
