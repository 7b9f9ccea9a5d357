"""A source of a recording: a reader of one sensor, and the view of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.clock import Clock
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import Datagrams, Facts, InMemory, Marks, Reader, Times, View
from taxel.recording.frames import times_at
from taxel.verdict import Verdict

#: Returns the notes of a file with the labels of the tables beside it.
Labelled = Callable[[tuple[Note, ...]], tuple[Note, ...]]


class Whole:
    """All of a source, by the clock of a view: its slices share what is read."""

    def __init__(self, reader: Reader, view: View, labelled: Labelled | None) -> None:
        self.reader, self._times, self.labelled = reader, view.times, labelled

    @cached_property
    def table(self) -> Events | Frames:
        """The events or the frames."""
        table = self.reader.table()
        return table if self._times is None else table._moved(self._times)

    @cached_property
    def marks(self) -> Marks:
        """What happened at a time, with the labels beside the file."""
        marks = self.reader.marks()
        if self.labelled is not None:
            marks = replace(marks, notes=self.labelled(marks.notes))
        return marks if self._times is None else marks.moved(self._times)

    @cached_property
    def clock(self) -> Clock | None:
        """Arrival times against the times of the source."""
        clock = self.reader.clock()
        if clock is None or self._times is None:
            return clock
        return Clock(self._times(clock.board_us), clock.arrived_ns)


class SourceView:
    """One sensor of a recording; everything is read at its first access.

    Parameters
    ----------
    reader : Reader
    view : View, optional
        Default: all of it.
    facts : Facts, optional
        What a layout says of it; default: what the reader does.
    labelled : function, optional
        Adds the labels beside the file to its notes.
    whole : Whole, optional
        What another view of it has read, by the same clock.
    """

    def __init__(
        self,
        reader: Reader,
        view: View | None = None,
        facts: Facts | None = None,
        labelled: Labelled | None = None,
        whole: Whole | None = None,
    ) -> None:
        self.reader, self.view = reader, View() if view is None else view
        self.facts = reader.facts if facts is None else facts
        self._whole = Whole(reader, self.view, labelled) if whole is None else whole
        array, view = self.facts.array, self.view
        self._is_part = view.columns is not None or view.rows is not None
        (left, right), (top, bottom) = array.region(view.columns or slice(None), view.rows or slice(None))
        self._inside = slice(left, right), slice(top, bottom)
        self.array = array._part(*self._inside) if self._is_part else array

    @cached_property
    def table(self) -> Events | Frames:
        """The events or the frames."""
        return self._table.region(*self._inside) if self._is_part else self._table

    @property
    def _table(self) -> Events | Frames:
        """The events or the frames of all of the array."""
        table, array = self._whole.table, self.facts.array
        if table.array != array:
            table = table._on(array)
        return table.between(self.view.start, self.view.stop) if self.view.is_slice else table

    @cached_property
    def marks(self) -> Marks:
        """What happened at a time, and the state at the beginning."""
        whole, view = self._whole.marks, self.view
        held = None if whole.held is None else whole.held.reshape(self.facts.array.shape)
        if view.is_slice:
            held = held_at(self._whole.table, held, view.start)
        # A note of the same text and time as another is that note.
        there = {(note.text, note.t) for note in whole.notes if note.t is not None}
        more = tuple(note for note in view.notes if (note.text, note.t) not in there)
        marks = replace(whole, notes=(*whole.notes, *more), held=held)
        if view.is_slice:
            marks = marks.between(view.start, view.stop)
        return marks.region(*self._inside) if self._is_part else marks

    @property
    def clock(self) -> Clock | None:
        """Arrival times against the times of the source; None without any."""
        return self._whole.clock

    @cached_property
    def verdict(self) -> Verdict:
        """What was lost of the whole file, with times by the view's clock."""
        verdict, times = self.reader.verdict(), self.view.times
        steps = verdict.steps_back
        after = steps[0]["after_us"] if verdict.doubtful_after_us is None and steps else verdict.doubtful_after_us
        if times is None or after is None:
            return verdict
        return verdict._later(int(times(np.array([after]))[0]) - after)

    @property
    def counts(self) -> Mapping[str, Any]:
        """The numbers of what was received and lost, by cause."""
        return self.reader.counts()

    @property
    def received(self) -> Datagrams | None:
        """What was received of this view, as it was received; None if the events or frames must be written instead."""
        return self.reader.datagrams() if self.view.is_whole else None

    @property
    def lost(self) -> tuple[str, ...]:
        """A line for each kind of information that is not there any more."""
        has_raw = not self.facts.raw or self.view.is_whole
        return self.facts.lost if has_raw else tuple(dict.fromkeys((*self.facts.lost, "raw datagrams")))

    @property
    def interval(self) -> tuple[int, int] | None:
        """The first time and the end of a slice, us, limited to those of the whole; None of the whole."""
        if not self.view.is_slice:
            return None
        t = self._whole.table.t
        begin, end = (int(t.min()), int(t.max()) + 1) if len(t) else (0, 1)
        first = max(begin, int(np.ceil(max(self.view.start, -(2.0**62)))))
        return first, max(first, min(end, int(np.ceil(min(self.view.stop, 2.0**62)))))

    def but(self, **view: Any) -> SourceView:
        """Return another view of the same file."""
        changed = replace(self.view, **view)
        whole = self._whole if changed.times is self.view.times else None
        return SourceView(self.reader, changed, self.facts, self._whole.labelled, whole)

    def stated(self, **facts: Any) -> SourceView:
        """Return the same view with other facts."""
        return SourceView(self.reader, self.view, replace(self.facts, **facts), self._whole.labelled, self._whole)

    def labelled(self, labelled: Labelled) -> SourceView:
        """Return the same source with the labels beside its file, which a function adds to its notes."""
        return SourceView(self.reader, self.view, self.facts, labelled)

    def between(self, start: float, stop: float) -> SourceView:
        """Return the view of ``start <= t < stop`` (us) within this one."""
        first = max(start, self.view.start)
        return self.but(start=first, stop=max(first, min(stop, self.view.stop)))

    def region(self, columns: slice, rows: slice) -> SourceView:
        """Return the view of a rectangle within this one; unchanged if that is all."""
        (left, right), (top, bottom) = self.array.region(columns, rows)
        if (bottom - top, right - left) == self.array.shape:
            return self
        across, down = self._inside
        return self.but(
            columns=slice(across.start + left, across.start + right), rows=slice(down.start + top, down.start + bottom)
        )

    def at_rate(self, rate_hz: float) -> SourceView:
        """Return the view with times of numbered frames; unchanged of a source with times."""
        if self.facts.timed:
            return self
        times, view = partial(times_at, rate_hz=rate_hz), self.view
        ends = [
            edge if np.isinf(edge) else float(times(np.array([np.ceil(edge)]))[0]) for edge in (view.start, view.stop)
        ]
        notes = Marks(notes=view.notes).moved(times).notes
        return self.but(start=ends[0], stop=ends[1], times=times, notes=notes).stated(timed=True)

    def on_clock(self, name: str, times: Times | None) -> SourceView:
        """Return the view by another clock, of this name; None if it is the source's own."""
        notes = self.view.notes if times is None else Marks(notes=self.view.notes).moved(times).notes
        return self.but(clock=name, times=times, notes=notes)

    def with_notes(self, more: Sequence[Note]) -> SourceView:
        """Return the view with further notes."""
        return self.but(notes=(*self.view.notes, *more))

    def in_memory(self, table: Events | Frames | None = None, marks: Marks | None = None, **facts: Any) -> InMemory:
        """Return this view, or another table of it, as a source in memory."""
        table, marks = self.table if table is None else table, self.marks if marks is None else marks
        told = replace(self.facts, **{"lost": self.lost, **facts})
        return InMemory(told, table, marks, self.verdict, self.counts)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what is in memory, so that a pickle does not need the file."""
        view = View(self.view.start, self.view.stop, clock=self.view.clock)
        return SourceView, (self.in_memory(), view)


def held_at(table: Events | Frames, held: NDArray[np.float32] | None, start: float) -> NDArray[np.float32] | None:
    """Return the values that the taxels held at a time (us), as far as they are known."""
    if not isinstance(table, Events) or table.present is None or np.isinf(start):
        return held
    earlier = table.between(-np.inf, start)
    if earlier.present is None or not earlier.present.any():
        return held
    unknown = float(_core.UNKNOWN)
    begins = (
        np.full(table.array.shape, unknown, np.float32) if held is None else np.where(np.isnan(held), unknown, held)
    )
    values = _core.HeldValues(earlier, None, begins.astype(np.float32).reshape(-1))
    at = values.at(np.array([earlier.t.max()])).reshape(table.array.shape)
    return np.where(at == unknown, np.nan, at).astype(np.float32)


def ticks_of(held: NDArray[np.float32] | None) -> NDArray[np.uint16] | None:
    """Return held values as files hold them, row by row: 65 535 for one that is not known."""
    if held is None:
        return None
    return np.where(np.isnan(held), _core.UNKNOWN, held).astype(np.uint16).reshape(-1)


def share_clock(sources: Mapping[str, SourceView]) -> bool:
    """Return whether sources have one clock: frames without arrival times, as those of two feet, or by `on_clock`."""
    views = [source.view for source in sources.values()]
    if all(view.clock is not None for view in views):
        return True
    return all(not source.facts.has_events and source.clock is None for source in sources.values())


def one_clock(sources: Mapping[str, SourceView], name: str) -> dict[str, SourceView]:
    """Return sources by the clock of one of them, or of the host.

    Raises
    ------
    ProblemError : no such source, one without arrival times, or slices
    """
    first = next(iter(sources.values()))
    path = first.facts.path
    if any(source.view.is_slice for source in sources.values()) and first.view.clock is None:
        raise ProblemError(f"{path}: was already cut with between; call on_clock({name!r}) before between")
    if name not in (*sources, "host"):
        raise ProblemError(f"{path}: has no clock {name!r}; must be one of {', '.join((*sources, 'host'))}")
    if first.view.clock is not None:
        raise ProblemError(f"{path}: is already on the clock of {first.view.clock}")
    to = None if name == "host" else _clock(sources[name])
    return {
        label: source.on_clock(name, None if label == name else _between_clocks(_clock(source), to))
        for label, source in sources.items()
    }


def _clock(source: SourceView) -> Clock:
    clock = source.clock
    if clock is None or not len(clock.board_us):
        raise ProblemError(
            f"{source.facts.path}: source {source.facts.label!r} has no arrival times, so its clock is not known"
        )
    return clock


def _between_clocks(clock: Clock, to: Clock | None) -> Times:
    """Return a function that converts times of one clock to those of another; None is the host's, us since 1970."""

    def times(t: NDArray[np.int64]) -> NDArray[np.int64]:
        host = clock.host_ns(np.asarray(t, np.int64))
        return np.asarray((host + 500) // 1000 if to is None else to.board_us_at(host), np.int64)

    return times
