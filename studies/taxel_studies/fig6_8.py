"""Figure 6.8: the three noises on a wave train, and the response of a trained neuron (thesis 6.4.5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.learn import ConeX
from taxel.metrics import victor_purpura
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies import waves
from taxel_studies.mapping import LEARN
from taxel_studies.runner import noted
from taxel_studies.study import Judgement, Parameters, Summary, one_task, only_result, subplots

WHERE = "thesis 6.4.5, figure 6.8"
PROTOCOL = (
    "The first repetitions and some of the 200 inputs are drawn; the neuron was trained by CONE-X on the clean "
    "pattern, kappa 1.16, B as a sum, delta t 1.5 ms. " + waves.PROTOCOL
)

PARAMETERS: dict[str, Any] = {
    "levels": {"jitter": 3.0, "background": 6.0, "shunting": 15.0},
    "kappa": 1.16,
    "lambdas": [2.0, 2.0, 200.0],
    "repetitions": 30,
    "drawn_repetitions": 3,
    "drawn_inputs": 40,
    "seed": 1,
}
SIZES = {"toy": {"repetitions": 8}}

#: The title of each panel: the noise with its level, and the spikes that are drawn faint or grey.
TITLES = {
    "jitter": "jitter, sd {:g} ms (faint: before it)",
    "background": "background, {:g} Hz an input (grey: added)",
    "shunting": "shunting, {:g} % of the spikes (faint: deleted)",
}
#: A neuron is called robust whose distance is below this share of that of silence.
ROBUST = 0.2


tasks = one_task


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train a neuron on the clean pattern and run it under each noise."""
    times = waves.pattern(seed)
    learnt = {name: params[name] for name in ("kappa", "lambdas")}
    cone = ConeX(neuron=Neuron(**waves.NEURON), **LEARN, **learnt, **waves.READINGS["sum"].options)
    noted(cone.fit([SpikeTrains.from_lists([[t] for t in times], 0.0, waves.DURATION_MS)], [[waves.DURATION_MS]]))
    train = waves.waves(times, np.random.default_rng([seed, 3]), params["repetitions"])
    clean = train.trains
    end = float(train.targets[params["drawn_repetitions"] - 1] + waves.GAP_MS[0])
    result: dict[str, Any] = {
        "status": cone.status_,
        "targets": train.targets.round(3).tolist(),
        "end": end,
        "clean": _drawn(clean, params, end),
        "clean_distance": round(victor_purpura(cone.neuron_.run(cone.weights_, clean), train.targets, q=waves.Q), 3),
        "noises": {},
    }
    for number, (noise, level) in enumerate(params["levels"].items()):
        disturbed = waves.noisy(train, noise, level, np.random.default_rng([seed, 4, number]))
        spikes = cone.neuron_.run(cone.weights_, disturbed)
        result["noises"][noise] = {
            "drawn": _drawn(disturbed, params, end),
            "spikes": spikes.round(3).tolist(),
            "distance": round(victor_purpura(spikes, train.targets, q=waves.Q), 3),
            "count": len(disturbed.times),
            # Spikes of a train lie 90 ms apart and keep their order.
            "moved_sd_ms": round(float(np.std(disturbed.times - clean.times)), 3) if noise == "jitter" else None,
            "of": len(clean.times),
            "stop": train.stop,
        }
    return result


def _drawn(trains: SpikeTrains, params: dict[str, Any], end: float) -> list[list[float]]:
    return [train[train <= end].round(3).tolist() for train in trains][: params["drawn_inputs"]]


summarise = only_result


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.5 and the caption say."""
    noises = summary["noises"]
    if "jitter" in noises:
        sd = noises["jitter"]["moved_sd_ms"]
        yield Judgement(
            69,
            f"sd {sd:.2f} ms over {noises['jitter']['count']} spikes; none lost",
            abs(sd - p["levels"]["jitter"]) < 0.1 * p["levels"]["jitter"]
            and noises["jitter"]["count"] == noises["jitter"]["of"],
        )
    if "background" in noises:
        n = noises["background"]
        rate = (n["count"] - n["of"]) / waves.INPUTS / (n["stop"] / 1000)
        yield Judgement(
            70,
            f"{rate:.2f} Hz an input",
            abs(rate - p["levels"]["background"]) < 0.15 * p["levels"]["background"],
            "the rate is read as one input's",
        )
    if "shunting" in noises:
        n = noises["shunting"]
        lost = 100 * (1 - n["count"] / n["of"])
        yield Judgement(71, f"{lost:.2f} %", abs(lost - p["levels"]["shunting"]) < 0.1)
    listed = ", ".join(f"{n} {v['distance']:.2f}" for n, v in noises.items())
    worst = max(v["distance"] for v in noises.values())
    yield Judgement(
        72,
        f"distance over {len(summary['targets'])} targets: {summary['clean_distance']:.2f} without noise, {listed}",
        worst < ROBUST * len(summary["targets"]),
        f"kappa {p['kappa']:g}; robust: below {ROBUST:.0%} of silence",
        waves.READINGS["sum"].name,
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.8: a panel a noise, and the target with the output spikes of the neuron."""
    figure, axes = subplots(
        11, 9, len(summary["noises"]) + 1, 1, sharex=True, height_ratios=[*(3 for _ in summary["noises"]), 1.2]
    )
    clean = summary["clean"]
    for ax, (noise, shown) in zip(axes, summary["noises"].items(), strict=False):
        kept = [set(train) for train in shown["drawn"]]
        if noise == "jitter":
            ax.eventplot(clean, colors="C3", alpha=0.3, linewidths=1, linelengths=0.8)
            ax.eventplot(shown["drawn"], colors="C3", linewidths=1, linelengths=0.8)
        elif noise == "background":
            own = [set(train) for train in clean]
            added = [[t for t in train if t not in own[n]] for n, train in enumerate(shown["drawn"])]
            ax.eventplot(added, colors="0.6", linewidths=1, linelengths=0.8)
            ax.eventplot(clean, colors="C3", linewidths=1, linelengths=0.8)
        else:
            gone = [[t for t in train if t not in kept[n]] for n, train in enumerate(clean)]
            ax.eventplot(gone, colors="C3", alpha=0.3, linewidths=1, linelengths=0.8)
            ax.eventplot(shown["drawn"], colors="C3", linewidths=1, linelengths=0.8)
        ax.set(ylabel="input", title=TITLES[noise].format(p["levels"][noise]))
    names = ["target", *summary["noises"]]
    trains = [summary["targets"], *(shown["spikes"] for shown in summary["noises"].values())]
    trains = [[t for t in train if t <= summary["end"]] for train in trains]
    axes[-1].eventplot(trains, colors=["k", *(f"C{k}" for k in range(len(names) - 1))], linewidths=2, linelengths=0.7)
    axes[-1].set(yticks=range(len(names)), yticklabels=names, xlabel="time, ms", xlim=(0, summary["end"]))
    axes[-1].set_title("target, and spikes of the trained neuron under each noise")
    axes[-1].invert_yaxis()
    return figure
