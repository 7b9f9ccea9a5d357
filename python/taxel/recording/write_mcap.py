"""Writes the live format: datagrams as they came, or made of events, with all that stands beside them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from itertools import pairwise
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

#: Bytes of a datagram at most, as the board sends them.
_DATAGRAM_BYTES = 1400

#: Between the pictures that a converted file shows to viewers, and at least between those around an event, us.
_PICTURE_US, _NEAR_US = 100_000, 10_000

#: The unit of the stamps of wire version 1, us.
_STAMP_US = 100


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
    # What the host told the board stands between the datagrams before and after it, as decoding asks for it.
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


def _pictures(events: Events, around: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    """Give what the taxels hold: ten times a second where something came, and at whole 10 ms around `around`, us."""
    if events.intensity is None or events.present is None:
        return
    there = np.flatnonzero(events.present)
    order = there[np.argsort(events.t[there], kind="stable")]
    if not len(order):
        return
    at, place, ticks = events.t[order], events.array.index(events.x[order], events.y[order]), events.intensity[order]
    # Each event is in the first picture from it on.
    tenths = -(-at // _PICTURE_US) * _PICTURE_US
    near = -(-around // _NEAR_US) * _NEAR_US
    near = np.concatenate([near - _NEAR_US, near])
    times = np.union1d(tenths, near[(near >= at[0]) & (near <= tenths[-1])])
    begins = [0, *np.searchsorted(at, times, side="right").tolist()]
    now = np.zeros(events.array.rows * events.array.columns, np.uint16)
    for t, (a, b) in zip(times.tolist(), pairwise(begins), strict=True):
        now[place[a:b]] = ticks[a:b]
        yield t, now


def _add_remarks(writer: Any, events: Events, contents: Contents) -> None:
    clock = contents.clock if contents.clock is not None and len(contents.clock.board_us) else None

    def at_ns(t: int) -> int:
        return max(0, t * 1000 if clock is None else int(clock.host_ns(t)))

    found = contents.detections
    noted = [note.t for note in contents.notes if note.t is not None]
    around = np.concatenate([found.t, found.known, np.array([*(t for t, _ in events.markers), *noted], np.int64)])
    for t, start in events.markers:
        writer.marker(at_ns(t), t, start)
    for t, ticks in _pictures(events, around):
        writer.picture(at_ns(t), t, events.array.columns, ticks)
    for note in contents.notes:
        writer.note(note.at_ns, note.t, note.text)
    for zeroing in contents.zeroings:
        writer.zeroing(at_ns(zeroing.t), zeroing.t, zeroing.x, zeroing.y, zeroing.rest, zeroing.before)
    for at, values in contents.register_changes:
        writer.registers(at, values._json())
    for d in found:
        writer.detection(at_ns(d.known), d.label, d.t, d.known, d.slope, d.repaired)


def cut_raw(raw: NDArray[np.uint8]) -> Datagrams:
    """Cut raw bytes of wire version 1 into datagrams, never between a change and its intensity.

    The bytes have no arrival times, so each datagram gets the board's time of its first stamp: what a reader needs to
    unwrap time as it was before. It looks at times within half a turn, so a datagram is never longer than a second.
    """
    first = np.append(raw, np.uint8(0x80)) & 0x80 != 0
    begins = np.flatnonzero(first[:-1])
    ends = np.flatnonzero(first)[1:]
    # Whole words that show a time: a change or a marker, not an intensity (Z2).
    begins = begins[(ends - begins >= 5) & (raw[begins] & 0x20 == 0)]
    # Steps back do not count: arrivals never step back.
    at = np.maximum.accumulate(_stamps(raw, begins)) if len(begins) else begins
    offsets, arrived = [0], []
    while offsets[-1] < len(raw):
        begin = offsets[-1]
        k = int(np.searchsorted(begins, begin))
        now = int(at[min(k, len(at) - 1)]) if len(at) else 0
        late = int(np.searchsorted(at, now + 1_000_000, side="right")) if k < len(at) else len(at)
        fits = int(np.searchsorted(begins, begin + _DATAGRAM_BYTES, side="right")) - 1
        if begin + _DATAGRAM_BYTES >= len(raw):
            fits = len(begins)
        last = min(late, fits)
        end = int(begins[last]) if last < len(begins) else len(raw)
        if not begin < end <= begin + _DATAGRAM_BYTES:
            end = min(begin + _DATAGRAM_BYTES, len(raw))
        offsets.append(end)
        arrived.append(now * 1000)
    number = np.arange(len(arrived), dtype=np.uint64)
    return Datagrams(np.array(arrived, np.int64), number, np.array(offsets, np.int64), np.ascontiguousarray(raw))


def _stamps(raw: NDArray[np.uint8], begins: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the times of words (us) as their stamps alone show them."""
    word = [raw[begins + k].astype(np.int64) for k in range(3)]
    stamp = (word[0] & 3) << 14 | (word[1] & 0x7F) << 7 | word[2] & 0x7F
    step = np.diff(stamp, prepend=stamp[:1]) % 65_536
    # As the decoder reads it: up to 0.1 s behind is a step back.
    step[step >= 64_536] -= 65_536
    first = int(stamp[0]) if len(stamp) else 0
    return np.asarray((first + np.cumsum(step)) * _STAMP_US)
