"""The live format: a reader of each source, which reads part by part; what writes datagrams, frames and the rest."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.columns import frozen
from taxel._base.limits import available
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError, RecordingWriter
from taxel.array import Array
from taxel.clock import Clock
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import BoardChange, Datagrams, Facts, Marks, Reader, Zeroing
from taxel.recording.source import SourceView, ticks_of
from taxel.verdict import Verdict
from taxel.wire import Registers

__all__ = ["DOUBTS", "STEPS", "McapReader", "RecordingWriter", "encode_events", "read_mcap", "write_mcap"]

#: The damage after which times are doubtful; from when on is known by the file's own times alone.
DOUBTS = ("jumps_of_time", "stamps_out_of_order", "drifts_from_arrival")
#: What a stream of numbers counts, whether it happened or not.
_OF_STREAMS = (
    "bytes_in_no_line",
    "bytes_of_unfinished_lines",
    "clock_began_anew",
    "drifts_from_arrival",
    "jumps_of_time",
    "lines_that_could_not_be_read",
    "missing_values",
    "stamps_out_of_order",
)
#: What is counted where times step back, by how much and where.
STEPS = ("events_out_of_order", "events_overtaken")
#: Number of values of a block of frames: a chunk of the file.
_BLOCK = 1 << 18
#: The most numbers of repaired events in the description of a file, which is limited to 16 MiB.
_MOST = 1_000_000
#: From one preview to the next, us, as in recordings of a board.
_PREVIEW_US = 100_000


def read_mcap(path: Path) -> list[McapReader]:
    """Return a reader of each source of a .mcap.

    Raises
    ------
    FormatError : not a recording of the live format, or damaged so that nothing can be read
    OSError : the file cannot be read
    """
    reader = _core.RecordingReader(path)
    return [McapReader(path, reader.of_source(name)) for name in reader.sources()]


class McapReader(Reader):
    """Reads one source of a .mcap: a board, or frames; those of a stream of numbers have one row.

    Parameters
    ----------
    path : Path
    reader : RecordingReader
        Of this source.
    """

    def __init__(self, path: Path, reader: _core.RecordingReader) -> None:
        self._reader = reader
        self._header, ending, self._opened = reader.about()
        self._ending = ending or {}
        self._frames = self._header.get("frames")
        about, header = self._frames or {}, self._header
        # Those of the recording that it was converted from.
        self._before: dict[str, Any] = header.get("counts") or {}
        is_board = self._frames is None
        self.facts = Facts(
            path=path,
            array=Array._from_geometry(header["array"]),
            kind="mcap",
            label=header.get("name", "board"),
            source=header["source"],
            side=header.get("side", ""),
            heel=header.get("heel", ""),
            has_events=is_board,
            timed=about.get("clock", True),
            columns=tuple(about.get("columns") or ()),
            turned=about.get("turned"),
            frame_us=about.get("frame_us"),
            raw="datagrams" if is_board else "",
            begins_us=int(header["origin_us"]) if is_board else None,
            remarks=tuple(header.get("remarks", ())),
            lost=tuple(header.get("lost", ())),
            truncated=bool(self._opened["unfinished"]) or "finished" not in self._ending,
        )

    def _now(self) -> _core.RecordingReader:
        """Return the reader of this source, which reads as much as the memory that is available now allows."""
        return self._reader.within(available())

    @cached_property
    def _remarks(self) -> _core.Remarks:
        return self._now().remarks()

    @cached_property
    def _decoded(self) -> _core.DecodedDatagrams:
        return self._now().decode()

    @cached_property
    def _read_frames(self) -> _core._RecordedFrames:
        return self._now().frames()

    def table(self) -> Events | Frames:
        """Return the events or the frames."""
        array = self.facts.array
        if self._frames is None:
            return Events._unchecked(**self._decoded.events, array=array)
        t, values = self._read_frames["t"], self._read_frames["values"]
        try:
            shaped = frozen(values).reshape(len(t), *array.shape)
            return Frames(shaped, frozen(t), unit=self._frames["unit"], array=array)
        except ProblemError as error:
            raise FormatError(f"{self.facts.path}, source {self.facts.label}: {error}") from None

    def marks(self) -> Marks:
        """Return what happened at a time."""
        remarks = self._remarks
        settings = tuple((at, Registers._of_file(values, self._driven())) for at, values in remarks.registers)
        first = self._header.get("registers")
        at_beginning = settings[0][1] if settings else None
        return Marks(
            notes=tuple(Note(note["text"], note["t_us"], note["at_ns"]) for note in remarks.notes),
            detections=_detections(remarks.detections),
            zeroings=tuple(sorted((Zeroing(**zeroing) for _, zeroing in remarks.zeroings), key=lambda one: one.t)),
            changes=tuple(
                BoardChange(one["t_us"], at, one["change"], one.get("version"), one.get("asked", False))
                for at, one in remarks.board
            ),
            registers=at_beginning if first is None else Registers._of_file(first, self._driven()),
            settings=settings,
            held=self._held(remarks.held),
        )

    def _driven(self) -> Array:
        """Return the array that the registers drive."""
        geometry = self._header.get("driven")
        return self.facts.array if geometry is None else Array._from_geometry(geometry)

    def _held(self, held: list[int] | None) -> NDArray[np.float32] | None:
        array = self.facts.array
        if held is None or len(held) != array.rows * array.columns:
            return None
        ticks = np.array(held, np.float32).reshape(array.shape)
        return np.where(ticks == _core.UNKNOWN, np.float32(np.nan), ticks)

    def clock(self) -> Clock | None:
        """Return arrival times against the source's time."""
        if self._frames is not None:
            read = self._read_frames if self._frames.get("arrivals") else None
            return None if read is None else Clock(read["t"], read["at_ns"])
        has = self._decoded.left > np.iinfo(np.int64).min
        left, arrived = self._decoded.left[has], self._decoded.arrived_ns[has]
        return Clock(np.ascontiguousarray(left), np.ascontiguousarray(arrived))

    def verdict(self) -> Verdict:
        """Return what was lost at which stage; a board is decoded only if the file does not say it."""
        condition = self._remarks.condition
        # The counts of frames say all.
        if self._frames is None and condition["messages"] and self._must_decode():
            condition = condition | {"decoded": self._decoded.found}
        return Verdict._of({"file": condition})

    def _must_decode(self) -> bool:
        """Return whether the counts in the file do not tell what decoding finds: damage at the end, wrong times."""
        if "finished" not in self._ending:
            return True
        counts = self._ending["finished"]["counts"]
        causes = DOUBTS if counts.get("steps_back") else (*DOUBTS, *STEPS)
        return not self._header.get("converted") and any(counts["decoder"].get(cause, 0) for cause in causes)

    def datagrams(self) -> Datagrams | None:
        """Return the datagrams of a board as received."""
        if self._frames is not None:
            return None
        return Datagrams(
            **self._now().datagrams(),
            version=2 if self._decoded.version_2["intact"] else 1,
            differences=bool(self._header["difference"]),
            origin_us=int(self._header["origin_us"]),
            unmarked=tuple(self._header.get("repaired", ())),
        )

    def damage(self) -> Mapping[str, int]:
        """Return the numbers of what reading the file skipped or repaired, by cause."""
        rebuilt = {key: int(value) for key, value in self._opened.items() if key != "unfinished"}
        return {**rebuilt, "bad_chunks": int(self._remarks.condition["bad_chunks"])}

    def counts(self) -> Mapping[str, Any]:
        """Return the numbers of what was received and lost, by cause; or those from before it was converted.

        Those have the damage of this file beside them.
        """
        if self._before:
            return {**self._before, **{cause: n for cause, n in self.damage().items() if n}}
        own = self._counts_of_board() if self._frames is None else self._counts_of_frames()
        return {**own, **self.damage()}

    def _counts_of_board(self) -> dict[str, Any]:
        remarks, decoded = self._remarks, self._decoded
        counts = self._counted or remarks.counts or {}
        of_2 = decoded.version_2
        # Datagrams that this computer dropped or the file lost are missing among the board's numbers too, and are
        # counted separately.
        lost_in_file = self.verdict().lost.get("lost_in_file", 0)
        of_2["missing"] -= min(of_2["missing"], lost_in_file + (counts.get("dropped_by_queue") or 0))
        return {
            "datagrams": remarks.datagrams,
            "bytes": remarks.datagram_bytes,
            "lost_in_file": lost_in_file,
            **{name: counts.get(name) for name in ("received", "dropped_by_kernel", "dropped_by_queue")},
            "decoder": decoded.counts,
            **({"decoder_version_2": of_2} if of_2["datagrams"] else {}),
        }

    def _counts_of_frames(self) -> dict[str, Any]:
        read = self._read_frames
        recorded = (self._counted or self._remarks.counts or {}).get("decoder", {})
        of_lines = _OF_STREAMS if self.facts.columns else ()
        return {
            "frames": len(read["t"]),
            "frames_that_could_not_be_read": read["bad"],
            **{cause: recorded.get(cause, 0) for cause in of_lines},
            "received": self._counted.get("received"),
        }

    @property
    def _counted(self) -> dict[str, Any]:
        """The final counts of what was received; of a converted recording, or one that lacks its end, none."""
        counts = self._ending.get("finished", {}).get("counts") or {}
        return {} if self._header.get("converted") else counts


def _detections(records: Any) -> Detections:
    """Return detections from records of (host ns, label, t, known, slope, repaired); JSON has no NaN."""
    label, t, known, slopes, repaired = ([row[k] for row in records] for k in range(1, 6))
    return Detections._of(label, t, known, [np.nan if slope is None else slope for slope in slopes], repaired=repaired)


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
