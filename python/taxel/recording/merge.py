"""Merges recordings into one: in sequence, by their times, or with their sensors side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import flag, instance, number, several, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events, repaired_of
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording import sections
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.contents import (
    BoardSource,
    Contents,
    FrameSource,
    RecordedSource,
    Stream,
    name_remarks,
    with_losses,
)
from taxel.recording.kinds import verdict_of
from taxel.recording.once import UNKNOWN, anything, known
from taxel.recording.recording import Recording
from taxel.recording.verdict import Verdict

T = TypeVar("T")
#: Contents that have their own times.
M = TypeVar("M", Note, BoardChange)


def merge(recordings: Iterable[Recording], *, gap_us: float | None = None, beside: bool = False) -> Recording:
    """Merge recordings of one sensor in time, or of several sensors side by side.

    Parameters
    ----------
    recordings : iterable of Recording
        All of events, or all of frames in one unit.
    gap_us : float, us, 0 or more, optional
        Pause between the end of a recording and the next one, which is shifted to follow it; default: all keep their
        times (one clock).
    beside : bool
        Whether to place the sensors side by side, left to right, as one sensor with all their columns; frames must
        then have equal times. Otherwise the sensors must be equal.

    Returns
    -------
    Recording
        In memory; `taxel.convert` writes it. A note with its name marks the beginning of each recording, so that `cut`
        finds it. Registers, changes of the board, zeroed taxels, counts, arrival times and the values held at the
        beginning are carried if the recordings agree; otherwise `Recording.lost` lists them.

    Raises
    ------
    ProblemError : nothing to merge, sensors that differ, events among frames, or frames at one time twice

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.npz"
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> _ = taxel.convert(events, place)
    >>> whole = taxel.open(place)
    >>> both = taxel.merge([whole.between(0, 100), whole.between(100, 300)])
    >>> both.events == events, [note.t for note in both.notes], both.lost
    (True, [0, 200], ())
    """
    sources = [instance("recordings", recording, Recording) for recording in several("recordings", recordings)]
    flag("beside", beside)
    gap = None if gap_us is None else number("gap_us", gap_us)
    if gap is not None and not 0 <= gap < 2**52:
        raise refused("gap_us", f" is {shown(gap_us)}: must be 0 or more")
    if not sources:
        raise ProblemError("recordings: there must be one or more")
    return Recording(merge_contents([recording._contents for recording in sources], gap, beside=beside))


def merge_contents(recordings: Sequence[Contents], gap: float | None = None, *, beside: bool = False) -> Contents:
    """Return the contents of several recordings as those of one; arguments and errors are those of `merge`."""
    sources = [recording.main for recording in recordings]
    if len({source.has_events for source in sources}) > 1:
        differing = next(source for source in sources if source.has_events != sources[0].has_events)
        events, frames = (sources[0], differing) if sources[0].has_events else (differing, sources[0])
        raise ProblemError(
            f"recordings: {events.origin.name} contains events, but {frames.origin.name} contains frames; convert "
            f"one of them first"
        )
    tables = [source.table for source in sources]
    shifts = _shifts(tables, gap)
    if beside:
        array, lefts = Array._beside([table.array for table in tables])
    else:
        array, lefts = _common(sources, tables), [0] * len(sources)
    merging = _Merging(sources, tables, shifts, lefts, array, beside)
    lost = [line for source in sources for line in source.losses.lost()]
    for recording, source in zip(recordings, sources, strict=True):
        lost += [
            *source.section(sections.Wire).losses(),
            *source.section(sections.SampleColumns).received(),
            *recording.others(),
        ]
    merged = merging.source()
    # `lost` is stored as a value, not as a function of the parts, so that the parts can be freed.
    return Contents.single(with_losses(merged, known((*lost, *merging.lost))))


@dataclass
class _Merging:
    """Merges sources, a type of section after the other; `lost` lists what they do not agree in."""

    sources: Sequence[RecordedSource]
    tables: Sequence[Events | Frames]
    shifts: list[int]
    lefts: list[int]
    array: Array
    beside: bool
    lost: list[str] = field(default_factory=list)

    def source(self) -> RecordedSource:
        """Return the sources as one."""
        names = ", ".join(source.origin.name for source in self.sources)
        header: dict[str, Any] = {
            "origin": sections.Origin(Path("merged"), "merged", "merged", source=f"merged of {names}"),
            "sensor": self.sensor(),
            "settings": self.settings(),
            "marks": self.marks(),
            "timing": self.timing(),
            "losses": self.losses(),
        }
        if self.sources[0].has_events:
            tables = [table for table in self.tables if isinstance(table, Events)]
            return BoardSource(
                event_table=sections.EventTable(known(_events(tables, self.shifts, self.array, self.lefts))), **header
            )
        columns = self.columns()
        if columns is None:
            return FrameSource(frame_table=self.frame_table(), **header)
        return Stream(frame_table=self.frame_table(), stream=sections.SampleColumns(columns), **header)

    def agreed(self, values: Iterable[T], empty: T, line: str, key: Callable[[T], object] = lambda value: value) -> T:
        """Return the common value if all recordings agree, else the empty value; then a line says so."""
        first, *later = all_values = list(values)
        if all(value is first or key(value) == key(first) for value in later):
            return first
        if any(map(anything, all_values)):
            self.lost.append(f"{line} (the recordings differ)")
        return empty

    def columns(self) -> tuple[str, ...] | None:
        """Return the names of the columns."""
        columns = [source.columns for source in self.sources]
        if not self.beside:
            return self.agreed(columns, None, "the names of the columns")
        return (
            tuple(name for names in columns for name in names or ())
            if any(names is not None for names in columns)
            else None
        )

    def sensor(self) -> sections.Sensor:
        """Merge what describes the sensors; what one of them says of its taxels may be lost."""
        array, sensors = self.array, [source.sensor for source in self.sources]
        for source in self.sources:
            stated, name = source.sensor.array, source.origin.name
            if stated._is_measured and (stated.pitch_mm, stated.places) != (array.pitch_mm, array.places):
                self.lost.append(f"the pitch or places of {name} ({stated._apart()})")
            if not self.beside and stated.names not in (None, array.names):
                self.lost.append(f"the names of the taxels of {name}")
        calibrations = [sensor.calibration() for sensor in sensors]
        calibration = self.agreed(calibrations, None, "the calibration", lambda stated: stated and stated.to_json())
        if self.beside and calibration is not None and len(sensors) > 1:
            self.lost.append("the calibration (it is of one of the sensors)")
            calibration = None
        return sections.Sensor(
            array,
            self.agreed((sensor.side for sensor in sensors), "", "the side"),
            self.agreed((sensor.heel for sensor in sensors), "", "where the heel is"),
            known(calibration),
        )

    def settings(self) -> sections.Settings:
        """Merge registers that are equal, and the values that the taxels held at the beginning."""
        settings = [source.settings for source in self.sources]
        registers = [state.registers() for state in settings]
        held = self.held_beside() if self.beside else self.held()
        changes = self.agreed((state.register_changes() for state in settings), (), "the settings of the registers")
        return sections.Settings(
            held=known(held),
            registers=known(
                self.agreed(registers, None, "the board's registers", lambda held: held and (held, held.array))
            ),
            register_changes=known(changes),
        )

    def marks(self) -> sections.Marks:
        """Merge what happened at a time; a note with its name is at the beginning of each recording."""
        changes, notes, found = list[tuple[BoardChange, ...]](), list[Note](), list[Any]()
        for source, table, shift in zip(self.sources, self.tables, self.shifts, strict=True):
            marks, d = source.marks, source.marks.detections()
            changes.append(tuple(_later(change, shift) for change in marks.board_changes()))
            notes.append(Note(source.origin.name, int(table.t.min()) + shift if len(table) else shift, 0))
            notes += [_later(note, shift) for note in marks.notes()]
            found += zip(d.label, d.t + shift, d.known + shift, d.slope, d.repaired, strict=True)
        found.sort(key=lambda row: int(row[2]))
        label, t, when, slope, repaired = ([row[k] for row in found] for k in range(5))
        return sections.Marks(
            board_changes=known(self.agreed(changes, (), "the changes of the board")),
            # Recordings of two sensors may have the same labels.
            notes=known(tuple(sorted(dict.fromkeys(notes), key=lambda note: (note.t is None, note.t or 0)))),
            detections=known(Detections._of(label, t, when, slope, repaired=repaired)),
            zeroings=known(self.zeroings()),
        )

    def timing(self) -> sections.Timing:
        """Merge clocks that are equal."""
        clocks = [source.timing.clock() for source in self.sources]
        clock = clocks[0]
        if len(set(self.shifts)) > 1 or not all(c is clock or _same_clock(clock, c) for c in clocks[1:]):
            self.lost += ["arrival times"] * any(map(anything, clocks))
            clock = None
        return sections.Timing(
            known(clock), self.agreed((p.timing.clock_of for p in self.sources), None, "the clock of the times")
        )

    def losses(self) -> sections.Losses:
        """Merge what was lost; counts only if they are equal."""
        losses = [source.losses for source in self.sources]
        verdict = None
        if any(source.verdict() is not None for source in losses):
            verdict = Verdict._together(_of_files(self.sources, self.shifts))
        return sections.Losses(
            counts=known(
                self.agreed(
                    (source.counts() for source in losses), {}, "the counts of received and lost data, by cause"
                )
            ),
            verdict=known(verdict),
            remarks=name_remarks([(source.origin.name, source.losses.remarks) for source in self.sources]),
            truncated=any(source.truncated for source in losses),
            rebuilt=known(
                self.agreed((source.rebuilt() for source in losses), {}, "the remarks on reading each recording")
            ),
        )

    def frame_table(self) -> sections.FrameTable:
        """Merge frames."""
        tables = [table for table in self.tables if isinstance(table, Frames)]
        frames = [source.frame_table for source in self.sources if isinstance(source, FrameSource)]
        return sections.FrameTable(
            known(_frames(tables, self.shifts, self.array, self.lefts if self.beside else None)),
            all(table.untimed for table in frames),
            self.agreed((table.turned for table in frames), None, "whether readings were inverted"),
            self.agreed((table.frame_us for table in frames), None, "the time from one frame to the next"),
        )

    def zeroings(self) -> tuple[Zeroing, ...]:
        """Return the zeroed taxels of all recordings, unless one of them would change a rest in another recording."""
        of_sources = [
            [replace(z, t=z.t + shift, x=z.x + left) for z in source.marks.zeroings()]
            for source, shift, left in zip(self.sources, self.shifts, self.lefts, strict=True)
        ]
        together = tuple(sorted({z for zeroings in of_sources for z in zeroings}, key=lambda z: (z.t, z.x, z.y)))
        # Sensors side by side have no taxels in common.
        for source, zeroings, shift in zip(self.sources, of_sources, self.shifts, strict=True):
            stop = _end(source) + shift
            if not self.beside and {z for z in together if z.t < stop} != {z for z in zeroings if z.t < stop}:
                self.lost.append(
                    f"{len(together)} zeroed taxels (they would change the rest in a recording without them)"
                )
                return ()
        return together

    def held_beside(self) -> NDArray[np.uint16] | None:
        """Return the values that the taxels of all sensors held at the beginning."""
        held = [source.settings.held() for source in self.sources]
        known_lefts = [(values, left) for values, left in zip(held, self.lefts, strict=True) if values is not None]
        return _side_by_side(np.full(self.array.shape, UNKNOWN, np.uint16), known_lefts) if known_lefts else None

    def held(self) -> NDArray[np.uint16] | None:
        """Return the values held at the beginning, if they and the events since imply those held in later parts."""
        entries = list(zip(self.sources, self.tables, self.shifts, strict=True))
        entries.sort(key=lambda entry: _begin(entry[0]) + entry[2])
        first = entries[0][0].settings.held()
        now = np.full(self.array.shape, UNKNOWN, np.uint16) if first is None else first.copy()
        # All events by time determine the values that the taxels hold at the beginning of each recording.
        changes = [(t.t + shift, t) for _, t, shift in entries if isinstance(t, Events) and t.intensity is not None]
        at = np.concatenate([t[e.present] for t, e in changes]) if changes else np.zeros(0, np.int64)
        x, y, ticks = (
            np.concatenate([getattr(e, name)[e.present] for _, e in changes]) if changes else np.zeros(0, np.uint16)
            for name in ("x", "y", "intensity")
        )
        order = np.argsort(at, kind="stable")
        done = 0
        for source, _, shift in entries[1:]:
            held = source.settings.held()
            if held is None:
                continue
            upto = int(np.searchsorted(at[order], _begin(source) + shift, side="left"))
            new = order[done:upto]
            now[y[new], x[new]] = ticks[new]
            done = upto
            known = held != UNKNOWN
            if (now[known] != held[known]).any():
                self.lost.append(
                    f"the values of {counted(int(known.sum()), 'taxel')} at the beginning of {source.origin.name}"
                )
        return first


def _later(mark: M, shift: int) -> M:
    """Return what happened at its time in the merged recording."""
    return replace(mark, t=None if mark.t is None else mark.t + shift)


def _same_clock(a: Clock | None, b: Clock | None) -> bool:
    if a is None or b is None:
        return False
    return np.array_equal(a.board_us, b.board_us) and np.array_equal(a.arrived_ns, b.arrived_ns)


def _of_files(sources: Sequence[RecordedSource], shifts: Sequence[int]) -> list[tuple[str, Verdict]]:
    """Return name and verdict of each file or merged recording of which there are parts.

    Stretches of one recording, in memory or in separate files, have the losses of the whole, which count once;
    sources of one file share its damage.
    """
    files: dict[str, Any] = {}
    verdicts: dict[Any, dict[Any, dict[Verdict, tuple[str, Verdict]]]] = {}
    for merged, shift in zip(sources, shifts, strict=True):
        verdict = verdict_of(merged)
        file = id(verdict) if merged.origin.kind == "merged" else merged.origin.path
        if verdict.stretch_of is not None:
            file = files.setdefault(verdict.stretch_of, verdict.stretch_of if merged.origin.kind == "merged" else file)
        label = merged.origin.label if verdict.stretch_of is not None else (merged.origin.name, merged.origin.label)
        verdicts.setdefault(file, {}).setdefault(label, {}).setdefault(
            verdict, (merged.origin.name, verdict._later(shift))
        )
    of_files = []
    for of_file in verdicts.values():
        of_sources = [
            (next(iter(spans.values()))[0], Verdict._of_stretches(spans.values())) for spans in of_file.values()
        ]
        of_files.append((of_sources[0][0], Verdict._of_sources(of_sources)))
    return of_files


def _end(source: RecordedSource) -> int:
    """Return the first time after everything in a recording."""
    if source.timing.interval is not None:
        return source.timing.interval()[1]
    t = source.table.t
    return max([int(t.max()) if len(t) else 0, *(z.t for z in source.marks.zeroings())]) + 1


def _begin(source: RecordedSource) -> int:
    if source.timing.interval is not None:
        return source.timing.interval()[0]
    t = source.table.t
    return int(t.min()) if len(t) else 0


def _shifts(tables: Sequence[Events | Frames], gap: float | None) -> list[int]:
    """Return the time that is added to each recording."""
    if gap is None:
        return [0] * len(tables)
    shifts: list[int] = [0]
    free: int | None = None
    for k, table in enumerate(tables):
        first = int(table.t.min()) if len(table) else 0
        if k:
            shifts.append((free if free is not None else first) - first)
        if len(table):
            free = int(table.t.max()) + shifts[-1] + max(1, round(gap))
    return shifts


def _common(sources: Sequence[RecordedSource], tables: Sequence[Events | Frames]) -> Array:
    array = tables[0].array
    for source, table in zip(sources, tables, strict=True):
        if not array.fits(table.array):
            raise ProblemError(
                f"{source.origin.name} has {table.array!r}, {sources[0].origin.name} has {array!r}; different "
                f"sensors can "
                "only be merged beside one another"
            )
    return array


def _events(tables: list[Events], shifts: list[int], array: Array, lefts: list[int]) -> Events:
    t = np.concatenate([table.t + shift for table, shift in zip(tables, shifts, strict=True)])
    order = np.argsort(t, kind="stable")
    x = np.concatenate([table.x.astype(np.int64) + left for table, left in zip(tables, lefts, strict=True)])
    y, p = (np.concatenate([getattr(table, name) for table in tables]) for name in ("y", "p"))
    more: dict[str, Any] = {}
    if any(table.intensity is not None for table in tables):
        none = [np.zeros(len(table), np.uint16) for table in tables]
        held = [table.intensity if table.intensity is not None else z for table, z in zip(tables, none, strict=True)]
        present = [
            table.present if table.present is not None else z.astype(bool)
            for table, z in zip(tables, none, strict=True)
        ]
        more = {"intensity": np.concatenate(held)[order], "present": np.concatenate(present)[order]}
    repaired = repaired_of(tables)
    if repaired is not None:
        more["repaired"] = repaired[order]
    markers = sorted(
        (at + shift, start) for table, shift in zip(tables, shifts, strict=True) for at, start in table.markers
    )
    return Events(t[order], x[order], y[order], p[order], array=array, markers=markers, **more)


def _side_by_side(filled: NDArray[Any], columns: Iterable[tuple[NDArray[Any], int]]) -> NDArray[Any]:
    """Fill values of a whole sensor with those of its parts, each beginning at a column; return them."""
    for values, left in columns:
        filled[..., : values.shape[-2], left : left + values.shape[-1]] = values
    return filled


def _frames(tables: list[Frames], shifts: list[int], array: Array, lefts: list[int] | None) -> Frames:
    """Return all frames in order of time, or those of sensors side by side, the first columns of which are `lefts`."""
    units = {table.unit for table in tables}
    if len(units) > 1:
        raise ProblemError(f"recordings: the frames are in {' and '.join(sorted(units))}; must be in one unit")
    times = [table.t + shift for table, shift in zip(tables, shifts, strict=True)]
    if lefts is not None:
        if any(not np.array_equal(t, times[0]) for t in times):
            raise ProblemError("recordings: frames that are merged beside one another must have the same times")
        zeros = np.zeros((len(times[0]), *array.shape), np.float32)
        values = _side_by_side(zeros, zip((table.values for table in tables), lefts, strict=True))
        return Frames(values, times[0], unit=tables[0].unit, array=array)
    t = np.concatenate(times)
    order = np.argsort(t, kind="stable")
    return Frames(np.concatenate([table.values for table in tables])[order], t[order], unit=tables[0].unit, array=array)
