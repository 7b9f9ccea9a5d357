"""A file, opened: what was recorded, when, and what was lost."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base import arguments
from taxel._base.arguments import flag, instance, number, several, shown, text, window
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Labels, beside
from taxel.recording.h5 import read_h5
from taxel.recording.remarks import Note, Remarks, Zeroing, array_of, detections_of, notes_of, zeroings_of
from taxel.recording.tables import read_csv, read_npz
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
    "Zeroing",
    "in_memory",
    "kind_of_file",
    "open_recording",
]

#: Pictures a second where a recording of events is asked for frames without a rate.
FRAMES_HZ = 100.0

#: What a file holds of a taxel that was never heard of.
_UNHEARD = 65_535

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
        self,
        source: _Source,
        window: tuple[float, float] | None = None,
        noted: tuple[Note, ...] = (),
        family: dict[str, _Source] | None = None,
        clock_of: str | None = None,
    ) -> None:
        if not isinstance(source, _Source):
            raise ProblemError(f"source is {shown(source)}: a recording is opened by taxel.open(path), not built")
        self._source = source
        self._window = window
        self._noted = noted
        #: All sources of the file by name, this one among them, and whose clock they are on (its own each, if none).
        self._family = {source.label: source} if family is None else family
        self._clock_of = clock_of
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
            Of events: the held intensities, which begin with `held`, else with 0; of pictures: the last at each time.

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
            begins = self._source.held
            begins = None if begins is None else np.where(begins == _UNHEARD, 0, begins)
            if self._window is None:
                return Frames.from_events(whole, period, held=begins)
            # A picture needs what came before the window, too.
            t = whole.t if len(whole) else np.zeros(1, np.int64)
            first, last = max(int(t.min()), _whole(self._window[0])), min(int(t.max()) + 1, _whole(self._window[1]))
            return Frames.from_events(whole, period, first, max(first, last), held=begins)
        if period is not None and len(own):
            t = np.arange(own.t[0], own.t[-1] + 1, period, dtype=np.int64)
            held = own.values[np.searchsorted(own.t, t, side="right") - 1]
            own = Frames(held, t, unit=own.unit, array=own.array)
        return own if self._window is None else own.between(*self._window)

    @property
    def sources(self) -> dict[str, Recording]:
        """The sources of the file by name, in the order in which they were named, each with its own clock.

        Each is a recording that every step takes. A file of one board is one source. Of one board and streams of
        numbers (an IMU) the file's own events, frames and all else are the board's; of several boards they are refused,
        by name.

        Raises
        ------
        ProblemError : of a slice by the clock of one source: the others have another
        """
        if self._window is not None and len(self._family) > 1 and self._clock_of is None:
            names = ", ".join(self._family)
            raise ProblemError(
                f"{self.path}: a slice by one clock, and its sources ({names}) have each its own; say on_clock(name) "
                "before between"
            )
        return {
            name: Recording(source, self._window, self._noted if source is self._source else (), self._family,
                            self._clock_of)
            for name, source in self._family.items()
        }  # fmt: skip

    def on_clock(self, name: str) -> Recording:
        """Return the same recording with all its sources' times by the clock of one of them, or of the host.

        Nothing else applies what is known of the clocks (`clock`): until this is asked for, each source has its own.

        Parameters
        ----------
        name : str
            A source, or "host": then times are us since 1970.

        Raises
        ------
        ProblemError : no such source, one without arrival times, or a slice by another clock

        Examples
        --------
        After ``both = taxel.open("two.mcap").on_clock("left")`` the times of ``both.sources["right"].events`` are in us
        of the board "left".
        """
        names = [*self._family, "host"]
        text("name", name)
        if name not in names:
            raise ProblemError(f"{self.path}: has no clock {name!r}; there are {', '.join(names)}")
        if self._clock_of is not None:
            raise ProblemError(f"{self.path}: is on the clock of {self._clock_of} already")
        if self._window is not None:
            raise ProblemError(f"{self.path}: a slice by its own clock; say on_clock({name!r}) before between")
        to = None if name == "host" else _clock_of(self._family[name])
        family = {
            one: source if one == name else _OnClock(source, to) for one, source in self._family.items()
        }  # fmt: skip
        own = _alone(family) if self._source.is_several else family[self._source.label]
        return Recording(own, None, (), family, name)

    @cached_property
    def held(self) -> NDArray[np.float32] | None:
        """What the taxels held when it began, ticks, shape (rows, columns), NaN of one that was not heard of.

        None where nothing is known of it. A recording that begins in mid-stream says it, as a taxel that does not
        change would else be unknown until it does; a slice knows what came before it. `frames` begins with it, and so
        do encoders and readouts that are given the recording (not its events alone).
        """
        held = self._began_with()
        return None if held is None else np.where(held == _UNHEARD, np.nan, held).astype(np.float32)

    def _began_with(self) -> NDArray[np.uint16] | None:
        """Return what the taxels held when it began, as files keep it; of a slice with what came before it."""
        held, events = self._source.held, self._source.events
        if self._window is None or events is None or events.intensity is None or events.present is None:
            return held
        before = np.flatnonzero(events.present & (events.t < self._window[0]))
        if not len(before):
            return held
        now = np.full(self.array.shape, _UNHEARD, np.uint16) if held is None else held.copy()
        last = before[np.argsort(events.t[before], kind="stable")]
        # Of values at one place the last one stays.
        now[events.y[last], events.x[last]] = events.intensity[last]
        return now

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
        return self._source.is_several or self._source.holds_events

    @cached_property
    def notes(self) -> tuple[Note, ...]:
        """What people wrote down, in the order of the file; then the labels of its folder and of `NAME.notes.csv`.

        Raises
        ------
        FormatError : a table of labels that is none (names the line)
        """
        # They are by the clock of the file's first source.
        beside = _beside(self.path, self.kind) if self._source.label == next(iter(self._family)) else ()
        notes = self._source.notes + self._noted + self._source.moved(beside)
        if self._window is None:
            return notes
        start, stop = self._window
        return tuple(n for n in notes if n.t is not None and start <= n.t < stop)

    @cached_property
    def zeroings(self) -> tuple[Zeroing, ...]:
        """Taxels that people zeroed while recording, in order; of a slice those before it too, which hold in it."""
        zeroings = self._source.zeroings
        return zeroings if self._window is None else tuple(z for z in zeroings if z.t < self._window[1])

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

    @property
    def columns(self) -> list[str]:
        """Of a stream of numbers the names of its columns of values, in the order of `frames`.

        Raises
        ------
        ProblemError : no stream of numbers
        """
        of = self._source.of if isinstance(self._source, _OnClock) else self._source
        if not isinstance(of, _Samples):
            raise ProblemError(
                f"{self.path}: source {self._source.label!r} is no stream of numbers, so it has no columns"
            )
        return of.columns

    @property
    def is_stream(self) -> bool:
        """Whether it is a stream of numbers, line by line, as an IMU's, and no array of taxels."""
        return isinstance(self._source, _Samples)

    def _stream(self) -> tuple[dict[str, Any], NDArray[np.int64], NDArray[np.uint64], NDArray[np.float64]]:
        """Return header, arrivals (ns), numbers and all columns of a stream, its own stamps unwrapped."""
        assert isinstance(self._source, _Samples)
        return self._source.as_it_came

    @property
    def is_on_clock(self) -> bool:
        """Whether times are by another clock, made by `on_clock`."""
        return self._clock_of is not None

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
        part = (start, max(start, stop))
        return Recording(self._source, part, self._noted, self._family, self._clock_of)

    def with_notes(self, notes: Iterable[Note]) -> Recording:
        """Return the same recording with further notes."""
        more = tuple(instance("notes", note, Note) for note in several("notes", notes))
        return Recording(self._source, self._window, self._noted + more, self._family, self._clock_of)

    def plot(self) -> Figure:
        """Draw what is in it: events (or the sum of pressure) over time, and where on the array."""
        from taxel.plot import overview  # noqa: PLC0415  matplotlib loads slowly

        return overview(self)

    def _repr_html_(self) -> str:
        from taxel.plot import html  # noqa: PLC0415  matplotlib loads slowly

        return html(self)

    def __repr__(self) -> str:
        if self._source.is_several:
            return f"Recording({self.name}: {len(self._family)} sources: {', '.join(self._family)})"
        what = self.events if self.has_events else self.frames()
        noun = "events" if self.has_events else "pictures"
        time = f"{int(what.t.min())} to {int(what.t.max())} us" if len(what) else "no time"
        more = [f"{len(self.notes)} notes"] * bool(self.notes)
        more += [f"{len(self.detections)} detections"] * bool(len(self.detections))
        more += [f"{len(self.zeroings)} zeroed taxels"] * bool(self.zeroings)
        more += ["truncated"] * self.truncated
        others = [name for name in self._family if name != self._source.label]
        more += [f"beside {', '.join(others)}"] * bool(others)
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
            return _of_mcap(place, pairing)
        if kind == "lsa":
            return Recording(_Lsa(place, array or Array.thesis(), pairing, differences))
        table = {"npz": read_npz, "csv": read_csv, "h5": read_h5}[kind](place, array)
        return in_memory(place, kind, *table)
    except MemoryError as error:
        raise FormatError(f"{place}: needs more memory than there is ({error})") from None


def _of_mcap(place: Path, pairing: str) -> Recording:
    """Open the live format, with all its sources."""
    reader = _core.RecordingReader(place)
    family: dict[str, _Source] = {}
    for name in reader.sources():
        one = reader.of_source(name)
        header = json.loads(one.about())["header"]
        family[name] = _Mcap(place, pairing, one) if header.get("stream") is None else _Samples(place, one)
    return Recording(_alone(family), family=family)


def _alone(family: dict[str, _Source]) -> _Source:
    """Return the source whose events are the file's: its only one, or its only board; else one that refuses."""
    boards = [source for source in family.values() if source.holds_events]
    if len(family) == 1:
        return next(iter(family.values()))
    return boards[0] if len(boards) == 1 else _Several(family)


def _clock_of(source: _Source) -> Clock:
    clock = source.clock
    if clock is None or not len(clock.board_us):
        raise ProblemError(f"{source.path}: source {source.label!r} has no arrival times, so its clock is not known")
    return clock


def in_memory(path: Path, kind: str, table: Events | Frames, remarks: Remarks, *, name: str | None = None) -> Recording:
    """Return a recording of a table that is in memory."""
    return Recording(_Table(path, kind, table, remarks, path.name if name is None else name))


def period_us(name: str, rate_hz: float) -> int:
    """Return the whole us of a rate."""
    rate = number(name, rate_hz, "Hz")
    if not 0 < rate <= 1e6:
        raise ProblemError(f"{name} is {rate}: must be above 0, at most 1000000")
    if rate < 1e-9:
        raise ProblemError(f"{name} is {rate}: must be 1e-9 or more, a picture in 31 years")
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
        #: What the source is called among those of its file.
        self.label = "board"

    @property
    def is_several(self) -> bool:
        """Whether there are several sources of events, so that none is the file's."""
        return False

    @property
    def holds_events(self) -> bool:
        return self.frames is None

    @property
    def held(self) -> NDArray[np.uint16] | None:
        """What the taxels held when it began, shape (rows, columns)."""
        return None

    def moved(self, notes: tuple[Note, ...]) -> tuple[Note, ...]:
        """Return notes by the clock that the source is on."""
        return notes

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
    def zeroings(self) -> tuple[Zeroing, ...]:
        """Taxels that were zeroed, in order of time."""
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
    def zeroings(self) -> tuple[Zeroing, ...]:
        return self._remarks.zeroings

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


class _Reader(_Source):
    """A source of the live format."""

    def __init__(self, path: Path, reader: _core.RecordingReader) -> None:
        self._reader = reader
        about = json.loads(self._reader.about())
        self._header, self._ending, self._rebuilt = about["header"], about["ending"] or {}, about["rebuilt"]
        super().__init__(path, "mcap", array_of(self._header["array"]), self._header["source"])
        self.label = self._header.get("name", "board")

    @cached_property
    def _remarks(self) -> dict[str, Any]:
        remarks: dict[str, Any] = json.loads(self._reader.remarks())
        return remarks

    @property
    def truncated(self) -> bool:
        return bool(self._rebuilt["unfinished"]) or "finished" not in self._ending

    @property
    def rebuilt(self) -> dict[str, int]:
        rebuilt = {key: int(value) for key, value in self._rebuilt.items() if key != "unfinished"}
        return {**rebuilt, "bad_chunks": int(self._remarks["bad_chunks"])}

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


class _Mcap(_Reader):
    """A board's part of the live format."""

    def __init__(self, path: Path, pairing: str, reader: _core.RecordingReader) -> None:
        super().__init__(path, reader)
        self._pairing = pairing

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
    def zeroings(self) -> tuple[Zeroing, ...]:
        return zeroings_of([one for _, one in self._remarks["zeroings"]])

    @property
    def detections(self) -> Detections:
        return detections_of(self._remarks["detections"])

    @cached_property
    def clock(self) -> Clock:
        arrived, left = self._decoded[3], self._decoded[7]
        has = left > np.iinfo(np.int64).min
        return Clock(np.ascontiguousarray(left[has]), np.ascontiguousarray(arrived[has]))

    @property
    def held(self) -> NDArray[np.uint16] | None:
        held = self._remarks["held"]
        if held is None or len(held) != self.array.rows * self.array.columns:
            return None
        return np.array(held, np.uint16).reshape(self.array.shape)

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


class _Samples(_Reader):
    """A stream's part of the live format: numbers, line by line."""

    @cached_property
    def _read(self) -> tuple[Any, ...]:
        return self._reader.samples()

    @property
    def holds_events(self) -> bool:
        return False

    @cached_property
    def frames(self) -> Frames:
        _, _, t, values, _, _ = self._read
        order = np.argsort(t, kind="stable")
        rows = values.reshape(len(t), 1, self.array.columns)[order]
        return Frames(rows.astype(np.float32), _ascending(t[order]), unit="as sent", array=self.array)

    @property
    def columns(self) -> list[str]:
        """The names of the columns of values."""
        stream = self._header["stream"]
        return [name for name in stream["columns"] if name != stream.get("time")]

    @cached_property
    def clock(self) -> Clock:
        return Clock(self._read[2], self._read[0])

    @property
    def as_it_came(self) -> tuple[dict[str, Any], NDArray[np.int64], NDArray[np.uint64], NDArray[np.float64]]:
        """Header, arrivals (ns), numbers, and all columns line by line: the source's own stamps unwrapped."""
        arrived, number, t, values, _, _ = self._read
        stream = self._header["stream"]
        rows = values.reshape(len(t), self.array.columns)
        if stream.get("time") is not None:
            own = t / float(stream["unit_us"])
            rows = np.insert(rows, stream["columns"].index(stream["time"]), own, axis=1)
        return self._header, arrived, number, np.ascontiguousarray(rows).reshape(-1)

    @property
    def counts(self) -> dict[str, Any]:
        _, _, t, _, bad, resets = self._read
        said = self._ending.get("finished", {}).get("counts") or {}
        seen = {"samples": len(t), "lines_that_could_not_be_read": bad, "clock_began_anew": resets}
        return {**seen, "received": said.get("received"), **self.rebuilt}


class _Several(_Source):
    """A file of several boards, of which none is the file's."""

    def __init__(self, family: dict[str, _Source]) -> None:
        first = next(iter(family.values()))
        super().__init__(first.path, first.kind, first.array, first.origin)
        self._family, self.label = family, first.label

    @property
    def is_several(self) -> bool:
        return True

    def _refusal(self) -> ProblemError:
        names = ", ".join(self._family)
        first = next(iter(self._family))
        return ProblemError(
            f"{self.path}: holds {len(self._family)} sources ({names}); say which, as recording.sources[{first!r}]"
        )

    @property
    def events(self) -> Events:
        raise self._refusal()

    @property
    def registers(self) -> dict[str, Any]:
        raise self._refusal()

    @property
    def register_changes(self) -> tuple[tuple[int, dict[str, Any]], ...]:
        raise self._refusal()

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        raise self._refusal()

    @property
    def held(self) -> NDArray[np.uint16]:
        raise self._refusal()

    @property
    def clock(self) -> Clock:
        raise self._refusal()

    @property
    def datagrams(self) -> Datagrams:
        raise self._refusal()

    @property
    def notes(self) -> tuple[Note, ...]:
        return next(iter(self._family.values())).notes

    @property
    def zeroings(self) -> tuple[Zeroing, ...]:
        raise self._refusal()

    @property
    def detections(self) -> Detections:
        return next(iter(self._family.values())).detections

    @property
    def counts(self) -> dict[str, Any]:
        return {name: source.counts for name, source in self._family.items()}

    @property
    def verdict(self) -> str:
        return "; ".join(f"{name}: {source.verdict}" for name, source in self._family.items())

    @property
    def truncated(self) -> bool:
        return any(source.truncated for source in self._family.values())


class _OnClock(_Source):
    """A source with its times by another clock; the host's, where that is none."""

    def __init__(self, source: _Source, to: Clock | None) -> None:
        super().__init__(source.path, source.kind, source.array, source.origin)
        self.name, self.label = source.name, source.label
        self.of, self._own, self._to = source, _clock_of(source), to

    def _times(self, t: NDArray[np.int64]) -> NDArray[np.int64]:
        host = self._own.host_ns(np.asarray(t, np.int64))
        return np.asarray((host + 500) // 1000 if self._to is None else self._to.board_us_at(host), np.int64)

    def _time(self, t: int) -> int:
        return int(self._times(np.array([t]))[0])

    @property
    def holds_events(self) -> bool:
        return self.of.holds_events

    @cached_property
    def events(self) -> Events | None:
        of = self.of.events
        if of is None:
            return None
        more: dict[str, Any] = {"array": of.array, "repaired": of.repaired}
        if of.intensity is not None:
            more |= {"intensity": of.intensity, "present": of.present}
        markers = [(self._time(t), start) for t, start in of.markers]
        return Events(self._times(of.t), of.x, of.y, of.p, markers=markers, **more)

    @cached_property
    def frames(self) -> Frames | None:
        of = self.of.frames
        return None if of is None else Frames(of.values, _ascending(self._times(of.t)), unit=of.unit, array=of.array)

    @property
    def registers(self) -> dict[str, Any] | None:
        return self.of.registers

    @property
    def register_changes(self) -> tuple[tuple[int, dict[str, Any]], ...]:
        return self.of.register_changes

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        return tuple(replace(c, t=None if c.t is None else self._time(c.t)) for c in self.of.board_changes)

    def moved(self, notes: tuple[Note, ...]) -> tuple[Note, ...]:
        return tuple(replace(note, t=None if note.t is None else self._time(note.t)) for note in notes)

    @property
    def notes(self) -> tuple[Note, ...]:
        return self.moved(self.of.notes)

    @property
    def zeroings(self) -> tuple[Zeroing, ...]:
        return tuple(replace(one, t=self._time(one.t)) for one in self.of.zeroings)

    @property
    def detections(self) -> Detections:
        of = self.of.detections
        return Detections._of(of.label, self._times(of.t), self._times(of.known), of.slope, repaired=of.repaired)

    @property
    def clock(self) -> Clock:
        return Clock(self._times(self._own.board_us), self._own.arrived_ns)

    @property
    def held(self) -> NDArray[np.uint16] | None:
        return self.of.held

    @property
    def counts(self) -> dict[str, Any]:
        return self.of.counts

    @property
    def verdict(self) -> str:
        return self.of.verdict

    @property
    def truncated(self) -> bool:
        return self.of.truncated

    @property
    def rebuilt(self) -> dict[str, int]:
        return self.of.rebuilt


def _ascending(t: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times of pictures, of which two at one time follow one another by 1 us."""
    steps = np.arange(len(t))
    return np.maximum.accumulate(t - steps) + steps if len(t) else t
