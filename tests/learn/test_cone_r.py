"""CONE-R against 6.12 to 6.14 stated plainly, every row written out, and handed whole to a cone solver."""

from __future__ import annotations

import itertools
import signal
import threading
import time
import warnings

import numpy as np
import pytest

import taxel
from taxel import ProblemError, SpikeTrains
from taxel.learn import ConeR

clarabel = pytest.importorskip("clarabel")
sparse = pytest.importorskip("scipy.sparse")


def examples(seed, trains=14, patterns=2, targets=2, duration=120.0, whole_ms=False):
    random = np.random.default_rng(seed)
    spikes, wanted = [], []
    for _ in range(patterns):
        times = [np.sort(random.uniform(0, duration, random.integers(1, 5))) for _ in range(trains)]
        spikes.append(SpikeTrains.from_lists([t.round() if whole_ms else t for t in times], stop=duration + 10))
        at = np.sort(random.uniform(20, duration, targets))
        while np.any(np.diff(at) < 8):
            at = np.sort(random.uniform(20, duration, targets))
        wanted.append(at.round() if whole_ms else at)
    return spikes, wanted


def statement(cone, patterns, targets):
    """Every coefficient of 6.12 to 6.14, one sum of kernels at a time."""

    def threshold(t, earlier, start):
        spike = earlier[-1] if len(earlier) else (start if cone.first_threshold == "printed" else None)
        since = -np.inf if spike is None else t - spike - cone.refractory
        rec = 2 * cone.tau if cone.tau_rec is None else cone.tau_rec
        return cone.theta_0 + (cone.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0)

    def coefficients(pattern, t, earlier):
        row = np.zeros(len(pattern))
        for n, train in enumerate(pattern):
            for s in train[train < t]:
                if cone.after_spike == "reset" and len(earlier) and s <= earlier[-1] + cone.refractory:
                    continue
                if cone.after_spike == "ignore" and any(e < s <= e + cone.refractory for e in earlier):
                    continue
                row[n] += (t - s) / cone.tau * np.exp(-(t - s) / cone.tau)
        return row

    delta = 0.1 * cone.tau if cone.delta_t_ms is None else cone.delta_t_ms
    at, behind, theta, silent, limit = [], [], [], [], []
    for pattern, wanted in zip(patterns, targets, strict=True):
        for k, t in enumerate(wanted):
            at.append(coefficients(pattern, t, wanted[:k]))
            behind.append(coefficients(pattern, t + delta, wanted[:k]))
            theta.append(threshold(t, wanted[:k], pattern.start))
        end = cone.horizon if cone.horizon is not None else max([pattern.stop, *(wanted[-1:] + cone.tau)])
        for k in range(int((end - pattern.start) / cone.step_ms + 1e-9) + 1):
            t = pattern.start + k * cone.step_ms
            if any(e - 1e-9 <= t <= e + cone.refractory + 1e-9 for e in wanted):
                continue
            earlier = [e for e in wanted if e < t]
            silent.append(coefficients(pattern, t, earlier))
            limit.append(threshold(t, earlier, pattern.start) - cone.margin)
    return (np.array(v) for v in (at, behind, theta, silent, limit))


def terms(cone, rows, w):
    at, behind, theta, silent, limit = rows
    return np.array(
        [
            np.abs(w).sum(),
            np.linalg.norm(w) ** (2 if cone.norm == "square" else 1),
            ((behind @ w - cone.kappa * theta) ** 2).sum(),
            np.abs(at @ w - theta).sum(),
            np.maximum(silent @ w - limit, 0).sum(),
        ]
    )


def shares(cone, rows):
    """What each term is multiplied with: its lambda over their sum, over its largest value (6.3.2, 6.3.3)."""
    most = max(abs(cone.lb), abs(cone.ub))
    n = rows[0].shape[1]
    low, high = terms(cone, rows, np.full(n, -most)), terms(cone, rows, np.full(n, most))
    largest = np.array([high[0], high[1], low[2], low[3], high[4]])
    if cone.divide_b_by == "targets":
        largest[2] = len(rows[0])
    return np.array(cone.lambdas) / np.sum(cone.lambdas) / largest


def least(cone, rows):
    """Minimise 6.14 over every row at once: w, |w|, |w|_2, B's and C's and D's images as variables of their own."""
    at, behind, theta, silent, limit = rows
    (k, n), m = at.shape, len(silent)
    c = shares(cone, rows)
    scale = 1 / (c @ terms(cone, rows, np.zeros(n)))
    c = c * scale
    # variables: w, a >= |w|, t >= |w|_2, y = behind w - kappa theta, e >= |at w - theta|, h >= max(silent w - limit, 0)
    sizes = np.cumsum([0, n, n, 1, k, k, m])
    q = np.zeros(sizes[-1])
    q[sizes[1] : sizes[2]], q[sizes[4] : sizes[5]], q[sizes[5] :] = c[0], c[3], c[4]
    p = np.zeros(sizes[-1])
    p[sizes[3] : sizes[4]] = 2 * c[2]
    if cone.norm == "square":
        p[:n] = 2 * c[1]
    else:
        q[sizes[2]] = c[1]

    def block(rows, **columns):
        row = [sparse.csc_matrix((rows, sizes[i + 1] - sizes[i])) for i in range(6)]
        for name, value in columns.items():
            row["watyeh".index(name)] = sparse.csc_matrix(value)
        return sparse.hstack(row)

    eye = np.eye
    parts = [
        (block(k, w=behind, y=-eye(k)), cone.kappa * theta),
        (block(n, w=eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=-eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=eye(n)), np.full(n, cone.ub)),
        (block(n, w=-eye(n)), np.full(n, -cone.lb)),
        (block(k, w=at, e=-eye(k)), theta),
        (block(k, w=-at, e=-eye(k)), -theta),
        (block(m, w=silent, h=-eye(m)), limit),
        (block(m, h=-eye(m)), np.zeros(m)),
        (block(1, t=-eye(1)), np.zeros(1)),
        (block(n, w=-eye(n)), np.zeros(n)),
    ]
    a, b = sparse.vstack([v[0] for v in parts]).tocsc(), np.concatenate([v[1] for v in parts])
    cones = [
        clarabel.ZeroConeT(k),
        clarabel.NonnegativeConeT(4 * n + 2 * k + 2 * m),
        clarabel.SecondOrderConeT(n + 1),
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = 1e-12, 1e-10, 1e-11
    answer = clarabel.DefaultSolver(sparse.diags(p).tocsc(), q, a, b, cones, settings).solve()
    w = np.clip(np.array(answer.x[:n]), cone.lb, cone.ub)
    return (c @ terms(cone, rows, w)) / scale


OPTIONS = [
    {},
    {"after_spike": "reset"},
    {"after_spike": "ignore", "refractory": 6.0},
    {"after_spike": "reset", "divide_b_by": "targets", "kappa": 1.1},
    {"norm": "square", "divide_b_by": "targets", "lambdas": (0, 4, 100, 100, 80)},
    {"lambdas": (4, 0, 100, 100, 80), "step_ms": 0.5},
    {"lambdas": (0, 0, 1, 1, 1), "margin": 0.05},
    {"lambdas": (2, 2, 0, 100, 400), "theta_plus": 3.0, "tau_rec": 100.0},
    {"lb": 0.0, "ub": 1.0, "first_threshold": "printed"},
    {"lb": -1.0, "ub": 0.2, "delta_t_ms": 4.0, "horizon": 150.0},
    {"lambdas": (0, 1, 0, 1, 100), "lb": -3.0, "ub": 3.0, "margin": 0.01, "kappa": 2.0},
]


@pytest.mark.parametrize("options", OPTIONS, ids=lambda o: ",".join(f"{k}={v}" for k, v in o.items()) or "printed")
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_objective_is_that_of_every_row_handed_whole_to_a_solver(options, seed):
    patterns, targets = examples(seed, whole_ms=seed == 2)
    cone = ConeR(tau=12.0, **options).fit(patterns, targets)
    rows = tuple(statement(cone, patterns, targets))
    value = shares(cone, rows) * terms(cone, rows, cone.weights_)
    assert cone.silent_rows_ == len(rows[3])
    assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-12)
    assert cone.objective_ == pytest.approx(value.sum(), rel=1e-12)
    assert cone.status_ == "solved"
    assert cone.objective_ == pytest.approx(least(cone, rows), rel=1e-6)
    assert cone.weights_.min() >= cone.lb and cone.weights_.max() <= cone.ub
