"""6.9 to 6.11 stated plainly, one sum of kernels at a time: the oracle of the tests of ConeX."""

from __future__ import annotations

import numpy as np
from simulator import kernel

from taxel import SpikeTrains


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


def grid_rows(cone, patterns, targets):
    """Every row of 6.11: at the targets, behind them, at the silent points; and what each asks."""
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
            fired = [e for e in wanted if e < t]
            silent.append(row(cone, pattern, t, fired))
            limit.append(threshold(cone, t, fired, pattern.start) - (cone.margin or 0.0))
    return tuple(np.array(v) for v in (at, behind, theta, silent, limit))


def terms(cone, rows, w):
    _, behind, theta, _, _ = rows
    return np.array(
        [
            np.abs(w).sum(),
            np.linalg.norm(w) ** (2 if cone.norm == "square" else 1),
            ((behind @ w - cone.kappa * theta) ** 2).sum(),
        ]
    )


def shares(cone, rows):
    """What each term is multiplied with: its lambda over their sum, over its largest value (6.3.2, 6.3.3)."""
    n = rows[0].shape[1]
    most = np.maximum(np.abs(np.broadcast_to(cone.lb, n)), np.abs(np.broadcast_to(cone.ub, n)))
    high, low = terms(cone, rows, most), terms(cone, rows, -most)
    largest = np.array([high[0], high[1], low[2]])
    if cone.divide_b_by == "targets":
        largest[2] = len(rows[0])
    return np.array(cone.lambdas) / max(np.sum(cone.lambdas), 1e-300) / largest


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
