"""Figure 6.7: how many patterns a neuron can learn, by inputs and classes (thesis 6.4.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel_studies import capacity
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, grid, listed, results, subplots

WHERE = "thesis 6.4.4, figure 6.7"
PROTOCOL = (
    "Each pattern has one spike an input on a random whole ms from 1 to 200; class c of C shall fire once, at 200 "
    "c / (C + 1) ms. The largest p, a multiple of C, at which all realisations are feasible: start at 0.2 N, up "
    "while all are, down if not. Table 6.1, bounds ±0.3 mV, silence from 0 to 200 ms: at whole ms as the thesis "
    "has it, and at every instant. A realisation draws its patterns one after the other and a load takes the "
    "first p, so verdicts are monotone in p, and the search needs one solve for most realisations. Dotted: what "
    "others reported, under other criteria."
)

PARAMETERS: dict[str, Any] = {
    "realisations": 100,
    "inputs": [*range(50, 201, 10), *range(250, 501, 50), *range(600, 1001, 100)],
    "classes": [3, 5, 7],
    "times": ["grid", "continuous"],
    "readings": ["keep", "reset"],
    "margin": 1e-3,
    "slope": 1e-3,
}
TOY: dict[str, Any] = {"realisations": 3, "inputs": [40, 60, 80], "classes": [3, 5], "readings": ["keep"]}
SIZES = {"toy": TOY}
#: Where 6.4.4 says that the rise ends, and from where on we call it saturated.
BEND, SATURATED = 150, 500


def tasks(p: Parameters) -> list[Task]:
    """List one search an N, C, time and reading; the longest first."""
    ordered = {**p, "inputs": sorted(p["inputs"], reverse=True)}
    return grid(ordered, after_spike="readings", time="times", inputs="inputs", classes="classes")


realise = capacity.realise


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List the largest load by reading, time, classes and inputs."""
    lines = []
    for reading in p["readings"]:
        for time in p["times"]:
            for classes in p["classes"]:
                wanted = {"after_spike": reading, "time": time, "classes": classes}
                here = {n: results(rows, **wanted, inputs=n)[0] for n in p["inputs"]}
                lines.append(
                    {
                        "after_spike": reading,
                        "time": time,
                        "classes": classes,
                        "inputs": list(p["inputs"]),
                        "p": [here[n]["p"] for n in p["inputs"]],
                        "load": [here[n]["load"] for n in p["inputs"]],
                        "solves": sum(r["solves"] for r in here.values()),
                    }
                )
    return {"lines": lines, "others": capacity.PUBLISHED}


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.4.4 says, in each reading of what remains after a spike, on the grid and in continuous time."""
    for after in p["readings"]:
        for time in p["times"]:
            lines = [line for line in summary["lines"] if (line["after_spike"], line["time"]) == (after, time)]
            reading = f"after a spike “{after}”, " + ("1 ms grid" if time == "grid" else "every instant")
            yield from _of(p, lines, reading)
    yield from _price(p, summary)


def _of(p: Parameters, lines: list[dict[str, Any]], reading: str) -> Iterator[Judgement]:
    inputs = np.array(p["inputs"])
    load = np.array([line["load"] for line in lines])
    late, bend = inputs >= SATURATED, inputs == BEND
    if not (late.any() and bend.any()):
        ours = listed(load.mean(axis=0), inputs, ".3f", "N = {:g}")
        yield Judgement(65, f"{ours} (mean over C)", None, reading=reading)
        return
    saturated, at_bend = load[:, late].mean(axis=1), load[:, bend].mean()
    by_class = listed(saturated, [line["classes"] for line in lines], ".3f", "C = {:g}")
    best = max(capacity.PUBLISHED.values())
    yield Judgement(
        65,
        f"{load[:, 0].mean():.3f} at N = {inputs[0]}, {at_bend:.3f} at {BEND}, {load[:, -1].mean():.3f} at "
        f"{inputs[-1]} (mean over C)",
        bool(at_bend - load[:, 0].mean() > load[:, -1].mean() - at_bend),
        reading=reading,
    )
    yield Judgement(
        66,
        f"mean from N = {SATURATED} on: {by_class}",
        bool(np.all(np.abs(saturated - 0.3) <= 0.03) and np.ptp(saturated) <= 0.03),
        "about: within 0.03, which is ours",
        reading,
    )
    yield Judgement(
        67,
        f"{load[:, -1].min():.3f} or more at N = {inputs[-1]}",
        bool(load[:, -1].min() > best),
        "theirs were got under other criteria",
        reading,
    )


def _price(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    for after in p["readings"]:
        lines = {
            time: np.array(
                [line["p"] for line in summary["lines"] if (line["after_spike"], line["time"]) == (after, time)]
            )
            for time in p["times"]
        }
        if {"grid", "continuous"} <= set(lines):
            grid, exact = lines["grid"].sum(axis=0), lines["continuous"].sum(axis=0)
            large = np.array(p["inputs"]) >= min(BEND, max(p["inputs"]))
            cost = 100 * (1 - exact[large].sum() / max(grid[large].sum(), 1))
            yield Judgement(
                204,
                f"{cost:.1f} % of p over N from {min(BEND, max(p['inputs']))} on",
                None,
                f"margin {p['margin']:g} mV, slope {p['slope']:g} mV/ms",
                f"after a spike “{after}”",
            )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.7: load by inputs, a line a number of classes; a panel a time and reading."""
    shape = len(p["readings"]), len(p["times"])
    figure, axes = subplots(5.5 * shape[1], 3.6 * shape[0], *shape, sharex=True, sharey=True, squeeze=False)
    for line in summary["lines"]:
        ax = axes[p["readings"].index(line["after_spike"]), p["times"].index(line["time"])]
        ax.plot(line["inputs"], line["load"], ".-", lw=1.2, label=f"C = {line['classes']}")
        where = "1 ms grid" if line["time"] == "grid" else "every instant"
        ax.set_title(f"after a spike “{line['after_spike']}”, {where}")
    for ax in axes.ravel():
        for name, value in capacity.PUBLISHED.items():
            ax.axhline(value, color="0.75", lw=0.8, ls=":")
            ax.annotate(name, (0.99, value), xycoords=("axes fraction", "data"), fontsize=7, ha="right", va="bottom")
        ax.set_ylim(0, 0.4)
    for ax in axes[-1]:
        ax.set_xlabel("inputs N")
    for ax in axes[:, 0]:
        ax.set_ylabel("largest load p / N")
    axes[0, 0].legend(fontsize="small")
    return figure
