"""An event camera that looks at a skin from behind: `.raw` (EVT2, EVT3), `.dat` and `.aedat4`, by the library faery.

They are read as events, or, with a window, as frames of counts. No live camera is read.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from taxel.array import Array
from taxel.formats.checks import files_at
from taxel.formats.event_camera.counting import reduced
from taxel.formats.event_camera.headers import ENDINGS, is_dat
from taxel.formats.event_camera.reading import read
from taxel.formats.event_camera.reduction import Reduction, are_counts
from taxel.formats.trial import Trial

__all__ = ["ENDINGS", "Reduction", "are_counts", "files", "reduced", "trials"]


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.raw`` and ``.aedat4``, and those ``.dat`` that are not text."""
    found = sorted(path.iterdir()) if path.is_dir() else [path]
    named = (file for file in found if file.suffix.lower() in ENDINGS and file.is_file())
    return [file for file in named if file.suffix.lower() != ".dat" or is_dat(file)]


def trials(path: str | Path, reduction: Reduction | None = None, size: Array | None = None) -> Iterator[Trial]:
    """Read one file, or all of a folder, one after the other.

    Parameters
    ----------
    path : str or Path
    reduction : Reduction, optional
        Selection of the events; default: all, unchanged.
    size : Array, optional
        Rows and columns of a sensor whose header does not state them.

    Raises
    ------
    FormatError : a file that is damaged, has no header or no event, or is larger than the memory that is available
    ImportError : faery is not installed (``pip install 'taxel[events]'``)
    ProblemError : a region beyond the sensor
    """
    for file in files_at(path, files, f"{', '.join(ENDINGS)} of an event camera"):
        yield Trial(file.name, file.stem, read(file, reduction or Reduction(), size), {}, "")
