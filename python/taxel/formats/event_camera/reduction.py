"""Selection of the events of a camera: a region, taxels of several pixels, a polarity, counts in windows."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, replace

from taxel._base.arguments import finite, integer, shown, text
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.spikes import to_us

__all__ = ["POLARITIES", "Reduction", "are_counts"]

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
    window_ms : float, ms, whole us, optional
        Read frames of counts, one for each window; default: events.
    polarity : {"both", "on", "off"}, optional
        Which events are read; default: both.

    Raises
    ------
    ProblemError : a value of another kind

    Examples
    --------
    >>> Reduction("100:420,60:300", bin=4).bounds(640, 480), Reduction(window_ms=2.5).window_us
    ((100, 420, 60, 300), 2500)
    """

    region: str | None = None
    bin: int | None = None
    window_ms: float | None = None
    polarity: str | None = None

    def __post_init__(self) -> None:
        if self.region is not None:
            _ends(self.region)
        if self.bin is not None:
            integer("bin", self.bin, 1, 65_535)
        if self.window_ms is not None:
            window_us = to_us(finite("window_ms", self.window_ms, "ms", least=0.001, most=_LONGEST_MS))
            if round(window_us, 6) % 1:
                raise ProblemError(f"window_ms is {shown(self.window_ms)}: must be a whole number of us")
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
    def side(self) -> int:
        """Pixels along a taxel."""
        return self.bin or 1

    @property
    def window_us(self) -> int | None:
        """The window, us; None for events."""
        return None if self.window_ms is None else round(to_us(self.window_ms))

    @property
    def unit(self) -> str:
        """The unit of counts, which names a chosen polarity: a training on one polarity does not fit the other."""
        chosen = "" if self.polarity in (None, "both") else f"{self.polarity} "
        return f"{chosen}events/{self.window_ms:g} ms"

    def shape(self, columns: int, rows: int) -> tuple[int, int]:
        """Return the rows and columns of taxels on a sensor.

        Raises
        ------
        ProblemError : a region or a taxel beyond the sensor
        """
        left, right, top, bottom = self.bounds(columns, rows)
        width, height = right - left, bottom - top
        if self.side > max(width, height):
            part = "the region" if self.region else "the sensor"
            raise refused(
                "bin",
                f" is {self.side}: must be a whole number from 1 to {max(width, height)}, because {part} has {width} "
                f"columns and {height} rows",
            )
        return -(-height // self.side), -(-width // self.side)

    def bounds(self, columns: int, rows: int) -> tuple[int, int, int, int]:
        """Return first and last (exclusive) column and row of the region on a sensor.

        Raises
        ------
        ProblemError : a region beyond the sensor
        """
        left, right, top, bottom = _ends(self.region or ":,:")
        right, bottom = columns if right is None else right, rows if bottom is None else bottom
        for name, first, end in (("columns", left, right), ("rows", top, bottom)):
            if first >= end:
                order = (
                    ": the first number must be below the second"
                    if first > end
                    else " is empty, because the second number is not included"
                )
                raise ProblemError(f"region {shown(self.region)}: {name} {first}:{end}{order}")
        if not (right <= columns and bottom <= rows):
            size = f"{columns} columns and {rows} rows"
            raise ProblemError(
                f"region {shown(self.region)}: must be within the sensor's {size}, for example 0:{columns},0:{rows}"
            )
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
