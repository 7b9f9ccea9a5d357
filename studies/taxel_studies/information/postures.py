"""Postures on a mat: bits by the number of taxels. The recordings have no time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.information import estimate, nested_predictions, zero_test
from taxel_studies.datasets import popu, trials
from taxel_studies.study import Parameters, Statement, Summary, Table

__all__ = ["ASKS", "USES", "draw", "realise", "statements", "tables"]

ASKS = ("posture",)
USES = ("mat_taxels", "draws", "shuffles", "most_trials")


def realise(params: dict[str, Any], seed: int, folder: Path) -> dict[str, Any]:
    """Estimate the bits on the posture, whole poses with all their variants left out."""
    values, labels, groups = [], [], []
    for trial in trials(popu, folder):
        if trial.about["posture"] == "empty":
            continue
        # The person does not move during the ten frames of a trial, so their mean is one sample.
        values.append(trial.frames.values.mean(0).ravel())
        labels.append(str(trial.about["posture"]))
        groups.append(str(trial.about["pose"]))
    x, y, poses = np.array(values, np.float64), np.array(labels), np.array(groups)
    loaded = np.flatnonzero(x.any(0))

    def named(x: NDArray[Any], draw: int, labels: NDArray[Any] = y) -> NDArray[Any]:
        centred = x - x.mean(0)
        features = max(1, int(centred.any(0).sum()))
        return nested_predictions([centred @ centred.T], [features], labels, groups=poses, seed=seed + draw).responses

    def bits(xs: list[NDArray[Any]]) -> dict[str, Any]:
        answers = np.array([named(one, k) for k, one in enumerate(xs)])
        return estimate(y, answers, groups=poses, seed=seed).to_dict()

    random = np.random.default_rng(seed)
    result: dict[str, Any] = {
        "looks": len(y),
        "poses": len(set(groups)),
        "taxels": params["mat_taxels"],
        "all": bits([x] * params["draws"]),
        "on_off": bits([(x > 0).astype(np.float64)] * params["draws"]),
        "sum": bits([x.sum(1, keepdims=True) / x.sum(1).std()]),
        "random": [
            bits([x[:, random.choice(loaded, n, replace=False)] for _ in range(params["draws"])])
            for n in params["mat_taxels"]
        ],
    }
    zero = zero_test(
        lambda mixed: named(x, 0, mixed), y, result["all"]["bits"], groups=poses, shuffles=params["shuffles"], seed=seed
    )
    result["zero"] = {"level": zero.level, "p": zero.p}
    return result


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Compare bits by number of taxels with the earlier trial."""
    one = summary["posture"]
    before = {16: 1.1, 64: 1.87}
    ours = {n: b["bits"] for n, b in zip(one["taxels"], one["random"], strict=True) if n in before}
    whole = p["most_trials"] == 0
    listed = ", ".join(f"{n} at random {bits:.2f}" for n, bits in ours.items())
    same = all(abs(bits - before[n]) <= 0.35 for n, bits in ours.items()) and one["all"]["bits"] > 1.8
    return [
        Statement(
            "Which of four postures somebody lies in, by number of taxels; new poses.",
            "all 2.00 of 2 bits, " + ", ".join(f"{n} at random {before[n]:.2f}" for n in ours) + ", loaded or not 1.63",
            f"all {one['all']['bits']:.2f} of 2 bits, {listed}, loaded or not {one['on_off']['bits']:.2f}",
            same if whole else None,
            "tried beforehand with other code; 28 poses of one person, interval over poses; within .35 bit",
        )
    ]


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """Return bits by number of taxels, as a table."""
    del p
    one = summary["posture"]

    def row(name: str, b: dict[str, Any]) -> list[str]:
        return [name, f"{b['bits']:.2f}", f"[{b['interval'][0]:.2f} {b['interval'][1]:.2f}]"]

    rows = [row(f"{n} taxels at random", b) for n, b in zip(one["taxels"], one["random"], strict=True)]
    rows += [row("all", one["all"]), row("all, loaded or not", one["on_off"]), row("the sum alone", one["sum"])]
    note = f"{one['looks']} looks at {one['poses']} poses, one person; chance {one['zero']['level']:.2f} (95 % below)"
    return [Table("mat, posture: bits of 2", ["taxels", "bits", "95 %, by poses"], rows, note)]


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw bits over the number of taxels."""
    del p
    one = summary["posture"]
    figure = Figure(figsize=(6, 4), layout="constrained")
    ax = figure.subplots()
    bits = np.array([b["bits"] for b in one["random"]])
    ends = np.array([b["interval"] for b in one["random"]])
    ax.errorbar(one["taxels"], bits, [bits - ends[:, 0], ends[:, 1] - bits], marker="o", capsize=2, label="at random")
    ax.axhline(one["all"]["bits"], color="0.3", lw=1, label="all")
    ax.axhline(one["on_off"]["bits"], color="0.6", ls=":", label="all, loaded or not")
    ax.set(xscale="log", xlabel="taxels", ylabel="bits", ylim=(0, 2.05), title="which posture on the mat")
    ax.legend(frameon=False)
    return [figure]
