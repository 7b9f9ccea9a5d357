"""Columns of the data classes: read-only arrays, which can be shared without a copy, and how files fill them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import column, numbers


class FrozenColumns:
    """Base of data classes of columns: two are equal by their values, and a copy's columns are read-only too."""

    #: The attributes by which two are equal.
    _COMPARED: ClassVar[tuple[str, ...]]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        return all(_equal(getattr(self, name), getattr(other, name)) for name in self._COMPARED)

    __hash__ = None  # type: ignore[assignment]

    def _records(self, names: Iterable[str]) -> NDArray[np.void]:
        """Return a record for each row, with a field for each of these columns."""
        columns = {name: getattr(self, name) for name in names}
        rows = len(next(iter(columns.values())))
        records = np.empty(rows, [(name, column.dtype) for name, column in columns.items()])
        for name, values in columns.items():
            records[name] = values
        return records

    # A copy and unpickling make NumPy's arrays writable.
    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                frozen(value)
        self.__dict__.update(state)


def _equal(mine: object, other: object) -> bool:
    has_nan = isinstance(mine, np.ndarray) and mine.dtype.kind == "f"
    return np.array_equal(mine, other, equal_nan=has_nan)  # type: ignore[arg-type]


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Make one of our own arrays read-only and return it."""
    array.setflags(write=False)
    return array


def frozen_whole(array: NDArray[Any]) -> NDArray[Any]:
    """Make an array of ours read-only, with all that it is a view of, and return it: nothing else refers to that."""
    part: object = array
    while isinstance(part, np.ndarray):
        frozen(part)
        part = part.base
    return array


def frozen_column(name: str, values: ArrayLike, dtype: type[Any], unit: str = "") -> NDArray[Any]:
    """Return a read-only column (see `column`), copied if it shares memory with a caller's writable array."""
    return frozen_copy(column(name, values, dtype, unit), values)


def frozen_numbers(name: str, values: ArrayLike, dtype: type[Any]) -> NDArray[Any]:
    """Return a read-only array of any shape (see `numbers`), copied as by `frozen_column`."""
    return frozen_copy(numbers(name, values, dtype), values)


def frozen_copy(array: NDArray[Any], source: ArrayLike) -> NDArray[Any]:
    """Return an array made from `source`, read-only; copy it if it shares memory that the caller can change."""
    if isinstance(source, np.ndarray):
        shared = array is source or np.may_share_memory(array, source)
    else:
        shared = not isinstance(source, list | tuple)
    return frozen(array.copy() if shared and not _unchangeable(array) else array)


def _unchangeable(array: object) -> bool:
    """Return whether every array below a view is read-only, down to memory of NumPy or of the compiled part."""
    while isinstance(array, np.ndarray):
        if array.flags.writeable:
            return False
        array = array.base
    return array is None or isinstance(array, bytes) or type(array).__name__ == "PySliceContainer"
