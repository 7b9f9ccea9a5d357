"""ConeX with l1, norm and B in the objective against CVXPY + Clarabel with every row (6.4.4, C = 3, on the grid).

Three sizes, four mixes of terms, one thread. The peer runs in a process of its own, in turn with ConeX if it needs 3 s
at most, and is stopped after a minute of CPU (15 with ``taxel bench --peers``, which saves a time above one); its time
is that of `solve`, without stating the rows; ours is the whole `fit`.

Peer: CVXPY with Clarabel. Unit: CPU seconds a fit. Goal: not slower than the peer.
"""

import argparse
import json
import sys
import time
import warnings
from functools import partial

import numpy as np
from _goals import at_least
from _peer import ask, in_turn, kept_of, missing
from _rounds import WIDEST, stamp

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX

TAU, THETA_0, THETA_PLUS, REFRACTORY, BOUND, END = 15.0, 0.3, 0.2, 3.0, 0.3, 200.0
KAPPA, DELTA_T = 1.2, 1.5
SIZES = [(100, 18), (400, 99), (1000, 300)]
MIXES = [(1, 0, 0), (2, 2, 200), (1, 4, 0), (0, 2, 100)]
#: At N = 1000 the peer solves this mix alone: each takes it a quarter of an hour or more.
ASKED = (2, 2, 200)
LIMIT_S = 900
PEERS = {"CVXPY + Clarabel": "cvxpy clarabel"}


def draw(trains, patterns, seed=0):
    """Draw one spike a train on whole ms 1 to 200, shape (patterns, trains), and the target of each pattern."""
    random = np.random.default_rng(seed)
    return random.integers(1, 201, (patterns, trains)).astype(float), END * (1 + np.arange(patterns) % 3) / 4


def rows(spikes, times):
    """Coefficients of the potential at these times, shape (times, trains)."""
    x = np.maximum(np.asarray(times)[:, None] - spikes, 0.0) / TAU
    return x * np.exp(-x)


def peer(trains, patterns, lambdas):
    """Solve 6.11 with CVXPY and Clarabel; return time and result."""
    import cvxpy as cp  # noqa: PLC0415  a peer need not be there

    spikes, targets = draw(trains, patterns)
    at = np.concatenate([rows(s, [t]) for s, t in zip(spikes, targets, strict=True)])
    behind = np.concatenate([rows(s, [t + DELTA_T]) for s, t in zip(spikes, targets, strict=True)])
    silent, limit = [], []
    points = np.arange(END + 1)
    for one, t in zip(spikes, targets, strict=True):
        kept = points[(points < t) | (points > t + REFRACTORY)]
        silent.append(rows(one, kept))
        rise = THETA_PLUS * np.exp(-(kept - t - REFRACTORY) / (2 * TAU))
        limit.append(THETA_0 + np.where(kept > t, rise, 0.0))
    wanted = np.full(patterns, KAPPA * THETA_0)
    share = np.array(lambdas) / sum(lambdas)
    share /= [trains * BOUND, np.sqrt(trains) * BOUND, np.sum((BOUND * behind.sum(1) + wanted) ** 2)]
    w = cp.Variable(trains)
    terms = [cp.norm1(w), cp.norm(w, 2), cp.sum_squares(behind @ w - wanted)]
    objective = sum(s * term for s, term in zip(share, terms, strict=True) if s > 0)
    met = [at @ w == THETA_0, np.concatenate(silent) @ w <= np.concatenate(limit), w >= -BOUND, w <= BOUND]
    problem = cp.Problem(cp.Minimize(objective), met)
    begun = time.process_time()
    problem.solve(solver=cp.CLARABEL, max_threads=1)
    return {"cpu_s": time.process_time() - begun, "verdict": problem.status, "objective": float(problem.value)}


def case(trains, patterns, lambdas, rounds, *, asked, quick):
    """Measure one size and mix: ConeX, and in turn the peer, if it is `asked`."""
    spikes, targets = draw(trains, patterns)
    examples = [SpikeTrains.from_lists([[s] for s in one], stop=END) for one in spikes], [[t] for t in targets]
    cone = ConeX(neuron=Neuron(time="grid"), horizon=END, lambdas=lambdas, kappa=KAPPA)
    (packages,) = PEERS.values()
    run = partial(ask, __file__, trains, patterns, *lambdas, packages=packages, limit=LIMIT_S, quick=quick)
    ours, theirs = in_turn(lambda: cone.fit(*examples), dict.fromkeys(PEERS, run) if asked else {}, rounds)
    said = {
        "status": cone.status_,
        "engine": cone.engine_,
        "objective": cone.objective_,
        "gap": cone.gap_,
        "violation_mv": cone.violation_,
        "rounds": cone.rounds_,
        "weights of 0": int(np.sum(cone.weights_ == 0)),
    }
    out = {"ConeX": ours | said}
    for name, found in theirs.items():
        found["times ConeX, at least" if "stopped" in found else "times ConeX"] = found.pop("times", None)
        if found.get("verdict") == "optimal":
            found["objective, relative difference"] = found["objective"] / cone.objective_ - 1
        out[name] = found
    print(f"{trains}/{patterns} {lambdas}: {out}", file=sys.stderr)
    return out


def goals(result):
    """Return the goals with what a result reached."""
    # A peer that was stopped is at least so many times slower.
    times = {
        f"{size}, times ConeX": found.get("times ConeX", found.get("times ConeX, at least"))
        for size, case in result["cases"].items()
        # With a thousand trains the peer is asked for one mix only, as it takes minutes.
        if not size.startswith("1000/") or size.endswith(f"lambda {ASKED}")
        for found in (case.get("CVXPY + Clarabel", {}),)
    }
    return at_least(dict.fromkeys(times, 1.0), times)


def run(*, quick):
    """Measure; quick: no N = 1000."""
    absent = missing(PEERS)
    cases = {}
    for trains, patterns in SIZES[:2] if quick else SIZES:
        for lambdas in MIXES:
            asked = not absent and (trains < 1000 or lambdas == ASKED)
            rounds = 3 if trains < 1000 else 2
            found = case(trains, patterns, lambdas, rounds, asked=asked, quick=quick)
            cases[f"{trains}/{patterns}, lambda {lambdas}"] = found
    return {
        "question": __doc__.splitlines()[0],
        **stamp("clarabel", "cvxpy"),
        "left out": absent,
        "unit": "trains/patterns; CPU seconds, one thread",
        "kept": kept_of(cases),
        "cases": cases,
        "stable": all(found["ConeX"]["stable"] for found in cases.values()),
        "widest": WIDEST,
    }


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    arguments = argparse.ArgumentParser()
    arguments.add_argument("trains", type=int)
    arguments.add_argument("patterns", type=int)
    arguments.add_argument("lambdas", type=float, nargs=3)
    given = arguments.parse_args()
    print(json.dumps(peer(given.trains, given.patterns, given.lambdas)))
