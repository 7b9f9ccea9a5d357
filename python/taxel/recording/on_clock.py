"""Converts the times of all sources of a recording to one clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar, assert_never

import numpy as np
from numpy.typing import NDArray

from taxel._core import ProblemError
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording import sections
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.contents import Contents, RecordedSource, alone, apply_rule
from taxel.recording.kinds import verdict_of
from taxel.recording.once import Once
from taxel.recording.readers.mcap import ascending
from taxel.recording.verdict import Verdict

#: The name of the host's clock, us since 1970.
HOST = "host"

#: Contents that have their own times.
M = TypeVar("M", Note, Zeroing, BoardChange)
Times = Callable[[NDArray[np.int64]], NDArray[np.int64]]


def on_clock(contents: Contents, name: str) -> Contents:
    """Return the same recording with the times of all sources by the clock of a single source, or of the host.

    Raises
    ------
    ProblemError : no such source, one without arrival times, or a slice by another clock
    """
    main, sources = contents.main, contents.sources
    path, label = main.origin.path, main.origin.label
    if main.timing.interval is not None and main.timing.clock_of is None:
        raise ProblemError(f"{path}: was already cut with between; call on_clock({name!r}) before between")
    if name not in (*sources, HOST):
        raise ProblemError(f"{path}: has no clock {name!r}; must be one of {', '.join((*sources, HOST))}")
    if main.timing.clock_of is not None:
        raise ProblemError(f"{path}: is already on the clock of {main.timing.clock_of}")
    to = None if name == HOST else _clock(sources[name])
    moved = {
        of_source: _move(source, name, None if of_source == name else _times(_clock(source), to))
        for of_source, source in sources.items()
    }
    if contents.is_several:
        return alone(moved)
    named = moved[label]

    def verdict() -> Verdict | None:
        # It may be that of all sources.
        is_own = main.losses.verdict() == sources[label].losses.verdict()
        return (named if is_own else alone(moved).main).losses.verdict()

    return Contents(replace(named, losses=replace(named.losses, verdict=Once(verdict))), moved)


def _clock(source: RecordedSource) -> Clock:
    clock = source.timing.usable()
    if clock is None:
        raise ProblemError(
            f"{source.origin.path}: source {source.origin.label!r} has no arrival times, so its clock is not known"
        )
    return clock


def _times(clock: Clock, to: Clock | None) -> Times:
    """Return a function that converts times of one clock to those of another; None is the host's clock."""

    def times(t: NDArray[np.int64]) -> NDArray[np.int64]:
        host = clock.host_ns(np.asarray(t, np.int64))
        return np.asarray((host + 500) // 1000 if to is None else to.board_us_at(host), np.int64)

    return times


def _move(source: RecordedSource, name: str, times: Times | None) -> RecordedSource:
    """Return a source with its times converted to another clock; None leaves them unchanged."""
    if times is None:
        return replace(source, timing=replace(source.timing, clock_of=name))

    def time(t: int) -> int:
        return int(times(np.array([t]))[0])

    def move_marks(marks: tuple[M, ...]) -> tuple[M, ...]:
        return tuple(replace(mark, t=None if mark.t is None else time(mark.t)) for mark in marks)

    def events(table: Events) -> Events:
        more: dict[str, Any] = {"array": table.array, "repaired": table.repaired}
        if table.intensity is not None:
            more |= {"intensity": table.intensity, "present": table.present}
        return Events(
            times(table.t), table.x, table.y, table.p, markers=[(time(t), start) for t, start in table.markers], **more
        )

    def frames(table: Frames) -> Frames:
        return Frames(table.values, ascending(times(table.t)), unit=table.unit, array=table.array)

    def detections(found: Detections) -> Detections:
        return Detections._of(found.label, times(found.t), times(found.known), found.slope, repaired=found.repaired)

    def clock(before: Clock | None) -> Clock | None:
        return None if before is None else Clock(times(before.board_us), before.arrived_ns)

    def verdict(before: Verdict | None) -> Verdict | None:
        own_verdict = verdict_of(source)
        doubtful, steps = own_verdict.doubtful_after_us, own_verdict.steps_back
        after = steps[0]["after_us"] if doubtful is None and steps else doubtful
        return before if after is None else own_verdict._later(time(after) - after)

    def rule(section: sections.Section) -> sections.Section:  # noqa: PLR0911  one a type
        match section:
            # The times in the datagrams stay by the source's own clock.
            case sections.Origin() | sections.Sensor() | sections.Settings() | sections.Wire():
                return section
            case sections.Marks():
                return sections.Marks(
                    section.board_changes.to(move_marks),
                    section.notes.to(move_marks),
                    section.detections.to(detections),
                    section.zeroings.to(move_marks),
                )
            case sections.Timing():
                return sections.Timing(section.clock.to(clock), name, section.interval)
            case sections.Losses():
                return replace(section, verdict=section.verdict.to(verdict))
            case sections.EventTable():
                return sections.EventTable(section.events.to(events))
            case sections.FrameTable():
                return replace(section, frames=section.frames.to(frames))
            case sections.SampleColumns():
                return sections.SampleColumns(section.columns)
            case _:
                assert_never(section)

    return apply_rule(source, rule, source.section(sections.SampleColumns).received)
