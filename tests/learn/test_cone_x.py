"""CONE-X on the grid against 6.11 stated plainly, every row written out, and handed whole to other solvers."""

from __future__ import annotations

import numpy as np
import pytest
from draws import mixed
from interrupts import ctrl_c_after
from making import made
from refusal import refused
from stated import examples, grid_rows, least, shares, terms

from taxel import SpikeTrains
from taxel.learn import ConeX, check_certificate

linprog = pytest.importorskip("scipy.optimize").linprog


def feasible(cone, rows):
    """The verdict of HiGHS on every row."""
    at, _, theta, silent, limit = rows
    n = at.shape[1]
    bounds = np.column_stack([np.broadcast_to(cone.lb, n), np.broadcast_to(cone.ub, n)])
    found = linprog(np.zeros(n), A_ub=silent, b_ub=limit, A_eq=at, b_eq=theta, bounds=bounds, method="highs")
    assert found.status in (0, 2)
    return found.status == 0


OPTIONS = [
    {},
    {"after_spike": "reset"},
    {"after_spike": "ignore", "refractory": 6.0},
    {"lambdas": (1, 0, 0)},
    {"lambdas": (2, 2, 200), "after_spike": "reset"},
    {"lambdas": (2, 2, 200), "divide_b_by": "targets", "kappa": 1.08},
    {"lambdas": (0, 1, 100), "norm": "square", "divide_b_by": "targets"},
    {"lambdas": (2, 2, 200), "form_b": "sum", "kappa": 1.08},
    {"lambdas": (1, 0, 2), "form_b": "sum", "divide_b_by": "targets", "after_spike": "reset"},
    {"lambdas": (0, 1, 0), "norm": "square", "margin": 0.01},
    {"lambdas": (0, 0, 1), "delta_t_ms": 4.0},
    {"lambdas": (1, 4, 0), "first_threshold": "printed", "after_spike": "ignore"},
    {"lambdas": (1, 1, 0), "lb": np.linspace(-2.0, -1.0, 20), "ub": np.linspace(3.0, 1.0, 20), "horizon": 150.0},
    {"kernel": "double_exponential", "horizon": 140.0},
    {"kernel": "double_exponential", "tau_s": 2.0, "lambdas": (2, 2, 200), "after_spike": "reset"},
    {"kernel": "exponential", "tau": 8.0, "lambdas": (1, 1, 0)},
    {"step_ms": 0.5, "theta_plus": 1.0, "tau_rec": 60.0},
]


@pytest.mark.parametrize(("options", "seed"), mixed(OPTIONS, [1, 2, 3, 4]))
def test_on_the_grid_verdict_and_objective_are_those_of_every_row_handed_whole_to_a_solver(options, seed):
    patterns, targets = examples(seed, whole_ms=seed % 2 == 0, patterns=2 if seed < 4 else 6)
    cone = made(ConeX, **{"time": "grid", "tau": 12.0, "lb": -3.0, "ub": 3.0, **options}).fit(patterns, targets)
    rows = grid_rows(cone, patterns, targets)
    assert (cone.status_ == "solved") == feasible(cone, rows)
    if cone.status_ == "infeasible":
        assert check_certificate(cone.problem_, cone.certificate_)
        return
    w = cone.weights_
    factors = shares(cone, rows)
    value = factors * terms(cone, rows, w)
    assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-15)
    assert cone.objective_ == pytest.approx(value.sum(), rel=1e-12)
    nothing = 1e-10 * (factors @ terms(cone, rows, 0 * w))
    assert cone.objective_ == pytest.approx(least(cone, rows, factors), rel=1e-6, abs=nothing)
    assert cone.gap_ <= 1e-8 or cone.gap_ * cone.objective_ <= nothing
    assert np.abs(rows[0] @ w - rows[2]).max() <= 1e-12
    assert (rows[3] @ w - rows[4]).max() <= 1e-12
    assert np.all(w >= np.array(cone.lb))
    assert np.all(w <= np.array(cone.ub))
    assert cone.margin_.mv == pytest.approx(np.min(rows[4] + (cone.margin or 0.0) - rows[3] @ w), abs=1e-12)


def test_a_start_from_an_earlier_fit_changes_the_way_but_not_the_result():
    patterns, targets = examples(6, trains=60, patterns=8, targets=2, duration=200.0)
    for options in ({}, {"lambdas": (2, 2, 200)}, {"time": "grid"}):
        common = {"lb": -1.0, "ub": 1.0, **options}
        cold = made(ConeX, **common, kappa=1.1).fit(patterns, targets)
        assert cold.status_ == "solved"
        again = made(ConeX, **common, kappa=1.1).fit(patterns, targets, start=cold)
        assert again.status_ == "solved"
        assert again.objective_ == pytest.approx(cold.objective_, rel=1e-7)
        assert again.rounds_ <= cold.rounds_
        # Other bounds, other targets, other margins: rows that are not there any more are left out.
        moved = [t + 0.25 for t in targets]
        for other, times in (
            ({**common, "ub": 0.8}, targets),
            (common, moved),
            ({**common, "refractory": 5.0}, targets),
        ):
            fresh, warm = (
                made(ConeX, **other).fit(patterns, times),
                made(ConeX, **other).fit(patterns, times, start=cold),
            )
            assert warm.status_ == fresh.status_
            if fresh.status_ == "solved":
                # In continuous time a little of the margin is left open.
                near = 1e-7 if "time" in options else 1e-5 if "lambdas" not in options else 1e-3
                assert warm.objective_ == pytest.approx(fresh.objective_, rel=near)
    with refused():
        ConeX().fit(patterns, targets, start=ConeX())


def test_the_horizon_frees_what_lies_behind_it_in_each_pattern():
    patterns, targets = examples(12, trains=30, patterns=2, targets=1)
    ends = [float(t[-1]) + 5.0 for t in targets]
    whole, short = ConeX(lb=-1, ub=1).fit(patterns, targets), ConeX(lb=-1, ub=1, horizon=ends).fit(patterns, targets)
    assert short.objective_ <= whole.objective_
    with refused():
        short.problem_.silence(0, ends[0] + 1.0)


def large():
    random = np.random.default_rng(0)
    patterns = [SpikeTrains.from_lists(random.uniform(0, 200, (1500, 1)), stop=200.0) for _ in range(430)]
    return patterns, [[50.0 + 50.0 * (k % 3)] for k in range(430)]


def test_control_c_stops_a_fit_at_once_keeps_the_best_so_far_and_then_raises():
    patterns, targets = large()
    cone = ConeX(horizon=200.0)
    with ctrl_c_after(0.5, answered_within=10):
        for _ in range(1000):
            cone.fit(patterns, targets)
    assert cone.status_ in ("stopped", "feasible", "solved", "infeasible")
