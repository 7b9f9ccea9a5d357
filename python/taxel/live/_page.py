"""What the panel's server shows, for a client that is no browser: its protocol, read (docs/panel-protocol.md)."""

from __future__ import annotations

import json
import struct
import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from taxel.spikes import to_us

__all__ = ["Curves", "Detection", "Item", "Note", "Page", "Picture", "Spikes", "Subject"]

#: What a picture holds of a taxel that was never heard of, and its time before anything came.
_UNKNOWN, _NOTHING_CAME = 65_535, -(2**63)

#: Flags of a picture.
_LIVE, _RESTART = 1, 4

#: What comes late changes columns of time so long afterwards, us: then they are told.
_SETTLED_US = 120_000

#: The scale of pictures holds its largest value so long, us.
_SCALE_US = 10_000_000

#: Longer than the server's own time from one message of spikes to the next, s.
_SPIKES_WITHIN_S = 0.05

_CURVES = np.dtype([("force", "<u4"), ("area", "<u4"), ("x", "<f4"), ("y", "<f4")])


@dataclass(frozen=True, eq=False)
class Subject:
    """What is shown; another one of the same name begins anew, as of a board that was reset."""

    name: str
    rows: int
    columns: int


@dataclass(frozen=True, eq=False)
class Picture:
    """Hold the array at a time.

    Attributes
    ----------
    t : int, us
    above : uint16, shape (rows, columns), ticks above rest
    known : bool, shape (rows, columns)
        False where a taxel was never heard of.
    change : int8, shape (rows, columns), ticks
        The largest change lately, decaying.
    full, full_change : int, ticks
        The largest value above rest, and the largest change either way, of the last 10 s, 1 at least.
    """

    kind: ClassVar[str] = "pictures"
    count: ClassVar[int] = 1
    t: int
    above: NDArray[np.uint16]
    known: NDArray[np.bool_]
    change: NDArray[np.int8]
    full: int
    full_change: int


@dataclass(frozen=True, eq=False)
class Curves:
    """Hold force (ticks), area (taxels) and centre (taxels, NaN where nothing is pressed) at times, us."""

    kind: ClassVar[str] = "curves"
    t: NDArray[np.int64]
    force: NDArray[np.uint32]
    area: NDArray[np.uint32]
    x: NDArray[np.float32]
    y: NDArray[np.float32]

    @property
    def count(self) -> int:
        """How many times."""
        return len(self.t)


@dataclass(frozen=True, eq=False)
class Spikes:
    """Hold an encoder's spikes: times in us, trains and values; `left_out` were too many to be told."""

    kind: ClassVar[str] = "spikes"
    encoder: str
    t: NDArray[np.int64]
    train: NDArray[np.int64]
    value: NDArray[np.float64]
    left_out: int

    @property
    def count(self) -> int:
        """How many spikes."""
        return len(self.t)


@dataclass(frozen=True)
class Detection:
    """Hold what a readout said, us of the board's clock; of a recording not when it was said; slope in mV/ms."""

    kind: ClassVar[str] = "detections"
    count: ClassVar[int] = 1
    label: str
    t: int
    known: int
    said: int | None = None
    latency: int | None = None
    slope: float | None = None


@dataclass(frozen=True)
class Note:
    """Hold what a person wrote down, at a time, us."""

    kind: ClassVar[str] = "notes"
    count: ClassVar[int] = 1
    text: str
    t: int


Item = Picture | Curves | Spikes | Detection | Note


class Page:
    """Look at what a panel's server shows, and iterate over it.

    Parameters
    ----------
    address : str
        The server's host and port.
    token : str
    rate_hz : float, 1/s
        Pictures a second, of real time, at most.
    encoder : str, optional
        JSON of the encoder whose spikes are wanted.
    opens : str, optional
        A recording of the server's folder, in place of the live source.

    Raises
    ------
    OSError : there is no such server
    """

    def __init__(
        self, address: str, token: str, *, rate_hz: float, encoder: str | None = None, opens: str | None = None
    ) -> None:
        self._socket = connect(
            f"ws://{address}/socket",
            origin=Origin(f"http://{address}"),
            subprotocols=[Subprotocol("taxel.panel.1"), Subprotocol(f"token.{token}")],
            compression=None,
            max_size=None,
            proxy=None,
        )
        self._period_s, self._live = 1.0 / rate_hz, opens is None
        self._subject: Subject | None = None
        self._floor = 0
        self._rest: NDArray[np.uint16] | None = None
        self._shown = self._told = _NOTHING_CAME
        self._columns: tuple[NDArray[np.int64], NDArray[Any]] | None = None
        self._full, self._full_change = _Scale(), _Scale()
        #: Of a recording, what is told when its time has come.
        self._later: deque[Detection | Note] = deque()
        self._plays = self._ends = False
        #: What a person should read.
        self.trouble: str | None = None
        if opens is not None:
            self._send(type="open", name=opens)
        if encoder is not None:
            self._send(type="encode", encoder=json.loads(encoder))

    def play(self, speed: float) -> None:
        """Let the recording go on from where it is, at a speed."""
        self._send(type="play", speed=speed)

    def close(self) -> None:
        """Look no more; whoever iterates comes to the end."""
        self._socket.close()

    def __iter__(self) -> Iterator[tuple[Subject, Item]]:
        """Yield what is shown as it comes, until the recording or the server ends."""
        self._send(type="credit", n=1)
        due: float | None = None
        while True:
            try:
                message = self._socket.recv(None if due is None else max(0.0, due - time.monotonic()))
            except TimeoutError:
                self._send(type="credit", n=1)
                due = None
                continue
            except ConnectionClosed:
                break
            if isinstance(message, bytes):
                due = time.monotonic() + self._period_s
                yield from self._picture(message)
                if self._ends:
                    yield from self._last_spikes()
                    break
            else:
                yield from self._text(json.loads(message))
        yield from self._settled(over=True)
        # What a readout said when a recording's last event was over.
        while self._ends and self._later and self._subject is not None:
            yield self._subject, self._later.popleft()

    def _send(self, **message: Any) -> None:
        try:
            self._socket.send(json.dumps(message))
        except ConnectionClosed:
            # The next `recv` says so as well.
            return

    def _text(self, said: dict[str, Any]) -> Iterator[tuple[Subject, Item]]:
        kind = said["type"]
        if kind == "hello" and self._live:
            self._begin(said["array"], said["array"]["name"] or "board")
        elif kind == "opened":
            self._begin(said["array"], said["name"])
            self._floor = (said["registers"] or {}).get("noise_floor", self._floor)
            found: list[Detection | Note] = [
                Detection(one["label"], one["t_us"], one["known_us"]) for one in said["detections"]
            ]
            found += [Note(one["text"], one["t_us"]) for one in said["notes"] if one["t_us"] is not None]
            self._wait_for(found)
        elif kind == "labels":
            self._wait_for([Note(one["label"], one["t_us"]) for one in said["labels"]])
        elif kind == "registers":
            self._floor = said["values"]["noise_floor"]
        elif kind == "detection" and self._subject is not None:
            times = said["t_us"], said["known_us"], said["said_us"], said["latency_us"]
            yield self._subject, Detection(said["label"], *times, said["slope_mv_per_ms"])
        elif kind == "spikes" and self._subject is not None:
            yield self._subject, _spikes(said)
        elif kind == "transport":
            # It held before it was let go, too.
            self._ends = self._plays and said["state"] == "paused"
            self._plays = said["state"] == "playing"
        elif kind == "warning":
            self.trouble = said["text"]
        elif kind == "refused":
            self.trouble = said["reason"]

    def _begin(self, array: dict[str, Any], name: str) -> None:
        shape = array["rows"], array["columns"]
        if self._subject is None or (name, *shape) != (self._subject.name, self._subject.rows, self._subject.columns):
            self._subject = Subject(name, *shape)
            self._rest, self._columns = None, None
            self._anew()

    def _anew(self) -> None:
        """Time begins anew."""
        self._shown = self._told = _NOTHING_CAME
        self._full, self._full_change = _Scale(), _Scale()

    def _wait_for(self, marks: Sequence[Detection | Note]) -> None:
        self._later = deque(sorted([*self._later, *marks], key=_when))

    def _picture(self, message: bytes) -> Iterator[tuple[Subject, Item]]:
        flags, _, rows, columns, t = struct.unpack_from("<HIHHq", message, 6)
        column_us, first, count = struct.unpack_from("<IqI", message, 44)
        pressure, change, curves, rest = (_section(message, *which) for which in _SECTIONS)
        if len(rest):
            self._rest = rest
        subject = self._subject
        if subject is None or t == _NOTHING_CAME or (rows, columns) != (subject.rows, subject.columns):
            return
        if flags & _RESTART and t < self._shown:
            # A board that was reset, or a source that had stalled.
            subject = self._subject = Subject(subject.name, rows, columns)
            self._anew()
        self._shown = t
        known = pressure != _UNKNOWN
        if self._rest is not None and len(self._rest) == len(pressure):
            above = np.where(known & (self._rest != _UNKNOWN), pressure.astype(np.int32) - self._rest, 0)
        else:
            above = np.zeros(len(pressure), np.int32)
        above[above <= self._floor] = 0
        shape = rows, columns
        full = self._full.of(t, int(above.max(initial=0)))
        full_change = self._full_change.of(t, int(np.abs(change.astype(np.int16)).max(initial=0)))
        drawn = above.astype(np.uint16).reshape(shape)
        yield subject, Picture(t, drawn, known.reshape(shape), change.reshape(shape), full, full_change)
        self._columns = (np.arange(first + 1, first + count + 1, dtype=np.int64) * column_us, curves)
        yield from self._settled(over=False)
        while self._later and _when(self._later[0]) <= t:
            yield subject, self._later.popleft()

    def _settled(self, *, over: bool) -> Iterator[tuple[Subject, Item]]:
        """Yield the curves that nothing changes any more."""
        if self._columns is None or self._subject is None:
            return
        ends, curves = self._columns
        until = self._shown if over else self._shown - _SETTLED_US
        new = (ends > self._told) & (ends <= until)
        if new.any():
            self._told = int(ends[new][-1])
            chosen = curves[new]
            yield self._subject, Curves(ends[new], chosen["force"], chosen["area"], chosen["x"], chosen["y"])

    def _last_spikes(self) -> Iterator[tuple[Subject, Item]]:
        """Yield what is told after a recording's last picture."""
        for n in range(2):
            time.sleep(_SPIKES_WITHIN_S)
            self._send(type="overview", id=n)
            try:
                for message in self._socket:
                    if isinstance(message, bytes):
                        continue
                    said = json.loads(message)
                    yield from self._text(said)
                    if said["type"] in ("done", "refused") and said.get("id") == n:
                        break
            except ConnectionClosed:
                return


class _Scale:
    """Know the largest value lately, 1 at least."""

    def __init__(self) -> None:
        # Falling values, so that the first is the largest of all.
        self._peaks: deque[tuple[int, int]] = deque()

    def of(self, t: int, value: int) -> int:
        """Return it, with the value of this time."""
        while self._peaks and self._peaks[0][0] < t - _SCALE_US:
            self._peaks.popleft()
        while self._peaks and self._peaks[-1][1] <= value:
            self._peaks.pop()
        self._peaks.append((t, value))
        return max(1, self._peaks[0][1])


#: Number and type of the sections of a picture that are read.
_SECTIONS = ((0, np.dtype("<u2")), (1, np.dtype("i1")), (3, _CURVES), (5, np.dtype("<u2")))


def _section(message: bytes, number: int, dtype: np.dtype[Any]) -> NDArray[Any]:
    start, size = struct.unpack_from("<II", message, 64 + 8 * number)
    return np.frombuffer(message, dtype, size // dtype.itemsize, start)


def _spikes(said: dict[str, Any]) -> Spikes:
    times = np.round(to_us(np.array(said["t_ms"], np.float64))).astype(np.int64)
    trains, values = np.array(said["train"], np.int64), np.array(said["value"], np.float64)
    return Spikes(said["encoder"], times, trains, values, said["left_out"])


def _when(mark: Detection | Note) -> int:
    """Return when it is told: a detection, when it was known."""
    return mark.known if isinstance(mark, Detection) else mark.t
