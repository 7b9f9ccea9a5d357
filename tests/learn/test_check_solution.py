"""`check_solution` against the neuron itself: it holds where the neuron fires at the targets and nowhere else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from draws import mixed
from making import made
from problems import KINDS
from refusal import refused
from stated import examples, graded

from taxel import Neuron, NotFittedError, ProblemError, SpikeTrains
from taxel.learn import ConeX, check_solution


def fitted(weights, neuron):
    """A fit with other weights: the check reads its parameters and its weights."""
    trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    cone = ConeX(neuron=Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    cone.set_params(neuron=neuron, lb=-1e9, ub=1e9)
    cone.neuron_, cone.weights_ = neuron, weights
    return cone


@pytest.mark.parametrize(("kernel", "after_spike"), mixed(["alpha", "double_exponential"], ["keep", "ignore", "reset"]))
def test_any_weights_hold_with_the_spikes_of_the_neuron_and_with_no_others(kernel, after_spike):
    fired_in_all = held = 0
    for seed in range(12):
        random = np.random.default_rng([31, seed])
        neuron = Neuron(
            tau=float(random.choice([3.0, 15.0])),
            kernel=kernel,
            after_spike=after_spike,
            theta_plus=float(random.choice([0.0, 0.2, 1.0])),
            first_threshold=str(random.choice(["theta_0", "printed"])),
        )
        (pattern,), _ = examples(seed, trains=12, patterns=1, targets=0, duration=150.0)
        if seed % 2:
            (pattern,) = graded([pattern], seed)
        weights = random.normal(0.1, 0.4, 12)
        cone = fitted(weights, neuron)
        fired = neuron.run(weights, pattern)
        fired_in_all += len(fired)
        found = check_solution(cone, [pattern], [fired])
        # Silence is required up to tau after the last target, where the neuron, run to the pattern's stop, may fire.
        if len(neuron.run(weights, pattern.lasting(1e4))) == len(fired):
            assert found, f"seed {seed}: {found.wrong}"
            held += 1
        for k in range(len(fired)):
            wrong = check_solution(cone, [pattern], [np.delete(fired, k)])
            assert not wrong
            assert "silence" in wrong.wrong
        quiet = [t for t in np.linspace(1, 149, 20) if np.abs(fired - t).min(initial=99) > 4]
        for t in quiet[:5]:
            assert not check_solution(cone, [pattern], [np.sort(np.append(fired, t))])
    assert fired_in_all > 12
    assert held > 6


@pytest.mark.parametrize("side", [-1, 1])
def test_a_touch_between_two_inputs_is_seen_however_short_it_is(side):
    neuron, pattern = Neuron(tau=15.0), SpikeTrains.from_lists([[10.0]], stop=4e5)
    highest = neuron.theta_0 * np.e
    for apart in (1e-3, 1e-6, 1e-9):
        cone = fitted(np.array([highest * (1 + side * apart)]), neuron)
        found = check_solution(cone, [pattern], [[]])
        assert found.holds == (side < 0)
        assert found.room_mv <= 0.3 * (apart + 1e-3)


@pytest.mark.parametrize("kind", ["usual", "before", "close", "paused", "lifted"])
def test_room_and_slope_are_those_of_many_instants(kind):
    held = 0
    for seed in range(8):
        cone, patterns, targets = KINDS[kind](seed)
        cone.fit(patterns, targets)
        if cone.status_ == "infeasible":
            continue
        found = check_solution(cone, patterns, targets)
        assert found, found.wrong
        held += 1
        room, slope, problem = np.inf, np.inf, cone.problem_
        for p, (pattern, times) in enumerate(zip(patterns, targets, strict=True)):
            edges = np.unique([pattern.start, *pattern.times, *times, *np.array(times) + cone.neuron_.refractory])
            between = [np.linspace(a, b, 40) for a, b in pairwise(edges)]
            t = np.unique(np.concatenate([*between, *(t - np.geomspace(1e-6, 1, 200) for t in times)]))
            potential = cone.neuron_.potential(cone.weights_, pattern, t, spikes=times)
            for at, u in zip(t, potential, strict=True):
                try:
                    _, limit = problem.silence(p, at, margin=False)
                except ProblemError:
                    continue
                room = min(room, (limit - u) / min([1.0, *(x - at for x in times if x >= at)]))
            for k in range(len(times)):
                coefficients, limit = problem.slope(p, k, margin=False)
                slope = min(slope, limit - coefficients @ cone.weights_)
        assert 0 < found.room_mv <= 1.05 * room + 1e-12
        assert found.slope == pytest.approx(slope, rel=1e-9, abs=1e-12)
    assert held


LATE = [1e-10, 1e-9, 3.3e-9, 3.4e-9, 6.7e-9, 1e-8, 1e-6]


@pytest.mark.parametrize("share", LATE)
def test_a_crossing_up_to_1e_6_ms_behind_the_target_is_right_and_a_later_one_is_wrong(share):
    trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    cone = ConeX(neuron=Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    cone.weights_ = (1 - share) * cone.weights_
    (fired,) = cone.neuron_.run(cone.weights_, trains)
    assert fired > 20.0
    found = check_solution(cone, [trains], [[20.0]])
    assert found.holds == (fired - 20.0 <= 1e-6) == (share < 3.35e-9)
    assert found.holds or "does not fire at target 0" in found.wrong


@pytest.mark.parametrize("time", ["continuous", "grid"])
def test_numpy_finds_alone_what_is_wrong(time, monkeypatch):
    """The neuron says that it fires at the targets, whatever its weights."""
    patterns, targets = examples(3, trains=60, patterns=1, targets=2, whole_ms=True)
    cone = made(ConeX, time=time, lb=-2, ub=2, margin=1e-6).fit(patterns, targets)
    monkeypatch.setattr(Neuron, "run", lambda *_: np.array(targets[0]))
    assert check_solution(cone, patterns, targets)
    cone.set_params(lb=-9, ub=9)
    weights = cone.weights_
    for factor, said in ((1 - 1e-4, "target 0"), (3.0, "silence")):
        cone.weights_ = factor * weights
        assert said in check_solution(cone, patterns, targets).wrong


def test_on_a_grid_a_margin_decides_and_a_target_is_a_point():
    patterns, targets = examples(5, trains=60, patterns=3, targets=1, whole_ms=True)
    cone = made(ConeX, time="grid", lb=-1, ub=1, margin=1e-6).fit(patterns, targets)
    found = check_solution(cone, patterns, targets)
    assert found, found.wrong
    assert found.room_mv == pytest.approx(cone.margin_.mv, rel=1e-6)
    assert all(np.allclose(cone.neuron_.run(cone.weights_, p), t) for p, t in zip(patterns, targets, strict=True))
    held = set()
    for seed in range(5, 15):
        others, wanted = examples(seed, trains=60, patterns=3, targets=1, whole_ms=True)
        touching = made(ConeX, time="grid", lb=-1, ub=1).fit(others, wanted)
        fires = all(
            np.array_equal(touching.neuron_.run(touching.weights_, p), t) for p, t in zip(others, wanted, strict=True)
        )
        assert check_solution(touching, others, wanted).holds == fires, f"seed {seed}"
        held.add(fires)
    assert held == {False, True}
    between = [t + 0.5 for t in targets]
    cone.fit(patterns, between)
    assert "is between two time steps" in check_solution(cone, patterns, between).wrong


def test_what_cannot_be_checked_is_one_clear_error():
    patterns, targets = examples(3, trains=12, patterns=8, targets=1)
    with refused(NotFittedError):
        check_solution(ConeX(), patterns, targets)
    cone = ConeX(lb=-0.1, ub=0.1).fit(patterns, targets)
    with refused(argument="cone"):
        check_solution(cone, patterns, targets)
    with refused(argument="cone"):
        check_solution(Neuron(), patterns, targets)
    cone = ConeX(lb=-9, ub=9).fit(patterns[:1], targets[:1])
    with refused():
        check_solution(cone, patterns[:2], targets[:1])
