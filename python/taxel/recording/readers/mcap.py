"""Reads the live format: each source by a reader, which reads its parts at their first access."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
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
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import BoardChange, Datagrams, Facts, Marks, Reader, Zeroing
from taxel.verdict import Verdict
from taxel.wire import Registers

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
