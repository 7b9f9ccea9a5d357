"""Reads the live format: each source as contents, whose fields are read at their first access."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base import limits
from taxel._base.columns import frozen
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.clock import Clock
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.contents import Contents, Once, alone, once
from taxel.recording.description import (
    array_of,
    board_changes_of,
    counts_of,
    detections_of,
    notes_of,
    zeroings_of,
)
from taxel.recording.raw import Datagrams, Samples
from taxel.recording.verdict import Verdict
from taxel.wire import Registers

__all__ = ["DOUBTS", "STEPS", "ascending", "read_mcap"]

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
    limit = limits.given()
    reader = _core.RecordingReader(path, limits.memory(limit), limit is not None)
    sources: dict[str, Contents] = {}
    for name in reader.sources():
        one = _Source(path, reader.of_source(name), sources, limit)
        if one.header.get("pictures") is not None:
            sources[name] = one.pictures()
        else:
            sources[name] = one.board(pairing) if one.header.get("stream") is None else one.stream()
    sensors = [name for name, one in sources.items() if not one.has_events and vars(one)["columns"] is None]
    if len(sensors) > 1:
        for name in sensors:
            sources[name] = sources[name].but(name=f"{path.name} {name}")
    return alone(sources)


class _Source:
    """Reader of one source of a file: its header and trailer, and the values that several fields share."""

    def __init__(
        self, path: Path, reader: _core.RecordingReader, sources: dict[str, Contents], limit: int | None
    ) -> None:
        self._reader, self._limit = reader, limit
        about = json.loads(reader.about())
        self.header, self.ending, self.opened = about["header"], about["ending"] or {}, about["rebuilt"]
        self.array = array_of(self.header["array"])
        self.before = _counts_before(path, self.header)
        self.remarks = Once(lambda: json.loads(self.reader().remarks()))
        self.common: dict[str, Any] = {
            "path": path,
            "name": path.name,
            "kind": "mcap",
            "array": self.array,
            "label": self.header.get("name", "board"),
            "source": self.header["source"],
            "verdict": once(self.verdict),
            "truncated": bool(self.opened["unfinished"]) or "finished" not in self.ending,
            "rebuilt": once(self.rebuilt),
            "sources": sources,
            "remarks": tuple(self.header.get("remarks", ())),
            "lost": tuple(self.header.get("lost", ())),
            "side": self.header.get("side", ""),
            "heel": self.header.get("heel", ""),
        }

    def reader(self) -> _core.RecordingReader:
        """Return the reader of this source, which reads as much as the memory that is available now allows."""
        return self._reader.within(limits.memory(self._limit))

    def board(self, pairing: str) -> Contents:
        """Return the contents of a board."""
        decoded = Once(lambda: self.reader().decode(pairing))
        arrived = lambda: self.remarks()["datagrams"] > 0  # noqa: E731  the same for two fields
        return Contents(
            **self.common | {"verdict": once(lambda: self.verdict(lambda: decoded()[7]))},
            **self.remarked(),
            events=once(lambda: Events._from_parts(decoded()[0], self.array)),
            clock=once(lambda: _clock(decoded()), arrived),
            counts=self.counts(lambda: self.counts_of_board(decoded())),
            datagrams=once(lambda: Datagrams(*self.reader().datagrams()), arrived),
            version_2=once(lambda: bool(json.loads(decoded()[5])["intact"])),
            differences=bool(self.header["difference"]),
            origin_us=int(self.header["origin_us"]),
            unmarked=tuple(self.header.get("repaired", ())),
        )

    def remarked(self) -> dict[str, Any]:
        """Return the fields that a board and pictures share."""
        return {
            "held": once(self.held),
            "registers": once(self.registers),
            "register_changes": once(self.register_changes),
            "board_changes": once(lambda: board_changes_of(self.remarks()["board"])),
            "notes": once(lambda: notes_of(self.remarks()["notes"])),
            "detections": once(lambda: detections_of(self.remarks()["detections"])),
            "zeroings": once(lambda: zeroings_of([one for _, one in self.remarks()["zeroings"]])),
        }

    def pictures(self) -> Contents:
        """Return the contents of a source of pictures."""
        about, place = self.header["pictures"], self.common["path"]
        read = Once(lambda: self.reader().pictures())

        def frames() -> Frames:
            t, values, _ = read()
            shaped = frozen(values).reshape(len(t), *self.array.shape)
            try:
                return Frames(shaped, frozen(t), unit=about["unit"], array=self.array)
            except ProblemError as error:
                raise FormatError(f"{place}, source {self.common['label']}: {error}") from None

        def counts() -> dict[str, Any]:
            t, _, bad = read()
            damage = {"pictures": len(t), "pictures_that_could_not_be_read": bad}
            return {**damage, "received": self.counted().get("received"), **self.rebuilt()}

        names = about.get("columns")
        return Contents(
            **self.common,
            **self.remarked(),
            frames=once(frames),
            counts=self.counts(counts),
            columns=tuple(names) if names else None,
            untimed=not about.get("clock", True),
        )

    def stream(self) -> Contents:
        """Return the contents of a stream of numbers, whose lines are pictures of one row."""
        stream = self.header["stream"]
        read = Once(lambda: self.reader().samples())

        def samples() -> Samples:
            arrived, number, t, values, _ = read()
            rows = values.reshape(len(t), self.array.columns)
            if stream.get("time") is not None:
                own = t / float(stream["unit_us"])
                rows = np.insert(rows, stream["columns"].index(stream["time"]), own, axis=1)
            return Samples(self.header, arrived, number, t, np.ascontiguousarray(rows))

        def frames() -> Frames:
            _, _, t, values, _ = read()
            order = np.argsort(t, kind="stable")
            rows = values.reshape(len(t), 1, self.array.columns)[order]
            return Frames(rows.astype(np.float32), ascending(t[order]), unit="as sent", array=self.array)

        return Contents(
            **self.common | {"verdict": once(lambda: self.verdict(lambda: read()[4]))},
            frames=once(frames),
            clock=once(lambda: Clock(read()[2], read()[0])),
            counts=self.counts(lambda: self.counts_of_stream(read())),
            samples=once(samples, lambda: self.remarks()["samples"] > 0),
            columns=tuple(name for name in stream["columns"] if name != stream.get("time")),
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
        return Registers._of(first, self.driven())

    def register_changes(self) -> tuple[tuple[int, Registers], ...]:
        """Return the registers at each change."""
        return tuple((at, Registers._of(values, self.driven())) for at, values in self.remarks()["registers"])

    def held(self) -> NDArray[np.uint16] | None:
        """Return the values that the taxels held at the beginning."""
        held = self.remarks()["held"]
        if held is None or len(held) != self.array.rows * self.array.columns:
            return None
        return np.array(held, np.uint16).reshape(self.array.shape)

    def rebuilt(self) -> dict[str, int]:
        """Return counts of damage that the reader skipped or repaired."""
        rebuilt = {key: int(value) for key, value in self.opened.items() if key != "unfinished"}
        return {**rebuilt, "bad_chunks": int(self.remarks()["condition"]["bad_chunks"])}

    def counts(self, read: Callable[[], dict[str, Any]]) -> dict[str, Any]:
        """Return the field of counts: those that are read, or those of the recording that this one was converted from.

        Those have the damage of this file beside them.
        """
        if not self.before:
            return once(read, lambda: True)
        return once(lambda: {**self.before, **{cause: n for cause, n in self.rebuilt().items() if n}}, lambda: True)

    def counts_of_board(self, decoded: tuple[Any, ...]) -> dict[str, Any]:
        """Return the numbers of received and lost datagrams and events of a board, by cause and version of the wire."""
        remarks = self.remarks()
        counts = self.counted() or remarks["counts"] or {}
        of_2 = json.loads(decoded[5])
        # What this computer dropped or the file lost is missing among the board's numbers too, and is counted apart.
        skipped = remarks["condition"]["skipped_numbers"]
        of_2["missing"] -= min(of_2["missing"], skipped)
        return {
            "datagrams": remarks["datagrams"],
            "bytes": remarks["datagram_bytes"],
            "missing_numbers": skipped,
            "lost_in_file": self.verdict(lambda: decoded[7]).lost.get("lost_in_file", 0),
            **{name: counts.get(name) for name in ("received", "dropped_by_kernel", "dropped_by_queue")},
            "decoder": json.loads(decoded[1]),
            **({"decoder_version_2": of_2} if of_2["datagrams"] else {}),
            **self.rebuilt(),
        }

    def counts_of_stream(self, read: tuple[Any, ...]) -> dict[str, Any]:
        """Return the numbers of received and lost datagrams and lines of a stream, by cause."""
        found, counts = json.loads(read[4])["damage"], self.counted() or self.remarks()["counts"] or {}
        # What was in no line is not in the file.
        said = {cause: max(n, counts.get("decoder", {}).get(cause, 0)) for cause, n in found.items()}
        return {"samples": len(read[2]), **said, "received": self.counted().get("received"), **self.rebuilt()}

    def counted(self) -> dict[str, Any]:
        """Return the final counts of what was received; of a converted recording, or one that lacks its end, none."""
        counts = self.ending.get("finished", {}).get("counts") or {}
        return {} if self.header.get("converted") else counts

    def verdict(self, found: Callable[[], str] | None = None) -> Verdict:
        """Return what was lost at which stage; `found` decodes a board or a stream, and returns what it found."""
        condition = self.remarks()["condition"]
        if found is not None and condition["messages"] and (condition["changed"] or self.must_decode()):
            condition = condition | {"decoded": json.loads(found())}
        return Verdict._of({"file": condition})

    def must_decode(self) -> bool:
        """Return whether the counts in the file do not tell what decoding finds: damage at the end, wrong times."""
        if "finished" not in self.ending:
            return True
        counts = self.ending["finished"]["counts"]
        causes = DOUBTS if counts.get("steps_back") else (*DOUBTS, *STEPS)
        return not self.header.get("converted") and any(counts["decoder"].get(cause, 0) for cause in causes)


def _counts_before(path: Path, header: dict[str, Any]) -> dict[str, Any]:
    """Return the counts of the recording that a source was converted from, if any."""
    try:
        return counts_of(header.get("counts", {}))
    except ProblemError as error:
        raise FormatError(f"{path}, header, counts: {error}") from None


def _clock(decoded: tuple[Any, ...]) -> Clock:
    arrived, left = decoded[2], decoded[6]
    has = left > np.iinfo(np.int64).min
    return Clock(np.ascontiguousarray(left[has]), np.ascontiguousarray(arrived[has]))


def ascending(t: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return times of pictures, with equal times moved apart by 1 us."""
    steps = np.arange(len(t))
    return np.maximum.accumulate(t - steps) + steps if len(t) else t
