"""Objectives of l1, norms and B (6.11) against CVXPY handed every row of the grid, and the bound beside its optimum."""

from __future__ import annotations

import numpy as np
import pytest
from draws import mixed
from making import made

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX

cp = pytest.importorskip("cvxpy")

TAU, THETA_0, THETA_PLUS, REFRACTORY = 10.0, 0.3, 0.2, 3.0


def draw(seed, trains=25, patterns=3, end=60):
    """Draw one or two spikes a train on whole ms, and a target or two a pattern."""
    random = np.random.default_rng(seed)
    spikes = [
        [np.unique(random.integers(1, end, random.integers(1, 3))) for _ in range(trains)] for _ in range(patterns)
    ]
    targets = [np.array([30.0, 52.5][: 1 + p % 2]) for p in range(patterns)]
    trained = [SpikeTrains.from_lists([s.astype(float) for s in one], stop=float(end)) for one in spikes]
    return spikes, trained, targets


def row(spikes, t, after=-np.inf):
    """Coefficients of the potential at `t`, inputs up to `after` lost."""
    ages = [t - s[(s < t) & (s > after)] for s in spikes]
    return np.array([np.sum(a / TAU * np.exp(-a / TAU)) for a in ages])


def threshold(t, targets):
    """Threshold at `t`; the neuron fired at the targets before."""
    past = targets[targets < t]
    rise = THETA_PLUS * np.exp(-(t - past[-1] - REFRACTORY) / (2 * TAU)) if len(past) else 0.0
    return THETA_0 + rise


def statement(spikes, targets, reset, end):
    """State every row: at the targets, behind them, and in silence."""
    at, behind, theta, silent, limit = [], [], [], [], []
    for one, times in zip(spikes, targets, strict=True):
        for k, t in enumerate(times):
            lost = times[k - 1] + REFRACTORY if reset and k else -np.inf
            at.append(row(one, t, lost))
            behind.append(row(one, t + 0.1 * TAU, lost))
            theta.append(threshold(t, times))
        for t in np.arange(end + 1.0):
            past = times[times < t]
            if t not in times and not (len(past) and t <= past[-1] + REFRACTORY):
                silent.append(row(one, t, past[-1] + REFRACTORY if reset and len(past) else -np.inf))
                limit.append(threshold(t, times))
    return tuple(map(np.array, (at, behind, theta, silent, limit)))


def optimum(cone, rows):
    """Minimise 6.11 with CVXPY; give its terms and its least value."""
    at, behind, theta, silent, limit = rows
    trains = at.shape[1]
    lower, upper = (np.broadcast_to(b, trains) for b in (cone.lb, cone.ub))
    most = np.maximum(np.abs(lower), np.abs(upper))
    share = np.array(cone.lambdas, float) / np.sum(cone.lambdas)
    largest = np.sum((behind @ most + cone.kappa * theta) ** 2)
    square = cone.norm == "square"
    share /= [
        most.sum(),
        most @ most if square else np.sqrt(most @ most),
        len(theta) if cone.divide_b_by == "targets" else largest,
    ]
    w = cp.Variable(trains)
    terms = [
        cp.norm1(w),
        cp.sum_squares(w) if square else cp.norm(w, 2),
        cp.sum_squares(behind @ w - cone.kappa * theta),
    ]
    scale = 1 / share.max()
    objective = sum(scale * s * term for s, term in zip(share, terms, strict=True) if s > 0)
    problem = cp.Problem(cp.Minimize(objective), [at @ w == theta, silent @ w <= limit, w >= lower, w <= upper])
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-12, tol_gap_rel=1e-10, tol_feas=1e-11)
    return share, problem.value / scale


LAMBDAS = [(1, 0, 0), (2, 2, 200), (1, 4, 0), (4, 1, 0), (0, 2, 100), (1, 0, 100), (0, 0, 1)]


@pytest.mark.parametrize(
    ("lambdas", "reset", "options"),
    mixed(LAMBDAS, [False, True], [{}, {"norm": "square"}, {"divide_b_by": "targets", "kappa": 1.08}]),
    ids=str,
)
def test_the_objective_is_the_least_and_the_bound_lies_below_it(lambdas, reset, options):
    spikes, trains, targets = draw(seed=3)
    after = "reset" if reset else "keep"
    cone = made(
        ConeX, time="grid", tau=TAU, after_spike=after, lambdas=lambdas, lb=-2.0, ub=2.0, horizon=60.0, **options
    )
    cone.fit(trains, targets)
    rows = statement(spikes, targets, reset, 60)
    share, least = optimum(cone, rows)
    assert cone.status_ == "solved"
    at, behind, theta, silent, limit = rows
    w = cone.weights_
    length = np.linalg.norm(w)
    terms = [
        np.abs(w).sum(),
        length**2 if cone.norm == "square" else length,
        np.sum((behind @ w - cone.kappa * theta) ** 2),
    ]
    assert cone.objective_ == pytest.approx(share @ terms, rel=1e-12, abs=1e-15)
    # An objective next to 0 beside that of no weights is 0 to the oracle.
    nothing = 1e-9 * share[2] * np.sum((cone.kappa * theta) ** 2)
    assert cone.objective_ == pytest.approx(least, rel=1e-7, abs=nothing)
    assert cone.objective_ * (1 - cone.gap_) <= least * (1 + 1e-9) + nothing
    assert cone.gap_ <= 1e-8 or cone.gap_ * cone.objective_ <= 0.1 * nothing
    assert np.abs(at @ w - theta).max() <= 1e-12
    assert (silent @ w - limit).max() <= 1e-12
    assert np.abs(w).max() <= 2.0


def test_a_bound_far_from_the_optimum_is_said_and_still_lies_below_it():
    spikes, trains, targets = draw(seed=4, trains=40)
    cone = ConeX(neuron=Neuron(time="grid", tau=TAU), lambdas=(2, 2, 200), lb=-2.0, ub=2.0, horizon=60.0, tolerance=0.1)
    cone.fit(trains, targets)
    _, least = optimum(cone, statement(spikes, targets, False, 60))
    assert cone.status_ == "solved"
    assert cone.objective_ * (1 - cone.gap_) <= least <= cone.objective_ * (1 + 1e-9)
    assert cone.objective_ <= least * (1 + 0.12)


def test_l1_uses_the_fewer_weights_the_larger_its_share():
    _, trains, targets = draw(seed=5, trains=60)
    used = []
    for ratio in [(0, 1, 0), (1, 4, 0), (1, 1, 0), (4, 1, 0), (1, 0, 0)]:
        cone = ConeX(neuron=Neuron(time="grid", tau=TAU), lambdas=ratio, lb=-2.0, ub=2.0).fit(trains, targets)
        assert cone.status_ == "solved"
        used.append(np.count_nonzero(cone.weights_))
    assert used == sorted(used, reverse=True)
    assert used[-1] < used[0]


@pytest.mark.parametrize("lambdas", [(1, 0, 0), (2, 2, 200), (0, 2, 100)], ids=str)
def test_in_continuous_time_the_trained_neuron_fires_at_its_targets_only(lambdas):
    _, trains, targets = draw(seed=6, trains=50)
    cone = ConeX(neuron=Neuron(tau=TAU, after_spike="reset"), lambdas=lambdas, lb=-2.0, ub=2.0).fit(trains, targets)
    assert cone.status_ == "solved"
    assert cone.gap_ <= 1e-8
    for pattern, times in zip(trains, targets, strict=True):
        np.testing.assert_allclose(cone.neuron_.run(cone.weights_, pattern), times, atol=1e-6, rtol=0)


def test_wave_trains_that_must_fall_silent_again_are_solved_with_b_undivided():
    """6.4.5 with inputs kept: an augmented Lagrangian left its silent rows broken here."""
    for kappa in [1.0, 1.04, 1.08, 1.16]:
        random = np.random.default_rng(7)
        pattern = SpikeTrains.from_lists([[t] for t in random.uniform(0, 40, 200)], stop=40.0)
        cone = ConeX(
            neuron=Neuron(time="grid", tau=10.0, theta_plus=0.0),
            lambdas=(0, 2, 100),
            divide_b_by="targets",
            delta_t_ms=1.5,
            kappa=kappa,
        )
        cone.fit([pattern], [[40.0]])
        assert cone.status_ == "solved"
        assert cone.gap_ <= 1e-8
        assert cone.violation_ <= 1e-12
