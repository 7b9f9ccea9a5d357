"""What a reader of files returns: facts, a table and marks of one source, and the view that a recording has of it.

A reader of another format returns `InMemory`; `taxel.recording` looks at it through a `View`. For readers of
other distributions it has `Text`, which reads any encoding, and what makes errors with their place, as `unreadable`.

Examples
--------
>>> frames = Frames([[[1.0, 2.0]]], [0], unit="N")
>>> InMemory(Facts(path=Path("press.txt"), array=frames.array, kind="table"), frames).table()
Frames(1 frame of 1 x 2 taxels, 0 to 0 us, N)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import damaged, helped, refused, unreadable
from taxel._base.messages import warn
from taxel._base.table_text import Text, beginning, read_parquet, values_in
from taxel.array import Array
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.verdict import Verdict
from taxel.wire import Registers

__all__ = [
    "ENDINGS",
    "BoardChange",
    "Datagrams",
    "Facts",
    "InMemory",
    "Marks",
    "Reader",
    "Text",
    "View",
    "Zeroing",
    "after_zeros",
    "beginning",
    "damaged",
    "helped",
    "kind_of_file",
    "read_parquet",
    "refused",
    "unreadable",
    "values_in",
    "warn",
]  # fmt: skip

#: Converts times of one clock to those of another, us.
Times = Callable[[NDArray[np.int64]], NDArray[np.int64]]

#: taxel's own kinds of files by their endings.
ENDINGS: dict[str, str] = {".mcap": "mcap", ".lsa": "lsa", ".npz": "npz", ".csv": "csv", ".h5": "h5"}
#: So many frames show how far apart they are.
_LEAST = 2
#: Kinds of files that are no recordings of one format.
_OTHERS = {"arrays": "file of arrays", "records": "file of events", "table": "table", "ros": "ROS bag"}


def after_zeros(frames: Frames, seconds: float) -> Frames:
    """Return frames with frames of 0 before the first, so long, where the first is loaded; later times stay.

    As a sensor that starts itself at contact, such as a plate, read before it.

    Parameters
    ----------
    frames : Frames
    seconds : float, s

    Examples
    --------
    >>> after_zeros(Frames([[[3.0]], [[4.0]]], [0, 10_000]), 0.02).t.tolist()
    [-20000, -10000, 0, 10000]
    """
    if len(frames) < _LEAST or not np.any(frames.values[0]):
        return frames
    step = max(1, round(float(np.median(np.diff(frames.t)))))
    count = max(1, round(seconds * 1e6 / step))
    t = frames.t[0] + step * np.arange(-count, 0)
    values = np.concatenate([np.zeros((count, *frames.array.shape), np.float32), frames.values])
    return Frames(values, np.concatenate([t, frames.t]), unit=frames.unit, array=frames.array)


def kind_of_file(kind: str) -> str:
    """Return the name of a kind of recording: its ending if it is taxel's own, else its format.

    Examples
    --------
    >>> kind_of_file("npz"), kind_of_file("pedar"), kind_of_file("arrays")
    ('.npz', 'pedar recording', 'file of arrays')
    """
    return f".{kind}" if kind in ENDINGS.values() else _OTHERS.get(kind, f"{kind} recording")


@dataclass(frozen=True)
class Zeroing:
    """Hold that a person zeroed a taxel: its held value becomes its rest.

    Parameters
    ----------
    t : int, us
        Time of the zeroing: after all events up to it, before later ones.
    x, y : int, taxels
        The taxel's column and row.
    rest : float, ticks
        The rest after it.
    before : float, ticks, optional
        The rest before, if it was known.

    Examples
    --------
    >>> Zeroing(5000, 3, 2, rest=120.0, before=100.0)
    Zeroing(t=5000, x=3, y=2, rest=120.0, before=100.0)
    """

    t: int
    x: int
    y: int
    rest: float
    before: float | None


@dataclass(frozen=True)
class BoardChange:
    """Hold a change of the board while recording.

    Attributes
    ----------
    t : int, us, or None
        The board's time, which continues over the change; None if it was unknown.
    at_ns : int, ns since 1970
        Time at which the change was detected.
    change : str
        "reset": the board was reset, so the values of its taxels are unknown until their next event. "wire": it
        switched to another version of the wire.
    version : int, 1 or more, or None
        The version of the wire after it.
    asked : bool
        Whether the host requested the change; otherwise it was detected in the board's datagrams.

    Examples
    --------
    >>> BoardChange(5000, 1_700_000_000_000_000_000, "reset").asked
    False
    """

    t: int | None
    at_ns: int
    change: str
    version: int | None = None
    asked: bool = False

    def _described(self) -> dict[str, Any]:
        """Return the change as files hold it, without the host's time."""
        record: dict[str, Any] = {"t_us": self.t, "change": self.change}
        if self.version is not None:
            record |= {"version": self.version, "asked": self.asked}
        return record


@dataclass(frozen=True, eq=False)
class Datagrams:
    """Hold raw datagrams as received.

    Parameters
    ----------
    arrived_ns : int64, shape (n,), ns since 1970
    number : uint64, shape (n,), counted from 0
        Number of the arrival; a missing number is a datagram that was received but is not stored.
    offsets : int64, shape (n + 1,), bytes
        Index of the first byte of each in `payload`; the last entry is the number of bytes.
    payload : uint8, shape (bytes,), bytes as received
    version : int
        The version of the wire.
    differences : bool
        Whether intensities in them are differences.
    origin_us : int, us
        Offset that is added to times in them.
    unmarked : tuple of int
        The numbers of repaired events that they do not mark as repaired.

    Examples
    --------
    >>> empty = np.zeros(0, np.int64)
    >>> len(Datagrams(empty, empty.astype(np.uint64), np.zeros(1, np.int64), np.zeros(0, np.uint8)))
    0
    """

    arrived_ns: NDArray[np.int64]
    number: NDArray[np.uint64]
    offsets: NDArray[np.int64]
    payload: NDArray[np.uint8]
    version: int = 1
    differences: bool = False
    origin_us: int = 0
    unmarked: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.arrived_ns)

    def __getitem__(self, k: int) -> bytes:
        """Return the bytes of one datagram."""
        n = range(len(self))[k]
        return self.payload[self.offsets[n] : self.offsets[n + 1]].tobytes()

    def __repr__(self) -> str:
        return f"Datagrams({len(self)}, {self.payload.size} bytes)"


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Hold what is known of a source without reading its table.

    Parameters
    ----------
    path : Path
    array : Array
    kind : str
        The kind of file: "mcap", "table", the name of a format ...
    name : str
        The recording's name: the file's, or that of a trial in it. Default: the file's.
    label : str
        The name of the source within its recording, such as "left".
    source : str
        The origin of the bytes, such as an address or a port.
    side : {"left", "right", ""}
        The foot or hand that the sensor is of.
    heel : {"top", "bottom", ""}
        Place of the heel on the sensor.
    has_events : bool
        Whether its table is of events (else of frames).
    timed : bool
        Whether frames have times; else they are numbered: frame k has the time k us.
    columns : tuple of str
        The names of the columns of a stream of numbers; empty for a sensor.
    turned : float, optional
        The number that readings were subtracted from, as they fall with pressure (`falls` of a layout file).
    frame_us : float, us, optional
        Time from one frame to the next, by which a readout knew live when a frame was over.
    range_end : float, in the unit of the frames, optional
        The value at which the range of a taxel ends, if the file states it.
    raw : {"datagrams", ""}
        What was received that the reader holds too.
    begins_us : int, us, optional
        About when its times begin, if this is known; else the table says it.
    remarks : tuple of str
        What else there is to know: by whose times it is, what was left out, what it was converted from.
    lost : tuple of str
        A line for each kind of information that is not there any more, or that was not read.
    truncated : bool
        Whether the last data are missing.
    layout : str
        The text of a layout file by which a table or array of another program was read, complete.
    roles : tuple of mapping
        What each column or axis of such a file is (`taxel.formats.roles.Role`).
    episode : int, optional
        The number of the trial in a data set, by whose tables detections are written.
    labels_of : str
        The quantity of plain rules whose thresholds its notes are, as they were derived from it; "" if they were not.
    """

    path: Path = Path()
    array: Array
    kind: str = "events"
    name: str = ""
    label: str = "board"
    source: str = ""
    side: str = ""
    heel: str = ""
    has_events: bool = False
    timed: bool = True
    columns: tuple[str, ...] = ()
    turned: float | None = None
    frame_us: float | None = None
    range_end: float | None = None
    raw: str = ""
    begins_us: int | None = None
    remarks: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()
    truncated: bool = False
    layout: str = ""
    roles: tuple[Mapping[str, Any], ...] = ()
    episode: int | None = None
    labels_of: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.path.name)


M = TypeVar("M", Note, Zeroing, BoardChange)


@dataclass(frozen=True, eq=False)
class Marks:
    """Hold what happened at a time of a source's clock, and its state at the beginning.

    Parameters
    ----------
    notes : tuple of Note
    detections : Detections
    zeroings : tuple of Zeroing
        In order of time.
    changes : tuple of BoardChange
    registers : Registers, optional
        Those at the beginning, with the array that they drive: the whole sensor, even if the recording is a part of it.
    settings : tuple of (int ns since 1970, Registers)
        The registers at each change.
    held : float32, shape (rows, columns), ticks, optional
        The values that the taxels held at the beginning; NaN for one without any event before.
    """

    notes: tuple[Note, ...] = ()
    detections: Detections = field(default_factory=lambda: Detections([], [], []))
    zeroings: tuple[Zeroing, ...] = ()
    changes: tuple[BoardChange, ...] = ()
    registers: Registers | None = None
    settings: tuple[tuple[int, Registers], ...] = ()
    held: NDArray[np.float32] | None = None

    def between(self, start: float, stop: float) -> Marks:
        """Return those of ``start <= t < stop`` (us): taxels that were zeroed before it stay so; `held` is as it is."""
        notes = tuple(note for note in self.notes if note.t is not None and start <= note.t < stop)
        zeroings = tuple(zeroing for zeroing in self.zeroings if zeroing.t < stop)
        return replace(self, notes=notes, zeroings=zeroings, detections=self.detections.between(start, stop))

    def moved(self, times: Times) -> Marks:
        """Return the same by another clock."""

        def each(marks: tuple[M, ...]) -> tuple[M, ...]:
            return tuple(replace(m, t=None if m.t is None else int(times(np.array([m.t]))[0])) for m in marks)

        found = self.detections
        moved = Detections._of(found.label, times(found.t), times(found.known), found.slope, repaired=found.repaired)
        return replace(
            self,
            notes=each(self.notes),
            zeroings=each(self.zeroings),
            changes=each(self.changes),
            detections=moved,
        )

    def region(self, columns: slice, rows: slice) -> Marks:
        """Return those of a rectangle, whose columns and rows count from 0."""
        inside = (z for z in self.zeroings if columns.start <= z.x < columns.stop and rows.start <= z.y < rows.stop)
        zeroings = tuple(replace(z, x=z.x - columns.start, y=z.y - rows.start) for z in inside)
        return replace(self, zeroings=zeroings, held=None if self.held is None else self.held[rows, columns])


class Reader(Protocol):
    """Reads one source of a file.

    Each function may be called several times; a reader keeps what it read.
    """

    facts: Facts

    def table(self) -> Events | Frames:
        """Return the events or the frames."""
        ...

    def marks(self) -> Marks:
        """Return what happened at a time."""
        return Marks()

    def clock(self) -> Clock | None:
        """Return arrival times against the source's time; None without any."""
        return None

    def verdict(self) -> Verdict:
        """Return what was lost."""
        return Verdict._of({"silent": kind_of_file(self.facts.kind)})

    def datagrams(self) -> Datagrams | None:
        """Return what was received, as it was received; None if the file does not hold it."""
        return None

    def counts(self) -> Mapping[str, Any]:
        """Return the numbers of what was received, lost and repaired while reading, by cause."""
        return {}

    def damage(self) -> Mapping[str, int]:
        """Return the numbers of what reading the file skipped or repaired, by cause."""
        return {}


@dataclass(frozen=True, eq=False)
class InMemory(Reader):
    """A source whose table is in memory: of a file of another format, or merged.

    Parameters
    ----------
    facts : Facts
    data : Events or Frames
    marked : Marks, optional
    lost : Verdict, optional
        What was lost; default: unknown.
    counted : mapping, optional
        The numbers of what was received and lost, by cause.
    """

    facts: Facts
    data: Events | Frames
    marked: Marks = field(default_factory=Marks)
    lost: Verdict | None = None
    counted: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        has_events = isinstance(self.data, Events)
        object.__setattr__(self, "facts", replace(self.facts, array=self.data.array, has_events=has_events, raw=""))

    def table(self) -> Events | Frames:
        """Return the events or the frames."""
        return self.data

    def marks(self) -> Marks:
        """Return what happened at a time."""
        return self.marked

    def verdict(self) -> Verdict:
        """Return what was lost."""
        return super().verdict() if self.lost is None else self.lost

    def counts(self) -> Mapping[str, Any]:
        """Return the numbers of what was received and lost, by cause."""
        return self.counted


@dataclass(frozen=True, eq=False)
class View:
    """Say what of a source is looked at: a time, a rectangle, another clock.

    Parameters
    ----------
    start, stop : float, us
        ``start <= t < stop``, by the view's clock.
    columns, rows : slice, optional
        The rectangle, in columns and rows of the file's array; default: all.
    clock : str, optional
        The name of the clock of all times; default: the source's own.
    times : function, optional
        Converts the source's times to those of `clock`, or the numbers of frames to times; default: they are the same.
    notes : tuple of Note
        Notes that are not in the file, by the view's clock.
    """

    start: float = -np.inf
    stop: float = np.inf
    columns: slice | None = None
    rows: slice | None = None
    clock: str | None = None
    times: Times | None = None
    notes: tuple[Note, ...] = ()

    @property
    def is_slice(self) -> bool:
        """Whether it is of a time."""
        return bool(np.isfinite(self.start) or np.isfinite(self.stop))

    @property
    def is_whole(self) -> bool:
        """Whether it is of all of the source, by its own clock."""
        return not self.is_slice and self.columns is None and self.times is None
