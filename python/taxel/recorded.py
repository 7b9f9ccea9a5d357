"""The interface of a recording for the modules that `taxel.recording` imports: it holds events or frames."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.errors import helped
from taxel._base.messages import counted, warn
from taxel._core import ProblemError
from taxel.clock import Clock
from taxel.events import Events
from taxel.frames import Frames

__all__ = ["Recorded", "recorded", "refuse_numbered", "unit_of"]

T = TypeVar("T")


class Recorded(Protocol):
    """Events or frames, as `taxel.Recording` does."""

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
        """Whether it holds events (else frames)."""
        ...

    @property
    def timed(self) -> bool:
        """Whether it has times; else its frames are numbered, one a us."""
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
        """Return the frames."""
        ...


def recorded(x: Events | Frames | Recorded | T, *, hold: bool = True) -> Events | Frames | T:
    """Return a recording's events, preceded by the values held at its beginning, or its frames; else `x` itself.

    Missing values of a recording's frames are filled (`Frames.held`), with a warning that counts them, unless `hold`
    is false.

    Raises
    ------
    ProblemError : frames without times
    """
    if isinstance(x, type) or not all(hasattr(x, name) for name in ("has_events", "frames")):
        return x  # type: ignore[return-value]
    refuse_numbered(x)  # type: ignore[arg-type]
    if not x.has_events:  # type: ignore[union-attr]
        frames = x.frames()  # type: ignore[union-attr]
        return _filled(frames, x.path) if hold and frames.missing else frames  # type: ignore[union-attr]
    return _begun(x.events, getattr(x, "held", None))  # type: ignore[union-attr]


def _filled(frames: Frames, path: Path) -> Frames:
    """Return frames without missing values; say how many were filled."""
    never = int(np.count_nonzero(np.isnan(frames.values).all(axis=0)))
    warn(
        f"{path}: {frames.missing} of {frames.values.size} values are missing (NaN): taxel uses the last value of the "
        "same taxel instead"
        + f"; {counted(never, 'taxel')} without any value {'reads' if never == 1 else 'read'} 0"
        * bool(never),
        stacklevel=3,
    )
    return frames.held()


def unit_of(source: Events | Frames) -> str:
    """Return the unit of values: that of frames; the intensities of events are ticks."""
    return source.unit if isinstance(source, Frames) else "ticks"


def refuse_numbered(recording: Recorded) -> None:
    """Refuse a recording whose frames are numbered (`Recording.timed`), where times are needed.

    Raises
    ------
    ProblemError : frames without times
    """
    if not recording.timed:
        raise helped(ProblemError(f"{recording.path}: its frames have no times"), "rate_hz", "give")


def _begun(events: Events, held: NDArray[np.float32] | None) -> Events:
    """Return events preceded by the held values of the taxels, as repaired events, which are not changes."""
    if held is None or events.intensity is None or events.present is None or not len(events):
        return events
    ticks = np.where(np.isnan(held), _core.UNKNOWN, held).astype(np.uint16).reshape(-1)
    if (ticks == _core.UNKNOWN).all():
        return events
    first = _core.held_as_events(ticks, int(events.t.min()), events.array)
    return Events._joined((Events._unchecked(**first, array=events.array), events))
