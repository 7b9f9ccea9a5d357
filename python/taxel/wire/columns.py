"""The memory into which a decoder writes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taxel import _core
from taxel._base.columns import frozen
from taxel.array import Array
from taxel.events import Events

#: From this number of rows on, NumPy requests large pages (from 4 MB on) for the narrowest column too. The page fault
#: at the first write to each small page costs more than the write itself.
_LARGE = 1 << 22


def filled(array: Array, rows: int, fill: Callable[[tuple[Any, ...]], _core._Filled]) -> Events:
    """Return the events that `fill` writes into new columns with room for a number of rows."""
    room = max(rows, _LARGE) if rows >= _LARGE // 4 else rows
    t = np.empty(room, np.int64)
    x, y, ticks = np.empty(room, np.uint16), np.empty(room, np.uint16), np.empty(room, np.uint16)
    p, present = np.empty(room, np.bool_), np.empty(room, np.bool_)
    written = fill((t, x, y, ticks, p.view(np.uint8), present.view(np.uint8)))
    for column in (t, x, y, ticks, p, present):
        # What was not written is freed.
        column.resize(written["rows"], refcheck=False)
        frozen(column)
    intensity, stated = (ticks, present) if written["paired"] else (None, None)
    return Events._unchecked(t, x, y, p, array, intensity, stated, written["repaired"], tuple(written["markers"]))
