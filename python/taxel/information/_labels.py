"""Labels and groups, one per trial: texts or whole numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import shown
from taxel._base.errors import refused

#: Labels that one call of NumPy sorts or looks up (30 ms for texts): Ctrl-C is answered between calls.
_AT_ONCE = 1 << 17

__all__ = ["belonging", "distinct", "labelled", "numbered", "one_label_a_group", "words"]


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


def distinct(column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return each label of a column once, in ascending order."""
    parts = [np.unique(column[first : first + _AT_ONCE]) for first in range(0, len(column), _AT_ONCE)]
    return np.unique(np.concatenate(parts)) if len(parts) > 1 else np.unique(column)


def numbered(classes: NDArray[np.generic], column: NDArray[np.generic]) -> NDArray[np.int64]:
    """Return the place of each label among the classes, which are in ascending order and hold all of them."""
    flat, ranks = column.ravel(), np.empty(column.shape, np.int64)
    for first in range(0, len(flat), _AT_ONCE):
        piece = slice(first, first + _AT_ONCE)
        ranks.ravel()[piece] = np.searchsorted(classes, flat[piece])
    return ranks


def belonging(groups: ArrayLike, trials: int) -> NDArray[np.int64]:
    """Return the number of each trial's group."""
    names = words("groups", groups)
    if len(names) != trials:
        raise refused("groups", f" has {len(names)} entries: must be {trials}, one per trial")
    return numbered(distinct(names), names)


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
