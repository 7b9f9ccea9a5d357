"""E-learning and I-learning against their formulas."""

import itertools

import numpy as np
import pytest
from rule_examples import change_and_formula, kernel, patterns, summed

from taxel_rules import Chronotron, _rules

NEURON = {"tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}
GIVEN = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch", **NEURON}


def cheapest(fired, targets, tau_q):
    """The way from spikes to targets that costs least, by trying every way to pair them in order."""
    best = (np.inf, [])
    for count in range(min(len(fired), len(targets)) + 1):
        for a in itertools.combinations(range(len(fired)), count):
            for b in itertools.combinations(range(len(targets)), count):
                apart = np.array([fired[i] - targets[j] for i, j in zip(a, b, strict=True)])
                cost = len(fired) + len(targets) - 2 * count + np.sum((apart / tau_q) ** 2 / 2)
                if cost < best[0]:
                    best = (cost, list(zip(a, b, strict=True)))
    return best[1]


@pytest.mark.parametrize("seed", range(6))
def test_e_learning_adds_removes_and_moves_at_least_cost(seed):
    (pattern,), (wanted,) = patterns(seed, trains=60, count=1, targets=3, spikes=3)
    weights = np.random.default_rng(seed).uniform(-2, 4, 60)
    tau_q, gamma_r = 12.0, 9.0
    change, fired = Chronotron(rule="E", tau_q=tau_q, gamma_r=gamma_r, **GIVEN).change(weights, pattern, wanted)

    def potential(t):
        return summed(pattern, t, lambda s: kernel(s, 10.0, 5.0))

    pairs = cheapest(fired, wanted, tau_q)
    expected = np.zeros(60)
    for j in set(range(3)) - {j for _, j in pairs}:
        expected += potential(wanted[j])
    for i in set(range(len(fired))) - {i for i, _ in pairs}:
        expected -= potential(fired[i])
    for i, j in pairs:
        expected += gamma_r / tau_q**2 * (fired[i] - wanted[j]) * potential(fired[i])
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)


def filled(learner):
    """The parameters as the compiled part has them, with all that was left out."""
    return _rules.check_parameters("chronotron", learner._json())


def test_time_constants_are_the_membranes_where_they_are_left_out():
    (pattern,), (wanted,) = patterns(2, trains=60, count=1)
    weights = np.full(60, 2.0)
    left_out = Chronotron(rule="E", **GIVEN).change(weights, pattern, wanted)[0]
    given = Chronotron(rule="E", tau_q=10.0, gamma_r=10.0, **GIVEN).change(weights, pattern, wanted)[0]
    assert left_out.tobytes() == given.tobytes()
    assert filled(Chronotron(rule="E", **{**GIVEN, "tau": 15.0}))["tau_s"] == 5.0
    named = {k: v for k, v in GIVEN.items() if k not in ("tau", "tau_s")}
    assert filled(Chronotron(rule="E", **named))["tau_s"] == 3.75


@pytest.mark.parametrize("targets", [1, 3])
def test_i_learning_goes_by_currents_with_the_sign_of_the_weight(targets):
    def current(s):
        return np.where(s >= 0, np.exp(-np.maximum(s, 0) / 5.0), 0.0)

    change, sides, weights, _ = change_and_formula(Chronotron(rule="I", **GIVEN), current, targets, seed=3)
    assert change == pytest.approx(np.sign(weights) * sides, rel=1e-9, abs=1e-12)
