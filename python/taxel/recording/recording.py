"""An opened recording: its events or frames, their times, and what was lost."""

from __future__ import annotations

import weakref
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance, several, shown, text, window
from taxel._base.drawing import draw
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped, plain
from taxel._core import ProblemError
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.between import Slices, between, inside
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.contents import Contents, FrameSource, S, Stream, refuse_several
from taxel.recording.frames import as_frames, at_rate, calibrate
from taxel.recording.gaps import Gaps, gaps_of, with_gaps
from taxel.recording.kinds import kind_of_file, verdict_of
from taxel.recording.on_clock import on_clock
from taxel.recording.once import UNKNOWN, Once, known
from taxel.recording.raw import Datagrams
from taxel.recording.sections import Wire
from taxel.recording.verdict import Verdict
from taxel.tare import Tare
from taxel.wire import Registers

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Recording:
    """Hold an opened file; each attribute is read at its first access.

    Made by `taxel.open`.

    Parameters
    ----------
    contents : Contents
        The contents that `taxel.open` read.

    Attributes
    ----------
    path : Path
    name : str
        The file's name; for a trial in a file of another format its name in that file.
    kind : str
        "mcap", "lsa", "npz", "csv" or "h5"; one of `taxel.formats.FORMATS` for another format; "merged" for the
        result of `taxel.merge`.
    array : Array
        The sensor.
    source : str
        The origin of the bytes, as the file states it.

    Raises
    ------
    ProblemError : built by hand; a recording is opened

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.mcap"
    >>> events = taxel.Events([0, 192], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> taxel.convert(events, place)
    []
    >>> rec = taxel.open(place)
    >>> rec
    Recording(two.mcap: 2 events, 0 to 192 us, 8 x 8 taxels)
    >>> rec.events == events
    True
    >>> rec.verdict
    'nothing lost'
    """

    def __init__(self, contents: Contents) -> None:
        if not isinstance(contents, Contents):
            raise refused("contents", f" is {shown(contents)}: to open a recording, call taxel.open(path)")
        self._contents = contents
        main = contents.main
        self.path, self.name, self.kind = main.origin.path, main.origin.name, main.origin.kind
        self.array, self.source = main.sensor.array, main.origin.source
        self._cut_from: tuple[weakref.ref[Recording], float, float] | None = None
        self._gaps: Once[Gaps | None] = Once(lambda: None if contents.is_several else gaps_of(main))

    path: Path
    name: str
    kind: str
    array: Array
    source: str

    @property
    def events(self) -> Events:
        """The changes at taxels.

        Raises
        ------
        ProblemError : the file holds frames
        """
        events = self._contents.main.table
        if not isinstance(events, Events):
            raise ProblemError(f"{self.path}: contains frames and no events; call frames()")
        return events

    def frames(self, rate_hz: float | None = None) -> Frames:
        """Return frames over time.

        Parameters
        ----------
        rate_hz : float, above 0, optional
            Frames a second, with a period rounded to whole us; default: a file of frames returns its own, one of
            events 100 a second.

        Returns
        -------
        Frames
            For events: the held intensities, beginning with `held`, or with 0; for frames: the last at each time.

        Raises
        ------
        ProblemError : an invalid rate, or events without intensities
        """
        return as_frames(self._contents.main, rate_hz).table

    @property
    def sources(self) -> dict[str, Recording]:
        """The sources of the file by name, in their order in the file, each with its own clock.

        Each is a recording that every function accepts. A file of one board has one source. In a file of one board and
        streams of numbers (an IMU) the events, frames and other attributes are those of the board, except the verdict,
        which is of all; in a file of several boards they raise an error that names the sources.

        Raises
        ------
        ProblemError : a slice by the clock of one source, as the other sources have other clocks
        """
        sources = self._contents.sources
        return {name: self if len(sources) == 1 else Recording(Contents(sources[name], sources)) for name in sources}

    def on_clock(self, name: str) -> Recording:
        """Return the same recording with the times of all sources by the clock of a single source, or of the host.

        No other function converts times between clocks (`clock`): without this call each source has its own.

        Parameters
        ----------
        name : str
            A source, or "host" for times in us since 1970.

        Raises
        ------
        ProblemError : no such source, one without arrival times, or a slice by another clock

        Examples
        --------
        After ``both = taxel.open("two.mcap").on_clock("left")`` the times of ``both.sources["right"].events`` are in us
        of the board "left".
        """
        return Recording(on_clock(self._contents, text("name", name)))

    @property
    def held(self) -> NDArray[np.float32] | None:
        """The values of the taxels at its beginning, ticks, shape (rows, columns); NaN without any event before.

        None if they are unknown. A recording that begins in mid-stream stores them, as a taxel without changes would
        otherwise be unknown; for a slice they follow from the events before it. `frames` begins with them, and so do
        encoders and readouts whose argument is the recording (not its events alone).
        """
        held = self._contents.main.settings.held()
        return None if held is None else np.where(held == UNKNOWN, np.nan, held).astype(np.float32)

    @property
    def calibration(self) -> Calibration | None:
        """The calibration in the file's folder (`Calibration.beside`); None if there is none.

        Raises
        ------
        FormatError : it cannot be read
        ProblemError : it is of another array, or of readings in another unit
        """
        return self._contents.main.sensor.calibration()

    def calibrated(self, rate_hz: float | None = None, rest: Tare | None = None) -> Frames:
        """Return frames in N or kPa, by the calibration in the file's folder.

        Parameters
        ----------
        rate_hz : float, above 0, optional
            As in `frames`.
        rest : Tare, optional
            Today's rest; default: the calibration's own.

        Raises
        ------
        ProblemError : no calibration is beside it, or a calibration of another array
        """
        return calibrate(self._contents.main, rate_hz, rest).table

    @property
    def side(self) -> str:
        """The foot or hand of the sensor, "left" or "right"; "" if not stated."""
        return self._contents.main.sensor.side

    @property
    def heel(self) -> str:
        """Place of the heel on the sensor, "top" or "bottom"; "" if not stated."""
        return self._contents.main.sensor.heel

    @property
    def is_slice(self) -> bool:
        """Whether this is a slice of the file, made by `between`."""
        return self._contents.main.timing.interval is not None

    @property
    def interval(self) -> tuple[int, int] | None:
        """The first time and the end of a slice, us; None for a whole file."""
        interval = self._contents.main.timing.interval
        return None if interval is None else interval()

    @property
    def is_several(self) -> bool:
        """Whether its events or frames are those of its `sources` alone."""
        return self._contents.is_several

    @property
    def has_events(self) -> bool:
        """Whether the file holds events (else frames)."""
        return self._contents.main.has_events

    @property
    def timed(self) -> bool:
        """Whether it has times; else its frames are numbered: the time of frame k is k us (`at_rate`)."""
        return not self._contents.main.untimed

    @property
    def label(self) -> str:
        """The name of the source within its file, such as "left"; "" for a file of several sensors as a whole."""
        return self._contents.main.origin.label

    @property
    def title(self) -> str:
        """The path, with the name of the source or of the trial where the file holds several."""
        path, sources = str(self.path), inside(self._contents.sources)
        if self.label and sum(not isinstance(source, Stream) for source in sources.values()) > 1:
            return f"{path} {self.label}"
        return path if path.endswith(self.name) else f"{path}, {self.name}"

    @property
    def notes(self) -> tuple[Note, ...]:
        """The notes of the file in its order, followed by the labels of its folder and of `NAME.notes.csv`.

        A note of the file that a label of `NAME.notes.csv` replaces (`replaces_us`) is left out.

        Raises
        ------
        FormatError : an invalid table of labels (names the line)
        """
        return self._contents.main.marks.notes()

    @property
    def zeroings(self) -> tuple[Zeroing, ...]:
        """Taxels that people zeroed while recording, in order; a slice includes those before it, which still apply."""
        return self._contents.main.marks.zeroings()

    @property
    def detections(self) -> Detections:
        """The detections of a readout while recording."""
        return self._contents.main.marks.detections()

    @property
    def registers(self) -> Registers | None:
        """The board's registers at the beginning; None if the file does not have them.

        They are those of the whole sensor (`Registers.array`), even if the recording is a part of it.
        """
        return self._contents.main.settings.registers()

    @property
    def frame_us(self) -> float | None:
        """The length of a frame, us, as the board's registers or a source of frames state it; None if none does."""
        if (registers := self.registers) is not None:
            return registers.frame_us
        main = self._contents.main
        return main.frame_table.frame_us if isinstance(main, FrameSource) else None

    @property
    def _turned(self) -> float | None:
        """The number that readings were subtracted from, as a layout says; None of others."""
        main = self._contents.main
        return main.frame_table.turned if isinstance(main, FrameSource) else None

    @property
    def register_changes(self) -> tuple[tuple[int, Registers], ...]:
        """The registers at each change while recording, with the host's time (ns since 1970)."""
        return self._contents.main.settings.register_changes()

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        """Resets of the board and changes of its version of the wire, as detected while recording."""
        return self._contents.main.marks.board_changes()

    @property
    def clock(self) -> Clock | None:
        """Arrival times against board time; None if the file has no arrival times."""
        return self._contents.main.timing.clock()

    @property
    def columns(self) -> list[str]:
        """The names of the columns of a stream of numbers, in the order of `frames`.

        Raises
        ------
        ProblemError : the recording is not a stream of numbers
        """
        columns = self._contents.main.columns
        if columns is None:
            raise ProblemError(f"{self.path}: source {self.label!r} is not a stream of numbers, so it has no columns")
        return list(columns)

    @property
    def is_stream(self) -> bool:
        """Whether it is a stream of numbers, such as that of an IMU, instead of an array of taxels."""
        return self._contents.main.columns is not None

    @property
    def is_on_clock(self) -> bool:
        """Whether times were converted to another clock by `on_clock`."""
        return self._contents.main.timing.clock_of is not None

    def datagrams(self) -> Datagrams:
        """Return the raw datagrams as received; a slice returns all those of the file.

        Raises
        ------
        ProblemError : there are none: a stream, a part of a sensor, or a kind of file that does not hold them
        """
        refuse_several(self._contents.main)
        datagrams = self._contents.main.section(Wire).datagrams()
        if datagrams is not None:
            return datagrams
        if self.is_stream:
            why = f"source {self.label!r} is a stream of numbers, which has lines and no datagrams"
        elif self.kind == "mcap":
            why = "a part of the sensor has no datagrams; the datagrams of the file belong to the whole sensor"
        else:
            why = f"the {kind_of_file(self.kind)} contains no datagrams; only a .mcap does"
        raise ProblemError(f"{self.path}: {why}")

    @property
    def counts(self) -> dict[str, Any]:
        """The numbers of the counts of received and lost data, by cause."""
        return dict(self._contents.main.losses.counts())

    @property
    def verdict(self) -> Verdict:
        """Losses at each stage: a line of text, with a status and numbers by cause (`taxel.Verdict`).

        A part of a file has the verdict of the whole file. Only gaps of frames with times, and gaps in the events of a
        camera, are those of the part; they are in the verdict if the file does not state what was lost. The page *What
        the output means* lists statuses, causes and wordings; `remarks` has further facts.
        """
        each = self.sources if self.is_several else {self.label: self}
        return with_gaps(verdict_of(self._contents.main), {name: source._gaps() for name, source in each.items()})

    @property
    def remarks(self) -> tuple[str, ...]:
        """Further facts, one line each: the clock of its times, what was left out, what it was converted from.

        `.mcap`, `.npz` and `.h5` store it.

        Examples
        --------
        >>> import pathlib, tempfile, taxel
        >>> folder = pathlib.Path(tempfile.mkdtemp())
        >>> _ = taxel.convert(taxel.Frames([[[1.0, 2.0]]], [0]), folder / "one.npz")
        >>> _ = taxel.convert(folder / "one.npz", folder / "one.mcap")
        >>> one = taxel.open(folder / "one.mcap")
        >>> one.verdict, one.remarks
        ('losses unknown: the .npz does not record them', ('converted from one.npz',))
        """
        return self._contents.main.losses.remarks

    @property
    def lost(self) -> tuple[str, ...]:
        """Information that functions could not carry over from the original recording, one line each.

        Cutting, merging, converting and similar functions add to it, and `.mcap`, `.npz` and `.h5` store it. It is
        empty for an original file. Losses while recording are in `verdict`.

        Examples
        --------
        >>> import pathlib, tempfile, taxel
        >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.mcap"
        >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
        >>> _ = taxel.convert(events, place)
        >>> whole = taxel.open(place)
        >>> [half] = taxel.cut(whole, columns=slice(0, 4))
        >>> whole.lost, half.lost
        ((), ('raw datagrams',))
        """
        return self._contents.main.losses.lost()

    @property
    def truncated(self) -> bool:
        """Whether the last data are missing: the writer was killed, or the file was cut within its data."""
        return self._contents.main.losses.truncated

    @property
    def rebuilt(self) -> dict[str, int]:
        """Counts of damage found while reading: cut bytes at the end, gaps, bytes skipped, bad and large chunks.

        A missing or damaged summary (`no_summary`) and damaged final counts (`no_end`) count 1.
        """
        return dict(self._contents.main.losses.rebuilt())

    def between(self, start: float, stop: float) -> Recording:
        """Return the slice of ``start <= t < stop`` (us of the board's clock).

        Notes without a time are dropped and listed in its `lost`.

        Parameters
        ----------
        start, stop : float, us

        Raises
        ------
        ProblemError : a start after the stop, or a time that is not a number

        Examples
        --------
        >>> import pathlib, tempfile, taxel
        >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.npz"
        >>> events = taxel.Events([0, 192], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
        >>> _ = taxel.convert(events, place)
        >>> taxel.open(place).between(100, 200)
        Recording(two.npz: 1 event, 192 to 192 us, 8 x 8 taxels)
        """
        time_slice = Recording(between(self._contents, *window("us", start, stop)))
        # A weak reference, so that a slice does not hold what it was taken from.
        time_slice._cut_from = weakref.ref(self), start, stop
        return time_slice

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_cut_from": None}

    def _why_empty(self) -> str:
        """Return where the events or frames of a recording are of which an empty slice was taken."""
        if self._cut_from is None:
            return f": {self.title} is empty"
        reference, start, stop = self._cut_from
        bounds, recording = f" from {plain(start)} to {plain(stop)} us", reference()
        if recording is None:
            return f"{bounds} of {self.title}"
        t = recording._contents.main.table.t
        return f"{bounds}: {recording.title} " + (f"is from {t.min()} to {t.max()} us" if len(t) else "is empty")

    def at_rate(self, rate_hz: float) -> Recording:
        """Return the same recording of numbered frames with times: `rate_hz` frames per second, the first at 0.

        Parameters
        ----------
        rate_hz : float, Hz, above 0, at most 1 000 000

        Raises
        ------
        ProblemError : it has times (`timed`), or the rate is invalid

        Examples
        --------
        >>> import pathlib, tempfile, taxel
        >>> from taxel.recording.contents import Contents, source_from
        >>> from taxel.recording.sections import Origin
        >>> frames = taxel.Frames([[[1.0]], [[2.0]]], [0, 1])
        >>> numbered = source_from(frames, Origin(pathlib.Path("grasp"), "grasp", "icub"), untimed=True)
        >>> taxel.Recording(Contents.single(numbered)).at_rate(50).frames().t
        array([    0, 20000])
        """
        return Recording(at_rate(self._contents, rate_hz))

    def with_notes(self, notes: Iterable[Note]) -> Recording:
        """Return the same recording with further notes.

        Parameters
        ----------
        notes : iterable of Note

        Raises
        ------
        ProblemError : something that is not a `taxel.Note`
        """
        more = tuple(instance("notes", note, Note) for note in several("notes", notes))
        return Recording(with_notes(self._contents, known(more)))

    def plot(self) -> Figure:
        """Draw events (or the sum of pressure) over time, and the activity of each taxel."""
        return draw("overview", self)  # type: ignore[no-any-return]

    def _repr_html_(self) -> str:
        return draw("html", self)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        contents = self._contents
        if contents.is_several:
            return escaped(f"Recording({self.name}: {len(contents.sources)} sources: {', '.join(contents.sources)})")
        table = contents.main.table
        noun = "event" if self.has_events else "frame"
        time = f"{int(table.t.min())} to {int(table.t.max())} us" if len(table) and self.timed else "no time"
        more = [counted(len(self.notes), "note")] * bool(self.notes)
        more += [counted(len(self.detections), "detection")] * bool(len(self.detections))
        more += [counted(len(self.zeroings), "zeroed taxel")] * bool(self.zeroings)
        more += ["truncated"] * self.truncated
        others = (
            [] if self.is_slice and not self.is_on_clock else [name for name in contents.sources if name != self.label]
        )
        more += [f"beside {', '.join(others)}"] * bool(others)
        size = f"{self.array.rows} x {self.array.columns} taxels"
        return escaped(f"Recording({self.name}: {', '.join([counted(len(table), noun), time, size, *more])})")


def with_notes(contents: Contents, more: Once[tuple[Note, ...]]) -> Contents:
    """Return the same contents with further notes."""
    label, sources = contents.main.origin.label, contents.sources
    if label in sources:
        source = add_notes(inside(sources)[label], more)
        sources = sources.but(label, source) if isinstance(sources, Slices) else {**sources, label: source}
    return Contents(add_notes(contents.main, more), sources)


def add_notes(source: S, more: Once[tuple[Note, ...]]) -> S:
    """Return the same source with further notes; one of the same text and time as another is that note."""

    def notes() -> tuple[Note, ...]:
        there = source.marks.notes()
        held = {(note.text, note.t) for note in there if note.t is not None}
        return there + tuple(note for note in more() if (note.text, note.t) not in held)

    return replace(source, marks=replace(source.marks, notes=Once(notes)))
