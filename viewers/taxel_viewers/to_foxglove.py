"""Foxglove: shows what a panel shows, by a server on loopback that Foxglove connects to."""

from __future__ import annotations

import importlib
import math
import threading
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Detection, Note
from taxel.live.client import Curves, Frame, Item, Spikes, Subject

#: Messages that wait for each client; beyond them the server drops the oldest.
_BACKLOG = 512

#: A client subscribes to one topic after the other, to all within this time, s.
_SUBSCRIBED_WITHIN_S = 0.25

#: Colour of a taxel without any event so far.
_UNKNOWN = (96, 96, 96)

_NUMBER, _WHOLE, _TEXT = {"type": "number"}, {"type": "integer"}, {"type": "string"}
_SOME = {"type": ["number", "null"]}
_SCHEMAS = {
    "/contact": {"t_us": _WHOLE, "force_ticks": _WHOLE, "area_taxels": _WHOLE, "x": _SOME, "y": _SOME},
    "/spikes": {
        "t_us": _WHOLE,
        "encoder": _TEXT,
        "train": {"type": "array", "items": _WHOLE},
        "value": {"type": "array", "items": _NUMBER},
    },
    "/detections": {
        "label": _TEXT,
        "t_us": _WHOLE,
        "known_us": _WHOLE,
        "reported_us": _SOME,
        "latency_us": _SOME,
        "slope": _SOME,
    },
}


class ToFoxglove:
    """Show what a panel shows in every Foxglove that opens ``ws://127.0.0.1:PORT``.

    Parameters
    ----------
    port : int
        TCP; 0 finds a free one.

    Raises
    ------
    OSError : the port is taken
    """

    def __init__(self, port: int) -> None:
        self._foxglove: Any = importlib.import_module("foxglove")
        channels: Any = importlib.import_module("foxglove.channels")
        self._messages: Any = importlib.import_module("foxglove.messages")
        self._context = self._foxglove.Context()
        self._begun = False
        self._subscribed: set[tuple[int, int]] = set()
        self._since, self._lock = 0.0, threading.Lock()
        self._images = {name: channels.RawImageChannel(name, context=self._context) for name in _IMAGES}
        self._notes = channels.LogChannel("/notes", context=self._context)
        self._tables = {name: self._table(name, fields) for name, fields in _SCHEMAS.items()}
        try:
            self._server = self._foxglove.start_server(
                name="taxel",
                host="127.0.0.1",
                port=port,
                context=self._context,
                message_backlog_size=_BACKLOG,
                server_listener=self,
            )
        except RuntimeError as error:
            raise OSError(
                f"127.0.0.1:{port}: Foxglove's server cannot listen there: {str(error).removeprefix('FoxgloveError: ')}"
            ) from None
        self.place = f"Foxglove at ws://127.0.0.1:{self._server.port}"

    def _table(self, name: str, fields: dict[str, Any]) -> Any:
        schema = {"title": f"taxel.{_TITLES[name]}", "type": "object", "properties": fields}
        return self._foxglove.Channel(name, schema=schema, message_encoding="json", context=self._context)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Note a subscription."""
        with self._lock:
            if not self._subscribed:
                self._since = time.monotonic()
            self._subscribed.add((client.id, channel.id))

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Note the end of a subscription."""
        with self._lock:
            self._subscribed.discard((client.id, channel.id))

    def is_connected(self) -> bool:
        """Return whether a client has subscribed to the topics."""
        with self._lock:
            return bool(self._subscribed) and time.monotonic() > self._since + _SUBSCRIBED_WITHIN_S

    @property
    def why_not_connected(self) -> str:
        """Why no viewer is connected."""
        return "no Foxglove is connected"

    def begin(self, subject: Subject) -> None:  # noqa: ARG002  frames bring its name
        """Show another subject from now on."""
        if self._begun:
            # Time may begin anew, so that clients must discard what they have.
            self._server.clear_session()
        self._begun = True

    def show(self, subject: Subject, item: Item) -> None:
        """Show the next item."""
        match item:
            case Frame():
                for name, (encoding, draw) in _IMAGES.items():
                    self._image(name, subject, item.t, encoding, draw(item))
            case Curves():
                for t, force, area, x, y in zip(item.t, item.force, item.area, item.x, item.y, strict=True):
                    self._row("/contact", t, force_ticks=int(force), area_taxels=int(area), x=_some(x), y=_some(y))
            case Spikes():
                cuts = np.flatnonzero(np.diff(item.t)) + 1
                parts = (np.split(column, cuts) for column in (item.t, item.train, item.value))
                for t, train, value in zip(*parts, strict=True):
                    if len(t):
                        self._row("/spikes", t[0], encoder=item.encoder, train=train.tolist(), value=value.tolist())
            case Detection():
                when = {"known_us": item.known, "reported_us": item.reported, "latency_us": item.latency}
                slope = None if math.isnan(item.slope) else item.slope
                self._row("/detections", item.t, label=item.label, **when, slope=slope)
            case Note() if item.t is not None:
                level = self._messages.LogLevel.Info
                note = self._messages.Log(timestamp=self._stamp(item.t), level=level, message=item.text, name="note")
                self._notes.log(note, log_time=_ns(item.t))

    def flush(self) -> None:
        """Return at once: Foxglove's server never waits for a slow client."""

    def close(self) -> bool:
        """End the server."""
        self._server.stop()
        return True

    def _stamp(self, t_us: int) -> Any:
        return self._messages.Timestamp(*divmod(_ns(t_us), 10**9))

    def _row(self, name: str, t: Any, **values: Any) -> None:
        self._tables[name].log({"t_us": int(t), **values}, log_time=_ns(int(t)))

    def _image(self, name: str, subject: Subject, t: int, encoding: str, values: NDArray[Any]) -> None:
        rows, columns = values.shape[:2]
        image = self._messages.RawImage(
            timestamp=self._stamp(t),
            frame_id=subject.name,
            width=columns,
            height=rows,
            encoding=encoding,
            step=values[0].nbytes,
            data=values.tobytes(),
        )
        self._images[name].log(image, log_time=_ns(t))


def _pressure(frame: Frame) -> NDArray[np.uint8]:
    scaled = np.minimum(frame.above.astype(np.int64) * 255 // frame.full, 255)
    drawn: NDArray[np.uint8] = _colours()[scaled]
    drawn[~frame.known] = _UNKNOWN
    return drawn


def _ticks(frame: Frame) -> NDArray[np.uint16]:
    return frame.above.astype("<u2")


def _change(frame: Frame) -> NDArray[np.uint8]:
    strength = np.abs(frame.change.astype(np.int16))[:, :, None] / frame.full_change
    colour = np.where(frame.change[:, :, None] > 0, (255, 150, 50), (70, 150, 255))
    drawn: NDArray[np.uint8] = (strength * colour).astype(np.uint8)
    return drawn


@cache
def _colours() -> NDArray[np.uint8]:
    """Return 256 colours that can be distinguished with a colour vision deficiency."""
    from matplotlib import colormaps  # noqa: PLC0415  loads slowly

    colour_map: NDArray[np.uint8] = (np.asarray(colormaps["viridis"](np.arange(256)))[:, :3] * 255).astype(np.uint8)
    return colour_map


#: Images by topic, in colours and in numbers.
_IMAGES: dict[str, tuple[str, Callable[[Frame], NDArray[Any]]]] = {
    "/pressure": ("rgb8", _pressure),
    "/pressure/ticks": ("16UC1", _ticks),
    "/change": ("rgb8", _change),
}
_TITLES = {"/contact": "Contact", "/spikes": "Spikes", "/detections": "Detection"}


def _some(value: Any) -> float | None:
    """Return a number, or None for NaN."""
    return None if np.isnan(value) else float(value)


def _ns(t_us: int) -> int:
    return max(0, 1000 * t_us)
