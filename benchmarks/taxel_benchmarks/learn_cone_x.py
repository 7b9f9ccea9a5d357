"""ConeX against general solvers on the memory task (6.4.4, C = 3); and the growth of its cost.

Shortest weights on the grid, one thread. *Rows on demand*: DAQP, PIQP and HiGHS begin with the targets alone, as ConeX
does, and solve again with the violated rows (its peaks, from our sweep), DAQP and HiGHS from where they ended. *All
rows*: Clarabel, CVXPY, HiGHS and PIQP get the whole problem at once, up to N = 400, as it takes them minutes at 1000.
HiGHS decides feasibility alone, which is easier. Each runs in a process of its own; one that needs 3 s at most runs in
turn with ConeX, and all are stopped after 60 s of CPU, so that their ratio is a bound. CPU time of the process; the
statement of all rows is not counted, that of rows on demand is; for ConeX it is the whole `fit`.

Peer: DAQP, PIQP and HiGHS with rows on demand; Clarabel, CVXPY, HiGHS and PIQP with all. Unit: times the CPU seconds of
a fit. Goal: not slower than the fastest of them, with the verdict and the objective of each.
"""

import argparse
import json
import sys
import time
import warnings
from functools import partial

import numpy as np
import scipy.sparse as sp

from taxel import Neuron
from taxel.learn import ConeX, check_certificate
from taxel_benchmarks._goals import at_least, at_most, not_slower
from taxel_benchmarks._memory import BOUND, END, THETA_0, draw, equalities, every_row, on_demand, trains
from taxel_benchmarks._peer import ask, in_turn, missing, ratios_of
from taxel_benchmarks._rounds import WIDEST, stamp

CASES = [(100, 24), (400, 99), (1000, 300), (400, 141), (1000, 360)]
QUICK = [(100, 24), (400, 99), (400, 141)]
#: The most trains with which a peer gets all rows.
MOST = 400
#: The modules that each peer needs.
PEERS = {
    "DAQP, rows on demand": "daqp",
    "PIQP, rows on demand": "piqp",
    "HiGHS, rows on demand": "highspy",
    "Clarabel, all rows": "clarabel",
    "CVXPY with Clarabel, all rows": "cvxpy clarabel",
    "HiGHS, all rows": "highspy",
    "PIQP, all rows": "piqp",
}
#: How far the objective of a peer may differ, relative to it.
APART = 1e-5
GROWTH = [250, 500, 1000, 2000, 4000]


def timed(solve):
    """Return CPU time, verdict and objective of a call that returns the last two."""
    begun = time.process_time()
    verdict, objective = solve()
    return time.process_time() - begun, verdict, objective


def by_clarabel(n, p):
    """Solve it with Clarabel, from the matrices."""
    import clarabel  # noqa: PLC0415  a peer need not be there

    (unequal, limits), identity = every_row(n, p), sp.eye_array(n)
    a = sp.vstack([sp.csc_array(equalities(n, p)), sp.csc_array(unequal), identity, -identity], format="csc")
    b = np.concatenate([np.full(p, THETA_0), limits, np.full(2 * n, BOUND)])
    cones = [clarabel.ZeroConeT(p), clarabel.NonnegativeConeT(len(limits) + 2 * n)]
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1

    def solve():
        found = clarabel.DefaultSolver(sp.eye_array(n, format="csc"), np.zeros(n), a, b, cones, settings).solve()
        names = {"Solved": "solved", "PrimalInfeasible": "infeasible"}
        return names.get(str(found.status), str(found.status)), found.obj_val

    return timed(solve)


def by_cvxpy(n, p):
    """Solve it with Clarabel through CVXPY."""
    import cvxpy as cp  # noqa: PLC0415  a peer need not be there

    unequal, limits = every_row(n, p)
    w = cp.Variable(n)
    rows = [equalities(n, p) @ w == THETA_0, unequal @ w <= limits, w >= -BOUND, w <= BOUND]
    problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(w)), rows)

    def solve():
        problem.solve(solver=cp.CLARABEL)
        return {"optimal": "solved"}.get(problem.status, problem.status), problem.value

    return timed(solve)


class Highs:
    """HiGHS with the targets' rows, to which rows are added; its simplex goes on from where it ended."""

    def __init__(self, n, p):
        import highspy  # noqa: PLC0415  a peer need not be there

        self.of, self.solver = highspy, highspy.Highs()
        for name, value in (("output_flag", False), ("threads", 1), ("primal_feasibility_tolerance", 1e-9)):
            self.solver.setOptionValue(name, value)
        self.solver.addVars(n, np.full(n, -BOUND), np.full(n, BOUND))
        self.add(equalities(n, p), np.full(p, THETA_0), np.full(p, THETA_0))

    def add(self, rows, least, most):
        """Add rows between two limits each."""
        a = sp.csr_array(rows)
        self.solver.addRows(len(rows), least, most, a.nnz, a.indptr[:-1], a.indices, a.data)

    def solve(self, rows, limits):
        """Add rows of silence, and solve."""
        self.add(rows, np.full(len(rows), -self.of.kHighsInf), limits)
        self.solver.run()
        states = self.of.HighsModelStatus
        names = {states.kOptimal: "solved", states.kInfeasible: "infeasible"}
        status = self.solver.getModelStatus()
        verdict = names.get(status, self.solver.modelStatusToString(status))
        return verdict, np.array(self.solver.getSolution().col_value), None


def by_highs(n, p):
    """Decide it with HiGHS, all rows at once."""
    solver, rows = Highs(n, p), every_row(n, p)
    return timed(lambda: solver.solve(*rows)[::2])


def by_highs_on_demand(n, p):
    """Decide it with HiGHS, with rows on demand."""
    return timed(lambda: on_demand(n, p, Highs(n, p).solve))


def piqp_solve(n, p, rows, limits):
    """Solve it with PIQP with these rows of silence, dense; return verdict, weights and objective."""
    import piqp  # noqa: PLC0415  a peer need not be there

    solver = piqp.DenseSolver()
    solver.settings.verbose = False
    none = np.full(len(rows), -np.inf)
    bounds = np.full(n, -BOUND), np.full(n, BOUND)
    silence = (rows, none, limits) if len(rows) else (None, None, None)
    solver.setup(np.eye(n), np.zeros(n), equalities(n, p), np.full(p, THETA_0), *silence, *bounds)
    status = solver.solve()
    verdict = {piqp.PIQP_SOLVED: "solved", piqp.PIQP_PRIMAL_INFEASIBLE: "infeasible"}.get(status, str(status))
    return verdict, solver.result.x, solver.result.info.primal_obj


def by_piqp(n, p):
    """Solve it with PIQP, all rows at once."""
    rows = every_row(n, p)
    return timed(lambda: piqp_solve(n, p, *rows)[::2])


def by_piqp_on_demand(n, p):
    """Solve it with PIQP, with rows on demand."""
    held = [np.empty((0, n)), np.empty(0)]

    def solve(rows, limits):
        held[:] = np.concatenate([held[0], rows]), np.concatenate([held[1], limits])
        return piqp_solve(n, p, *held)

    return timed(lambda: on_demand(n, p, solve))


def by_daqp_on_demand(n, p):
    """Solve it with DAQP, with rows on demand, from the active rows of the last solution."""
    import daqp  # noqa: PLC0415  a peer need not be there

    # DAQP's states of a row: active, active at its lower limit, and an equality.
    active, lower, equal = 1, 3, 5
    held = [equalities(n, p), np.full(p, THETA_0), np.empty(0)]

    def solve(rows, limits):
        held[:2] = np.concatenate([held[0], rows]), np.concatenate([held[1], limits])
        most = np.concatenate([np.full(n, BOUND), held[1]])
        least = np.concatenate([np.full(n, -BOUND), np.full(p, THETA_0), np.full(len(held[1]) - p, -1e30)])
        state, last = np.zeros(len(most), np.intc), held[2]
        state[: len(last)] = np.where(last > 0, active, np.where(last < 0, lower, 0))
        state[n : n + p] = equal
        w, objective, flag, info = daqp.solve(np.eye(n), np.zeros(n), held[0], most, least, state, iter_limit=1_000_000)
        held[2] = info["lam"]
        return {1: "solved", -1: "infeasible"}.get(flag, f"flag {flag}"), w, objective

    return timed(lambda: on_demand(n, p, solve))


RUNS = dict(
    zip(
        PEERS,
        (by_daqp_on_demand, by_piqp_on_demand, by_highs_on_demand, by_clarabel, by_cvxpy, by_highs, by_piqp),
        strict=True,
    )
)


def peer(name, n, p):
    """Run one peer; return its time and result."""
    warnings.simplefilter("ignore")
    took, verdict, objective = RUNS[name](n, p)
    return {"cpu_s": took, "verdict": verdict, "objective": objective}


def asked(n):
    """Return the peers of a case with this many trains."""
    return [name for name in PEERS if n <= MOST or name.endswith("on demand")]


def against(n, p, rounds, absent, *, quick):
    """Measure one case: ConeX and the peers in turn."""
    patterns, targets = trains(*draw(n, p))
    cone = ConeX(neuron=Neuron(time="grid"), horizon=float(END))
    peers = {name: partial(ask, __file__, name, n, p, quick=quick) for name in asked(n) if name not in absent}
    ours, theirs = in_turn(lambda: cone.fit(patterns, targets), peers, rounds)
    ours |= {"verdict": cone.status_, "rounds": cone.rounds_, "held": len(cone.held_)}
    if cone.status_ == "solved":
        ours["objective"] = 0.5 * float(cone.weights_ @ cone.weights_)
        ours["violation_mv"] = cone.violation_
        ours["gap"] = cone.gap_
    else:
        ours["certificate checked"] = bool(check_certificate(cone.problem_, cone.certificate_))
    for name, found in theirs.items():
        if found.get("verdict") == cone.status_ == "solved" and found["objective"] is not None:
            found["objective, relative difference"] = abs(found["objective"] / ours["objective"] - 1)
        print(f"{n}/{p} {name}: {found}", file=sys.stderr)
    return {"ConeX": ours, **theirs}


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
    names = [f"{n}/{p}, {name}" for n, p in CASES for name in asked(n)]
    # A peer that was stopped has no verdict.
    agree, apart, proven = {}, {}, {}
    for size, case in result["cases"].items():
        ours = case["ConeX"]
        found = [one for name, one in case.items() if name in PEERS and "verdict" in one]
        same = [one["verdict"] == ours["verdict"] for one in found]
        agree[f"{size}, share of peers with ConeX's verdict"] = np.mean(same) if same else None
        off = [abs(one[key]) for one in found for key in one if key == "objective, relative difference"]
        if ours["verdict"] == "solved":
            apart[f"{size}, objectives differ by at most"] = max(off, default=None)
        else:
            proven[f"{size}, certificate of infeasibility checked"] = float(ours["certificate checked"])
    return (
        not_slower({"ratios": result.get("ratios", {})}, *names)
        + at_least(dict.fromkeys(agree | proven, 1.0), agree | proven)
        + at_most(dict.fromkeys(apart, APART), apart)
    )


def run(*, quick):
    """Measure; quick: no N = 1000, growth to N = 1000."""
    rounds, absent = 3 if quick else 7, missing(PEERS)
    cases = {f"{n}/{p}": against(n, p, rounds, absent, quick=quick) for n, p in (QUICK if quick else CASES)}
    return {
        "question": __doc__.splitlines()[0],
        **stamp("clarabel", "cvxpy", "daqp", "highspy", "piqp"),
        "left out": absent,
        "unit": "N/p: trains and patterns; C = 3; CPU seconds, one thread",
        "not asked": f"peers with all rows above N = {MOST}, which takes them minutes",
        "cases": cases,
        **ratios_of(cases),
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
