"""What a recording holds, whichever file it comes from: a field for each thing, read when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sized
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
from taxel.recording.notes import BoardChange, Datagrams, Samples, Zeroing
from taxel.wire import Registers

__all__ = ["FIELDS", "UNKNOWN", "Contents", "Once", "alone", "anything", "once", "several"]

T = TypeVar("T")

#: Value of a taxel without any event so far, where files hold what the taxels held.
UNKNOWN = _core.UNKNOWN


class Once(Generic[T]):
    """Function that reads a value when it is first called, and keeps it.

    Parameters
    ----------
    read : function without arguments
        Called once; where it raises, the next call tries again.
    holds : function without arguments, optional
        Whether the value holds anything, where that is known more cheaply than the value itself.
    """

    def __init__(self, read: Callable[[], T], holds: Callable[[], bool] | None = None) -> None:
        self._read: Callable[[], T] | None = read
        self._holds = holds

    def __call__(self) -> T:
        """Return the value."""
        if self._read is not None:
            self._value = self._read()
            # What the function refers to (another recording's contents) need not be kept longer than this.
            self._read = self._holds = None
        return self._value

    def holds(self) -> bool:
        """Tell whether the value holds anything."""
        return anything(self()) if self._holds is None else self._holds()


def once(read: Callable[[], T], holds: Callable[[], bool] | None = None) -> T:
    """Return the value of a field of `Contents` as a function that reads it once."""
    return cast(T, Once(read, holds))


def anything(value: object) -> bool:
    """Tell whether the value of a field says more than nothing at all."""
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
    """Hold what a recording holds.

    Each field is a value, or a function that reads it once (`once`); reading an attribute gives the value either way.
    What a file cannot hold has the field's default. Which function does what to which field stands in
    `taxel.recording.fates`.

    Parameters
    ----------
    path : Path
    name, kind, label : str
        The file's name (of a trial in other people's file what that calls it); the kind of file; what the source is
        called among those of its file, "" where the file holds several boards of which none is its own.
    array : Array
        The sensor.
    source : str
        Where the bytes came from.
    events, frames : Events, Frames
        One of the two; `frames` is the value None, never a function, where it holds events.
    stretch : (int, int), us
        Of a part by time the first time and the end.
    held : uint16, shape (rows, columns), ticks
        What the taxels held at the beginning; `UNKNOWN` of one without any event before.
    registers : Registers
        What the board's registers held at the beginning, with the array that they drive: the whole sensor also where
        the recording is a part of one.
    register_changes : tuple of (int ns since 1970, Registers)
    board_changes : tuple of BoardChange
    notes : tuple of Note
    detections : Detections
    zeroings : tuple of Zeroing
    calibration : Calibration
    clock : Clock
        Arrival times against the source's time.
    clock_of : str
        By whose clock times are, where they are not by the source's own.
    counts : mapping
        What was received and lost, by cause.
    verdict : str
        The same in one line; None where nothing is said.
    datagrams : Datagrams
        As they came, of the whole file also where the recording is a part by time.
    payload : uint8, shape (bytes,)
        The board's bytes, of a file that does not say where datagrams begin.
    version_2 : bool
        Whether the datagrams are of version 2 of the wire.
    differences : bool
        Whether intensities in the datagrams are differences.
    origin_us : int, us
        What is added to times in the datagrams.
    unmarked : tuple of int
        The numbers of events that are repaired though the datagrams do not say so.
    samples : Samples
        Of a stream of numbers its lines as they came.
    columns : tuple of str
        Of a stream of numbers the names of its columns; None of a sensor.
    truncated : bool
    rebuilt : mapping
        What reading had to put up with.
    sources : mapping from str to Contents
        All sources of the file, this one among them; empty where it is alone.
    lost : tuple of str
        A line for each thing that was left behind.
    """

    path: Path
    name: str
    kind: str
    array: Array
    label: str = "board"
    source: str = ""
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
    verdict: str | None = None
    datagrams: Datagrams | None = None
    payload: NDArray[np.uint8] | None = None
    version_2: bool = False
    differences: bool = False
    origin_us: int = 0
    unmarked: tuple[int, ...] = ()
    samples: Samples | None = None
    columns: tuple[str, ...] | None = None
    truncated: bool = False
    rebuilt: Mapping[str, int] = field(default_factory=dict)
    sources: Mapping[str, Contents] = field(default_factory=dict)
    lost: tuple[str, ...] = ()

    def __getattribute__(self, name: str) -> Any:
        value = object.__getattribute__(self, name)
        return value() if isinstance(value, Once) else value

    def __getstate__(self) -> dict[str, Any]:
        """Return all fields, read: what goes to another process needs no file."""
        return {name: getattr(self, name) for name in FIELDS}

    def holds(self, name: str) -> bool:
        """Tell whether a field holds anything; reads no more than that takes."""
        value = vars(self)[name]
        return value.holds() if isinstance(value, Once) else anything(value)

    def but(self, **changed: Any) -> Self:
        """Return the same contents with other values of some fields; nothing is read."""
        return type(self)(**{**vars(self), **changed})

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else pictures); reads neither."""
        return vars(self)["frames"] is None

    @property
    def is_slice(self) -> bool:
        """Whether it is a part by time; reads nothing."""
        return vars(self)["stretch"] is not None

    @property
    def is_several(self) -> bool:
        """Whether the file holds several boards, of which none is its own."""
        return not self.label

    @property
    def table(self) -> Events | Frames:
        """The events or the pictures."""
        table = self.events if self.has_events else self.frames
        assert table is not None  # each reader gives one of the two
        return table


#: The names of the fields, in their order.
FIELDS = tuple(one.name for one in fields(Contents))


def several(sources: Mapping[str, Contents]) -> Contents:
    """Return the contents of a file of several boards: what is of one board is refused, by the sources' names."""
    first = next(iter(sources.values()))
    names = ", ".join(sources)

    def refuse() -> Any:
        raise ProblemError(
            f"{first.path}: holds {len(sources)} sources ({names}); say which, as "
            f"recording.sources[{next(iter(sources))!r}]"
        )

    of_one_board = [
        *("events", "held", "registers", "register_changes", "board_changes", "zeroings", "clock", "calibration"),
        *("datagrams", "payload", "samples", "version_2"),
    ]
    return Contents(
        **{name: once(refuse) for name in of_one_board},
        **{name: getattr(first, name) for name in ("path", "name", "kind", "array", "source")},
        label="",
        notes=once(lambda: first.notes),
        detections=once(lambda: first.detections),
        counts=once(lambda: {name: one.counts for name, one in sources.items()}),
        verdict=once(lambda: "; ".join(f"{name}: {one.verdict}" for name, one in sources.items())),
        truncated=once(lambda: any(one.truncated for one in sources.values())),
        lost=once(lambda: tuple(dict.fromkeys(line for one in sources.values() for line in one.lost))),
        clock_of=first.clock_of,
        sources=sources,
    )


def alone(sources: Mapping[str, Contents]) -> Contents:
    """Return the contents of a file: those of its only source, or of its only board; else one that refuses."""
    boards = [one for one in sources.values() if one.has_events]
    if len(sources) == 1:
        return next(iter(sources.values()))
    return boards[0] if len(boards) == 1 else several(sources)
