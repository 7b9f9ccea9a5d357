"""Files of event cameras, written and read by hand from the makers' descriptions, to hold faery's reading against."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

#: (t us, x, y, p) of each event.
Rows = NDArray[np.int64]

HEADS = {
    "evt2": "% evt 2.0\n% format EVT2;height={1};width={0}\n% geometry {0}x{1}\n% end\n",
    "evt3": "% evt 3.0\n% format EVT3;height={1};width={0}\n% geometry {0}x{1}\n% end\n",
    "dat": "% Data file containing CD events.\n% Version 2\n% Width {0}\n% Height {1}\n",
}


def some_rows(count: int = 400, size: tuple[int, int] = (64, 48), seed: int = 5) -> Rows:
    """Make events in order of time, some of which come at once in a row."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 100 * count, count))
    t[1::5] = t[::5][: len(t[1::5])]
    rows = np.stack([t, rng.integers(0, size[0], count), rng.integers(0, size[1], count), rng.integers(0, 2, count)], 1)
    return rows[np.argsort(rows[:, 0], kind="stable")]


def evt2(rows: Rows) -> bytes:
    """EVT 2.0: words of 32 bits; the type in the upper four, then six bits of time, column and row."""
    words, high = [], -1
    for t, x, y, p in rows.tolist():
        if t >> 6 != high:
            high = t >> 6
            words.append(0x8 << 28 | high)
        words.append(p << 28 | (t & 63) << 22 | x << 11 | y)
    return np.array(words, "<u4").tobytes()


def evt3(rows: Rows) -> bytes:
    """EVT 3.0: words of 16 bits, of which each changes time, row or column; neighbours at once are a vector of 12."""
    words: list[int] = []
    time, row, k, every = (-1, -1), -1, 0, rows.tolist()
    while k < len(every):
        t, x, y, p = every[k]
        if t >> 12 != time[0]:
            words.append(0x8000 | (t >> 12) & 0xFFF)
        if (t >> 12, t & 0xFFF) != time:
            words.append(0x6000 | t & 0xFFF)
        time = (t >> 12, t & 0xFFF)
        if y != row:
            words.append(y)
            row = y
        along = [k]
        while along[-1] + 1 < len(every) and every[along[-1] + 1] == [t, x + len(along), y, p] and len(along) < 12:
            along.append(along[-1] + 1)
        if len(along) == 1:
            words.append(0x2000 | p << 11 | x)
        else:
            words += [0x3000 | p << 11 | x, 0x4000 | (1 << len(along)) - 1]
        k += len(along)
    return np.array(words, "<u2").tobytes()


def dat(rows: Rows) -> bytes:
    """DAT: two bytes say the type and the size of events; each is 32 bits of time, then 14 of column, 14 of row, p."""
    t, x, y, p = rows.T
    return b"\x0c\x08" + np.stack([t, p << 28 | y << 14 | x], 1).astype("<u4").tobytes()


ENCODED = {"evt2": evt2, "evt3": evt3, "dat": dat}


def write(path: Path, rows: Rows, kind: str = "evt3", size: tuple[int, int] = (64, 48)) -> Path:
    """Write a file of a kind."""
    path.write_bytes(HEADS[kind].format(*size).encode() + ENCODED[kind](rows))
    return path


def rows_of_dat(path: Path) -> Rows:
    """Read a .dat by NumPy alone."""
    data = path.read_bytes()
    t, place = np.frombuffer(data[data.index(b"\x0c\x08") + 2 :], "<u4").reshape(-1, 2).astype(np.int64).T
    return np.stack([t, place & 0x3FFF, place >> 14 & 0x3FFF, place >> 28], 1)


def rows_of_evt2(path: Path) -> Rows:
    """Read EVT 2.0 by NumPy alone."""
    data = path.read_bytes()
    words = np.frombuffer(data[data.index(b"% end\n") + 6 :], "<u4").astype(np.int64)
    kind = words >> 28
    highs = np.where(kind == 8, words & 0xFFFFFFF, 0)
    latest = np.maximum.accumulate(np.where(kind == 8, np.arange(len(words)), 0))
    events = kind < 2
    t = highs[latest] << 6 | words >> 22 & 63
    return np.stack([t, words >> 11 & 0x7FF, words & 0x7FF, kind], 1)[events]


def rows_of_evt3(path: Path) -> Rows:
    """Read EVT 3.0 word after word."""
    data = path.read_bytes()
    high = low = x = y = p = 0
    rows = []
    for (word,) in struct.iter_unpack("<H", data[data.index(b"% end\n") + 6 :]):
        kind, rest = word >> 12, word & 0xFFF
        if kind == 0x8:
            high, low = rest, 0
        elif kind == 0x6:
            low = rest
        elif kind == 0x0:
            y = rest & 0x7FF
        elif kind in (0x2, 0x3):
            x, p = rest & 0x7FF, rest >> 11
            rows += [(high << 12 | low, x, y, p)] * (kind == 0x2)
        elif kind == 0x4:
            rows += [(high << 12 | low, x + k, y, p) for k in range(12) if rest >> k & 1]
            x += 12
    return np.array(rows, np.int64)


READ = {"evt2": rows_of_evt2, "evt3": rows_of_evt3, "dat": rows_of_dat}
