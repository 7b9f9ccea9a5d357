"""Frames of people lying on a mat of 64 x 27 taxels, no movement (PoPu).

A file ``*.npz`` holds ``readings``, uint8, poses x snapshots x rows x columns, and ``pose``, the names of the poses:
left, prone, right or supine with a number and a variant (``supine3_1``), and the empty mat.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from taxel._base import arguments
from taxel._base.arrays import read_arrays, stored_names
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats.checks import candidates, files_at
from taxel.formats.trial import Trial
from taxel.frames import Frames

__all__ = ["files", "trials"]

_NAME = re.compile(r"([a-z]+)(\d*)(?:_(\d+))?")


def files(path: Path) -> list[Path]:
    """Find the files of this format: a .npz with ``readings`` and ``pose``."""
    return [f for f in candidates(path, "*.npz") if f.suffix == ".npz" and {"readings", "pose"} <= set(stored_names(f))]


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the poses of a file, or of all in a folder.

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Trial
        Its frames are snapshots of the same lying person; as the file has no times, the time of a frame is its
        number in us: 0, 1, 2 ... `about` has the posture, the pose (without its variant) and the variant.

    Raises
    ------
    FormatError : a file that breaks the format
    """
    for file in files_at(path, files, ".npz with readings and pose"):
        arrays = read_arrays(file, ("readings", "pose"))
        readings, names = arrays["readings"], arrays["pose"]
        if readings.ndim != 4 or readings.dtype.kind not in "ui" or names.shape != readings.shape[:1]:
            raise FormatError(
                f"{file.name}: readings must be poses x snapshots x rows x columns, with a name for each pose"
            )
        array = Array(readings.shape[2], readings.shape[3], name="bed mat")
        for name, frames in zip(names, readings, strict=True):
            match = _NAME.fullmatch(str(name))
            if match is None:
                raise FormatError(f"{file.name}: the pose {arguments.shown(str(name))} must have a name like supine3_1")
            yield Trial(
                str(name),
                "",
                Frames(frames, np.arange(len(frames)), array=array),
                {},
                "",
                about={"posture": match[1], "pose": f"{match[1]}{match[2]}", "variant": match[3] or ""},
                timed=False,
            )
