"""Grasps of an iCub hand, 60 taxels on five fingers, one object in each file (icub_grasp_dataset).

A file ``OBJECT.csv.gz`` (or ``.csv``) holds grasps, a time slice in each row: trial, slice, nine joint angles, the
largest value of each finger, and twelve taxels for each finger, thumb to little finger. The source has neither times
nor a rate.
"""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from taxel import Array, FormatError, Frames
from taxel.reading import InMemory
from taxel_studies.datasets import DAMAGE, Trial, readers

__all__ = ["FINGERS", "knows", "read", "trials"]

#: Rows of the array, twelve taxels each.
FINGERS = ("thumb", "index", "middle", "ring", "little")
_TAXELS = [f"{finger}_{k}" for finger in FINGERS for k in range(1, 13)]
_JOINTS = [f"joint{k}" for k in range(7, 16)]


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: its first line names trial, slice and the thumb's taxels."""
    if not path.name.endswith((".csv", ".csv.gz")) or not path.is_file():
        return False
    try:
        with (gzip.open if path.suffix == ".gz" else open)(path, "rb") as file:
            head = file.readline(1 << 12)
    except DAMAGE:
        return False
    return head.startswith(b"trial,slice,") and b"thumb_1" in head


def read(path: Path, _layout: Any = None) -> list[InMemory]:
    """Return a reader of each grasp, for `taxel.open`."""
    return readers(path, "icub", trials(path))


def trials(path: Path) -> Iterator[Trial]:
    """Yield the grasps of one object's file.

    Frames are 5 x 12 (fingers by rows), 255 less the raw value, so that they rise with pressure. As the file has no
    times, the time of a frame is the number of its slice in us: 0, 1, 2 ...

    Yields
    ------
    Trial
        `about` names the object; `series` has the joints, degrees.

    Raises
    ------
    FormatError : a file that breaks the format, or slices that do not count from 0 (names the grasp)
    """
    import pandas as pd  # noqa: PLC0415  takes long

    name, array = path.name.removesuffix(".gz").removesuffix(".csv"), Array(len(FINGERS), 12, name="iCub hand")
    try:
        grasps = pd.read_csv(path, usecols=["trial", "slice", *_JOINTS, *_TAXELS]).groupby("trial", sort=False)
    except DAMAGE as error:
        raise FormatError(f"{path.name}: must be a table of grasps: {error}") from None
    for number, grasp in grasps:
        try:
            values = grasp[_TAXELS].to_numpy(np.float32)
        except ValueError as error:
            raise FormatError(f"{path.name}, trial {number}: {error}") from None
        if grasp["slice"].tolist() != list(range(len(grasp))) or not np.isfinite(values).all():
            raise FormatError(f"{path.name}, trial {number}: must have a number for each taxel, and slices 0, 1, 2 ...")
        yield Trial(
            f"{name}/{number}",
            "",
            Frames(255 - values.reshape(len(grasp), len(FINGERS), -1), np.arange(len(grasp)), array=array),
            series={joint: grasp[joint].to_numpy(np.float64) for joint in _JOINTS},
            about={"object": name},
            timed=False,
        )
