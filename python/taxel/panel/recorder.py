"""The recorder of the page: one recording at a time of the live source; it goes on without clients."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

from taxel import _core
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.live import Live
from taxel.panel.board import Board
from taxel.panel.folder import Folder
from taxel.panel.threads import in_thread

_T = TypeVar("_T")

#: How often progress is sent, and how long the board's stop marker is waited for, s.
_PROGRESS_S, _MARKER_S = 1.0, 0.1


class Host(Protocol):
    """Hold what is recorded, and tell the clients: the hub."""

    board: Board
    folder: Folder
    source: _core.PanelLive | None

    def needed_live(self) -> Live:
        """Return the live source; a ProblemError says that there is none."""

    def needed_source(self) -> _core.PanelLive:
        """Return the live source as the views see it; a ProblemError says that there is none."""

    async def say(self, message: dict[str, Any] | str) -> None:
        """Send a message to all clients."""

    async def warn(self, reason: object) -> None:
        """Tell all clients what went wrong."""

    async def recordings(self) -> dict[str, Any]:
        """Return the recordings of the folder."""

    async def on_board(self, work: Callable[[], _T]) -> _T:
        """Work on the board in a thread of its own."""


class Recorder:
    """Record as the page asks.

    Parameters
    ----------
    hub : Host
        Whose live source is recorded, and whose clients are told.
    """

    def __init__(self, hub: Host) -> None:
        self._hub = hub
        self._state, self._since = "idle", 0.0
        self._file: str | None = None
        self._label: str | None = None
        self._length_s: float | None = None
        self._last: dict[str, str] | None = None
        self._error: str | None = None
        self._stop = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a recording runs, or is being ended."""
        return self._state != "idle"

    @property
    def runs(self) -> bool:
        """Whether any recording of the live source runs, also one that the page did not begin."""
        return self.is_busy or (self._hub.source is not None and self._hub.source.is_recording())

    @property
    def file(self) -> str | None:
        """The file that is being recorded."""
        return self._file if self.is_busy else None

    def message(self) -> dict[str, Any]:
        """Return how far the recording is, sent on each change and once a second while it runs."""
        runs = self._state == "recording"
        return {
            "type": "recorder",
            "state": self._state,
            "file": self.file,
            "label": self._label,
            "seconds": time.monotonic() - self._since if runs else None,
            "length_s": self._length_s,
            "last": self._last,
            "error": self._error,
        }

    async def begin(self, name: str, label: str | None, length_s: float | None) -> None:
        """Begin a recording, which ends by itself after `length_s`.

        Raises
        ------
        ProblemError : a recording runs; there is no live source; the file exists
        OSError : it cannot be written
        """
        if self.runs:
            raise ProblemError("a recording runs already: stop it first")
        source, file = self._hub.needed_source(), f"{name}.mcap"
        path = self._hub.folder.file(file)
        if path.exists():
            raise refused("name", f": {file} exists already; choose another name")
        self._state, self._file, self._label, self._length_s = "recording", file, label, length_s
        self._error, self._since = None, time.monotonic()
        self._stop.clear()
        try:
            await in_thread(source.record, path)
        except BaseException:
            self._state = "idle"
            raise
        self._task = asyncio.create_task(self._run(path))

    def end(self) -> None:
        """End the recording; a ProblemError says that none runs."""
        if not self.is_busy:
            raise ProblemError("nothing is recorded")
        self._stop.set()

    async def _run(self, path: Path) -> None:
        live = self._hub.needed_live()
        await self._hub.say(self.message())
        await self._mark(True)
        if self._label is not None:
            try:
                await in_thread(self._hub.needed_source().entitle, self._label)
            except (OSError, _core.Error) as error:
                await self._hub.warn(f"label: {error}")
        told = self._since
        while not self._stop.is_set() and live.records and not live.is_over:
            passed = time.monotonic() - self._since
            if self._length_s is not None and passed >= self._length_s:
                break
            left = _PROGRESS_S / 10 if self._length_s is None else min(_PROGRESS_S / 10, self._length_s - passed)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), left)
            if time.monotonic() - told >= _PROGRESS_S:
                told = time.monotonic()
                await self._hub.say(self.message())
        await self._mark(False)
        self._state = "finishing"
        await self._hub.say(self.message())
        if self._hub.board.is_connected:
            await asyncio.sleep(_MARKER_S)
        try:
            summary = await in_thread(live.end_recording)
        except (OSError, _core.Error) as error:
            self._error = str(error)
        else:
            if summary.path is None:
                what = f"datagrams arrived during the recording{_core.FIREWALL}"
                what = what if live.frame_us is None else "frames arrived during the recording"
                self._error = f"no {what}: no file was written"
            else:
                self._last = {"file": path.name, "verdict": str(summary.verdict)}
        self._state = "idle"
        await self._hub.say(await self._hub.recordings())
        await self._hub.say(self.message())

    async def _mark(self, on: bool) -> None:
        """Write the board's register of recordings, where the serial line is connected."""
        if self._hub.board.is_connected:
            try:
                await self._hub.on_board(lambda: self._hub.board.record(on))
            except (OSError, _core.Error) as error:
                await self._hub.warn(f"register record: {error}")
