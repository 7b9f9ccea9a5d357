"""Figure 4.9: drops of a tennis ball laid out by t-SNE, by sampling rate (thesis 4.4.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel_studies import dropped, fig4_8
from taxel_studies.dropped import TENNIS
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, grid, listed

WHERE = "thesis 4.4.2, figure 4.9"
PROTOCOL = (
    "The drops of the study fig4.8, the first 20 ms of each drop, at the rates of the picture's panels by guess. "
    "t-SNE of scikit-learn on all frames of a drop, begun at its principal components; beside each map, how many "
    "of a drop's 10 nearest neighbours in it are of its own class; the same of drops sampled from any phase on, and of "
    "30 principal components with a random start, as a common toolbox does by default (from memory)."
)

PARAMETERS: dict[str, Any] = {
    **dropped.TENNIS_TABLE,
    "rates_hz": [50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0],
    "perplexity": 30.0,
    "seed": 1,
}
TOY: dict[str, Any] = {**dropped.TENNIS_TOY, "rates_hz": [100.0, 1000.0], "perplexity": 5.0}
SIZES = {"toy": TOY}
#: How long the frames of a drop last, ms.
LENGTH_MS = 20.0
#: From here on the classes lie clearly apart, Hz.
CLEAR_HZ = 500.0
#: The readings of what is mapped, and their names in the results.
MAPS = {
    "whole frames from the impact on": "own",
    "whole frames from any phase on": "any_phase_own",
    "30 principal components from the impact on, begun at random": "components_own",
}
#: Principal components that a common toolbox of t-SNE begins with by default (from memory).
COMPONENTS = 30
#: How many nearest neighbours in the map count, and what share of one's own class counts as clearly apart.
NEIGHBOURS, CLEAR = 10, 0.95


shared = partial(dropped.shared, rig=TENNIS)
tasks = partial(grid, rate_hz="rates_hz")


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Map all drops at a rate onto a plane, and classify each by its neighbours."""
    from sklearn.decomposition import PCA  # noqa: PLC0415  takes long
    from sklearn.manifold import TSNE  # noqa: PLC0415

    result: dict[str, Any] = {}
    for how, aligned in (("", True), ("any_phase_", False), ("components_", True)):
        x, y = fig4_8.sampled_drops(params, kept, 1000 / params["rate_hz"], LENGTH_MS, aligned=aligned)
        if how == "components_":
            x = PCA(min(COMPONENTS, *x.shape), random_state=params["seed"]).fit_transform(x)
        begun = "random" if how == "components_" else "pca"
        laid = TSNE(perplexity=params["perplexity"], init=begun, random_state=params["seed"]).fit_transform(x)
        result[f"{how}own"] = round(own_neighbours(np.asarray(laid, np.float64), y), 4)
        if not how:
            result["map"] = [[round(float(a), 1), round(float(b), 1)] for a, b in laid]
    return result


def own_neighbours(places: NDArray[np.float64], y: NDArray[np.int64]) -> float:
    """Return which share of the nearest neighbours is of one's own class."""
    squares = (places**2).sum(1)
    apart = squares[:, None] + squares - 2 * places @ places.T
    np.fill_diagonal(apart, np.inf)
    near = np.argsort(apart, axis=1)[:, : min(NEIGHBOURS, int(np.bincount(y).min()) - 1)]
    return float(np.mean(y[near] == y[:, None]))


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List the maps by rate."""
    maps = {row.params["rate_hz"]: row.result for row in rows}
    names = [f"{c.height_mm / 10:g} cm, {c.slant_deg:g} degrees" for c in dropped.conditions(p)]
    return {"lines": [{"rate_hz": rate, **maps[rate]} for rate in sorted(maps)], "classes": names}


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.4.2 says of the maps."""
    lines = summary["lines"]
    for reading, name in MAPS.items():
        fast = [line[name] for line in lines if line["rate_hz"] >= CLEAR_HZ]
        slow = [line[name] for line in lines if line["rate_hz"] < CLEAR_HZ]
        if fast and slow:
            shares = listed([line[name] for line in lines], [line["rate_hz"] for line in lines], place="{:g} Hz")
            yield Judgement(
                21,
                f"of the {NEIGHBOURS} nearest in the map are of one's own class: {shares}",
                bool(min(fast) >= CLEAR and max(slow) < min(fast)),
                f"clearly: {CLEAR:.0%} or more; by chance {1 / len(summary['classes']):.2f}; {p['drops']} drops a "
                f"class, perplexity {p['perplexity']:g}",
                reading,
            )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw a map a rate."""
    lines = summary["lines"]
    columns = min(3, len(lines))
    figure = Figure(figsize=(3 * columns, 3 * -(-len(lines) // columns) + 0.5), layout="constrained")
    axes = np.ravel(figure.subplots(-(-len(lines) // columns), columns, squeeze=False))
    size = len(lines[0]["map"]) // len(summary["classes"])
    for ax, line in zip(axes, lines, strict=False):
        places = np.array(line["map"])
        for k, name in enumerate(summary["classes"]):
            ax.plot(*places[k * size : (k + 1) * size].T, ".", ms=4, color=f"C{k}", label=name)
        ax.set_title(f"{line['rate_hz']:g} Hz", fontsize="medium")
    for ax in axes:
        ax.set_xticks([])
        ax.set_yticks([])
    for ax in axes[len(lines) :]:
        ax.set_axis_off()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize="small")
    figure.suptitle("figure 4.9: t-SNE of the first 20 ms")
    return figure
