"""A trial: one recording of one sensor, with reference times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel._core import ProblemError
from taxel.events import Events
from taxel.frames import Frames

__all__ = ["MARGIN_US", "Trial", "scored_around", "stances"]

#: Readers score detections from this time before the first reference event to this time after the last one, us.
MARGIN_US = 100_000


@dataclass(frozen=True, eq=False, repr=False)
class Trial:
    """Hold one recording of a published data set: its frames or events, its subject, and reference times.

    `taxel.open` returns it as a `Recording`; a `taxel.detect.Example` has labels and no subject, group or condition.

    Parameters
    ----------
    name : str
        "subj003/17", "GaCo02_01 left": unique among the trials of a folder.
    person : str
    recorded : Frames or Events
        Frames that are missing in the file are missing here too, so times jump there.
    truth : mapping from event to int64, shape (events,), us
        Ascending; "contact", "heel_off", "foot_off", if the data set has them.
    source : str
        The origin of the reference times, in one sentence, which every figure states. "" without reference times.
    foot : str
        "left", "right", or "" if unknown.
    group : str
        "healthy", "patient", or "".
    scored : (int, int), us, optional
        The interval in which reference times are complete; detections outside it are never counted as false. Default:
        the whole trial.
    series : mapping from name to float64, shape (frames,) or (events,), in the file's unit
        Further columns of the file, such as the total force computed by the manufacturer.
    about : mapping
        Other information: condition, speed, age ...
    timed : bool
        Whether the recording has times; else its frames are numbered: frame k has the time k us.
    unread : tuple of str
        Names of further columns of the file, which are not read.

    Raises
    ------
    ProblemError : reference times that do not ascend, or a column of another length than the recording, or
        `timed` that is not a boolean

    Examples
    --------
    >>> from taxel.array import Array
    >>> events = Events([0, 200], [0, 1], [0, 0], [True, False], array=Array(1, 2))
    >>> Trial("walk 1", "anna", events, {"contact": np.array([100])}, "an instrumented plate")
    Trial(walk 1: Events(2 events, 0 to 200 us, 1 x 2 taxels, no intensities), 1 contact)
    """

    name: str
    person: str
    recorded: Frames | Events
    truth: Mapping[str, NDArray[np.int64]]
    source: str
    foot: str = ""
    group: str = ""
    scored: tuple[int, int] | None = None
    series: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    about: Mapping[str, str | float] = field(default_factory=dict)
    timed: bool = True
    unread: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        arguments.instance("recorded", self.recorded, Frames, Events)
        for name in ("name", "person", "source", "foot", "group"):
            arguments.text(name, getattr(self, name))
        arguments.flag("timed", self.timed)
        for column in arguments.several("unread", self.unread):
            arguments.text("unread", column)
        for name in ("truth", "series", "about"):
            arguments.mapping(name, getattr(self, name))
        for event, times in self.truth.items():
            arguments.column(event, times, np.int64)
            back = np.flatnonzero(np.diff(times) <= 0)
            if len(back):
                k = int(back[0])
                raise ProblemError(
                    f"{self.name}: {event} {k + 1} is at {times[k + 1]} us; must be after {event} {k}, at {times[k]} us"
                )
        for name, column in self.series.items():
            if np.shape(column)[:1] != (len(self.recorded),):
                raise ProblemError(
                    f"{self.name}: {name} has shape {np.shape(column)}, which does not fit {self.recorded!r}"
                )
        if self.scored is None:
            t = self.recorded.t
            object.__setattr__(self, "scored", (int(t.min()), int(t.max())) if len(t) else (0, 0))
        else:
            ends = arguments.several("scored", self.scored)
            if len(ends) != 2:
                raise refused("scored", f" is {arguments.shown(self.scored)}: must be two times in us")
            first, last = (arguments.integer("scored", end, unit="us") for end in ends)
            if first > last:
                raise refused("scored", f" is {first} to {last} us: the end must not be before the beginning")
            object.__setattr__(self, "scored", (first, last))

    @property
    def frames(self) -> Frames:
        """The frames.

        Raises
        ------
        ProblemError : the trial holds events
        """
        if not isinstance(self.recorded, Frames):
            raise ProblemError(f"{self.name}: contains events and no frames")
        return self.recorded

    @property
    def events(self) -> Events:
        """The events.

        Raises
        ------
        ProblemError : the trial holds frames
        """
        if not isinstance(self.recorded, Events):
            raise ProblemError(f"{self.name}: contains frames and no events")
        return self.recorded

    def __repr__(self) -> str:
        events = ", ".join(f"{len(times)} {event}" for event, times in self.truth.items()) or "no truth"
        return escaped(f"Trial({self.name}: {self.recorded!r}, {events})")


def stances(ups: NDArray[np.int64], downs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return each beginning of a load with the end that follows it, shape (n, 2); both ascend and alternate."""
    downs = downs[np.searchsorted(downs, ups[0]) :] if len(ups) else downs[:0]
    n = min(len(ups), len(downs))
    return np.stack([ups[:n], downs[:n]], axis=1)


def scored_around(truth: Mapping[str, NDArray[np.int64]]) -> tuple[int, int]:
    """Return the interval from `MARGIN_US` before the first reference event to as long after the last one, us."""
    times = np.concatenate([*truth.values(), np.empty(0, np.int64)])
    return (int(times.min()) - MARGIN_US, int(times.max()) + MARGIN_US) if len(times) else (0, 0)
