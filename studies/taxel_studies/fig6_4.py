"""Figure 6.4: a larger kappa lifts the potential behind the target and leaves the spike where it is (thesis 6.4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import mapping
from taxel_studies.mapping import LEARN, TABLE
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, listed, results, subplots
from taxel_studies.waves import READINGS

WHERE = "thesis 6.4.1, figure 6.4"
PROTOCOL = (
    "100 inputs with one spike each, uniform on 0 to 100 ms, one target at 100 ms; Table 6.1, CONE-X in continuous "
    "time, lambda (0, 2, 100), kappa varied, in three readings of B. The first pattern is drawn; claims are judged "
    "over all of them."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 20,
    "inputs": 100,
    "stop": 100.0,
    "target": 100.0,
    "kappas": [1.0, 1.05, 1.1, 1.2, 1.3],
    "lambdas": [0.0, 2.0, 100.0],
    "readings": ["sum", "targets", "B_max"],
    "after_spike": "reset",
    "time": "continuous",
    "drawn_to": 130.0,
}
TOY: dict[str, Any] = {"realisations": 2, "kappas": [1.0, 1.2]}
SIZES = {"toy": TOY}
#: Delta t of Table 6.1, at which B asks for kappa thetas, ms.
DELTA_T: float = LEARN["delta_t_ms"]


def _times(p: Parameters) -> list[float]:
    steps = np.arange(0.0, p["drawn_to"] + 0.5)
    return sorted({*steps.tolist(), p["target"] + DELTA_T})


tasks = partial(grid, reading="readings", kappa="kappas", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Fit one pattern."""
    times = _times(params)
    trains = mapping.single_spikes(seed, params["inputs"], params["stop"], max(times))
    learn = {**READINGS[params["reading"]].options, "kappa": params["kappa"], "lambdas": params["lambdas"]}
    neuron = {"neuron__after_spike": params["after_spike"], "neuron__time": params["time"]}
    return mapping.fitted(trains, [params["target"]], times, **learn, **neuron)


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Sum up a reading and a kappa: spikes, potential behind the target, weights by distance from it."""
    times = _times(p)
    behind = times.index(p["target"] + DELTA_T)
    summary: Summary = {"times": times, "readings": {}}
    for reading in p["readings"]:
        summary["readings"][reading] = []
        for kappa in p["kappas"]:
            here = results(rows, reading=reading, kappa=kappa)
            solved = [r for r in here if r["status"] == "solved"]
            weights = [
                [w for w, t in zip(r["weights"], r["at"], strict=True) if p["target"] - t <= 2 * TABLE["tau"]]
                for r in solved
            ]
            first = here[0]
            summary["readings"][reading].append(
                {
                    "kappa": kappa,
                    **mapping.timing(here, [p["target"]]),
                    "behind": round(float(np.mean([r["potential"][behind] for r in solved])) / TABLE["theta_0"], 4)
                    if solved
                    else None,
                    "near_weight": round(float(np.mean([np.mean(w) for w in weights])), 6) if solved else None,
                    "potential": first["potential"],
                    "weights": first["weights"],
                    "at": first["at"],
                }
            )
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.1 says."""
    for name, all_ in summary["readings"].items():
        behind = [c["behind"] for c in all_]
        weights = [c["near_weight"] for c in all_]
        reading = f"{READINGS[name].name}, after a spike “{p['after_spike']}”"
        yield Judgement(56, *mapping.exactness(all_), reading=reading)
        yield Judgement(
            57,
            f"U({p['target'] + DELTA_T:g} ms) in thresholds: " + listed(behind, p["kappas"], ".3f"),
            None not in behind and bool(np.all(np.diff(behind) > 0)),
            "it does, but by less than kappa asks for" if name == "B_max" else "",
            reading,
        )
        yield Judgement(
            58,
            f"mean weight within {2 * TABLE['tau']:g} ms of it, mV: " + listed(weights, p["kappas"], ".4f"),
            None not in weights and bool(np.all(np.diff(weights) > 0)),
            reading=reading,
        )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.4 once a reading: left potential without spiking, right weights by spike time."""
    figure, axes = subplots(11, 3.6 * len(p["readings"]), len(p["readings"]), 2, squeeze=False)
    weighed = f"lambda ({', '.join(f'{v:g}' for v in p['lambdas'])})"
    for row, (reading, all_) in enumerate(summary["readings"].items()):
        left, right = axes[row]
        for c in all_:
            left.plot(summary["times"], c["potential"], label=f"{c['kappa']:g}", lw=1.3)
            right.plot(c["at"], c["weights"], ".", ms=5, label=f"{c['kappa']:g}")
        left.axhline(TABLE["theta_0"], color="k", ls="--", lw=0.8)
        left.axvline(p["target"], color="0.6", lw=0.8)
        left.set(xlabel="time, ms", ylabel="potential without spiking, mV", title=READINGS[reading].name)
        left.legend(title="kappa", fontsize="small")
        right.set(xlabel="spike time of the synapse, ms", ylabel="weight, mV", title=weighed)
    return figure
