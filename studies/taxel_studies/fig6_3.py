"""Figure 6.3: the objectives of CONE-X and CONE-R over two weights (thesis 6.3.4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.learn import ConeR, ConeX
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.mapping import LEARN, TABLE
from taxel_studies.runner import noted
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, grid

WHERE = "thesis 6.3.4, figure 6.3"
PROTOCOL = (
    "Two synapses with one spike each, at 5 and 12 ms, one target at 20 ms; Table 6.1 but bounds of ±1 mV (with "
    "±0.3 mV two inputs cannot reach the threshold: 2 x 0.3 x 0.368 = 0.22 mV), rows on a grid of 1 ms. The "
    "surfaces are stated with NumPy from 6.5, 6.8, 6.11 and 6.14, apart from the learners; dots are the learners' "
    "optima."
)

PARAMETERS: dict[str, Any] = {
    "inputs_at": [5.0, 12.0],
    "target": 20.0,
    "bound": 1.0,
    "kappa": 1.2,
    "lambdas_x": [2.0, 2.0, 200.0],
    "lambdas_r": [2.0, 2.0, 100.0, 100.0, 100.0],
    "points": 101,
}
SIZES = {"toy": {"points": 41}}
#: Delta t of Table 6.1, ms.
DELTA_T: float = LEARN["delta_t_ms"]


def tasks(p: Parameters) -> list[Task]:
    """List the two learners."""
    return grid({**p, "learners": ["cone_x", "cone_r"]}, learner="learners")


def realise(params: dict[str, Any], _seed: int) -> dict[str, Any]:
    """State the objective over a grid of weights with NumPy, and let the learner find its optimum."""
    hard = params["learner"] == "cone_x"
    trains = SpikeTrains.from_lists([[t] for t in params["inputs_at"]], 0.0, params["target"])
    options = {
        "neuron": Neuron(**TABLE, time="grid"),
        "kappa": params["kappa"],
        "delta_t_ms": DELTA_T,
        "lb": -params["bound"],
        "ub": params["bound"],
        "lambdas": params["lambdas_x"] if hard else params["lambdas_r"],
    }
    if hard:
        exact = noted(ConeX(**options).fit([trains], [[params["target"]]]))
        status, weights = exact.status_, exact.weights_
    else:
        best = noted(ConeR(**options).fit([trains], [[params["target"]]]))
        status, weights = best.status_, best.weights_
    axis = np.linspace(-params["bound"], params["bound"], params["points"])
    mesh = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1)
    rows = _Rows(params)
    return {
        "status": status,
        "weights": weights.tolist(),
        "axis": axis.round(6).tolist(),
        "objective": rows.objective(mesh, hard).round(6).tolist(),
        "optimum": float(rows.objective(weights, hard)),
        "line": rows.line(axis, hard),
        "silent": rows.silent(mesh).tolist(),
        "missed_mv": float(abs(weights @ rows.target - rows.theta)),
    }


class _Rows:
    """The rows of 6.11 and 6.14 for one target, by the printed kernel, on a grid of 1 ms."""

    def __init__(self, params: dict[str, Any]) -> None:
        self.params = params
        td, refractory = params["target"], TABLE["refractory"]
        inputs = np.array(params["inputs_at"])

        def kernel(times: Any) -> NDArray[np.float64]:
            x = np.maximum(np.asarray(times)[..., None] - inputs, 0.0) / TABLE["tau"]
            values: NDArray[np.float64] = x * np.exp(-x)
            return values

        times = np.arange(0.0, td + TABLE["tau"] + 0.5)
        times = times[(times < td) | (times > td + refractory)]
        self.theta = TABLE["theta_0"]
        self.target, self.lifted, self.quiet = kernel(td), kernel(td + DELTA_T), kernel(times)
        decay = np.exp(-(times - td - refractory) / (2 * TABLE["tau"]))
        self.limit = self.theta + np.where(times > td, TABLE["theta_plus"] * decay, 0.0)

    def terms(self, weights: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """Return l1, l2, B, C, D, not normalised."""
        lifted = (weights @ self.lifted - self.params["kappa"] * self.theta) ** 2
        broken = np.maximum(weights @ self.quiet.T - self.limit, 0.0).sum(axis=-1)
        missed = np.abs(weights @ self.target - self.theta)
        return [np.abs(weights).sum(axis=-1), np.sqrt((weights**2).sum(axis=-1)), lifted, missed, broken]

    def objective(self, weights: Any, hard: bool) -> NDArray[np.float64]:
        """Return 6.11's objective (`hard`) or 6.14's."""
        bound = self.params["bound"]
        least, most = self.terms(np.full(2, -bound)), self.terms(np.full(2, bound))
        largest = [most[0], most[1], least[2], least[3], most[4]]
        lambdas = self.params["lambdas_x" if hard else "lambdas_r"]
        total = np.zeros(np.shape(weights)[:-1])
        for factor, term, normaliser in zip(lambdas, self.terms(np.asarray(weights)), largest, strict=False):
            total = total + factor / sum(lambdas) * term / normaliser
        return total

    def silent(self, weights: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mark the weights that satisfy every row at which the neuron must not fire."""
        kept: NDArray[np.bool_] = np.all(weights @ self.quiet.T <= self.limit + 1e-12, axis=-1)
        return kept

    def line(self, axis: NDArray[np.float64], hard: bool) -> dict[str, Any]:
        """Return the line within the bounds on which the target is met, and the objective along it."""
        fine = np.linspace(axis[0], axis[-1], 4001)
        other = (self.theta - fine * self.target[1]) / self.target[0]
        inside = np.abs(other) <= self.params["bound"]
        weights = np.stack([other[inside], fine[inside]], axis=-1)
        kept = self.silent(weights)
        values = self.objective(weights, hard)
        return {
            "weights": weights[::20].round(6).tolist(),
            "objective": values[::20].round(6).tolist(),
            "kept": kept[::20].tolist(),
            "least": float(values[kept].min()) if kept.any() else None,
        }


def summarise(_p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return both surfaces."""
    return {row.params["learner"]: row.result for row in rows}


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 6.3.4 says."""
    x, r = summary["cone_x"], summary["cone_r"]
    surface, axis = np.array(r["objective"]), np.array(r["axis"])
    least = np.unravel_index(np.argmin(surface), surface.shape)
    rows = _Rows({**p})
    there = np.array([axis[least[0]], axis[least[1]]])
    missed = abs(float(there @ rows.target) - rows.theta)
    cell = float(np.abs(rows.target).sum() * (axis[1] - axis[0]))
    silent = np.array(r["silent"])
    reach = abs(p["bound"])
    broken = float(np.median(surface[~silent])) if (~silent).any() else float("nan")
    along = float(np.median(r["line"]["objective"]))
    yield Judgement(
        52,
        f"least second difference along both axes and diagonals: {_bend(np.array(x['objective'])):.0e} (CONE-X), "
        f"{_bend(surface):.0e} (CONE-R), rounded to 1e-6",
        min(_bend(np.array(x["objective"])), _bend(surface)) > -5e-6,
    )
    yield Judgement(
        53,
        f"learner {x['optimum']:.6f}, lowest of 4001 points of the line {x['line']['least']:.6f}; "
        f"target met to {x['missed_mv']:.0e} mV",
        x["status"] == "solved"
        and x["optimum"] <= x["line"]["least"] + 1e-9
        and x["line"]["least"] - x["optimum"] < 1e-3
        and x["missed_mv"] < 1e-9,
    )
    yield Judgement(
        54,
        f"the lowest of {p['points']} x {p['points']} points misses it by {missed:.4f} mV (a cell: {cell:.4f} mV); "
        f"learner {r['optimum']:.6f} against {surface.min():.6f}, misses it by {r['missed_mv']:.0e} mV",
        missed <= cell and r["optimum"] <= float(surface.min()) + 1e-6,
    )
    yield Judgement(
        55,
        f"median objective {broken:.3f} where silence is broken, {along:.3f} along the line (bounds ±{reach:g} mV)",
        broken > 3 * along,
    )


def _bend(surface: NDArray[np.float64]) -> float:
    """Return the least second difference: below 0 where a surface is not convex."""
    middle = surface[1:-1, 1:-1]
    pairs = (
        (surface[2:, 1:-1], surface[:-2, 1:-1]),
        (surface[1:-1, 2:], surface[1:-1, :-2]),
        (surface[2:, 2:], surface[:-2, :-2]),
        (surface[2:, :-2], surface[:-2, 2:]),
    )
    return float(min((a + b - 2 * middle).min() for a, b in pairs))


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 6.3: left CONE-X with its line, right CONE-R; below them the same from above."""
    figure = Figure(figsize=(12, 10.5), layout="constrained")
    for number, (learner, title) in enumerate((("cone_x", "CONE-X"), ("cone_r", "CONE-R")), 1):
        result = summary[learner]
        axis, surface = np.array(result["axis"]), np.array(result["objective"])
        first, second = np.meshgrid(axis, axis, indexing="ij")
        line, height = np.array(result["line"]["weights"]), np.array(result["line"]["objective"])
        kept = np.array(result["line"]["kept"])
        ax = figure.add_subplot(2, 2, number, projection="3d", computed_zorder=False)
        ax.plot_surface(first, second, surface, cmap="viridis", alpha=0.75, rcount=80, ccount=80, lw=0, rasterized=True)
        ax.plot(*line.T, height, color="0.2", lw=1.0, ls="--", label="target met")
        ax.plot(*line[kept].T, height[kept], color="C3", lw=2.5, label="target met, silence kept")
        ax.scatter(*result["weights"], result["optimum"], color="k", s=40, label="optimum", depthshade=False)
        ends = [-p["bound"], 0.0, p["bound"]]
        ax.set(xlabel="w1, mV", ylabel="w2, mV", zlabel="objective", title=title, xticks=ends, yticks=ends)
        ax.view_init(30, -60)
        above = figure.add_subplot(2, 2, number + 2, aspect="equal")
        # Levels have equal steps of rank, not of height: the surface is flat at its optimum and steep at the bounds.
        heights = np.unique(np.quantile(surface, np.linspace(0, 1, 25)))
        drawn = above.contourf(first, second, surface, heights, cmap="viridis")
        drawn.set(edgecolor="face", linewidth=0.4)  # closes the gaps that the page shows between two bands
        broken = np.where(result["silent"], np.nan, 1.0)
        above.contourf(first, second, broken, [0.5, 1.5], colors="none", hatches=["////"])
        above.plot(*line.T, color="0.2", lw=1.0, ls="--")
        above.plot(*line[kept].T, color="C3", lw=2.5)
        above.plot(*result["weights"], "ko", ms=6)
        above.set(xlabel="w1, mV", ylabel="w2, mV", xlim=(-p["bound"], p["bound"]), ylim=(-p["bound"], p["bound"]))
        above.set_title("from above; hatched: silence broken", fontsize="small")
        figure.colorbar(drawn, ax=above, shrink=0.8, label="objective", format="%.3f")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, fontsize="small", loc="outside upper center", ncols=3)
    return figure
