"""The points of a grid: sweep, rows and neuron reckon them alike, however a quotient of times rounds."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from draws import mixed
from making import made

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, ConeX


def alpha(age, tau):
    """The kernel (6.5), 0 up to the input itself."""
    late = np.maximum(age, 0.0)
    return np.where(age > 0, late / tau * np.exp(-late / tau), 0.0)


def coefficients(trains, t, fired, neuron):
    """The row at t: inputs count from the end of the last spike's refractory time on ("reset")."""
    since = max([e + neuron.refractory + 1e-6 for e in fired if e < t - 1e-9], default=-np.inf)
    return np.array([alpha(t - train[(train > since) & (train < t - 1e-9)], neuron.tau).sum() for train in trains])


def broken(cone, trains, targets, weights):
    """D without its factor: by how much silence is broken over all grid points (6.13), one sum of kernels at a time."""
    neuron, total = cone.neuron_, 0.0
    for k in range(round((trains.stop - trains.start) / neuron.step_ms) + 1):
        t = trains.start + k * neuron.step_ms
        if any(e - 1e-9 <= t <= e + neuron.refractory + 1e-9 for e in targets):
            continue
        total += max(0.0, coefficients(trains, t, targets, neuron) @ weights - neuron.theta_0)
    return total


def test_a_reset_at_a_target_whose_quotient_rounds_down_takes_every_input_before_it():
    neuron = Neuron(tau=10.0, time="grid", step_ms=0.1, refractory=5.0, after_spike="reset", theta_plus=0.0)
    trains = SpikeTrains.from_lists([[72.21], [90.0], [71.0]], stop=150.0)
    said = {}
    for target in (72.3, 72.4):
        cone = ConeX(neuron=neuron, lb=[-1, 0.9, 0], ub=[-1, 0.9, 5]).fit([trains], [[target]])
        said[target] = cone.status_
    assert said == {72.3: "infeasible", 72.4: "infeasible"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cone = ConeR(neuron=neuron, lb=[-1, 0.9, 0], ub=[-1, 0.9, 5], lambdas=(0, 0, 0, 1, 1)).fit([trains], [[72.3]])
    most = np.array([1.0, 0.9, 5.0])
    shared = broken(cone, trains, [72.3], cone.weights_) / broken(cone, trains, [72.3], most) / 2
    assert shared > 0
    assert cone.parts_["D"] == pytest.approx(shared, rel=1e-9)


#: Steps, and starts, for which quotients of times round up and down.
STEPS = [0.1, 0.3, 0.7, 1.0, 0.05]
STARTS = [0.0, 0.3, -17.1, 1000.1, -1e5, 1e7]


def drawn(seed, start, step):
    """Inputs next to the points of a grid, and a target on a point, stated as a product or as a sum."""
    random = np.random.default_rng([31, seed])
    lists = []
    for _ in range(14):
        points = np.sort(random.choice(np.arange(5, 400), random.integers(1, 4), replace=False))
        lists.append(start + (points - random.choice([0.0, 0.9, 0.5], len(points))) * step)
    k = int(random.integers(150, 300))
    target = start + k * step if random.random() < 0.5 else float(repr(start + round(k * step, 6)))
    # An input in the step before the target: of all it is the one that a reset a step late leaves behind.
    lists.append(np.array([target - 0.9 * step]))
    stop = start + 420 * step
    return SpikeTrains.from_lists([np.sort(np.clip(t, start, stop)) for t in lists], start=start, stop=stop), target, k


@pytest.mark.parametrize("after_spike", ["keep", "ignore", "reset"])
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("step", STEPS)
def test_what_is_solved_on_a_grid_is_silent_but_at_its_targets(step, start, after_spike):
    solved = 0
    for seed in range(12):
        trains, target, _ = drawn(seed, start, step)
        cone = made(
            ConeX, tau=20 * step, time="grid", step_ms=step, refractory=8 * step, after_spike=after_spike,
            theta_plus=0.1, margin=1e-4, lb=-5, ub=5,
        ).fit([trains], [[target]])  # fmt: skip
        assert cone.status_ in ("solved", "infeasible"), f"seed {seed}: {cone.reason_}"
        if cone.status_ == "solved":
            fired = cone.neuron_.run(cone.weights_, trains)
            assert len(fired) == 1, f"seed {seed}: fires at {fired}, not at {target}"
            assert abs(fired[0] - target) <= 2 * np.spacing(abs(start) + abs(target)), f"seed {seed}"
            assert cone.margin_.mv >= 0.99e-4, f"seed {seed}"
            solved += 1
    assert solved > 3


def test_a_margin_below_the_resolution_of_times_is_solved_only_where_the_neuron_fires_right():
    """At 1e9 ms times are rounded by 1e-7 ms: a potential 1e-9 mV below the threshold has reached it."""
    ended = []
    for seed in range(40):
        trains, target, _ = drawn(seed, 1e9, 0.3)
        cone = made(
            ConeX, tau=6.0, time="grid", step_ms=0.3, refractory=2.4, theta_plus=0.1, margin=1e-9, lb=-5, ub=5
        ).fit([trains], [[target]])
        ended.append(cone.status_)
        fired = [] if cone.status_ == "infeasible" else cone.neuron_.run(cone.weights_, trains)
        if cone.status_ == "solved":
            assert len(fired) == 1, f"seed {seed}: fires at {fired}, not at {target}"
            assert abs(fired[0] - target) <= 2 * np.spacing(target), f"seed {seed}"
        if cone.status_ == "stopped":
            assert "fires at" in cone.reason_
    assert ended.count("solved") > 3
    assert ended.count("stopped") > 1


@pytest.mark.parametrize(("start", "step"), mixed([0.0, 0.3, -17.1, -1e5, 1e7], [0.1, 0.3]))
def test_d_of_cone_r_is_the_sum_over_the_points(step, start):
    for seed in range(4):
        trains, target, _ = drawn(seed, start, step)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cone = made(
                ConeR, tau=20 * step, step_ms=step, refractory=8 * step, after_spike="reset", theta_plus=0.0,
                lambdas=(1, 1, 0, 1, 1), lb=-2, ub=2, horizon=trains.stop,
            ).fit([trains], [[target]])  # fmt: skip
        by_hand = broken(cone, trains, [target], cone.weights_) / broken(cone, trains, [target], np.full(15, 2.0)) / 4
        # At 1e7 ms neighbouring times lie 2e-9 ms apart.
        assert cone.parts_["D"] == pytest.approx(by_hand, rel=1e-6, abs=1e-9), f"seed {seed}"
