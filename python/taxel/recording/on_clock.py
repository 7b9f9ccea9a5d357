"""Converts the times of all sources of a recording to one clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._core import ProblemError
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.contents import Contents, alone, once
from taxel.recording.fates import after
from taxel.recording.kinds import verdict_of
from taxel.recording.read_mcap import ascending
from taxel.recording.verdict import Verdict

__all__ = ["HOST", "on_clock"]

#: The name of the host's clock, us since 1970.
HOST = "host"

Times = Callable[[NDArray[np.int64]], NDArray[np.int64]]


def on_clock(of: Contents, name: str) -> Contents:
    """Return the same recording with the times of all sources by the clock of one of them, or of the host.

    Raises
    ------
    ProblemError : no such source, one without arrival times, or a part by another clock
    """
    if of.is_slice and of.clock_of is None:
        raise ProblemError(f"{of.path}: a slice by its own clock; say on_clock({name!r}) before between")
    sources = of.sources or {of.label: of}
    if name not in (*sources, HOST):
        raise ProblemError(f"{of.path}: has no clock {name!r}; there are {', '.join((*sources, HOST))}")
    if of.clock_of is not None:
        raise ProblemError(f"{of.path}: is on the clock of {of.clock_of} already")
    to = None if name == HOST else _clock(sources[name])
    moved: dict[str, Contents] = {}
    for label, one in sources.items():
        times = None if label == name else _times(_clock(one), to)
        moved[label] = _moved(one, name, times).but(sources=moved)
    if of.is_several:
        return alone(moved)
    # The verdict may be that of all sources.
    return moved[of.label].but(
        verdict=once(lambda: (moved[of.label] if of.verdict == sources[of.label].verdict else alone(moved)).verdict)
    )


def _clock(of: Contents) -> Clock:
    clock = of.clock
    if clock is None or not len(clock.board_us):
        raise ProblemError(f"{of.path}: source {of.label!r} has no arrival times, so its clock is not known")
    return clock


def _times(own: Clock, to: Clock | None) -> Times:
    """Return a function that converts times of one clock to those of another; None is the host's clock."""

    def times(t: NDArray[np.int64]) -> NDArray[np.int64]:
        host = own.host_ns(np.asarray(t, np.int64))
        return np.asarray((host + 500) // 1000 if to is None else to.board_us_at(host), np.int64)

    return times


def _moved(of: Contents, name: str, times: Times | None) -> Contents:
    """Return a source with its times converted to another clock; None leaves them unchanged."""
    if times is None:
        return of.but(clock_of=name)

    def one(t: int) -> int:
        return int(times(np.array([t]))[0])

    def events() -> Events | None:
        own = of.events
        if own is None:
            return None
        more: dict[str, Any] = {"array": own.array, "repaired": own.repaired}
        if own.intensity is not None:
            more |= {"intensity": own.intensity, "present": own.present}
        return Events(times(own.t), own.x, own.y, own.p, markers=[(one(t), start) for t, start in own.markers], **more)

    def frames() -> Frames | None:
        own = of.frames
        return None if own is None else Frames(own.values, ascending(times(own.t)), unit=own.unit, array=own.array)

    def detections() -> Detections:
        own = of.detections
        return Detections._of(own.label, times(own.t), times(own.known), own.slope, repaired=own.repaired)

    def notes() -> tuple[Note, ...]:
        return tuple(replace(note, t=None if note.t is None else one(note.t)) for note in of.notes)

    def verdict() -> Verdict | None:
        told = verdict_of(of)
        doubtful, steps = told.doubtful_after_us, told.steps_back
        at = steps[0]["after_us"] if doubtful is None and steps else doubtful
        return of.verdict if at is None else told._later(one(at) - at)

    return after(
        "on_clock",
        of,
        lambda: ["the lines of the stream as they came"] if of.holds("samples") else [],
        events=once(events) if of.has_events else None,
        frames=None if of.has_events else once(frames),
        board_changes=once(
            lambda: tuple(replace(c, t=None if c.t is None else one(c.t)) for c in of.board_changes),
            lambda: of.holds("board_changes"),
        ),
        notes=once(notes),
        detections=once(detections),
        zeroings=once(lambda: tuple(replace(z, t=one(z.t)) for z in of.zeroings)),
        clock=once(lambda: None if of.clock is None else Clock(times(of.clock.board_us), of.clock.arrived_ns)),
        clock_of=name,
        verdict=once(verdict),
        # The times in the datagrams are by the source's own clock.
        samples=None,
        sources={},
    )
