"""Merges recordings of one sensor into one: in sequence, or by their times."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from taxel._base.arguments import finite, instance, several
from taxel._core import ProblemError
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import Facts, InMemory, Marks, Times, Zeroing
from taxel.recording.recording import Recording
from taxel.recording.source import SourceView
from taxel.verdict import Verdict


def merge(recordings: Iterable[Recording], *, gap_us: float | None = None) -> Recording:
    """Merge recordings of one sensor.

    Parameters
    ----------
    recordings : iterable of Recording
        All of events, or all of frames in one unit.
    gap_us : float, us, 0 or more, optional
        Pause between the end of a recording and the next one, which is shifted to follow it; default: all keep their
        times (one clock).

    Returns
    -------
    Recording
        In memory; `taxel.convert` writes it. A note with its name marks the beginning of each recording, so that `cut`
        finds it. It has the registers and the values at the beginning of the first recording, and no arrival times.

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
    parts = [instance("recordings", part, Recording)._only for part in several("recordings", recordings)]
    gap = None if gap_us is None else finite("gap_us", gap_us, least=0.0, most=2.0**52)
    if not parts:
        raise ProblemError("recordings: there must be one or more")
    _check(parts)
    return Recording({"board": SourceView(_merged(parts, _shifts([part.table for part in parts], gap)))})


def _check(parts: Sequence[SourceView]) -> None:
    """Refuse events among frames, and parts of other sensors or in other units."""
    first = parts[0]
    for part in parts:
        if part.facts.has_events != first.facts.has_events:
            events, frames = (first, part) if first.facts.has_events else (part, first)
            raise ProblemError(
                f"recordings: {events.facts.name} contains events, but {frames.facts.name} contains frames; convert "
                "one of them first"
            )
        if not first.array.fits(part.array):
            raise ProblemError(
                f"{part.facts.name} has {part.array!r}, {first.facts.name} has {first.array!r}; only recordings of one "
                "sensor can be merged"
            )
    units = {part.table.unit for part in parts if isinstance(part.table, Frames)}
    if len(units) > 1:
        raise ProblemError(f"recordings: the frames are in {' and '.join(sorted(units))}; must be in one unit")


def _shifts(tables: Sequence[Events | Frames], gap: float | None) -> list[int]:
    """Return the time that is added to each recording, us."""
    shifts: list[int] = []
    free: int | None = None
    for table in tables:
        first = int(table.t.min()) if len(table) else 0
        shifts.append(0 if gap is None or free is None else free - first)
        if len(table) and gap is not None:
            free = int(table.t.max()) + shifts[-1] + max(1, round(gap))
    return shifts


def _merged(parts: Sequence[SourceView], shifts: Sequence[int]) -> InMemory:
    """Return recordings of one sensor as one source in memory."""
    later: list[Times] = [partial(np.add, shift) for shift in shifts]
    tables = [part.table if not k else part.table._moved(t) for part, k, t in zip(parts, shifts, later, strict=True)]
    events = [table for table in tables if isinstance(table, Events)]
    table: Events | Frames = (
        Events._joined(events).sorted()
        if events
        else Frames._joined([table for table in tables if isinstance(table, Frames)])
    )
    marks = [part.marks.moved(times) for part, times in zip(parts, later, strict=True)]
    begins = [int(each.t.min()) if len(each) else shift for each, shift in zip(tables, shifts, strict=True)]
    notes = [Note(part.facts.name, begin, 0) for part, begin in zip(parts, begins, strict=True)]
    notes += [note for each in marks for note in each.notes]
    found = Detections([], [], [])
    for each in marks:
        found += each.detections
    facts = [part.facts for part in parts]
    names = ", ".join(each.name for each in facts)
    # What they do not all state alike is not stated.
    stated = {key: {getattr(each, key) for each in facts} for key in ("side", "heel", "columns", "turned", "frame_us")}
    agreed: dict[str, Any] = {key: values.pop() for key, values in stated.items() if len(values) == 1}
    lost = dict.fromkeys(line for part in parts for line in part.lost)
    for part in parts:
        if part.array != table.array and (part.array._is_measured or part.array.names is not None):
            lost[f"how {part.facts.name} describes the sensor otherwise"] = None
    zeroings = _zeroings(tables, marks)
    if zeroings is None:
        zeroings, lost["zeroed taxels (they would change the rest in a recording without them)"] = (), None
    return InMemory(
        Facts(
            path=Path("merged"),
            array=table.array,
            kind="merged",
            source=f"merged of {names}",
            timed=any(each.timed for each in facts),
            remarks=tuple(dict.fromkeys(line for each in facts for line in each.remarks)),
            lost=tuple(lost),
            truncated=any(each.truncated for each in facts),
            **agreed,
        ),
        table,
        Marks(
            notes=tuple(sorted(dict.fromkeys(notes), key=lambda note: (note.t is None, note.t or 0))),
            detections=found,
            zeroings=zeroings,
            changes=tuple(dict.fromkeys(change for each in marks for change in each.changes)),
            registers=marks[0].registers,
            settings=marks[0].settings,
            held=marks[int(np.argmin(begins))].held,
        ),
        _verdict(parts, shifts),
        _counts(parts),
    )


def _counts(parts: Sequence[SourceView]) -> dict[str, Any]:
    """Return the counts of the file of each part, by the names that the verdict has."""
    counts, seen = dict[str, Any](), Counter[str]()
    for part in {each.facts.path: each for each in parts if each.counts}.values():
        name = part.facts.name
        seen[name] += 1
        counts[name if seen[name] == 1 else f"{name} ({seen[name]})"] = dict(part.counts)
    return counts


def _verdict(parts: Sequence[SourceView], shifts: Sequence[int]) -> Verdict:
    """Return the verdict on the files of several parts: slices of one source, and damage of one file, count once."""
    files: dict[Path | int, dict[str, tuple[str, Verdict]]] = {}
    for part, shift in zip(parts, shifts, strict=True):
        facts = part.facts
        of_file = files.setdefault(id(part.reader) if facts.kind == "merged" else facts.path, {})
        of_file.setdefault(f"{facts.name} {facts.label}", (facts.name, part.verdict._later(shift)))
    each = [[*of_file.values()] for of_file in files.values()]
    together = [of[0] if len(of) == 1 else (of[0][0], Verdict._of_sources(of)) for of in each]
    return together[0][1] if len(together) == 1 else Verdict._together(together)


def _zeroings(tables: Sequence[Events | Frames], marks: Sequence[Marks]) -> tuple[Zeroing, ...] | None:
    """Return the zeroed taxels of all recordings; None if one of them would change a rest in another recording."""
    together = tuple(sorted({z for each in marks for z in each.zeroings}, key=lambda z: (z.t, z.x, z.y)))
    for table, each in zip(tables, marks, strict=True):
        stop = int(table.t.max()) + 1 if len(table) else 0
        if {z for z in together if z.t < stop} != {z for z in each.zeroings if z.t < stop}:
            return None
    return together
