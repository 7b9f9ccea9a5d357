"""Writes recordings and what a running sensor holds to a Rerun viewer that the user has started."""

from __future__ import annotations

import importlib
import os
import re
import socket
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import DeviceError, Frames, ProblemError, Recording, Tare

__all__ = ["Viewer"]

#: How long a connection may take, and how long a viewer may take to read everything, s.
_CONNECT_S, _READ_S = 0.5, 60.0


class Viewer:
    """A Rerun viewer that runs. Times are those of the recording or the board, on the time line "board".

    Parameters
    ----------
    to : str
        "rerun" or "rerun:HOST:PORT"; default: port 9876 of this computer.
    name : str
        The name that the viewer shows.

    Raises
    ------
    ImportError : rerun-sdk is not installed (``pip install 'taxel[rerun]'``)
    DeviceError : no viewer answers there
    ProblemError : `to` names no viewer
    """

    def __init__(self, to: str, name: str) -> None:
        found = re.fullmatch(r"rerun(?::(.+):([0-9]{1,5}))?", to)
        if found is None:
            raise ProblemError(f"viewer is {to!r}: must be rerun or rerun:HOST:PORT")
        # The library's own messages are not for the user.
        os.environ.setdefault("RUST_LOG", "off")
        try:
            self._rerun: Any = importlib.import_module("rerun")
        except ImportError:
            raise ImportError("rerun is not installed: pip install 'taxel[rerun]'") from None
        host, port = found[1] or "127.0.0.1", int(found[2] or 9876)
        try:
            # The library itself would wait for five seconds, and then go on in silence.
            socket.create_connection((host.strip("[]"), port), _CONNECT_S).close()
        except (OSError, OverflowError):
            raise DeviceError(f"no viewer answers at {host}:{port}: start one with rerun") from None
        self._stream = self._rerun.RecordingStream("taxel")
        self._stream.connect_grpc(f"rerun+http://{host}:{port}/proxy")
        self._stream.send_recording_name(name)
        for sign, colour in (("more", (230, 140, 40)), ("less", (70, 150, 240))):
            style = self._rerun.SeriesPoints(colors=colour, names=sign, markers="circle", marker_sizes=1.5)
            self._stream.log(f"events/{sign}", style, static=True)

    def recording(self, recording: Recording, tare: Tare | None = None) -> None:
        """Send events, frames with their sum, detections and notes; return when the viewer has read them."""
        if recording.has_events:
            events = recording.events
            for sign, chosen in (("more", events.p), ("less", ~events.p)):
                self._curve(f"events/{sign}", events.t[chosen], events.array.index(events.x, events.y)[chosen])
        if not recording.has_events or recording.events.intensity is not None:
            frames = recording.frames()
            self.frames(frames if tare is None else tare.off(frames))
        texts = [("detections", found.t, found.label) for found in recording.detections]
        texts += [("notes", note.t, note.text) for note in recording.notes if note.t is not None]
        for entity, t, text in texts:
            self._at(t)
            self._stream.log(entity, self._rerun.TextLog(text, level="INFO"))
        try:
            self._stream.flush(timeout_sec=_READ_S)
        except (RuntimeError, ValueError) as error:
            raise DeviceError(f"the viewer has not read everything: {error}") from None

    def frames(self, frames: Frames) -> None:
        """Send frames, and the sum of each."""
        colours = {
            "meter": 1.0,
            "colormap": "viridis",
            "depth_range": [0.0, float(np.nanmax(frames.values, initial=1))],
        }
        for t, values in zip(frames.t, frames.values, strict=True):
            self._at(t)
            self._stream.log("pressure", self._rerun.DepthImage(values, **colours))
        self._curve("force", frames.t, frames.total())

    def _at(self, t_us: int) -> None:
        self._stream.set_time("board", duration=np.timedelta64(int(t_us), "us"))

    def _curve(self, entity: str, t_us: NDArray[np.int64], values: NDArray[Any]) -> None:
        times = self._rerun.TimeColumn("board", duration=t_us.astype("timedelta64[us]"))
        scalars = self._rerun.Scalars.columns(scalars=values.astype(np.float64))
        self._rerun.send_columns(entity, [times], scalars, recording=self._stream)
