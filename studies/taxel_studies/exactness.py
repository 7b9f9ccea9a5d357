"""The cost and the benefit of exactness: slope at the targets against clocked steps, and against capacity (ours)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel_studies import capacity, mapping
from taxel_studies.mapping import LEARN, TABLE
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary

WHERE = "ours; beside thesis 6.4.4"
PROTOCOL = (
    "Poisson inputs of 5 to 25 Hz over 200 ms, random targets at least 12 ms apart, CONE-X (l2, continuous time) "
    "with margin m0 mV and slope m0 mV/ms. Each solution runs freely on clocks of 1, 10 and 100 us steps, that is "
    "with the threshold's recovery from its own spikes. Beside it the search of figure 6.7 (C = 3, 30 "
    "realisations) on the grid and at every instant, by margin."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 100,
    "inputs": 250,
    "rates_hz": [5.0, 25.0],
    "stop": 200.0,
    "counts": [1, 5],
    "theta_plus": [0.0, 0.2],
    "margins": [1e-4, 1e-3, 3e-3, 1e-2, 3e-2],
    "steps_ms": [0.001, 0.01, 0.1],
    "capacity": {"inputs": [100, 200, 300], "classes": 3, "realisations": 30, "margins": [1e-4, 1e-3, 1e-2]},
    "after_spike": "keep",
}
TOY: dict[str, Any] = {
    "realisations": 3,
    "inputs": 150,
    "margins": [1e-3, 1e-2],
    "capacity": {"inputs": [60], "classes": 3, "realisations": 2, "margins": [1e-3]},
}
SIZES = {"toy": TOY}
#: Targets lie at least so far apart, and from both ends, ms.
APART_MS = 12.0


def tasks(p: Parameters) -> list[Task]:
    """List free runs at clocked steps, and searches of the largest load."""
    listed = [
        Task(
            {
                "kind": "steps",
                **{name: p[name] for name in ("inputs", "rates_hz", "stop", "after_spike", "steps_ms")},
                "count": count,
                "theta_plus": rise,
                "margin": margin,
            },
            seed,
        )
        for count in p["counts"]
        for rise in p["theta_plus"]
        for margin in p["margins"]
        for seed in range(p["realisations"])
    ]
    c = p["capacity"]
    common = {"kind": "capacity", "classes": c["classes"], "after_spike": p["after_spike"]}
    for inputs in sorted(c["inputs"], reverse=True):
        searched = common | {"inputs": inputs, "realisations": c["realisations"]}
        listed.append(Task(searched | {"time": "grid", "margin": 0.0, "slope": 0.0}))
        listed += [Task(searched | {"time": "continuous", "margin": m, "slope": m}) for m in c["margins"]]
    return listed


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train exactly and run freely on clocks of several steps; or search the largest load."""
    if params["kind"] == "capacity":
        return capacity.realise(params, seed)
    trains = mapping.poisson(seed, params["inputs"], params["stop"], *params["rates_hz"])
    rng = np.random.default_rng([seed, 1])
    room = params["stop"] - APART_MS * (params["count"] + 1)
    targets = np.sort(rng.uniform(0.0, room, params["count"])) + APART_MS * (np.arange(params["count"]) + 1)
    options = {**TABLE, "theta_plus": params["theta_plus"], "after_spike": params["after_spike"]}
    margins = dict.fromkeys(("margin", "slope"), params["margin"])
    cone = ConeX(neuron=Neuron(**options), **LEARN, lambdas=(0.0, 1.0, 0.0), kappa=1.0, **margins)
    cone.fit([trains], [targets])
    if cone.status_ not in ("solved", "feasible"):
        return {"status": cone.status_, "runs": []}
    exact = cone.neuron_.run(cone.weights_, trains)
    runs = []
    for step in params["steps_ms"]:
        spikes = Neuron(**options, time="grid", step_ms=step).run(cone.weights_, trains)
        runs.append({"step_ms": step, **_beside(spikes, targets, step)})
    return {"status": "solved", "exact": _beside(exact, targets, 0.0), "runs": runs}


def _beside(spikes: NDArray[np.float64], targets: NDArray[np.float64], step: float) -> dict[str, Any]:
    """Return whether there is a spike a target, and how far it is off, ms."""
    right = len(spikes) == len(targets)
    off = float(np.max(np.abs(spikes - targets))) if right else None
    return {
        "right_count": right,
        "lost": max(len(targets) - len(spikes), 0),
        "worst_ms": off,
        "within_a_step": off is not None and off <= step + 1e-9,
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Sum up shares by case and margin, and loads."""
    cases = []
    for count in p["counts"]:
        for rise in p["theta_plus"]:
            for margin in p["margins"]:
                wanted = (count, rise, margin)
                here = [
                    r.result
                    for r in rows
                    if r.params["kind"] == "steps"
                    and (r.params["count"], r.params["theta_plus"], r.params["margin"]) == wanted
                ]
                solved = [r for r in here if r["status"] == "solved"]
                cases.append(
                    {
                        "count": count,
                        "theta_plus": rise,
                        "margin": margin,
                        "of": len(here),
                        "solved": len(solved),
                        "exact": sum(r["exact"]["right_count"] and r["exact"]["worst_ms"] < 1e-6 for r in solved),
                        "steps": [_over(solved, k, step) for k, step in enumerate(p["steps_ms"])],
                    }
                )
    loads = [
        {
            "inputs": r.params["inputs"],
            "time": r.params["time"],
            "margin": r.params["margin"],
            "p": r.result["p"],
            "load": r.result["load"],
        }
        for r in rows
        if r.params["kind"] == "capacity"
    ]
    return {"cases": cases, "loads": loads}


def _over(solved: Sequence[dict[str, Any]], k: int, step: float) -> dict[str, Any]:
    runs = [r["runs"][k] for r in solved]
    late = [r["worst_ms"] for r in runs if r["worst_ms"] is not None]
    return {
        "step_ms": step,
        "within_a_step": sum(r["within_a_step"] for r in runs),
        "right_count": sum(r["right_count"] for r in runs),
        "worst_ms": round(max(late), 4) if late else None,
    }


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Judge our own statements; the thesis has none on this."""
    cases = summary["cases"]
    fine = min(p["steps_ms"])
    several = max(p["counts"])
    hard = [c for c in cases if c["count"] == several and c["theta_plus"] == max(p["theta_plus"])]
    easy = [c for c in cases if c["count"] == 1 or c["theta_plus"] == 0]
    exact, solved = sum(c["exact"] for c in cases), sum(c["solved"] for c in cases)
    shares = [_share(c, fine) for c in hard]
    listed = ", ".join(f"{s:.0%} at {c['margin']:g}" for s, c in zip(shares, hard, strict=True))
    judged = [
        Statement(
            "Every solved problem is exact in continuous time (ours).",
            "none",
            f"{exact} of {solved} solved fire once a target, within 1e-6 ms, and never elsewhere",
            exact == solved and solved > 0,
        ),
        Statement(
            "One target, or no rise of the threshold: a clock of 1 us fires each spike within one step (ours).",
            "none",
            f"{sum(c['steps'][p['steps_ms'].index(fine)]['within_a_step'] for c in easy)} of "
            f"{sum(c['solved'] for c in easy)}",
            all(_share(c, fine) == 1.0 for c in easy if c["solved"]),
            "a spike up to one step late moves nothing behind it",
        ),
        Statement(
            f"{several} targets and a threshold that recovers: slope at the target is robustness (ours).",
            "none",
            f"share within one step of {fine:g} ms by slope (mV/ms): {listed}",
            bool(shares[-1] > shares[0]) if len(shares) > 1 else None,
            "each spike comes late, the threshold recovers that much later, and where the slope is small the next "
            "crossing moves by more than that",
        ),
    ]
    grid = {c["inputs"]: c for c in summary["loads"] if c["time"] == "grid"}
    priced = [
        f"N = {n}: {grid[n]['load']:.3f} on the grid, "
        + ", ".join(
            f"{c['load']:.3f} at {c['margin']:g}" for c in summary["loads"] if c["inputs"] == n and c["time"] != "grid"
        )
        for n in sorted(grid)
    ]
    small = [
        c["p"] / grid[c["inputs"]]["p"] for c in summary["loads"] if 0 < c["margin"] <= 1e-3 and grid[c["inputs"]]["p"]
    ]
    judged.append(
        Statement(
            "Silence at every instant costs little capacity while margin and slope are 1e-3 or less (ours).",
            "none; 0 to 10 % in trials",
            "load: " + "; ".join(priced),
            bool(min(small) >= 0.85) if small else None,
            "margin in mV and slope in mV/ms alike",
        )
    )
    return judged


def _share(case: dict[str, Any], step: float) -> float:
    run = next(s for s in case["steps"] if s["step_ms"] == step)
    return run["within_a_step"] / case["solved"] if case["solved"] else 0.0


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw the share within one step by slope, and the load by margin."""
    figure = Figure(figsize=(13, 4), layout="constrained")
    within, late, load = figure.subplots(1, 3)
    for number, (count, rise) in enumerate((c, r) for c in p["counts"] for r in p["theta_plus"]):
        here = [c for c in summary["cases"] if (c["count"], c["theta_plus"]) == (count, rise)]
        label = f"{count} target{'s' if count > 1 else ''}, theta+ {rise:g}"
        for k, step in enumerate(p["steps_ms"]):
            # Earlier lines are drawn broader, since lines at 100 % overlap.
            style = {"color": f"C{number}", "ls": ("-", "--", ":")[k % 3], "marker": ".", "lw": max(4.5 - number, 1.2)}
            shares = [100 * _share(c, step) for c in here]
            within.plot(p["margins"], shares, **style, label=f"{label}" if k == 0 else None)
            worst = [c["steps"][k]["worst_ms"] for c in here]
            late.plot(p["margins"], [np.nan if w is None else max(w, 1e-5) for w in worst], **style)
    within.set(xscale="log", xlabel="margin (mV) and slope (mV/ms)", ylabel="% of problems: all spikes within one step")
    within.legend(fontsize="small")
    within.set_title(
        "steps of " + ", ".join(f"{1000 * s:g} us" for s in p["steps_ms"]) + ": solid, dashed, dotted", fontsize="small"
    )
    late.set(
        xscale="log",
        yscale="log",
        xlabel="margin (mV) and slope (mV/ms)",
        ylabel="largest error of a spike, ms (where none is lost)",
    )
    for number, inputs in enumerate(p["capacity"]["inputs"]):
        here = sorted(
            (c["margin"], c["load"]) for c in summary["loads"] if c["inputs"] == inputs and c["time"] != "grid"
        )
        grid = next(c["load"] for c in summary["loads"] if c["inputs"] == inputs and c["time"] == "grid")
        load.plot(*zip(*here, strict=True), ".-", color=f"C{number}", label=f"N = {inputs}")
        load.axhline(grid, color=f"C{number}", ls="--", lw=max(2.4 - 0.8 * number, 0.8))
    load.set(xscale="log", xlabel="margin (mV) and slope (mV/ms)", ylabel="largest load p / N", ylim=(0, None))
    load.set_title("dashed: silence at the points of a 1 ms grid alone", fontsize="small")
    load.legend(fontsize="small")
    return figure
