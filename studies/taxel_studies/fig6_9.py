"""Figure 6.9: how kappa makes a neuron robust against noise, trained without it and with it (thesis 6.4.5, 6.4.6)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import waves
from taxel_studies.study import Judgement, Parameters, Summary, Task, listed
from taxel_studies.waves import NOISES, READINGS

WHERE = "thesis 6.4.5 and 6.4.6, figure 6.9"
PROTOCOL = (
    waves.PROTOCOL
    + waves.READ
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
#: The claims of 6.4.5 and 6.4.6, by training: jitter, shunting, background below 15 Hz and above.
CLAIMS_OF = {"clean": (73, 74, 75, 76), "noisy": (77, 78, 79, 80)}
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


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.5 and 6.4.6 say, in each reading of B."""
    return waves.agreed(p["readings"], lambda reading: _judged(p, summary["curves"][reading]))


def _judged(p: Parameters, curves: dict[str, Any]) -> Iterator[Judgement]:
    for training, claims in CLAIMS_OF.items():
        here = curves[training]
        for claim, noise in zip(claims, ("jitter", "shunting"), strict=False):
            if noise in here:
                yield _larger_is_better(p, here[noise], claim)
        if "background" in here:
            yield from _turn(p, here["background"], claims[2:])
    yield _training_helps(p, curves)


def _larger_is_better(p: Parameters, curve: dict[str, Any], claim: int) -> Judgement:
    mean = np.array(curve["mean"])[:, [k for k, level in enumerate(curve["levels"]) if level]].mean(axis=1)
    holds = bool(mean[-1] < mean[0] - SAME * p["repetitions"] and np.all(np.diff(mean) < SAME * p["repetitions"]))
    return Judgement(claim, "distance, mean over levels: " + listed(mean, p["kappas"], ".1f"), holds)


def _turn(p: Parameters, curve: dict[str, Any], claims: tuple[int, ...]) -> Iterator[Judgement]:
    mean, levels = np.array(curve["mean"]), np.array(curve["levels"], float)
    gain = mean[0] - mean[-1]
    low, high = (levels > 0) & (levels < 15), levels > 15
    turns = [
        float(levels[k] + (levels[k + 1] - levels[k]) * gain[k] / (gain[k] - gain[k + 1]))
        for k in range(len(levels) - 1)
        if levels[k] > 0 and gain[k] > 0 >= gain[k + 1]
    ]
    turn = f"; turns at {turns[0]:.0f} Hz" if turns else ""
    yield Judgement(
        claims[0],
        "distance, mean below 15 Hz: " + listed(mean[:, low].mean(axis=1), p["kappas"], ".1f"),
        bool(gain[low].mean() > SAME * p["repetitions"]),
    )
    yield Judgement(
        claims[1],
        "distance, mean above 15 Hz: " + listed(mean[:, high].mean(axis=1), p["kappas"], ".1f") + turn,
        bool(gain[high].mean() < -SAME * p["repetitions"]),
    )


def _training_helps(p: Parameters, curves: dict[str, Any]) -> Judgement:
    parts, holds = [], True
    for noise, noisy in curves["noisy"].items():
        clean = curves["clean"][noise]
        columns = [clean["levels"].index(level) for level in noisy["levels"]]
        before, after = np.array(clean["mean"])[:, columns].mean(axis=1), np.array(noisy["mean"]).mean(axis=1)
        gain = 100 * (1 - after / np.maximum(before, 1e-9))
        holds &= bool(np.all(gain[np.array(p["kappas"]) > 1] > 0))
        parts.append(f"{noise} {listed(gain, p['kappas'], '.0f')}")
    return Judgement(
        81,
        "% less distance, mean over levels: " + "; ".join(parts),
        holds,
        "judged for kappa > 1, as 6.10 has it",
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.9 once a reading: rows a, b, c (clean, noisy, improvement), columns jitter, background, shunting."""
    readings = p["readings"]
    figure = Figure(figsize=(12, 10 * len(readings)), layout="constrained")
    parts = figure.subfigures(len(readings), 1, squeeze=False)[:, 0]
    for part, reading in zip(parts, readings, strict=True):
        part.suptitle(READINGS[reading].title)
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
