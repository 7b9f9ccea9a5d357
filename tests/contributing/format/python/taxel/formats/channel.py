"""One force channel as text: a first line of names, then one line for each sample: time in us, force in N."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from taxel._base.columns import Growing
from taxel._core import FormatError, ProblemError
from taxel.formats import text
from taxel.formats.checks import files_at, whole_us
from taxel.formats.trial import Trial
from taxel.frames import Frames

__all__ = ["files", "trials"]


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.channel``."""
    found = sorted(path.glob("*.channel")) if path.is_dir() else [path]
    return [file for file in found if file.suffix == ".channel"]


def trials(path: str | Path) -> Iterator[Trial]:
    """Read one file, or all of a folder, one after the other.

    Raises
    ------
    FormatError : a file that does not hold what it should (names file and line)
    """
    for file in files_at(path, files, ".channel"):
        lines, read = text.stream(file), Growing(file.name, t=((), np.int64), force=((), np.float32))
        next(lines, "")  # the names
        for line, rows in text.blocks((row.split() for row in lines), file, 2, ["t_us", "force_n"]):
            read.add(t=whole_us(file.name, rows[:, 0] / 1e6, line), force=rows[:, 1])
        try:
            frames = Frames(read.column("force").reshape(-1, 1, 1), read.column("t"), unit="N")
        except ProblemError as error:
            raise FormatError(f"{file.name}: {error}") from None
        yield Trial(file.stem, file.stem, frames, {}, "none: the file has no truth")
