"""The contents of a recording from any kind of file: one dataclass, each field read at its first access."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Generic, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.raw import Datagrams, Samples
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

__all__ = ["FIELDS", "UNKNOWN", "Contents", "Once", "alone", "anything", "named", "once", "several", "together"]

T = TypeVar("T")

#: The held value, in files, of a taxel without any event so far.
UNKNOWN = _core.UNKNOWN


class Once(Generic[T]):
    """Function that reads a value at its first call and caches it.

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

    def holds(self) -> bool:
        """Return whether the value holds anything."""
        return anything(self()) if self._holds is None else self._holds()


def once(read: Callable[[], T], holds: Callable[[], bool] | None = None) -> T:
    """Return the value of a field of `Contents` as a function that reads it once."""
    return cast(T, Once(read, holds))


def anything(value: object) -> bool:
    """Return whether the value of a field holds any information."""
    match value:
        case Clock():
            return len(value.board_us) > 0
        case np.ndarray():
            return bool((value != UNKNOWN).any())
        case Events() | Frames() | Registers() | Calibration() | Array():
            return True
        case dict():
            return any(map(anything, value.values()))
        case Sized():
            return len(value) > 0
    return bool(value)


@dataclass(frozen=True, eq=False, repr=False)
class Contents:
    """Hold the contents of a recording.

    Each field is a value, or a function that reads it once (`once`); the attribute is the value in both cases. A field
    that a file cannot hold has its default. The table in `taxel.recording.fates` states what each function does to each
    field.

    Parameters
    ----------
    path : Path
    name, kind, label : str
        The file's name (for a trial in a file of another format the name in that file); the kind of file; the name of
        the source within its file, "" for a file of several boards as a whole.
    array : Array
        The sensor.
    source : str
        The origin of the bytes, such as an address or a port.
    side : {"left", "right", ""}
        The foot or hand that the sensor is of.
    heel : {"top", "bottom", ""}
        Where on the sensor the heel lies.
    events, frames : Events, Frames
        One of the two; for a recording of events `frames` is None, never a function.
    stretch : (int, int), us
        The first time and the end of a part by time.
    held : uint16, shape (rows, columns), ticks
        The values that the taxels held at the beginning; `UNKNOWN` for one without any event before.
    registers : Registers
        The board's registers at the beginning, with the array that they drive: the whole sensor, even if the recording
        is a part of it.
    register_changes : tuple of (int ns since 1970, Registers)
    board_changes : tuple of BoardChange
    notes : tuple of Note
    detections : Detections
    zeroings : tuple of Zeroing
    calibration : Calibration
    clock : Clock
        Arrival times against the source's time.
    clock_of : str
        The name of the clock of all times, if it is not the source's own.
    counts : mapping
        What was received and lost, by cause.
    verdict : Verdict
        What was lost; None if that is not known.
    remarks : tuple of str
        What else there is to know: by whose times it is, what was left out, what it was converted from.
    datagrams : Datagrams
        The datagrams as received; those of the whole file, even if the recording is a part by time.
    payload : uint8, shape (bytes,)
        The board's bytes, for a file that does not record where datagrams begin.
    version_2 : bool
        Whether the datagrams are of version 2 of the wire.
    differences : bool
        Whether intensities in the datagrams are differences.
    origin_us : int, us
        Offset that is added to times in the datagrams.
    unmarked : tuple of int
        The numbers of repaired events that the datagrams do not mark as repaired.
    samples : Samples
        The lines of a stream of numbers, as received.
    columns : tuple of str
        The names of the columns of a stream of numbers; None for a sensor.
    untimed : bool
        Whether the pictures have no times: they are numbered, one a us.
    truncated : bool
    rebuilt : mapping
        Counts of damage that the reader skipped or repaired.
    sources : mapping from str to Contents
        All sources of the file, including this one; empty if there is only one.
    lost : tuple of str
        A line for each kind of information that was lost.
    """

    path: Path
    name: str
    kind: str
    array: Array
    label: str = "board"
    source: str = ""
    side: str = ""
    heel: str = ""
    events: Events | None = None
    frames: Frames | None = None
    stretch: tuple[int, int] | None = None
    held: NDArray[np.uint16] | None = None
    registers: Registers | None = None
    register_changes: tuple[tuple[int, Registers], ...] = ()
    board_changes: tuple[BoardChange, ...] = ()
    notes: tuple[Note, ...] = ()
    detections: Detections = field(default_factory=lambda: Detections([], [], []))
    zeroings: tuple[Zeroing, ...] = ()
    calibration: Calibration | None = None
    clock: Clock | None = None
    clock_of: str | None = None
    counts: Mapping[str, Any] = field(default_factory=dict)
    verdict: Verdict | None = None
    remarks: tuple[str, ...] = ()
    datagrams: Datagrams | None = None
    payload: NDArray[np.uint8] | None = None
    version_2: bool = False
    differences: bool = False
    origin_us: int = 0
    unmarked: tuple[int, ...] = ()
    samples: Samples | None = None
    columns: tuple[str, ...] | None = None
    untimed: bool = False
    truncated: bool = False
    rebuilt: Mapping[str, int] = field(default_factory=dict)
    sources: Mapping[str, Contents] = field(default_factory=dict)
    lost: tuple[str, ...] = ()

    def __getattribute__(self, name: str) -> Any:
        value = object.__getattribute__(self, name)
        return value() if isinstance(value, Once) else value

    def __getstate__(self) -> dict[str, Any]:
        """Read and return all fields, so that a pickle does not need the file."""
        return {name: getattr(self, name) for name in FIELDS}

    def holds(self, name: str) -> bool:
        """Return whether a field holds anything; read no more than necessary."""
        value = vars(self)[name]
        return value.holds() if isinstance(value, Once) else anything(value)

    def but(self, **changed: Any) -> Self:
        """Return the same contents with other values of some fields; read nothing."""
        return type(self)(**{**vars(self), **changed})

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else pictures); neither is read."""
        return vars(self)["frames"] is None

    @property
    def is_slice(self) -> bool:
        """Whether it is a part by time; nothing is read."""
        return vars(self)["stretch"] is not None

    @property
    def is_several(self) -> bool:
        """Whether these are the contents of a file of several boards as a whole."""
        return not self.label

    @property
    def table(self) -> Events | Frames:
        """The events or the pictures."""
        table = self.events if self.has_events else self.frames
        assert table is not None  # each reader sets one of the two
        return table


#: The names of the fields, in their order.
FIELDS = tuple(one.name for one in fields(Contents))


def several(sources: Mapping[str, Contents]) -> Contents:
    """Return the contents of a file of several sensors; fields of a single one raise an error."""
    first = next(iter(sources.values()))
    pictures = together(sources)
    names = ", ".join(sources)

    def refuse() -> Any:
        raise ProblemError(
            f"{first.path}: holds {len(sources)} sources ({names}); say which, as "
            f"recording.sources[{next(iter(sources))!r}]; taxel convert --source NAME writes one to a file of its own"
        )

    of_one_board = [
        *("events", "held", "registers", "register_changes", "board_changes", "zeroings", "clock", "calibration"),
        *("datagrams", "payload", "samples", "version_2", *(["frames"] if pictures else [])),
    ]
    return Contents(
        **{name: once(refuse) for name in of_one_board},
        **{name: getattr(first, name) for name in ("path", "kind", "array", "source")},
        # A source is named after its file and itself.
        name=first.name.removesuffix(f" {first.label}"),
        label="",
        untimed=first.untimed,
        notes=once(lambda: first.notes),
        detections=once(lambda: first.detections),
        counts=once(lambda: {name: one.counts for name, one in sources.items()}),
        verdict=once(lambda: _verdict(sources)),
        remarks=once(lambda: named([(name, one.remarks) for name, one in sources.items()])),
        truncated=once(lambda: any(one.truncated for one in sources.values())),
        lost=once(lambda: tuple(dict.fromkeys(line for one in sources.values() for line in one.lost))),
        clock_of=first.clock_of,
        sources=sources,
    )


def _verdict(sources: Mapping[str, Contents]) -> Verdict | None:
    """Return what several sources lost, as far as they say it."""
    said = [(name, one.verdict) for name, one in sources.items() if one.verdict is not None]
    return Verdict._of_sources(said) if said else None


def named(remarks: Sequence[tuple[str, tuple[str, ...]]]) -> tuple[str, ...]:
    """Return the remarks of several recordings as those of one: each with its recording's name if they differ."""
    if len({lines for _, lines in remarks}) == 1:
        return remarks[0][1]
    return tuple(dict.fromkeys(f"{name}: {line}" for name, lines in remarks for line in lines))


def together(sources: Mapping[str, Contents]) -> bool:
    """Return whether sources share one clock: pictures without arrival times, as those of two feet."""
    return all(not one.has_events and one.samples is None and not one.holds("clock") for one in sources.values())


def alone(sources: Mapping[str, Contents]) -> Contents:
    """Return the contents of a file: those of its only source or its only sensor; else those of `several`.

    The verdict is that of all sources.
    """
    boards = [one for one in sources.values() if vars(one)["columns"] is None]
    if len(sources) == 1:
        return next(iter(sources.values()))
    return boards[0].but(verdict=once(lambda: _verdict(sources))) if len(boards) == 1 else several(sources)
