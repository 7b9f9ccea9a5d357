"""Footfalls of a pressure plate, laid over the array."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from taxel._core import ProblemError
from taxel.array import Array
from taxel.formats import plate
from taxel.formats.trial import Trial
from taxel.simulate import Act, FrameSequence, Silence

__all__ = ["NOTE", "footfalls"]

#: Of each person, how many footfalls are played.
_EACH = 2

#: How much of the array a footprint may fill; the peak as a share of the way from rest to the ramp's end.
_FILL_MM, _PEAK = 150.0, 0.8

NOTE = (
    f"Footfalls of a pressure plate, laid over the array and given to the same readout, which was not trained "
    f"on any; no goal. Guesses: the footprint is shrunk to {_FILL_MM:.0f} mm, the plate's pictures (500 a second) "
    f"are joined by straight lines, and a footfall's largest value is {_PEAK:.0%} of the way from rest to the "
    f"ramp's end. Truth is the plate's own: its last empty picture before and the first after, so it can be 2 ms early."
)


def footfalls(data: Path) -> list[Act]:
    """Return acts of the first two footfalls of each person in ``data/plate``, with silence between them.

    Raises
    ------
    ProblemError : there is no plate/ in `data`
    FormatError : a file that does not hold what it should
    """
    place = data / "plate"
    if not place.is_dir():
        raise ProblemError(f"{data}: holds no plate/, whose footfalls would be laid over the array")
    acts: list[Act] = [Silence(300.0)]
    for file in plate.files(place):
        for trial in islice(plate.trials(file), _EACH):
            acts += [FrameSequence(_shrunk(trial), float(plate.FRAME_US)), Silence(300.0)]
    return acts


def _shrunk(trial: Trial) -> NDArray[np.float32]:
    """Return a footfall's pictures on the array, an empty one before and after, as shares of the ramp."""
    values = trial.frames.values
    loaded = np.argwhere(values.max(axis=0) > 0)
    (top, left), (bottom, right) = loaded.min(axis=0), loaded.max(axis=0)
    size = np.array([(bottom - top + 1) * plate.ROW_MM, (right - left + 1) * plate.COLUMN_MM])
    scale = max(1.0, float(size.max()) / _FILL_MM)
    # Where each taxel lies on the plate, in its rows and columns; the footprint's middle on the array's.
    array = Array.thesis()
    away = (np.arange(array.rows) - (array.rows - 1) / 2) * array.row_mm * scale
    rows = (top + bottom) / 2 + away / plate.ROW_MM
    columns = (left + right) / 2 + away / plate.COLUMN_MM
    places = np.meshgrid(rows, columns, indexing="ij")
    pictures = np.zeros((len(values) + 2, *array.shape), np.float32)
    for k, picture in enumerate(values):
        pictures[k + 1] = map_coordinates(picture, places, order=1, mode="constant")
    return pictures * np.float32(_PEAK / pictures.max())
