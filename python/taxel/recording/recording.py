"""An opened recording: its events or frames, their times, and what was lost."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
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
from taxel.reading import BoardChange, Datagrams, Reader, Zeroing, kind_of_file
from taxel.recording.frames import FRAMES_HZ, Gaps, gaps_of, period_us, with_gaps
from taxel.recording.source import SourceView, one_clock, share_clock
from taxel.tare import Tare
from taxel.verdict import Verdict
from taxel.wire import Registers

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Recording:
    """Hold an opened file; each attribute is read at its first access.

    Made by `taxel.open`.

    Parameters
    ----------
    sources : mapping from str to SourceView
        The sources of the file by name.

    Attributes
    ----------
    path : Path
    name : str
        The file's name; for a trial in a file of another format its name in that file.
    kind : str
        "mcap", "lsa", "npz", "csv" or "h5"; the name of another format; "merged" for the result of `taxel.merge`.
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

    def __init__(self, sources: Mapping[str, SourceView]) -> None:
        named = sources if isinstance(sources, Mapping) else {}
        if not named or not all(isinstance(source, SourceView) for source in named.values()):
            raise refused("sources", f" is {shown(sources)}: to open a recording, call taxel.open(path)")
        self._sources = dict(named)
        sensors = [source for source in named.values() if not source.facts.columns]
        self._main = (sensors or [*named.values()])[0]
        #: Whether its events or frames are those of its `sources` alone.
        self.is_several = len(named) > 1 and len(sensors) != 1
        facts = self._main.facts
        label = f" {facts.label}"
        self.path, self.kind, self.source, self.array = facts.path, facts.kind, facts.source, self._main.array
        # A source is named after its file and itself.
        self.name = facts.name.removesuffix(label) if self.is_several else facts.name

    @classmethod
    def of(cls, *readers: Reader) -> Recording:
        """Return the recording of the sources that readers read.

        Parameters
        ----------
        *readers : Reader

        Examples
        --------
        >>> import taxel
        >>> from taxel.reading import Facts, InMemory
        >>> frames = taxel.Frames([[[1.0, 2.0]]], [0], unit="N")
        >>> Recording.of(InMemory(Facts(path=Path("press.txt"), array=frames.array), frames))
        Recording(press.txt: 1 frame, 0 to 0 us, 1 x 2 taxels)
        """
        sources = {reader.facts.label: SourceView(reader) for reader in readers}
        if sum(not source.facts.columns for source in sources.values()) > 1:
            for label, source in sources.items():
                if not source.facts.columns:
                    sources[label] = source.stated(name=f"{source.facts.name} {label}")
        return cls(sources)

    path: Path
    name: str
    kind: str
    array: Array
    source: str
    is_several: bool

    @property
    def _only(self) -> SourceView:
        """The only sensor; of several an error that lists them."""
        if self.is_several:
            first = next(iter(self._sources))
            raise ProblemError(
                f"{self.path}: contains {len(self._sources)} sources ({', '.join(self._sources)}); choose one with "
                f"recording.sources[{first!r}], or write one to a separate file with taxel convert --source NAME"
            )
        return self._main

    def _each(self, change: Callable[[SourceView], SourceView]) -> Recording:
        """Return the recording with each source changed."""
        return Recording({name: change(source) for name, source in self._sources.items()})

    @property
    def events(self) -> Events:
        """The changes at taxels.

        Raises
        ------
        ProblemError : the file holds frames, or several sensors
        """
        events = self._only.table
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
        period = None if rate_hz is None else period_us("rate_hz", rate_hz)
        source = self._only
        if period is not None and not self.timed:
            raise ProblemError(
                f"{self.path}: the frames have no times, so their rate is unknown; to give one, call recording.at_rate"
            )
        table = source.table
        if isinstance(table, Frames):
            return table if period is None else table._resampled(period)
        held = source.marks.held
        ends = () if source.interval is None else source.interval
        period = round(1e6 / FRAMES_HZ) if period is None else period
        return Frames.from_events(table, period, *ends, held=None if held is None else np.nan_to_num(held))

    @property
    def sources(self) -> dict[str, Recording]:
        """The sources of the file by name, in their order in the file, each with its own clock.

        Each is a recording that every function accepts. A file of one board has one source. In a file of one board and
        streams of numbers (an IMU) the events, frames and other attributes are those of the board, except the verdict,
        which is of all; in a file of several boards they raise an error that names the sources.
        """
        if len(self._sources) == 1:
            return dict.fromkeys(self._sources, self)
        return {name: Recording({name: source}) for name, source in self._sources.items()}

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
        return Recording(one_clock(self._sources, text("name", name)))

    @property
    def held(self) -> NDArray[np.float32] | None:
        """The values of the taxels at its beginning, ticks, shape (rows, columns); NaN without any event before.

        None if they are unknown. A recording that begins in mid-stream stores them, as a taxel without changes would
        otherwise be unknown; for a slice they follow from the events before it. `frames` begins with them, and so do
        encoders and readouts whose argument is the recording (not its events alone).
        """
        return self._only.marks.held

    @property
    def calibration(self) -> Calibration | None:
        """The calibration in the file's folder (`Calibration.beside`); None if there is none.

        Raises
        ------
        FormatError : it cannot be read
        ProblemError : it is of another array, or of readings in another unit
        """
        source, file = self._only, Calibration.beside(self.path)
        return None if file is None or source.facts.columns else self._fitting(file)

    def _fitting(self, path: Path) -> Calibration:
        """Return the calibration of a file; refuse one of another array or of readings in another unit."""
        calibration, array, view = Calibration.load(path), self._only.facts.array, self._only.view
        table = None if self.has_events else self._only.table
        unit = table.unit if isinstance(table, Frames) else "ticks"
        if not calibration.array.fits(array) or calibration.reading_unit != unit:
            raise ProblemError(
                f"{path}: the calibration is for {calibration.reading_unit} of {calibration.array!r}; {self.name} "
                f"contains {unit} of {array!r}; where several sensors share a folder, name it after its recording"
            )
        is_part = view.columns is not None or view.rows is not None
        whole = slice(None)
        return calibration._region(view.columns or whole, view.rows or whole) if is_part else calibration

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
        calibration = self.calibration
        if calibration is None:
            raise ProblemError(
                f"{self.path}: no calibration was found beside it, so the values cannot be converted to N or kPa; to "
                "make a calibration, run taxel calibrate"
            )
        return calibration.apply(self.frames(rate_hz), rest)

    def _calibrated_by(self, path: Path) -> Recording:
        """Return the recording, or each sensor of one with several, as frames in N or kPa by a calibration file.

        Raises
        ------
        FormatError : it cannot be read
        ProblemError : it is of another array than the recording, or of readings in another unit
        """

        def calibrated(source: SourceView) -> SourceView:
            if source.facts.columns:
                return source
            one = Recording({source.facts.label: source})
            return SourceView(source.in_memory(one._fitting(path).apply(one.frames())))

        return self._each(calibrated)

    @property
    def side(self) -> str:
        """The foot or hand of the sensor, "left" or "right"; "" if not stated."""
        return self._main.facts.side

    @property
    def range_end(self) -> float | None:
        """The value at which the range of a taxel ends, in the unit of the frames; None if no file states it."""
        return self._main.facts.range_end

    @property
    def heel(self) -> str:
        """Place of the heel on the sensor, "top" or "bottom"; "" if not stated."""
        return self._main.facts.heel

    @property
    def episode(self) -> int | None:
        """The number of the trial in a data set whose tables have one; else None."""
        return self._main.facts.episode

    @property
    def is_slice(self) -> bool:
        """Whether this is a slice of the file, made by `between`."""
        return self._main.view.is_slice

    @property
    def interval(self) -> tuple[int, int] | None:
        """The first time and the end of a slice, us; None for a whole file."""
        return self._main.interval

    @property
    def has_events(self) -> bool:
        """Whether the file holds events (else frames)."""
        return not share_clock(self._sources) if self.is_several else self._main.facts.has_events

    @property
    def timed(self) -> bool:
        """Whether it has times; else its frames are numbered: the time of frame k is k us (`at_rate`)."""
        return self._main.facts.timed

    @property
    def label(self) -> str:
        """The name of the source within its file, such as "left"; "" for a file of several sensors as a whole."""
        return "" if self.is_several else self._main.facts.label

    @property
    def title(self) -> str:
        """The path, with the name of the source or of the trial where the file holds several."""
        path, in_file = str(self.path), f"{self.path.name} {self.label}"
        if self.name == in_file:
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
        return self._main.marks.notes

    @property
    def zeroings(self) -> tuple[Zeroing, ...]:
        """Taxels that people zeroed while recording, in order; a slice includes those before it, which still apply."""
        return self._only.marks.zeroings

    @property
    def detections(self) -> Detections:
        """The detections of a readout while recording."""
        return self._main.marks.detections

    @property
    def registers(self) -> Registers | None:
        """The board's registers at the beginning; None if the file does not have them.

        They are those of the whole sensor (`Registers.array`), even if the recording is a part of it.
        """
        return self._only.marks.registers

    @property
    def frame_us(self) -> float | None:
        """The length of a frame, us, as the board's registers or a source of frames state it; None if none does."""
        if (registers := self.registers) is not None:
            return registers.frame_us
        return self._main.facts.frame_us

    @property
    def _turned(self) -> float | None:
        """The number that readings were subtracted from, as a layout says; None of others."""
        return self._main.facts.turned

    @property
    def register_changes(self) -> tuple[tuple[int, Registers], ...]:
        """The registers at each change while recording, with the host's time (ns since 1970)."""
        return self._only.marks.settings

    @property
    def board_changes(self) -> tuple[BoardChange, ...]:
        """Resets of the board and changes of its version of the wire, as detected while recording."""
        return self._only.marks.changes

    @property
    def clock(self) -> Clock | None:
        """Arrival times against board time; None if the file has no arrival times."""
        return self._only.clock

    @property
    def columns(self) -> list[str]:
        """The names of the columns of a stream of numbers, in the order of `frames`.

        Raises
        ------
        ProblemError : the recording is not a stream of numbers
        """
        columns = self._main.facts.columns
        if self.is_several or not columns:
            raise ProblemError(f"{self.path}: source {self.label!r} is not a stream of numbers, so it has no columns")
        return list(columns)

    @property
    def is_stream(self) -> bool:
        """Whether it is a stream of numbers, such as that of an IMU, instead of an array of taxels."""
        return not self.is_several and bool(self._main.facts.columns)

    def datagrams(self) -> Datagrams:
        """Return the raw datagrams as received.

        Raises
        ------
        ProblemError : there are none: a stream, a part of a recording, or a kind of file that does not hold them
        """
        received = self._only.received if self.kind == "mcap" else None
        if isinstance(received, Datagrams):
            return received
        if self.is_stream:
            why = f"source {self.label!r} is a stream of numbers, which has no datagrams"
        elif self._main.facts.raw == "datagrams" and self.kind == "mcap":
            why = "a part of the recording has no datagrams; those of the file belong to the whole"
        else:
            why = f"the {kind_of_file(self.kind)} contains no datagrams; only a .mcap does"
        raise ProblemError(f"{self.path}: {why}")

    @property
    def counts(self) -> dict[str, Any]:
        """The numbers of the counts of received and lost data, by cause."""
        if self.is_several:
            return {name: dict(source.counts) for name, source in self._sources.items()}
        return dict(self._main.counts)

    @property
    def verdict(self) -> Verdict:
        """Losses at each stage: a line of text, with a status and numbers by cause (`taxel.Verdict`).

        A part of a file has the verdict of the whole file. Only gaps of frames with times are those of the part; they
        are in the verdict if the file does not state what was lost. The page *What the output means* lists statuses,
        causes and wordings; `remarks` has further facts.
        """
        gaps = {name: Recording({name: source})._gaps for name, source in self._sources.items()}
        verdicts = [(name, source.verdict) for name, source in self._sources.items()]
        verdict = verdicts[0][1] if len(verdicts) == 1 else Verdict._of_sources(verdicts)
        return with_gaps(verdict, gaps)

    @cached_property
    def _gaps(self) -> Gaps | None:
        """The gaps of frames with times; None without any. A board sends nothing where nothing changes."""
        if self.is_several or self.has_events or not self.timed:
            return None
        return gaps_of(self._main.table.t)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Further facts, one line each: the clock of its times, what was left out, what it was converted from.

        A `.mcap` stores it.

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
        each = {name: source.facts.remarks for name, source in self._sources.items()}
        if not self.is_several or len(set(each.values())) == 1:
            return self._main.facts.remarks
        return tuple(f"{name}: {line}" for name, lines in each.items() for line in lines)

    @property
    def lost(self) -> tuple[str, ...]:
        """Information that functions could not carry over from the original recording, one line each.

        A part of a file has no raw datagrams; a `.mcap` stores these lines. It is empty for an original file. Losses
        while recording are in `verdict`.

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
        chosen = self._sources.values() if self.is_several else [self._main]
        return tuple(dict.fromkeys(line for source in chosen for line in source.lost))

    @property
    def truncated(self) -> bool:
        """Whether the last data are missing: the writer was killed, or the file was cut within its data."""
        return any(source.facts.truncated for source in self._sources.values())

    @property
    def rebuilt(self) -> dict[str, int]:
        """Counts of damage found while reading: cut bytes at the end, gaps, bytes skipped, bad and large chunks."""
        return dict(self._main.reader.damage())

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
        start, stop = window("us", start, stop)
        chosen = self._sources
        if len(chosen) > 1 and not share_clock(chosen):
            # The interval is by the clock of the only sensor.
            if self.is_several:
                raise ProblemError(
                    f"{self.path}: the sources ({', '.join(chosen)}) have different clocks, so one interval does not "
                    "fit all; call on_clock(name) before between"
                )
            label = self._main.facts.label
            others = tuple(f"the source {name} (it has another clock)" for name in chosen if name != label)
            chosen = {label: self._main.stated(lost=(*self._main.facts.lost, *others))}
        return Recording({name: source.between(start, stop) for name, source in chosen.items()})

    def _why_empty(self) -> str:
        """Return where the events or frames of a recording are of which an empty slice was taken."""
        view, t = self._main.view, self._main._whole.table.t
        if not view.is_slice:
            return f": {self.title} is empty"
        bounds = f" from {plain(view.start)} to {plain(view.stop)} us"
        return f"{bounds}: {self.title} " + (f"is from {t.min()} to {t.max()} us" if len(t) else "is empty")

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
        >>> import pathlib, taxel
        >>> from taxel.reading import Facts, InMemory
        >>> frames = taxel.Frames([[[1.0]], [[2.0]]], [0, 1])
        >>> facts = Facts(path=pathlib.Path("grasp"), array=frames.array, kind="icub", timed=False)
        >>> taxel.Recording.of(InMemory(facts, frames)).at_rate(50).frames().t
        array([    0, 20000])
        """
        period_us("rate_hz", rate_hz)
        if self.timed:
            raise ProblemError(f"{self.path}: the frames have times; a rate is only for frames without times")
        return self._each(lambda source: source.at_rate(rate_hz))

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
        label = self._main.facts.label
        return Recording({**self._sources, label: self._main.with_notes(more)})

    def plot(self) -> Figure:
        """Draw events (or the sum of pressure) over time, and the activity of each taxel."""
        return draw("overview", self)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        if self.is_several:
            return escaped(f"Recording({self.name}: {len(self._sources)} sources: {', '.join(self._sources)})")
        table = self._main.table
        noun = "event" if self.has_events else "frame"
        time = f"{int(table.t.min())} to {int(table.t.max())} us" if len(table) and self.timed else "no time"
        more = [counted(len(self.notes), "note")] * bool(self.notes)
        more += [counted(len(self.detections), "detection")] * bool(len(self.detections))
        more += [counted(len(self.zeroings), "zeroed taxel")] * bool(self.zeroings)
        more += ["truncated"] * self.truncated
        others = [name for name in self._sources if name != self.label]
        more += [f"beside {', '.join(others)}"] * bool(others)
        size = f"{self.array.rows} x {self.array.columns} taxels"
        return escaped(f"Recording({self.name}: {', '.join([counted(len(table), noun), time, size, *more])})")
