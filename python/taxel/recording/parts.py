"""Recordings in parts: cut by time, region and label, and merged again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from taxel._base.arguments import finite, flag, instance, number, several, shown, text, window
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detections import Detections
from taxel.events import Events, repaired_of
from taxel.frames import Frames
from taxel.recording.recording import Recording, in_memory
from taxel.recording.remarks import Note, Remarks, Zeroing

__all__ = ["cut", "merge"]


def cut(
    recording: Recording,
    *,
    start_us: float = -np.inf,
    stop_us: float = np.inf,
    columns: slice | None = None,
    rows: slice | None = None,
    label: str | None = None,
    before_us: float = 500_000.0,
    after_us: float = 500_000.0,
) -> list[Recording]:
    """Cut a stretch of time, a region of the sensor, or what lies around each note of a label.

    Parameters
    ----------
    recording : Recording
    start_us, stop_us : float, us
        What is kept, by the board's clock: ``start_us <= t < stop_us``.
    columns, rows : slice, optional
        The rectangle that is kept; it becomes a sensor of its own, whose columns and rows count from 0.
    label : str, optional
        Cut around each note of this text: one recording each, of which there may be none.
    before_us, after_us : float, us
        How much around it.

    Returns
    -------
    list of Recording
        One, or one a note. Times stay the board's.

    Raises
    ------
    ProblemError : a start after its stop, or a region without a taxel

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "two.npz"
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> _ = taxel.convert(events, place)
    >>> taxel.cut(taxel.open(place), start_us=100, columns=slice(4, 8))
    [Recording(two.npz: 1 events, 200 to 200 us, 8 x 4 taxels)]
    """
    instance("recording", recording, Recording)
    start_us, stop_us = window("us", start_us, stop_us)
    around = [
        finite(name, given, "us", least=0.0) for name, given in (("before_us", before_us), ("after_us", after_us))
    ]
    kept = recording.between(start_us, stop_us)
    if label is None:
        return [_region(kept, columns, rows)]
    text("label", label)
    times = [note.t for note in kept.notes if note.text == label and note.t is not None]
    return [_region(kept.between(t - around[0], t + around[1]), columns, rows) for t in times]


def merge(recordings: Iterable[Recording], *, gap_us: float | None = None, beside: bool = False) -> Recording:
    """Merge recordings of one sensor in time, or of several sensors beside one another.

    Parameters
    ----------
    recordings : iterable of Recording
        Of events all, or of pictures all in one unit.
    gap_us : float, us, 0 or more, optional
        Put each after the end of the one before, with such a pause; left out, all keep their times (one clock).
    beside : bool
        Put the sensors beside one another, left to right, as one with all their columns; else they must be equal.
        Of pictures then the times must be equal.

    Returns
    -------
    Recording
        In memory; `taxel.convert` writes it. A note at the beginning of each says which it was, so that `cut` finds it.
        That taxels were zeroed is left out: it would hold in the others too.

    Raises
    ------
    ProblemError : nothing to merge, sensors that differ, events among pictures, or pictures at one time twice
    """
    parts = [instance("recordings", part, Recording) for part in several("recordings", recordings)]
    flag("beside", beside)
    if not parts:
        raise ProblemError("recordings: there must be one or more")
    if len({part.has_events for part in parts}) > 1:
        raise ProblemError("recordings: events among pictures; convert one kind to the other first")
    gap = None if gap_us is None else number("gap_us", gap_us)
    if gap is not None and not 0 <= gap < 2**52:
        raise ProblemError(f"gap_us is {shown(gap_us)}: must be 0 or more")
    tables = [part.events if part.has_events else part.frames() for part in parts]
    shifts = _shifts(tables, gap)
    array, lefts = _side_by_side(tables) if beside else (_common(parts, tables), [0] * len(parts))
    table = (
        _events([t for t in tables if isinstance(t, Events)], shifts, array, lefts)
        if parts[0].has_events
        else _frames([t for t in tables if isinstance(t, Frames)], shifts, array, beside)
    )
    notes: list[Note] = []
    found: list[Any] = []
    for part, own, shift in zip(parts, tables, shifts, strict=True):
        begin = int(own.t.min()) + shift if len(own) else shift
        notes.append(Note(part.name, begin, 0))
        notes += [Note(n.text, None if n.t is None else n.t + shift, n.at_ns) for n in part.notes]
        d = part.detections
        found += list(zip(d.label, d.t + shift, d.known + shift, d.slope, d.repaired, strict=True))
    found.sort(key=lambda row: int(row[2]))
    label, t, known, slope, repaired = ([row[k] for row in found] for k in range(5))
    detections = Detections._of(label, t, known, slope, repaired=repaired)
    notes.sort(key=lambda note: (note.t is None, note.t or 0))
    source = ", ".join(part.name for part in parts)
    remarks = Remarks(array=array, source=f"merged of {source}", notes=tuple(notes), detections=detections)
    return in_memory(Path("merged"), "merged", table, remarks)


def _region(recording: Recording, columns: slice | None, rows: slice | None) -> Recording:
    """Return the part of a recording within a rectangle, as a sensor of its own; without one as it is."""
    if columns is None and rows is None:
        return recording
    across, down = (slice(None) if chosen is None else chosen for chosen in (columns, rows))
    array = recording.array
    (left, right), (top, bottom) = array.region(across, down)
    if right <= left or bottom <= top:
        raise ProblemError(f"columns {left} to {right}, rows {top} to {bottom}: no taxel of {array!r} lies there")
    exists = None if array.exists is None else array.exists[top:bottom, left:right]
    small = Array(bottom - top, right - left, array.pitch_mm, exists, array.name)
    table: Events | Frames
    if recording.has_events:
        inside = recording.events.region(across, down)
        more: dict[str, Any] = {}
        if inside.intensity is not None:
            more = {"intensity": inside.intensity, "present": inside.present}
        more["repaired"] = inside.repaired
        x, y = inside.x.astype(np.int64) - left, inside.y.astype(np.int64) - top
        table = Events(inside.t, x, y, inside.p, array=small, markers=inside.markers, **more)
    else:
        table = recording.frames().region(across, down)
    zeroings = tuple(
        Zeroing(z.t, z.x - left, z.y - top, z.rest, z.before)
        for z in (recording.zeroings if recording.has_events else ())
        if left <= z.x < right and top <= z.y < bottom
    )
    remarks = Remarks(
        array=small,
        source=recording.source,
        notes=recording.notes,
        detections=recording.detections,
        zeroings=zeroings,
    )
    return in_memory(recording.path, recording.kind, table, remarks, name=recording.name)


def _shifts(tables: Sequence[Events | Frames], gap: float | None) -> list[int]:
    """Return what is added to the times of each."""
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


def _common(parts: list[Recording], tables: Sequence[Events | Frames]) -> Array:
    array = tables[0].array
    for part, table in zip(parts, tables, strict=True):
        if table.array != array:
            raise ProblemError(
                f"{part.name}: {table.array!r}, {parts[0].name}: {array!r}; different sensors are merged "
                "beside one another only"
            )
    return array


def _side_by_side(tables: Sequence[Events | Frames]) -> tuple[Array, list[int]]:
    """Return one sensor of all, and the first column of each; what one has fewer rows does not exist."""
    arrays = [table.array for table in tables]
    lefts = np.cumsum([0, *(a.columns for a in arrays)]).tolist()
    rows = max(a.rows for a in arrays)
    exists = np.zeros((rows, lefts[-1]), bool)
    for left, a in zip(lefts, arrays, strict=False):
        exists[: a.rows, left : left + a.columns] = True if a.exists is None else a.exists
    name = " | ".join(dict.fromkeys(a.name for a in arrays))
    return Array(rows, lefts[-1], arrays[0].pitch_mm, None if exists.all() else exists, name), lefts[:-1]


def _events(tables: list[Events], shifts: list[int], array: Array, lefts: list[int]) -> Events:
    t = np.concatenate([table.t + shift for table, shift in zip(tables, shifts, strict=True)])
    order = np.argsort(t, kind="stable")
    x = np.concatenate([table.x.astype(np.int64) + left for table, left in zip(tables, lefts, strict=True)])
    y, p = (np.concatenate([getattr(table, name) for table in tables]) for name in ("y", "p"))
    more: dict[str, Any] = {}
    if any(table.intensity is not None for table in tables):
        none = [np.zeros(len(table), np.uint16) for table in tables]
        held = [table.intensity if table.intensity is not None else z for table, z in zip(tables, none, strict=True)]
        there = [
            table.present if table.present is not None else z.astype(bool)
            for table, z in zip(tables, none, strict=True)
        ]
        more = {"intensity": np.concatenate(held)[order], "present": np.concatenate(there)[order]}
    repaired = repaired_of(tables)
    if repaired is not None:
        more["repaired"] = repaired[order]
    markers = sorted(
        (at + shift, start) for table, shift in zip(tables, shifts, strict=True) for at, start in table.markers
    )
    return Events(t[order], x[order], y[order], p[order], array=array, markers=markers, **more)


def _frames(tables: list[Frames], shifts: list[int], array: Array, beside: bool) -> Frames:
    units = {table.unit for table in tables}
    if len(units) > 1:
        raise ProblemError(f"recordings: pictures in {' and '.join(sorted(units))}; must be in one unit")
    times = [table.t + shift for table, shift in zip(tables, shifts, strict=True)]
    if beside:
        if any(not np.array_equal(t, times[0]) for t in times):
            raise ProblemError("recordings: pictures beside one another must have the same times")
        values = np.zeros((len(times[0]), *array.shape), np.float32)
        left = 0
        for table in tables:
            values[:, : table.array.rows, left : left + table.array.columns] = table.values
            left += table.array.columns
        return Frames(values, times[0], unit=tables[0].unit, array=array)
    t = np.concatenate(times)
    order = np.argsort(t, kind="stable")
    return Frames(np.concatenate([table.values for table in tables])[order], t[order], unit=tables[0].unit, array=array)
