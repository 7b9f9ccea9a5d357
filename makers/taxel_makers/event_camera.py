"""Event cameras of Prophesee (`.raw` in EVT2 and EVT3, `.dat`) and iniVation (`.aedat4`), by the library faery.

They are read as events, or, with a window, as frames of counts (`taxel.formats.event_camera`). No live camera is read.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from taxel import Array, Events, ProblemError
from taxel.formats.layout import Layout
from taxel.reading import Facts, InMemory, beginning, damaged, helped, unreadable
from taxel.recording.kinds import Kind

#: The endings of these files, and how faery names what is in them.
ENDINGS: dict[str, str] = {".raw": "evt", ".dat": "dat", ".aedat4": "aedat"}
#: What begins a text in UTF-8 or UTF-16, which no event does.
_TEXTS = (b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")


def knows(path: Path) -> bool:
    """Return whether a file is of this kind: ``.raw`` and ``.aedat4``, and those ``.dat`` that are not text."""
    ending = path.suffix.lower()
    if ending != ".dat" or not path.is_file():
        return ending in ENDINGS and path.is_file()
    head = beginning(path)
    header = re.match(rb"(?:%[^\n]*\n)*", head)
    below = head[header.end() if header else 0 :][:64]
    # Of each event's word the upper bytes of its time are 0.
    return not head.startswith(_TEXTS) and (below[1:2] == b"\x08" or below.count(0) >= 8)


def read(path: Path, layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the events; rows and columns of a layout are those of a sensor whose header has none.

    Raises
    ------
    FormatError : a file that is damaged, has no header or no event, or is larger than the memory that is available
    ImportError : faery is not installed (``pip install 'taxel[events]'``)
    """
    try:
        import faery  # noqa: PLC0415  an extra
    except ImportError:
        how = "which is not installed: pip install 'taxel[events]'"
        raise ImportError(f"{path}: to read a file of an event camera, taxel needs faery, {how}") from None
    kind = ENDINGS[path.suffix.lower()]
    if not beginning(path, 1).startswith(b"#" if kind == "aedat" else b"%"):
        raise damaged(path, "file of an event camera", "it begins with no header")
    try:
        # A header without a size has that of no event.
        size = None if layout is None else layout.grid()
        given = (0, 0) if size is None else (size.columns, size.rows)
        stream = faery.events_stream_from_file(path, file_type=kind, dimensions_fallback=given)
        columns, rows = stream.dimensions()
        packets = list(stream) if columns and rows else []
    except (MemoryError, KeyboardInterrupt, FileNotFoundError, PermissionError):
        raise
    # At damaged files faery also panics, which is no Exception.
    except BaseException as error:
        raise damaged(path, "file of an event camera", _why(error)) from None
    if not columns or not rows:
        raise helped(unreadable("the header does not state the size of the sensor", path), "array", "lay_out_camera")
    if not packets:
        raise unreadable("contains no event; the file is damaged, or nothing moved", path)
    found = np.concatenate(packets)
    try:
        array = Array(rows, columns, name="event camera")
        events = Events(found["t"].astype(np.int64), found["x"], found["y"], found["on"], array=array)
    except ProblemError as error:
        raise damaged(path, "file of an event camera", str(error)) from None
    return [InMemory(Facts(path=path, array=array, kind="event_camera"), events)]


def _why(error: BaseException) -> str:
    """Return the first line of an error of faery."""
    return str(error).partition("\n")[0][:200] or type(error).__name__


CAMERA = Kind(knows, read, has_size=True)
