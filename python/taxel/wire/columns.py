"""The memory into which a decoder writes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance, integer
from taxel._base.columns import frozen
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.array import Array
from taxel.events import Events

#: From this number of rows on, NumPy requests large pages (from 4 MB on) for the narrowest column too. The page fault
#: at the first write to each small page costs more than the write itself.
_LARGE = 1 << 22


def _on_a_line(n: int, dtype: Any) -> NDArray[Any]:
    """Return memory for n values, aligned to a cache line, as the decoder writes whole cache lines fastest."""
    size = np.dtype(dtype).itemsize
    memory = np.empty(n + 64 // size, dtype)
    first = -memory.__array_interface__["data"][0] % 64 // size
    return memory[first : first + n]


class Columns:
    """Reuse memory for decoded events (`Decoder.push_into`, `decode`).

    New memory costs more than decoding: the first write to each page is a page fault.

    Parameters
    ----------
    rows : int, 1 or more
        Capacity in events; ``len(data) // 5 + 2`` is enough for `data`.

    Raises
    ------
    ProblemError : not a whole number, or below 1

    Examples
    --------
    >>> from taxel.wire import Decoder
    >>> columns, decoder = Columns(1000), Decoder()
    >>> decoder.push_into(columns, bytes.fromhex("c000050304 c000060304"))
    Events(1 event, 500 to 500 us, 64 x 64 taxels, no intensities)
    """

    def __init__(self, rows: int) -> None:
        self._lay_out(integer("rows", rows, 1, 2**48), _on_a_line)

    def _lay_out(self, n: int, memory: Callable[[int, Any], NDArray[Any]]) -> None:
        try:
            self.t: NDArray[np.int64] = memory(n, np.int64)
            self.x: NDArray[np.uint16] = memory(n, np.uint16)
            self.y: NDArray[np.uint16] = memory(n, np.uint16)
            self.intensity: NDArray[np.uint16] = memory(n, np.uint16)
            self.p: NDArray[np.bool_] = memory(n, np.bool_)
            self.present: NDArray[np.bool_] = memory(n, np.bool_)
        except MemoryError:
            raise refused("rows", f" is {n}: needs more memory than is available") from None

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"Columns(room for {counted(len(self), 'event')})"

    def _parts(self) -> tuple[Any, Any, Any, Any, Any, Any]:
        p, present = self.p.view(np.uint8), self.present.view(np.uint8)
        return self.t, self.x, self.y, self.intensity, p, present

    @classmethod
    def _fresh(cls, rows: int) -> Columns:
        """Return new columns for `rows` events, which are filled once and own their memory."""
        columns = cls.__new__(cls)
        columns._lay_out(max(rows, _LARGE) if rows >= _LARGE // 4 else rows, np.empty)
        return columns

    @classmethod
    def _or_fresh(cls, columns: Columns | None, rows: int) -> tuple[Columns, bool]:
        """Return the caller's columns, or new ones for this number of rows; and whether they are new."""
        return (cls._fresh(rows), True) if columns is None else (instance("columns", columns, cls), False)

    def _first(
        self,
        array: Array,
        rows: int,
        paired: bool,
        repaired: NDArray[np.bool_] | None,
        markers: Sequence[tuple[int, bool]],
    ) -> Events:
        """Return the first rows as events that are views of the columns."""
        ticks, present = (self.intensity[:rows], self.present[:rows]) if paired else (None, None)
        t, x, y, p = self.t[:rows], self.x[:rows], self.y[:rows], self.p[:rows]
        return Events._unchecked(t, x, y, p, array, ticks, present, repaired, tuple(markers))

    def _trim(self, rows: int) -> None:
        """Keep the first rows alone, read-only, for events that own the columns; unused memory is freed."""
        for filled in vars(self).values():
            filled.resize(rows, refcheck=False)
            frozen(filled)
