"""Grasps of an iCub hand, 60 taxels on five fingers, one object in each file (icub_grasp_dataset).

A file ``OBJECT.csv.gz`` (or ``.csv``) holds grasps, a time slice in each row: trial, slice, nine joint angles, the
largest value of each finger, and twelve taxels for each finger, thumb to little finger. The source has neither times
nor a rate.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from taxel._base.columns import Growing
from taxel._base.header_table import HeaderTable
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import candidates, files_at
from taxel.formats.trial import Trial
from taxel.frames import Frames

__all__ = ["FINGERS", "files", "trials"]

#: Rows of the array, twelve taxels each.
FINGERS = ("thumb", "index", "middle", "ring", "little")
_TAXELS = tuple(f"{finger}_{k}" for finger in FINGERS for k in range(1, 13))
_JOINTS = tuple(f"joint{k}" for k in range(7, 16))


def files(path: Path) -> list[Path]:
    """Find the files of this format: tables whose first line names trial, slice and the thumb's taxels."""
    return [f for f in candidates(path, "*.csv", "*.csv.gz") if f.name.endswith((".csv", ".csv.gz")) and _begins_so(f)]


def _begins_so(path: Path) -> bool:
    try:
        head = text.head(path)
    except (FormatError, OSError):
        return False
    return head.startswith("trial,slice,") and "thumb_1" in head


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the grasps of one object's file, or of all in a folder.

    Frames are 5 x 12 (fingers by rows), 255 less the raw value, so that they rise with pressure. As the file has no
    times, the time of a frame is the number of its slice in us: 0, 1, 2 ...

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Trial
        `about` names the object; `series` has the joints, degrees.

    Raises
    ------
    FormatError : a file that breaks the format (names file and line)
    """
    for file in files_at(path, files, "table of grasps (OBJECT.csv.gz)"):
        name = file.name.removesuffix(".gz").removesuffix(".csv")
        shapes = {"taxels": ((len(_TAXELS),), np.float32), "joints": ((len(_JOINTS),), np.float64)}
        grasps: dict[str, Growing] = {}
        for line, row in HeaderTable.stream(file.name, text.stream(file), ["trial", "slice", *_JOINTS, *_TAXELS]):
            if row["trial"] not in grasps:
                grasps[row["trial"]] = Growing(file.name, **shapes)
            grasp = grasps[row["trial"]]
            if text.number(row["slice"], file, line, "slice") != len(grasp):
                raise FormatError(f"{file.name}, line {line}: slice is {row['slice']}; must be {len(grasp)}")
            taxels, joints = (
                text.numbers([[row[n] for n in names]], file, line, names) for names in (_TAXELS, _JOINTS)
            )
            grasp.add(taxels=255.0 - taxels, joints=joints)
        for number, grasp in grasps.items():
            yield Trial(
                f"{name}/{number}",
                "",
                Frames(
                    grasp.column("taxels").reshape(len(grasp), len(FINGERS), -1),
                    np.arange(len(grasp)),
                    array=Array(len(FINGERS), 12, name="iCub hand"),
                ),
                {},
                "",
                series=dict(zip(_JOINTS, grasp.column("joints").T, strict=True)),
                about={"object": name},
                timed=False,
            )
