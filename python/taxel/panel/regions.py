"""Regions of a recording that the page shows: their file, and the curve of each in columns of time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct
from numpy.typing import NDArray

from taxel._base.errors import refused
from taxel._base.files import beside, named
from taxel._core import ProblemError
from taxel.frames import Frames
from taxel.panel.declared import line
from taxel.recording import Recording
from taxel.recording.analysis.pressure import above_rest
from taxel.regions import Region, read_regions, write_regions

#: Corners or taxels of a region.
_MOST_PLACES = 10_000


class Drawn(Struct, forbid_unknown_fields=True):
    """Hold a region as the page has it: corners in the array's `centre_unit`, or column and row of taxels."""

    name: Annotated[str, line(100)]
    corners: Annotated[list[tuple[float, float]], Meta(max_length=_MOST_PLACES)]
    taxels: Annotated[list[tuple[int, int]], Meta(max_length=_MOST_PLACES)]


class RegionLoads:
    """Give the force of regions, or the sum of their values, of frames above rest: as `Frames.region` does.

    Parameters
    ----------
    recording : Recording
        Of frames of one sensor.
    us : int
        How long one us of the file is in the view.

    Raises
    ------
    ProblemError : several sensors, or no frame
    """

    def __init__(self, recording: Recording, us: int) -> None:
        found = None if recording.is_several or recording.has_events else above_rest(recording)
        if found is None or not len(found[0]):
            raise ProblemError(f"{recording.path.name}: regions need frames of one sensor")
        frames, above, _ = found
        self.array = frames.array
        force = frames._in_n
        self.unit, self.above = frames.unit if force is None else "N", above
        areas = np.ones(self.array.shape) if force is None else np.asarray(self.array.area_mm2) * force
        # Taxel after taxel, so that a region reads only its own.
        loads = _loaded(frames, above) * areas.astype(np.float32)
        self._loads = np.ascontiguousarray(loads.transpose(1, 2, 0))
        self._t = frames.t * us

    def curve(self, region: Region, first: int, count: int, column_us: int) -> list[tuple[float, float] | None]:
        """Return least and greatest load in columns of time; None where there is no frame.

        Parameters
        ----------
        region : Region
        first, count : int
            The number of the first column, which begins at that many times its width, and how many there are.
        column_us : int

        Raises
        ------
        ProblemError : a region that does not fit the array
        """
        shares = region.shares(self.array).astype(np.float32)
        starts = np.arange(first, first + count, dtype=np.int64) * column_us
        # A frame holds until the next one.
        begin = np.searchsorted(self._t, starts, side="right") - 1
        end = np.searchsorted(self._t, starts + column_us)
        known = (end > 0) & (starts <= self._t[-1])
        if not known.any():
            return [None] * count
        begin, end = np.maximum(begin[known], 0), end[known]
        low, high = int(begin[0]), int(end[-1])
        load = np.zeros(high - low, np.float32)
        for share, loads in zip(shares, self._loads, strict=True):
            if len(inside := np.flatnonzero(share)):
                part = slice(inside[0], inside[-1] + 1)
                load += share[part] @ loads[part, low:high]
        # Pairs of begin and end; what is between an end and the next begin is left out.
        pairs = np.stack([begin - low, end - low], axis=1).ravel()
        padded = np.append(load, load[-1:])
        least, greatest = (of.reduceat(padded, pairs)[::2].astype(float) for of in (np.minimum, np.maximum))
        found = iter(zip(np.round(least, 4).tolist(), np.round(greatest, 4).tolist(), strict=True))
        return [next(found) if is_known else None for is_known in known]

    def curves(
        self, drawn: Sequence[Drawn], first: int, count: int, column_us: int
    ) -> list[list[tuple[float, float] | None] | str]:
        """Return the curve of each region; of one that does not fit, or is none, the reason."""
        found: list[list[tuple[float, float] | None] | str] = []
        for one in drawn:
            try:
                found.append(self.curve(self.regions([one])[0], first, count, column_us))
            except ProblemError as error:
                found.append(str(error))
        return found

    def regions(self, drawn: Sequence[Drawn]) -> list[Region]:
        """Return regions of the page."""
        unit = self.array.centre_unit or "taxels"
        return [Region(one.name, tuple(one.corners), tuple(one.taxels), unit) for one in drawn]

    def drawn(self, regions: Sequence[Region]) -> list[dict[str, Any]]:
        """Return regions as the page has them.

        Raises
        ------
        ProblemError : a region that does not fit the array
        """
        unit, pitch = self.array.centre_unit, self.array.pitch_mm
        found = []
        for region in regions:
            region.shares(self.array)
            in_taxels = bool(region.corners) and region.unit == "taxels" != unit and pitch is not None
            x, y = (self.array.column_mm, self.array.row_mm) if in_taxels else (1.0, 1.0)
            corners = [(a * x, b * y) for a, b in region.corners]
            found.append({"name": region.name, "corners": corners, "taxels": region.taxels})
        return found


def _loaded(frames: Frames, above: float) -> NDArray[np.float32]:
    """Return the values of the loaded taxels, and 0 for the others."""
    return np.where(frames._loaded(above), frames.values, np.float32(0))


def regions_beside(recording: Path) -> Path:
    """Return the file of the regions of a recording."""
    return beside(recording, f"{named(recording).stem}.regions.json")


def read_beside(recording: Path) -> tuple[Region, ...]:
    """Return the regions beside a recording; none without a file.

    Raises
    ------
    FormatError : as of `read_regions`
    """
    file = regions_beside(recording)
    return read_regions(file) if file.exists() else ()


def write_beside(recording: Path, regions: Sequence[Region], *, replace: bool) -> None:
    """Write the regions beside a recording.

    Raises
    ------
    ProblemError : the file is there, and it is not to be replaced
    OSError : it cannot be written
    """
    file = regions_beside(recording)
    if os.path.lexists(file) and not replace:
        raise refused("replace", f": {file.name} exists already")
    write_regions(file, regions, overwrite=replace)
