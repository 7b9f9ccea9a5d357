"""Weights that are "solved" fire at their targets and nowhere else in a simulator that is not the package's."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from making import made
from simulator import misfire
from test_solved_is_true import KINDS

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_certificate, check_solution

#: Further problems are tried by `pytest -m slow`: 3500 in all.
QUICK, ALL = 4, 500

LAMBDAS = [(0, 1, 0), (1, 0, 0), (2, 2, 200), (0, 0, 1)]


def drawn_neuron(random, **fixed):
    drawn = {
        "tau": float(random.choice([2.0, 5.0, 15.0])),
        "kernel": str(random.choice(["alpha", "double_exponential"])),
        "theta_plus": float(random.choice([0.0, 0.05, 0.2])),
        "tau_rec": random.choice([None, 3.0, 100.0]),
        "after_spike": str(random.choice(["keep", "ignore", "reset"])),
        "first_threshold": str(random.choice(["theta_0", "printed"])),
        "refractory": float(random.choice([1.0, 3.0, 8.0])),
    }
    return Neuron(**(drawn | fixed))


def problem(random, neuron, start, near, margin=None):
    """One to three patterns; `near` draws inputs beside the targets and the ends of refractory times."""
    trains, lists, wanted = int(random.integers(8, 40)), [], []
    for _ in range(int(random.integers(1, 4))):
        own = start + np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        stop = own[-1] + 20
        times = [list(random.uniform(start, stop - 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 7), replace=False):
            times[n].append(near(float(random.choice(own))))
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], start=start, stop=stop))
        wanted.append(own.tolist())
    return ConeX(neuron=neuron, lambdas=LAMBDAS[random.integers(4)], lb=-2, ub=2, margin=margin), lists, wanted


def before_targets(seed):
    """Inputs 1e-8 to 1e-4 ms before targets, several of them before one."""
    random = np.random.default_rng([22, seed])
    return problem(random, drawn_neuron(random), 0.0, lambda t: t - 10 ** random.uniform(-8, -4))


def close(seed):
    """Inputs 1e-10 to 1e-7 ms apart around targets and the ends of refractory times."""
    random = np.random.default_rng([51, seed])
    neuron = drawn_neuron(random)

    def near(t):
        return t + neuron.refractory * random.integers(2) + random.integers(-5, 6) * 10.0 ** random.integers(-10, -6)

    return problem(random, neuron, 0.0, near)


def far(seed):
    """An hour to a year before or after time 0; inputs up to three neighbouring times beside targets."""
    random = np.random.default_rng([52, seed])
    neuron, start = drawn_neuron(random), float(random.choice([-1, 1]) * 10 ** random.uniform(6.5, 10.5))

    def near(t):
        t += neuron.refractory * random.integers(2)
        return float(t + random.integers(-3, 4) * np.spacing(abs(t)))

    return problem(random, neuron, start, near)


def grid(seed):
    """Targets whose quotient with the step rounds either way, stated as products and as sums; inputs beside points."""
    random = np.random.default_rng([53, seed])
    step = float(random.choice([0.1, 0.3, 0.7, 1.0, 0.05, 0.192]))
    start = float(random.choice([0.0, 0.3, -17.1, 1000.1, -1e5, 1e7, 8.64e7]))
    neuron = drawn_neuron(
        random, tau=20 * step, time="grid", step_ms=step, refractory=float(random.choice([3, 8, 50.5])) * step,
        kernel=str(random.choice(["alpha", "double_exponential", "exponential"])),
    )  # fmt: skip
    points = np.cumsum(random.integers(70, 200, random.integers(1, 4)))
    own = [start + k * step if random.random() < 0.5 else start + round(float(k * step), 6) for k in points]
    stop, lists = start + (points[-1] + 60) * step, []
    for _ in range(int(random.integers(8, 30))):
        times = start + (random.choice(points[-1], random.integers(1, 4)) - random.choice([0.0, 0.5, 0.9])) * step
        if random.random() < 0.3:
            times[0] = random.choice(own) + random.choice([-0.9 * step, -1e-10, 0, 1e-10, neuron.refractory])
        lists.append(np.sort(np.clip(times, start, stop)))
    # A margin below the rounding of potentials far from 0 is another test's.
    margin = max(float(random.choice([1e-9, 1e-6, 1e-4])), 1e-14 * start)
    cone = ConeX(neuron=neuron, lambdas=LAMBDAS[random.integers(4)], lb=-5, ub=5, margin=margin)
    return cone, [SpikeTrains.from_lists(lists, start=start, stop=stop)], [own]


def at_targets(seed):
    """Graded patterns with inputs at targets and up to 1e-8 ms behind them."""
    random = np.random.default_rng([61, seed])
    trains, lists, wanted = int(random.integers(8, 60)), [], []
    largest = float(random.choice([0.1, 0.5]))
    for _ in range(int(random.integers(1, 4))):
        own = np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        stop = float(own[-1]) + 20
        times = [list(random.uniform(0, stop - 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 7), replace=False):
            times[n].append(float(random.choice(own)) + float(random.choice([0.0, 1e-12, 1e-10, 1e-9, 1e-8])))
        values = [random.choice([-1, 1], len(one)) * 10 ** random.uniform(-largest, largest, len(one)) for one in times]
        times = [np.sort(one) for one in times]
        lists.append(SpikeTrains.from_lists(times, stop=stop, values=values, kind="graded"))
        wanted.append(own.tolist())
    bound = float(random.choice([0.3, 2.0, 100.0]))
    neuron, lambdas = drawn_neuron(random), LAMBDAS[random.integers(4)]
    return ConeX(neuron=neuron, lambdas=lambdas, lb=-bound, ub=bound), lists, wanted


SIMULATED = {
    "at_targets": at_targets,
    "before_targets": before_targets, "close": close, "far": far, "grid": grid,
    **{kind: KINDS[kind] for kind in ("beside", "just_before", "lifted")},
}  # fmt: skip


def refuted(cone, patterns, targets):
    """A difference between weights that are solved and the simulator; None where there is none."""
    for pattern, times in zip(patterns, targets, strict=True):
        wrong = misfire(cone.neuron_, cone.weights_, pattern, times, max(pattern.stop, times[-1] + cone.neuron_.tau))
        if wrong is not None:
            return wrong
    return None


def simulated(kind, seed):
    """Fit; run solved weights in the simulator, check proofs; return the status."""
    cone, patterns, targets = SIMULATED[kind](seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cone.fit(patterns, targets)
    if cone.status_ == "solved":
        assert refuted(cone, patterns, targets) is None, f"{kind}, seed {seed}"
    if cone.status_ == "infeasible":
        assert check_certificate(cone.problem_, cone.certificate_), f"{kind}, seed {seed}"
    return cone.status_


@pytest.mark.parametrize("kind", SIMULATED)
def test_what_is_solved_fires_at_its_targets_alone(kind):
    ended = [simulated(kind, seed) for seed in range(QUICK)]
    assert ended.count("solved") >= QUICK / 4
    assert "stopped" not in ended


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("kind", SIMULATED)
def test_thousands_that_are_solved_fire_at_their_targets_alone(kind):
    ended = [simulated(kind, seed) for seed in range(QUICK, ALL)]
    assert ended.count("stopped") <= ALL / 100


@pytest.mark.parametrize("after_rounds", ["first", "feasible"])
def test_a_search_that_ended_early_is_feasible_where_the_neuron_accepts_its_weights(after_rounds):
    """Ended by an exception of `progress`: after the first round, or after the first with weights that satisfy all."""
    ended = []
    for seed in range(12):
        cone, patterns, targets = KINDS["just_before"](seed)
        cone.set_params(lambdas=(1, 0, 0))

        def progress(_round, _rows, broken, _objective):
            if after_rounds == "first" or broken == 0:
                raise StopIteration

        try:
            cone.fit(patterns, targets, progress=progress)
        except StopIteration:
            ended.append(cone.status_)
            if cone.status_ == "feasible":
                assert refuted(cone, patterns, targets) is None, f"seed {seed}"
                assert check_solution(cone, patterns, targets), f"seed {seed}"
                assert cone.gap_ > cone.tolerance
                assert "objective" in cone.reason_
            elif cone.status_ == "stopped":
                assert "pattern" in cone.reason_
                assert " ms" in cone.reason_
    assert ended.count("feasible" if after_rounds == "feasible" else "stopped") > 6


@pytest.mark.parametrize("after_spike", ["keep", "reset"])
def test_a_stopped_fit_names_the_pattern_and_the_time(after_spike):
    found = None
    for seed in range(30):
        _, patterns, targets = KINDS["just_before"](seed)
        cone = made(ConeX, after_spike=after_spike, lb=-2, ub=2, lambdas=(1, 0, 0), max_seconds=1e-9)
        cone.fit(patterns, targets)
        if cone.status_ == "stopped":
            found = cone.reason_
            assert "max_seconds" in found
            assert "pattern" in found
            assert " ms" in found
    assert found is not None
