"""Targets and weights that no fit has: the checks of a fit refuse them as the fit does."""

import numpy as np
import pytest
from refusal import refused

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, ConeX, check_gap, check_solution

TRAINS = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], start=2.0, stop=60.0)
GRADED = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], 2.0, 60.0, [[3e38], [-3e38], [1.0]], kind="graded")


@pytest.mark.parametrize("target", [np.nan, np.inf, -np.inf, 1e308, -1e308, 1e10, 60.000001, 1.99, 0.0, -0.0, 5e-324])
@pytest.mark.parametrize("time", ["continuous", "grid"])
@pytest.mark.parametrize("learner", [ConeX, ConeR])
@pytest.mark.parametrize("check", [check_solution, check_gap])
def test_a_target_outside_its_pattern_is_refused(check, learner, time, target):
    cone = learner(neuron=Neuron(tau=10.0, time=time), lb=-1.0, ub=1.0).fit([TRAINS], [[20.0]])
    for call in (lambda: check(cone, [TRAINS], [[target]]), lambda: cone.fit([TRAINS], [[target]])):
        with refused():
            call()
    with refused():
        check(cone, [TRAINS], [[20.0, target]])


@pytest.mark.parametrize("trains", [TRAINS, GRADED])
@pytest.mark.parametrize(
    ("kernel", "time"),
    [
        ("alpha", "continuous"),
        ("double_exponential", "continuous"),
        ("alpha", "grid"),
        ("double_exponential", "grid"),
        ("exponential", "grid"),
    ],
)
@pytest.mark.parametrize("scale", [1e308, 1e200, 1.0001e100, 1e100, 1.0, 1e-308, 5e-324, -0.0])
def test_weights_have_a_potential_or_are_refused(trains, kernel, time, scale):
    neuron, times = Neuron(tau=10.0, kernel=kernel, time=time), np.arange(2.0, 60.0)
    weights = [scale, -scale, scale]
    if scale > 1e100:
        for call in (
            lambda: neuron.potential(weights, trains, times),
            lambda: neuron.run(weights, trains),
        ):
            with refused(argument="weights"):
                call()
    else:
        assert np.isfinite(neuron.potential(weights, trains, times)).all()
        neuron.run(weights, trains)


@pytest.mark.parametrize("name", ["tau", "theta_0", "tau_rec", "step_ms"])
@pytest.mark.parametrize("value", [5e-324, 1e-308, 1e-300, 1e-101])
def test_a_parameter_by_which_nothing_can_be_divided_is_refused(name, value):
    with refused(argument=name):
        Neuron(**{name: value})
