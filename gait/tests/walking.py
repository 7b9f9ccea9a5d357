"""A walk with known times: each stance is a trapezium in time, on eight sensors a foot, as in gaitpdb's files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

#: Stride and stance of each foot, s; the right foot is half a stride later, so double support is 0.1 s, twice.
STRIDE, STANCE, STEP = 1.0, 0.6, 0.5
TOP_N = 800.0
#: A load rises and falls in this time, s.
RAMP = 0.05

SHARED = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[3] / "shared" / "data"))


def published(name):
    """Return the folder of a published data set; a test is skipped where it is not there."""
    if not (SHARED / name).is_dir():
        pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
    return SHARED / name


def trapezium(t, contact, lift, top=TOP_N):
    """The load of a stance: from 0 at contact and lift to its top."""
    return top * np.clip(np.minimum((t - contact) / RAMP, (lift - t) / RAMP), 0, 1)


def contacts(first, count, stride=STRIDE):
    return first + stride * np.arange(count)


def load(t, starts, stance=STANCE, top=TOP_N):
    return sum((trapezium(t, start, start + stance, top) for start in starts), np.zeros_like(t))


def two_feet(seconds=40.0, rate=100.0, left=None, right=None):
    """Times and the loads of both feet of a steady walk, or of given contacts."""
    t = np.arange(int(seconds * rate)) / rate
    n = int(seconds)
    left = contacts(0.5, n - 1) if left is None else left
    right = contacts(0.5 + STEP, n - 1) if right is None else right
    return t, load(t, left), load(t, right)


def write(path: Path, t, left, right) -> Path:
    """Write a file as of gaitpdb: time, eight sensors of each foot, both totals."""
    shares = np.array([0.2, 0.1, 0.1, 0.1, 0.1, 0.15, 0.15, 0.1])
    columns = [t, *(left * share for share in shares), *(right * share for share in shares), left, right]
    np.savetxt(path, np.stack(columns, 1), "%.4f", "\t")
    return path
