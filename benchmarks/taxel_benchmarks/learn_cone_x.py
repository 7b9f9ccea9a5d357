"""ConeX against general solvers on the memory task (6.4.4, C = 3), with shortest weights and with mixes of terms.

On the grid, one thread. `learn_cone_x` finds the shortest weights, beside DAQP and PIQP; `learn_cone_x_mixed` has l1,
norm and B in the objective, beside CVXPY with Clarabel. Peers get *rows on demand*, as ConeX does: they begin with the
targets alone, and solve again with the violated rows (their peaks, from our sweep), DAQP from where it ended. CPU time
of the process: a peer's is that of solving and of stating rows on demand, ours the whole `fit`.

Peer: DAQP and PIQP; CVXPY with Clarabel. Unit: times the CPU seconds of a fit. Goal: not slower than any of them, with
its verdict and objective.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_certificate
from taxel_benchmarks._goals import Goal, at_least, at_most, not_slower
from taxel_benchmarks._rounds import measured, missing

TAU, THETA_0, THETA_PLUS, REFRACTORY, BOUND, END = 15.0, 0.3, 0.2, 3.0, 0.3, 200
#: How much the potential may be above its limit of silence.
TOLERANCE = 1e-8
KAPPA, DELTA_T = 1.2, 1.5
SIZES = [(100, 24), (400, 99), (1000, 300), (400, 141), (1000, 360)]
#: With terms that are mixed: sizes, and lambdas of l1, norm and B.
MIXED_SIZES = [(100, 18), (400, 99), (1000, 300)]
MIXES = [(1, 0, 0), (2, 2, 200), (1, 4, 0), (0, 2, 100)]
PEERS = {
    "DAQP, rows on demand": "daqp",
    "PIQP, rows on demand": "piqp",
    "CVXPY + Clarabel, rows on demand": "cvxpy clarabel",
}
DAQP, PIQP, CVXPY = PEERS

#: Takes the rows that are added, and their limits; returns the verdict, the weights and the objective.
Solve = Callable[[Any, Any], tuple[str, Any, float]]


def draw(n: int, p: int, seed: int = 0) -> tuple[Any, Any]:
    """Draw one spike per train on whole ms 1 to 200, shape (p, n), and the target of each pattern."""
    random = np.random.default_rng(seed)
    return random.integers(1, END + 1, (p, n)).astype(float), END * (1 + np.arange(p) % 3) / 4


def kernel(ages: Any) -> Any:
    """Alpha kernel at these ages, ms."""
    x = np.maximum(ages, 0.0) / TAU
    return x * np.exp(-x)


def limits(target: float) -> Any:
    """Limits of silence on whole ms (6.9b): the threshold; none at the target and while the neuron is refractory."""
    t = np.arange(END + 1.0)
    raised = np.where(t > target, THETA_0 + THETA_PLUS * np.exp(-(t - target - REFRACTORY) / (2 * TAU)), THETA_0)
    return np.where((t < target) | (t > target + REFRACTORY), raised, np.inf)


def equalities(n: int, p: int, after: float = 0.0) -> Any:
    """Return the rows of the potential at the targets, or so many ms after them."""
    spikes, targets = draw(n, p)
    return np.array([kernel(t + after - row) for row, t in zip(spikes, targets, strict=True)])


def on_demand(n: int, p: int, solve: Solve) -> tuple[str, float]:
    """Solve from the targets alone, adding the peak of each stretch above the limit of silence; return the verdict."""
    spikes, targets = draw(n, p)
    silence = np.array([limits(t) for t in targets])
    at = spikes.astype(int) + (END + 1) * np.arange(p)[:, None]
    decay = math.exp(-1 / TAU)
    rows, most = np.empty((0, n)), np.empty(0)
    while True:
        verdict, w, objective = solve(rows, most)
        if verdict != "solved":
            return verdict, objective
        inputs = np.bincount(at.ravel(), np.tile(w, p), p * (END + 1)).reshape(p, END + 1)
        potential, a, b = np.zeros((p, END + 1)), np.zeros(p), np.zeros(p)
        for t in range(1, END + 1):
            a, b = a * decay, (b + a / TAU) * decay
            potential[:, t] = b
            a = a + inputs[:, t]
        excess = potential - silence
        broken = [np.flatnonzero(over > TOLERANCE) for over in excess]
        added = [
            (pattern, stretch[np.argmax(excess[pattern, stretch])])
            for pattern, times in enumerate(broken)
            for stretch in np.split(times, np.flatnonzero(np.diff(times) > 1) + 1)
            if len(stretch)
        ]
        if not added:
            return "solved", objective
        rows = np.array([kernel(t - spikes[pattern]) for pattern, t in added])
        most = np.array([silence[pattern, t] for pattern, t in added])


def by_daqp(n: int, p: int) -> Solve:
    """Return shortest weights by DAQP, from the active rows of the last solution."""
    import daqp  # noqa: PLC0415  a peer need not be there

    # DAQP's states of a row: active, active at its lower limit, and an equality.
    active, lower, equal = 1, 3, 5
    held = [equalities(n, p), np.full(p, THETA_0), np.empty(0)]

    def solve(rows: Any, most: Any) -> tuple[str, Any, float]:
        held[:2] = np.concatenate([held[0], rows]), np.concatenate([held[1], most])
        upper = np.concatenate([np.full(n, BOUND), held[1]])
        least = np.concatenate([np.full(n, -BOUND), np.full(p, THETA_0), np.full(len(held[1]) - p, -1e30)])
        state, last = np.zeros(len(upper), np.intc), held[2]
        state[: len(last)] = np.where(last > 0, active, np.where(last < 0, lower, 0))
        state[n : n + p] = equal
        w, objective, flag, info = daqp.solve(
            np.eye(n), np.zeros(n), held[0], upper, least, state, iter_limit=1_000_000
        )
        held[2] = info["lam"]
        return {1: "solved", -1: "infeasible"}.get(flag, f"flag {flag}"), w, objective

    return solve


def by_piqp(n: int, p: int) -> Solve:
    """Return shortest weights by PIQP, from nothing with all rows so far."""
    import piqp  # noqa: PLC0415  a peer need not be there

    held = [np.empty((0, n)), np.empty(0)]
    names = {piqp.PIQP_SOLVED: "solved", piqp.PIQP_PRIMAL_INFEASIBLE: "infeasible"}

    def solve(rows: Any, most: Any) -> tuple[str, Any, float]:
        held[:] = np.concatenate([held[0], rows]), np.concatenate([held[1], most])
        solver = piqp.DenseSolver()
        solver.settings.verbose = False
        bounds = np.full(n, -BOUND), np.full(n, BOUND)
        silence = (held[0], np.full(len(held[0]), -np.inf), held[1]) if len(held[0]) else (None, None, None)
        solver.setup(np.eye(n), np.zeros(n), equalities(n, p), np.full(p, THETA_0), *silence, *bounds)
        status = solver.solve()
        return names.get(status, str(status)), solver.result.x, solver.result.info.primal_obj

    return solve


def by_cvxpy(lambdas: tuple[int, ...], n: int, p: int) -> Solve:
    """Return weights of 6.11 by CVXPY with Clarabel."""
    import cvxpy as cp  # noqa: PLC0415  a peer need not be there

    at, behind, wanted = equalities(n, p), equalities(n, p, after=DELTA_T), np.full(p, KAPPA * THETA_0)
    share = np.array(lambdas) / sum(lambdas)
    share /= [n * BOUND, np.sqrt(n) * BOUND, np.sum((BOUND * behind.sum(1) + wanted) ** 2)]
    w = cp.Variable(n)
    terms = [cp.norm1(w), cp.norm(w, 2), cp.sum_squares(behind @ w - wanted)]
    objective = cp.Minimize(sum(s * term for s, term in zip(share, terms, strict=True) if s > 0))
    met = [at @ w == THETA_0, w >= -BOUND, w <= BOUND]

    def solve(rows: Any, most: Any) -> tuple[str, Any, float]:
        if len(rows):
            met.append(rows @ w <= most)
        problem = cp.Problem(objective, met)
        problem.solve(solver=cp.CLARABEL, max_threads=1)
        return {"optimal": "solved"}.get(problem.status, problem.status), w.value, float(problem.value)

    return solve


@dataclass(frozen=True)
class Objective:
    """The benchmark of one kind of objective: sizes, lambdas (none for the shortest weights), how far peers may be."""

    about: str
    sizes: list[tuple[int, int]]
    mixes: list[tuple[int, ...]]
    peers: tuple[str, ...]
    apart: float

    def cases(self) -> dict[str, tuple[int, int, tuple[int, ...]]]:
        """Return trains, patterns and lambdas by name."""
        named = {mix: f", lambda {mix}" if mix else "" for mix in self.mixes}
        return {f"{n}/{p}{named[mix]}": (n, p, mix) for n, p in self.sizes for mix in self.mixes}

    def goals(self, result: Mapping[str, Any]) -> list[Goal]:
        """Return the goals with what a result reached."""
        agree, apart, proven = {}, {}, {}
        for name, case in result["cases"].items():
            ours = case["ConeX"]
            verdict = ours.get("verdict", ours.get("status"))
            found = [one for peer, one in case.items() if peer in self.peers and "verdict" in one]
            same = [one["verdict"] == verdict for one in found]
            # A peer that was stopped has no verdict.
            if same:
                agree[f"{name}, share of peers with ConeX's verdict"] = float(np.mean(same))
            off = [abs(one[key]) for one in found for key in one if key == "objective, relative difference"]
            if verdict == "solved" and off:
                apart[f"{name}, objectives differ by at most"] = max(off)
            elif verdict != "solved":
                proven[f"{name}, certificate of infeasibility checked"] = float(ours["certificate checked"])
        return (
            not_slower(result, *(f"{name}, {peer}" for name in self.cases() for peer in self.peers))
            + at_least(dict.fromkeys(agree | proven, 1.0), agree | proven)
            + at_most(dict.fromkeys(apart, self.apart), apart)
        )

    def run(self, *, quick: bool) -> dict[str, Any]:
        """Measure; quick: no N = 1000, one round."""
        warnings.simplefilter("ignore")
        found: dict[str, Any] = {"cases": {}, "results": {}, "ratios": {}, "spread": {}, "stable": True}
        for name, (n, p, mix) in self.cases().items():
            if n < 1000 or not quick:
                case, part = self._case(name, n, p, mix, rounds=1 if quick or n == 1000 else 3)
                found["cases"][name] = case
                for of in ("results", "ratios", "spread"):
                    found[of] |= part[of]
                found["stable"] &= part["stable"]
        return found

    def _case(
        self, name: str, n: int, p: int, mix: tuple[int, ...], *, rounds: int
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Measure one case, ConeX and the peers in turn; return verdicts, and times."""
        spikes, targets = draw(n, p)
        examples = [SpikeTrains.from_lists([[s] for s in row], stop=float(END)) for row in spikes]
        options: dict[str, Any] = {"lambdas": mix, "kappa": KAPPA} if mix else {}
        cone = ConeX(neuron=Neuron(time="grid"), horizon=float(END), **options)
        made = {DAQP: by_daqp, PIQP: by_piqp, CVXPY: partial(by_cvxpy, mix)}
        there = [peer for peer in self.peers if peer not in missing(PEERS)]
        theirs: dict[str, tuple[str, float]] = {}

        def ask(peer: str) -> None:
            theirs[peer] = on_demand(n, p, made[peer](n, p))

        runs: dict[str, Callable[[], Any]] = {f"{name}, ConeX": lambda: cone.fit(examples, [[t] for t in targets])}
        runs |= {f"{name}, {peer}": partial(ask, peer) for peer in there}
        pairs = {f"{name}, {peer}": (f"{name}, ConeX", f"{name}, {peer}") for peer in there}
        part = measured(runs, pairs, rounds=rounds, warm_up=rounds > 1)
        ours = {"verdict": cone.status_, "rounds": cone.rounds_, "held": len(cone.held_)}
        solved = cone.status_ == "solved"
        objective = 0.0
        if solved:
            objective = cone.objective_ if mix else 0.5 * float(cone.weights_ @ cone.weights_)
            ours |= {"objective": objective, "violation_mv": cone.violation_, "gap": cone.gap_}
        else:
            ours["certificate checked"] = bool(check_certificate(cone.problem_, cone.certificate_))
        case: dict[str, Any] = {"ConeX": ours}
        for peer, (verdict, one) in theirs.items():
            case[peer] = {"verdict": verdict, "objective": one}
            if solved and verdict == "solved":
                case[peer]["objective, relative difference"] = abs(one / objective - 1)
        return case, part


#: The benchmarks of this module.
BENCHMARKS = {
    "learn_cone_x": Objective(
        "ConeX against DAQP and PIQP: the shortest weights of the memory task (6.4.4, C = 3).",
        SIZES,
        [()],
        (DAQP, PIQP),
        1e-5,
    ),
    "learn_cone_x_mixed": Objective(
        "ConeX with l1, norm and B in the objective against CVXPY + Clarabel (6.4.4, C = 3, on the grid).",
        MIXED_SIZES,
        MIXES,
        (CVXPY,),
        1e-4,
    ),
}
