"""A noun's columns: read-only arrays, which need not be copied to be read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import column, numbers

__all__ = ["Columns", "frozen", "own", "own_column", "own_numbers"]


class Columns:
    """Keep arrays read-only where they are copied or come out of a pickle, which NumPy does not."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                frozen(value)
        self.__dict__.update(state)


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array of our own, read-only from now on."""
    array.setflags(write=False)
    return array


def own_column(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """Return a noun's column (see `column`): read-only, and copied once where it lies in memory of the caller's."""
    return own(column(name, values, dtype, unit), values)


def own_numbers(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """As `own_column`, of any shape (see `numbers`)."""
    return own(numbers(name, values, dtype, unit), values)


def own(array: NDArray[Any], source: ArrayLike) -> NDArray[Any]:
    """Return an array made from `source`, read-only: a copy where it shares memory that the caller can still change."""
    if isinstance(source, np.ndarray):
        shared = array is source or np.may_share_memory(array, source)
    else:
        shared = not isinstance(source, list | tuple)
    return frozen(array.copy() if shared and not _unchangeable(array) else array)


def _unchangeable(array: object) -> bool:
    """Tell whether all that an array is a view of is read-only: of NumPy's own memory, or of the compiled part's."""
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return False
        array = array.base
    return array is None or isinstance(array, bytes) or type(array).__name__ == "PySliceContainer"
