"""Labels and groups, one per trial: texts or whole numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import shown
from taxel._base.errors import refused

__all__ = ["belonging", "labelled", "one_label_a_group", "words"]


def words(name: str, values: ArrayLike) -> NDArray[np.generic]:
    """Return labels as a column of texts or whole numbers."""
    try:
        column = np.asarray(values)
    except (ValueError, TypeError):
        column = np.empty(0, object)
    if column.ndim == 1 and column.size == 0:
        return np.empty(0, np.int64)
    if column.ndim != 1 or column.dtype.kind not in "biuU":
        raise refused(name, f" is {shown(values)}: must be texts or whole numbers, one per trial")
    return column


def belonging(groups: ArrayLike, trials: int) -> NDArray[np.int64]:
    """Return the number of each trial's group."""
    names = words("groups", groups)
    if len(names) != trials:
        raise refused("groups", f" has {len(names)} entries: must be {trials}, one per trial")
    return np.asarray(np.unique(names, return_inverse=True)[1])


def one_label_a_group(row: NDArray[np.int64], groups: NDArray[np.int64]) -> bool:
    """Return whether all trials of a group have the same label."""
    first = np.unique(groups, return_index=True)[1]
    return bool((row[first][groups] == row).all())


def labelled(y: ArrayLike, trials: int) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """Return the classes and each trial's number among them.

    Raises
    ------
    ProblemError : another number of labels than trials, or one class
    """
    labels = words("y", y)
    if len(labels) != trials:
        raise refused("y", f" has {len(labels)} entries: must be {trials}, one per trial")
    classes, row = np.unique(labels, return_inverse=True)
    if len(classes) < 2:
        raise refused("y", f" has {len(classes)} class: must have at least two")
    return classes, row
