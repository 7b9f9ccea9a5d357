"""The memory into which a decoder writes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.columns import frozen_whole
from taxel.array import Array
from taxel.events import Events

#: From this number of rows on, NumPy requests large pages (from 4 MB on) for the narrowest column too. The page fault
#: at the first write to each small page costs more than the write itself.
_LARGE = 1 << 22

#: Below this number of rows, columns are parts of one memory, which is freed as large as it was allocated: the C
#: library then keeps it for the next piece of a stream. Columns that shrink to what was written return to the system.
_PIECE = _LARGE // 4

#: Parts of which less than this share was written are copied, so that few events do not hold much memory.
_LEAST_WRITTEN = 1 / 8


class Columns(NamedTuple):
    """The columns of events that a decoder fills."""

    t: NDArray[Any]
    x: NDArray[Any]
    y: NDArray[Any]
    ticks: NDArray[Any]
    p: NDArray[Any]
    present: NDArray[Any]


def filled(array: Array, rows: int, fill: Callable[[Columns], _core._Filled]) -> Events:
    """Return the events that `fill` writes into new columns with room for a number of rows."""
    columns = _parts(rows) if rows < _PIECE else _columns(max(rows, _LARGE))
    written = fill(columns._replace(p=columns.p.view(np.uint8), present=columns.present.view(np.uint8)))
    n = written["rows"]
    if rows >= _PIECE:
        for column in columns:
            column.resize(n, refcheck=False)
    elif n < _LEAST_WRITTEN * rows:
        columns = Columns(*(column[:n].copy() for column in columns))
    t, x, y, ticks, p, present = (frozen_whole(column[:n]) for column in columns)
    intensity, stated = (ticks, present) if written["paired"] else (None, None)
    states = {"intensity": intensity, "present": stated, "repaired": written["repaired"]}
    return Events._unchecked(array, written["markers"], t=t, x=x, y=y, p=p, **states)


def _columns(rows: int) -> Columns:
    """Return columns with a memory each."""
    dtypes: tuple[Any, ...] = (np.int64, np.uint16, np.uint16, np.uint16, np.bool_, np.bool_)
    return Columns(*(np.empty(rows, dtype) for dtype in dtypes))


def _parts(rows: int) -> Columns:
    """Return columns in one memory, the widest first."""
    memory = np.empty(16 * rows, np.uint8)
    t = memory[: 8 * rows].view(np.int64)
    x, y, ticks = (memory[k * rows : (k + 2) * rows].view(np.uint16) for k in (8, 10, 12))
    p, present = memory[14 * rows : 15 * rows].view(np.bool_), memory[15 * rows :].view(np.bool_)
    return Columns(t, x, y, ticks, p, present)
