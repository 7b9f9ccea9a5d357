"""ConeR against CVXPY with Clarabel, which gets every row: the same objective, and the CPU time.

Drawn insoles of 92 taxels, one ON and one OFF spike a taxel and footfall, Table 6.2; then one long walk of a million
rows, ours alone. CPU time of the process, in turn: the cone solver has a thread of its own.

Peer: CVXPY with Clarabel. Unit: CPU seconds a fit. Goal: not slower, with an objective not above its.
"""

import time
import warnings

import numpy as np

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR
from taxel_benchmarks._goals import at_most, not_slower
from taxel_benchmarks._rounds import measured, missing

WEIGHTS = 184

PEERS = {"CVXPY with Clarabel": "cvxpy clarabel"}


def walk(footfalls, trains, seed=0):
    """Draw a walk: pressure moves from heel to toe; contact is the load of the first taxels."""
    random = np.random.default_rng(seed)
    half = trains // 2
    place = np.linspace(0, 1, half)
    times, targets, t = [[] for _ in range(trains)], [], 0.0
    for _ in range(footfalls):
        t += random.uniform(300, 900)
        stance = random.normal(640, 60)
        on = t + 0.55 * place**1.3 * stance + random.normal(0, 6, half).clip(-12, 12) + 12
        off = np.minimum(t + (0.35 + 0.65 * place**0.7) * stance + random.normal(0, 8, half), t + stance)
        for n in range(half):
            times[n].append(on[n])
            times[half + n].append(max(off[n], on[n] + 2))
        targets.append(t + 24)
        t += stance
    return [SpikeTrains.from_lists([np.sort(x) for x in times], stop=t + 300)], [np.array(targets)]


def whole(cone, pattern, targets):
    """State 6.14 with every row; return a function that solves it by CVXPY and stores the least objective."""
    neuron, n = cone.neuron, len(pattern)
    tau = neuron.tau

    def rows(points, since):
        out = np.zeros((len(points), n), np.float64)
        for train, spikes in enumerate(pattern):
            for s in spikes:
                after = slice(*np.searchsorted(points, [s, s + 45 * tau]))
                x = (points[after] - s) / tau
                out[after, train] += np.where(s > since[after], x * np.exp(-x), 0.0)
        return out

    def last(points):
        k = np.searchsorted(targets, points) - 1
        return np.where(k >= 0, targets[np.maximum(k, 0)], -np.inf)

    def theta(points):
        past = points - last(points) - neuron.refractory
        return neuron.theta_0 + np.where(past >= -1e-9, neuron.theta_plus * np.exp(-np.abs(past) / (2 * tau)), 0.0)

    grid = np.arange(pattern.start, pattern.stop + 1e-9, neuron.step_ms)
    nearest = np.searchsorted(targets, grid, side="right") - 1
    free = (nearest >= 0) & (grid - targets[np.maximum(nearest, 0)] <= neuron.refractory)
    silent = grid[~free]
    lost = neuron.refractory
    d, limit = rows(silent, last(silent) + lost), theta(silent)
    c, threshold = rows(targets, last(targets) + lost), theta(targets)
    b = rows(targets + 0.1 * tau, last(targets) + lost)
    most = max(abs(cone.lb), abs(cone.ub))
    share = np.array(cone.lambdas) / np.sum(cone.lambdas)
    share /= [
        n * most,
        np.sqrt(n) * most,
        ((most * b.sum(1) + cone.kappa * threshold) ** 2).sum(),
        (most * c.sum(1) + threshold).sum(),
        np.maximum(most * d.sum(1) - limit, 0).sum(),
    ]
    scale = 1 / (share[2] * ((cone.kappa * threshold) ** 2).sum() + share[3] * threshold.sum())

    def stated():
        import cvxpy  # noqa: PLC0415  a peer need not be there

        w = cvxpy.Variable(n)
        terms = (
            cvxpy.norm1(w),
            cvxpy.norm2(w),
            cvxpy.sum_squares(b @ w - cone.kappa * threshold),
            cvxpy.norm1(c @ w - threshold),
            cvxpy.sum(cvxpy.pos(d @ w - limit)),
        )
        objective = sum(float(scale * factor) * term for factor, term in zip(share, terms, strict=True))
        problem = cvxpy.Problem(cvxpy.Minimize(objective), [w >= cone.lb, w <= cone.ub])
        stated.objective = problem.solve(solver=cvxpy.CLARABEL, max_threads=1) / scale

    return stated


def goals(result):
    """Return the goals with what a result reached."""
    names = [f"relative difference to {peer}" for peer in PEERS]
    above = {name: result["objective"].get(name) for name in names}
    return not_slower(result, *(f"ConeR over {peer}" for peer in PEERS)) + at_most(dict.fromkeys(above, 1e-6), above)


def run(*, quick):
    """Measure; quick: a thirtieth of the footfalls, one round."""
    warnings.simplefilter("ignore")
    cone = ConeR(neuron=Neuron(tau=70.0, after_spike="reset"), kappa=1.2)
    patterns, targets = walk(2 if quick else 60, WEIGHTS)
    absent = missing(PEERS)
    runs = {name: whole(cone, patterns[0], targets[0]) for name in PEERS if name not in absent}
    rows = cone.prepare(patterns, targets)
    start = rows.fit(ConeR(neuron=Neuron(tau=70.0, after_spike="reset"), kappa=1.25))
    ours = {
        "ConeR": lambda: cone.fit(patterns, targets),
        "ConeR, from a fit at kappa 1.25": lambda: rows.fit(cone, start=start),
    }
    pairs = {f"{one} over {name}": (one, name) for one in ours for name in PEERS}
    found = measured(ours | runs, pairs, rounds=1 if quick else 3, warm_up=quick)
    mine = cone.objective_
    long, at = walk(20 if quick else 1150, 96, seed=1)
    large = ConeR(neuron=Neuron(tau=30.0, after_spike="reset"), divide_b_by="targets")
    begun = time.process_time()
    large.fit(long, at)
    return found | {
        "rows": rows.silent_rows,
        "objective": {
            "ConeR": mine,
            **{name: run.objective for name, run in runs.items()},
            **{f"relative difference to {name}": mine / run.objective - 1 for name, run in runs.items()},
            "gap": cone.gap_,
        },
        "long walk": {
            "rows": large.silent_rows_,
            "trains": 96,
            "targets": len(at[0]),
            "cpu_s": time.process_time() - begun,
            "status": large.status_,
            "gap": large.gap_,
        },
    }
