"""Counts events in windows, and reads what is asked for of events of any file."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import frozen, frozen_whole
from taxel._base.limits import check_memory
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import sensor
from taxel.formats.event_camera.reduction import Reduction
from taxel.frames import Frames

__all__ = ["CountWindows", "reduced"]


class CountWindows:
    """Frames of counts of events, which are added some at a time.

    Parameters
    ----------
    name : str
        The name of the file in errors.
    array : Array
        The taxels of the events.
    first, last : int, us
        The times of the first and the last event of the file, even if these are not counted.
    reduction : Reduction
        With a window.

    Raises
    ------
    FormatError : more frames than the memory that is available holds
    """

    def __init__(self, name: str, array: Array, first: int, last: int, reduction: Reduction) -> None:
        assert reduction.window_us is not None
        self._array, self._unit, self._window_us = array, reduction.unit, reduction.window_us
        self._begin = first // self._window_us
        count = last // self._window_us - self._begin + 1
        size = f"{count} frames of {array.rows} x {array.columns} taxels"
        fewer = "for fewer frames, use --region, a larger --bin or a larger --count-ms (in Python: window_ms)"
        check_memory(name, count * (4 * array.rows * array.columns + 8), f"{size} ({fewer}): ")
        self._values = np.zeros((count, *array.shape), np.float32)

    def add(self, t: NDArray[np.int64], x: NDArray[np.uint16], y: NDArray[np.uint16]) -> bool:
        """Count events; return whether all are in the windows."""
        window = t // self._window_us - self._begin
        if len(window) and not 0 <= window.min() <= window.max() < len(self._values):
            return False
        place = (window * self._array.rows + y) * self._array.columns + x
        np.add.at(self._values.reshape(-1), place, np.float32(1))
        return True

    def frames(self) -> Frames:
        """Return the frames; the time of each is the beginning of its window."""
        t = (self._begin + np.arange(len(self._values), dtype=np.int64)) * self._window_us
        return Frames(frozen_whole(self._values), frozen(t), unit=self._unit, array=self._array)


def reduced(name: str, events: Events, reduction: Reduction) -> Events | Frames:
    """Return what is asked for of events without intensities: a part of them, or their counts.

    Raises
    ------
    FormatError : more frames than the memory that is available holds
    ProblemError : a region or a taxel beyond the sensor
    """
    sensor_array = events.array
    left, right, top, bottom = reduction.bounds(sensor_array.columns, sensor_array.rows)
    kept = events.region(slice(left, right), slice(top, bottom))
    if reduction.polarity not in (None, "both"):
        kept = kept[kept.p == (reduction.polarity == "on")]
    side, pitch = reduction.side, sensor_array.pitch_mm
    wider = pitch and ((pitch[0] * side, pitch[1] * side) if isinstance(pitch, tuple) else pitch * side)
    array = sensor(
        name, Array(*reduction.shape(sensor_array.columns, sensor_array.rows), wider, name=sensor_array.name)
    )
    x, y = ((at - at.dtype.type(begin)) // at.dtype.type(side) for at, begin in ((kept.x, left), (kept.y, top)))
    if reduction.window_us is None:
        return Events(kept.t, x, y, kept.p, markers=kept.markers, array=array)
    ends = (int(events.t.min()), int(events.t.max())) if len(events) else (0, -1)
    counts = CountWindows(name, array, *ends, reduction)
    counts.add(kept.t, x, y)
    return counts.frames()
