"""Readings of a board's comparators at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.array import Array
from taxel.board_check.received import Capture, decoded
from taxel.board_check.results import RestCheck
from taxel.wire import Registers


def lines_of(taxels: NDArray[np.bool_]) -> str:
    """Name the lines of which all taxels are meant, where not all lines are."""
    rows, columns = np.flatnonzero(taxels.all(axis=1)), np.flatnonzero(taxels.all(axis=0))
    named = []
    for name, lines, count in (("sense line", rows, taxels.shape[0]), ("driven line", columns, taxels.shape[1])):
        if 0 < len(lines) < count:
            named.append(f"{name}{'s' * (len(lines) > 1)} {', '.join(map(str, lines))}")
    return " and ".join(named)


def rest_of(capture: Capture, array: Array, registers: Registers, faults: int) -> RestCheck:
    """Work out what each taxel read: its values hold until the next one."""
    mean, noise = np.full(array.shape, np.nan), np.full(array.shape, np.nan)
    full = np.zeros(array.shape, bool)
    if capture.datagrams:
        values = decoded(capture, array)
        taxel = values.y.astype(np.int64) * array.columns + values.x
        order = np.lexsort((values.t, taxel))
        taxel, t, value = taxel[order], values.t[order], values.value[order].astype(np.float64)
        last = np.append(taxel[1:] != taxel[:-1], True) if len(taxel) else np.empty(0, bool)
        end = (t.max() if len(t) else 0) + registers.frame_us
        weight = np.where(last, end, np.append(t[1:], end)[: len(t)]) - t
        size = mean.size
        total = np.bincount(taxel, weight, size)
        seen = total > 0
        first = np.divide(np.bincount(taxel, weight * value, size), total, where=seen, out=np.full(size, np.nan))
        square = np.bincount(taxel, weight * (value - first[taxel]) ** 2, size)
        mean = first.reshape(array.shape)
        noise = np.sqrt(np.divide(square, total, where=seen, out=np.full(size, np.nan))).reshape(array.shape)
        full = mean >= registers.ramp
    return RestCheck(registers, faults, mean, noise, np.isnan(mean), full)
