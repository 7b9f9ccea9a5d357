"""Figure 6.9: how kappa makes a neuron robust against noise, trained without it and with it (thesis 6.4.5, 6.4.6)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import waves
from taxel_studies.study import Parameters, Statement, Summary, Task, listed
from taxel_studies.waves import NOISES, READINGS

WHERE = "thesis 6.4.5 and 6.4.6, figure 6.9"
PROTOCOL = (
    waves.PROTOCOL
    + " Noise-free training: CONE-X in continuous time, lambda (2, 2, 200); noisy: CONE-R, (2, 2, 100, 100, 100)."
)

PARAMETERS: dict[str, Any] = {
    **waves.TESTED,
    "kappas": [1.0, 1.04, 1.08, 1.16],
    "lambdas_clean": [2.0, 2.0, 200.0],
    "lambdas_noisy": [2.0, 2.0, 100.0, 100.0, 100.0],
}
TOY: dict[str, Any] = {
    **waves.TESTED_TOY,
    "kappas": [1.0, 1.08],
}
SIZES = {"toy": TOY}
#: A distance a target by which two kappas count as different: one spike lost in twenty.
SAME = 0.05


def tasks(p: Parameters) -> list[Task]:
    """List the realisations: CONE-X without noise, CONE-R with it."""
    clean, noisy = (
        [{"kappa": k, "lambdas": p[name]} for k in p["kappas"]] for name in ("lambdas_clean", "lambdas_noisy")
    )
    return waves.tasks(p, list(clean), list(noisy), "cone_x")


realise = waves.realise
summarise = waves.summarise


def statements(p: Parameters, summary: Summary) -> Iterator[Statement]:
    """Judge what 6.4.5 and 6.4.6 say, in each reading of B."""
    for reading in p["readings"]:
        curves = summary["curves"][reading]
        why = waves.why(reading)
        for training, source in (("clean", "6.4.5"), ("noisy", "6.4.6")):
            trained = "noise-free training" if training == "clean" else "noisy training"
            yield from (
                _larger_is_better(p, curves[training][noise], noise, f"{source}, {trained}", why)
                for noise in ("jitter", "shunting")
                if noise in curves[training]
            )
            if "background" in curves[training]:
                yield from _turn(p, curves[training]["background"], f"{source}, {trained}", why)
        yield _training_helps(p, curves, why)


def _larger_is_better(p: Parameters, curve: dict[str, Any], noise: str, where: str, why: str) -> Statement:
    mean = np.array(curve["mean"])[:, [k for k, level in enumerate(curve["levels"]) if level]].mean(axis=1)
    holds = bool(mean[-1] < mean[0] - SAME * p["repetitions"] and np.all(np.diff(mean) < SAME * p["repetitions"]))
    return Statement(
        f"A larger kappa makes the neuron more robust against {noise} ({where}).",
        "columns 1 and 3: lower error",
        "distance, mean over levels: " + listed(mean, p["kappas"], ".1f"),
        holds,
        why,
    )


def _turn(p: Parameters, curve: dict[str, Any], where: str, why: str) -> Iterator[Statement]:
    mean, levels = np.array(curve["mean"]), np.array(curve["levels"], float)
    gain = mean[0] - mean[-1]
    low, high = (levels > 0) & (levels < 15), levels > 15
    turns = [
        float(levels[k] + (levels[k + 1] - levels[k]) * gain[k] / (gain[k] - gain[k + 1]))
        for k in range(len(levels) - 1)
        if levels[k] > 0 and gain[k] > 0 >= gain[k + 1]
    ]
    turn = f"; turns at {turns[0]:.0f} Hz" if turns else ""
    yield Statement(
        f"Below 15 Hz of background a larger kappa helps ({where}).",
        "lower error below 15 Hz",
        "distance, mean below 15 Hz: " + listed(mean[:, low].mean(axis=1), p["kappas"], ".1f"),
        bool(gain[low].mean() > SAME * p["repetitions"]),
        why,
    )
    yield Statement(
        f"Above 15 Hz of background a larger kappa hurts ({where}).",
        "rapid increase after 15 Hz",
        "distance, mean above 15 Hz: " + listed(mean[:, high].mean(axis=1), p["kappas"], ".1f") + turn,
        bool(gain[high].mean() < -SAME * p["repetitions"]),
        why,
    )


def _training_helps(p: Parameters, curves: dict[str, Any], why: str) -> Statement:
    parts, holds = [], True
    for noise, noisy in curves["noisy"].items():
        clean = curves["clean"][noise]
        columns = [clean["levels"].index(level) for level in noisy["levels"]]
        before, after = np.array(clean["mean"])[:, columns].mean(axis=1), np.array(noisy["mean"]).mean(axis=1)
        gain = 100 * (1 - after / np.maximum(before, 1e-9))
        holds &= bool(np.all(gain[np.array(p["kappas"]) > 1] > 0))
        parts.append(f"{noise} {listed(gain, p['kappas'], '.0f')}")
    return Statement(
        "For all values of kappa training with noise is better, in all three noises (6.4.6).",
        "significant improvement (figure 6.9c)",
        "% less distance, mean over levels: " + "; ".join(parts),
        holds,
        f"{why}; judged for kappa > 1, as 6.10 has it",
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.9 once a reading: rows a, b, c (clean, noisy, improvement), columns jitter, background, shunting."""
    readings = p["readings"]
    figure = Figure(figsize=(12, 10 * len(readings)), layout="constrained")
    parts = figure.subfigures(len(readings), 1, squeeze=False)[:, 0]
    for part, reading in zip(parts, readings, strict=True):
        part.suptitle(READINGS[reading])
        axes = part.subplots(3, len(p["levels"]), squeeze=False)
        for column, noise in enumerate(p["levels"]):
            _column(axes[:, column], summary["curves"][reading], noise, p)
        for row, text in enumerate(
            ("(a) trained without noise\nVP distance", "(b) trained with noise\nVP distance", "(c) improvement, %")
        ):
            axes[row, 0].set_ylabel(text)
        axes[0, 0].legend(title="kappa", fontsize="small")
    return figure


def _column(axes: Any, curves: dict[str, Any], noise: str, p: Parameters) -> None:
    clean, noisy = curves["clean"][noise], curves["noisy"][noise]
    for row, curve in enumerate((clean, noisy)):
        for k, kappa in enumerate(p["kappas"]):
            axes[row].errorbar(curve["levels"], curve["mean"][k], curve["sem"][k], label=f"{kappa:g}", lw=1.2)
        if noise == "background":
            inset = axes[row].inset_axes((0.1, 0.5, 0.45, 0.45))
            low = [n for n, level in enumerate(curve["levels"]) if level <= 15]
            for k in range(len(p["kappas"])):
                inset.plot([curve["levels"][n] for n in low], [curve["mean"][k][n] for n in low], lw=1)
            inset.tick_params(labelsize="x-small")
    columns = [clean["levels"].index(level) for level in noisy["levels"]]
    for k in range(len(p["kappas"])):
        before, after = np.array(clean["mean"][k])[columns], np.array(noisy["mean"][k])
        axes[2].plot(noisy["levels"], 100 * (1 - after / np.maximum(before, 1e-9)), lw=1.2)
    axes[2].axhline(0, color="0.7", lw=0.8)
    axes[0].set_title(noise)
    axes[2].set_xlabel(f"{noise}, {NOISES[noise]}")
