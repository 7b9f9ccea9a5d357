"""Cuts an insole of 92 taxels out of a plate's footfall, placed as a shoe would place it.

The insole lies under the foot before the foot comes down, so it may know the size and toe-out of this person's foot
from other steps, and where the heel landed, but nothing that this footfall does later. Size and toe-out of other people
lose events (a second row of the study); a placement from later frames would look ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError
from taxel.array import Array
from taxel.frames import Frames
from taxel_studies.datasets import Trial

#: Taxels by row, heel to toe: 92 in the outline of an insole.
CELLS = (4, 5, 6, 6, 6, 6, 6, 6, 7, 7, 7, 7, 7, 6, 6)
TAXELS = sum(CELLS)
_FIRST = np.concatenate([[0], np.cumsum(CELLS)])
#: Taxels of the first five rows (the heel region of the plate's heel-off is its first 30 %), and of the last four.
HEEL = np.arange(_FIRST[5])
TOES = np.arange(_FIRST[11], TAXELS)


class Placement(NamedTuple):
    """Size and toe-out of a foot, or of an insole."""

    toe_out: float
    """From the direction of walking to the axis from heel to forefoot, radians."""
    back_mm: float
    """How far it reaches from its origin, along its own axis; and the same to the front, and across."""
    front_mm: float
    inner_mm: float
    outer_mm: float


def footprint(trial: Trial) -> tuple[NDArray[np.float64], Placement]:
    """Measure one footfall of the plate.

    Returns
    -------
    origin_mm : float64, shape (2,)
        Across and along the plate: the centroid of the sensors that the first loaded frame loads. Nothing later.
    foot : Placement

    Raises
    ------
    ProblemError : nothing is ever loaded
    """
    values = trial.frames.values
    loaded = np.flatnonzero(values.any(axis=(1, 2)))
    if not len(loaded):
        raise ProblemError(f"{trial.name}: never loaded, so there is no foot to place an insole under")
    across, along = _positions(trial)
    first = values[loaded[0]] > 0
    origin = np.array([across[first].mean(), along[first].mean()])
    peak = values.max(axis=0)
    rows = np.flatnonzero(peak.any(axis=1))
    low, n = int(rows[0]), int(rows[-1] - rows[0]) + 1
    row = np.arange(len(peak))[:, None]
    # Heel and forefoot: the parts of the length that carry load in every foot; the arch between may be empty.
    heel = np.where(row < low + 0.3 * n, peak, 0)
    fore = np.where((row >= low + 0.55 * n) & (row < low + 0.85 * n), peak, 0)
    if not (heel.any() and fore.any()):
        toe_out = 0.0
    else:
        (ax, ay), (bx, by) = (((across * w).sum() / w.sum(), (along * w).sum() / w.sum()) for w in (heel, fore))
        toe_out = float(np.arctan2(bx - ax, by - ay))
    u, v = _turned(across[peak > 0], along[peak > 0], origin, toe_out)
    half_row, half_column = 0.5 * float(trial.about["row_mm"]), 0.5 * float(trial.about["column_mm"])
    reach = (
        float(u.min()) - half_row,
        float(u.max()) + half_row,
        float(v.min()) - half_column,
        float(v.max()) + half_column,
    )
    return origin, Placement(toe_out, *reach)


def placement(others: Sequence[Placement]) -> Placement:
    """Return mean toe-out and median extents of other footfalls.

    Parameters
    ----------
    others : sequence of Placement
        As of `footprint`; never the footfall that is to be cut.

    Raises
    ------
    ProblemError : no other footfall
    """
    if not others:
        raise ProblemError("an insole's size comes from other footfalls of the person: there is none")
    toe_out, *extents = np.array(others).T
    return Placement(float(np.mean(toe_out)), *np.median(extents, axis=1).tolist())


def cut(trial: Trial, origin_mm: NDArray[np.float64], placed: Placement) -> Frames:
    """Return the footfall as the 92 taxels of an insole measure it.

    Parameters
    ----------
    trial : Trial
        Of the plate.
    origin_mm : float64, shape (2,)
        Of this footfall's first loaded frame, as of `footprint`.
    placed : Placement
        Size and toe-out, from other footfalls.

    Returns
    -------
    Frames
        One row of 92 channels, heel to toe. A taxel is the sum of the sensors whose centre lies in it; sensors outside
        go to the nearest taxel.
    """
    across, along = _positions(trial)
    u, v = _turned(across.ravel(), along.ravel(), origin_mm, placed.toe_out)
    length, width = placed.front_mm - placed.back_mm, placed.outer_mm - placed.inner_mm
    row = np.clip(np.floor((u - placed.back_mm) / (length / len(CELLS))).astype(int), 0, len(CELLS) - 1)
    cells = np.array(CELLS)[row]
    middle = 0.5 * (placed.inner_mm + placed.outer_mm)
    column = np.floor((v - middle) / (width / max(CELLS)) + 0.5 * cells).astype(int)
    taxel = _FIRST[row] + np.clip(column, 0, cells - 1)
    which = np.zeros((len(taxel), TAXELS), np.float32)
    which[np.arange(len(taxel)), taxel] = 1
    values = trial.frames.values.reshape(len(trial.frames), -1) @ which
    return Frames(values[:, None, :], trial.frames.t, unit=trial.frames.unit, array=Array(1, TAXELS, name="insole"))


def _positions(trial: Trial) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sensors' centres, mm: across the walk, along the walk."""
    rows, columns = trial.frames.array.shape
    along, across = np.mgrid[0:rows, 0:columns].astype(np.float64)
    return across * float(trial.about["column_mm"]), along * float(trial.about["row_mm"])


def _turned(
    across: NDArray[np.float64], along: NDArray[np.float64], origin_mm: NDArray[np.float64], angle: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions along the foot's axis and across it, from its origin."""
    x, y = across - origin_mm[0], along - origin_mm[1]
    return x * np.sin(angle) + y * np.cos(angle), x * np.cos(angle) - y * np.sin(angle)
