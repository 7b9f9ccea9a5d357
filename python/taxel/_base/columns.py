"""Columns of the data classes: read-only arrays, which can be shared without a copy, and how files fill them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import column, numbers
from taxel._base.limits import check_memory


class FrozenColumns:
    """Keep arrays read-only after a copy or unpickling, which make NumPy's arrays writable."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        for value in state.values():
            if isinstance(value, np.ndarray):
                frozen(value)
        self.__dict__.update(state)


class Growing:
    """Collect the columns of a file whose number of rows is not known before it is read; each row is in memory once.

    Parameters
    ----------
    place : str
        The file, for errors.
    **columns : (tuple of int, dtype)
        The shape of a row, and its dtype, by the name of a column.
    """

    def __init__(self, location: str, **columns: tuple[tuple[int, ...], type[Any]]) -> None:
        self._location, self._columns = location, columns
        self._row = sum(math.prod(shape) * np.dtype(kind).itemsize for shape, kind in columns.values())
        self._blocks: dict[str, list[NDArray[Any]]] = {name: [] for name in columns}
        # How many rows there are, how many the blocks hold, and how many the last of them.
        self._rows = self._room = self._last = 0

    def __len__(self) -> int:
        return self._rows

    def add(self, **rows: ArrayLike) -> None:
        """Add as many rows to each column.

        Raises
        ------
        FormatError : more than the memory that is available
        """
        parts = {name: np.asarray(part) for name, part in rows.items()}
        (count,) = {len(part) for part in parts.values()}
        check_memory(self._location, (self._rows + count) * self._row)
        begin = 0
        while begin < count:
            if self._rows == self._room:
                self._last = self._next_block()
                self._room += self._last
            free = self._room - self._rows
            part = slice(begin, min(count, begin + free))
            for name, values in parts.items():
                at = self._last - free
                self._blocks[name][-1][at : at + part.stop - part.start] = values[part]
            self._rows += part.stop - part.start
            begin = part.stop

    def _next_block(self) -> int:
        """Begin blocks of twice as many rows; those of more than 64 MiB would keep too much of the memory twice."""
        rows = min(max(1, 2 * self._last, _FIRST_BYTES // self._row), max(1, _BLOCK_BYTES // self._row))
        for name, (shape, kind) in self._columns.items():
            self._blocks[name].append(np.empty((rows, *shape), kind))
        return rows

    def column(self, name: str) -> NDArray[Any]:
        """Return a column, read-only; its blocks are gone then, so that each can be taken once."""
        shape, kind = self._columns[name]
        values, at, blocks = np.empty((self._rows, *shape), kind), 0, self._blocks.pop(name)
        blocks.reverse()
        while blocks:
            block = blocks.pop()[: self._rows - at]
            values[at : at + len(block)] = block
            at += len(block)
        return frozen(values)


#: Bytes of the first block of rows, and of the largest: the system takes memory of more than 32 MiB back at once.
_FIRST_BYTES, _BLOCK_BYTES = 1 << 12, 1 << 26


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


def frozen_column(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """Return a read-only column (see `column`), copied if it shares memory with a caller's writable array."""
    return frozen_copy(column(name, values, dtype, unit), values)


def frozen_numbers(name: str, values: ArrayLike, dtype: type[Any], unit: str | None = None) -> NDArray[Any]:
    """Return a read-only array of any shape (see `numbers`), copied as by `frozen_column`."""
    return frozen_copy(numbers(name, values, dtype, unit), values)


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
