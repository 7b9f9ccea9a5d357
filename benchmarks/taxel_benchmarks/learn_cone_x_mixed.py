"""ConeX with l1, norm and B in the objective against CVXPY + Clarabel (6.4.4, C = 3, on the grid).

Three sizes, four mixes of terms, one thread. The peer solves with *rows on demand*, as ConeX does: from the targets
alone, and again with the violated rows; and, up to N = 400, with *all rows* at once. It runs in a process of its own,
in turn with ConeX if it needs 3 s at most, and is stopped after 60 s of CPU, so that its ratio is a bound. Its time
is that of `solve` and of stating rows on demand, but not of stating all; ours is the whole `fit`.

Peer: CVXPY with Clarabel. Unit: times the CPU seconds of a fit. Goal: not slower than the peer, with its objective.
"""

import argparse
import json
import sys
import time
import warnings
from functools import partial

import numpy as np

from taxel import Neuron
from taxel.learn import ConeX
from taxel_benchmarks._goals import at_most, not_slower
from taxel_benchmarks._memory import BOUND, END, THETA_0, draw, equalities, every_row, on_demand, trains
from taxel_benchmarks._peer import ask, in_turn, missing, ratios_of
from taxel_benchmarks._rounds import WIDEST, stamp

KAPPA, DELTA_T = 1.2, 1.5
SIZES = [(100, 18), (400, 99), (1000, 300)]
MIXES = [(1, 0, 0), (2, 2, 200), (1, 4, 0), (0, 2, 100)]
#: The most trains with which the peer gets all rows, which takes it minutes at 1000.
MOST = 400
PEERS = {"CVXPY + Clarabel, rows on demand": "cvxpy clarabel", "CVXPY + Clarabel, all rows": "cvxpy clarabel"}
ON_DEMAND, ALL = PEERS
#: How far the objectives may differ, relative to ours; the violation and the gap of ours are below that.
APART = 1e-4


def peer(name, n, p, lambdas):
    """Solve 6.11 with CVXPY and Clarabel; return time and result."""
    import cvxpy as cp  # noqa: PLC0415  a peer need not be there

    at, behind, wanted = equalities(n, p), equalities(n, p, after=DELTA_T), np.full(p, KAPPA * THETA_0)
    share = np.array(lambdas) / sum(lambdas)
    share /= [n * BOUND, np.sqrt(n) * BOUND, np.sum((BOUND * behind.sum(1) + wanted) ** 2)]
    w = cp.Variable(n)
    terms = [cp.norm1(w), cp.norm(w, 2), cp.sum_squares(behind @ w - wanted)]
    objective = cp.Minimize(sum(s * term for s, term in zip(share, terms, strict=True) if s > 0))
    met = [at @ w == THETA_0, w >= -BOUND, w <= BOUND]

    def solve(rows, limits):
        if len(rows):
            met.append(rows @ w <= limits)
        problem = cp.Problem(objective, met)
        problem.solve(solver=cp.CLARABEL, max_threads=1)
        return {"optimal": "solved"}.get(problem.status, problem.status), w.value, float(problem.value)

    rows = every_row(n, p) if name == ALL else None
    begun = time.process_time()
    verdict, value = on_demand(n, p, solve) if rows is None else solve(*rows)[::2]
    return {"cpu_s": time.process_time() - begun, "verdict": verdict, "objective": value}


def asked(n):
    """Return the peers of a case with this many trains."""
    return [ON_DEMAND, ALL] if n <= MOST else [ON_DEMAND]


def case(n, p, lambdas, rounds, absent, *, quick):
    """Measure one size and mix: ConeX and the peer in turn."""
    examples = trains(*draw(n, p))
    cone = ConeX(neuron=Neuron(time="grid"), horizon=float(END), lambdas=lambdas, kappa=KAPPA)
    peers = {name: partial(ask, __file__, name, n, p, *lambdas, quick=quick) for name in asked(n) if name not in absent}
    ours, theirs = in_turn(lambda: cone.fit(*examples), peers, rounds)
    said = {
        "status": cone.status_,
        "objective": cone.objective_,
        "gap": cone.gap_,
        "violation_mv": cone.violation_,
        "rounds": cone.rounds_,
        "weights of 0": int(np.sum(cone.weights_ == 0)),
    }
    for found in theirs.values():
        if found.get("verdict") == "solved":
            found["objective, relative difference"] = found["objective"] / cone.objective_ - 1
    print(f"{n}/{p} {lambdas}: {theirs}", file=sys.stderr)
    return {"ConeX": ours | said, **theirs}


def goals(result):
    """Return the goals with what a result reached."""
    cases = result["cases"]
    names = [f"{n}/{p}, lambda {mix}, {name}" for n, p in SIZES for mix in MIXES for name in asked(n)]
    off = [
        abs(one["objective, relative difference"])
        for of in cases.values()
        for one in of.values()
        if "objective, relative difference" in one
    ]
    exact = {
        "objectives differ by at most, relative": max(off, default=None),
        "gap of ConeX, relative": max(of["ConeX"]["gap"] / of["ConeX"]["objective"] for of in cases.values()),
    }
    return not_slower({"ratios": result.get("ratios", {})}, *names) + at_most(dict.fromkeys(exact, APART), exact)


def run(*, quick):
    """Measure; quick: no N = 1000."""
    absent, cases = missing(PEERS), {}
    for n, p in SIZES[:2] if quick else SIZES:
        for lambdas in MIXES:
            found = case(n, p, lambdas, 3 if n < 1000 else 2, absent, quick=quick)
            cases[f"{n}/{p}, lambda {lambdas}"] = found
    return {
        "question": __doc__.splitlines()[0],
        **stamp("clarabel", "cvxpy"),
        "left out": absent,
        "unit": "trains/patterns; CPU seconds, one thread",
        "not asked": f"all rows above N = {MOST}, which takes minutes",
        "cases": cases,
        **ratios_of(cases),
        "stable": all(found["ConeX"]["stable"] for found in cases.values()),
        "widest": WIDEST,
    }


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    arguments = argparse.ArgumentParser()
    arguments.add_argument("peer", choices=PEERS)
    arguments.add_argument("trains", type=int)
    arguments.add_argument("patterns", type=int)
    arguments.add_argument("lambdas", type=float, nargs=3)
    given = arguments.parse_args()
    print(json.dumps(peer(given.peer, given.trains, given.patterns, given.lambdas)))
