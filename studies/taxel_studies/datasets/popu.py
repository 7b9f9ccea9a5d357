"""Frames of people lying on a mat of 64 x 27 taxels, no movement (PoPu).

A file ``*.npz`` holds ``readings``, uint8, poses x snapshots x rows x columns, and ``pose``, the names of the poses:
left, prone, right or supine with a number and a variant (``supine3_1``), and the empty mat.
"""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from taxel import Array, FormatError, Frames
from taxel.reading import InMemory
from taxel_studies.datasets import DAMAGE, Trial, readers

__all__ = ["knows", "read", "trials"]

_NAME = re.compile(r"([a-z]+)(\d*)(?:_(\d+))?")


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: a .npz with ``readings`` and ``pose``."""
    if path.suffix != ".npz" or not path.is_file():
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return {"readings.npy", "pose.npy"} <= set(archive.namelist())
    except DAMAGE:
        return False


def read(path: Path, _layout: Any = None) -> list[InMemory]:
    """Return a reader of each pose, for `taxel.open`."""
    return readers(path, "popu", trials(path))


def trials(path: Path) -> Iterator[Trial]:
    """Yield the poses of a file.

    Yields
    ------
    Trial
        Its frames are snapshots of the same lying person; as the file has no times, the time of a frame is its
        number in us: 0, 1, 2 ... `about` has the posture, the pose (without its variant) and the variant.

    Raises
    ------
    FormatError : a file that breaks the format
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            readings, names = stored["readings"], stored["pose"]
    except DAMAGE as error:
        raise FormatError(f"{path.name}: the .npz is damaged: {error}") from None
    if readings.ndim != 4 or names.shape != readings.shape[:1]:
        raise FormatError(
            f"{path.name}: readings must be poses x snapshots x rows x columns, with a name for each pose"
        )
    array = Array(readings.shape[2], readings.shape[3], name="bed mat")
    for name, frames in zip(names, readings, strict=True):
        match = _NAME.fullmatch(str(name))
        if match is None:
            raise FormatError(f"{path.name}: the pose {str(name)!r} must have a name like supine3_1")
        about = {"posture": match[1], "pose": f"{match[1]}{match[2]}", "variant": match[3] or ""}
        yield Trial(str(name), "", Frames(frames, np.arange(len(frames)), array=array), about=about, timed=False)
