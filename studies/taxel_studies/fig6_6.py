"""Figure 6.6: Poisson trains mapped to five spikes; what l1 and l2 do between them (thesis 6.4.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel_studies import mapping
from taxel_studies.mapping import TABLE, thresholds
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, grid, results

WHERE = "thesis 6.4.3, figure 6.6"
PROTOCOL = (
    "500 Poisson trains of 200 ms, each with a rate of its own, uniform on 5 to 25 Hz; targets at 30, 40, 50, 120 "
    "and 150 ms; Table 6.1, CONE-X in continuous time with l2 alone and l1 alone; drawn is the mean potential over "
    "the realisations, 0 in refractory times. In both readings of what remains after a spike: “keep” as 6.7 prints "
    "it, and “reset”."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 100,
    "inputs": 500,
    "rates_hz": [5.0, 25.0],
    "stop": 200.0,
    "targets": [30.0, 40.0, 50.0, 120.0, 150.0],
    "norms": {"l2": [0.0, 1.0, 0.0], "l1": [1.0, 0.0, 0.0]},
    "readings": ["keep", "reset"],
    "time": "continuous",
}
TOY: dict[str, Any] = {"realisations": 1}
SIZES = {"toy": TOY}


def tasks(p: Parameters) -> list[Task]:
    """List one fit a reading, a norm and a seed."""
    listed = {**p, "norms": list(p["norms"].values())}
    return grid(listed, reading="readings", lambdas="norms", seed="realisations")


def _times(p: Parameters) -> NDArray[np.float64]:
    return np.arange(0.0, p["stop"] + 0.5)


def _silent(p: Parameters, times: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the instants between output spikes, refractory times left out."""
    targets = np.array(p["targets"])
    since = times[:, None] - targets
    inside = (times > 0) & (times < targets[-1])
    free: NDArray[np.bool_] = inside & ~np.any((since >= 0) & (since <= TABLE["refractory"]), axis=1)
    return free


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Fit one pattern."""
    trains = mapping.poisson(seed, params["inputs"], params["stop"], *params["rates_hz"])
    neuron = {"neuron__after_spike": params["reading"], "neuron__time": params["time"]}
    learn = {"lambdas": params["lambdas"], "kappa": 1.0}
    return mapping.fitted(trains, params["targets"], _times(params).tolist(), **learn, **neuron)


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Average the potentials, by reading and norm."""
    times = _times(p)
    silent = _silent(p, times)
    summary: Summary = {"times": times.tolist(), "readings": {}}
    for reading in p["readings"]:
        summary["readings"][reading] = {}
        for norm, lambdas in p["norms"].items():
            here = results(rows, reading=reading, lambdas=lambdas)
            solved = [r for r in here if r["status"] == "solved"]
            between = np.array([r["between"] for r in solved]).reshape(len(solved), len(times))
            summary["readings"][reading][norm] = {
                **mapping.timing(here, p["targets"]),
                "mean_between": round(float(between[:, silent].mean()), 4) if solved else None,
                "potential": between.mean(axis=0).round(5).tolist() if solved else [],
                "used": round(float(np.mean([np.sum(np.abs(r["weights"]) > 1e-6) for r in solved])), 1)
                if solved
                else None,
            }
    return summary


def judge(_p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.3 says."""
    for after, norms in summary["readings"].items():
        reading = f"after a spike “{after}”"
        mean = {norm: c["mean_between"] for norm, c in norms.items()}
        yield Judgement(63, *mapping.exactness(list(norms.values())), reading=reading)
        yield Judgement(
            64,
            "mean potential, mV: " + ", ".join(f"{norm} {v}" for norm, v in mean.items()),
            bool(mean["l1"] < mean["l2"]) if None not in mean.values() else None,
            reading=reading,
        )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.6 once a reading: solid l2, dot-dash l1, dashed the threshold."""
    figure = Figure(figsize=(10, 3.4 * len(p["readings"])), layout="constrained")
    axes = figure.subplots(len(p["readings"]), 1, sharex=True, squeeze=False)[:, 0]
    times = np.array(summary["times"])
    fine = np.arange(0.0, p["stop"], 0.1)
    for ax, (reading, norms) in zip(axes, summary["readings"].items(), strict=True):
        for norm, style in (("l2", "-"), ("l1", "-.")):
            if norm in norms and norms[norm]["potential"]:
                ax.plot(
                    times, norms[norm]["potential"], style, color="C0" if norm == "l2" else "C3", label=norm, lw=1.4
                )
        ax.plot(fine, thresholds(fine, p["targets"]), "k--", lw=0.9, label="threshold")
        for target in p["targets"]:
            ax.axvline(target, color="0.85", lw=0.8, zorder=0)
        ax.set(ylabel="mean potential, mV", title=f"after a spike “{reading}”")
        ax.legend(fontsize="small", loc="lower right")
    axes[-1].set_xlabel("time, ms")
    return figure
