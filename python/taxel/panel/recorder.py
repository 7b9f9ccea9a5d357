"""The recorder of the page: one recording at a time of the live source; it goes on without clients."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from taxel import _core
from taxel._core import ProblemError
from taxel.live import Live
from taxel.panel.threads import in_thread

_T = TypeVar("_T")
_Done: TypeAlias = Coroutine[Any, Any, _T]

#: How often progress is sent, and how long the board's stop marker is waited for, s.
_PROGRESS_S, _MARKER_S = 1.0, 0.1


class Recorder:
    """Record as the page asks.

    Parameters
    ----------
    say : coroutine function of a message
        Tells all clients.
    mark : coroutine function of a bool
        Writes the board's register of recordings; returns whether there is a board that marks them.
    """

    def __init__(self, say: Callable[[dict[str, Any]], _Done[None]], mark: Callable[[bool], _Done[bool]]) -> None:
        self._say, self._mark = say, mark
        self._state, self._since = "idle", 0.0
        self._file: str | None = None
        self._label: str | None = None
        self._length_s: float | None = None
        self._last: dict[str, str] | None = None
        self._error: str | None = None
        self._stop = asyncio.Event()

    @property
    def is_busy(self) -> bool:
        """Whether a recording runs, or is being ended."""
        return self._state != "idle"

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

    async def begin(self, source: _core.PanelLive, path: Path, label: str | None, length_s: float | None) -> None:
        """Begin a recording.

        Raises
        ------
        OSError : it cannot be written
        """
        self._state, self._file, self._label, self._length_s = "recording", path.name, label, length_s
        self._error, self._since = None, time.monotonic()
        self._stop.clear()
        try:
            await in_thread(source.record, path)
        except BaseException:
            self._state = "idle"
            raise

    def end(self) -> None:
        """End the recording; a ProblemError says that none runs."""
        if not self.is_busy:
            raise ProblemError("nothing is recorded")
        self._stop.set()

    async def run(self, live: Live, source: _core.PanelLive) -> None:
        """Tell of the recording that was begun until it has ended, by itself after its length."""
        await self._say(self.message())
        await self._mark(True)
        if self._label is not None:
            try:
                await in_thread(source.entitle, self._label)
            except (OSError, _core.Error) as error:
                await self._say({"type": "warning", "text": f"label: {error}"})
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
                await self._say(self.message())
        is_marked = await self._mark(False)
        self._state = "finishing"
        await self._say(self.message())
        if is_marked:
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
                self._last = {"file": summary.path.name, "verdict": str(summary.verdict)}
        self._state = "idle"
