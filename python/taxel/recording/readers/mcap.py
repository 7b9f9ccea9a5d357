"""Reads the live format: each source as contents, whose fields are read at their first access."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.columns import frozen
from taxel._base.limits import available
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.clock import Clock
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import sections
from taxel.recording.contents import BoardSource, Contents, FrameSource, RecordedSource, Stream, alone
from taxel.recording.description import (
    array_of,
    board_changes_of,
    counts_of,
    detections_of,
    frame_us_of,
    notes_of,
    turned_of,
    zeroings_of,
)
from taxel.recording.once import Once, known
from taxel.recording.raw import Datagrams, Samples
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

#: The damage after which times are doubtful; from when on is known by the file's own times alone.
DOUBTS = ("jumps_of_time", "stamps_out_of_order", "drifts_from_arrival")
#: What is counted where times step back, by how much and where.
STEPS = ("events_out_of_order", "events_overtaken")


def read_mcap(path: Path, pairing: str) -> Contents:
    """Return the contents of a .mcap: those of its only source or board, including all sources.

    Raises
    ------
    FormatError : not a recording of the live format, or damaged so that nothing can be read
    OSError : the file cannot be read
    """
    reader = _core.RecordingReader(path)
    sources: dict[str, RecordedSource] = {}
    for name in reader.sources():
        channel = _Source(path, reader.of_source(name))
        if channel.header.get("frames") is not None:
            sources[name] = channel.frames()
        else:
            sources[name] = channel.board(pairing) if channel.header.get("stream") is None else channel.stream()
    sensors = [name for name, source in sources.items() if type(source) is FrameSource]
    if len(sensors) > 1:
        for name in sensors:
            source = sources[name]
            sources[name] = replace(source, origin=replace(source.origin, name=f"{path.name} {name}"))
    return alone(sources)


class _Source:
    """Reader of one source of a file: its header and trailer, and the values that several fields share."""

    def __init__(self, path: Path, reader: _core.RecordingReader) -> None:
        self._reader = reader
        self.header, ending, self.opened = reader.about()
        self.ending = ending or {}
        self.array = array_of(self.header["array"])
        # Those of the recording that a source was converted from.
        self.before = _read_entry(path, "counts", counts_of, self.header.get("counts")) or {}
        self.remarks = Once(lambda: self.reader().remarks())
        label = self.header.get("name", "board")
        self.origin = sections.Origin(path, path.name, "mcap", label, self.header["source"])
        self.sensor = sections.Sensor(self.array, self.header.get("side", ""), self.header.get("heel", ""))

    def losses(
        self, counts: Callable[[], dict[str, Any]], found: Callable[[], dict[str, Any]] | None = None
    ) -> sections.Losses:
        """Return what was lost; arguments are those of `counts` and `verdict`."""
        return sections.Losses(
            counts=self.counts(counts),
            verdict=Once(lambda: self.verdict(found)),
            remarks=tuple(self.header.get("remarks", ())),
            truncated=bool(self.opened["unfinished"]) or "finished" not in self.ending,
            rebuilt=Once(self.rebuilt),
            lost=known(tuple(self.header.get("lost", ()))),
        )

    def reader(self) -> _core.RecordingReader:
        """Return the reader of this source, which reads as much as the memory that is available now allows."""
        return self._reader.within(available())

    def board(self, pairing: str) -> BoardSource:
        """Return the contents of a board."""
        decoded = Once(lambda: self.reader().decode(pairing))

        def arrived() -> bool:
            return self.remarks().datagrams > 0

        return BoardSource(
            self.origin,
            self.sensor,
            sections.EventTable(Once(lambda: Events._from_parts(decoded().events, self.array))),
            sections.Wire(
                datagrams=Once(lambda: Datagrams(**self.reader().datagrams()), arrived),
                version_2=Once(lambda: bool(decoded().version_2["intact"])),
                differences=bool(self.header["difference"]),
                origin_us=int(self.header["origin_us"]),
                unmarked=tuple(self.header.get("repaired", ())),
            ),
            timing=sections.Timing(Once(lambda: _clock(decoded()), arrived)),
            losses=self.losses(lambda: self.counts_of_board(decoded()), lambda: decoded().found),
            settings=self.settings(),
            marks=self.marks(),
        )

    def settings(self) -> sections.Settings:
        """Return the board's state of a board, or of the frames that were made of one."""
        return sections.Settings(Once(self.held), Once(self.registers), Once(self.register_changes))

    def marks(self) -> sections.Marks:
        """Return what happened at a time."""
        return sections.Marks(
            board_changes=Once(lambda: board_changes_of(self.remarks().board)),
            notes=Once(lambda: notes_of(self.remarks().notes)),
            detections=Once(lambda: detections_of(self.remarks().detections)),
            zeroings=Once(lambda: zeroings_of([remark for _, remark in self.remarks().zeroings])),
        )

    def frames(self) -> FrameSource:
        """Return the contents of a source of frames."""
        about, path = self.header["frames"], self.origin.path
        read = Once(lambda: self.reader().frames())

        def frames() -> Frames:
            t, values, _ = read()
            shaped = frozen(values).reshape(len(t), *self.array.shape)
            try:
                return Frames(shaped, frozen(t), unit=about["unit"], array=self.array)
            except ProblemError as error:
                raise FormatError(f"{path}, source {self.origin.label}: {error}") from None

        def counts() -> dict[str, Any]:
            t, _, bad = read()
            damage = {"frames": len(t), "frames_that_could_not_be_read": bad}
            return {**damage, "received": self.counted().get("received"), **self.rebuilt()}

        turned = _read_entry(path, "turned", turned_of, about.get("turned"))
        frame_us = _read_entry(path, "frame_us", frame_us_of, about.get("frame_us"))
        frame_table = sections.FrameTable(Once(frames), not about.get("clock", True), turned, frame_us)
        header: dict[str, Any] = {"settings": self.settings(), "marks": self.marks(), "losses": self.losses(counts)}
        if not about.get("columns"):
            return FrameSource(self.origin, self.sensor, frame_table, **header)
        return Stream(self.origin, self.sensor, frame_table, sections.SampleColumns(tuple(about["columns"])), **header)

    def stream(self) -> Stream:
        """Return the contents of a stream of numbers, whose lines are frames of one row."""
        stream = self.header["stream"]
        read = Once(lambda: self.reader().samples())

        def samples() -> Samples:
            lines = read()
            rows = lines.values.reshape(len(lines.t), self.array.columns)
            if stream.get("time") is not None:
                times = lines.t / float(stream["unit_us"])
                rows = np.insert(rows, stream["columns"].index(stream["time"]), times, axis=1)
            return Samples(self.header, lines.arrived_ns, lines.number, lines.t, np.ascontiguousarray(rows))

        def frames() -> Frames:
            t = read().t
            order = np.argsort(t, kind="stable")
            rows = read().values.reshape(len(t), 1, self.array.columns)[order]
            return Frames(rows.astype(np.float32), ascending(t[order]), unit="as sent", array=self.array)

        names = tuple(name for name in stream["columns"] if name != stream.get("time"))
        return Stream(
            self.origin,
            self.sensor,
            sections.FrameTable(Once(frames)),
            sections.SampleColumns(names, Once(samples, lambda: self.remarks().samples > 0)),
            # The arrival of lines that waited in a file is none of their clock.
            timing=sections.Timing()
            if stream.get("waited")
            else sections.Timing(Once(lambda: Clock(read().t, read().arrived_ns))),
            losses=self.losses(lambda: self.counts_of_stream(read()), lambda: read().found),
            marks=self.marks(),
        )

    def driven(self) -> Array:
        """Return the array that the registers drive."""
        geometry = self.header.get("driven")
        return self.array if geometry is None else array_of(geometry)

    def registers(self) -> Registers | None:
        """Return the registers at the beginning, or the first that were set."""
        first = self.header["registers"]
        if first is None:
            changes = self.register_changes()
            return changes[0][1] if changes else None
        return Registers._of_file(first, self.driven())

    def register_changes(self) -> tuple[tuple[int, Registers], ...]:
        """Return the registers at each change."""
        return tuple((at, Registers._of_file(values, self.driven())) for at, values in self.remarks().registers)

    def held(self) -> NDArray[np.uint16] | None:
        """Return the values that the taxels held at the beginning."""
        held = self.remarks().held
        if held is None or len(held) != self.array.rows * self.array.columns:
            return None
        return np.array(held, np.uint16).reshape(self.array.shape)

    def rebuilt(self) -> dict[str, int]:
        """Return counts of damage that the reader skipped or repaired."""
        rebuilt = {key: int(value) for key, value in self.opened.items() if key != "unfinished"}
        return {**rebuilt, "bad_chunks": int(self.remarks().condition["bad_chunks"])}

    def counts(self, read: Callable[[], dict[str, Any]]) -> Once[Mapping[str, Any]]:
        """Return the field of counts: those that are read, or those of the recording before it was converted.

        Those have the damage of this file beside them.
        """
        if not self.before:
            return Once(read, lambda: True)
        return Once(lambda: {**self.before, **{cause: n for cause, n in self.rebuilt().items() if n}}, lambda: True)

    def counts_of_board(self, decoded: _core.DecodedDatagrams) -> dict[str, Any]:
        """Return the numbers of received and lost datagrams and events of a board, by cause and version of the wire."""
        remarks = self.remarks()
        counts = self.counted() or remarks.counts or {}
        of_2 = decoded.version_2
        # Datagrams that this computer dropped or the file lost are missing among the board's numbers too, and are
        # counted separately.
        skipped = remarks.condition["skipped_numbers"]
        of_2["missing"] -= min(of_2["missing"], skipped)
        return {
            "datagrams": remarks.datagrams,
            "bytes": remarks.datagram_bytes,
            "missing_numbers": skipped,
            "lost_in_file": self.verdict(lambda: decoded.found).lost.get("lost_in_file", 0),
            **{name: counts.get(name) for name in ("received", "dropped_by_kernel", "dropped_by_queue")},
            "decoder": decoded.counts,
            **({"decoder_version_2": of_2} if of_2["datagrams"] else {}),
            **self.rebuilt(),
        }

    def counts_of_stream(self, read: _core.Samples) -> dict[str, Any]:
        """Return the numbers of received and lost datagrams and lines of a stream, by cause."""
        found, counts = read.found["damage"], self.counted() or self.remarks().counts or {}
        # Bytes that are in no line are not in the file.
        lost = {cause: max(n, counts.get("decoder", {}).get(cause, 0)) for cause, n in found.items()}
        return {"samples": len(read.t), **lost, "received": self.counted().get("received"), **self.rebuilt()}

    def counted(self) -> dict[str, Any]:
        """Return the final counts of what was received; of a converted recording, or one that lacks its end, none."""
        counts = self.ending.get("finished", {}).get("counts") or {}
        return {} if self.header.get("converted") else counts

    def verdict(self, found: Callable[[], dict[str, Any]] | None = None) -> Verdict:
        """Return what was lost at which stage; `found` decodes a board or a stream, and returns what it found."""
        condition = self.remarks().condition
        if found is not None and condition["messages"] and (condition["changed"] or self.must_decode()):
            condition = condition | {"decoded": found()}
        return Verdict._of({"file": condition})

    def must_decode(self) -> bool:
        """Return whether the counts in the file do not tell what decoding finds: damage at the end, wrong times."""
        if "finished" not in self.ending:
            return True
        counts = self.ending["finished"]["counts"]
        causes = DOUBTS if counts.get("steps_back") else (*DOUBTS, *STEPS)
        return not self.header.get("converted") and any(counts["decoder"].get(cause, 0) for cause in causes)


def _read_entry(path: Path, entry: str, read: Callable[[Any], Any], value: Any) -> Any:
    """Return what an entry of a header states; None if it is not there."""
    try:
        return None if value is None else read(value)
    except ProblemError as error:
        raise FormatError(f"{path}, header, {entry}: {error}") from None


def _clock(decoded: _core.DecodedDatagrams) -> Clock:
    has = decoded.left > np.iinfo(np.int64).min
    return Clock(np.ascontiguousarray(decoded.left[has]), np.ascontiguousarray(decoded.arrived_ns[has]))


def ascending(t: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times of frames, with equal times moved apart by 1 us."""
    steps = np.arange(len(t))
    return np.maximum.accumulate(t - steps) + steps if len(t) else t
