"""Merges recordings into one: in sequence, by their times, or with their sensors side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import flag, instance, number, several, shown
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array, names_beside
from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events, repaired_of
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording.changes import Zeroing
from taxel.recording.contents import UNKNOWN, Contents, anything, named
from taxel.recording.fates import after
from taxel.recording.kinds import verdict_of
from taxel.recording.recording import Recording
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

__all__ = ["merge", "merged"]


def merge(recordings: Iterable[Recording], *, gap_us: float | None = None, beside: bool = False) -> Recording:
    """Merge recordings of one sensor in time, or of several sensors side by side.

    Parameters
    ----------
    recordings : iterable of Recording
        All of events, or all of pictures in one unit.
    gap_us : float, us, 0 or more, optional
        Pause between the end of a recording and the next one, which is shifted to follow it; default: all keep their
        times (one clock).
    beside : bool
        Whether to place the sensors side by side, left to right, as one sensor with all their columns; pictures must
        then have equal times. Otherwise the sensors must be equal.

    Returns
    -------
    Recording
        In memory; `taxel.convert` writes it. A note with its name marks the beginning of each recording, so that `cut`
        finds it. Registers, changes of the board, zeroed taxels, counts, arrival times and the values held at the
        beginning are carried if the recordings agree; otherwise `Recording.lost` lists them.

    Raises
    ------
    ProblemError : nothing to merge, sensors that differ, events among pictures, or pictures at one time twice

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
    parts = [instance("recordings", part, Recording) for part in several("recordings", recordings)]
    flag("beside", beside)
    gap = None if gap_us is None else number("gap_us", gap_us)
    if gap is not None and not 0 <= gap < 2**52:
        raise ProblemError(f"gap_us is {shown(gap_us)}: must be 0 or more")
    if not parts:
        raise ProblemError("recordings: there must be one or more")
    return Recording(merged([part._contents for part in parts], gap, beside=beside))


def merged(parts: Sequence[Contents], gap: float | None = None, *, beside: bool = False) -> Contents:
    """Return the contents of several recordings as those of one; arguments and errors are those of `merge`."""
    if len({part.has_events for part in parts}) > 1:
        ours, other = parts[0], next(part for part in parts if part.has_events != parts[0].has_events)
        of_events, of_pictures = (ours, other) if ours.has_events else (other, ours)
        raise ProblemError(
            f"recordings: {of_events.name} holds events, {of_pictures.name} pictures; convert one of them first"
        )
    tables = [part.table for part in parts]
    shifts = _shifts(tables, gap)
    array, lefts = _side_by_side(tables) if beside else (_common(parts, tables), [0] * len(parts))
    lost = [
        f"the pitch or places of {p.name} ({p.array._apart()})"
        for p in parts
        if p.array._is_measured and (p.array.pitch_mm, p.array.places) != (array.pitch_mm, array.places)
    ]
    lost += [
        f"the names of the taxels of {p.name}" for p in parts if not beside and p.array.names not in (None, array.names)
    ]
    has_events = parts[0].has_events
    events = _events([t for t in tables if isinstance(t, Events)], shifts, array, lefts) if has_events else None
    frames = None if has_events else _frames([t for t in tables if isinstance(t, Frames)], shifts, array, beside)
    common = _Common(parts, lost)
    fields: dict[str, Any] = {}
    fields["registers"] = common("registers", None, "the board's registers (the recordings differ)", _same_registers)
    fields["register_changes"] = common("register_changes", (), "the settings of the registers (the recordings differ)")
    changes = [tuple(_at(c.t, shift, c) for c in part.board_changes) for part, shift in zip(parts, shifts, strict=True)]
    fields["board_changes"] = _agreed(changes, (), "the changes of the board (the recordings differ)", lost)
    fields["counts"] = common("counts", {}, "what each received and lost, by cause (the recordings differ)")
    fields["rebuilt"] = common("rebuilt", {}, "what reading each had to put up with (the recordings differ)")
    for name, what in (("side", "the side"), ("heel", "where the heel lies")):
        fields[name] = common(name, "", f"{what} (the recordings differ)")
    fields["columns"] = None if beside else common("columns", None, "the names of the columns (the recordings differ)")
    if beside and any(part.columns is not None for part in parts):
        fields["columns"] = tuple(name for part in parts for name in part.columns or ())
    fields["untimed"] = all(part.untimed for part in parts)
    fields["clock_of"] = common("clock_of", None, "by whose clock times are (the recordings differ)")
    clocks = [part.clock for part in parts]
    moved = len(set(shifts)) > 1
    fields["clock"] = _agreed(clocks, None, "arrival times", lost, _same_clock if not moved else lambda _, __: False)
    calibrations = [part.calibration for part in parts]
    whose = "the calibration (the recordings differ)"
    fields["calibration"] = _agreed(calibrations, None, whose, lost, _same_calibration)
    if beside and fields["calibration"] is not None and len(parts) > 1:
        fields["calibration"] = None
        lost.append("the calibration (it is of one of the sensors)")
    fields["zeroings"] = _zeroings(parts, shifts, lefts, lost, beside=beside)
    fields["held"] = _beside_held(parts, array, lefts) if beside else _held(parts, tables, shifts, lost)
    of_files = _of_files(parts, shifts)
    together = after(
        "merge",
        parts[0].but(lost=tuple(dict.fromkeys(line for part in parts for line in part.lost))),
        lambda: [*_others(parts), *lost],
        path=Path("merged"),
        name="merged",
        kind="merged",
        label="board",
        source="merged of " + ", ".join(part.name for part in parts),
        array=array,
        events=events,
        frames=frames,
        notes=_notes(parts, tables, shifts),
        detections=_detections(parts, shifts),
        verdict=None if all(p.verdict is None for p in parts) else Verdict._together(of_files),
        remarks=named([(part.name, part.remarks) for part in parts]),
        truncated=any(part.truncated for part in parts),
        **fields,
    )
    # `lost` is stored as a value, not as a function of the parts, so that the parts can be freed.
    return together.but(lost=together.lost)


def _of_files(parts: Sequence[Contents], shifts: Sequence[int]) -> list[tuple[str, Verdict]]:
    """Return name and verdict of each file or merged recording of which there are parts.

    Stretches of one recording, in memory or in files of their own, have the losses of the whole, which count once;
    sources of one file share its damage.
    """
    files: dict[str, Any] = {}
    verdicts: dict[Any, dict[Any, dict[Verdict, tuple[str, Verdict]]]] = {}
    for part, shift in zip(parts, shifts, strict=True):
        said = verdict_of(part)
        file = id(said) if part.kind == "merged" else part.path
        if said.stretch_of is not None:
            file = files.setdefault(said.stretch_of, said.stretch_of if part.kind == "merged" else file)
        source = part.label if said.stretch_of is not None else (part.name, part.label)
        verdicts.setdefault(file, {}).setdefault(source, {}).setdefault(said, (part.name, said._later(shift)))
    of_files = []
    for sources in verdicts.values():
        each = [(next(iter(own.values()))[0], Verdict._of_stretches(own.values())) for own in sources.values()]
        of_files.append((each[0][0], Verdict._of_sources(each)))
    return of_files


def _at(t: int | None, shift: int, change: Any) -> Any:
    """Return a change of the board at its time in the merged recording."""
    return type(change)(None if t is None else t + shift, change.at_ns, change.change, change.version, change.asked)


class _Common:
    """Merges a field: the common value if all recordings agree, else the empty value and a line of `lost`."""

    def __init__(self, parts: Sequence[Contents], lost: list[str]) -> None:
        self.parts, self.lost = parts, lost

    def __call__(
        self, name: str, empty: Any, line: str, same: Callable[[Any, Any], bool] = lambda a, b: bool(a == b)
    ) -> Any:
        return _agreed([getattr(part, name) for part in self.parts], empty, line, self.lost, same)


def _agreed(
    values: Sequence[Any],
    empty: Any,
    line: str,
    lost: list[str],
    same: Callable[[Any, Any], bool] = lambda a, b: bool(a == b),
) -> Any:
    first = values[0]
    if all(one is first or same(first, one) for one in values[1:]):
        return first
    if any(map(anything, values)):
        lost.append(line)
    return empty


def _same_registers(a: Registers | None, b: Registers | None) -> bool:
    return a is not None and b is not None and a == b and a.array == b.array


def _same_clock(a: Clock | None, b: Clock | None) -> bool:
    if a is None or b is None:
        return False
    return np.array_equal(a.board_us, b.board_us) and np.array_equal(a.arrived_ns, b.arrived_ns)


def _same_calibration(a: Calibration | None, b: Calibration | None) -> bool:
    return a is not None and b is not None and a.to_json() == b.to_json()


def _others(parts: Sequence[Contents]) -> list[str]:
    """Return the lines of `lost` for all recordings but the first, whose lines the table of fates gives."""
    lines: list[str] = []
    for part in parts[1:]:
        lines += ["raw datagrams"] * part.holds("datagrams")
        lines += ["raw bytes (words that are no events)"] * part.holds("payload")
        lines += ["the lines of the stream as they came"] * part.holds("samples")
        lines += [f"the source {name}" for name in part.sources if name != part.label]
    return lines


def _notes(parts: Sequence[Contents], tables: Sequence[Events | Frames], shifts: Sequence[int]) -> tuple[Note, ...]:
    """Return all notes by time, and a note with its name at the beginning of each recording."""
    notes: list[Note] = []
    for part, own, shift in zip(parts, tables, shifts, strict=True):
        notes.append(Note(part.name, int(own.t.min()) + shift if len(own) else shift, 0))
        notes += [Note(n.text, None if n.t is None else n.t + shift, n.at_ns) for n in part.notes]
    return tuple(sorted(notes, key=lambda note: (note.t is None, note.t or 0)))


def _detections(parts: Sequence[Contents], shifts: Sequence[int]) -> Detections:
    """Return all detections in the order of `known`."""
    rows: list[Any] = []
    for part, shift in zip(parts, shifts, strict=True):
        d = part.detections
        rows += list(zip(d.label, d.t + shift, d.known + shift, d.slope, d.repaired, strict=True))
    rows.sort(key=lambda row: int(row[2]))
    label, t, known, slope, repaired = ([row[k] for row in rows] for k in range(5))
    return Detections._of(label, t, known, slope, repaired=repaired)


def _zeroings(
    parts: Sequence[Contents], shifts: Sequence[int], lefts: Sequence[int], lost: list[str], *, beside: bool
) -> tuple[Zeroing, ...]:
    """Return the zeroed taxels of all recordings, unless one of them would change a rest in another recording."""
    every = [
        [Zeroing(z.t + shift, z.x + left, z.y, z.rest, z.before) for z in part.zeroings]
        for part, shift, left in zip(parts, shifts, lefts, strict=True)
    ]
    together = tuple(sorted({z for own in every for z in own}, key=lambda z: (z.t, z.x, z.y)))
    # Sensors side by side have no taxels in common.
    for part, own, shift in zip(parts, every, shifts, strict=True):
        stop = _end(part) + shift
        if not beside and {z for z in together if z.t < stop} != {z for z in own if z.t < stop}:
            lost.append(f"{len(together)} zeroed taxels (the recordings differ)")
            return ()
    return together


def _end(part: Contents) -> int:
    """Return the first time after everything in a recording."""
    if part.stretch is not None:
        return part.stretch[1]
    t = part.table.t
    return max([int(t.max()) if len(t) else 0, *(z.t for z in part.zeroings)]) + 1


def _begin(part: Contents) -> int:
    if part.stretch is not None:
        return part.stretch[0]
    t = part.table.t
    return int(t.min()) if len(t) else 0


def _held(
    parts: Sequence[Contents], tables: Sequence[Events | Frames], shifts: Sequence[int], lost: list[str]
) -> NDArray[np.uint16] | None:
    """Return the values held at the beginning, if they and the events since imply those held in later parts."""
    every = list(zip(parts, tables, shifts, strict=True))
    every.sort(key=lambda one: _begin(one[0]) + one[2])
    first = every[0][0].held
    now = np.full(parts[0].array.shape, UNKNOWN, np.uint16) if first is None else first.copy()
    # All events by time determine the values that the taxels hold at the beginning of each recording.
    changes = [(t.t + shift, t) for _, t, shift in every if isinstance(t, Events) and t.intensity is not None]
    at = np.concatenate([t[e.present] for t, e in changes]) if changes else np.zeros(0, np.int64)
    x, y, ticks = (
        np.concatenate([getattr(e, name)[e.present] for _, e in changes]) if changes else np.zeros(0, np.uint16)
        for name in ("x", "y", "intensity")
    )
    order = np.argsort(at, kind="stable")
    done = 0
    for part, _, shift in every[1:]:
        held = part.held
        if held is None:
            continue
        upto = int(np.searchsorted(at[order], _begin(part) + shift, side="left"))
        new = order[done:upto]
        now[y[new], x[new]] = ticks[new]
        done = upto
        known = held != UNKNOWN
        if (now[known] != held[known]).any():
            lost.append(f"what {counted(int(known.sum()), 'taxel')} held where {part.name} begins")
    return first


def _beside_held(parts: Sequence[Contents], array: Array, lefts: Sequence[int]) -> NDArray[np.uint16] | None:
    """Return the values that the taxels of all sensors held at the beginning."""
    if all(part.held is None for part in parts):
        return None
    held = np.full(array.shape, UNKNOWN, np.uint16)
    for part, left in zip(parts, lefts, strict=True):
        if part.held is not None:
            held[: part.array.rows, left : left + part.array.columns] = part.held
    return held


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


def _common(parts: Sequence[Contents], tables: Sequence[Events | Frames]) -> Array:
    array = tables[0].array
    for part, table in zip(parts, tables, strict=True):
        if not array.fits(table.array):
            raise ProblemError(
                f"{part.name}: {table.array!r}, {parts[0].name}: {array!r}; different sensors are merged "
                "beside one another only"
            )
    return array


def _side_by_side(tables: Sequence[Events | Frames]) -> tuple[Array, list[int]]:
    """Return one sensor of all, and the first column of each; rows that a sensor lacks do not exist there."""
    arrays = [table.array for table in tables]
    lefts = np.cumsum([0, *(a.columns for a in arrays)]).tolist()
    rows = max(a.rows for a in arrays)
    exists = np.zeros((rows, lefts[-1]), bool)
    for left, a in zip(lefts, arrays, strict=False):
        exists[: a.rows, left : left + a.columns] = True if a.exists is None else a.exists
    name = " | ".join(dict.fromkeys(a.name for a in arrays))
    pitch = arrays[0].pitch_mm if all(a.pitch_mm == arrays[0].pitch_mm for a in arrays) else None
    names = names_beside(arrays, lefts, exists.shape)
    return Array(rows, lefts[-1], pitch, None if exists.all() else exists, name, names=names), lefts[:-1]


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
