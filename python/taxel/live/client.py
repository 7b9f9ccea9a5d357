"""A client of the panel: what the panel's server sends, as Python objects (protocol: docs/panel-protocol.md)."""

from __future__ import annotations

import json
import math
import struct
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite, instance, number, shown, text
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.detections import Detection
from taxel.encode import Encoder
from taxel.labels import Note
from taxel.live import _messages
from taxel.spikes import to_us

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

__all__ = ["Curves", "Frame", "Item", "PanelClient", "Spikes", "Subject"]

#: Pressure of a taxel without any event so far, and time of a frame before the first event.
_UNKNOWN, _NO_TIME = 65_535, -(2**63)

#: A flag of a frame: all earlier columns are void.
_RESTART = 4

#: How long late events can change a column of time, us; after that it is final.
_LATE_US = 120_000

#: The scale of frames is the largest value within this time, us.
_SCALE_US = 10_000_000

#: Longer than the server waits between two messages of spikes, s.
_SPIKES_WITHIN_S = 0.05

#: The server sends at most 60 frames a second.
_MOST_HZ = 60.0

_CURVES = np.dtype([("force", "<u4"), ("area", "<u4"), ("x", "<f4"), ("y", "<f4")])


@dataclass(frozen=True, eq=False)
class Subject:
    """Name the sensor or recording that is shown.

    A new object of the same name means that time begins again, as after a reset of the board.

    Attributes
    ----------
    name : str
    rows, columns : int
    """

    name: str
    rows: int
    columns: int


@dataclass(frozen=True, eq=False)
class Frame:
    """Hold the state of the array at a time.

    Attributes
    ----------
    t : int, us
    above : uint16, shape (rows, columns), ticks above rest
    known : bool, shape (rows, columns)
        False for a taxel without any event so far.
    change : int8, shape (rows, columns), ticks
        The largest recent change, decaying.
    full, full_change : int, ticks
        The largest value above rest, and the largest absolute change, in the last 10 s; at least 1.
    """

    t: int
    above: NDArray[np.uint16]
    known: NDArray[np.bool_]
    change: NDArray[np.int8]
    full: int
    full_change: int


@dataclass(frozen=True, eq=False)
class Curves:
    """Hold force, area and centre of the whole contact over time.

    Attributes
    ----------
    t : int64, shape (n,), us
    force : uint32, shape (n,), ticks above rest, summed over the array
    area : uint32, shape (n,), taxels above rest
    x, y : float32, shape (n,), taxels
        Column and row of the centre; NaN where nothing is pressed.
    """

    t: NDArray[np.int64]
    force: NDArray[np.uint32]
    area: NDArray[np.uint32]
    x: NDArray[np.float32]
    y: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Spikes:
    """Hold spikes of the encoder.

    Attributes
    ----------
    encoder : str
    t : int64, shape (n,), us
    train : int64, shape (n,)
    value : float64, shape (n,)
    left_out : int
        Number of further spikes, which the server does not send at once.
    """

    encoder: str
    t: NDArray[np.int64]
    train: NDArray[np.int64]
    value: NDArray[np.float64]
    left_out: int


Item = Frame | Curves | Spikes | Detection | Note


class PanelClient:
    """Receive what a panel shows: a context manager, and an iterator over pairs of `Subject` and `Item`.

    The client is one more viewer of the panel. It receives a frame only after a request, so that a slow client does not
    delay receiving and recording. The iteration ends with the recording or with the panel's server.

    Parameters
    ----------
    url : str
        The panel's address with its token, as `Panel.url` holds it and ``taxel live --panel`` prints it. The recording
        that it names, if any, is opened at its beginning, paused: see `play`.
    rate_hz : float, 1 to 60
        Maximum number of frames a second.
    encoder : Encoder, optional
        The encoder whose spikes are sent too.
    recording : str, optional
        Name of another recording in the panel's folder.

    Raises
    ------
    ImportError : the package `websockets` is not installed
    OSError : no server listens there
    ProblemError : arguments that are invalid; an address whose token the server refuses

    Examples
    --------
    >>> from taxel.live import Live, Panel, PanelClient, send
    >>> with Live(0, host="127.0.0.1") as live, Panel(live) as panel, PanelClient(panel.url) as client:
    ...     _ = send([bytes.fromhex("c000050304")], *live.address, seconds=0.2)
    ...     subject, frame = next(iter(client))
    >>> frame.above.shape
    (64, 64)
    """

    def __init__(
        self, url: str, *, rate_hz: float = 30.0, encoder: Encoder | None = None, recording: str | None = None
    ) -> None:
        address, token, opens = _parts(url)
        rate = finite("rate_hz", rate_hz, least=1.0, most=_MOST_HZ)
        spikes = None if encoder is None else instance("encoder", encoder, Encoder).to_json()
        opens = opens if recording is None else text("recording", recording)
        self._socket = _connected(address, token)
        self._period_s, self._live = 1.0 / rate, opens is None
        self._subject: Subject | None = None
        self._noise_floor = 0
        self._rest: NDArray[np.uint16] | None = None
        self._time = self._curves_until = _NO_TIME
        self._columns: tuple[NDArray[np.int64], NDArray[Any]] | None = None
        self._full, self._full_change = _Scale(), _Scale()
        #: Items of a recording that are yielded when playback reaches their time.
        self._later: deque[Detection | Note] = deque()
        self._plays = self._ends = False
        self._warning: str | None = None
        if opens is not None:
            self._send({"type": "open", "name": opens})
        if spikes is not None:
            self._send({"type": "encode", "encoder": json.loads(spikes)})

    @property
    def warning(self) -> str | None:
        """The last warning or refusal of the server, in words for a person."""
        return self._warning

    def play(self, speed: float = 1.0) -> None:
        """Play the recording from where it is.

        Parameters
        ----------
        speed : float, 0.001 to 100
            Speed: board time divided by real time.
        """
        self._send({"type": "play", "speed": number("speed", speed)})

    def close(self) -> None:
        """Disconnect; an iteration that runs ends."""
        self._socket.close()

    def __enter__(self) -> PanelClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __iter__(self) -> Iterator[tuple[Subject, Item]]:
        """Yield what is shown as it arrives, until the recording or the server ends."""
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415  an extra

        self._send({"type": "credit", "n": 1})
        due: float | None = None
        while True:
            try:
                message = self._socket.recv(None if due is None else max(0.0, due - time.monotonic()))
            except TimeoutError:
                self._send({"type": "credit", "n": 1})
                due = None
                continue
            except ConnectionClosed:
                break
            if isinstance(message, bytes):
                due = time.monotonic() + self._period_s
                yield from self._frame(message)
                if self._ends:
                    yield from self._last_spikes()
                    break
            else:
                yield from self._message(json.loads(message))
        yield from self._final_curves(over=True)
        # Detections that a readout made after a recording's last event.
        while self._ends and self._later and self._subject is not None:
            yield self._subject, self._later.popleft()

    def _send(self, request: _messages.Request) -> None:
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415  an extra

        try:
            self._socket.send(json.dumps(request))
        except ConnectionClosed:
            # The next `recv` reports it too.
            return

    def _message(self, message: _messages.Message) -> Iterator[tuple[Subject, Item]]:
        if message["type"] == "hello":
            if self._live and message["array"] is not None:
                self._begin(message["array"], message["array"]["name"] or "board")
        elif message["type"] == "opened":
            self._begin(message["array"], message["name"])
            self._noise_floor = (message["registers"] or {}).get("noise_floor", self._noise_floor)
            items: list[Detection | Note] = [
                Detection(found["label"], found["t_us"], found["known_us"]) for found in message["detections"]
            ]
            items += [Note(note["text"], note["t_us"]) for note in message["notes"] if note["t_us"] is not None]
            self._yield_later(items)
        elif message["type"] == "labels":
            self._yield_later([Note(label["label"], label["t_us"]) for label in message["labels"]])
        elif message["type"] == "registers":
            self._noise_floor = message["values"]["noise_floor"]
        elif message["type"] == "detection" and self._subject is not None:
            slope = math.nan if message["slope_mv_per_ms"] is None else message["slope_mv_per_ms"]
            times = message["t_us"], message["known_us"], slope, message["reported_us"]
            yield self._subject, Detection(message["label"], *times)
        elif message["type"] == "spikes" and self._subject is not None:
            yield self._subject, _spikes(message)
        elif message["type"] == "transport":
            # A recording is paused before it is played as well.
            self._ends = self._plays and message["state"] == "paused"
            self._plays = message["state"] == "playing"
        elif message["type"] == "warning":
            self._warning = message["text"]
        elif message["type"] == "refused":
            self._warning = message["reason"]

    def _begin(self, array: _messages.ArrayInfo, name: str) -> None:
        shape = array["rows"], array["columns"]
        if self._subject is None or (name, *shape) != (self._subject.name, self._subject.rows, self._subject.columns):
            self._subject = Subject(name, *shape)
            self._rest, self._columns = None, None
            self._restart()

    def _restart(self) -> None:
        """Begin time again."""
        self._time = self._curves_until = _NO_TIME
        self._full, self._full_change = _Scale(), _Scale()

    def _yield_later(self, items: Sequence[Detection | Note]) -> None:
        self._later = deque(sorted([*self._later, *items], key=_time_of))

    def _frame(self, message: bytes) -> Iterator[tuple[Subject, Item]]:
        flags, _, rows, columns, t = struct.unpack_from("<HIHHq", message, 6)
        column_us, first, count = struct.unpack_from("<IqI", message, 44)
        pressure, change, curves, rest = (_section(message, *section) for section in _SECTIONS)
        if len(rest):
            self._rest = rest
        subject = self._subject
        if subject is None or t == _NO_TIME or (rows, columns) != (subject.rows, subject.columns):
            return
        if flags & _RESTART and t < self._time:
            # The board was reset, or its source had stalled.
            subject = self._subject = Subject(subject.name, rows, columns)
            self._restart()
        self._time = t
        known = pressure != _UNKNOWN
        if self._rest is not None and len(self._rest) == len(pressure):
            above = np.where(known & (self._rest != _UNKNOWN), pressure.astype(np.int32) - self._rest, 0)
        else:
            above = np.zeros(len(pressure), np.int32)
        above[above <= self._noise_floor] = 0
        shape = rows, columns
        full = self._full.update(t, int(above.max(initial=0)))
        full_change = self._full_change.update(t, int(np.abs(change.astype(np.int16)).max(initial=0)))
        drawn = above.astype(np.uint16).reshape(shape)
        yield subject, Frame(t, drawn, known.reshape(shape), change.reshape(shape), full, full_change)
        self._columns = (np.arange(first + 1, first + count + 1, dtype=np.int64) * column_us, curves)
        yield from self._final_curves(over=False)
        while self._later and _time_of(self._later[0]) <= t:
            yield subject, self._later.popleft()

    def _final_curves(self, *, over: bool) -> Iterator[tuple[Subject, Item]]:
        """Yield the new curves that no late event can change any more; all of them when the source has ended."""
        if self._columns is None or self._subject is None:
            return
        ends, curves = self._columns
        until = self._time if over else self._time - _LATE_US
        new = (ends > self._curves_until) & (ends <= until)
        if new.any():
            self._curves_until = int(ends[new][-1])
            chosen = curves[new]
            yield self._subject, Curves(ends[new], chosen["force"], chosen["area"], chosen["x"], chosen["y"])

    def _last_spikes(self) -> Iterator[tuple[Subject, Item]]:
        """Yield the spikes that the server sends after a recording's last frame."""
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415  an extra

        for n in range(2):
            time.sleep(_SPIKES_WITHIN_S)
            self._send({"type": "overview", "id": n})
            try:
                for message in self._socket:
                    if isinstance(message, bytes):
                        continue
                    received = json.loads(message)
                    yield from self._message(received)
                    if received["type"] in ("done", "refused") and received.get("id") == n:
                        break
            except ConnectionClosed:
                return


class _Scale:
    """The largest recent value, 1 at least."""

    def __init__(self) -> None:
        # Falling values, so that the first is the largest of all.
        self._peaks: deque[tuple[int, int]] = deque()

    def update(self, t: int, value: int) -> int:
        """Return it, with the value of this time."""
        while self._peaks and self._peaks[0][0] < t - _SCALE_US:
            self._peaks.popleft()
        while self._peaks and self._peaks[-1][1] <= value:
            self._peaks.pop()
        self._peaks.append((t, value))
        return max(1, self._peaks[0][1])


def _parts(url: object) -> tuple[str, str, str | None]:
    """Return host and port, token, and the recording that a panel's address names."""
    parts = urlsplit(text("url", url))
    keys = parse_qs(parts.fragment)
    if parts.scheme != "http" or not parts.netloc or "token" not in keys:
        raise refused("url", f" is {shown(url)}: must be a panel's address, http://HOST:PORT/#token=...")
    return parts.netloc, keys["token"][0], keys.get("open", [None])[0]


def _connected(address: str, token: str) -> ClientConnection:
    try:
        from websockets.exceptions import InvalidHandshake  # noqa: PLC0415  an extra
        from websockets.sync.client import connect  # noqa: PLC0415  an extra
        from websockets.typing import Origin, Subprotocol  # noqa: PLC0415  an extra
    except ImportError:
        raise ImportError("websockets is not installed: pip install websockets") from None
    try:
        # Newer versions connect when the context is entered; `PanelClient.close` closes the connection.
        return connect(
            f"ws://{address}/socket",
            origin=Origin(f"http://{address}"),
            subprotocols=[Subprotocol("taxel.panel.1"), Subprotocol(f"token.{token}")],
            compression=None,
            max_size=None,
            proxy=None,
        ).__enter__()
    except InvalidHandshake as error:
        raise ProblemError(f"panel at {address}: refuses the connection; the token may be wrong: {error}") from None


#: Number and type of the sections of a frame that are read.
_SECTIONS = ((0, np.dtype("<u2")), (1, np.dtype("i1")), (3, _CURVES), (5, np.dtype("<u2")))


def _section(message: bytes, number: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    start, size = struct.unpack_from("<II", message, 64 + 8 * number)
    return np.frombuffer(message, dtype, size // dtype.itemsize, start)


def _spikes(message: _messages.SpikesMessage) -> Spikes:
    times = np.round(to_us(np.array(message["t_ms"], np.float64))).astype(np.int64)
    trains, values = np.array(message["train"], np.int64), np.array(message["value"], np.float64)
    return Spikes(message["encoder"], times, trains, values, message["left_out"])


def _time_of(item: Detection | Note) -> int:
    """Return the time at which an item is yielded: of a detection, when it was known."""
    return item.known if isinstance(item, Detection) else item.t or 0
