"""Reads an event camera's file as events, or as frames of counts."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import frozen
from taxel._base.limits import TIME_US, unpacked
from taxel._base.messages import escaped, installing
from taxel._base.reading_child import ReadingChild
from taxel._core import FormatError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import sensor
from taxel.formats.event_camera.counting import CountWindows
from taxel.formats.event_camera.headers import check
from taxel.formats.event_camera.reduction import Reduction
from taxel.frames import Frames

_CHILD = Path(__file__).with_name("child.py")
#: The longest time between two lines of the child, s.
PATIENCE_S = 30.0
#: The columns of events, in the order in which the child sends them.
_COLUMNS: dict[str, np.dtype[Any]] = {
    "t": np.dtype(np.int64),
    "x": np.dtype(np.uint16),
    "y": np.dtype(np.uint16),
    "p": np.dtype(np.bool_),
}


def read(path: Path, reduction: Reduction) -> Events | Frames:
    """Read the events of a file, or their counts in windows.

    The file is read twice, first for the size of its arrays and then for their values, so that the arrays are made
    once.

    Raises
    ------
    FormatError : a file that is damaged, has no header or no event, or is larger than the limit
    ImportError : faery is not installed
    ProblemError : a region or a taxel beyond the sensor
    """
    kind = check(path)
    if find_spec("faery") is None:
        raise ImportError(
            f"{escaped(path)}: to read a file of an event camera, taxel needs faery, which is not installed: "
            f"{installing('events')}"
        )
    with _EventFile(path, kind) as file:
        return file.read(reduction)


class _EventFile(ReadingChild):
    """Open an event camera's file as a context manager."""

    def __init__(self, path: Path, encoding: str) -> None:
        super().__init__(_CHILD, path, "file of an event camera", PATIENCE_S)
        self._encoding = encoding

    def read(self, reduction: Reduction) -> Events | Frames:
        """Return the events, or their counts."""
        self._order({"kind": self._encoding})
        columns, rows = self._answer()["size"]
        if not columns or not rows:
            raise FormatError(
                f"{self.path}: the header does not state the size; add a line to the header, for example % "
                f"geometry 640x480"
            )
        left, right, top, bottom = reduction.bounds(columns, rows)
        array = sensor(str(self.path), Array(*reduction.shape(columns, rows), name="event camera"))
        how = {
            "kind": self._encoding,
            "bounds": [left, right, top, bottom],
            "side": reduction.side,
            "polarity": reduction.polarity or "both",
        }
        self._order({**how, "columns": False})
        while "total" not in (found := self._answer()):
            pass
        if not found["total"]:
            raise FormatError(f"{self.path}: contains no event; the file is damaged, or nothing moved")
        first, last = found["ends"]
        if last > TIME_US:
            raise FormatError(
                f"{self.path}: the last time is {last} us; times must be within {TIME_US} us (142 years) of 0"
            )
        self._order({**how, "columns": True})
        if reduction.window_us is None:
            return self._events(array, found["count"])
        return self._counts(array, first, last, reduction)

    def _pieces(self) -> Iterator[dict[str, NDArray[Any]]]:
        """Yield the columns of some events after the other."""
        while "events" in (answer := self._answer()):
            count = answer["events"]
            yield {name: self._bytes(count * kind.itemsize).view(kind) for name, kind in _COLUMNS.items()}

    def _events(self, array: Array, count: int) -> Events:
        unpacked(str(self.path), count * sum(kind.itemsize for kind in _COLUMNS.values()))
        read, at = {name: np.empty(count, kind) for name, kind in _COLUMNS.items()}, 0
        for piece in self._pieces():
            end = at + len(piece["t"])
            if end > count:
                break
            for name, column in piece.items():
                read[name][at:end] = column
            at = end
        if at != count:
            raise FormatError(f"{self.path}: the file changed while taxel read it")
        t, x, y, p = (frozen(column) for column in read.values())
        return Events(t, x, y, p, array=array)

    def _counts(self, array: Array, first: int, last: int, reduction: Reduction) -> Frames:
        counts = CountWindows(str(self.path), array, first, last, reduction)
        for piece in self._pieces():
            if not counts.add(piece["t"], piece["x"], piece["y"]):
                raise FormatError(f"{self.path}: the file changed while taxel read it")
        return counts.frames()
