"""Writes files of the board's raw bytes (.lsa), with the empty .lss that marks them complete."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np

from taxel import _core
from taxel._base.files import write_whole
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.reading import Datagrams
from taxel.recording.source import SourceView
from taxel.wire import decode as wire_decode

#: The unit of the stamps of wire version 1, us.
STAMP_US = 100


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
