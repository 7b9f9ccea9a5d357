"""Writes the live format: datagrams as received, or made of events, with all other records."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.messages import first_line
from taxel._core import ProblemError, RecordingWriter
from taxel.clock import Clock
from taxel.events import Events
from taxel.frames import Frames
from taxel.reading import Datagrams
from taxel.recording.source import SourceView, ticks_of

__all__ = ["RecordingWriter", "encode_events", "write_mcap"]

#: Number of values of a block of frames: a chunk of the file.
_BLOCK = 1 << 18
#: The most numbers of repaired events in the description of a file, which is limited to 16 MiB.
_MOST = 1_000_000
#: From one preview to the next, us, as in recordings of a board.
_PREVIEW_US = 100_000


def write_mcap(path: Path, sources: Mapping[str, SourceView], compression: str) -> tuple[str, ...]:
    """Write a .mcap of a board, or of sources of frames by one clock.

    Parameters
    ----------
    path : Path
    sources : mapping from str to SourceView
    compression : {"none", "lz4", "zstd"}

    Returns
    -------
    tuple of str
        A line for each kind of information that is not there any more.

    Raises
    ------
    ProblemError : events that a .mcap cannot hold
    OSError : the disk is full ...
    """
    first = next(iter(sources.values()))
    if isinstance(first.table, Events):
        return _write_board(path, first, first.table, first.received, compression)
    _write_frames(path, sources, compression)
    return tuple(dict.fromkeys(line for source in sources.values() for line in source.lost))


def _write_board(
    path: Path, source: SourceView, events: Events, datagrams: Datagrams | None, compression: str
) -> tuple[str, ...]:
    """Write the datagrams of a board, or new ones made of its events; return what is lost."""
    lost = source.lost
    if datagrams is None:
        if source.facts.raw:
            lost = tuple(dict.fromkeys((*lost, "raw datagrams")))
        clock = source.clock
        datagrams = encode_events(
            events, source.marks.held, clock if clock is not None and len(clock.board_us) else None
        )
        if len(datagrams.unmarked) > _MOST:
            lost = (*lost, f"the fact that {len(datagrams.unmarked) - _MOST} of the events are repaired")
    # Host times before 1970 are not possible, so all board times are shifted together.
    earliest = int(datagrams.arrived_ns[0]) if len(datagrams) else 0
    arrived = datagrams.arrived_ns - min(0, earliest)
    started = int(arrived[0]) if len(arrived) else 0
    header = {
        **_header(source, lost),
        "repaired": datagrams.unmarked[:_MOST],
        "difference": datagrams.differences,
        "origin_us": datagrams.origin_us,
        "started_ns": started,
    }
    writer = RecordingWriter(path, json.dumps(header), compression, True)
    # Written before all datagrams, as the recorder does, because a player reads it there.
    if (held := ticks_of(source.marks.held)) is not None:
        writer.held(started, None, held)
    done = 0
    # Commands of the host are written between the datagrams before and after them, an order that the decoder needs.
    for change in source.marks.changes:
        upto = int(np.searchsorted(datagrams.arrived_ns, change.at_ns, side="left"))
        _add_datagrams(writer, datagrams, arrived, done, max(done, upto))
        writer.board_change(max(0, change.at_ns), json.dumps(change._described()))
        done = max(done, upto)
    _add_datagrams(writer, datagrams, arrived, done, len(arrived))
    _add_remarks(writer, events, source)
    writer.finish(json.dumps(_counts(source, len(datagrams))))
    return lost


def _counts(source: SourceView, received: int) -> dict[str, Any]:
    """Return the counts of a recording under the names of the live format."""
    if source.facts.kind == "events":
        # Nothing is missing of what was made here.
        return {"received": received, "missing": 0}
    if not source.facts.has_events:
        return {"received": received}
    counts = source.counts
    known = {name: counts.get(name) or 0 for name in ("dropped_by_queue", "received")}
    by_kernel = counts.get("dropped_by_kernel")
    # Where it is not counted it is unknown; a file without its end says nothing of it.
    known["dropped_by_kernel"] = by_kernel if known["received"] else by_kernel or 0
    decoder = counts.get("decoder")
    damage = _core.recording_damage(json.dumps(decoder)) if decoder else {}
    return {**known, "decoder": damage}


def _header(source: SourceView, lost: tuple[str, ...]) -> dict[str, Any]:
    """Return what a header states of a sensor."""
    facts, registers = source.facts, source.marks.registers
    is_file = facts.kind != "events"
    # `source` names the recordings that were merged.
    converted = [f"converted from {facts.name}"] * (is_file and facts.kind != "merged")
    driven = source.array if registers is None else registers.array
    return {
        "array": source.array._geometry(),
        "registers": None if registers is None else registers._held,
        **({} if driven == source.array else {"driven": driven._geometry()}),
        # The verdict is here and not with the final counts, so that a file that was cut still states it.
        "converted": source.verdict._held if is_file else None,
        "counts": dict(source.counts),
        "lost": lost,
        "remarks": tuple(dict.fromkeys((*facts.remarks, *converted))),
        "source": facts.source or facts.name or ("events" if facts.has_events else "frames"),
        "side": facts.side,
        "heel": facts.heel,
    }


def _write_frames(path: Path, sources: Mapping[str, SourceView], compression: str) -> None:
    """Write sources of frames; times in the file are those of arrival, else those of their one clock, from 0 on."""
    tables = {name: cast("Frames", source.table) for name, source in sources.items()}
    origin_us = min([0, *(int(table.t[0]) for table in tables.values() if len(table))])
    headers = [
        {
            **_header(source, source.lost),
            "name": source.facts.label,
            "frames": {
                "unit": tables[name].unit,
                "clock": source.facts.timed,
                "columns": source.facts.columns,
                "turned": source.facts.turned,
                "frame_us": source.facts.frame_us,
                "arrivals": source.clock is not None,
            },
        }
        for name, source in sources.items()
    ]
    header = {**headers[0], "sources": headers[1:], "started_ns": 0}
    writer = RecordingWriter(path, json.dumps(header), compression, True)
    tracks = {name: writer.track(source.facts.label) for name, source in sources.items()}

    def at_ns(t: int) -> int:
        return max(0, (t - origin_us) * 1000)

    for name, source in sources.items():
        if (held := ticks_of(source.marks.held)) is not None:
            tracks[name].held(0, None, held)
        for change in source.marks.changes:
            tracks[name].board_change(max(0, change.at_ns), json.dumps(change._described()))
    for name, first, block, fits in _blocks(tables):
        t = np.ascontiguousarray(block.t)
        values = np.ascontiguousarray(block.values).reshape(-1)
        clock = sources[name].clock
        arrived = (t - origin_us) * 1000 if clock is None else np.asarray(clock.host_ns(t), np.int64)
        tracks[name].frames(first, arrived, t, values, fits)
    for name, source in sources.items():
        _add_small(tracks[name], source, at_ns)
    counts = {name: json.dumps(_counts(source, len(tables[name]))) for name, source in sources.items()}
    for name in [*sources][1:]:
        tracks[name].end(counts[name])
    writer.finish(counts[next(iter(sources))])


def _blocks(tables: Mapping[str, Frames]) -> Iterator[tuple[str, int, Frames, bool]]:
    """Yield name, number of the first frame, frames, and whether 16 bits hold them, of all sources by time."""
    fits = {name: _core.whole_frames(np.ascontiguousarray(table.values).reshape(-1)) for name, table in tables.items()}
    done = dict.fromkeys(tables, 0)
    blocks = {name: max(1, _BLOCK // max(1, table.array.rows * table.array.columns)) for name, table in tables.items()}
    while left := {name: table for name, table in tables.items() if done[name] < len(table)}:
        # The block of the source that comes first, and what the others have until its end.
        first = min(left, key=lambda name: left[name].t[done[name]])
        end = left[first].t[min(done[first] + blocks[first], len(left[first])) - 1]
        for name, frames in left.items():
            stop = min(int(np.searchsorted(frames.t, end, side="right")), done[name] + blocks[name])
            if stop > done[name]:
                yield name, done[name], frames[done[name] : stop], fits[name]
                done[name] = stop


def encode_events(events: Events, held: NDArray[np.float32] | None, clock: Clock | None) -> Datagrams:
    """Return events as datagrams of wire version 2, without loss.

    Parameters
    ----------
    events : Events
    held : float32, shape (rows, columns), ticks, optional
        The values that the taxels held at the beginning; NaN for unknown.
    clock : Clock, optional
        If given, each datagram promises a time and has the host's time for it as its arrival time, so that a reader
        computes the same clock; otherwise datagrams promise no time, and a reader finds no clock.

    Returns
    -------
    Datagrams
        With the numbers of the repaired events that no state of a taxel can encode (`unmarked`).

    Raises
    ------
    ProblemError : an array of more than 65 536 positions, or times more than 8.9 years apart
    """
    try:
        encoded = _core.encode_datagrams(events, ticks_of(held), clock is not None)
    except ProblemError as error:
        smaller = "to make fewer taxels of an event camera's file, use region and bin"
        raise ProblemError(f"{first_line(error)}; write such events to a .npz, .h5 or .csv; {smaller}") from None
    at = (
        encoded.times * 1000
        if clock is None or not len(encoded.times)
        else np.asarray(clock.host_ns(encoded.times), np.int64)
    )
    # Arrival times never decrease.
    arrived = np.maximum.accumulate(at) if len(at) else at
    return Datagrams(
        arrived,
        np.arange(len(arrived), dtype=np.uint64),
        encoded.offsets,
        encoded.payload,
        version=2,
        origin_us=encoded.origin_us,
        unmarked=tuple(encoded.unmarked.tolist()),
    )


def _add_datagrams(writer: Any, datagrams: Datagrams, arrived: NDArray[np.int64], first: int, last: int) -> None:
    if last > first:
        writer.datagrams(
            arrived[first:last], datagrams.number[first:last], datagrams.offsets[first : last + 1], datagrams.payload
        )


def _by_host(source: SourceView) -> Callable[[int], int]:
    """Return the function of a source's times, us, to those in the file, ns: by its clock where that is known."""
    clock = source.clock
    has_times = clock is not None and len(clock.board_us) > 0
    return lambda t: max(0, int(clock.host_ns(t)) if has_times and clock is not None else t * 1000)


def _add_remarks(writer: Any, events: Events, source: SourceView) -> None:
    at_ns = _by_host(source)
    for t, start in events.markers:
        writer.marker(at_ns(t), t, start)
    if events.intensity is not None:
        _add_previews(writer, events, at_ns)
    _add_small(writer, source, at_ns)


def _add_previews(writer: Any, events: Events, at_ns: Callable[[int], int]) -> None:
    """Write what taxels hold, for viewers: at each multiple of 100 ms, if an event occurred in the 100 ms up to it."""
    times = np.unique(-(-events.t // _PREVIEW_US) * _PREVIEW_US)
    held = _core.HeldValues(events, None, None)
    for t in times.tolist():
        writer.preview(at_ns(t), t, held.at(np.array([t])).astype(np.uint16))


def _add_small(writer: Any, source: SourceView, at_ns: Callable[[int], int]) -> None:
    """Write notes, zeroed taxels, registers and detections."""
    for note in source.marks.notes:
        writer.note(note.at_ns, note.t, note.text)
    for zeroing in source.marks.zeroings:
        writer.zeroing(at_ns(zeroing.t), (zeroing.t, zeroing.x, zeroing.y, zeroing.rest, zeroing.before))
    for at, values in source.marks.settings:
        writer.registers(at, values._json())
    for d in source.marks.detections:
        writer.detection(at_ns(d.known), (d.label, d.t, d.known, d.slope, d.repaired))
