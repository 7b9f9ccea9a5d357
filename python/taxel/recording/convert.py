"""From one kind of recording to another: lossless where the target can hold it, else what it cannot is said."""

from __future__ import annotations

import errno
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core, wire
from taxel._base.arguments import flag, path, shown, text
from taxel._base.files import whole_file, write_whole
from taxel._core import ProblemError
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import TURN_US
from taxel.recording.h5 import write_h5
from taxel.recording.recording import Datagrams, Recording, _Source, open_recording, period_us
from taxel.recording.remarks import Remarks
from taxel.recording.tables import write_csv, write_npz

__all__ = ["KINDS", "convert"]

#: What can be written.
KINDS = (".mcap", ".lsa", ".npz", ".csv", ".h5")

#: Events a datagram at most, as the board sends them: 1400 bytes.
_DATAGRAM_BYTES = 1400

#: Of a stream of numbers.
_UNREAD = "lines_that_could_not_be_read"

#: The unit of the board's stamps, us.
_STAMP_US = 100


def convert(
    source: Recording | Events | Frames | str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    frames_hz: float | None = None,
    compression: str = "none",
    overwrite: bool = False,
) -> list[str]:
    """Write a recording as another kind of file, named by the target's ending.

    Parameters
    ----------
    source : Recording, Events, Frames or path
    target : path ending in .mcap, .lsa, .npz, .csv or .h5
    frames_hz : float, optional
        Write pictures at this rate (.npz, .csv, .h5) instead of events.
    compression : {"none", "lz4", "zstd"}
        Of a .mcap.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    list of str
        What the source holds and the target cannot, one line each; empty where nothing is lost.

    Raises
    ------
    ProblemError : another ending, or something that the target cannot hold at all (pictures in a .mcap)
    FormatError : a source that is no recording
    OSError : a target that exists, a folder that does not, a full disk ...

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> events = taxel.Events([0, 192], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> taxel.convert(events, folder / "two.npz")
    []
    >>> taxel.convert(folder / "two.npz", folder / "two.csv")
    ['the sensor (8 x 8 taxels, 1 mm apart, "array")']
    >>> taxel.convert(folder / "two.npz", folder / "two.mcap")
    ['times finer than 100 us']
    """
    place = Path(path("target", target))
    kind = place.suffix.lower()
    if kind not in KINDS:
        raise ProblemError(f"{place}: ends in {kind or 'nothing'!r}; must be {', '.join(KINDS)}")
    text("compression", compression, ("none", "lz4", "zstd"))
    if not flag("overwrite", overwrite) and os.path.lexists(place):
        raise FileExistsError(errno.EEXIST, "exists already; say so where it may be overwritten", str(place))
    if isinstance(source, str | os.PathLike):
        source = open_recording(source)
    if not isinstance(source, Recording | Events | Frames):
        raise ProblemError(f"source is {shown(source)}: must be a Recording, Events, Frames or the name of a file")
    recording = source if isinstance(source, Recording) else None
    if recording is not None and recording.is_stream and kind == ".mcap" and not recording.is_slice:
        with whole_file(place, overwrite=overwrite) as part:
            return _write_stream(part, recording, compression)
    table = _table(source, frames_hz)
    if kind in (".npz", ".csv", ".h5"):
        remarks, lost = _remarks_of(recording)
        lost = lost + _others(recording)
        if kind == ".h5":
            with whole_file(place, overwrite=overwrite) as part:
                write_h5(part, table, remarks)
            return lost
        if kind == ".npz":
            write_whole(place, lambda file: write_npz(file, table, remarks), overwrite=overwrite)
            return lost
        write_whole(place, lambda file: write_csv(file, table), overwrite=overwrite)
        return lost + _not_in_csv(table, remarks)
    if isinstance(table, Frames):
        raise ProblemError(f"{place}: a {kind} holds events and no pictures; write pictures to .npz, .csv or .h5")
    # Of a slice the bytes are not known: they are made of its events.
    made = recording is None or recording.is_slice or recording.is_on_clock
    origin = None if recording is None or made else recording._source
    if kind == ".lsa":
        if origin is not None and origin.speaks_version_2:
            raise ProblemError(
                f"{place}: a .lsa holds wire version 1; write what a board of version 2 sent to .mcap or .npz"
            )
        raw = None if origin is None else origin.payload
        payload, lost = (raw.tobytes(), []) if raw is not None else _encoded(table)
        _core.write_lsa(place, payload, overwrite)
        return lost + _not_in_lsa(table, recording) + _others(recording)
    with whole_file(place, overwrite=overwrite) as part:
        return _write_mcap(part, table, recording, origin, compression) + _others(recording)


def _table(source: Recording | Events | Frames, frames_hz: float | None) -> Events | Frames:
    """Return what is to be written."""
    if isinstance(source, Recording):
        return source.events if frames_hz is None and source.has_events else source.frames(frames_hz)
    if frames_hz is None:
        return source
    if isinstance(source, Frames):
        raise ProblemError("frames_hz: pictures keep their own times; open the file and ask it for frames(rate_hz)")
    return Frames.from_events(source, period_us("frames_hz", frames_hz))


def _remarks_of(recording: Recording | None) -> tuple[Remarks, list[str]]:
    """Return what stands beside a table, and what is lost without datagrams."""
    if recording is None:
        return Remarks(), []
    remarks = Remarks(
        source=recording.source or recording.name,
        registers=recording._source.registers,
        notes=recording.notes,
        detections=recording.detections,
        counts=recording.counts,
        verdict=recording.verdict,
        zeroings=recording.zeroings,
    )
    lost = {"mcap": ["raw datagrams with their arrival times"], "lsa": ["raw bytes (words that are no events)"]}
    return remarks, lost.get(recording.kind, [])


def _others(recording: Recording | None) -> list[str]:
    """Return which sources of a recording are not written with one of them."""
    if recording is None or len(recording._family) == 1:
        return []
    return [f"the source {name}" for name in recording._family if name != recording._source.label]


def _write_stream(part: Path, recording: Recording, compression: str) -> list[str]:
    """Write a stream of numbers alone, as it came."""
    header, arrived, number, values = recording._stream()
    writer = _core.RecordingWriter(part, json.dumps({**header, "sources": []}), compression, True)
    writer.samples(arrived, number, values)
    writer.finish(json.dumps({"received": len(arrived), "converted": recording.verdict}))
    return _others(recording) + [f"{n} lines that could not be read" for n in [recording.counts[_UNREAD]] if n]


def _sensor(table: Events | Frames) -> str:
    array = table.array
    some = "" if array.exists is None else f", {array.taxels} exist"
    return f'the sensor ({array.rows} x {array.columns} taxels{some}, {array.pitch_mm:g} mm apart, "{array.name}")'


def _not_in_csv(table: Events | Frames, remarks: Remarks) -> list[str]:
    lost = [_sensor(table)]
    if isinstance(table, Frames):
        lost += [f"the unit ({table.unit})"] * (table.unit != "counts")
    else:
        lost += [f"{len(table.markers)} markers of start and stop"] * bool(table.markers)
    return lost + _said(remarks)


def _not_in_lsa(table: Events, recording: Recording | None) -> list[str]:
    lost = [_sensor(table)] * (table.array != type(table.array).thesis())
    if recording is not None and recording.kind == "mcap":
        lost.append("arrival times, and where datagrams begin")
    return lost + _said(_remarks_of(recording)[0])


def _said(remarks: Remarks) -> list[str]:
    counts = {
        "notes": len(remarks.notes),
        "detections": len(remarks.detections),
        "zeroed taxels": len(remarks.zeroings),
    }
    return [f"{n} {name}" for name, n in counts.items() if n] + ["the board's registers"] * bool(remarks.registers)


def _encoded(events: Events) -> tuple[bytes, list[str]]:
    """Return events as the board's bytes, and what those cannot hold."""
    times = np.concatenate([events.t, np.array([at for at, _ in events.markers], np.int64)])
    lost = ["times finer than 100 us"] if (times % _STAMP_US).any() else []
    lost += ["which events are repaired"] if events.repaired is not None else []
    return wire.encode(events), lost


def _write_mcap(
    part: Path, events: Events, recording: Recording | None, origin: _Source | None, compression: str
) -> list[str]:
    """Write the live format: the datagrams as they came, or made of raw bytes or of events."""
    lost: list[str] = []
    first_us = 0
    datagrams = None if origin is None else origin.datagrams
    if origin is not None and datagrams is not None:
        first_us = origin.origin_us
    elif origin is not None and origin.payload is not None:
        datagrams = _cut(origin.payload)
    else:
        payload, lost = _encoded(events)
        datagrams = _cut_made(np.frombuffer(payload, np.uint8), events)
        # The first stamp shows its time modulo one turn of the counter; the turns before it are kept apart.
        first_us = int(datagrams.arrived_ns[0]) // 1000 // TURN_US * TURN_US if len(datagrams) else 0
    # Before 1970 there is no time of the host: board times are moved there as a whole.
    earliest = int(datagrams.arrived_ns[0]) if len(datagrams) else 0
    arrived = datagrams.arrived_ns - min(0, earliest)
    registers = None if recording is None else recording._source.registers
    header = {
        "array": events.array._geometry(),
        "registers": registers,
        "difference": origin is not None and origin.differences,
        "origin_us": first_us,
        "source": "events" if recording is None else recording.source or recording.name,
        "started_ns": int(arrived[0]) if len(arrived) else 0,
    }
    writer = _core.RecordingWriter(part, json.dumps(header), compression, True)
    # Before all datagrams, as the recorder does it: who plays the file looks for it there.
    held = None if recording is None else recording._began_with()
    if held is not None:
        writer.held(int(arrived[0]) if len(arrived) else 0, None, np.ascontiguousarray(held).reshape(-1))
    done = 0
    # What the host told the board stands between the datagrams before and after it, as decoding asks for it.
    for change in () if origin is None else origin.board_changes:
        upto = int(np.searchsorted(datagrams.arrived_ns, change.at_ns, side="left"))
        _add_datagrams(writer, datagrams, arrived, done, max(done, upto))
        writer.board_change(max(0, change.at_ns), change._json())
        done = max(done, upto)
    _add_datagrams(writer, datagrams, arrived, done, len(arrived))
    _add_remarks(writer, events, recording)
    writer.finish(json.dumps(_counts(recording, len(datagrams))))
    again = Events._from_parts(_core.RecordingReader(part).decode("direct")[0], events.array)
    if (len(again), again.intensity is None) != (len(events), events.intensity is None):
        lost.append(f"the pairing of intensities ({len(again)} events when paired directly)")
    elif ((again.t != events.t // _STAMP_US * _STAMP_US) & (again.t != events.t)).any():
        lost.append("the order of times that step back by more than 0.1 s")
    return lost


def _add_datagrams(writer: Any, datagrams: Datagrams, arrived: NDArray[np.int64], first: int, last: int) -> None:
    if last > first:
        writer.datagrams(
            arrived[first:last], datagrams.number[first:last], datagrams.offsets[first : last + 1], datagrams.payload
        )


def _add_remarks(writer: Any, events: Events, recording: Recording | None) -> None:
    clock = None if recording is None else recording.clock

    def at_ns(t: int) -> int:
        return int(clock.host_ns(t)) if clock is not None and len(clock.board_us) else t * 1000

    found = Detections([], [], []) if recording is None else recording.detections
    noted = [] if recording is None else [note.t for note in recording.notes if note.t is not None]
    around = np.concatenate([found.t, found.known, np.array([*(t for t, _ in events.markers), *noted], np.int64)])
    for t, start in events.markers:
        writer.marker(max(0, at_ns(t)), t, start)
    for t, ticks in _core.RecordingPictures(events._parts(), around):
        writer.picture(max(0, at_ns(t)), t, events.array.columns, ticks)
    if recording is None:
        return
    for note in recording.notes:
        writer.note(note.at_ns, note.t, note.text)
    for zeroing in recording.zeroings:
        writer.zeroing(max(0, at_ns(zeroing.t)), zeroing.t, zeroing.x, zeroing.y, zeroing.rest, zeroing.before)
    for at, values in recording._source.register_changes:
        writer.registers(at, json.dumps(values))
    for d in found:
        writer.detection(max(0, at_ns(d.known)), d.label, d.t, d.known, d.slope, d.repaired)


def _counts(recording: Recording | None, datagrams: int) -> dict[str, Any]:
    """Return the counts of a recording in the words of the live format."""
    if recording is None:
        return {"received": datagrams}
    counts = recording.counts
    known = {name: counts.get(name) or 0 for name in ("dropped_by_kernel", "dropped_by_queue", "received")}
    decoder = counts.get("decoder")
    damage = json.loads(_core.recording_damage(json.dumps(decoder))) if decoder else {}
    return {**known, "decoder": damage, "converted": recording.verdict}


def _cut(raw: NDArray[np.uint8]) -> Datagrams:
    """Cut raw bytes into datagrams; each has the board's time of its first stamp, as there are no arrival times."""
    raw = np.ascontiguousarray(raw)
    offsets, times = _core.wire_cut(raw)
    return Datagrams(times * 1000, np.arange(len(times), dtype=np.uint64), offsets, raw)


def _cut_made(raw: NDArray[np.uint8], events: Events) -> Datagrams:
    """Cut bytes that were made of events into datagrams, never between a change and its intensity.

    The wire has no arrival times, so each datagram gets the board's time of its first stamp: what a reader needs to
    unwrap time as it was before. It looks at times within half a turn, so a datagram is never longer than a second.
    """
    first = np.append(raw, np.uint8(0x80)) & 0x80 != 0
    begins = np.flatnonzero(first[:-1])
    ends = np.flatnonzero(first)[1:]
    # Whole words that show a time: a change or a marker, not an intensity (Z2).
    begins = begins[(ends - begins >= 5) & (raw[begins] & 0x20 == 0)]
    at = _times(raw, begins, events)
    # Steps back do not count: arrivals never step back.
    at = np.maximum.accumulate(at) if len(at) else at
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


def _times(raw: NDArray[np.uint8], begins: NDArray[np.int64], events: Events) -> NDArray[np.int64]:
    """Return the times of words (us) that were made of events."""
    marker = raw[begins] & 0x08 != 0
    at = np.empty(len(begins), np.int64)
    at[~marker], at[marker] = events.t, [t for t, _ in events.markers]
    return at
