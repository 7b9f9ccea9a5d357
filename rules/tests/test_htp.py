"""HTP against its definition, and its demands against the rows of CONE-X."""

import numpy as np
import pytest
from making import made
from rule_examples import kernel, patterns

from taxel.learn import ConeX, ConeXProblem
from taxel_rules import HTP

GIVEN = {"initial": (0.0, 1.0), "updates": "pattern", "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}
STEP = 0.1


def cone_x_rows(pattern, targets):
    """6.9 with after_spike "reset", no refractory time, no threshold rise, on the grid: target rows, silent rows."""
    times = STEP * np.arange(int(pattern.stop / STEP + 1e-9) + 1)
    times = times[np.min(np.abs(times[:, None] - targets[None]), axis=1) >= 1e-9]

    def rows(at):
        earlier = np.searchsorted(targets, at)
        lost_up_to = np.concatenate([[-np.inf], targets])[earlier][:, None]
        return np.stack(
            [(kernel(at[:, None] - train[None], 10.0, 5.0) * (train[None] > lost_up_to)).sum(1) for train in pattern], 1
        )

    return rows(targets), rows(times), times


def demands(learner, pattern, targets, weights):
    """What HTP corrects, stated from those rows: missed targets, and the peak of each stretch above the threshold."""
    at, silent, times = cone_x_rows(pattern, targets)
    change = at[at @ weights < 15.0].sum(0) if np.any(at @ weights < 15.0) else np.zeros(len(pattern))
    free = np.array([np.any((targets - learner.window_ms <= t) & (t <= targets)) for t in times])
    u, stretch = silent @ weights, []
    for k in range(len(times) + 1):
        over = k < len(times) and u[k] >= 15.0 and not free[k]
        apart = stretch and k < len(times) and np.any((targets > times[stretch[-1]]) & (targets < times[k]))
        if stretch and (not over or apart):
            change = change - silent[max(stretch, key=lambda j: u[j])]
            stretch = []
        if over:
            stretch.append(k)
    return change


@pytest.mark.parametrize("window", [0.0, 3.0])
@pytest.mark.parametrize("seed", range(5))
def test_what_is_corrected_are_broken_rows_of_cone_x(window, seed):
    (pattern,), (wanted,) = patterns(seed, trains=60, count=1, targets=3, spikes=3)
    weights = np.random.default_rng(seed).uniform(-1, 4, 60)
    learner = HTP(window_ms=window, eta=1.0, epochs=1, **GIVEN)
    change, _ = learner.change(weights, pattern, wanted)
    assert change.any()
    assert change == pytest.approx(demands(learner, pattern, wanted, weights), rel=1e-9, abs=1e-9)


def cone_x(**options):
    """CONE-X with HTP's neuron: no refractory time, no threshold rise; bounds far out."""
    bare = {"theta_plus": 0.0, "refractory": 0.0, "after_spike": "reset", "lb": -50.0, "ub": 50.0}
    kernel = {"kernel": "double_exponential", "tau": 10.0, "tau_s": 5.0, "theta_0": 0.3}
    return made(ConeX, **bare, **kernel, time="grid", step_ms=STEP, **options)


@pytest.mark.parametrize("seed", range(3))
def test_the_rows_that_cone_x_states_are_those_of_htp(seed):
    (pattern,), (wanted,) = patterns(seed, trains=30, count=1, targets=3, spikes=3)
    problem = ConeXProblem(cone_x(), [pattern], [wanted])
    at, silent, times = cone_x_rows(pattern, wanted)
    for k in range(3):
        coefficients, limit = problem.target(0, k)
        assert coefficients == pytest.approx(at[k], abs=1e-12)
        assert limit == pytest.approx(0.3)
    for k in range(0, len(times), 37):
        coefficients, limit = problem.silence(0, times[k])
        assert coefficients == pytest.approx(silent[k], abs=1e-9)
        assert limit == pytest.approx(0.3)
