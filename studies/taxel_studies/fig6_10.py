"""Figure 6.10: dense against sparse weights under three noises (thesis 6.4.7)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import waves
from taxel_studies.study import Judgement, Parameters, Summary, Task
from taxel_studies.waves import NOISES, READINGS, TRAINED_AT

WHERE = "thesis 6.4.7, figure 6.10"
PROTOCOL = (
    waves.PROTOCOL
    + waves.READ
    + " CONE-R in both trainings, kappa 1.08, lambda 3 to 5 at 100, lambda 1 : lambda 2 varied."
)

PARAMETERS: dict[str, Any] = {
    **waves.TESTED,
    "ratios": [[0.0, 4.0], [1.0, 3.0], [2.0, 2.0], [3.0, 1.0], [4.0, 0.0]],
    "kappa": 1.08,
    "rest": [100.0, 100.0, 100.0],
}
TOY: dict[str, Any] = {
    **waves.TESTED_TOY,
    "ratios": [[0.0, 4.0], [4.0, 0.0]],
}
SIZES = {"toy": TOY}

#: Units of the levels.
UNITS = {"jitter": "ms", "background": "Hz", "shunting": "%"}
#: Levels of noise over which a statement is judged: above the first, up to the second.
ANY, WEAK, STRONG = (0.0, 100.0), (0.0, 5.0), (15.0, 100.0)


def tasks(p: Parameters) -> list[Task]:
    """List the realisations: CONE-R in both trainings."""
    settings = [{"kappa": p["kappa"], "lambdas": [*ratio, *p["rest"]]} for ratio in p["ratios"]]
    return waves.tasks(p, settings, settings, "cone_r")


realise = waves.realise
summarise = waves.summarise


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.7 says, in each reading of B."""
    return waves.agreed(p["readings"], lambda reading: _judged(summary["curves"][reading]))


def _judged(curves: dict[str, Any]) -> Iterator[Judgement]:
    clean = curves["clean"]
    claims = (
        (82, "jitter", True, ANY),
        (83, "background", False, ANY),
        (84, "shunting", True, WEAK),
        (85, "shunting", False, STRONG),
    )
    yield from (
        _compared(claim, clean[noise], UNITS[noise], dense_is_better, levels)
        for claim, noise, dense_is_better, levels in claims
        if noise in clean
    )
    spread = {t: _spread(c) for t, c in (("clean", clean), ("noisy", curves["noisy"]))}
    yield Judgement(
        86,
        "largest less smallest distance between ratios, mean over levels and noises: "
        f"{spread['clean']:.2f} noise-free, {spread['noisy']:.2f} noisy",
        spread["noisy"] < spread["clean"],
    )


def _compared(
    claim: int, curve: dict[str, Any], unit: str, dense_is_better: bool, among: tuple[float, float]
) -> Judgement:
    levels, mean = np.array(curve["levels"], float), np.array(curve["mean"])
    dense, sparse = mean[0], mean[-1]
    here = (levels > among[0]) & (levels <= among[1])
    means = dense[here].mean(), sparse[here].mean()
    gain = sparse - dense
    turns = [
        levels[k] + (levels[k + 1] - levels[k]) * gain[k] / (gain[k] - gain[k + 1])
        for k in range(len(levels) - 1)
        if levels[k] > 0 and gain[k] * gain[k + 1] < 0
    ]
    crossing = f"; they cross at {', '.join(f'{t:.1f}' for t in turns)} {unit}" if turns else "; they do not cross"
    over = " to ".join(f"{level:g}" for level in sorted({levels[here].min(), levels[here].max()}))
    holds = bool(means[0] < means[1] if dense_is_better else means[1] < means[0])
    turned = not holds and len(turns) == 1 and (gain[here][0] > 0) == dense_is_better
    return Judgement(
        claim,
        f"mean distance at {over} {unit}: {means[0]:.2f} dense (0 : 4), {means[1]:.2f} sparse (4 : 0){crossing}",
        holds,
        f"it does below {turns[0]:.1f} {unit}, and above it the other way round" if turned else "",
    )


def _spread(curves: dict[str, Any]) -> float:
    spreads = []
    for curve in curves.values():
        columns = [k for k, level in enumerate(curve["levels"]) if level >= TRAINED_AT]
        mean = np.array(curve["mean"])[:, columns]
        spreads.append(float((mean.max(axis=0) - mean.min(axis=0)).mean()))
    return float(np.mean(spreads))


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.10 once a reading: left noise-free, right noisy training; rows jitter, background, shunting."""
    figure = Figure(figsize=(7.5 * len(p["readings"]), 8.5), layout="constrained")
    parts = figure.subfigures(1, len(p["readings"]), squeeze=False)[0]
    for part, reading in zip(parts, p["readings"], strict=True):
        part.suptitle(READINGS[reading].title)
        axes = part.subplots(len(p["levels"]), 2, squeeze=False)
        for row, noise in enumerate(p["levels"]):
            for column, training in enumerate(("clean", "noisy")):
                curve = summary["curves"][reading][training][noise]
                for k, ratio in enumerate(p["ratios"]):
                    label = f"{ratio[0]:g} : {ratio[1]:g}"
                    axes[row, column].errorbar(curve["levels"], curve["mean"][k], curve["sem"][k], label=label, lw=1.2)
                axes[row, column].set(xlabel=f"{noise}, {NOISES[noise]}", ylabel="VP distance")
                axes[row, column].set_ylim(bottom=0)
        axes[0, 0].set_title("trained without noise")
        axes[0, 1].set_title("trained with noise")
        axes[min(1, len(axes) - 1), 0].legend(title="lambda 1 : lambda 2", fontsize="small", loc="upper left")
    return figure
