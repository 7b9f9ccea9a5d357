"""The Tempotron's capacity: how many epochs a load takes, and which loads it still solves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.spikes import SpikeTrains
from taxel_rules import Tempotron
from taxel_studies.study import Parameters, Row, Statement, Summary, grid, results, subplots

WHERE = "Gütig and Sompolinsky 2006; thesis 3.3"
PROTOCOL = (
    "500 inputs, one spike each in 500 ms, a random label a pattern; the settings of the paper's capacity runs as "
    "secondary sources give them (rate 3e-3 T / (tau N V0), momentum .99, first weights of 1e-3), without the "
    "supplement's small potential; weights change after each wrong pattern, until an epoch has no error or 2000 "
    "are over."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 10,
    "inputs": 500,
    "duration_ms": 500.0,
    "loads": [1.0, 2.0, 2.5, 3.0],
    "epochs": 2000,
}
TOY: dict[str, Any] = {"realisations": 3, "inputs": 50, "loads": [1.0, 2.0], "epochs": 300}
SIZES = {"toy": TOY}
#: Epochs to the solution in throw-away code with the same settings, 2 to 3 seeds a load.
NOTED = {1.0: (21, 29), 2.0: (68, 155)}


tasks = partial(grid, load="loads", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train on one drawn task: one spike an input, a random label a pattern."""
    random = np.random.default_rng([seed, params["inputs"]])
    inputs, duration = params["inputs"], params["duration_ms"]
    count = round(params["load"] * inputs)
    offsets = np.arange(inputs + 1)
    patterns = [SpikeTrains(random.uniform(0.0, duration, inputs), offsets, 0.0, duration) for _ in range(count)]
    labels = random.random(count) < 0.5
    fitted = Tempotron(epochs=params["epochs"], seed=seed).fit(patterns, labels)
    return {
        "solved": fitted.status_ == "right",
        "epochs": fitted.epochs_,
        "right": round(float(fitted.right_.max()), 6),
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List by load: share solved, epochs of those that were."""
    lines = []
    for load in p["loads"]:
        here = results(rows, load=load)
        epochs = sorted(r["epochs"] for r in here if r["solved"])
        lines.append(
            {
                "load": load,
                "runs": len(here),
                "solved": len(epochs),
                "epochs": epochs,
                "right": [r["right"] for r in here],
            }
        )
    return {"lines": lines}


def statements(p: Parameters, summary: Summary) -> Iterator[Statement]:
    """Compare the noted epochs with ours."""
    full = (p["inputs"], p["epochs"]) == (PARAMETERS["inputs"], PARAMETERS["epochs"])
    for line in summary["lines"]:
        spread = f"{line['epochs'][0]} to {line['epochs'][-1]} epochs" if line["epochs"] else "none"
        ours = f"{line['solved']} of {line['runs']} solved: {spread}"
        if line["load"] in NOTED:
            low, high = NOTED[line["load"]]
            yield Statement(
                f"At p / N = {line['load']:g} every task is solved.",
                f"{low} to {high} epochs (2 to 3 seeds of throw-away code)",
                ours,
                line["solved"] == line["runs"] if full else None,
                f"{p['realisations']} seeds spread wider",
            )
        else:
            yield Statement(
                f"At p / N = {line['load']:g} some tasks are solved.", "in part; capacity about 3", ours, None
            )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw the share of tasks solved, and the epochs that they needed, by load."""
    figure, (left, right) = subplots(9, 3.4, 1, 2)
    left.plot(
        [line["load"] for line in summary["lines"]], [line["solved"] / line["runs"] for line in summary["lines"]], ".-"
    )
    left.set(ylim=(-0.05, 1.05), ylabel=f"share solved in {p['epochs']} epochs")
    for line in summary["lines"]:
        right.plot([line["load"]] * len(line["epochs"]), line["epochs"], ".", color="C0")
    right.set_yscale("log")
    right.set_ylabel("epochs to the solution")
    for ax in (left, right):
        ax.set_xlabel("load p / N")
    return figure
