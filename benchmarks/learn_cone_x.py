"""ConeX against general solvers on the memory task (6.4.4, C = 3): Clarabel, HiGHS, PIQP; and the growth of its cost.

Shortest weights on the grid, one thread. Each peer gets the whole problem (HiGHS also only the rows that are
violated, from our sweep, with its warm dual simplex) in a process of its own. One that needs 3 s at most runs in turn
with ConeX; all are stopped after a minute of CPU, 15 with ``taxel bench --peers``, which saves the times above one.
HiGHS decides feasibility alone, which is easier. CPU time of the process, the statement of the rows not counted; for
ConeX it is the whole `fit`.

Peer: Clarabel, CVXPY, HiGHS and PIQP. Unit: CPU seconds a fit. Goal: not slower than the fastest of them.
"""

import argparse
import json
import math
import sys
import time
import warnings
from functools import partial

import numpy as np
import scipy.sparse as sp
from _goals import at_least
from _peer import ask, in_turn, kept_of, missing
from _rounds import WIDEST, stamp

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_certificate

TAU, THETA_0, THETA_PLUS, REFRACTORY, BOUND, END = 15.0, 0.3, 0.2, 3.0, 0.3, 200
CASES = [(100, 24), (400, 99), (1000, 300), (400, 141), (1000, 360)]
QUICK = [(100, 24), (400, 99), (400, 141)]
LIMIT_S = 900
#: The modules that each peer needs.
PEERS = {
    "Clarabel": "clarabel",
    "CVXPY + Clarabel": "cvxpy clarabel",
    "HiGHS, all rows": "highspy",
    "HiGHS, rows on demand": "highspy",
    "PIQP": "piqp",
}
GROWTH = [250, 500, 1000, 2000, 4000]


def draw(n, p, seed=0):
    """Draw one spike a train on whole ms 1 to 200, shape (p, n), and the target of each pattern."""
    random = np.random.default_rng(seed)
    return random.integers(1, END + 1, (p, n)).astype(float), END * (1 + np.arange(p) % 3) / 4


def trains(spikes, targets):
    """Return trains and targets as ConeX takes them."""
    patterns = [SpikeTrains.from_lists([[s] for s in row], stop=float(END)) for row in spikes]
    return patterns, [[t] for t in targets]


def kernel(ages):
    """Alpha kernel at these ages, ms."""
    x = np.maximum(ages, 0.0) / TAU
    return x * np.exp(-x)


def threshold(t, target):
    """Threshold at `t`; the neuron fired at `target` if that is past."""
    return np.where(t > target, THETA_0 + THETA_PLUS * np.exp(-(t - target - REFRACTORY) / (2 * TAU)), THETA_0)


def silent(target):
    """Whole ms at which the neuron must be silent (6.9b)."""
    points = np.arange(END + 1.0)
    return points[(points < target) | (points > target + REFRACTORY)]


def state(n, p):
    """State 6.9 with every row: equalities, their values, inequalities, their limits."""
    spikes, targets = draw(n, p)
    equal = np.array([kernel(t - row) for row, t in zip(spikes, targets, strict=True)])
    points = [silent(t) for t in targets]
    unequal = np.empty((sum(map(len, points)), n))
    at = 0
    for row, times in zip(spikes, points, strict=True):
        unequal[at : at + len(times)] = kernel(times[:, None] - row)
        at += len(times)
    limits = np.concatenate([threshold(times, t) for times, t in zip(points, targets, strict=True)])
    return equal, np.full(p, THETA_0), unequal, limits


def by_clarabel(n, p):
    """Solve it with Clarabel, from the matrices."""
    import clarabel  # noqa: PLC0415  a peer need not be there

    equal, values, unequal, limits = state(n, p)
    identity = sp.eye_array(n)
    a = sp.vstack([sp.csc_array(equal), sp.csc_array(unequal), identity, -identity], format="csc")
    b = np.concatenate([values, limits, np.full(2 * n, BOUND)])
    cones = [clarabel.ZeroConeT(p), clarabel.NonnegativeConeT(len(limits) + 2 * n)]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    begun = time.process_time()
    found = clarabel.DefaultSolver(sp.eye_array(n, format="csc"), np.zeros(n), a, b, cones, settings).solve()
    took = time.process_time() - begun
    verdict = {"Solved": "solved", "PrimalInfeasible": "infeasible"}.get(str(found.status), str(found.status))
    return took, verdict, found.obj_val


def by_cvxpy(n, p):
    """Solve it with Clarabel through CVXPY."""
    import cvxpy as cp  # noqa: PLC0415  a peer need not be there

    equal, values, unequal, limits = state(n, p)
    w = cp.Variable(n)
    rows = [equal @ w == values, unequal @ w <= limits, w >= -BOUND, w <= BOUND]
    problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(w)), rows)
    begun = time.process_time()
    problem.solve(solver=cp.CLARABEL)
    took = time.process_time() - begun
    return took, {"optimal": "solved"}.get(problem.status, problem.status), problem.value


def by_highs(n, p):
    """Decide it with HiGHS, all rows at once."""
    import highspy  # noqa: PLC0415  a peer need not be there

    equal, values, unequal, limits = state(n, p)
    a = sp.csr_array(np.concatenate([equal, unequal]))
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = n, a.shape[0]
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = np.zeros(n), np.full(n, -BOUND), np.full(n, BOUND)
    lp.row_lower_ = np.concatenate([values, np.full(len(limits), -highspy.kHighsInf)])
    lp.row_upper_ = np.concatenate([values, limits])
    lp.a_matrix_.format_ = highspy.MatrixFormat.kRowwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = a.indptr, a.indices, a.data
    solver = _silent_highs()
    begun = time.process_time()
    solver.passModel(lp)
    solver.run()
    return time.process_time() - begun, _said(solver), 0.0


def _silent_highs():
    import highspy  # noqa: PLC0415  a peer need not be there

    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("threads", 1)
    solver.setOptionValue("primal_feasibility_tolerance", 1e-9)
    return solver


def _said(solver):
    import highspy  # noqa: PLC0415  a peer need not be there

    names = {highspy.HighsModelStatus.kOptimal: "solved", highspy.HighsModelStatus.kInfeasible: "infeasible"}
    return names.get(solver.getModelStatus(), solver.modelStatusToString(solver.getModelStatus()))


def by_highs_on_demand(n, p):
    """Decide it with HiGHS from the targets alone, adding the peak of each stretch above the limit of silence."""
    import highspy  # noqa: PLC0415  a peer need not be there

    spikes, targets = draw(n, p)
    begun = time.process_time()
    solver = _silent_highs()
    solver.addVars(n, np.full(n, -BOUND), np.full(n, BOUND))
    every = np.arange(n, dtype=np.int32)
    for row, t in zip(spikes, targets, strict=True):
        solver.addRow(THETA_0, THETA_0, n, every, kernel(t - row))
    points = np.arange(END + 1.0)
    limits = np.array([np.where(np.isin(points, silent(t)), threshold(points, t), np.inf) for t in targets])
    at = spikes.astype(int) + (END + 1) * np.arange(p)[:, None]
    decay = math.exp(-1 / TAU)
    while True:
        solver.run()
        if _said(solver) != "solved":
            return time.process_time() - begun, _said(solver), 0.0
        w = np.array(solver.getSolution().col_value)
        inputs = np.bincount(at.ravel(), np.tile(w, p), p * (END + 1)).reshape(p, END + 1)
        potential, a, b = np.zeros((p, END + 1)), np.zeros(p), np.zeros(p)
        for t in range(1, END + 1):
            a, b = a * decay, (b + a / TAU) * decay
            potential[:, t] = b
            a = a + inputs[:, t]
        excess = potential - limits
        added = 0
        for pattern, over in enumerate(excess):
            broken = np.flatnonzero(over > 1e-8)
            for stretch in np.split(broken, np.flatnonzero(np.diff(broken) > 1) + 1):
                if len(stretch):
                    t = stretch[np.argmax(over[stretch])]
                    solver.addRow(-highspy.kHighsInf, limits[pattern, t], n, every, kernel(t - spikes[pattern]))
                    added += 1
        if not added:
            return time.process_time() - begun, "solved", 0.0


def by_piqp(n, p):
    """Solve it with PIQP, dense."""
    import piqp  # noqa: PLC0415  a peer need not be there

    equal, values, unequal, limits = state(n, p)
    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    begun = time.process_time()
    solver.setup(
        np.eye(n),
        np.zeros(n),
        equal,
        values,
        unequal,
        np.full(len(limits), -np.inf),
        limits,
        np.full(n, -BOUND),
        np.full(n, BOUND),
    )
    status = solver.solve()
    took = time.process_time() - begun
    verdict = {piqp.PIQP_SOLVED: "solved", piqp.PIQP_PRIMAL_INFEASIBLE: "infeasible"}.get(status, str(status))
    return took, verdict, solver.result.info.primal_obj


def peer(name, n, p):
    """Run one peer; return its time and result."""
    warnings.simplefilter("ignore")
    run = {
        "Clarabel": lambda: by_clarabel(n, p),
        "CVXPY + Clarabel": lambda: by_cvxpy(n, p),
        "HiGHS, all rows": lambda: by_highs(n, p),
        "HiGHS, rows on demand": lambda: by_highs_on_demand(n, p),
        "PIQP": lambda: by_piqp(n, p),
    }[name]
    took, verdict, objective = run()
    return {"cpu_s": took, "verdict": verdict, "objective": objective}


def against(n, p, rounds, peers, *, quick):
    """Measure one case: ConeX and the peers in turn."""
    patterns, targets = trains(*draw(n, p))
    cone = ConeX(neuron=Neuron(time="grid"), horizon=float(END))
    asked = {
        name: partial(ask, __file__, name, n, p, packages=PEERS[name], limit=LIMIT_S, quick=quick) for name in peers
    }
    ours, theirs = in_turn(lambda: cone.fit(patterns, targets), asked, rounds)
    out = {"ConeX": {**ours, "verdict": cone.status_, "rounds": cone.rounds_, "held": len(cone.held_)}}
    if cone.status_ == "solved":
        out["ConeX"]["objective"] = 0.5 * float(cone.weights_ @ cone.weights_)
        out["ConeX"]["violation_mv"] = cone.violation_
    else:
        out["ConeX"]["certificate checked"] = bool(check_certificate(cone.problem_, cone.certificate_))
    for name, found in theirs.items():
        found["times ConeX, at least" if "stopped" in found else "times ConeX"] = found.pop("times", None)
        if found.get("verdict") == cone.status_ == "solved" and not name.startswith("HiGHS"):
            found["objective, relative difference"] = found["objective"] / out["ConeX"]["objective"] - 1
        out[name] = found
        print(f"{n}/{p} {name}: {found}", file=sys.stderr)
    # A peer that was stopped has no verdict to compare.
    verdicts = {found.get("verdict") for found in out.values()} & {"solved", "infeasible"}
    return out | {"verdicts equal": len(verdicts) == 1}


def growth(most):
    """Measure ConeX as N and p grow, grid and continuous, one fit each."""
    table = []
    for clock in ("grid", "continuous"):
        for share in (0.25, 0.3):
            for n in (n for n in GROWTH if n <= most):
                p = round(share * n / 3) * 3
                patterns, targets = trains(*draw(n, p))
                cone = ConeX(neuron=Neuron(time=clock), horizon=float(END))
                begun = time.process_time()
                cone.fit(patterns, targets)
                table.append(
                    {
                        "time": clock,
                        "N": n,
                        "p": p,
                        "cpu_s": time.process_time() - begun,
                        "status": cone.status_,
                        "rounds": cone.rounds_,
                        "rows held": len(cone.held_),
                    }
                )
                print(table[-1], file=sys.stderr)
    return table


WHY = (
    "Rows held grow as N (.78 N at p = .3 N). Each round multiplies its new rows (2 N in all) with those held and "
    "updates their factor: N^3 in both, but as a few matrix products and blocked solves, so N^2 work (writing rows "
    "out, pricing) and overheads show at small N and N^3 only at large. Rounds hardly grow. "
    "Continuous time has slope rows besides, and finds its cuts between inputs: about as many."
)


def goals(result):
    """Return the goals with what a result reached."""
    # A peer that was stopped is at least so many times slower.
    times = {
        f"{size}, {peer}, times ConeX": found.get("times ConeX", found.get("times ConeX, at least"))
        for size, case in result["cases"].items()
        for peer, found in ((peer, case.get(peer, {})) for peer in PEERS)
    }
    return at_least(dict.fromkeys(times, 1.0), times)


def run(*, quick):
    """Measure; quick: no N = 1000, growth to N = 1000."""
    rounds, absent = 3 if quick else 7, missing(PEERS)
    peers = [name for name in PEERS if name not in absent]
    cases = {f"{n}/{p}": against(n, p, rounds, peers, quick=quick) for n, p in (QUICK if quick else CASES)}
    return {
        "question": __doc__.splitlines()[0],
        **stamp("clarabel", "cvxpy", "highspy", "piqp"),
        "left out": absent,
        "unit": "N/p: trains and patterns; C = 3; CPU seconds, one thread",
        "kept": kept_of(cases),
        "cases": cases,
        "growth": {"table": growth(1000 if quick else 4000), "why": WHY},
        "stable": all(case["ConeX"]["stable"] for case in cases.values()),
        "widest": WIDEST,
    }


if __name__ == "__main__":
    arguments = argparse.ArgumentParser()
    arguments.add_argument("peer", choices=PEERS)
    arguments.add_argument("trains", type=int)
    arguments.add_argument("patterns", type=int)
    given = arguments.parse_args()
    print(json.dumps(peer(given.peer, given.trains, given.patterns)))
