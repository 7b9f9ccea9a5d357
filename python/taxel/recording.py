"""A file, opened: what was recorded, when, and what was lost."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel import _arguments as arguments
from taxel import _core
from taxel._arguments import flag, instance, number, several, shown, text, window
from taxel._core import FormatError, ProblemError
from taxel._h5 import read_h5
from taxel._remarks import Note, Remarks, array_of, detections_of, notes_of
from taxel._tables import read_csv, read_npz
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Labels, beside
from taxel.tare import Tare
from taxel.wire import Registers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ENDINGS",
    "BoardChange",
    "Clock",
    "Datagrams",
    "Note",
    "Recording",
    "in_memory",
    "kind_of_file",
    "open_recording",
]

#: Pictures a second where a recording of events is asked for frames without a rate.
FRAMES_HZ = 100.0

#: How well-known files of other kinds begin, and what to do with them.
_MAGIC = {
    b"\x89MCAP0\r\n": "mcap",
    b"PK\x03\x04": "npz",
    b"PK\x05\x06": "npz",
    b"\x89HDF\r\n\x1a\n": "h5",
}
_STRANGERS = {
    b"\x1f\x8b": "gzip; unpack it first",
    b"\x28\xb5\x2f\xfd": "zstd; unpack it first",
    b"\x04\x22\x4d\x18": "lz4; unpack it first",
    b"BZh": "bzip2; unpack it first",
    b"\xfd7zXZ": "xz; unpack it first",
    b"\x89PNG": "a PNG picture, no recording",
    b"%PDF": "a PDF document, no recording",
    b"SQLite": "SQLite (a ROS 2 bag?); convert it to MCAP first",
    b"#ROSBAG": "a ROS 1 bag; convert it to MCAP first",
    b"\x93NUMPY": "a single NumPy array; save its columns t, x, y, p with numpy.savez",
}
ENDINGS = {".mcap": "mcap", ".lsa": "lsa", ".npz": "npz", ".csv": "csv", ".h5": "h5"}


def kind_of_file(kind: str) -> str:
    """Return what a kind of recording is called: by its ending where it is ours, else by its format."""
    return f".{kind}" if kind in ENDINGS.values() else f"{kind} recording"


@dataclass(frozen=True)
class BoardChange:
    """Say what became of the board while recording.

    Attributes
    ----------
    t : int, us, or None
        The board's time, which goes on over the change; None where it was not known.
    at_ns : int, ns since 1970
        When it was noticed.
    change : str
        "reset": the board was reset, so its taxels hold nothing until they are heard again. "wire": it speaks another
        version of the wire.
    version : int or None
        Of the wire from here on.
    asked : bool
        Whether the host told it to change that; else its datagrams showed it.
    """

    t: int | None
    at_ns: int
    change: str
    version: int | None = None
    asked: bool = False

    def _json(self) -> str:
        said: dict[str, Any] = {"t_us": self.t, "change": self.change}
        if self.version is not None:
            said |= {"version": self.version, "asked": self.asked}
        return json.dumps(said)


@dataclass(frozen=True, eq=False)
class Datagrams:
    """Hold raw datagrams as they came.

    Parameters
    ----------
    arrived_ns : int64, shape (n,), ns since 1970
    number : uint64, shape (n,)
        Our own arrival number: a hole in it is a datagram that was received but is not here.
    offsets : int64, shape (n + 1,)
        Where each begins in `payload`, and at last where all end.
    payload : uint8, shape (bytes,)
    """

    arrived_ns: NDArray[np.int64]
    number: NDArray[np.uint64]
    offsets: NDArray[np.int64]
    payload: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.arrived_ns)

    def __getitem__(self, k: int) -> bytes:
        """Return the bytes of one datagram."""
        n = range(len(self))[k]
        return self.payload[self.offsets[n] : self.offsets[n + 1]].tobytes()

    def __repr__(self) -> str:
        return f"Datagrams({len(self)}, {self.payload.size} bytes)"


@dataclass(frozen=True, eq=False, repr=False)
class Clock:
    """Tell the board's time from the host's: when each datagram came against the last stamp in it.

    A datagram comes late by whatever the way costs, never early, so the line below all arrivals is the offset between
    the clocks and the shortest way together; they cannot be told apart.

    Parameters
    ----------
    board_us : int64, shape (n,), us
        The last stamp of each datagram that has one.
    arrived_ns : int64, shape (n,), ns since 1970
        When it came.
    """

    board_us: NDArray[np.int64]
    arrived_ns: NDArray[np.int64]

    @cached_property
    def _line(self) -> tuple[int, int, float]:
        line = _core.board_clock(self.board_us, self.arrived_ns)
        if line is None:
            raise ProblemError("clock: no datagram holds a time, so there is nothing to compare")
        return line

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the board's, parts per million; 0 below four seconds."""
        return self._line[2]

    @property
    def offset_ns(self) -> int:
        """The host's time at time 0 of the board, ns since 1970."""
        return int(self.host_ns(0))

    def host_ns(self, board_us: int | NDArray[np.int64]) -> Any:
        """Return the host's time (ns since 1970) at times of the board (us)."""
        board, host, drift = self._line
        since = np.asarray(board_us, np.int64) - board
        return host + since * 1000 + np.rint(since * drift * 1e-3).astype(np.int64)

    def board_us_at(self, host_ns: int) -> int:
        """Return the board's time (us) at a time of the host (ns since 1970)."""
        board, host, drift = self._line
        return board + round((host_ns - host) / (1000.0 + drift * 1e-3))

    @property
    def delay_us(self) -> NDArray[np.float64]:
        """How much later than the quickest each datagram came, us."""
        late: NDArray[np.float64] = (self.arrived_ns - self.host_ns(self.board_us)) / 1000.0
        return late

    def __repr__(self) -> str:
        if not len(self.board_us):
            return "Clock(no datagram holds a time)"
        late = np.percentile(self.delay_us, [50, 99])
        return f"Clock(drift {self.drift_ppm:+.1f} ppm, delays {late[0]:.0f} us median, {late[1]:.0f} us 99 %)"


class Recording:
    """Hold a file, opened: everything is read when it is first asked for.

    Made by `taxel.open`.

    Attributes
    ----------
    path : Path
    name : str
        The file's name; of a trial in other people's file what that calls it.
    kind : str
        "mcap", "lsa", "npz", "csv" or "h5"; of other people's one of `taxel.formats.FORMATS`; of
        `taxel.merge` "merged".
    array : Array
        The sensor.
    source : str
        Where the bytes came from, as the file says.

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.mcap"
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> taxel.convert(events, place)
    []
    >>> rec = taxel.open(place)
    >>> rec
    Recording(two.mcap: 2 events, 0 to 200 us, 8 x 8 taxels)
    >>> rec.events == events
    True
    >>> rec.verdict
    'nothing lost after arrival (version 1 of the wire cannot show what was lost before it)'
    """

    def __init__(
        self, source: _Source, window: tuple[float, float] | None = None, noted: tuple[Note, ...] = ()
    ) -> None:
        if not isinstance(source, _Source):
            raise ProblemError(f"source is {shown(source)}: a recording is opened by taxel.open(path), not built")
        self._source = source
        self._window = window
        self._noted = noted
        self.path, self.kind, self.array, self.source = source.path, source.kind, source.array, source.origin
        self.name = source.name

    @cached_property
    def events(self) -> Events:
        """The changes at taxels.

        Raises
        ------
        ProblemError : the file holds pictures
        """
        events = self._source.events
        if events is None:
            raise ProblemError(f"{self.path}: holds pictures and no events; ask for frames()")
        return events if self._window is None else events.between(*self._window)

    def frames(self, rate_hz: float | None = None) -> Frames:
        """Return pictures over time.

        Parameters
        ----------
        rate_hz : float, above 0, optional
            Pictures a second, rounded to whole us; left out, a file of pictures gives its own, one of events 100.

        Returns
        -------
        Frames
            Of events: the held intensities, 0 before a taxel's first; of pictures: the last at each time.

        Raises
        ------
        ProblemError : a rate that makes no sense, or events without intensities
        """
        period = None if rate_hz is None else period_us("rate_hz", rate_hz)
        own = self._source.frames
        if own is None:
            period = round(1e6 / FRAMES_HZ) if period is None else period
            whole = self._source.events
            assert whole is not None  # a file holds one of the two
            if self._window is None:
                return Frames.from_events(whole, period)
            # A picture needs what came before the window, too.
            t = whole.t if len(whole) else np.zeros(1, np.int64)
            first, last = max(int(t.min()), _whole(self._window[0])), min(int(t.max()) + 1, _whole(self._window[1]))
            return Frames.from_events(whole, period, first, max(first, last))
        if period is not None and len(own):
            t = np.arange(own.t[0], own.t[-1] + 1, period, dtype=np.int64)
            held = own.values[np.searchsorted(own.t, t, side="right") - 1]
            own = Frames(held, t, unit=own.unit, array=own.array)
        return own if self._window is None else own.between(*self._window)

    @cached_property
    def calibration(self) -> Calibration | None:
        """The calibration that lies beside the file (`Calibration.beside`); None where there is none.

        Raises
        ------
        FormatError : it cannot be read
        ProblemError : it is of another array, or of readings in another unit
        """
        place = Calibration.beside(self.path)
        if place is None:
            return None
        found = Calibration.load(place)
        read = "ticks" if self.has_events else self.frames().unit
        if found.array != self.array or found.of != read:
            raise ProblemError(
                f"{place}: turns {found.of} of {found.array!r} into {found.unit}; {self.name} holds {read} of "
                f"{self.array!r}, another array"
            )
        return found

    def calibrated(self, rate_hz: float | None = None, rest: Tare | None = None) -> Frames:
        """Return pictures in N or kPa, by the calibration that lies beside the file.

        Parameters
        ----------
        rate_hz : float, above 0, optional
            As of `frames`.
        rest : Tare, optional
            Today's rest; the calibration's own where it is left out.

        Raises
        ------
        ProblemError : no calibration lies beside it, or one of another array
        """
        if self.calibration is None:
            raise ProblemError(
                f"{self.path}: no calibration lies beside it; taxel calibrate makes one, and without one nothing is N "
                "or kPa"
            )
        return self.calibration.apply(self.frames(rate_hz), rest)

    @property
    def is_slice(self) -> bool:
        """Whether this is a part of the file, made by `between`."""
        return self._window is not None

    @property
    def has_events(self) -> bool:
        """Whether the file holds events (else pictures)."""
        return self._source.frames is None

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What people wrote down, in the order of the file; then the labels of its folder and of `NAME.notes.csv`.

        Raises
        ------
        FormatError : a table of labels that is none (names the line)
        """
        notes = self._source.notes + self._noted + _beside(self.path, self.kind)
        if self._window is None:
            return notes
        start, stop = self._window
        return tuple(n for n in notes if n.t is not None and start <= n.t < stop)

    @cached_property
    def detections(self) -> Detections:
        """What a readout said while recording."""
        found = self._source.detections
        return found if self._window is None else found.between(*self._window)

    @cached_property
    def registers(self) -> Registers | None:
        """What the board's registers held at the beginning; None where the file does not say."""
        held = self._source.registers
        return None if held is None else Registers._of(held, self.array)

    @cached_property
    def register_changes(self) -> tuple[tuple[int, Registers], ...]:
        """The registers as they were set while recording, each with the host's time (ns since 1970)."""
        return tuple((at, Registers._of(held, self.array)) for at, held in self._source.register_changes)

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        """Resets of the board and changes of its version of the wire, as they were noticed live."""
        return self._source.board_changes

    @cached_property
    def clock(self) -> Clock | None:
        """Arrival times against board time; None where the file has no arrival times."""
        return self._source.clock

    def datagrams(self) -> Datagrams:
        """Return the raw datagrams as they came; of a slice, too, all of the file.

        Raises
        ------
        ProblemError : the file holds no datagrams
        """
        datagrams = self._source.datagrams
        if datagrams is None:
            raise ProblemError(f"{self.path}: the {kind_of_file(self.kind)} holds no datagrams; only .mcap does")
        return datagrams

    @property
    def counts(self) -> dict[str, Any]:
        """What came and what was lost, by cause."""
        return self._source.counts

    @property
    def verdict(self) -> str:
        """One line: nothing lost after arrival, or what was lost where."""
        return self._source.verdict

    @property
    def truncated(self) -> bool:
        """Whether the file lacks its end: the writer was killed, or the file was cut."""
        return self._source.truncated

    @property
    def rebuilt(self) -> dict[str, int]:
        """What reading had to put up with: torn bytes at the end, gaps, bytes skipped there, bad and large chunks."""
        return self._source.rebuilt

    def between(self, start: float, stop: float) -> Recording:
        """Return the part of ``start <= t < stop`` (us of the board's clock); notes without a time are left out.

        Raises
        ------
        ProblemError : a start that lies after the stop, or is no number
        """
        start, stop = window("us", start, stop)
        if self._window is not None:
            start, stop = max(start, self._window[0]), min(stop, self._window[1])
        return Recording(self._source, (start, max(start, stop)), self._noted)

    def with_notes(self, notes: Iterable[Note]) -> Recording:
        """Return the same recording with further notes."""
        more = tuple(instance("notes", note, Note) for note in several("notes", notes))
        return Recording(self._source, self._window, self._noted + more)

    def plot(self) -> Figure:
        """Draw what is in it: events (or the sum of pressure) over time, and where on the array."""
        from taxel.plot import overview  # noqa: PLC0415  matplotlib loads slowly

        return overview(self)

    def _repr_html_(self) -> str:
        from taxel.plot import html  # noqa: PLC0415  matplotlib loads slowly

        return html(self)

    def __repr__(self) -> str:
        what = self.events if self.has_events else self.frames()
        noun = "events" if self.has_events else "pictures"
        time = f"{int(what.t.min())} to {int(what.t.max())} us" if len(what) else "no time"
        more = [f"{len(self.notes)} notes"] * bool(self.notes)
        more += [f"{len(self.detections)} detections"] * bool(len(self.detections))
        more += ["truncated"] * self.truncated
        size = f"{self.array.rows} x {self.array.columns} taxels"
        return f"Recording({self.name}: {', '.join([f'{len(what)} {noun}', time, size, *more])})"


def _beside(path: Path, kind: str) -> tuple[Note, ...]:
    """Return the labels that people set on a finished recording, from the table beside it."""
    table = beside(path)
    if kind not in ENDINGS.values() or not table.is_file():
        return ()
    labels = Labels(table)
    name = labels.named(path)
    rows = sorted((row for row in labels.rows if row.recording == name), key=lambda row: row.t_us)
    return tuple(Note(row.label, row.t_us, row.host_ns or 0) for row in rows)


def open_recording(
    path: str | os.PathLike[str], *, array: Array | None = None, pairing: str = "direct", differences: bool = False
) -> Recording:
    """Open one file of ours: .mcap, .lsa, .npz, .csv or .h5, finished or not, whole or damaged.

    Parameters
    ----------
    path : path
    array : Array, optional
        The sensor, for files that do not hold it (.lsa, .csv, plain .npz); the thesis' 64 x 64 where it is left out,
        a larger one where events lie outside it.
    pairing : {"direct", "taxel"}
        Which change an intensity belongs to: the one directly before it, or the latest of that taxel.
    differences : bool
        Whether the intensities of a .lsa are differences (the board's option); a .mcap says so itself.

    Returns
    -------
    Recording

    Raises
    ------
    FormatError : the file is of another kind, or damaged where nothing can be read (names the place)
    OSError : the file is not there, or cannot be read

    Notes
    -----
    A .csv holds events as ``t_us,x,y,p[,intensity]``, or frames as ``t_us`` and a column a taxel.
    """
    place = Path(arguments.path("path", path))
    if array is not None:
        instance("array", array, Array)
    text("pairing", pairing, ("direct", "taxel"))
    flag("differences", differences)
    with place.open("rb") as file:
        head = file.read(16)
    kind = _kind(place, head)
    try:
        if kind == "mcap":
            return Recording(_Mcap(place, pairing))
        if kind == "lsa":
            return Recording(_Lsa(place, array or Array.thesis(), pairing, differences))
        table = {"npz": read_npz, "csv": read_csv, "h5": read_h5}[kind](place, array)
        return in_memory(place, kind, *table)
    except MemoryError as error:
        raise FormatError(f"{place}: needs more memory than there is ({error})") from None


def in_memory(path: Path, kind: str, table: Events | Frames, remarks: Remarks, *, name: str | None = None) -> Recording:
    """Return a recording of a table that is in memory."""
    return Recording(_Table(path, kind, table, remarks, path.name if name is None else name))


def period_us(name: str, rate_hz: float) -> int:
    """Return the whole us of a rate."""
    rate = number(name, rate_hz, "Hz")
    if not 0 < rate <= 1e6:
        raise ProblemError(f"{name} is {rate}: must be above 0, at most 1000000")
    return round(1e6 / rate)


def _kind(path: Path, head: bytes) -> str:
    """Return the kind of a file by its first bytes and its ending, which must not contradict each other."""
    ending = ENDINGS.get(path.suffix.lower())
    found = next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
    begins = " ".join(f"{byte:02X}" for byte in head[:4]) or "nothing"
    if found is not None and ending in (None, found):
        return found
    if ending == "lsa":
        # Raw bytes may begin with anything.
        return ending
    stranger = next((what for magic, what in _STRANGERS.items() if head.startswith(magic)), None)
    wanted = {"mcap": "the MCAP magic", "npz": "the magic of a .npz", "csv": "the names of columns"}
    wanted["h5"] = "the magic of HDF5"
    if found is not None:
        stranger = f"a .{found} file; rename it"
    if stranger is not None:
        right = wanted[ending] if ending else "a recording"
        what, _, advice = stranger.partition("; ")
        raise FormatError(
            f"{path}, byte 0: starts with {begins} ({what}), not with {right}" + f"; {advice}" * bool(advice)
        )
    if ending is None:
        raise FormatError(f"{path}, byte 0: starts with {begins}: no recording; there are {', '.join(ENDINGS)}")
    if ending in {"npz", "h5"}:
        magic = {"npz": "50 4B 03 04", "h5": "89 48 44 46"}[ending]
        raise FormatError(f"{path}, byte 0: starts with {begins}, not with {wanted[ending]} ({magic})")
    # The compiled reader says what is wrong with a .mcap, the table's reader with a .csv.
    return ending


def _whole(value: float) -> int:
    """Return a bound in whole us, infinite ones far away."""
    return int(np.ceil(np.clip(value, -(2.0**62), 2.0**62)))


class _Source:
    """Where a recording comes from; what a kind of file cannot hold stays empty."""

    def __init__(self, path: Path, kind: str, array: Array, origin: str = "") -> None:
        self.path, self.kind, self.array, self.origin = path, kind, array, origin
        self.name = path.name

    @property
    def events(self) -> Events | None:
        return None

    @property
    def frames(self) -> Frames | None:
        return None

    @property
    def registers(self) -> dict[str, Any] | None:
        return None

    @property
    def register_changes(self) -> tuple[tuple[int, dict[str, Any]], ...]:
        return ()

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        return ()

    @property
    def speaks_version_2(self) -> bool:
        """Whether the board's bytes are datagrams of wire version 2."""
        return False

    @property
    def notes(self) -> tuple[Note, ...]:
        return ()

    @property
    def detections(self) -> Detections:
        return Detections([], [], [])

    @property
    def clock(self) -> Clock | None:
        return None

    @property
    def datagrams(self) -> Datagrams | None:
        return None

    @property
    def counts(self) -> dict[str, Any]:
        return {}

    @property
    def verdict(self) -> str:
        return f"the {kind_of_file(self.kind)} does not say what was lost"

    @property
    def truncated(self) -> bool:
        return False

    @property
    def rebuilt(self) -> dict[str, int]:
        return {}

    @property
    def payload(self) -> NDArray[np.uint8] | None:
        """All bytes of the board, as they came."""
        return None

    @property
    def differences(self) -> bool:
        """Whether intensity words are differences."""
        return False

    @property
    def origin_us(self) -> int:
        """What is added to the times in the bytes."""
        return 0


class _Table(_Source):
    """A table of events or pictures, all in memory."""

    def __init__(self, path: Path, kind: str, table: Events | Frames, remarks: Remarks, name: str) -> None:
        super().__init__(path, kind, table.array, remarks.source)
        self.name = name
        self._table, self._remarks = table, remarks

    @property
    def events(self) -> Events | None:
        return self._table if isinstance(self._table, Events) else None

    @property
    def frames(self) -> Frames | None:
        return self._table if isinstance(self._table, Frames) else None

    @property
    def registers(self) -> dict[str, Any] | None:
        held = self._remarks.registers
        return None if held is None else dict(held)

    @property
    def notes(self) -> tuple[Note, ...]:
        return self._remarks.notes

    @property
    def detections(self) -> Detections:
        return self._remarks.detections

    @property
    def counts(self) -> dict[str, Any]:
        return dict(self._remarks.counts)

    @property
    def verdict(self) -> str:
        return self._remarks.verdict or super().verdict


class _Lsa(_Source):
    """The manual's raw bytes."""

    def __init__(self, path: Path, array: Array, pairing: str, differences: bool) -> None:
        super().__init__(path, "lsa", array)
        read = _core.read_lsa(path, array._parts(), pairing, differences)
        self._payload, parts, self._counts, self._complete = read
        self._events, self._differences = Events._from_parts(parts, array), differences

    @property
    def payload(self) -> NDArray[np.uint8]:
        return self._payload

    @property
    def differences(self) -> bool:
        return self._differences

    @property
    def events(self) -> Events:
        return self._events

    @property
    def truncated(self) -> bool:
        return not self._complete

    @property
    def counts(self) -> dict[str, Any]:
        return {"bytes": len(self._payload), "decoder": json.loads(self._counts)}

    @property
    def verdict(self) -> str:
        damage = json.loads(_core.recording_damage(self._counts))
        _, _, said = _core.recording_verdict(json.dumps({"decoder": damage})).partition("; ")
        parts = ["raw bytes do not say what was lost, nor how many turns of 6.5536 s a longer silence had"]
        parts += [said] * bool(said)
        parts += [f"{self.path.with_suffix('.lss').name} is not there: the recording was not finished"] * self.truncated
        return "; ".join(parts)


class _Mcap(_Source):
    """The live format."""

    def __init__(self, path: Path, pairing: str) -> None:
        self._reader, self._pairing = _core.RecordingReader(path), pairing
        about = json.loads(self._reader.about())
        self._header, self._ending, self._rebuilt = about["header"], about["ending"] or {}, about["rebuilt"]
        super().__init__(path, "mcap", array_of(self._header["array"]), self._header["source"])

    @cached_property
    def _remarks(self) -> dict[str, Any]:
        remarks: dict[str, Any] = json.loads(self._reader.remarks())
        return remarks

    @cached_property
    def _decoded(self) -> tuple[Any, ...]:
        parts, *rest = self._reader.decode(self._pairing)
        return Events._from_parts(parts, self.array), *rest

    @property
    def events(self) -> Events:
        events: Events = self._decoded[0]
        return events

    @property
    def registers(self) -> dict[str, Any] | None:
        first: dict[str, Any] | None = self._header["registers"]
        changes = self.register_changes
        return first if first is not None or not changes else changes[0][1]

    @property
    def register_changes(self) -> tuple[tuple[int, dict[str, Any]], ...]:
        return tuple((at, values) for at, values in self._remarks["registers"])

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        return tuple(
            BoardChange(said["t_us"], at, said["change"], said.get("version"), said.get("asked", False))
            for at, said in self._remarks["board"]
        )

    @property
    def speaks_version_2(self) -> bool:
        return bool(json.loads(self._decoded[6])["intact"])

    @property
    def notes(self) -> tuple[Note, ...]:
        return notes_of(self._remarks["notes"])

    @property
    def detections(self) -> Detections:
        return detections_of(self._remarks["detections"])

    @property
    def clock(self) -> Clock:
        events, _, _, arrived, _, first, _ = self._decoded
        last = np.append(first[1:], len(events)).astype(np.int64) - 1
        has = last >= first.astype(np.int64)
        return Clock(np.ascontiguousarray(events.t[last[has]]), np.ascontiguousarray(arrived[has]))

    @property
    def datagrams(self) -> Datagrams:
        return Datagrams(*self._reader.datagrams())

    @property
    def payload(self) -> NDArray[np.uint8]:
        return self.datagrams.payload

    @property
    def differences(self) -> bool:
        return bool(self._header["difference"])

    @property
    def origin_us(self) -> int:
        return int(self._header["origin_us"])

    @property
    def truncated(self) -> bool:
        return bool(self._rebuilt["unfinished"]) or "finished" not in self._ending

    @property
    def rebuilt(self) -> dict[str, int]:
        rebuilt = {key: int(value) for key, value in self._rebuilt.items() if key != "unfinished"}
        return {**rebuilt, "bad_chunks": int(self._remarks["bad_chunks"])}

    @property
    def counts(self) -> dict[str, Any]:
        said = self._ending.get("finished", {}).get("counts") or self._remarks["counts"] or {}
        _, decoder, _, _, number, *_ = self._decoded
        missing = int(number[-1]) - int(number[0]) + 1 - len(number) if len(number) else 0
        return {
            "datagrams": self._remarks["datagrams"],
            "bytes": self._remarks["datagram_bytes"],
            "missing_numbers": max(0, missing),
            **{name: said.get(name) for name in ("received", "dropped_by_kernel", "dropped_by_queue")},
            "decoder": json.loads(decoder),
            **self.rebuilt,
        }

    @property
    def verdict(self) -> str:
        rebuilt = self.rebuilt
        bad = []
        if rebuilt["large_chunks"]:
            bad.append(f"{rebuilt['large_chunks']} chunks skipped that say they unpack to more than 64 MiB")
        if rebuilt["bad_chunks"]:
            bad.append(f"{rebuilt['bad_chunks']} bad chunks skipped")
        if rebuilt["gaps"]:
            bad.append(f"{rebuilt['skipped_bytes']} bytes of the file skipped in {rebuilt['gaps']} places")
        if rebuilt["torn_bytes"]:
            bad.append(f"{rebuilt['torn_bytes']} torn bytes at the end")
        if "finished" in self._ending:
            said = str(self._ending["finished"]["verdict"])
            return f"LOST in the file: {', '.join(bad)}; while recording: {said}" if bad else said
        why = "not finished: what came last is missing"
        if "stopped" in self._ending:
            why = f"stopped by an error ({self._ending['stopped']}): what came last is missing"
        so_far = self._remarks["counts"]
        known = "no counts were kept yet"
        if so_far is not None:
            # What was received then is more than what the file holds now: the rest is the unfinished end.
            known = _core.recording_verdict(json.dumps({**so_far, "received": 0}))
        return "; ".join([why, *bad, f"until then: {known}"])
