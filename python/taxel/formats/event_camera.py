"""What is read of the events of a camera that looks at a skin from behind: a part, or frames of their counts."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, replace

import numpy as np

from taxel._base.arguments import finite, integer, shown, text
from taxel._base.columns import frozen, frozen_whole
from taxel._base.errors import refused
from taxel._base.limits import check_memory
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.spikes import to_us

POLARITIES = ("both", "on", "off")
#: The longest window, ms: an hour.
_LONGEST_MS = 3.6e6


@dataclass(frozen=True)
class Reduction:
    """Select events of a camera; the arguments are those of `taxel.open`.

    Parameters
    ----------
    region : str, optional
        Columns and rows as "A:B,C:D", where B and D are not included; default: the whole sensor.
    bin : int, pixels, 1 or more, optional
        The side of the square of pixels that becomes a taxel; default: 1.
    count_ms : float, ms, whole us, optional
        Read frames of counts, one for each window; default: events.
    polarity : {"both", "on", "off"}, optional
        Which events are read; default: both.

    Raises
    ------
    ProblemError : a value of another kind

    Examples
    --------
    >>> Reduction("100:420,60:300", bin=4).bounds(640, 480), Reduction(count_ms=2.5).window_us
    ((100, 420, 60, 300), 2500)
    """

    region: str | None = None
    bin: int | None = None
    count_ms: float | None = None
    polarity: str | None = None

    def __post_init__(self) -> None:
        if self.region is not None:
            _ends(self.region)
        if self.bin is not None:
            integer("bin", self.bin, 1, 65_535)
        if self.count_ms is not None:
            window_us = to_us(finite("count_ms", self.count_ms, least=0.001, most=_LONGEST_MS))
            if round(window_us, 6) % 1:
                raise refused("count_ms", f" is {shown(self.count_ms)}: must be a whole number of us")
        if self.polarity is not None:
            text("polarity", self.polarity, POLARITIES)

    @property
    def is_given(self) -> bool:
        """Whether any of these is given."""
        return any(getattr(self, field.name) is not None for field in fields(self))

    def but(self, stated: Reduction | None) -> Reduction:
        """Return the given values, and those of a layout for the others."""
        given = {field.name: value for field in fields(self) if (value := getattr(self, field.name)) is not None}
        return replace(stated or Reduction(), **given)

    @property
    def window_us(self) -> int | None:
        """The window, us; None for events."""
        return None if self.count_ms is None else round(to_us(self.count_ms))

    @property
    def unit(self) -> str:
        """The unit of counts, which names a chosen polarity: a training on one polarity does not fit the other."""
        chosen = "" if self.polarity in (None, "both") else f"{self.polarity} "
        return f"{chosen}events/{self.count_ms:g} ms"

    def bounds(self, columns: int, rows: int) -> tuple[int, int, int, int]:
        """Return first and last (exclusive) column and row of the region on a sensor.

        Raises
        ------
        ProblemError : a region, or a taxel, that is not within the sensor
        """
        left, right, top, bottom = _ends(self.region or ":,:")
        right, bottom = columns if right is None else right, rows if bottom is None else bottom
        if not (left < right <= columns and top < bottom <= rows):
            right_is = f"must be A:B,C:D, A below B and C below D, within 0:{columns},0:{rows}"
            raise refused("region", f" is {shown(self.region)}: {right_is}")
        if (self.bin or 1) > (most := max(right - left, bottom - top)):
            raise refused("bin", f" is {self.bin}: must be a whole number from 1 to {most}, the pixels that are read")
        return left, right, top, bottom


def are_counts(unit: str) -> bool:
    """Return whether values in a unit are counts of events (`Reduction.unit`)."""
    return unit.startswith(("events/", "on events/", "off events/"))


def _ends(region: str) -> tuple[int, int | None, int, int | None]:
    """Return the ends of a region's columns and rows; None for the sensor's own."""
    found = re.fullmatch(r"(\d{0,5}):(\d{0,5}),(\d{0,5}):(\d{0,5})", text("region", region), re.ASCII)
    if found is None:
        raise refused("region", f" is {shown(region)}: must be columns A:B and rows C:D, for example 100:420,60:300")
    left, right, top, bottom = (int(end) if end else None for end in found.groups())
    return left or 0, right, top or 0, bottom


def reduced(name: str, events: Events, reduction: Reduction) -> Events | Frames:
    """Return what is asked for of events without intensities: a part of them, or their counts.

    Raises
    ------
    FormatError : more frames than the memory that is available holds
    ProblemError : a region or a taxel beyond the sensor
    """
    sensor = events.array
    left, right, top, bottom = reduction.bounds(sensor.columns, sensor.rows)
    kept = events.region(slice(left, right), slice(top, bottom))
    if reduction.polarity not in (None, "both"):
        kept = kept[kept.p == (reduction.polarity == "on")]
    side, pitch = reduction.bin or 1, sensor.pitch_mm
    wider = pitch and ((pitch[0] * side, pitch[1] * side) if isinstance(pitch, tuple) else pitch * side)
    array = Array(-(-(bottom - top) // side), -(-(right - left) // side), wider, name=sensor.name)
    x, y = (at // at.dtype.type(side) for at in (kept.x, kept.y))
    window_us = reduction.window_us
    if window_us is None:
        return Events(kept.t, x, y, kept.p, markers=kept.markers, array=array)
    # The windows are those of all events, also of those that are not counted.
    first, last = (int(events.t.min()), int(events.t.max())) if len(events) else (0, -1)
    begin = first // window_us
    count = last // window_us - begin + 1
    size = f"{count} frames of {array.rows} x {array.columns} taxels"
    fewer = "for fewer frames, use --region, a larger --bin or a larger --count-ms"
    check_memory(name, count * (4 * array.rows * array.columns + 8), f"{size} ({fewer}): ")
    values = np.zeros((count, *array.shape), np.float32)
    np.add.at(values, (kept.t // window_us - begin, y, x), np.float32(1))
    t = (begin + np.arange(count, dtype=np.int64)) * window_us
    return Frames(frozen_whole(values), frozen(t), unit=reduction.unit, array=array)
