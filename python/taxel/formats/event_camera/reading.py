"""Reads an event camera's file as events, or as frames of counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from taxel._base.columns import Growing
from taxel._base.errors import damaged, helped, unreadable
from taxel._base.limits import TIME_US
from taxel._base.messages import escaped, first_line, installing
from taxel._core import FormatError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import sensor
from taxel.formats.event_camera.counting import reduced
from taxel.formats.event_camera.headers import check
from taxel.formats.event_camera.reduction import Reduction
from taxel.frames import Frames


def read(path: Path, reduction: Reduction, size: Array | None = None) -> Events | Frames:
    """Read the events of a file, or their counts in windows; `size` is that of a sensor whose header has none.

    Raises
    ------
    FormatError : a file that is damaged, has no header or no event, or is larger than the memory that is available
    ImportError : faery is not installed
    ProblemError : a region or a taxel beyond the sensor
    """
    kind = check(path)
    try:
        import faery  # noqa: PLC0415  an extra
    except ImportError:
        raise ImportError(
            f"{escaped(path)}: to read a file of an event camera, taxel needs faery, which is not installed: "
            f"{installing('events')}"
        ) from None
    read = Growing(str(path), t=((), np.int64), x=((), np.uint16), y=((), np.uint16), p=((), np.bool_))
    try:
        # A header without a size has that of no event.
        given = (0, 0) if size is None else (size.columns, size.rows)
        stream = faery.events_stream_from_file(path, file_type=kind, dimensions_fallback=given)
        columns, rows = stream.dimensions()
        if not columns or not rows:
            raise helped(
                unreadable("the header does not state the size of the sensor", path), "array", "lay_out_camera"
            )
        for packet in stream:
            read.add(t=packet["t"], x=packet["x"], y=packet["y"], p=packet["on"])
    except (FormatError, MemoryError, KeyboardInterrupt):
        raise
    # At damaged files faery also panics, which is no Exception.
    except BaseException as error:
        raise damaged(path, "file of an event camera", first_line(error)) from None
    if not len(read):
        raise unreadable("contains no event; the file is damaged, or nothing moved", path)
    t, x, y, p = (read.column(name) for name in ("t", "x", "y", "p"))
    if t.max() > TIME_US:
        raise unreadable(f"the last time is {t.max()} us; times must be within {TIME_US} us (142 years) of 0", path)
    events = Events(t, x, y, p, array=sensor(str(path), Array(rows, columns, name="event camera")))
    return reduced(str(path), events, reduction) if reduction.is_given else events
