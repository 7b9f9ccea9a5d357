"""Writes the live format: datagrams as they came, or made of events, with all that stands beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.clock import Clock
from taxel.events import Events
from taxel.recording.contents import Contents
from taxel.recording.notes import Datagrams

__all__ = ["cut_raw", "encoded", "write_mcap"]


def write_mcap(part: Path, contents: Contents, compression: str, counts: dict[str, Any]) -> None:
    """Write a .mcap of contents as it can hold them (`taxel.recording.stored`).

    Parameters
    ----------
    part : Path
    contents : Contents
        With datagrams, or the lines of a stream.
    compression : {"none", "lz4", "zstd"}
    counts : dict
        What was received and lost, in the words of the live format.

    Raises
    ------
    OSError : the disk is full ...
    """
    samples = contents.samples
    if samples is not None:
        header = {**samples.about, "sources": [], "lost": contents.lost}
        writer = _core.RecordingWriter(part, json.dumps(header), compression, True)
        writer.samples(samples.arrived_ns, samples.number, np.ascontiguousarray(samples.values).reshape(-1))
        writer.finish(json.dumps(counts))
        return
    datagrams, events = contents.datagrams, contents.events
    assert datagrams is not None and events is not None  # noqa: PT018  `stored` gives both
    # Before 1970 there is no time of the host: board times are moved there as a whole.
    earliest = int(datagrams.arrived_ns[0]) if len(datagrams) else 0
    arrived = datagrams.arrived_ns - min(0, earliest)
    registers = contents.registers
    driven = contents.array if registers is None else registers.array
    header = {
        "array": contents.array._geometry(),
        "registers": None if registers is None else json.loads(registers._json()),
        **({} if driven == contents.array else {"driven": driven._geometry()}),
        "lost": contents.lost,
        "repaired": contents.unmarked,
        "difference": contents.differences,
        "origin_us": contents.origin_us,
        "source": contents.source,
        "started_ns": int(arrived[0]) if len(arrived) else 0,
    }
    writer = _core.RecordingWriter(part, json.dumps(header), compression, True)
    # Before all datagrams, as the recorder does it: who plays the file looks for it there.
    if contents.held is not None:
        writer.held(int(arrived[0]) if len(arrived) else 0, None, np.ascontiguousarray(contents.held).reshape(-1))
    done = 0
    # Commands of the host stand between the datagrams before and after them: the decoder needs this order.
    for change in contents.board_changes:
        upto = int(np.searchsorted(datagrams.arrived_ns, change.at_ns, side="left"))
        _add_datagrams(writer, datagrams, arrived, done, max(done, upto))
        writer.board_change(max(0, change.at_ns), json.dumps(change._described()))
        done = max(done, upto)
    _add_datagrams(writer, datagrams, arrived, done, len(arrived))
    _add_remarks(writer, events, contents)
    writer.finish(json.dumps(counts))


def encoded(
    events: Events, held: NDArray[np.uint16] | None, clock: Clock | None
) -> tuple[int, Datagrams, NDArray[np.int64]]:
    """Return events as datagrams of wire version 2, which holds all of them.

    Parameters
    ----------
    events : Events
    held : uint16, shape (rows, columns), ticks, optional
        What the taxels held at the beginning.
    clock : Clock, optional
        Where it is known, each datagram promises a time and came when the host's clock showed it, so that a reader
        finds the same clock; else it promises nothing, and no clock can be made of it.

    Returns
    -------
    int, us
        What is added to times in the datagrams.
    Datagrams
    int64, shape (n,)
        The numbers of events that are repaired though no state of a taxel tells what they tell.

    Raises
    ------
    ProblemError : an array of more than 65 536 positions, or times more than 8.9 years apart
    """
    begins = None if held is None else np.ascontiguousarray(held).reshape(-1)
    origin_us, offsets, payload, times, unmarked = _core.encode_datagrams(events._parts(), begins, clock is not None)
    at = times * 1000 if clock is None or not len(times) else np.asarray(clock.host_ns(times), np.int64)
    # Arrivals never step back.
    arrived = np.maximum.accumulate(at) if len(at) else at
    return origin_us, Datagrams(arrived, np.arange(len(arrived), dtype=np.uint64), offsets, payload), unmarked


def _add_datagrams(writer: Any, datagrams: Datagrams, arrived: NDArray[np.int64], first: int, last: int) -> None:
    if last > first:
        writer.datagrams(
            arrived[first:last], datagrams.number[first:last], datagrams.offsets[first : last + 1], datagrams.payload
        )


def _add_remarks(writer: Any, events: Events, contents: Contents) -> None:
    clock = contents.clock if contents.clock is not None and len(contents.clock.board_us) else None

    def at_ns(t: int) -> int:
        return max(0, t * 1000 if clock is None else int(clock.host_ns(t)))

    detections = contents.detections
    noted = [note.t for note in contents.notes if note.t is not None]
    around = np.concatenate(
        [detections.t, detections.known, np.array([*(t for t, _ in events.markers), *noted], np.int64)]
    )
    for t, start in events.markers:
        writer.marker(at_ns(t), t, start)
    for t, ticks in _core.RecordingPictures(events._parts(), around):
        writer.picture(at_ns(t), t, events.array.columns, ticks)
    for note in contents.notes:
        writer.note(note.at_ns, note.t, note.text)
    for zeroing in contents.zeroings:
        writer.zeroing(at_ns(zeroing.t), zeroing.t, zeroing.x, zeroing.y, zeroing.rest, zeroing.before)
    for at, values in contents.register_changes:
        writer.registers(at, values._json())
    for d in detections:
        writer.detection(at_ns(d.known), d.label, d.t, d.known, d.slope, d.repaired)


def cut_raw(raw: NDArray[np.uint8]) -> Datagrams:
    """Cut raw bytes into datagrams; each has the board's time of its first stamp, as there are no arrival times."""
    raw = np.ascontiguousarray(raw)
    offsets, times = _core.wire_cut(raw)
    return Datagrams(times * 1000, np.arange(len(times), dtype=np.uint64), offsets, raw)
