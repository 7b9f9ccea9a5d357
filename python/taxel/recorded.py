"""The interface of a recording for the modules that `taxel.recording` imports: it holds events or pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.clock import Clock
from taxel.events import Events, repaired_of
from taxel.frames import Frames

__all__ = ["Recorded", "recorded"]

T = TypeVar("T")


class Recorded(Protocol):
    """Hold events or pictures, as `taxel.Recording` does."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def clock(self) -> Clock | None:
        """Arrival times against the board's time; None without arrival times."""
        ...

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else pictures)."""
        ...

    @property
    def timed(self) -> bool:
        """Whether it has times; else its pictures are numbered, one a us."""
        ...

    @property
    def events(self) -> Events:
        """The changes at taxels."""
        ...

    @property
    def held(self) -> NDArray[np.float32] | None:
        """The values of the taxels at its beginning, ticks, NaN for one without an event so far; None if unknown."""
        ...

    def frames(self) -> Frames:
        """Return the pictures."""
        ...


def recorded(x: Events | Frames | Recorded | T) -> Events | Frames | T:
    """Return a recording's events, preceded by the values held at its beginning, or its pictures; else `x` itself.

    Raises
    ------
    ProblemError : pictures without times
    """
    if isinstance(x, type) or not all(hasattr(x, name) for name in ("has_events", "frames")):
        return x  # type: ignore[return-value]
    if not getattr(x, "timed", True):
        raise ProblemError(
            f"{x.path}: its pictures have no times; say how many there are a second: --rate-hz HZ, or "  # type: ignore[union-attr]
            "recording.at_rate(HZ)"
        )
    if not x.has_events:  # type: ignore[union-attr]
        return x.frames()  # type: ignore[union-attr]
    return _begun(x.events, getattr(x, "held", None))  # type: ignore[union-attr]


def _begun(events: Events, held: NDArray[np.float32] | None) -> Events:
    """Return events preceded by the held values of the taxels, as repaired events, which are not changes."""
    if held is None or events.intensity is None or events.present is None or not len(events):
        return events
    ticks = np.where(np.isnan(held), _core.UNKNOWN, held).astype(np.uint16).reshape(-1)
    if (ticks == _core.UNKNOWN).all():
        return events
    first = _core.held_as_events(ticks, int(events.t.min()), events.array._parts())
    both = (Events._from_parts(first, events.array), events)
    names = ("t", "x", "y", "p", "intensity", "present")
    columns: list[Any] = [np.concatenate([getattr(e, name) for e in both]) for name in names]
    t, x, y, p, ticks, present = columns
    return Events._unchecked(t, x, y, p, events.array, ticks, present, repaired_of(both), events.markers)
