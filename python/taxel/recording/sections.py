"""The sections of a recording: what a function does with a field follows from the type of its section.

Each function (`between`, `merge`, `convert` ...) has a rule for every type in `Section`: the type checker demands it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel.array import Array
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.once import UNKNOWN, Once, known
from taxel.recording.raw import Datagrams, Samples
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

__all__ = [
    "EventTable",
    "FrameTable",
    "Losses",
    "Marks",
    "Origin",
    "SampleColumns",
    "Section",
    "Sensor",
    "Settings",
    "Timing",
    "Wire",
]  # fmt: skip

#: Defaults of fields of sections.
_NONE: Once[Any] = known(None)
_EMPTY: Once[Any] = known(())


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

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, one line each."""
        return [f"the origin of the recording ({self.source})"] * bool(self.source)


@dataclass(frozen=True, eq=False)
class Sensor:
    """Describe the sensor.

    Parameters
    ----------
    array : Array
    side : {"left", "right", ""}
        The foot or hand that the sensor is of.
    heel : {"top", "bottom", ""}
        Place of the heel on the sensor.
    calibration : Calibration
    """

    array: Array
    side: str = ""
    heel: str = ""
    calibration: Once[Calibration | None] = _NONE

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, except the array."""
        lines = [f"the side ({self.side})"] * bool(self.side)
        return lines + [f"where the heel is ({self.heel})"] * bool(self.heel)


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

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, one line each."""
        held, changes = self.held(), self.register_changes()
        lines = (
            [] if held is None else [f"the values of {counted(int(np.sum(held != UNKNOWN)), 'taxel')} at the beginning"]
        )
        lines = lines * self.held.holds() + ["the board's registers"] * (self.registers() is not None)
        return lines + [f"{counted(len(changes), 'setting')} of the registers"] * bool(changes)


@dataclass(frozen=True, eq=False)
class Marks:
    """Hold what happened at a time of the recording's clock."""

    board_changes: Once[tuple[BoardChange, ...]] = _EMPTY
    notes: Once[tuple[Note, ...]] = _EMPTY
    detections: Once[Detections] = field(default_factory=lambda: known(Detections([], [], [])))
    zeroings: Once[tuple[Zeroing, ...]] = _EMPTY

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, one line each."""
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
    interval : (int, int), us
        The first time and the end of a slice. A slice that is written to a file becomes a separate recording.
    """

    clock: Once[Clock | None] = _NONE
    clock_of: str | None = None
    interval: Once[tuple[int, int]] | None = None

    def usable(self) -> Clock | None:
        """Return the clock, if any datagram holds a time."""
        clock = self.clock()
        return clock if clock is not None and len(clock.board_us) else None

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, except arrival times."""
        return [f"the clock of the times ({self.clock_of})"] * (self.clock_of is not None)


@dataclass(frozen=True, eq=False)
class Losses:
    """State what was lost.

    Parameters
    ----------
    counts : mapping
        What was received and lost, by cause.
    verdict : Verdict
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
    verdict: Once[Verdict | None] = _NONE
    remarks: tuple[str, ...] = ()
    truncated: bool = False
    rebuilt: Once[Mapping[str, int]] = field(default_factory=lambda: known(dict[str, int]()))
    lost: Once[tuple[str, ...]] = _EMPTY

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, one line each."""
        counts = self.counts.holds()
        lines = ["the counts of received and lost data, by cause"] * counts
        # With counts, this is what they say.
        lines += ["the summary of losses"] * (not counts and self.verdict() is not None)
        return lines + [f"the remark: {line}" for line in self.remarks] + self.damage()

    def damage(self) -> list[str]:
        """Return what a file that does not state its damage lacks."""
        return ["the fact that the end of the recording is missing"] * self.truncated + [
            "the remarks on reading the recording"
        ] * self.rebuilt.holds()


@dataclass(frozen=True, eq=False)
class EventTable:
    """Hold the changes at taxels of a board."""

    events: Once[Events]

    def losses(self) -> list[str]:
        """Return nothing: a table is never left out."""
        return []


@dataclass(frozen=True, eq=False)
class FrameTable:
    """Hold frames.

    Parameters
    ----------
    frames : Frames
    untimed : bool
        Whether they have no times: they are numbered, one a us.
    turned : float
        The number that readings were subtracted from, as they fall with pressure (`falls` of a layout file).
    frame_us : float, us, optional
        Time from one frame to the next, by which a readout knew live when a frame was over.
    """

    frames: Once[Frames]
    untimed: bool = False
    turned: float | None = None
    frame_us: float | None = None

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, except the frames."""
        lines = ["the fact that the frames have no times"] * self.untimed
        lines += [] if self.turned is None else [f"the fact that the readings were inverted (falls = {self.turned:g})"]
        return lines + (
            [] if self.frame_us is None else [f"the length of a frame that a readout assumed, {self.frame_us:g} us"]
        )


@dataclass(frozen=True, eq=False)
class Wire:
    """Hold a board's bytes.

    Parameters
    ----------
    datagrams : Datagrams
        As received; those of the whole file, even if the recording is a slice.
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

    def losses(self, *, with_times: bool = False) -> list[str]:
        """Return what a file without this section does not hold; the other fields say how bytes are encoded."""
        lines = ["raw datagrams" + " with their arrival times" * with_times] * self.datagrams.holds()
        return lines + ["raw bytes (words that are not events)"] * (self.payload is not None and self.payload.size > 0)


@dataclass(frozen=True, eq=False)
class SampleColumns:
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

    def losses(self) -> list[str]:
        """Return what a file without this section does not hold, one line each."""
        return self.received() + [f"the names of the columns ({', '.join(self.columns)})"] * bool(self.columns)

    def received(self) -> list[str]:
        """Return what a file without the lines as received does not hold."""
        return ["the lines of the stream as received"] * self.samples.holds()


#: A function has a rule for each of these types: `match` them, and end with `assert_never`.
Section = Origin | Sensor | Settings | Marks | Timing | Losses | EventTable | FrameTable | Wire | SampleColumns
