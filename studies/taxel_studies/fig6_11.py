"""Figure 6.11: how weights are distributed, trained without noise and with it (thesis 6.4.7)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel_studies import waves
from taxel_studies.mapping import LEARN
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, results, subplots
from taxel_studies.waves import READINGS

WHERE = "thesis 6.4.7, figure 6.11"
PROTOCOL = (
    waves.PROTOCOL
    + waves.READ
    + " Here only the weights: CONE-R, kappa 1.04, lambda (2, 2, 100, 100, 100), mean of the trials."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 100,
    "kappa": 1.04,
    "lambdas": [2.0, 2.0, 100.0, 100.0, 100.0],
    "readings": list(READINGS),
    "trainings": ["clean", "jitter", "background", "shunting"],
    "bin_mv": 0.001,
    "repetitions": waves.REPETITIONS,
}
TOY: dict[str, Any] = {"realisations": 3, "repetitions": 5}
SIZES = {"toy": TOY}
#: The claim of 6.4.7 by training.
CLAIM_OF = {"clean": 87, "jitter": 88, "background": 89, "shunting": 90}
#: A mode stands out from its valley by this share of the tallest mode.
STANDS_OUT = 0.05
#: Bins with a smaller share are not drawn.
DRAWN_FROM = 2e-4


tasks = partial(grid, reading="readings", training="trainings", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train on one pattern, and test nothing."""
    given = {
        "training": params["training"],
        "learner": "cone_r",
        "settings": [{"kappa": params["kappa"], "lambdas": params["lambdas"]}],
        "reading": params["reading"],
        "levels": {params["training"]: []} if params["training"] != "clean" else {},
        "repetitions": params["repetitions"],
    }
    return waves.realise(given, seed)


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Average the histograms over trials, as shares of the weights."""
    bound = LEARN["ub"]
    half = round(bound / p["bin_mv"])
    # A bin is centred at 0, where l1 leaves many weights.
    edges = (np.arange(-half, half + 2) - 0.5) * p["bin_mv"]
    summary: Summary = {"centres": ((edges[:-1] + edges[1:]) / 2).round(6).tolist(), "shares": {}}
    for reading in p["readings"]:
        summary["shares"][reading] = {}
        for training in p["trainings"]:
            weights = [r["found"][0]["weights"] for r in results(rows, reading=reading, training=training)]
            counts = np.histogram(np.clip(weights, edges[0], edges[-1]), edges)[0]
            summary["shares"][reading][training] = (counts / counts.sum()).round(6).tolist()
    return summary


def modes(shares: NDArray[np.float64]) -> list[int]:
    """Return the bins of the modes that stand out, in a histogram smoothed over three bins."""
    smooth = np.convolve(np.pad(shares, 1, mode="edge"), [0.25, 0.5, 0.25], mode="valid")
    least = STANDS_OUT * smooth.max()
    places: list[int] = []
    best, rising, valley = 0, True, smooth[0]
    for k, value in enumerate(smooth):
        if rising:
            if value > smooth[best]:
                best = k
            elif value < smooth[best] - least:
                places.append(best)
                rising, valley = False, value
        elif value < valley:
            valley = value
        elif value > valley + least:
            rising, best = True, k
    if rising:
        places.append(best)
    return places


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.7 says, in each reading of B."""
    return waves.agreed(p["readings"], lambda reading: _judged(p, summary, reading))


def _judged(p: Parameters, summary: Summary, reading: str) -> Iterator[Judgement]:
    centres = np.array(summary["centres"])
    for training in p["trainings"]:
        shares = np.array(summary["shares"][reading][training])
        where = [float(centres[k]) for k in modes(shares)]
        ours = "modes at " + ", ".join(f"{w:.3f}" for w in where) + " mV"
        holds = len(where) > 1
        if training != "clean":
            holds = len(where) == 1 and abs(where[0]) <= p["bin_mv"]
            behind = shares[centres > 0.5 * p["bin_mv"]]
            back = 100 * float(np.max(behind - np.minimum.accumulate(behind)))
            ours += f"; above zero the histogram rises again by {back:.1f} % of the weights at most"
        yield Judgement(CLAIM_OF[training], ours, holds)


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.11: a row a training, a column a reading."""
    figure, axes = subplots(
        5 * len(p["readings"]), 8, len(p["trainings"]), len(p["readings"]), sharex=True, squeeze=False
    )
    for column, reading in enumerate(p["readings"]):
        axes[0, column].set_title(READINGS[reading].title)
        for row, training in enumerate(p["trainings"]):
            shares = 100 * np.array(summary["shares"][reading][training])
            edges = np.append(
                np.array(summary["centres"]) - 0.5 * p["bin_mv"], summary["centres"][-1] + 0.5 * p["bin_mv"]
            )
            axes[row, column].stairs(shares, edges, fill=True, color="C0" if row else "0.4")
            axes[row, column].set_ylabel(f"{'no noise' if training == 'clean' else training}\n% of weights")
        axes[-1, column].set_xlabel("weight, mV")
    held = np.array([shares for trainings in summary["shares"].values() for shares in trainings.values()]).max(axis=0)
    drawn = np.array(summary["centres"])[held > DRAWN_FROM]
    axes[0, 0].set_xlim(drawn[0] - 2 * p["bin_mv"], drawn[-1] + 2 * p["bin_mv"])
    return figure
