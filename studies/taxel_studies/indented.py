"""Indented silicone, sampled and coded: what figures 5.1 to 5.8 share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.encode import FA1
from taxel.frames import Frames
from taxel.information import folds
from taxel_studies.discriminants import FoldSums
from taxel_studies.fem import TABLE_5_1, Condition, Course, Indentation, SamplingGrid, conditions, paths, press
from taxel_studies.kept_bits import information
from taxel_studies.study import Kept

#: A course by diameter, modulus and angle of its indentation.
_Way = tuple[float, float, float]
#: Table 5.1 as a study's parameters; elements and steps that serve it.
TABLE: dict[str, Any] = {
    **TABLE_5_1,
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


def courses_of(p: Mapping[str, Any]) -> dict[_Way, Indentation]:
    """Return the indentations that serve a study's conditions, by diameter, modulus and angle."""
    meshed = {name: p[name] for name in ("mesh_mm", "base_mesh_mm", "step_um")}
    return {_way(asked): asked for asked in paths(conditions(p), **meshed)}


def shared(p: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """List the calls that make the courses, which studies share, the largest first."""
    return [(press, one) for one in sorted(courses_of(p).values(), key=lambda one: -one.diameter_mm)]


def pressed(asked: Indentation, kept: Kept) -> Course:
    """Return a course, computed once for all studies of a report."""
    course: Course = kept.made(press, asked)
    return course


class Contacts(NamedTuple):
    """The contacts of a table. A condition that its course did not reach is left out, never filled in."""

    courses: dict[_Way, Course]
    conditions: list[Condition]
    left_out: list[Condition]

    @property
    def range_kpa(self) -> float:
        """The largest pressure on any taxel on any course: Table 5.3's range."""
        return max(round(SamplingGrid().most_kpa(course), 4) for course in self.courses.values())


def contacts(p: Mapping[str, Any], kept: Kept) -> Contacts:
    """Return the contacts of a study's table."""
    courses = {way: pressed(asked, kept) for way, asked in courses_of(p).items()}
    reached: dict[bool, list[Condition]] = {True: [], False: []}
    for one in conditions(p):
        course = courses[_way(one)]
        reached[not course.fault or bool(course.path_mm[-1] >= one.depth_mm)].append(one)
    return Contacts(courses, reached[True], reached[False])


def _way(one: Condition | Indentation) -> _Way:
    return one.diameter_mm, one.modulus_kpa, one.angle_deg


def rasters(of: Contacts, encoder: FA1, *, samples: int, seed: int) -> NDArray[np.int8] | NDArray[np.int16]:
    """Return the spikes of each condition's samples, (conditions * samples, steps * taxels), by step."""
    grid = SamplingGrid()
    steps = grid.steps(encoder.period_ms)
    raster = np.zeros((len(of.conditions), samples, steps, grid.taxels), np.int8 if encoder.bits < 8 else np.int16)
    t = np.round(np.arange(steps + 1) * encoder.period_ms * 1000).astype(np.int64)
    for k, c in enumerate(of.conditions):
        drawn = seed * len(of.conditions) + k
        values = grid.draw(of.courses[_way(c)], c.depth_mm, encoder.period_ms, samples, seed=drawn)
        spikes = encoder.encode(Frames(values.transpose(1, 0, 2), t, unit="kPa"))
        assert spikes.values is not None  # FA-1's spikes have signs
        train = np.repeat(np.arange(len(spikes)), np.diff(spikes.offsets))
        step = np.round(spikes.times / encoder.period_ms).astype(np.int64) - 1
        raster[k, train // grid.taxels, step, train % grid.taxels] = spikes.values
    return raster.reshape(len(of.conditions) * samples, -1)


def sampled(of: Contacts, encoder: FA1, p: Mapping[str, Any]) -> tuple[NDArray[Any], FoldSums]:
    """Return the rasters of a study's samples, and their sums by condition and by one of ten folds."""
    x = rasters(of, encoder, samples=p["samples"], seed=p["seed"])
    y = np.repeat(np.arange(len(of.conditions)), p["samples"])
    return x, FoldSums(x, y, folds(y, count=10, seed=p["seed"]))


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
