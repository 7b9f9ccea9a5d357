"""Files of event cameras, written by faery."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

#: (t us, x, y, p) of each event.
Rows = NDArray[np.int64]


def some_rows(count: int = 400, size: tuple[int, int] = (64, 48), seed: int = 5) -> Rows:
    """Make events in order of time, some of which come at once in a row."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 100 * count, count))
    t[1::5] = t[::5][: len(t[1::5])]
    rows = np.stack([t, rng.integers(0, size[0], count), rng.integers(0, size[1], count), rng.integers(0, 2, count)], 1)
    return rows[np.argsort(rows[:, 0], kind="stable")]


def write(path: Path, rows: Rows, size: tuple[int, int] = (64, 48), **how: object) -> Path:
    """Write a file of the kind that its ending says, and of a version."""
    faery = pytest.importorskip("faery")

    events = np.zeros(len(rows), faery.EVENTS_DTYPE)
    events["t"], events["x"], events["y"], events["on"] = rows.T
    faery.events_stream_from_array(events, size).to_file(path, **how)
    return path
