"""Figure 6.1: input spikes, potential, threshold, refractory time, output spikes (thesis 6.3.1)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies import mapping
from taxel_studies.mapping import LEARN, TABLE, thresholds
from taxel_studies.runner import noted
from taxel_studies.study import Judgement, Parameters, Summary, one_task, only_result

WHERE = "thesis 6.3.1, figure 6.1"
PROTOCOL = (
    "60 Poisson inputs of 5 to 25 Hz, two targets; Table 6.1, weights by CONE-X (l1, continuous time). Drawn are "
    "the exact neuron and the postsynaptic potentials of its twelve largest weights."
)

PARAMETERS: dict[str, Any] = {
    "inputs": 60,
    "rates_hz": [5.0, 25.0],
    "stop": 140.0,
    "targets": [50.0, 100.0],
    "after_spike": "keep",
    "step_ms": 0.1,
    "seed": 3,
}
SIZES = {"toy": {"step_ms": 0.5}}


tasks = one_task


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train one neuron, and return its potential and spikes."""
    trains = mapping.poisson(seed, params["inputs"], params["stop"], *params["rates_hz"])
    neuron = Neuron(**TABLE, after_spike=params["after_spike"])
    cone = ConeX(neuron=neuron, **LEARN, lambdas=(1.0, 0.0, 0.0), kappa=1.0)
    noted(cone.fit([trains], [params["targets"]]))
    times = np.arange(round(params["stop"] / params["step_ms"]) + 1) * params["step_ms"]
    potential = cone.neuron_.potential(cone.weights_, trains, times, spikes=params["targets"])
    plain = cone.neuron_.potential(cone.weights_, trains, times)
    return {
        "status": cone.status_,
        "spikes": [float(t) for t in cone.neuron_.run(cone.weights_, trains)],
        "trains": [t.tolist() for t in trains],
        "weights": cone.weights_.tolist(),
        "times": times.round(6).tolist(),
        "potential": potential.round(6).tolist(),
        "worst_of_sum": float(np.max(np.abs(plain - _sum_of_kernels(cone.weights_, trains, times)))),
        "at_targets": [
            float(u) for u in cone.neuron_.potential(cone.weights_, trains, params["targets"], spikes=params["targets"])
        ],
    }


def _sum_of_kernels(
    weights: NDArray[np.float64], trains: SpikeTrains, times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return 6.4 with 6.5, as printed, without taxel's neuron."""
    total = np.zeros(len(times))
    for weight, spikes in zip(weights, trains, strict=True):
        for spike in spikes:
            x = np.maximum(times - spike, 0.0) / TABLE["tau"]
            total += weight * x * np.exp(-x)
    return total


summarise = only_result


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.3.1 and the caption say."""
    times, potential = np.array(summary["times"]), np.array(summary["potential"])
    theta = thresholds(np.array(p["targets"]), p["targets"])
    off = np.max(np.abs(np.array(summary["at_targets"]) - theta))
    quiet = np.any([(times > t) & (times <= t + TABLE["refractory"]) for t in p["targets"]], axis=0)
    raised = thresholds(np.array([t + TABLE["refractory"] for t in p["targets"]]), p["targets"])
    exact = len(summary["spikes"]) == len(p["targets"])
    yield Judgement(
        45, f"neuron against the printed sum: {summary['worst_of_sum']:.0e} mV at most", summary["worst_of_sum"] < 1e-12
    )
    yield Judgement(
        46,
        f"|U - theta| at the targets: {off:.0e} mV; fires at {', '.join(f'{t:.6f}' for t in summary['spikes'])} ms",
        bool(off < 1e-12) and exact and bool(np.max(np.abs(np.subtract(summary["spikes"], p["targets"]))) < 1e-6),
    )
    yield Judgement(47, f"{np.max(np.abs(potential[quiet])):g} mV at most", bool(np.all(potential[quiet] == 0)))
    yield Judgement(
        48,
        f"{raised[0]:g} mV at the end of the first refractory period; the neuron fires at the second target, where "
        f"it has come down to {theta[-1]:.4f} mV",
        exact and bool(np.isclose(raised[0], TABLE["theta_0"] + TABLE["theta_plus"])),
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.1: input trains, output train, and the dynamics in the lower right panel."""
    figure = Figure(figsize=(12, 6), layout="constrained")
    axes = figure.subplot_mosaic(
        [["inputs", "output"], ["inputs", "dynamics"]], height_ratios=[1, 5], width_ratios=[2, 3]
    )
    inputs, output, dynamics = axes["inputs"], axes["output"], axes["dynamics"]
    weights = np.array(summary["weights"])
    inputs.eventplot(summary["trains"], colors=_by_sign(weights), linewidths=1.0, linelengths=0.8)
    inputs.set(
        xlabel="time, ms",
        ylabel="input",
        title="input spike trains\n(red: excitatory, blue: inhibitory, grey: weight 0)",
    )
    inputs.set_xlim(0, p["stop"])
    output.eventplot(
        [p["targets"], summary["spikes"]], colors=["0.6", "k"], linewidths=2.0, lineoffsets=[1, 0], linelengths=0.8
    )
    output.set(yticks=[0, 1], yticklabels=["neuron", "target"], title="output spike train")
    output.set_xlim(0, p["stop"])
    times = np.array(summary["times"])
    largest = np.argsort(-np.abs(weights))[:12]
    for n in largest:
        for spike in summary["trains"][n]:
            x = np.maximum(times - spike, 0.0) / TABLE["tau"]
            dynamics.plot(times, weights[n] * x * np.exp(-x), color="C1", lw=0.8, alpha=0.8)
    dynamics.plot([], [], color="C1", lw=0.8, label="postsynaptic potentials")
    dynamics.plot(times, summary["potential"], "k", lw=1.4, label="membrane potential U")
    dynamics.plot(times, thresholds(times, p["targets"]), "C2--", lw=1.2, label="threshold")
    for k, target in enumerate(p["targets"]):
        spike, quiet = ("output spike", "absolute refractory period") if k == 0 else ("", "")
        dynamics.vlines(target, 0, 0.62, "C3", lw=1.6, label=spike)
        dynamics.axvspan(target, target + TABLE["refractory"], color="0.85", zorder=0, label=quiet)
    dynamics.set(xlabel="time, ms", ylabel="mV", ylim=(None, 0.65), xlim=(0, p["stop"]))
    figure.legend(*dynamics.get_legend_handles_labels(), fontsize="small", loc="outside lower right", ncols=5)
    return figure


def _by_sign(weights: NDArray[np.float64]) -> list[str]:
    return ["0.7" if abs(w) < 1e-6 else "C3" if w > 0 else "C0" for w in weights]
