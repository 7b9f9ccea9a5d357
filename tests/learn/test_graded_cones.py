"""ConeR and ConeX on graded trains: against 6.9 to 6.11 stated plainly, and against unsigned trains."""

from __future__ import annotations

import numpy as np
import pytest
import stated
from draws import mixed
from making import made
from simulator import misfire

from taxel import SpikeTrains
from taxel.learn import ConeR, ConeX, check_certificate

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


def wide(random, n):
    """Values of either sign over twelve decades."""
    return random.choice([-1, 1], n) * 10 ** random.uniform(-6, 6, n)


def test_a_target_that_only_negative_weights_reach_is_reachable():
    one = SpikeTrains.from_lists([[10.0]], stop=60.0, values=[[-1.0]], kind="graded")
    for lb, ub, unreachable in ((-2.0, 0.0, []), (0.0, 2.0, [(0, 0)])):
        assert made(ConeR, lb=lb, ub=ub, tau=10.0).fit([one], [[18.0]]).unreachable_ == unreachable


@pytest.mark.parametrize(
    ("time", "after_spike", "decades"), mixed(["grid", "continuous"], ["keep", "ignore", "reset"], [1, 6])
)
def test_what_is_solved_fires_at_its_targets_and_what_is_not_is_proven(time, after_spike, decades):
    solved = refuted = 0
    for seed in (0, 3, 5):
        patterns, targets = stated.examples(seed, trains=5 + 8 * seed, patterns=3, targets=1, whole_ms=time == "grid")
        values = wide if decades == 6 else lambda random, n: random.choice([-1, 1], n) * 10 ** random.uniform(-1, 1, n)
        patterns = stated.graded(patterns, seed, values)
        # On a grid a margin keeps the points beside targets below the threshold.
        margin = {"margin": 1e-3} if time == "grid" else {}
        cone = made(ConeX, time=time, after_spike=after_spike, lb=-2, ub=2, **margin).fit(patterns, targets)
        if cone.status_ == "solved":
            solved += 1
            for pattern, wanted in zip(patterns, targets, strict=True):
                if time == "continuous":
                    assert misfire(cone.neuron_, cone.weights_, pattern, wanted, pattern.stop) is None
                else:
                    assert np.allclose(cone.neuron_.run(cone.weights_, pattern), wanted, rtol=0, atol=1e-6)
        else:
            refuted += 1
            assert cone.status_ == "infeasible", (seed, cone.status_)
            proof, problem = cone.certificate_, cone.problem_
            assert check_certificate(problem, proof)
            for row in proof.rows:
                coefficients, _ = problem.row(row)
                own = patterns[row.pattern]
                at = row.at if row.kind == "silence" else targets[row.pattern][int(row.at)]
                if row.kind != "slope":
                    fired = [t for t in targets[row.pattern] if t < at]
                    plain = stated.row(cone, own, at, fired)
                    assert np.allclose(coefficients, plain, rtol=1e-9, atol=1e-12 * abs(own.values).max())
    assert solved
    assert refuted
