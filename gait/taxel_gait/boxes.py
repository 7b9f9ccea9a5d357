"""Footfalls of many people on one array, for a training: each is turned to its axis, and its box resized.

One readout holds many people where heel and toes, medial and lateral lie on the same cells. Sums are kept, but a cell
of a resized foot has no area: pressures are never measured on these arrays.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import taxel
from taxel import Array, Frames
from taxel.reading import after_zeros
from taxel_gait.prints import BOX, Placed, Print

__all__ = ["box_of", "write_box"]

#: Rows from the toes to the heel, and columns from the medial to the lateral side: of a box of 280 x 105 mm.
_ROWS, _COLUMNS = 15, 7
#: So long before and after a footfall nothing is loaded, s.
_BEFORE_S, _AFTER_S = 0.6, 0.3


def box_of(one: Print, placed: Placed) -> Frames:
    """Return a footfall on 15 x 7 cells: of its length and its width, from toes to heel and from medial to lateral.

    The value of each sensor goes to the cell that holds its middle, of one outside to the nearest.

    Parameters
    ----------
    one : Print
    placed : Placed
    """
    frames = one.frames
    x, y = placed.in_foot(np.stack([place.ravel() for place in frames.array.positions()], axis=1)).T
    row = np.clip(np.floor((1 - y / placed.length) * _ROWS), 0, _ROWS - 1).astype(int)
    column = np.clip(np.floor((x / placed.width + 0.5) * _COLUMNS), 0, _COLUMNS - 1).astype(int)
    there = one.picture.ravel() > 0
    sums = np.zeros((there.size, _ROWS * _COLUMNS))
    sums[np.flatnonzero(there), (row * _COLUMNS + column)[there]] = 1
    values = frames.values.reshape(len(frames), -1).astype(np.float64) @ sums
    step = int(np.median(np.diff(frames.t))) if len(frames) > 1 else 10_000
    after = max(1, round(_AFTER_S * 1e6 / step))
    t = np.concatenate([frames.t, frames.t[-1] + step * np.arange(1, after + 1)])
    values = np.concatenate([values, np.zeros((after, values.shape[1]))]).reshape(-1, _ROWS, _COLUMNS)
    array = Array(_ROWS, _COLUMNS, name=BOX)
    return after_zeros(Frames(values.astype(np.float32), t, unit=f"sum of {frames.unit}", array=array), _BEFORE_S)


def write_box(folder: Path, name: str, one: Print, placed: Placed) -> list[str]:
    """Write a footfall as ``NAME.npz``; return the rows of a table of labels of it: contact and foot_off.

    Parameters
    ----------
    folder : Path
    name : str
        Its slashes become hyphens.
    one : Print
    placed : Placed
    """
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name.replace('/', '-')}.npz"
    box = box_of(one, placed)
    taxel.convert(box, file, overwrite=True)
    after = box.t[int(np.flatnonzero(box.t == one.frames.t[-1])[0]) + 1]
    return [f"{file.stem},contact,{one.frames.t[0]}", f"{file.stem},foot_off,{after}"]
