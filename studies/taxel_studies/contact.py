"""Figures 5.1 to 5.4: a half disc pressed on silicone, the pressure at its base, how it is sampled, and the spikes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.encode import FA1
from taxel.frames import Frames
from taxel_studies import indented
from taxel_studies.fem import Course, SamplingGrid, Yeoh, bodies, conditions
from taxel_studies.fem.solids import Solids
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, Task, subplots

WHERE = "thesis 5.4.1 and 5.4.2, figures 5.1 to 5.4, tables 5.1 and 5.2"
PROTOCOL = (
    "Finite elements of our own: plane stress, incompressible Yeoh (Table 5.2), bilinear quadrilaterals, contact "
    "with friction 0.7, quasi-static. The block is 16 mm wide and 5 mm high and its base is held; the half disc's "
    "flat top is moved along the path. 75 paths serve the 300 conditions, as each depth is reached in 100 ms. "
    "Pressure is the normal traction at the base. What the thesis leaves open stands on the page Readings. Courses are "
    "kept beside the report and shared by figures 5.5 to 5.8."
)

PARAMETERS: dict[str, Any] = {
    **indented.TABLE,
    "drawn": {"diameter_mm": 3.0, "modulus_kpa": 150.0, "angle_deg": 10.0, "depth_mm": 1.0},
    "period_ms": 0.5,
    "alpha": 0.7,
    "seed": 1,
}
SIZES = {
    "coarse": indented.COARSE,
    "toy": {**indented.TOY, "drawn": {"diameter_mm": 2.0, "modulus_kpa": 50.0, "angle_deg": 10.0, "depth_mm": 0.5}},
}
#: A force on the base counts as equal to the one on the disc within this share of it.
ROUNDING = 1e-8
#: Samples of figure 5.3's picture, ms and mm (the thesis recorded every 0.2 ms), and its grids.
PICTURE_MS, PICTURE_MM, GRIDS = 0.4, 0.1, 3
#: Colours of the sampling grids in the picture.
COLOURS = ("C3", "C1", "C9")


shared = indented.shared


def tasks(p: Parameters) -> list[Task]:
    """List one realisation a course."""
    return [Task({"course": one}) for _, one in shared(p)]


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Press once, and return how well the forces balance."""
    course = indented.pressed(params["course"], kept)
    most = max(float(np.abs(course.reaction).max()), 1e-300)
    mirrored = course.pressure_kpa - course.pressure_kpa[:, ::-1]
    return {
        "reached_mm": float(course.path_mm[-1]),
        "fault": course.fault,
        "most_kpa": round(SamplingGrid().most_kpa(course), 4),
        "force": [round(f, 4) for f in course.reaction[-1]],
        "unbalanced": float(np.abs(course.reaction - course.base).max()) / most,
        "asymmetry": round(float(np.abs(mirrored[-1]).max() / course.pressure_kpa[-1].max()), 9),
        "factorisations": course.factorisations,
        "cuts": course.cuts,
    }


def summarise(p: Parameters, rows: Sequence[Row], kept: Kept) -> Summary:
    """List the courses, and what the pictures show of one of them."""
    paths = [{**asdict(row.params["course"]), **row.result} for row in rows]
    wanted = p["drawn"]
    asked = indented.courses_of(p)
    shown = asked[wanted["diameter_mm"], wanted["modulus_kpa"], wanted["angle_deg"]]
    course = indented.pressed(shown, kept)
    most = max(row.result["most_kpa"] for row in rows)
    return {
        "paths": [{k: v for k, v in one.items() if k != "silicone"} for one in paths],
        "conditions": len(conditions(p)),
        "most_kpa": most,
        "model": _shape(course, wanted["depth_mm"]),
        "sampled": _sampled(p, course, most),
    }


def _shape(course: Course, depth: float) -> dict[str, Any]:
    """Return the bodies at rest and pressed, and the pressure in each element: minus the true vertical stress."""
    ground, disc = bodies(course.indentation)
    laws = course.indentation.silicone, Yeoh.of_modulus(course.indentation.modulus_kpa)
    solids = Solids([(ground, laws[0]), (disc, laws[1])])
    at = min(course.shapes, key=lambda path: abs(path - depth))
    x = course.shapes[at].astype(float)
    f = solids.gradient((x - solids.nodes).ravel()).mean(1)
    split = len(ground.quads)
    pressure = []
    for part, law in ((f[:split], laws[0]), (f[split:], laws[1])):
        stress = law.stress(part)
        pressure.append(-(stress[:, 2] * part[:, 2] + stress[:, 3] * part[:, 3]))
    return {
        "at_mm": round(at, 4),
        "rest": solids.nodes.round(2).tolist(),
        "pressed": x.round(2).tolist(),
        "quads": np.concatenate([ground.quads, disc.quads + solids.first[1]]).tolist(),
        "pressure_kpa": np.concatenate(pressure).round(2).tolist(),
    }


def _sampled(p: Parameters, course: Course, most: float) -> dict[str, Any]:
    depth, period = p["drawn"]["depth_mm"], p["period_ms"]
    fine = SamplingGrid(taxels=51, pitch_mm=PICTURE_MM, shift_mm=0.0)
    still = SamplingGrid(shift_mm=0.0)
    random = np.random.default_rng(p["seed"])
    encoder = FA1(alpha=p["alpha"], range=most, period_ms=period)
    values = still.draw(course, depth, period, 1, seed=p["seed"])[0]
    t = np.round(np.arange(len(values)) * period * 1000).astype(np.int64)
    spikes = encoder.encode(Frames(values[:, None, :], t, unit="kPa"))
    assert spikes.values is not None  # FA-1's spikes have signs
    rho = np.maximum(values, 0) ** p["alpha"]
    return {
        "places_mm": still.places_mm().round(3).tolist(),
        "rho": rho.round(4).tolist(),
        "theta_0": most ** p["alpha"] / 1024,
        "times": [spikes[k].round(3).tolist() for k in range(len(spikes))],
        "signs": [
            spikes.values[spikes.offsets[k] : spikes.offsets[k + 1]].astype(int).tolist() for k in range(len(spikes))
        ],
        "least_change": _least_change(rho, spikes, period) / (most ** p["alpha"] / 1024),
        "picture": fine.draw(course, depth, PICTURE_MS, 1, seed=p["seed"])[0, 1:].round(3).astype(float).tolist(),
        "grids": [[round(float(v), 3) for v in random.uniform([0, -0.1], [5.0, 0.1])] for _ in range(GRIDS)],
    }


def _least_change(rho: NDArray[np.float64], spikes: Any, period: float) -> float:
    """Return the smallest change since the last spike at which one was fired: 5.3 anew, from the spikes."""
    least = np.inf
    for k in range(len(spikes)):
        at = np.concatenate([[0], np.round(spikes[k] / period).astype(int)])
        if len(at) > 1:
            least = min(least, float(np.abs(np.diff(rho[at, k])).min()))
    return least


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 5.4.1 and the captions say."""
    paths = summary["paths"]
    short = [one for one in paths if one["fault"]]
    slanted = [one["asymmetry"] for one in paths if one["angle_deg"]]
    straight = [one["asymmetry"] for one in paths if not one["angle_deg"]]
    yield Judgement(
        25,
        f"{summary['conditions']} conditions of {len(paths)} paths; {len(paths) - len(short)} reach their depth, "
        f"{sum(one['factorisations'] for one in paths)} matrices solved, {sum(one['cuts'] for one in paths)} steps "
        "halved",
        False if short else True if summary["conditions"] == 300 else None,
        "; ".join(f"{one['diameter_mm']:g} mm, {one['modulus_kpa']:g} kPa: {one['fault']}" for one in short)
        or f"mesh {p['mesh_mm']:g} mm, steps of {p['step_um']:g} um",
    )
    yield Judgement(
        202,
        f"within {max(one['unbalanced'] for one in paths):.1e} of the force, over all steps of all paths",
        all(one["unbalanced"] < ROUNDING for one in paths),
        "the sum of the base's reactions against the force on the half disc",
    )
    if slanted and straight:
        yield Judgement(
            26,
            f"left and right differ by {min(slanted):.3f} to {max(slanted):.3f} of the peak under a slant, by "
            f"{max(straight):.0e} straight down",
            min(slanted) > 0.01 > max(straight),
            "pressure at the base, at full depth",
        )
    drawn = summary["sampled"]
    count = sum(map(len, drawn["times"]))
    yield Judgement(
        27,
        f"{count} spikes; the smallest change since the last one is {drawn['least_change']:.3f} theta_0",
        count > 0 and drawn["least_change"] > 0.95,  # 5.5 as printed lets it sink below theta_0 by B theta_0
        f"one sample path at {p['period_ms']:g} ms",
    )


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw 5.2 (the model; pressed), 5.1 and 5.4 (pressure and spikes), and 5.3 (the grid)."""
    return [_draw_model(p, summary["model"]), _draw_spikes(summary["sampled"], p), _draw_grid(summary["sampled"])]


def _draw_model(p: Parameters, model: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(8, 7), layout="constrained")
    axes: Sequence[Axes] = figure.subplots(2, 1, sharex=True)
    quads, drawn = np.array(model["quads"]), p["drawn"]
    axes[0].add_collection(
        PolyCollection(
            np.array(model["rest"])[quads], facecolors="0.93", edgecolors="0.6", linewidths=0.2, rasterized=True
        )
    )
    angle = np.radians(drawn["angle_deg"])
    top = np.array(model["rest"])[:, 1].max()
    axes[0].annotate(
        "", (np.sin(angle) * 1.2, top - 1.2 * np.cos(angle)), (0, top), arrowprops={"arrowstyle": "->", "color": "C3"}
    )
    axes[0].set_title(
        "the model: (a) diameter, (b) modulus, (c) depth along the arrow, (d) its angle; the base is held"
    )
    pressed = PolyCollection(
        np.array(model["pressed"])[quads], linewidths=0, antialiaseds=False, cmap="viridis", rasterized=True
    )
    pressure = np.array(model["pressure_kpa"])
    pressed.set_array(pressure)
    pressed.set_clim(0, float(np.quantile(pressure, 0.995)))
    axes[1].add_collection(pressed)
    axes[1].set_title(
        f"{drawn['diameter_mm']:g} mm, {drawn['modulus_kpa']:g} kPa, {drawn['angle_deg']:g} degrees, "
        f"{model['at_mm']:g} mm deep"
    )
    figure.colorbar(pressed, ax=list(axes), label="pressure, kPa")
    for ax in axes:
        ax.set_aspect("equal")
        ax.set(xlim=(-5, 5), ylim=(-0.2, top + 0.3), ylabel="mm")
    axes[1].set_xlabel("mm")
    return figure


def _draw_spikes(sampled: dict[str, Any], p: Parameters) -> Figure:
    figure, ax = subplots(9, 4)
    rho, period = np.array(sampled["rho"]), p["period_ms"]
    shown = ax.imshow(
        rho.T, aspect="auto", origin="lower", extent=(0, len(rho) * period, -0.5, rho.shape[1] - 0.5), cmap="viridis"
    )
    for k, (times, signs) in enumerate(zip(sampled["times"], sampled["signs"], strict=True)):
        for t, sign in zip(times, signs, strict=True):
            ax.plot([t, t], [k - 0.4, k + 0.4], color="k" if sign > 0 else "w", lw=0.9)
    ax.set(
        xlabel="ms since contact",
        ylabel="afferent (0.2 mm apart)",
        title="spikes (black: rise, white: fall) on the pressure to the power alpha; the order is the pattern (5.1)",
    )
    figure.colorbar(shown, ax=ax, label="rho")
    return figure


def _draw_grid(sampled: dict[str, Any]) -> Figure:
    figure, ax = subplots(9, 4)
    picture = np.array(sampled["picture"])
    reach = (picture.shape[1] - 1) / 2 * PICTURE_MM
    ax.imshow(
        picture.T, aspect="auto", origin="lower", extent=(0, len(picture) * PICTURE_MS, -reach, reach), cmap="Greys"
    )
    for (late, aside), colour in zip(sampled["grids"], COLOURS, strict=False):
        t, x = np.meshgrid(np.arange(late, 100, 5.0), np.array(sampled["places_mm"]) + aside)
        ax.plot(t.ravel(), x.ravel(), ".", ms=3, color=colour, alpha=0.8)
    ax.set(
        xlabel="ms since contact",
        ylabel="place at the base, mm",
        title="three draws of the sub-sampling grid (here every 5 ms) over one course",
    )
    return figure
