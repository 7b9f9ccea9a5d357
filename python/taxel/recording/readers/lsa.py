"""Reads files of the board's raw bytes (.lsa), as the manual defines them."""

from __future__ import annotations

from pathlib import Path

from taxel import _core
from taxel._base.limits import available
from taxel.array import Array
from taxel.events import Events
from taxel.recording.contents import BoardSource
from taxel.recording.once import known
from taxel.recording.sections import EventTable, Losses, Origin, Sensor, Wire
from taxel.recording.verdict import Verdict


def read_lsa(path: Path, array: Array, pairing: str, differences: bool) -> BoardSource:
    """Return the contents of a .lsa.

    Parameters
    ----------
    path : Path
    array : Array
        The sensor, which the file does not hold.
    pairing : {"direct", "taxel"}
    differences : bool
        Whether intensities are differences.

    Raises
    ------
    FormatError : more than the memory that is available, or wire version 2
    OSError : the file cannot be read
    """
    read = _core.read_lsa(path, array._parts(), pairing, differences, available())
    unmarked = None if read.complete else path.with_suffix(".lss").name
    losses = Losses(
        known({"bytes": len(read.payload), "decoder": read.counts}),
        known(Verdict._of({"raw": [unmarked, read.damage]})),
        ("after a silence of more than 6.45 s, times are too early by a multiple of 6.5536 s",),
        truncated=not read.complete,
    )
    events = known(Events._from_parts(read.events, array))
    wire = Wire(payload=read.payload, differences=differences)
    return BoardSource(Origin(path, path.name, "lsa"), Sensor(array), EventTable(events), wire, losses=losses)
