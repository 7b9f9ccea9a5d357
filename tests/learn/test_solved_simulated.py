"""Weights that are "solved" in continuous time fire where they shall in a simulator that is not the package's."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from making import made
from simulator import misfire
from test_solved_is_true import KINDS

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX

#: Further problems are tried by `pytest -m slow`.
QUICK, ALL = 6, 2000


def before_targets(seed):
    """Inputs 1e-8 to 1e-4 ms before targets, some of them several before one, with every neuron there is."""
    random = np.random.default_rng([22, seed])
    trains, lists, wanted = int(random.integers(8, 40)), [], []
    for _ in range(int(random.integers(1, 4))):
        own = np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        times = [list(random.uniform(0, own[-1] + 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 7), replace=False):
            times[n].append(float(random.choice(own)) - 10 ** random.uniform(-8, -4))
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], stop=own[-1] + 20))
        wanted.append(own.tolist())
    neuron = Neuron(
        tau=float(random.choice([5.0, 15.0])),
        kernel=str(random.choice(["alpha", "double_exponential"])),
        theta_plus=float(random.choice([0.0, 0.05, 0.2])),
        after_spike=str(random.choice(["keep", "ignore", "reset"])),
    )
    lambdas = [(1, 0, 0), (2, 2, 200), (0, 1, 0), (0, 0, 1)][random.integers(4)]
    return ConeX(neuron=neuron, lambdas=lambdas, lb=-2, ub=2), lists, wanted


SIMULATED = {"before_targets": before_targets, **{kind: KINDS[kind] for kind in ("beside", "just_before", "lifted")}}


def simulated(kind, seed):
    """Fit; run what is solved in the simulator; give the status."""
    cone, patterns, targets = SIMULATED[kind](seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cone.fit(patterns, targets)
    if cone.status_ == "solved":
        for pattern, times in zip(patterns, targets, strict=True):
            end = max(pattern.stop, times[-1] + cone.neuron_.tau)
            wrong = misfire(cone.neuron_, cone.weights_, pattern, times, end)
            assert wrong is None, f"{kind}, seed {seed}: {wrong}"
    return cone


@pytest.mark.parametrize("kind", SIMULATED)
def test_what_is_solved_fires_at_its_targets_alone(kind):
    ended = [simulated(kind, seed).status_ for seed in range(QUICK)]
    assert ended.count("solved") > QUICK / 3
    assert ended.count("stopped") <= 1, "inputs just before a target are no reason to end without a verdict"


@pytest.mark.slow
@pytest.mark.parametrize("kind", SIMULATED)
def test_thousands_that_are_solved_fire_at_their_targets_alone(kind):
    ended = [simulated(kind, seed).status_ for seed in range(QUICK, ALL)]
    assert ended.count("stopped") <= ALL / 500


@pytest.mark.parametrize("after_spike", ["keep", "reset"])
def test_a_stopped_fit_names_the_pattern_and_the_time(after_spike):
    """Stopped before the first round: nothing is met yet."""
    found = None
    for seed in range(30):
        cone, patterns, targets = KINDS["just_before"](seed)
        cone = made(ConeX, after_spike=after_spike, lb=-2, ub=2, lambdas=(1, 0, 0), max_seconds=1e-9)
        cone.fit(patterns, targets)
        if cone.status_ == "stopped":
            found = cone.reason_
            assert "max_seconds" in found
            assert "pattern" in found or "objective" in found, found
    assert found is not None
