"""6.9 to 6.14 stated plainly, every row written out, and handed whole to a cone solver: the oracle of the learners."""

from __future__ import annotations

import numpy as np
import pytest
from simulator import kernel

from taxel import SpikeTrains
from taxel.learn import ConeR


def counts(cone, s, fired):
    """Whether an input at s counts after these spikes; within 1e-6 ms of an edge it is at it."""
    if cone.neuron_.after_spike == "reset" and len(fired):
        return s > fired[-1] + cone.neuron_.refractory + 1e-6
    if cone.neuron_.after_spike == "ignore":
        return not any(e + 1e-6 < s <= e + cone.neuron_.refractory + 1e-6 for e in fired)
    return True


def row(cone, pattern, t, fired):
    """The coefficients of the potential at t."""
    out = np.zeros(len(pattern))
    for n, train in enumerate(pattern):
        values = values_of(pattern, n)
        heard = [(s, v) for s, v in zip(train, values, strict=True) if s < t and counts(cone, s, fired)]
        times, values = np.array(heard).reshape(-1, 2).T
        out[n] = values @ kernel(cone.neuron_, t - times)
    return out


def values_of(pattern, n):
    """The values of a train's spikes, 1 of unsigned ones."""
    own = slice(pattern.offsets[n], pattern.offsets[n + 1])
    return np.ones(len(pattern[n])) if pattern.values is None else pattern.values[own].astype(float)


def threshold(cone, t, fired, start):
    spike = fired[-1] if len(fired) else (start if cone.neuron_.first_threshold == "printed" else None)
    since = -np.inf if spike is None else t - spike - cone.neuron_.refractory
    rec = 2 * cone.neuron_.tau if cone.neuron_.tau_rec is None else cone.neuron_.tau_rec
    return cone.neuron_.theta_0 + (cone.neuron_.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0)


def grid_rows(cone, patterns, targets, windows=None):
    """Every row: at the targets, behind them, at the silent points of the windows; and what each asks."""
    delta = 0.1 * cone.neuron_.tau if cone.delta_t_ms is None else cone.delta_t_ms
    at, behind, theta, silent, limit = [], [], [], [], []
    for p, (pattern, wanted) in enumerate(zip(patterns, targets, strict=True)):
        for k, t in enumerate(wanted):
            at.append(row(cone, pattern, t, wanted[:k]))
            behind.append(row(cone, pattern, t + delta, wanted[:k]))
            theta.append(threshold(cone, t, wanted[:k], pattern.start))
        end = max([pattern.stop, *(wanted[-1:] + cone.neuron_.tau)])
        if cone.horizon is not None:
            end = np.broadcast_to(cone.horizon, len(patterns))[p]
        for k in range(int((end - pattern.start) / cone.neuron_.step_ms + 1e-9) + 1):
            t = pattern.start + k * cone.neuron_.step_ms
            if any(e - 1e-9 <= t <= e + cone.neuron_.refractory + 1e-9 for e in wanted):
                continue
            asked = None if windows is None else windows[p]
            if asked is not None and not any(a - 1e-9 <= t <= b + 1e-9 for a, b in asked):
                continue
            fired = [e for e in wanted if e < t]
            silent.append(row(cone, pattern, t, fired))
            limit.append(threshold(cone, t, fired, pattern.start) - (cone.margin or 0.0))
    at, behind, silent = (np.reshape(v, (len(v), len(patterns[0]))) for v in (at, behind, silent))
    return at, behind, np.array(theta), silent, np.array(limit)


def short(sides, distances):
    """The distances that count."""
    return distances if sides == "both" else np.minimum(distances, 0.0)


def terms(cone, rows, w):
    at, behind, theta, silent, limit = rows
    power = 2 if cone.form_b == "square" else 1
    found = [np.abs(w).sum(), np.linalg.norm(w) ** (2 if cone.norm == "square" else 1)]
    if not isinstance(cone, ConeR):
        return np.array([*found, (np.abs(behind @ w - cone.kappa * theta) ** power).sum()])
    found.append((np.abs(short(cone.sides_b, behind @ w - cone.kappa * theta)) ** power).sum())
    found.append(np.abs(short(cone.sides_c, at @ w - theta)).sum())
    return np.array([*found, np.maximum(silent @ w - limit, 0).sum()])


def shares(cone, sizes):
    """What each term is multiplied with: its lambda over their sum, over its largest value (6.3.2, 6.3.3)."""
    most = np.maximum(np.abs(cone.lb), np.abs(cone.ub)) * np.ones(sizes[0].shape[1])
    low, high = terms(cone, sizes, -most), terms(cone, sizes, most)
    largest = np.array([*high[:2], *low[2:4], *high[4:]])
    for k, name in enumerate("bcd"[: len(largest) - 2]):
        if getattr(cone, f"divide_{name}_by") == "targets":
            largest[2 + k] = len(sizes[0]) if k < 2 else max(len(sizes[0]), 1)
    largest[largest == 0.0] = np.inf
    return np.array(cone.lambdas) / max(np.sum(cone.lambdas), 1e-300) / largest


def least(cone, rows, c):
    """Minimise 6.11 or 6.14 over every row at once: w, |w|, |w|_2, B's and C's and D's images as own variables."""
    clarabel, sparse = pytest.importorskip("clarabel"), pytest.importorskip("scipy.sparse")
    at, behind, theta, silent, limit = rows
    (k, n), m = at.shape, len(silent)
    hard = not isinstance(cone, ConeR)
    costs = [c @ terms(cone, rows, np.clip(w, cone.lb, cone.ub) * np.ones(n)) for w in (0.0, np.inf)]
    scale = 1 / (costs[0] or costs[1] or 1.0)
    c = c * scale
    # variables: w, a >= |w|, t >= |w|_2, y = behind w - kappa theta (of a sum: at least its size); unless the rows are
    # hard, e >= |at w - theta| and h >= max(silent w - limit, 0). Where only potentials below count,
    # y >= kappa theta - behind w, e >= theta - at w and 0.
    one_b, one_c = (not hard and sides == "below" for sides in (getattr(cone, f"sides_{x}", "") for x in "bc"))
    sizes = np.cumsum([0, n, n, 1, k, *((0, 0) if hard else (k, m))])
    q, p = np.zeros(sizes[-1]), np.zeros(sizes[-1])
    q[sizes[1] : sizes[2]] = c[0]
    if cone.form_b == "square":
        p[sizes[3] : sizes[4]] = 2 * c[2]
    else:
        q[sizes[3] : sizes[4]] = c[2]
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
    images = (block(k, w=(-1) ** one_b * behind, y=-eye(k)), (-1) ** one_b * cone.kappa * theta)
    equal, below = ([], [images]) if one_b else ([images], [])
    if cone.form_b == "sum":
        # y >= |behind w - kappa theta|.
        equal, below = [], [images, (block(k, y=-eye(k)), np.zeros(k))]
        if not one_b:
            below.append((block(k, w=-behind, y=-eye(k)), -cone.kappa * theta))
    if hard:
        equal.append((block(k, w=at), theta))
        below.append((block(m, w=silent), limit))
    else:
        q[sizes[4] : sizes[5]], q[sizes[5] :] = c[3], c[4]
        below += [
            (block(k, w=(1 - one_c) * at, e=-eye(k)), (1 - one_c) * theta),
            (block(k, w=-at, e=-eye(k)), -theta),
            (block(m, w=silent, h=-eye(m)), limit),
            (block(m, h=-eye(m)), np.zeros(m)),
        ]
    below += [
        (block(n, w=eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=-eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=eye(n)), cone.ub * np.ones(n)),
        (block(n, w=-eye(n)), np.multiply(cone.lb, -np.ones(n))),
    ]
    length = [(block(1, t=-eye(1)), np.zeros(1)), (block(n, w=-eye(n)), np.zeros(n))]
    kinds = {clarabel.ZeroConeT: equal, clarabel.NonnegativeConeT: below, clarabel.SecondOrderConeT: length}
    cones = [kind(sum(len(v[1]) for v in parts)) for kind, parts in kinds.items() if parts]
    parts = [*equal, *below, *length]
    a, b = sparse.vstack([v[0] for v in parts]).tocsc(), np.concatenate([v[1] for v in parts])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = 1e-12, 1e-10, 1e-11
    answer = clarabel.DefaultSolver(sparse.diags(p).tocsc(), q, a, b, cones, settings).solve()
    w = np.clip(np.array(answer.x[:n]), cone.lb, cone.ub)
    return (c @ terms(cone, rows, w)) / scale


def graded(patterns, seed, values=lambda random, n: random.choice([-1, 1], n) * 10 ** random.uniform(-1, 1, n)):
    """The same patterns with a value a spike."""
    random = np.random.default_rng(seed)
    return [
        SpikeTrains(p.times, p.offsets, p.start, p.stop, values(random, len(p.times)), kind="graded") for p in patterns
    ]


def examples(seed, trains=20, patterns=2, targets=2, duration=120.0, whole_ms=False, apart=8.0, spikes=4, first=25.0):
    random = np.random.default_rng(seed)
    lists, wanted = [], []
    for _ in range(patterns):
        times = [np.sort(random.uniform(0, duration, random.integers(1, spikes + 1))) for _ in range(trains)]
        lists.append(SpikeTrains.from_lists([t.round() if whole_ms else t for t in times], stop=duration + 10))
        at = np.sort(random.uniform(first, duration, targets))
        while np.any(np.diff(at) < apart):
            at = np.sort(random.uniform(first, duration, targets))
        wanted.append(at.round() if whole_ms else at)
    return lists, wanted
