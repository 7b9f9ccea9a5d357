"""Figure 6.5: l1 uses few synapses, l2 all of them; the spike stays where it is (thesis 6.4.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import mapping
from taxel_studies.mapping import TABLE
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, results, subplots

WHERE = "thesis 6.4.2, figure 6.5"
PROTOCOL = (
    "As figure 6.4, with kappa 1 and lambda 1 : lambda 2 varied (lambda 3 = 0). The first pattern is drawn; the "
    "claims are judged over all of them."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 20,
    "inputs": 100,
    "stop": 100.0,
    "target": 100.0,
    "ratios": [[0.0, 1.0], [1.0, 4.0], [1.0, 1.0], [4.0, 1.0], [1.0, 0.0]],
    "kappa": 1.0,
    "after_spike": "keep",
    "time": "continuous",
    "drawn_to": 130.0,
}
TOY: dict[str, Any] = {"realisations": 2, "ratios": [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]}
SIZES = {"toy": TOY}
#: A weight below this counts as zero, mV.
ZERO = 1e-6


tasks = partial(grid, ratio="ratios", seed="realisations")


def _times(p: Parameters) -> list[float]:
    times: list[float] = np.arange(0.0, p["drawn_to"] + 0.5).tolist()
    return times


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Fit one pattern."""
    times = _times(params)
    trains = mapping.single_spikes(seed, params["inputs"], params["stop"], max(times))
    learn = {"kappa": params["kappa"], "lambdas": [*params["ratio"], 0.0]}
    neuron = {"neuron__after_spike": params["after_spike"], "neuron__time": params["time"]}
    return mapping.fitted(trains, [params["target"]], times, **learn, **neuron)


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Sum up a ratio: spikes, zero weights, where the largest weight sits."""
    summary: Summary = {"times": _times(p), "ratios": []}
    for ratio in p["ratios"]:
        here = results(rows, ratio=ratio)
        weights = np.array([r["weights"] for r in here])
        at = np.array([r["at"] for r in here])
        largest = p["target"] - at[np.arange(len(here)), np.argmax(weights, axis=1)]
        size = np.abs(weights)
        summary["ratios"].append(
            {
                "ratio": ratio,
                **mapping.timing(here, [p["target"]]),
                "zeros": round(float((size < ZERO).sum(axis=1).mean()), 1),
                "largest_before_ms": round(float(largest.mean()), 2),
                "l1": round(float(size.sum(axis=1).mean()), 4),
                "potential": here[0]["potential"],
                "weights": here[0]["weights"],
                "at": here[0]["at"],
            }
        )
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.2 says."""
    all_ = summary["ratios"]
    zeros = [c["zeros"] for c in all_]
    listed = ", ".join(f"{z:g} at {c['ratio'][0]:g} : {c['ratio'][1]:g}" for z, c in zip(zeros, all_, strict=True))
    dense = next(c for c in all_ if c["ratio"][0] == 0)
    rising = bool(np.all(np.diff(zeros) > 0))
    yield Judgement(59, *mapping.exactness(all_))
    yield Judgement(
        60,
        f"zero weights of {p['inputs']}: {listed}",
        rising and zeros[0] < 1 and zeros[-1] > 0.9 * p["inputs"],
    )
    yield Judgement(61, f"zeros: {listed}", rising)
    yield Judgement(
        62,
        f"the largest weight (l2) spikes {dense['largest_before_ms']:.1f} ms before the target; "
        f"the kernel peaks at {TABLE['tau']:g} ms",
        abs(dense["largest_before_ms"] - TABLE["tau"]) < 0.25 * TABLE["tau"],
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.5: left potential without spiking, right weights by spike time."""
    figure, (left, right) = subplots(11, 4, 1, 2)
    for c in summary["ratios"]:
        label = f"{c['ratio'][0]:g} : {c['ratio'][1]:g}"
        left.plot(summary["times"], c["potential"], label=label, lw=1.3)
        at, weights = np.array(c["at"]), np.array(c["weights"])
        used = np.abs(weights) >= ZERO
        right.plot(at[used], weights[used], ".", ms=6, label=f"{label} ({used.sum()} used)")
    left.axhline(TABLE["theta_0"], color="k", ls="--", lw=0.8)
    left.axvline(p["target"], color="0.6", lw=0.8)
    left.set(xlabel="time, ms", ylabel="potential without spiking, mV")
    left.legend(title="lambda 1 : lambda 2", fontsize="small")
    right.set(xlabel="spike time of the synapse, ms", ylabel="weight, mV")
    right.legend(fontsize="small")
    return figure
