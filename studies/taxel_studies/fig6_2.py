"""Figure 6.2: kappa lifts the potential behind the target and steepens the crossing (thesis 6.3.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel_studies import mapping
from taxel_studies.mapping import LEARN, TABLE
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, listed, results, subplots
from taxel_studies.waves import READINGS

WHERE = "thesis 6.3.2, figure 6.2"
PROTOCOL = (
    "100 inputs with one spike each, uniform on 0 to 100 ms, target at 100 ms; Table 6.1, CONE-X in continuous "
    "time, lambda (0, 2, 100), in three readings of B. The first pattern is drawn; slopes and rises are means."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 20,
    "inputs": 100,
    "stop": 100.0,
    "target": 100.0,
    "kappas": [1.0, 1.2],
    "lambdas": [0.0, 2.0, 100.0],
    "readings": ["sum", "targets", "B_max"],
    "after_spike": "reset",
    "drawn": [85.0, 112.0],
    "step_ms": 0.05,
}
SIZES = {"toy": {"realisations": 2}}
#: Delta t of Table 6.1, ms.
DELTA_T: float = LEARN["delta_t_ms"]


tasks = partial(grid, reading="readings", kappa="kappas", seed="realisations")


def _times(p: Parameters) -> NDArray[np.float64]:
    first, last = p["drawn"]
    times: NDArray[np.float64] = first + p["step_ms"] * np.arange(round((last - first) / p["step_ms"]) + 1)
    return times.round(6)


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Fit one pattern."""
    times = _times(params).tolist()
    trains = mapping.single_spikes(seed, params["inputs"], params["stop"], max(times))
    learn = {**READINGS[params["reading"]].options, "kappa": params["kappa"], "lambdas": params["lambdas"]}
    return mapping.fitted(trains, [params["target"]], times, **learn, neuron__after_spike=params["after_spike"])


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Sum up a reading and a kappa: the slope at the target, how far it stays above threshold within delta t."""
    times = _times(p)
    at = int(np.searchsorted(times, p["target"]))
    behind = int(np.searchsorted(times, p["target"] + DELTA_T))
    summary: Summary = {"times": times.tolist(), "readings": {reading: [] for reading in p["readings"]}}
    for (reading, all_), kappa in product(summary["readings"].items(), p["kappas"]):
        here = results(rows, reading=reading, kappa=kappa)
        potential = np.array([r["potential"] for r in here])
        all_.append(
            {
                "kappa": kappa,
                **mapping.timing(here, [p["target"]]),
                "slope": round(
                    float(np.mean((potential[:, at + 1] - potential[:, at]) / (times[at + 1] - times[at]))), 5
                ),
                "rise": round(float(np.mean(potential[:, at : behind + 1].max(axis=1))) / TABLE["theta_0"] - 1, 5),
                "potential": here[0]["potential"],
            }
        )
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.3.2 says."""
    for name, all_ in summary["readings"].items():
        slopes, rises = [c["slope"] for c in all_], [c["rise"] for c in all_]
        reading = f"{READINGS[name].name}, after a spike “{p['after_spike']}”"
        yield Judgement(49, *mapping.exactness(all_), reading=reading)
        yield Judgement(
            50,
            "mean slope behind the target, mV/ms: " + listed(slopes, p["kappas"], ".4f", "kappa {:g}"),
            bool(np.all(np.diff(slopes) > 0)),
            reading=reading,
        )
        yield Judgement(
            51,
            f"within {DELTA_T:g} ms the potential would come above the threshold by, %: "
            + listed([100 * r for r in rises], p["kappas"], ".1f", "kappa {:g}"),
            bool(np.all(np.diff(rises) > 0)),
            reading=reading,
        )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.2 once a reading: the potential around the target, without and with kappa."""
    figure, axes = subplots(7.5, 3.6 * len(p["readings"]), len(p["readings"]), sharex=True, squeeze=False)
    theta, target = TABLE["theta_0"], p["target"]
    for ax, (reading, all_) in zip(axes[:, 0], summary["readings"].items(), strict=True):
        for number, c in enumerate(all_):
            ax.plot(summary["times"], c["potential"], color=f"C{number}", lw=1.6, label=f"kappa = {c['kappa']:g}")
            if c["kappa"] > 1:
                ax.axhline(c["kappa"] * theta, color=f"C{number}", ls=":", lw=1.0)
                ax.annotate("kappa theta", (p["drawn"][0], c["kappa"] * theta), va="bottom", fontsize="small")
        ax.axhline(theta, color="k", ls="--", lw=0.9)
        ax.annotate("theta", (p["drawn"][0], theta), va="bottom", fontsize="small")
        for x, text in ((target, "target"), (target + DELTA_T, "target + delta t")):
            ax.axvline(x, color="0.7", lw=0.8)
            ax.annotate(text, (x, 0.02), xycoords=("data", "axes fraction"), rotation=90, fontsize="small", ha="right")
        ax.set(ylabel="potential without spiking, mV", xlim=p["drawn"], title=READINGS[reading].name)
    axes[-1, 0].set_xlabel("time, ms")
    axes[0, 0].legend(loc="lower right", fontsize="small")
    return figure
