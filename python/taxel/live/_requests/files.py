"""Requests about the recordings of the panel's folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.array import Array
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening, ReadFrames, ShownFiles
from taxel.recording.analysis.health import TaxelStatistics, Touches, judge
from taxel.recording.convert import convert
from taxel.recording.cut import cut

#: Taxels as (column, row).
_Taxels = list[tuple[int, int]]


class FileRequests:
    """List, read and cut recordings, and judge their taxels.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    files : ShownFiles
        Reads them.
    """

    def __init__(self, opening: Opening, files: ShownFiles) -> None:
        self._opening, self._files = opening, files

    def health(
        self,
        array: _core._Array,
        events: NDArray[np.uint32],
        moved: NDArray[np.uint32],
        touches: tuple[NDArray[np.uint32], NDArray[np.uint32]],
        values: tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.int32]] | None,
    ) -> tuple[_Taxels, _Taxels, _Taxels, int]:
        """Return the taxels that are dead, stuck and noisy, and how many were not touched enough to say.

        Parameters
        ----------
        array : the sensor
        events, moved : shape (taxels,)
            Events of each taxel, and those in the direction of the one before.
        touches : two arrays
            Indices of taxels, and five counts of touches of each, as the core gives them.
        values : three arrays of shape (taxels,), or None without intensities
            Number of different values; least and greatest held value, -1 where unknown.
        """
        sensor = Array._from_parts(array)
        activity, repeated, *known = (
            np.asarray(column, np.int64).reshape(sensor.shape) for column in (events, moved, *(values or ()))
        )
        result = judge(sensor, TaxelStatistics(activity, repeated, Touches.from_counts(*touches), *known))
        taxels = result.named()
        return taxels["dead"], taxels["stuck"], taxels["noisy"], int(np.count_nonzero(result.untested))

    def recordings(self, folder: Path) -> list[str]:
        """Return the names of what is a recording in a folder."""
        with reasons():
            return [file.name for file in folder.iterdir() if self._opening.is_recording(file)]

    def read(self, path: Path, trial: str | None, entire: bool) -> tuple[Path | None, ReadFrames | None]:
        """Read a recording that is no file of a board's events.

        Parameters
        ----------
        path : path
        trial : str or None
            Of a file with several; default: the first.
        entire : bool
            Whether all of a large text table is read, not only its beginning.

        Returns
        -------
        path or None
            Of events, a .mcap that holds them, until the panel ends.
        tuple or None
            Frames, as the compiled part reads them.
        """
        with reasons():
            return self._files.read(path, trial, entire=entire)

    def health_of_frames(self, path: Path, trial: str | None) -> tuple[_Taxels, _Taxels, _Taxels, int]:
        """Return the taxels of a recording of frames that are dead, stuck, noisy, and how many cannot be judged."""
        with reasons():
            return self._files.health(path, trial)

    def cut(self, path: Path, trial: str | None, out: Path, start_us: int, stop_us: int) -> list[str]:
        """Write a stretch of a recording to a new file; return what that file cannot hold."""
        with reasons():
            recording, _ = self._files.opened(path, trial)
            (part,) = cut(recording, start_us=start_us, stop_us=stop_us)
            return list(convert(part, out))
