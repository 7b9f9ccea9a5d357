"""The folder of recordings: which there are, and those that were opened, indexed."""

from __future__ import annotations

import asyncio
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taxel import _core
from taxel._base.errors import refused
from taxel._base.files import write_whole
from taxel._core import ProblemError
from taxel.formats.layout import Layout, of_layout
from taxel.formats.roles import Changes
from taxel.live.lines import first_lines
from taxel.panel.look import Looks, layout_beside, picture
from taxel.panel.shown_files import FileState, Opening, ShownFiles, state_of
from taxel.panel.threads import in_thread
from taxel.recording.kinds import takes_layout

#: Recordings and readouts in a list.
_MOST_LISTED = 1000

#: A name that leads nowhere out of the folder.
_NAME = re.compile(r"(?!\.)[\w ._-]{1,110}")

#: How a file of a readout or a plain rule begins.
_READOUT = re.compile(rb'"format": "taxel (?:readout|plain rule)"')


@dataclass(eq=False)
class Shown:
    """Hold a recording as it is shown.

    Parameters
    ----------
    name, path : str, Path
    asked : str or None
        The trial that was asked for.
    trial : str
        The trial that it is, where the file has several; else "".
    recording : PanelRecording
    contents : dict
        What the message `opened` says of it.
    state : FileState
        That of the file when it was read.
    """

    name: str
    path: Path
    asked: str | None
    trial: str
    recording: _core.PanelRecording
    contents: dict[str, Any]
    state: FileState

    @property
    def us(self) -> int:
        """How long one us of the file is in the view: above 1 where frames are numbered."""
        return self.recording.times()[2]

    @property
    def begin_us(self) -> int:
        """The first time in the view, us."""
        range_us = self.recording.times()[0]
        return 0 if range_us is None else range_us[0]

    def check_label(self, t_us: int) -> None:
        """Refuse a time of a label outside the recording."""
        range_us, late_us, us = self.recording.times()
        if range_us is None:
            return
        for beyond, end in ((range_us[0] - t_us, "before the beginning"), (t_us - range_us[1], "after the end")):
            if beyond > late_us:
                far = f"{beyond / 1e6:.3f} s" if us == 1 else f"{beyond // us} frames"
                raise refused("t_us", f": a label is {far} {end} of {self.name}: must be within the recording")


class Folder:
    """List and index the recordings of a folder.

    Parameters
    ----------
    path : Path
    opening : Opening
        How recordings are opened.
    records : function
        Whether a recording runs.
    """

    def __init__(self, path: Path, opening: Opening, records: Callable[[], bool]) -> None:
        self.path = path
        self.files, self.looks = ShownFiles(opening, records), Looks()
        self._opening = opening
        self._locks: dict[Path, asyncio.Lock] = {}
        #: The recordings that were opened last, by path and the trial that was asked for.
        self._open: dict[tuple[Path, str | None], Shown] = {}

    def file(self, name: str) -> Path:
        """Return the path of a file of the folder, which need not exist; a ProblemError refuses other names."""
        if not _NAME.fullmatch(name):
            raise refused(
                "name",
                f" {name[:40]!r}: must be 1 to 100 letters, digits, spaces, '.', '_' or '-', not beginning with '.'",
            )
        return self.path / name

    def listed(self) -> tuple[list[tuple[str, int, int]], list[str]]:
        """Return name, size (bytes) and time of the last change (ns since 1970) of each recording, and the readouts."""
        files, readouts = [], []
        for file in self.path.iterdir():
            # A pipe is a source of lines, of which nobody else may read.
            if not _NAME.fullmatch(file.name) or not (file.is_file() or file.is_dir()):
                continue
            try:
                if self._opening.is_recording(file):
                    files.append((file.name, state_of(file).size, file.stat().st_mtime_ns))
                elif file.suffix == ".json" and _begins_as_readout(file):
                    readouts.append(file.name)
            except OSError:
                # It is gone, or may not be read.
                continue
        files.sort(key=lambda file: -file[2])
        return files[:_MOST_LISTED], sorted(readouts)[:_MOST_LISTED]

    def look(self, name: str, text: str | None, changes: Changes) -> tuple[dict[str, Any], Layout | None]:
        """Return what a file is by a layout as text, or by its own, that is changed: as `Looks.look`."""
        path, layout = self.looks.heard(name) or (self.file(name), None)
        self.files.check(path)
        layout = layout or self._opening.layout_of(path)
        return self.looks.look(path, layout if text is None else Layout.of_text(layout.path, text), changes, name)

    def seen(self, name: str, layout: Layout) -> dict[str, Any]:
        """Return the picture of a file by its whole layout."""
        heard = self.looks.heard(name)
        return picture(self.file(name) if heard is None else heard[0], layout, name)

    def hear(self, place: str, baud: int, most_s: float) -> str:
        """Read the first lines of a place that a person types; return it as a source.

        A place is a serial port or server, a file of the folder, a pipe, or KIND:PLACE of lines.

        Raises
        ------
        OSError : it cannot be opened
        ProblemError : a file elsewhere, or no lines of numbers
        """
        kind, _, where = place.partition(":")
        file = self.path / (where if kind == "lines" else place)
        source = place if kind in ("lines+tcp", "lines+udp") else f"serial:{place},baud={baud}"
        if kind == "lines" or file.is_file() or file.is_fifo():
            if not file.is_fifo() and self.path.resolve() not in file.resolve().parents:
                raise refused("place", f" is {place}: must be a file of the folder, a pipe, a port, or HOST:PORT")
            source = f"lines:{file}"
        self.looks.hear(source, first_lines(source, most_s))
        return source

    def lay(self, name: str, text: str, *, folder: bool, replace: bool) -> None:
        """Write a layout file beside a recording, or for all recordings of its folder.

        Raises
        ------
        FormatError : no layout
        ProblemError : no file that a layout describes; the layout file is there; another is read instead
        OSError : it cannot be written
        """
        path = self.file(name)
        out, own = (layout_beside(path, folder=each) for each in (folder, False))
        if not takes_layout(path):
            raise ProblemError(f"{name}: states its sensor itself, so it needs no layout")
        read = self._opening.options_of(path).layout or (own if folder and own.exists() else None)
        if read is not None:
            raise ProblemError(f"{out.name} would not be read, as {name} is read by {Path(read).name}")
        if os.path.lexists(out) and not replace:
            raise refused("replace", f": {out.name} exists already")
        written = of_layout(Layout.of_text(out, text)).encode()
        write_whole(out, lambda file: file.write(written), overwrite=replace)

    async def open(self, name: str, trial: str | None) -> Shown:
        """Return a recording, indexed once however many clients show it.

        Raises
        ------
        ProblemError, FormatError : no recording, or no such trial
        OSError : it cannot be read
        """
        path = self.file(name)
        async with self._locks.setdefault(path, asyncio.Lock()):
            known = self._open.get((path, trial))
            if known is not None and known.state == state_of(path):
                return known
            shown = await in_thread(self._index, name, path, trial)
            self._open = dict([*self._open.items()][-3:]) | {(path, trial): shown}
            return shown

    def _index(self, name: str, path: Path, trial: str | None) -> Shown:
        state = state_of(path)
        recording, contents = self.files.read(path, trial)
        of_frames = contents["frames"] or {}
        return Shown(name, path, trial, of_frames.get("trial") or "", recording, contents, state)


def _begins_as_readout(file: Path) -> bool:
    with open(file, "rb") as opened:
        return _READOUT.search(opened.read(256)) is not None
