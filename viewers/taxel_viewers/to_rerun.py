"""Rerun: shows what a panel shows in a Rerun viewer that the user has started. It opens no port of its own."""

from __future__ import annotations

import contextlib
import importlib
import math
import socket
import time
from typing import Any

import numpy as np

from taxel import Detection, Note
from taxel.live.client import Curves, Frame, Item, Spikes, Subject
from taxel.spikes import to_ms
from taxel_viewers.kinds import Disconnected

#: Name of the time line, which has the board's times.
_TIME = "board"

#: Time limit of a connection attempt and time between attempts; how long one flush waits for a slow viewer, s.
_CONNECT_S, _CONNECT_EVERY_S, _FLUSH_S = 0.5, 0.5, 1.0


class ToRerun:
    """Show what a panel shows in a Rerun viewer.

    Parameters
    ----------
    host : str
    port : int
        Where the viewer listens.
    """

    def __init__(self, host: str, port: int) -> None:
        self._rerun: Any = importlib.import_module("rerun")
        self.place = f"Rerun at {host}:{port}"
        self._address, self._name = (host.strip("[]"), port), f"{host}:{port}"
        self._stream: Any = None
        self._tried = -_CONNECT_EVERY_S
        self._connected = self._closed = False
        self._known: Any = None

    def is_connected(self) -> bool:
        """Return whether a viewer runs."""
        if self._stream is None and time.monotonic() >= self._tried + _CONNECT_EVERY_S:
            self._tried = time.monotonic()
            self._connected = self._answers()
        return self._connected

    @property
    def why_not_connected(self) -> str:
        """Why no viewer is connected."""
        return f"no viewer at {self._name}; start one with: rerun"

    def begin(self, subject: Subject) -> None:
        """Show another subject from now on, as a Rerun recording of its own, because its time may begin anew."""
        self._known = None
        self._stream = self._rerun.RecordingStream("taxel")
        self._stream.set_log_tick_enabled(False)
        self._stream.set_log_time_enabled(False)
        # Without a viewer this call would wait for five seconds; `is_connected` has found one.
        self._stream.connect_grpc(f"rerun+http://{self._name}/proxy")
        self._stream.send_recording_name(subject.name)
        self._stream.send_blueprint(_layout())
        unknown = self._rerun.AnnotationContext([(0, "known", (0, 0, 0, 0)), (1, "no event yet", (96, 96, 96))])
        self._stream.log("pressure/unknown", unknown, static=True)
        for name, colour in (("more", (230, 140, 40)), ("less", (70, 150, 240))):
            style = self._rerun.SeriesPoints(colors=colour, names=name, markers="circle", marker_sizes=1.5)
            self._stream.log(f"spikes/{name}", style, static=True)
        for name, colour in (("x", (230, 140, 40)), ("y", (70, 150, 240))):
            self._stream.log(f"contact/centre/{name}", self._rerun.SeriesLines(colors=colour, names=name), static=True)

    def show(self, subject: Subject, item: Item) -> None:  # noqa: ARG002  `begin` has set the subject
        """Show the next item."""
        match item:
            case Frame():
                self._frame(item)
            case Curves():
                values = {"force_ticks": item.force, "area_taxels": item.area, "centre/x": item.x, "centre/y": item.y}
                for name, column in values.items():
                    self._column(f"contact/{name}", item.t, column)
            case Spikes():
                increase = item.value >= 0
                for name, chosen in (("more", increase), ("less", ~increase)):
                    if chosen.any():
                        self._column(f"spikes/{name}", item.t[chosen], item.train[chosen])
            case Detection():
                self._at(item.t)
                self._stream.log("detections", self._rerun.TextLog(_described(item), level="INFO"))
                if item.latency is not None:
                    self._stream.log("latency_ms", self._rerun.Scalars(to_ms(item.latency)))
            case Note() if item.t is not None:
                self._at(item.t)
                self._stream.log("notes", self._rerun.TextLog(item.text, level="INFO"))

    def flush(self) -> None:
        """Wait until the viewer has read everything.

        Raises
        ------
        Disconnected : it does not run any more
        """
        while True:
            try:
                self._stream.flush(timeout_sec=_FLUSH_S)
            except (RuntimeError, ValueError) as error:
                # A viewer that only reads slowly still accepts connections. Its stream is kept: to drop it would wait.
                if "timed out" not in str(error) or not self._answers():
                    self._stream, self._connected = None, False
                elif not self._closed:
                    continue
                raise Disconnected(str(error)) from None
            return

    def close(self) -> bool:
        """End a `flush` that waits; return whether the viewer reads: else the library waits for it at its end."""
        self._closed = True
        with contextlib.suppress(Disconnected):
            if self._stream is not None:
                self.flush()
            return True
        return False

    def _answers(self) -> bool:
        with contextlib.suppress(OSError), socket.create_connection(self._address, _CONNECT_S):
            return True
        return False

    def _at(self, t_us: int) -> None:
        self._stream.set_time(_TIME, duration=np.timedelta64(t_us, "us"))

    def _column(self, name: str, t_us: Any, values: Any) -> None:
        times = self._rerun.TimeColumn(_TIME, duration=t_us.astype("timedelta64[us]"))
        self._stream.send_columns(name, [times], self._rerun.Scalars.columns(scalars=values.astype(np.float64)))

    def _frame(self, frame: Frame) -> None:
        self._at(frame.t)
        colours = {"meter": 1.0, "colormap": "viridis", "depth_range": [0.0, float(frame.full)]}
        self._stream.log("pressure", self._rerun.DepthImage(frame.above, **colours))
        most = float(frame.full_change)
        colours = {"meter": 1.0, "colormap": "cyantoyellow", "depth_range": [-most, most]}
        self._stream.log("change", self._rerun.DepthImage(frame.change.astype(np.int16), **colours))
        if self._known is None or not np.array_equal(self._known, frame.known):
            self._known = frame.known
            self._stream.log("pressure/unknown", self._rerun.SegmentationImage((~frame.known).astype(np.uint8)))


def _layout() -> Any:
    """Return the arrangement of the views, which the user may change."""
    layout: Any = importlib.import_module("rerun.blueprint")
    images = layout.Vertical(
        layout.Spatial2DView(origin="pressure", name="Pressure above rest, ticks"),
        layout.Spatial2DView(origin="change", name="Change, ticks"),
    )
    curves = layout.Vertical(
        layout.TimeSeriesView(origin="spikes", name="Spikes, trains"),
        layout.TimeSeriesView(origin="contact/force_ticks", name="Force, ticks"),
        layout.TimeSeriesView(origin="contact/area_taxels", name="Area, taxels"),
        layout.TimeSeriesView(origin="contact/centre", name="Centre, taxels"),
        layout.TextLogView(origin="/", name="Detections and notes"),
    )
    return layout.Blueprint(layout.Horizontal(images, curves), collapse_panels=True)


def _described(detection: Detection) -> str:
    known = f"known {to_ms(detection.known - detection.t):.2f} ms after the event"
    if detection.latency is None:
        return f"{detection.label}: {known}"
    slope = "" if math.isnan(detection.slope) else f", slope {detection.slope:g} mV/ms"
    return f"{detection.label}: {known}, output {to_ms(detection.latency):.2f} ms later{slope}"
