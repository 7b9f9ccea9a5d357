"""Writes the live format: datagrams as received, or made of events, with all other records."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
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
from taxel.recording.analysis.pressure import above_rest
from taxel.recording.analysis.rest import Rest, ticks_by_unit
from taxel.recording.contents import BoardSource, Contents, FrameSource, RecordedSource, Stream
from taxel.recording.kinds import verdict_of
from taxel.recording.once import known
from taxel.recording.raw import Datagrams
from taxel.recording.recording import Recording

__all__ = ["RecordingWriter", "cut_raw", "encode_events", "write_mcap"]

#: Number of values of a block of frames: a chunk of the file.
_BLOCK = 1 << 18
#: Interval between the pictures for viewers, us.
_EVERY_US = 100_000
#: What a picture for viewers states as the rest that was subtracted, by the source of the rest.
_RESTS = {"unit": "0", "quiet": "quiet stretch"}


def write_mcap(path: Path, contents: Contents, compression: str, counts: Mapping[str, dict[str, Any]]) -> None:
    """Write a .mcap of contents as it can hold them (`taxel.recording.writers.stored.storable`).

    Parameters
    ----------
    path : Path
    contents : Contents
        Of a board with datagrams, of a stream with lines, or of frames.
    compression : {"none", "lz4", "zstd"}
    counts : mapping from str to dict
        For each source the numbers of what was received and lost, under the names of the live format.

    Raises
    ------
    OSError : the disk is full ...
    """
    main = contents.main
    samples = main.stream.samples() if isinstance(main, Stream) else None
    if samples is not None:
        header = {**samples.about, "sources": [], **_provenance(main)}
        writer = RecordingWriter(path, json.dumps(header), compression, True)
        writer.samples(samples.arrived_ns, samples.number, np.ascontiguousarray(samples.values).reshape(-1))
        _add_small(writer, main, _by_host(main))
        writer.finish(json.dumps(counts[main.origin.label]))
        return
    if not isinstance(main, BoardSource):
        frame_sources = {name: source for name, source in contents.sources.items() if isinstance(source, FrameSource)}
        _write_frames(path, frame_sources, compression, counts)
        return
    wire, events = main.wire, main.table
    datagrams = wire.datagrams()
    assert datagrams is not None  # `storable` sets them
    # Host times before 1970 are not possible, so all board times are shifted together.
    earliest = int(datagrams.arrived_ns[0]) if len(datagrams) else 0
    arrived = datagrams.arrived_ns - min(0, earliest)
    header = {
        **_header(main),
        "repaired": wire.unmarked,
        "difference": wire.differences,
        "origin_us": wire.origin_us,
        "started_ns": int(arrived[0]) if len(arrived) else 0,
    }
    writer = RecordingWriter(path, json.dumps(header), compression, True)
    # Written before all datagrams, as the recorder does, because a player reads it there.
    if (held := main.settings.held()) is not None:
        writer.held(int(arrived[0]) if len(arrived) else 0, None, np.ascontiguousarray(held).reshape(-1))
    done = 0
    # Commands of the host are written between the datagrams before and after them, an order that the decoder needs.
    for change in main.marks.board_changes():
        upto = int(np.searchsorted(datagrams.arrived_ns, change.at_ns, side="left"))
        _add_datagrams(writer, datagrams, arrived, done, max(done, upto))
        writer.board_change(max(0, change.at_ns), json.dumps(change._described()))
        done = max(done, upto)
    _add_datagrams(writer, datagrams, arrived, done, len(arrived))
    _add_remarks(writer, events, main)
    writer.finish(json.dumps(counts[main.origin.label]))


def _header(source: RecordedSource) -> dict[str, Any]:
    """Return what a header states of a sensor."""
    registers, array = source.settings.registers(), source.sensor.array
    driven = array if registers is None else registers.array
    return {
        "array": array._geometry(),
        "registers": None if registers is None else registers._held,
        **({} if driven == array else {"driven": driven._geometry()}),
        **_provenance(source),
        "source": source.origin.source,
        "side": source.sensor.side,
        "heel": source.sensor.heel,
    }


def _provenance(source: RecordedSource) -> dict[str, Any]:
    """Return what a header states of the recording that a file was made of."""
    # The verdict is here and not with the final counts, so that a file that was cut still states it.
    converted = None if source.losses.verdict() is None else verdict_of(source)._held
    counts = dict(source.losses.counts())
    return {"lost": source.losses.lost(), "remarks": source.losses.remarks, "converted": converted, "counts": counts}


def _write_frames(
    path: Path, sources: Mapping[str, FrameSource], compression: str, counts: Mapping[str, dict[str, Any]]
) -> None:
    """Write sources of frames, all by one clock; times in the file are those of the board, counted from 0."""
    tables = {name: source.table for name, source in sources.items()}
    origin_us = min([0, *(int(table.t[0]) for table in tables.values() if len(table))])
    headers = [
        {
            **_header(source),
            "name": name,
            "frames": {
                "unit": source.table.unit,
                "clock": not source.untimed,
                "columns": source.columns or (),
                "turned": source.frame_table.turned,
                "frame_us": source.frame_table.frame_us,
            },
        }
        for name, source in sources.items()
    ]
    header = {**headers[0], "sources": headers[1:], "started_ns": 0}
    writer = RecordingWriter(path, json.dumps(header), compression, True)
    tracks = {name: writer.track(name) for name in sources}

    def at_ns(t: int) -> int:
        return max(0, (t - origin_us) * 1000)

    shown = {name: _low_rate(source) for name, source in sources.items()}
    drawn = dict.fromkeys(shown, 0)
    for name, source in sources.items():
        if (held := source.settings.held()) is not None:
            tracks[name].held(0, None, np.ascontiguousarray(held).reshape(-1))
        for change in source.marks.board_changes():
            tracks[name].board_change(max(0, change.at_ns), json.dumps(change._described()))
    for name, first, block, fits in _blocks(tables):
        t = np.ascontiguousarray(block.t)
        values = np.ascontiguousarray(block.values).reshape(-1)
        tracks[name].frames(first, (t - origin_us) * 1000, t, values, fits)
        few, about = shown[name]
        stop = int(np.searchsorted(few.t, t[-1], side="right"))
        for k in range(drawn[name], stop):
            above = np.ascontiguousarray(few.values[k]).reshape(-1)
            tracks[name].preview_above(at_ns(int(few.t[k])), int(few.t[k]), above, *about)
        drawn[name] = stop
    for name, source in sources.items():
        _add_small(tracks[name], source, at_ns)
    for name in [*sources][1:]:
        tracks[name].end(json.dumps(counts[name]))
    writer.finish(json.dumps(counts[next(iter(sources))]))


def _low_rate(source: FrameSource) -> tuple[Frames, tuple[float, str, str]]:
    """Return frames above rest, ten a second, and what white is at least, the rest that was subtracted, the unit.

    There are none where frames have no times.
    """
    frames = source.table
    _, first = np.unique(frames.t // _EVERY_US, return_index=True)
    first = first[: 0 if source.untimed else None]
    few = Frames(frames.values[first], frames.t[first], unit=frames.unit, array=frames.array)
    if not len(few):
        return few, (1.0, "none", few.unit)
    recording = Recording(Contents.single(replace(source, frame_table=replace(source.frame_table, frames=known(few)))))
    above, _, rest = cast("tuple[Frames, float, Rest]", above_rest(recording))
    return above, (1.0 / ticks_by_unit(few), _RESTS.get(rest.source, rest.source), above.unit)


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


def encode_events(
    events: Events, held: NDArray[np.uint16] | None, clock: Clock | None
) -> tuple[int, Datagrams, NDArray[np.int64]]:
    """Return events as datagrams of wire version 2, without loss.

    Parameters
    ----------
    events : Events
    held : uint16, shape (rows, columns), ticks, optional
        The values that the taxels held at the beginning.
    clock : Clock, optional
        If given, each datagram promises a time and has the host's time for it as its arrival time, so that a reader
        computes the same clock; otherwise datagrams promise no time, and a reader finds no clock.

    Returns
    -------
    int, us
        Offset to be added to times in the datagrams.
    Datagrams
    int64, shape (n,)
        The numbers of repaired events that no state of a taxel can encode.

    Raises
    ------
    ProblemError : an array of more than 65 536 positions, or times more than 8.9 years apart
    """
    begins = None if held is None else np.ascontiguousarray(held).reshape(-1)
    try:
        encoded = _core.encode_datagrams(events._parts(), begins, clock is not None)
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
    datagrams = Datagrams(arrived, np.arange(len(arrived), dtype=np.uint64), encoded.offsets, encoded.payload)
    return encoded.origin_us, datagrams, encoded.unmarked


def _add_datagrams(writer: Any, datagrams: Datagrams, arrived: NDArray[np.int64], first: int, last: int) -> None:
    if last > first:
        writer.datagrams(
            arrived[first:last], datagrams.number[first:last], datagrams.offsets[first : last + 1], datagrams.payload
        )


def _by_host(source: RecordedSource) -> Callable[[int], int]:
    """Return the function of a source's times, us, to those in the file, ns: by its clock where that is known."""
    clock = source.timing.usable()
    return lambda t: max(0, t * 1000 if clock is None else int(clock.host_ns(t)))


def _add_remarks(writer: Any, events: Events, source: RecordedSource) -> None:
    at_ns = _by_host(source)
    detections = source.marks.detections()
    noted = [note.t for note in source.marks.notes() if note.t is not None]
    around = np.concatenate(
        [detections.t, detections.known, np.array([*(t for t, _ in events.markers), *noted], np.int64)]
    )
    for t, start in events.markers:
        writer.marker(at_ns(t), t, start)
    for t, ticks in _core.RecordingPreviews(events._parts(), around):
        writer.preview(at_ns(t), t, events.array.columns, ticks)
    _add_small(writer, source, at_ns)


def _add_small(writer: Any, source: RecordedSource, at_ns: Callable[[int], int]) -> None:
    """Write notes, zeroed taxels, registers and detections."""
    for note in source.marks.notes():
        writer.note(note.at_ns, note.t, note.text)
    for zeroing in source.marks.zeroings():
        writer.zeroing(at_ns(zeroing.t), zeroing.t, zeroing.x, zeroing.y, zeroing.rest, zeroing.before)
    for at, values in source.settings.register_changes():
        writer.registers(at, values._json())
    for d in source.marks.detections():
        writer.detection(at_ns(d.known), d.label, d.t, d.known, d.slope, d.repaired)


def cut_raw(raw: NDArray[np.uint8]) -> Datagrams:
    """Split raw bytes into datagrams; the arrival time of each is the board's time of its first stamp."""
    raw = np.ascontiguousarray(raw)
    offsets, times = _core.wire_cut(raw)
    return Datagrams(times * 1000, np.arange(len(times), dtype=np.uint64), offsets, raw)
