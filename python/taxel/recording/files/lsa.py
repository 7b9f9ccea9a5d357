"""Files of the board's raw bytes (.lsa), as the manual defines them, with the empty .lss that marks them complete."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.errors import unreadable
from taxel._base.files import write_whole
from taxel._base.limits import check_memory
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.reading import Datagrams, Facts, InMemory
from taxel.recording.source import SourceView
from taxel.verdict import Verdict
from taxel.wire import decode as wire_decode
from taxel.wire.columns import filled

#: Bytes of an event in memory.
_EVENT = 16
#: The unit of the stamps of wire version 1, us.
STAMP_US = 100


@dataclass(frozen=True, eq=False, kw_only=True)
class LsaReader(InMemory):
    """A .lsa, whose bytes are kept."""

    payload: NDArray[np.uint8]
    differences: bool

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "facts", replace(self.facts, raw="datagrams"))

    def datagrams(self) -> Datagrams:
        """Return the bytes as datagrams, cut at stamps; the arrival time of each is the board's of its first stamp."""
        payload = np.ascontiguousarray(self.payload)
        offsets, times = _core.wire_cut(payload)
        numbers = np.arange(len(times), dtype=np.uint64)
        return Datagrams(times * 1000, numbers, offsets, payload, differences=self.differences)


def read_lsa(path: Path, array: Array | None = None, *, differences: bool = False) -> LsaReader:
    """Return a reader of a .lsa.

    Parameters
    ----------
    path : Path
    array : Array, optional
        The sensor, which the file does not hold; default: the thesis'.
    differences : bool
        Whether intensities are differences.

    Raises
    ------
    FormatError : more than the memory that is available, or wire version 2
    OSError : the file cannot be read
    """
    array = Array.thesis() if array is None else array
    size = path.stat().st_size
    rows = _core.wire_rows(1, size)
    check_memory(path, size + rows * _EVENT)
    payload = np.fromfile(path, np.uint8)
    if _core.is_version_2(payload):
        raise unreadable(
            "begins with a datagram of wire version 2; a .lsa file contains only version 1: record version 2 to a "
            ".mcap file",
            path,
        )
    decoder = _core.WireDecoder(1, array, differences)
    events = filled(array, rows, lambda columns: decoder.fill(payload, None, columns, True))
    decoded, marker = decoder.counts(), path.with_suffix(".lss")
    complete = marker.exists()
    facts = Facts(
        path=path,
        array=array,
        kind="lsa",
        begins_us=0,
        remarks=("after a silence of more than 6.45 s, times are too early by a multiple of 6.5536 s",),
        truncated=not complete,
    )
    damage = _core.recording_damage(json.dumps(decoded))
    verdict = Verdict._of({"raw": [None if complete else marker.name, damage]})
    counts = {"bytes": len(payload), "decoder": decoded}
    return LsaReader(facts, events, lost=verdict, counted=counts, payload=payload, differences=differences)


def write_lsa(path: Path, source: SourceView, *, overwrite: bool) -> list[str]:
    """Write a `.lsa` and its `.lss` whole; until then an older pair stays as it is.

    Returns
    -------
    list of str
        What of the events it cannot hold.

    Raises
    ------
    ProblemError : frames
    OSError : a target that exists, a full disk ...
    """
    marker, events, received = path.with_suffix(".lss"), source.table, source.received
    if not isinstance(events, Events):
        raise ProblemError(f"{path}: a .lsa can contain only events; write frames to .mcap, .npz, .csv or .h5")
    if not overwrite and os.path.lexists(marker):
        raise FileExistsError(errno.EEXIST, "exists already; give overwrite=True to replace it", str(marker))
    lost = [] if source.array == Array.thesis() else ["the sensor"]
    is_as_received = isinstance(received, Datagrams) and received.version == 1
    if isinstance(received, Datagrams) and is_as_received:
        payload = received.payload
    else:
        times = np.concatenate([events.t, np.array([at for at, _ in events.markers], np.int64)])
        lost += ["times finer than 100 us"] * bool((times % STAMP_US).any())
        lost += ["which events are repaired"] * (events.repaired is not None)
        payload = np.frombuffer(_core.wire_encode(events), np.uint8)
    differences = isinstance(received, Datagrams) and received.differences and is_as_received
    lost += ["the fact that intensities are differences"] * differences
    again = wire_decode(payload, array=source.array, differences=differences)
    if not np.array_equal(again.t, events.t // STAMP_US * STAMP_US):
        lost.append("whole turns of 6.5536 s in times")
    write_whole(path, lambda file: file.write(payload.data), overwrite=overwrite)
    write_whole(marker, lambda _: None, overwrite=True)
    return lost
