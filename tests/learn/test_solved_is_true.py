"""Whatever says "solved" is run, and looked at from outside: pauses of an hour, inputs next to targets."""

from __future__ import annotations

import numpy as np
import pytest
from bruteforce import looked_at

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_certificate

#: Further problems are tried by `pytest -m slow`.
QUICK, ALL = 60, 1000


def judged(cone, patterns, targets, *, margin=1e-3):
    """Fit; hold against the neuron and the sums what the fit says; give the verdict."""
    cone.fit(patterns, targets)
    said = f"{cone}: {cone.status_}, violation {cone.violation_}, margin {cone.margin_}, gap {cone.gap_}"
    if cone.status_ == "infeasible":
        assert check_certificate(cone.problem_, cone.certificate_), said
        return cone.status_
    assert cone.status_ == "solved", said
    assert min(cone.margin_) >= 0.5 * margin * (1 - 1e-3), said
    for pattern, times in zip(patterns, targets, strict=True):
        fired = cone.neuron_.run(cone.weights_, pattern)
        assert len(fired) == len(times), f"{said}: fires at {fired[:9]}, not at {times}"
        assert np.abs(fired - times).max(initial=0) <= 1e-6, f"{said}: {fired - times}"
        missed, room, slope = looked_at(cone.neuron_, cone.weights_, pattern, times)
        assert missed <= 2e-12, f"{said}: {missed}"
        assert room >= 0.499 * min(cone.margin_), f"{said}: {room}"
        assert slope >= 0.499 * cone.margin_.slope, f"{said}: {slope}"
    return cone.status_


@pytest.mark.parametrize("theta_plus", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("stop", [100.0, 2500.0, 60e3, 3.6e6])
@pytest.mark.parametrize("tau", [0.5, 15.0])
def test_a_long_pause_behind_the_target_is_silent(tau, stop, theta_plus):
    trains = SpikeTrains.from_lists([[0.0], [3.0], [10.0]], stop=stop)
    # With .5 ms the kernel would have its top at 10.5 ms, where no potential comes up to a target from below.
    target = 10.5 if tau == 15.0 else 10.3
    assert judged(ConeX(neuron=Neuron(tau=tau, theta_plus=theta_plus), lb=-3, ub=3), [trains], [[target]]) == "solved"


def paused(seed):
    """Bursts of inputs with pauses of up to an hour between them, and a target in some of them."""
    random = np.random.default_rng([17, seed])
    tau = float(random.choice([0.5, 2.0, 15.0]))
    trains, lists, wanted = int(random.integers(8, 25)), [], []
    for _ in range(int(random.integers(1, 4))):
        at, times, own = 0.0, [[] for _ in range(trains)], []
        for burst in range(int(random.integers(1, 4))):
            for n in range(trains):
                times[n] += list(at + np.sort(random.uniform(0, 4 * tau, random.integers(0, 3))))
            if random.random() < 0.8 or burst == 0:
                own.append(at + random.uniform(2, 4) * tau)
            at += 4 * tau + 4.0 + float(10 ** random.uniform(0, np.log10(3.6e6)))
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], stop=at))
        wanted.append(own)
    cone = ConeX(
        neuron=Neuron(
            tau=tau,
            kernel=str(random.choice(["alpha", "double_exponential"])),
            theta_plus=float(random.choice([0.0, 0.05, 0.2])),
            tau_rec=random.choice([None, 0.5, 200.0]),
            after_spike=str(random.choice(["keep", "ignore", "reset"])),
            first_threshold=str(random.choice(["theta_0", "printed"])),
        ),
        lambdas=[(0, 1, 0), (0, 1, 0), (1, 0, 0), (2, 2, 200)][random.integers(4)],
        lb=-3,
        ub=3,
    )
    return cone, lists, wanted


def beside(seed):
    """Inputs within 1e-10 to 1e-6 ms of targets, before and behind."""
    random = np.random.default_rng([18, seed])
    trains, lists, wanted = int(random.integers(10, 40)), [], []
    for _ in range(int(random.integers(1, 4))):
        own = np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        times = [list(random.uniform(0, own[-1] + 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 6), replace=False):
            near = 10 ** random.uniform(-10, -6.3) * random.choice([-1, 1])
            times[n].append(float(random.choice(own)) + near)
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], stop=own[-1] + 20))
        wanted.append(own.tolist())
    cone = ConeX(
        neuron=Neuron(
            kernel=str(random.choice(["alpha", "double_exponential"])),
            theta_plus=float(random.choice([0.0, 0.05, 0.2])),
            after_spike=str(random.choice(["keep", "ignore", "reset"])),
        ),
        lambdas=[(0, 1, 0), (1, 0, 0), (2, 2, 200), (0, 0, 1)][random.integers(4)],
        lb=-2,
        ub=2,
    )
    return cone, lists, wanted


def lifted(seed):
    """B alone."""
    random = np.random.default_rng([19, seed])
    trains, patterns = int(random.integers(10, 60)), int(random.integers(1, 6))
    lists = [
        SpikeTrains.from_lists([np.sort(random.uniform(0, 90, random.integers(1, 4))) for _ in range(trains)], stop=100)
        for _ in range(patterns)
    ]
    wanted = [np.sort(random.choice([[30.0], [70.0], [55.5]]))[:1].tolist() for _ in range(patterns)]
    wide = float(random.choice([0.3, 1.0, 3.0, 30.0]))
    cone = ConeX(neuron=Neuron(after_spike=str(random.choice(["keep", "reset"]))), lambdas=(0, 0, 1), lb=-wide, ub=wide)
    return cone, lists, wanted


KINDS = {"paused": paused, "beside": beside, "lifted": lifted}


@pytest.mark.parametrize("kind", KINDS)
def test_what_says_solved_fires_at_its_targets_and_nowhere_else(kind):
    said = [judged(*KINDS[kind](seed)) for seed in range(QUICK)]
    assert said.count("solved") > QUICK / 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_that_say_solved_fire_at_their_targets_and_nowhere_else(kind):
    for seed in range(QUICK, ALL):
        judged(*KINDS[kind](seed))
