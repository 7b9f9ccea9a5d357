"""Indented silicone, sampled and coded: what figures 5.1 to 5.8 share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.encode import FA1
from taxel.frames import Frames
from taxel.information import folds
from taxel_studies.discriminants import FoldSums
from taxel_studies.fem import TABLE_5_1, Condition, Course, Indentation, SamplingGrid, Table, paths, press
from taxel_studies.kept_bits import information
from taxel_studies.study import Kept, Row, Task

__all__ = [
    "COARSE",
    "TABLE",
    "TOY",
    "bits_of",
    "course_tasks",
    "courses_of",
    "largest_kpa",
    "make",
    "pressed",
    "rasters",
    "reached",
    "sampled",
    "shared",
    "summed",
    "table_of",
    "tasks",
    "varying",
]

#: Table 5.1 as a study's parameters; elements and steps that serve it.
TABLE: dict[str, Any] = {
    "diameters_mm": list(TABLE_5_1.diameters_mm),
    "moduli_kpa": list(TABLE_5_1.moduli_kpa),
    "depths_mm": list(TABLE_5_1.depths_mm),
    "angles_deg": list(TABLE_5_1.angles_deg),
    "mesh_mm": 0.1,
    "base_mesh_mm": 0.2,
    "step_um": 8.0,
}
#: All of it on elements twice as large and longer steps: minutes instead of an hour, pressure within some 1 %.
COARSE: dict[str, Any] = {"mesh_mm": 0.2, "step_um": 16.0}
#: A small table on coarse elements, which takes seconds.
TOY: dict[str, Any] = {
    "diameters_mm": [2.0, 4.0],
    "moduli_kpa": [50.0],
    "depths_mm": [0.25, 0.5],
    "angles_deg": [0.0, 10.0],
    "mesh_mm": 0.4,
    "base_mesh_mm": 0.4,
    "step_um": 25.0,
}
#: The parameter that marks the realisations of `course_tasks`.
_COURSE = "course"


def table_of(p: Mapping[str, Any]) -> Table:
    """Return the table of conditions that parameters name."""
    return Table(*(tuple(p[name]) for name in ("diameters_mm", "moduli_kpa", "depths_mm", "angles_deg")))


def courses_of(p: Mapping[str, Any], **settings: Any) -> dict[tuple[float, float, float], Indentation]:
    """Return the indentations that serve a study's conditions, by diameter, modulus and angle."""
    meshed = {name: p[name] for name in ("mesh_mm", "base_mesh_mm", "step_um")}
    asked = paths(table_of(p).conditions(), **{**meshed, **settings})
    return {(i.diameter_mm, i.modulus_kpa, i.angle_deg): i for i in asked}


def course_tasks(asked: Sequence[Indentation]) -> list[Task]:
    """List one realisation a course, the largest first."""
    return [Task({_COURSE: i.to_dict()}) for i in sorted(asked, key=lambda i: -i.diameter_mm)]


def tasks(p: Mapping[str, Any]) -> list[Task]:
    """List one realisation a path of a table of contacts."""
    return course_tasks(list(courses_of(p).values()))


def make(params: Mapping[str, Any], kept: Kept) -> Course | None:
    """Return the course that a realisation is to make, from the folder or anew; None where it makes none."""
    if _COURSE not in params:
        return None
    return pressed(Indentation.from_dict(params[_COURSE]), kept)


def pressed(asked: Indentation, kept: Kept) -> Course:
    """Return a course, computed once for all studies of a report."""
    course: Course = kept.made(press, asked)
    return course


def largest_kpa(asked: Sequence[Indentation], kept: Kept, grid: SamplingGrid) -> float:
    """Return the largest pressure on any taxel of a grid on any course: Table 5.3's range."""
    return max(grid.most_kpa(pressed(one, kept)) for one in asked)


def rasters(
    conditions: Sequence[Condition],
    asked: Mapping[tuple[float, float, float], Indentation],
    kept: Kept,
    *,
    grid: SamplingGrid,
    encoder: FA1,
    samples: int,
    seed: int,
    until_ms: float | None = None,
) -> NDArray[np.int8] | NDArray[np.int16]:
    """Return the spikes of the afferents in each condition's samples, (conditions * samples, steps * taxels), by step.

    Of the whole contact, or of its beginning until a time.
    """
    steps = grid.steps(encoder.period_ms) if until_ms is None else round(until_ms / encoder.period_ms)
    raster = np.zeros((len(conditions), samples, steps, grid.taxels), np.int8 if encoder.bits < 8 else np.int16)
    t = np.round(np.arange(steps + 1) * encoder.period_ms * 1000).astype(np.int64)
    loaded: dict[tuple[float, float, float], Course] = {}
    for k, c in enumerate(conditions):
        way = (c.diameter_mm, c.modulus_kpa, c.angle_deg)
        if way not in loaded:
            loaded[way] = pressed(asked[way], kept)
        values = grid.draw(loaded[way], c.depth_mm, encoder.period_ms, samples, seed=seed * len(conditions) + k)
        values = values[:, : steps + 1]
        spikes = encoder.encode(Frames(values.transpose(1, 0, 2), t, unit="kPa"))
        assert spikes.values is not None  # FA-1's spikes have signs
        train = np.repeat(np.arange(len(spikes)), np.diff(spikes.offsets))
        step = np.round(spikes.times / encoder.period_ms).astype(np.int64) - 1
        raster[k, train // grid.taxels, step, train % grid.taxels] = spikes.values
    return raster.reshape(len(conditions) * samples, -1)


def summed(x: NDArray[Any], conditions: int, samples: int, seed: int) -> FoldSums:
    """Assign the samples to ten folds, and sum them by fold and condition."""
    y = np.repeat(np.arange(conditions), samples)
    return FoldSums(x, y, folds(y, count=10, seed=seed))


def sampled(params: Mapping[str, Any], kept: Kept, encoder: FA1, seed: int) -> tuple[NDArray[Any], FoldSums]:
    """Return the rasters of a realisation on samples (of `shared` parameters), and their sums by fold and condition."""
    conditions, samples = reached(params), params["samples"]
    x = rasters(
        conditions,
        courses_of(params),
        kept,
        grid=SamplingGrid(),
        encoder=encoder,
        samples=samples,
        seed=seed,
        until_ms=params.get("until_ms"),
    )
    return x, summed(x, len(conditions), samples, seed)


def bits_of(
    sums: FoldSums, samples: int, merge: Mapping[int, Any] | None = None, features: int | None = None
) -> dict[str, float]:
    """Return the information of the discriminants' answers: corrected, as counted, and the share that is right."""
    # Taxels that never fire, or always with others, are left out by LDA, as scikit-learn does.
    answers = sums.predictions(merge=merge, features=features)
    truth = np.repeat(sums.classes, samples)
    if merge is not None:
        truth = np.array([merge[k] for k in truth.tolist()])
    return information(truth, answers, "bits", "plug_in", "right", "most")


def varying(x: NDArray[Any], folds: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which features vary in every training set: with none there is nothing to classify by."""
    least, most = (np.stack([way(x[folds == k], 0) for k in np.unique(folds)]) for way in (np.min, np.max))
    others = [np.arange(len(least)) != k for k in range(len(least))]
    return np.asarray(np.all([least[o].min(0) < most[o].max(0) for o in others], axis=0))


def course_summary(course: Course) -> dict[str, Any]:
    """Return the properties of a course that the studies of bits need."""
    return {
        "reached_mm": float(course.path_mm[-1]),
        "fault": course.fault,
        "most_kpa": round(SamplingGrid().most_kpa(course), 4),
    }


def shared(p: Mapping[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """Return the parameters that all realisations on samples share: the largest pressure, conditions left out and more.

    A condition that its course did not reach is left out, never filled in.
    """
    made = [row for row in rows if _COURSE in row.params]
    short = {
        (row.params[_COURSE]["diameter_mm"], row.params[_COURSE]["modulus_kpa"], row.params[_COURSE]["angle_deg"]): row
        for row in made
        if row.result["fault"]
    }
    left_out = [
        [c.diameter_mm, c.modulus_kpa, c.depth_mm, c.angle_deg]
        for c in table_of(p).conditions()
        if (row := short.get((c.diameter_mm, c.modulus_kpa, c.angle_deg))) and row.result["reached_mm"] < c.depth_mm
    ]
    return {
        **{name: p[name] for name in TABLE},
        "range_kpa": max(row.result["most_kpa"] for row in made),
        "left_out": left_out,
    }


def reached(params: Mapping[str, Any]) -> list[Condition]:
    """Return the conditions of a realisation on samples."""
    left_out = {Condition(*one) for one in params["left_out"]}
    return [c for c in table_of(params).conditions() if c not in left_out]
