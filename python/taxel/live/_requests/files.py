"""Requests about the recordings of the panel's folder."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.documents import read_text
from taxel._base.errors import refused
from taxel._base.files import beside, named, whole_file
from taxel.array import Array
from taxel.formats import layout_text
from taxel.formats.layout import Layout, layout_name
from taxel.formats.ros import is_bag, topics
from taxel.live._requests.reasons import reasons
from taxel.live._requests.typed import typed
from taxel.live._shown_files import Opening, ReadFrames, ShownFiles
from taxel.recording.analysis.health import judge
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
        greatest = np.zeros(sensor.shape) if values is None else values[2]
        activity, repeated, most = (
            np.asarray(column, np.int64).reshape(sensor.shape) for column in (events, moved, greatest)
        )
        result = judge(sensor, activity, repeated, touches, most > 0)
        taxels = result.named()
        return taxels["dead"], taxels["stuck"], taxels["noisy"], int(np.count_nonzero(result.untested))

    def recordings(self, folder: Path) -> list[str]:
        """Return the names of what is a recording in a folder."""
        with reasons():
            return [file.name for file in folder.iterdir() if self._opening.is_recording(file)]

    def read(self, path: Path, trial: str | None, entire: bool) -> tuple[Path | None, ReadFrames | None]:
        """Read a recording that is not a file of a board's events.

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

    def topics(self, path: Path) -> list[tuple[str, str, tuple[int, ...], int, str]]:
        """Return the fields with numbers of the topics of a ROS bag; none of any other file.

        Returns
        -------
        list of (str, str, tuple of int, int, str)
            Topic, field, shape, number of messages, and why it cannot be read ("" if it can).
        """
        with reasons():
            if not is_bag(path):
                return []
            options = self._opening.options_of(path)
            return [
                (each.topic, each.field, each.shape, each.messages, each.trouble) for each in topics(path, options.ros)
            ]

    def describe(
        self,
        path: Path,
        falls: bool | None,
        rate_hz: float | None,
        size: tuple[int, int] | None,
        topic: tuple[str, str] | None,
    ) -> None:
        """Write what is stated of a recording into the layout file beside it, which is made where there is none.

        Parameters
        ----------
        path : Path
        falls : bool, optional
            Whether values fall with pressure.
        rate_hz : float, Hz, optional
        size : (int, int), optional
            Rows and columns.
        topic : (str, str), optional
            Of a ROS bag, and its field ("" for none).

        Raises
        ------
        ProblemError : the command states it already
        """
        options = self._opening.options_of(path)
        stated = options.given()
        keys: dict[str, object] = {}
        if falls is not None:
            keys["falls"] = falls
        if rate_hz is not None:
            keys["rate_hz"] = rate_hz
        if size is not None:
            keys["rows"], keys["columns"] = size
        if topic is not None:
            keys["ros.topic"] = topic[0]
            keys |= {"ros.field": topic[1]} if topic[1] else {}
        for option, key in (("layout", ""), ("rate_hz", "rate_hz"), ("array", "rows"), ("topic", "ros.topic")):
            if option in stated and (key in keys or not key):
                raise refused(
                    option,
                    f" is {stated[option]} in the command taxel view: change it there, or start taxel view without it",
                )
        with reasons():
            # A layout of the whole folder stays as it is; this recording gets a copy with these keys.
            there = Layout.beside(path)
            target = beside(path, layout_name(named(path)))
            text = "" if there is None else read_text(there)
            written = layout_text.with_keys(target, text, keys)
            with whole_file(target, overwrite=True) as part:
                part.write_text(written, "utf-8", newline="\n")
        self._files.forget()

    def save_layout(self, source: str, out: Path) -> str:
        """Write the layout file of a source of lines, which must not exist; return the command that reads it live."""
        written = layout_text.of_source(source)
        with reasons(), whole_file(out) as part:
            part.write_text(written, "utf-8", newline="\n")
        return shlex.join(["taxel", "live", "--panel", "--source", typed(out)])
