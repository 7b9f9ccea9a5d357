"""What a recording holds: of each source a header in common, and a board's events, frames, or a stream of numbers.

A source consists of parts. What a function (`between`, `merge`, `convert` ...) does with a field follows from the type
of the part that it stands in: each function has a rule for every type in `Part`, which the type checker demands.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Generic, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.notes import BoardChange, Datagrams, Samples, Zeroing
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

__all__ = [
    "UNKNOWN", "Board", "Changes", "Contents", "Lines", "Losses", "Marks", "Once", "Origin", "Part", "Pictures",
    "Readings", "Sensor", "Settings", "Several", "Source", "Stream", "Timing", "Wire", "alone", "anything", "applied",
    "known", "named", "several", "source_from", "together",
]  # fmt: skip

T = TypeVar("T")
U = TypeVar("U")
P = TypeVar("P", bound="Part")
S = TypeVar("S", bound="Source")

#: The held value, in files, of a taxel without any event so far.
UNKNOWN = _core.UNKNOWN


class Once(Generic[T]):
    """A value that is read at the first call, and cached.

    Parameters
    ----------
    read : function without arguments
        Called once; after an error the next call tries again.
    holds : function without arguments, optional
        Whether the value holds anything, if that can be computed faster than the value itself.
    """

    def __init__(self, read: Callable[[], T], holds: Callable[[], bool] | None = None) -> None:
        self._read: Callable[[], T] | None = read
        self._holds = holds

    def __call__(self) -> T:
        """Return the value."""
        if self._read is not None:
            self._value = self._read()
            # Drop the function, so that what it refers to (another recording's contents) can be freed.
            self._read = self._holds = None
        return self._value

    @property
    def is_read(self) -> bool:
        """Whether the value is in memory."""
        return self._read is None

    def holds(self) -> bool:
        """Return whether the value holds anything."""
        return anything(self()) if self._holds is None else self._holds()

    def to(self, change: Callable[[T], U]) -> Once[U]:
        """Return a changed value, read at its first call, that holds something if this one does."""
        return Once(lambda: change(self()), self.holds)

    def __getstate__(self) -> dict[str, Any]:
        """Read and return the value, so that a pickle does not need the file."""
        return {"_read": None, "_holds": None, "_value": self()}


def known(value: T) -> Once[T]:
    """Return a value that needs no reading."""
    one = Once(lambda: value)
    one()
    return one


#: Defaults of fields of parts.
_NONE: Once[Any] = known(None)
_EMPTY: Once[Any] = known(())


def anything(value: object) -> bool:
    """Return whether a value holds any information."""
    match value:
        case Clock():
            return len(value.board_us) > 0
        case np.ndarray():
            return bool((value != UNKNOWN).any())
        case dict():
            return any(map(anything, value.values()))
        case Sized():
            return len(value) > 0
        case float():
            # 0.0 too is a number that readings are subtracted from.
            return True
    return bool(value)


@dataclass(frozen=True, eq=False)
class Origin:
    """Name a source.

    Parameters
    ----------
    path : Path
    name, kind, label : str
        The file's name (for a trial in a file of another format the name in that file); the kind of file; the name of
        the source within its file, "" for a file of several boards as a whole.
    source : str
        The origin of the bytes, such as an address or a port.
    """

    path: Path = Path()
    name: str = ""
    kind: str = "events"
    label: str = "board"
    source: str = ""

    def lines(self) -> list[str]:
        """Return what is lost without it."""
        return [f"where it came from ({self.source})"] * bool(self.source)


@dataclass(frozen=True, eq=False)
class Sensor:
    """Describe the sensor.

    Parameters
    ----------
    array : Array
    side : {"left", "right", ""}
        The foot or hand that the sensor is of.
    heel : {"top", "bottom", ""}
        Where on the sensor the heel lies.
    calibration : Calibration
    """

    array: Array
    side: str = ""
    heel: str = ""
    calibration: Once[Calibration | None] = _NONE

    def lines(self) -> list[str]:
        """Return what is lost without it, but for the array."""
        lines = [f"the side ({self.side})"] * bool(self.side)
        return lines + [f"where the heel lies ({self.heel})"] * bool(self.heel)


@dataclass(frozen=True, eq=False)
class Settings:
    """Hold the state of the board at the beginning, and how it was set.

    Parameters
    ----------
    held : uint16, shape (rows, columns), ticks
        The values that the taxels held; `UNKNOWN` for one without any event before.
    registers : Registers
        With the array that they drive: the whole sensor, even if the recording is a part of it.
    register_changes : tuple of (int ns since 1970, Registers)
    """

    held: Once[NDArray[np.uint16] | None] = _NONE
    registers: Once[Registers | None] = _NONE
    register_changes: Once[tuple[tuple[int, Registers], ...]] = _EMPTY

    def lines(self) -> list[str]:
        """Return what is lost without it."""
        held, changes = self.held(), self.register_changes()
        lines = [] if held is None else [f"what {counted(int(np.sum(held != UNKNOWN)), 'taxel')} held at the beginning"]
        lines = lines * self.held.holds() + ["the board's registers"] * (self.registers() is not None)
        return lines + [f"{counted(len(changes), 'setting')} of the registers"] * bool(changes)


@dataclass(frozen=True, eq=False)
class Marks:
    """Hold what happened at a time of the recording's clock."""

    board_changes: Once[tuple[BoardChange, ...]] = _EMPTY
    notes: Once[tuple[Note, ...]] = _EMPTY
    detections: Once[Detections] = field(default_factory=lambda: known(Detections([], [], [])))
    zeroings: Once[tuple[Zeroing, ...]] = _EMPTY

    def lines(self) -> list[str]:
        """Return what is lost without it."""
        changes, notes, detections = len(self.board_changes()), len(self.notes()), len(self.detections())
        lines = [f"{counted(changes, 'change')} of the board"] * bool(changes)
        lines += [counted(notes, "note")] * bool(notes) + [counted(detections, "detection")] * bool(detections)
        return lines + [counted(len(self.zeroings()), "zeroed taxel")] * bool(self.zeroings())


@dataclass(frozen=True, eq=False)
class Timing:
    """Relate the times to clocks.

    Parameters
    ----------
    clock : Clock
        Arrival times against the source's time.
    clock_of : str
        The name of the clock of all times, if it is not the source's own.
    stretch : (int, int), us
        The first time and the end of a part by time. One that is written to a file becomes a recording of its own.
    """

    clock: Once[Clock | None] = _NONE
    clock_of: str | None = None
    stretch: Once[tuple[int, int]] | None = None

    def lines(self) -> list[str]:
        """Return what is lost without it, but for arrival times."""
        return [f"by whose clock times are ({self.clock_of})"] * (self.clock_of is not None)


@dataclass(frozen=True, eq=False)
class Losses:
    """State what was lost.

    Parameters
    ----------
    counts : mapping
        What was received and lost, by cause.
    verdict : Verdict, or a line
        What was lost; None if that is not known.
    remarks : tuple of str
        What else there is to know: by whose times it is, what was left out, what it was converted from.
    truncated : bool
    rebuilt : mapping
        Counts of damage that the reader skipped or repaired.
    lost : tuple of str
        A line for each kind of information that functions could not carry over.
    """

    counts: Once[Mapping[str, Any]] = field(default_factory=lambda: known(dict[str, Any]()))
    verdict: Once[Verdict | str | None] = _NONE
    remarks: tuple[str, ...] = ()
    truncated: bool = False
    rebuilt: Once[Mapping[str, int]] = field(default_factory=lambda: known(dict[str, int]()))
    lost: Once[tuple[str, ...]] = _EMPTY

    def lines(self) -> list[str]:
        """Return what is lost without it."""
        counts = self.counts.holds()
        lines = ["what was received and lost, by cause"] * counts
        # With counts, this is what they say.
        lines += ["what was lost, in one line"] * (not counts and self.verdict() is not None)
        return lines + [f"the remark: {line}" for line in self.remarks] + self.damage()

    def damage(self) -> list[str]:
        """Return what is lost without a file's own damage."""
        return ["that its end is missing"] * self.truncated + ["what reading had to put up with"] * self.rebuilt.holds()


@dataclass(frozen=True, eq=False)
class Changes:
    """Hold the changes at taxels of a board."""

    events: Once[Events]

    def lines(self) -> list[str]:
        """Return nothing: a table is never left out."""
        return []


@dataclass(frozen=True, eq=False)
class Readings:
    """Hold frames.

    Parameters
    ----------
    frames : Frames
    untimed : bool
        Whether they have no times: they are numbered, one a us.
    turned : float
        The number that readings were subtracted from, as they fall with pressure (`falls` of a layout file).
    """

    frames: Once[Frames]
    untimed: bool = False
    turned: float | None = None

    def lines(self) -> list[str]:
        """Return what is lost without it, but for the frames."""
        lines = ["that its pictures have no times"] * self.untimed
        return lines + ([] if self.turned is None else [f"that its readings were turned (falls = {self.turned:g})"])


@dataclass(frozen=True, eq=False)
class Wire:
    """Hold a board's bytes.

    Parameters
    ----------
    datagrams : Datagrams
        As received; those of the whole file, even if the recording is a part by time.
    payload : uint8, shape (bytes,)
        The bytes of a file that does not record where datagrams begin.
    version_2 : bool
        Whether the datagrams are of version 2 of the wire.
    differences : bool
        Whether intensities in the datagrams are differences.
    origin_us : int, us
        Offset that is added to times in the datagrams.
    unmarked : tuple of int
        The numbers of repaired events that the datagrams do not mark as repaired.
    """

    datagrams: Once[Datagrams | None] = _NONE
    payload: NDArray[np.uint8] | None = None
    version_2: Once[bool] = field(default_factory=lambda: known(False))
    differences: bool = False
    origin_us: int = 0
    unmarked: tuple[int, ...] = ()

    def lines(self, *, with_times: bool = False) -> list[str]:
        """Return what is lost without it; the rest says how they are encoded."""
        lines = ["raw datagrams" + " with their arrival times" * with_times] * self.datagrams.holds()
        return lines + ["raw bytes (words that are no events)"] * (self.payload is not None and self.payload.size > 0)


@dataclass(frozen=True, eq=False)
class Lines:
    """Hold the lines of a stream of numbers.

    Parameters
    ----------
    columns : tuple of str
        The names of the columns of its frames.
    samples : Samples
        The lines as received.
    """

    columns: tuple[str, ...] = ()
    samples: Once[Samples | None] = _NONE

    def lines(self) -> list[str]:
        """Return what is lost without it."""
        return self.received() + [f"the names of the columns ({', '.join(self.columns)})"] * bool(self.columns)

    def received(self) -> list[str]:
        """Return what is lost without the lines as received."""
        return ["the lines of the stream as they came"] * self.samples.holds()


#: A function has a rule for each of these types: `match` them, and end with `assert_never`.
Part = Origin | Sensor | Settings | Marks | Timing | Losses | Changes | Readings | Wire | Lines


@dataclass(frozen=True, eq=False)
class Source:
    """Hold what all sources have: the header of a board, of frames, and of a stream of numbers."""

    origin: Origin
    sensor: Sensor
    settings: Settings = field(default_factory=Settings, kw_only=True)
    marks: Marks = field(default_factory=Marks, kw_only=True)
    timing: Timing = field(default_factory=Timing, kw_only=True)
    losses: Losses = field(default_factory=Losses, kw_only=True)

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else frames)."""
        return isinstance(self, Board)

    @property
    def table(self) -> Events | Frames:
        """The events or the frames."""
        raise NotImplementedError

    def part(self, kind: type[P]) -> P | None:
        """Return its part of a type; None if it has none."""
        return next((part for part in parts_of(self).values() if isinstance(part, kind)), None)

    @property
    def columns(self) -> tuple[str, ...] | None:
        """The names of the columns of a stream of numbers; None for a sensor."""
        lines = self.part(Lines)
        return None if lines is None else lines.columns

    @property
    def untimed(self) -> bool:
        """Whether its frames are numbered."""
        readings = self.part(Readings)
        return readings is not None and readings.untimed


@dataclass(frozen=True, eq=False)
class Board(Source):
    """Hold what a board sent."""

    changes: Changes
    wire: Wire = field(default_factory=Wire)

    @property
    def table(self) -> Events:
        """The events."""
        return self.changes.events()


@dataclass(frozen=True, eq=False)
class Pictures(Source):
    """Hold frames."""

    readings: Readings

    @property
    def table(self) -> Frames:
        """The frames."""
        return self.readings.frames()


@dataclass(frozen=True, eq=False)
class Drawn(Pictures):
    """Hold frames that were drawn of a board's events, whose bytes are still there."""

    wire: Wire = field(default_factory=Wire)


@dataclass(frozen=True, eq=False)
class Stream(Pictures):
    """Hold a stream of numbers, whose lines are frames of one row."""

    lines: Lines


@dataclass(frozen=True, eq=False)
class Several(Source):
    """Hold what a file of several sensors says as a whole; all that is of a single one refuses to be read."""

    refuse: Callable[[], NoReturn] = field(metadata={"is_part": False})
    first: Source = field(metadata={"is_part": False})
    are_frames: bool = field(metadata={"is_part": False})

    @property
    def has_events(self) -> bool:
        """Whether its sources are not all of frames by one clock."""
        return not self.are_frames

    @property
    def untimed(self) -> bool:
        """Whether its frames are numbered."""
        return self.first.untimed

    @property
    def table(self) -> NoReturn:
        """Refuse to return a table."""
        self.refuse()


def parts_of(of: Source) -> dict[str, Part]:
    """Return the parts of a source by the names of its fields."""
    return {one.name: getattr(of, one.name) for one in fields(of) if one.metadata.get("is_part", True)}


def applied(of: S, rule: Callable[[Part], Part | None], lines: Callable[[], Iterable[str]] = tuple) -> S:
    """Return a source with a rule applied to each of its parts.

    Parameters
    ----------
    of : Source
    rule : function
        Returns the part's successor, of the same type, or None if it is lost, which `Losses.lost` then says.
    lines : function that returns lines, optional
        What else is lost.
    """
    parts = parts_of(of)
    after = {name: rule(part) for name, part in parts.items()}
    gone = [parts[name] for name, part in after.items() if part is None]
    # Only a part whose fields have defaults may be lost.
    none: Callable[[str], Any] = lambda name: type(parts[name])()  # type: ignore[call-arg]  # noqa: E731
    kept: dict[str, Any] = {name: none(name) if part is None else part for name, part in after.items()}
    return saying(replace(of, **kept), lambda: [*(line for part in gone for line in part.lines()), *lines()])


def saying(of: S, lines: Callable[[], Iterable[str]]) -> S:
    """Return a source with further lines of what is lost, without duplicates."""
    lost = Once(lambda: tuple(dict.fromkeys((*of.losses.lost(), *lines()))))
    return replace(of, losses=replace(of.losses, lost=lost))


def source_from(
    table: Events | Frames,
    origin: Origin | None = None,
    *,
    untimed: bool = False,
    turned: float | None = None,
    columns: Sequence[str] = (),
    **header: Any,
) -> Board | Pictures:
    """Return a source of a table.

    Parameters
    ----------
    table : Events or Frames
    origin : Origin, optional
    untimed, turned : bool, float
        As of `Readings`.
    columns : sequence of str
        Of a stream of numbers, as of `Lines`.
    **header
        Its other parts; default: a sensor of the table's array alone.
    """
    origin = Origin() if origin is None else origin
    sensor = header.pop("sensor", None) or Sensor(table.array)
    if isinstance(table, Events):
        return Board(origin, sensor, Changes(known(table)), **header)
    readings = Readings(known(table), untimed, turned)
    if columns:
        return Stream(origin, sensor, readings, Lines(tuple(columns)), **header)
    return Pictures(origin, sensor, readings, **header)


@dataclass(frozen=True, eq=False)
class Contents:
    """Hold what an opened recording holds.

    Parameters
    ----------
    one : Source
        Its only source, the chosen one, the only board beside streams of numbers, or `Several`.
    sources : mapping from str to Source
        All sources of the file by their names.
    """

    one: Source
    sources: Mapping[str, Source]

    @classmethod
    def of(cls, source: Source) -> Contents:
        """Return a recording of one source."""
        return cls(source, {source.origin.label: source})

    def others(self) -> list[str]:
        """Return what is lost without the other sources."""
        return [f"the source {name}" for name in self.sources if name != self.one.origin.label]

    @property
    def is_several(self) -> bool:
        """Whether these are the contents of a file of several boards as a whole."""
        return isinstance(self.one, Several)


def alone(sources: Mapping[str, Source]) -> Contents:
    """Return the contents of a file: those of its only source or its only sensor; else those of `several`.

    The verdict is that of all sources.
    """
    boards = [one for one in sources.values() if not isinstance(one, Stream)]
    if len(sources) == 1:
        return Contents(next(iter(sources.values())), sources)
    if len(boards) != 1:
        return Contents(several(sources), sources)
    losses = replace(boards[0].losses, verdict=Once(lambda: _verdict(sources)))
    return Contents(replace(boards[0], losses=losses), sources)


def several(sources: Mapping[str, Source]) -> Several:
    """Return the contents of a file of several sensors as a whole; parts of a single one raise an error."""
    first = next(iter(sources.values()))
    path, names = first.origin.path, ", ".join(sources)

    def refuse() -> NoReturn:
        raise ProblemError(
            f"{path}: holds {len(sources)} sources ({names}); say which, as recording.sources["
            f"{next(iter(sources))!r}]; taxel convert --source NAME writes one to a file of its own"
        )

    no: Once[Any] = Once(refuse)
    every = [one.losses for one in sources.values()]
    return Several(
        # A source is named after its file and itself.
        replace(first.origin, name=first.origin.name.removesuffix(f" {first.origin.label}"), label=""),
        Sensor(first.sensor.array, calibration=no),
        refuse,
        first,
        are_frames=together(sources),
        settings=Settings(held=no, registers=no, register_changes=no),
        marks=replace(first.marks, board_changes=no, zeroings=no),
        timing=Timing(no, first.timing.clock_of),
        losses=Losses(
            counts=Once(lambda: {name: one.losses.counts() for name, one in sources.items()}),
            verdict=Once(lambda: _verdict(sources)),
            remarks=named([(name, one.losses.remarks) for name, one in sources.items()]),
            truncated=any(one.truncated for one in every),
            lost=Once(lambda: tuple(dict.fromkeys(line for one in every for line in one.lost()))),
        ),
    )


def _verdict(sources: Mapping[str, Source]) -> Verdict | None:
    """Return what several sources lost, as far as they say it."""
    said = [(name, one.losses.verdict()) for name, one in sources.items()]
    each = [(name, verdict) for name, verdict in said if verdict is not None]
    return Verdict._of_sources(each) if each else None


def named(remarks: Sequence[tuple[str, tuple[str, ...]]]) -> tuple[str, ...]:
    """Return the remarks of several recordings as those of one: each with its recording's name if they differ."""
    if len({lines for _, lines in remarks}) == 1:
        return remarks[0][1]
    return tuple(dict.fromkeys(f"{name}: {line}" for name, lines in remarks for line in lines))


def together(sources: Mapping[str, Source]) -> bool:
    """Return whether sources share one clock: frames without arrival times, as those of two feet."""
    return all(
        not one.has_events
        and not (isinstance(one, Stream) and one.lines.samples.holds())
        and not one.timing.clock.holds()
        for one in sources.values()
    )
