"""Delays and decays that CONE solves for: copies of every input, chosen from by l1, beside one random delay an input.

Delays found by a linear programme are not new: Rostro-Gonzalez, Vasquez, Cessac and Viéville 2010 (hal
inria-00455415) find weights at each delay, in discrete time, for a whole network. Here silence holds at every instant,
weights have bounds, and a least l1 norm selects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import linprog

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.capacity import DURATION_MS, patterns, satisfied, weakest
from taxel_studies.mapping import LEARN, TABLE, thresholds
from taxel_studies.runner import noted
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, subplots

WHERE = "thesis 6.6.3, which names delays and kernels"
PROTOCOL = (
    "Patterns and targets of 6.4.4: one spike an input on a random whole ms from 1 to 200, class c of C shall fire "
    "once at 200 c / (C + 1) ms. Each input arrives as it is; or put off by one random delay of its own; or "
    "several times, at delays spaced evenly from 0 to the longest, each copy with a weight. Load: the largest p, a "
    "multiple of C, at which all realisations are feasible, p over inputs. Selection: at given loads the weights "
    "of least l1 norm; p over the weights that are not 0. Table 6.1, bounds ±0.3 mV a copy, silence at every "
    "instant from 0 to 200 ms. Decays: each input has a copy with each time constant of the kernel; as taxel's neuron "
    "has one, 6.11 with l1 alone is stated by itself, silence at each ms, and solved by HiGHS, rows added on demand."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 30,
    "inputs": [50, 100, 150],
    "classes": 3,
    "copies": [2, 4],
    "longest_ms": 90.0,
    "shares": [0.1, 0.2],
    "time": "continuous",
    "decays_ms": [7.5, 15.0, 30.0],
}
TOY: dict[str, Any] = {"realisations": 2, "inputs": [40], "copies": [3], "shares": [0.1]}
SIZES = {"toy": TOY}
#: On the grid of decays silence is this far below the threshold, mV.
BELOW = 1e-6
#: A weight below this counts as 0, mV: a millionth of the bound.
NONE = 3e-7


def arms(p: Parameters) -> list[str]:
    """Name what is compared: inputs as they are, one random delay each, and so many copies."""
    return ["none", "random", *(f"{copies} copies" for copies in p["copies"])]


def tasks(p: Parameters) -> list[Task]:
    """List one search an arm and N, and one selection an arm, N, load and realisation; the longest first."""
    shared = {"classes": p["classes"], "longest_ms": p["longest_ms"], "time": p["time"]}
    listed = []
    for inputs in sorted(p["inputs"], reverse=True):
        for arm in reversed(arms(p)):
            one = {**shared, "inputs": inputs, "arm": arm}
            listed.append(Task({**one, "asks": "capacity", "realisations": p["realisations"]}))
            for share in p["shares"]:
                listed += [Task({**one, "asks": "weights", "share": share}, seed) for seed in range(p["realisations"])]
    for taus in ([TABLE["tau"]], p["decays_ms"]):
        one = {"classes": p["classes"], "inputs": max(p["inputs"]), "arm": "decays", "asks": "decays", "taus_ms": taus}
        listed += [Task({**one, "share": s}, seed) for s in p["shares"] for seed in range(p["realisations"])]
    return listed


def chosen_decays(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return what least l1 leaves of copies of all inputs with each time constant, at a load, as `realise` does.

    The rows are those of 6.11 at each ms: equality at targets, silence elsewhere but for the refractory period.
    """
    step, inputs = params["classes"], params["inputs"]
    count = max(round(params["share"] * inputs / step), 1) * step
    drawn, targets = patterns(seed, inputs, count, step)
    grid = np.arange(DURATION_MS + 1)
    since = np.maximum(grid[None, :, None] - np.array([one.times for one in drawn])[:, None, :], 0.0)
    rows = np.concatenate([since / tau * np.exp(-since / tau) for tau in params["taus_ms"]], axis=2)
    after = grid[None, :] - np.array(targets, float)
    theta = np.array([thresholds(grid, one) for one in targets])
    silent = (after < 0) | (after > TABLE["refractory"])
    met = rows[after == 0]
    asked = silent & (grid % 10 == 0)
    while True:
        above = rows[asked]
        found = linprog(
            np.ones(2 * rows.shape[2]),
            np.hstack([above, -above]),
            theta[asked] - BELOW,
            np.hstack([met, -met]),
            np.full(count, TABLE["theta_0"]),
            (0.0, LEARN["ub"]),
        )
        if found.status or found.x is None:
            return {"p": count, "solved": False}
        weights = found.x[: rows.shape[2]] - found.x[rows.shape[2] :]
        broken = silent & ~asked & (rows @ weights > theta - BELOW / 2)
        if not broken.any():
            break
        asked |= broken
    chosen = (np.abs(weights) > NONE).reshape(-1, inputs)
    return {"p": count, "solved": True, "weights": int(chosen.sum()), "heard": int(chosen.any(axis=0).sum())}


def delayed(params: dict[str, Any], drawn: Sequence[SpikeTrains], seed: int) -> list[SpikeTrains]:
    """Return patterns as an arm delays them; random delays are the same in all patterns of a realisation."""
    arm, longest, inputs = params["arm"], params["longest_ms"], params["inputs"]
    if arm == "none":
        return list(drawn)
    if arm == "random":
        delays = np.random.default_rng([seed, inputs, 1]).uniform(0.0, longest, inputs)
        return [
            SpikeTrains(one.times + np.repeat(delays, one.counts), one.offsets, one.start, one.stop + longest)
            for one in drawn
        ]
    return [one.delayed(np.linspace(0.0, longest, int(arm.split()[0]))) for one in drawn]


def fit(params: dict[str, Any], count: int, seed: int, lambdas: tuple[float, float, float]) -> ConeX:
    """Learn so many patterns of a realisation, with the inputs of an arm."""
    drawn, targets = patterns(seed, params["inputs"], count, params["classes"])
    neuron = Neuron(**TABLE, time=params["time"])
    cone = ConeX(neuron=neuron, **LEARN, lambdas=lambdas, horizon=DURATION_MS)
    return noted(cone.fit(delayed(params, drawn, seed), targets))


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Search the largest load at which all realisations are feasible, or select weights by l1 at a given one.

    Returns
    -------
    dict
        ``p`` and, of a selection, ``solved``, ``weights`` (how many are not 0), ``heard`` (inputs that have one).
    """
    step, inputs = params["classes"], params["inputs"]
    if params["asks"] == "decays":
        return chosen_decays(params, seed)
    if params["asks"] == "weights":
        count = max(round(params["share"] * inputs / step), 1) * step
        cone = fit(params, count, seed, (1.0, 0.0, 0.0))
        if cone.status_ not in ("solved", "feasible"):
            return {"p": count, "solved": False}
        chosen = (np.abs(cone.weights_) > NONE).reshape(-1, inputs)
        return {"p": count, "solved": True, "weights": int(chosen.sum()), "heard": int(chosen.any(axis=0).sum())}

    limits = weakest(lambda of, count: satisfied(fit(params, count, of, (0.0, 1.0, 0.0))), params, seed)
    return {"p": limits[-1][1]}


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List by arm and N the largest load, and by load the mean of the weights that l1 leaves."""
    lines = []
    for arm in arms(p):
        here = [r for r in rows if r.params["arm"] == arm]
        line: dict[str, Any] = {"arm": arm, "inputs": list(p["inputs"]), "load": [], "selected": []}
        for inputs in p["inputs"]:
            (largest,) = (r.result["p"] for r in here if _of(r, inputs, "capacity"))
            line["load"].append(round(largest / inputs, 4))
        for share in p["shares"]:
            for inputs in p["inputs"]:
                some = [r.result for r in here if _of(r, inputs, "weights") and r.params["share"] == share]
                solved = [s for s in some if s["solved"]]
                mean = {name: float(np.mean([s[name] for s in solved])) for name in ("weights", "heard") if solved}
                count = some[0]["p"]
                line["selected"].append(
                    {
                        "share": share,
                        "inputs": inputs,
                        "p": count,
                        "solved": len(solved),
                        "of": len(some),
                        **mean,
                        "by_weight": count / mean["weights"] if solved else None,
                    }
                )
        lines.append(line)
    decays = []
    for taus in ([TABLE["tau"]], p["decays_ms"]):
        for share in p["shares"]:
            some = [r.result for r in rows if r.params.get("taus_ms") == taus and r.params["share"] == share]
            weights = [s["weights"] for s in some if s["solved"]]
            counts = {"p": some[0]["p"], "of": len(some), "solved": len(weights)}
            decays.append(
                {"taus_ms": taus, "share": share, **counts, "weights": float(np.mean(weights)) if weights else None}
            )
    return {"lines": lines, "decays": decays}


def _of(row: Row, inputs: int, asks: str) -> bool:
    return bool(row.params["inputs"] == inputs and row.params["asks"] == asks)


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.6.3 holds possible, and what is asked of it here."""
    lines = {line["arm"]: line for line in summary["lines"]}
    most = f"{max(p['copies'])} copies"
    last = -1  # the most inputs
    plain, random, copied = (lines[arm]["load"][last] for arm in ("none", "random", most))
    loads = ", ".join(f"{arm} {line['load'][last]:g}" for arm, line in lines.items())
    at = f"N = {p['inputs'][last]}"
    yield Judgement(
        107,
        f"by copies at several delays; largest load p / N at {at}: {loads}",
        bool(copied > plain),
        f"held to be more patterns an input than without; {max(p['copies'])} times as many weights: a weight bears "
        f"{copied / max(p['copies']):.2f} patterns with them and {plain:g} without",
    )
    yield Judgement(
        205,
        f"{random:g} beside {plain:g} at {at}",
        bool(random <= plain + p["classes"] / p["inputs"][last]),
        "it costs: fewer inputs arrive before an early target, and what is put off beyond the last one is lost",
    )
    yield _decays(p, summary["decays"])
    chosen = {
        arm: [s for s in line["selected"] if s["inputs"] == p["inputs"][last] and s["by_weight"] is not None]
        for arm, line in lines.items()
    }
    for claim, share in zip((206, 207), p["shares"], strict=False):
        here = {arm: next((s for s in some if s["share"] == share), None) for arm, some in chosen.items()}
        known = {arm: s for arm, s in here.items() if s is not None}
        if {"none", most} <= set(known):
            by_arm = ", ".join(f"{arm} {s['by_weight']:.2f} ({s['weights']:.0f} weights)" for arm, s in known.items())
            yield Judgement(
                claim,
                f"patterns a weight at {at}: {by_arm}",
                bool(known[most]["by_weight"] > known["none"]["by_weight"]),
                "so what the copies buy is the choice of delays, and not the number of weights alone",
            )


def _decays(p: Parameters, decays: Sequence[dict[str, Any]]) -> Judgement:
    parts, holds = [], True
    for share in p["shares"]:
        one, many = (d for d in decays if d["share"] == share)
        solved = one["solved"] == one["of"] and many["solved"] == many["of"]
        holds &= bool(solved and many["weights"] < one["weights"])
        shown = " and ".join("none" if d["weights"] is None else f"{d['weights']:.1f}" for d in (one, many))
        parts.append(
            f"at a load of {share:g} ({one['p']} patterns) {shown} weights with one and {len(many['taus_ms'])}"
        )
    why = f"held to be fewer weights for the same patterns; N = {max(p['inputs'])}, {decays[0]['of']} realisations"
    return Judgement(112, "by copies with several decays: " + "; ".join(parts), holds, why)


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw loads by inputs, and patterns a weight by load."""
    figure, (left, right) = subplots(10, 3.8, 1, 2)
    for line in summary["lines"]:
        left.plot(line["inputs"], line["load"], ".-", lw=1.2, label=line["arm"])
        some = [s for s in line["selected"] if s["inputs"] == p["inputs"][-1] and s["by_weight"] is not None]
        right.plot([s["share"] for s in some], [s["by_weight"] for s in some], ".-", lw=1.2, label=line["arm"])
    left.set(xlabel="inputs N", ylabel="largest load p / N", ylim=(0, None))
    right.set(
        xlabel="load p / N", ylabel="p over the weights that l1 leaves", ylim=(0, None), title=f"N = {p['inputs'][-1]}"
    )
    left.legend(fontsize="small", title="delays")
    return figure
