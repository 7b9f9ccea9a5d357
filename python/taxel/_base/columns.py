"""A noun's columns: read-only arrays, which need not be copied to be read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import column, numbers

__all__ = ["Columns", "frozen", "kept", "kept_numbers", "own"]


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


def kept(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """Return a noun's column (see `column`): read-only, and copied once where it lies in memory of the caller's."""
    return own(column(name, values, dtype, unit), values)


def kept_numbers(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """As `kept`, of any shape (see `numbers`)."""
    return own(numbers(name, values, dtype, unit), values)


def own(array: NDArray[Any], given: ArrayLike) -> NDArray[Any]:
    """Return an array that was made of what a caller gave, or a copy where he could still change it; read-only."""
    if isinstance(given, np.ndarray):
        his = array is given or np.may_share_memory(array, given)
    else:
        his = not isinstance(given, list | tuple)
    return frozen(array.copy() if his and not _unchangeable(array) else array)


def _unchangeable(array: object) -> bool:
    """Tell whether all that an array is a view of is read-only: of NumPy's own memory, or of the compiled part's."""
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return False
        array = array.base
    return array is None or isinstance(array, bytes) or type(array).__name__ == "PySliceContainer"
