"""Reads files of the board's raw bytes (.lsa), as the manual defines them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.limits import available
from taxel.array import Array
from taxel.events import Events
from taxel.reading import Datagrams, Facts, InMemory
from taxel.verdict import Verdict


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
    read = _core.read_lsa(path, array._parts(), differences, available())
    facts = Facts(
        path=path,
        array=array,
        kind="lsa",
        begins_us=0,
        remarks=("after a silence of more than 6.45 s, times are too early by a multiple of 6.5536 s",),
        truncated=not read.complete,
    )
    verdict = Verdict._of({"raw": [None if read.complete else path.with_suffix(".lss").name, read.damage]})
    counts = {"bytes": len(read.payload), "decoder": read.counts}
    events = Events._from_parts(read.events, array)
    return LsaReader(facts, events, lost=verdict, counted=counts, payload=read.payload, differences=differences)


def cut_raw(raw: NDArray[np.uint8], *, differences: bool = False) -> Datagrams:
    """Split raw bytes into datagrams; the arrival time of each is the board's time of its first stamp."""
    raw = np.ascontiguousarray(raw)
    offsets, times = _core.wire_cut(raw)
    numbers = np.arange(len(times), dtype=np.uint64)
    return Datagrams(times * 1000, numbers, offsets, raw, differences=differences)
