"""Reads files of the board's raw bytes (.lsa), as the manual defines them."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.errors import unreadable
from taxel._base.limits import check_memory
from taxel.array import Array
from taxel.reading import Datagrams, Facts, InMemory
from taxel.verdict import Verdict
from taxel.wire.columns import filled

#: Bytes of an event in memory.
_EVENT = 16


@dataclass(frozen=True, eq=False, kw_only=True)
class LsaReader(InMemory):
    """A .lsa, whose bytes are kept: `datagrams` cuts them at stamps, each of which is its arrival time."""

    payload: NDArray[np.uint8]
    differences: bool

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "facts", replace(self.facts, raw="datagrams"))

    def datagrams(self) -> Datagrams:
        """Return the bytes as datagrams."""
        return cut_raw(self.payload, differences=self.differences)


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


def cut_raw(raw: NDArray[np.uint8], *, differences: bool = False) -> Datagrams:
    """Split raw bytes into datagrams; the arrival time of each is the board's time of its first stamp."""
    raw = np.ascontiguousarray(raw)
    offsets, times = _core.wire_cut(raw)
    numbers = np.arange(len(times), dtype=np.uint64)
    return Datagrams(times * 1000, numbers, offsets, raw, differences=differences)
