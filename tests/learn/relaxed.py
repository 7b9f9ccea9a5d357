"""6.12 to 6.14 stated plainly, every row written out, and handed whole to a cone solver: the oracle of ConeR."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import stated
from making import made
from simulator import kernel

from taxel import SpikeTrains
from taxel.learn import ConeR

clarabel = pytest.importorskip("clarabel")
sparse = pytest.importorskip("scipy.sparse")


def examples(seed, trains=14, *shape, **options):
    return stated.examples(seed, trains, *shape, first=20.0, **options)


def fitted(cone, *args, **kwargs):
    """Fit without a word of warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cone.fit(*args, **kwargs)


def statement(cone, patterns, targets, windows=None):
    """Every coefficient of 6.12 to 6.14, one sum of kernels at a time; silence is asked for in the windows alone."""

    def threshold(t, earlier, start):
        spike = earlier[-1] if len(earlier) else (start if cone.neuron_.first_threshold == "printed" else None)
        since = -np.inf if spike is None else t - spike - cone.neuron_.refractory
        rec = 2 * cone.neuron_.tau if cone.neuron_.tau_rec is None else cone.neuron_.tau_rec
        return cone.neuron_.theta_0 + (cone.neuron_.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0)

    def coefficients(pattern, t, earlier):
        row = np.zeros(len(pattern))
        for n, train in enumerate(pattern):
            for s, value in zip(train, stated.values_of(pattern, n), strict=True):
                if s >= t:
                    break
                if cone.neuron_.after_spike == "reset" and len(earlier) and s <= earlier[-1] + cone.neuron_.refractory:
                    continue
                if cone.neuron_.after_spike == "ignore" and any(e < s <= e + cone.neuron_.refractory for e in earlier):
                    continue
                row[n] += value * kernel(cone.neuron_, t - s)
        return row

    delta = 0.1 * cone.neuron_.tau if cone.delta_t_ms is None else cone.delta_t_ms
    at, behind, theta, silent, limit = [], [], [], [], []
    for p, (pattern, wanted) in enumerate(zip(patterns, targets, strict=True)):
        for k, t in enumerate(wanted):
            at.append(coefficients(pattern, t, wanted[:k]))
            behind.append(coefficients(pattern, t + delta, wanted[:k]))
            theta.append(threshold(t, wanted[:k], pattern.start))
        end = cone.horizon if cone.horizon is not None else max([pattern.stop, *(wanted[-1:] + cone.neuron_.tau)])
        for k in range(int((end - pattern.start) / cone.neuron_.step_ms + 1e-9) + 1):
            t = pattern.start + k * cone.neuron_.step_ms
            if any(e - 1e-9 <= t <= e + cone.neuron_.refractory + 1e-9 for e in wanted):
                continue
            asked = None if windows is None else windows[p]
            if asked is not None and not any(a - 1e-9 <= t <= b + 1e-9 for a, b in asked):
                continue
            earlier = [e for e in wanted if e < t]
            silent.append(coefficients(pattern, t, earlier))
            limit.append(threshold(t, earlier, pattern.start) - cone.margin)
    n = len(patterns[0])
    at, behind, silent = (np.reshape(v, (len(v), n)) for v in (at, behind, silent))
    return at, behind, np.array(theta), silent, np.array(limit)


def short(sides, distances):
    """The distances that count."""
    return distances if sides == "both" else np.minimum(distances, 0.0)


def terms(cone, rows, w):
    at, behind, theta, silent, limit = rows
    return np.array(
        [
            np.abs(w).sum(),
            np.linalg.norm(w) ** (2 if cone.norm == "square" else 1),
            (short(cone.sides_b, behind @ w - cone.kappa * theta) ** 2).sum(),
            np.abs(short(cone.sides_c, at @ w - theta)).sum(),
            np.maximum(silent @ w - limit, 0).sum(),
        ]
    )


def sizes(cone, patterns, targets, windows, rows):
    """The rows from which the largest value of each term is reckoned: those of the magnitudes of graded values."""
    if patterns[0].kind != "graded":
        return rows
    positive = [SpikeTrains(p.times, p.offsets, p.start, p.stop, abs(p.values), kind="graded") for p in patterns]
    return (*map(np.abs, rows[:3]), statement(cone, positive, targets, windows)[3], rows[4])


def shares(cone, sizes):
    """What each term is multiplied with: its lambda over their sum, over its largest value (6.3.2, 6.3.3)."""
    most = np.maximum(np.abs(cone.lb), np.abs(cone.ub)) * np.ones(sizes[0].shape[1])
    low, high = terms(cone, sizes, -most), terms(cone, sizes, most)
    largest = np.array([high[0], high[1], low[2], low[3], high[4]])
    for k, by in enumerate((cone.divide_b_by, cone.divide_c_by, cone.divide_d_by)):
        if by == "targets":
            largest[2 + k] = len(sizes[0]) if k < 2 else max(len(sizes[0]), 1)
    largest[largest == 0.0] = np.inf
    return np.array(cone.lambdas) / np.sum(cone.lambdas) / largest


def least(cone, rows, c):
    """Minimise 6.14 over every row at once: w, |w|, |w|_2, B's and C's and D's images as variables of their own."""
    at, behind, theta, silent, limit = rows
    (k, n), m = at.shape, len(silent)
    costs = [c @ terms(cone, rows, np.clip(w, cone.lb, cone.ub) * np.ones(n)) for w in (0.0, np.inf)]
    scale = 1 / (costs[0] or costs[1] or 1.0)
    c = c * scale
    # variables: w, a >= |w|, t >= |w|_2, y = behind w - kappa theta, e >= |at w - theta|,
    # h >= max(silent w - limit, 0); where only potentials below count, y >= kappa theta - behind w, e >= theta - at w
    # and 0.
    one_b, one_c = cone.sides_b == "below", cone.sides_c == "below"
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
        (block(k, w=(-1) ** one_b * behind, y=-eye(k)), (-1) ** one_b * cone.kappa * theta),
        (block(n, w=eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=-eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=eye(n)), cone.ub * np.ones(n)),
        (block(n, w=-eye(n)), np.multiply(cone.lb, -np.ones(n))),
        (block(k, w=(1 - one_c) * at, e=-eye(k)), (1 - one_c) * theta),
        (block(k, w=-at, e=-eye(k)), -theta),
        (block(m, w=silent, h=-eye(m)), limit),
        (block(m, h=-eye(m)), np.zeros(m)),
        (block(1, t=-eye(1)), np.zeros(1)),
        (block(n, w=-eye(n)), np.zeros(n)),
    ]
    a, b = sparse.vstack([v[0] for v in parts]).tocsc(), np.concatenate([v[1] for v in parts])
    cones = [
        *([clarabel.NonnegativeConeT(k) if one_b else clarabel.ZeroConeT(k)] if k else []),
        clarabel.NonnegativeConeT(4 * n + 2 * k + 2 * m),
        clarabel.SecondOrderConeT(n + 1),
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = 1e-12, 1e-10, 1e-11
    answer = clarabel.DefaultSolver(sparse.diags(p).tocsc(), q, a, b, cones, settings).solve()
    w = np.clip(np.array(answer.x[:n]), cone.lb, cone.ub)
    return (c @ terms(cone, rows, w)) / scale


def drawn(seed):
    """A fit with options, bounds, windows and examples of every kind, its examples and its windows."""
    random = np.random.default_rng([77, seed])
    one = lambda *values: values[random.integers(len(values))]  # noqa: E731
    trains = int(random.integers(1, 15)) * one(1, 1, 8)
    kernel = one("alpha", "alpha", "double_exponential", "exponential")
    shape = (int(random.integers(1, 4)), int(random.integers(1, 4)))
    patterns, targets = stated.examples(seed, trains, *shape, whole_ms=one(True, False), first=20.0)
    kind = one("unsigned", "unsigned", "positive", "signs")
    if kind != "unsigned":
        signs = [1.0] if kind == "positive" else [-1.0, 1.0]
        patterns = stated.graded(patterns, seed, lambda r, n: r.choice(signs, n) * 10 ** r.uniform(-1, 1, n))
    empty = random.random(trains) < one(0.0, 0.3)
    keep = [~np.repeat(empty, p.counts) for p in patterns]
    counts = [np.where(empty, 0, p.counts) for p in patterns]
    patterns = [
        SpikeTrains(
            p.times[k],
            np.append(0, np.cumsum(c)),
            p.start,
            p.stop,
            p.values if p.values is None else p.values[k],
            kind=p.kind,
        )
        for p, k, c in zip(patterns, keep, counts, strict=True)
    ]
    # A pattern without spikes has no target.
    targets = [t if len(p.times) else t[:0] for p, t in zip(patterns, targets, strict=True)]
    targets[0] = targets[0][: int(random.integers(0, 4))]
    options = {
        "kernel": kernel,
        "tau": float(random.uniform(5, 30)),
        "after_spike": one("keep", "ignore", "reset"),
        "first_threshold": one("theta_0", "printed"),
        "refractory": one(1.0, 3.0, 6.5),
        "theta_plus": one(0.0, 0.2, 2.0),
        "tau_rec": one(None, 8.0, 100.0),
        "step_ms": one(1.0, 1.0, 0.5, 0.3),
        "margin": one(0.0, 0.0, 0.02),
        "horizon": one(None, None, 180.0),
        "kappa": float(random.uniform(0.8, 2.0)),
        "delta_t_ms": one(None, 0.0, 4.0),
        "lambdas": [*(one(0.0, 1.0, 10.0, 100.0) for _ in range(4)), one(1.0, 80.0, 800.0)],
        "divide_b_by": one("B_max", "targets"),
        "divide_c_by": one("C_max", "targets"),
        "divide_d_by": one("D_max", "targets"),
        "sides_b": one("both", "below"),
        "sides_c": one("both", "below"),
        "norm": one("norm", "square"),
        "tolerance": one(1e-6, 1e-6, 1e-3),
    }
    if kernel == "double_exponential" and one(True, False):
        options["tau_s"] = 0.5 * options["tau"]
    low, high = random.uniform(-1, 0.02, trains), random.uniform(0.05, 1, trains)
    kinds = {"one": (-0.5, 0.3), "each": (low.tolist(), high.tolist()), "wide": (-300.0, 300.0), "up": (0.01, 0.6)}
    options["lb"], options["ub"] = kinds[one(*kinds)]
    silence = one(None, None, [one(None, [(15.0, 40.0), (40.0, 60.5)], []) for _ in patterns])
    # In another unit of potential every number of the options that is one is larger.
    unit = one(1.0, 1.0, 0.02, 40.0)
    options |= {"theta_0": 0.3 * unit, "theta_plus": options["theta_plus"] * unit, "margin": options["margin"] * unit}
    options |= {end: (np.asarray(options[end]) * unit).tolist() for end in ("lb", "ub")}
    cone = made(ConeR, **options).fit(patterns, targets, silence=silence)
    return cone, patterns, targets, silence
