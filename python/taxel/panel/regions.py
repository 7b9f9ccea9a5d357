"""Regions and pictures of what the page shows: curves in columns of time, isobars, the path of the centre, the file."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from contourpy import contour_generator
from msgspec import Meta, Struct
from numpy.typing import NDArray

from taxel._base.errors import refused
from taxel._base.files import beside, named
from taxel._core import ProblemError
from taxel.array import Array
from taxel.panel.declared import line
from taxel.recording import Recording
from taxel.recording.analysis.pressure import above_rest
from taxel.regions import Region, read_regions, write_regions

#: Corners or taxels of a region, and points of a path.
_MOST_PLACES, _MOST_POINTS = 10_000, 2000
#: A path is where the sum is above a share of its largest.
_LEAST = 0.02
#: Isobars, as shares of the largest value of a picture.
_LEVELS = (0.2, 0.4, 0.6, 0.8)

Measure = Literal["load", "peak", "mean", "area", "x", "y", "end"]
Picture = Literal["maximum", "mean"]
#: Least and greatest in columns of time; None where nothing is known.
Curve = list[tuple[float, float] | None]


class Drawn(Struct, forbid_unknown_fields=True):
    """Hold a region as the page has it: corners in the array's `centre_unit`, or column and row of taxels."""

    name: Annotated[str, line(100)]
    corners: Annotated[list[tuple[float, float]], Meta(max_length=_MOST_PLACES)]
    taxels: Annotated[list[tuple[int, int]], Meta(max_length=_MOST_PLACES)]


class _Part(NamedTuple):
    """Where a sensor lies in the array that is shown: its columns, and how far it was moved, in the `centre_unit`."""

    columns: slice
    x: float


class RegionLoads:
    """Measure regions and pictures of loaded taxels above rest: as `Frames.region` does.

    Parameters
    ----------
    name : str
        Of the recording.
    sensors : dict from str to Recording
        Those that are shown side by side.
    us : int
        How long one us of the file is in the view.

    Raises
    ------
    ProblemError : a sensor without a frame
    """

    def __init__(self, name: str, sensors: Mapping[str, Recording], us: int) -> None:
        read = [above_rest(sensor) for sensor in sensors.values()]
        found = [one for one in read if one is not None and len(one[0])]
        if len(found) < len(sensors):
            raise ProblemError(f"{name}: regions need frames, or events with intensities")
        arrays = [frames.array for frames, *_ in found]
        self.array, lefts = Array._beside(arrays, gap=1)
        self._parts = {
            sensor: _Part(slice(left, left + array.columns), _moved(self.array, array, left))
            for sensor, left, array in zip(sensors, lefts, arrays, strict=True)
        }
        t = np.unique(np.concatenate([frames.t for frames, *_ in found]))
        # Taxel after taxel, so that a region reads only its own; 0: not loaded, NaN: not known.
        self._values = np.zeros((*self.array.shape, len(t)), np.float32)
        for (frames, above, _), part in zip(found, self._parts.values(), strict=True):
            held = np.searchsorted(frames.t, t, side="right") - 1
            loaded = np.where(frames._loaded(above), frames.values, np.float32(0)).transpose(1, 2, 0)
            known = (held >= 0) & (t <= frames.t[-1])
            self._values[: frames.array.rows, part.columns] = np.where(known, loaded[..., held], np.nan)
        self._t, self._unit, areas = t * us, found[0][0].unit, self.array.area_mm2
        self._areas, self._in_n = np.ones(self.array.shape) if areas is None else areas, found[0][0]._in_n
        self.units = {
            "load": "N" if self._in_n else self._unit,
            "peak": self._unit,
            "mean": self._unit,
            "area": "taxels" if areas is None else "mm²",
            **dict.fromkeys("xy", self.array.centre_unit or ""),
            "end": "taxels",
        }
        # What a quiet stretch was subtracted from does not end where the taxel's range does.
        ends = {sensor.range_end for sensor in sensors.values()}
        is_as_read = all(rest.source == "unit" for *_, rest in found)
        self._range_end = ends.pop() if len(ends) == 1 and is_as_read else None

    def _over(self, weights: NDArray[np.float64], part: slice, *, loaded: bool = False) -> NDArray[np.float32]:
        """Return the sum of values by their weights, or of the weights of loaded taxels, over time."""
        total = np.zeros(len(self._t[part]), np.float32)
        for weight, values in zip(weights.astype(np.float32), self._values, strict=True):
            if len(there := np.flatnonzero(weight)):
                taxels = slice(there[0], there[-1] + 1)
                row = values[taxels, part]
                total += weight[taxels] @ ((row > 0).astype(np.float32) if loaded else row)
        return total

    def _measured(self, region: Region, measure: Measure, part: slice) -> NDArray[np.float32]:
        """Return a measure of a region over time; 0 where nothing is loaded, and no centre."""
        shares = region.shares(self.array)
        if measure in ("peak", "end"):
            inside = self._values[region.centred(self.array), part]
            most = np.asarray(inside.max(axis=0, initial=0))
            if measure == "peak":
                return most
            if self._range_end is None:
                raise ProblemError("the end of a taxel's range is not known: the file does not state it")
            return np.asarray(np.where(np.isnan(most), most, np.count_nonzero(inside >= self._range_end, axis=0)))
        if measure in ("x", "y"):
            places, total = self.array.positions()["xy".index(measure)], self._over(shares, part)
            # Of several sensors within its own.
            places = places - self._part_of(region)[1].x if measure == "x" else places
            moment = self._over(np.nan_to_num(places) * shares, part)
            return np.divide(moment, total, where=total > 0, out=np.full_like(total, np.nan))
        areas = shares * self._areas
        if measure == "load":
            return self._over(areas * self._in_n if self._in_n else shares, part)
        area = self._over(areas, part, loaded=True)
        # What is not known is so of each measure.
        values = self._over(areas, part)
        whole = np.where(np.isnan(values), np.nan, area) if measure == "area" else values
        return whole if measure == "area" else np.divide(values, area, out=whole, where=area > 0)

    def curve(self, region: Region, measure: Measure, first: int, count: int, column_us: int) -> Curve:
        """Return least and greatest of a measure in columns of time; None where there is no frame.

        Parameters
        ----------
        region : Region
            In the array that is shown.
        measure : {"load", "peak", "mean", "area"}
        first, count : int
            The number of the first column, which begins at that many times its width, and how many there are.
        column_us : int

        Raises
        ------
        ProblemError : a region that does not fit the array
        """
        starts = np.arange(first, first + count, dtype=np.int64) * column_us
        # A frame holds until the next one.
        begin = np.searchsorted(self._t, starts, side="right") - 1
        end = np.searchsorted(self._t, starts + column_us)
        known = (end > 0) & (starts <= self._t[-1])
        if not known.any():
            return [None] * count
        begin, end = np.maximum(begin[known], 0), end[known]
        low, high = int(begin[0]), int(end[-1])
        measured = self._measured(region, measure, slice(low, high))
        # Pairs of begin and end; what is between an end and the next begin is left out.
        pairs = np.stack([begin - low, end - low], axis=1).ravel()
        padded = np.append(measured, measured[-1:])
        ends = (np.round(of.reduceat(padded, pairs)[::2].astype(float), 4).tolist() for of in (np.fmin, np.fmax))
        found = iter([None if isnan(least) else (least, most) for least, most in zip(*ends, strict=True)])
        return [next(found) if is_known else None for is_known in known]

    def curves(
        self, drawn: Sequence[Drawn], measure: Measure, first: int, count: int, column_us: int
    ) -> list[Curve | str]:
        """Return the curve of each region; of one that does not fit, or is none, the reason."""
        found: list[Curve | str] = []
        for one in drawn:
            try:
                found.append(self.curve(self._region(one), measure, first, count, column_us))
            except ProblemError as error:
                found.append(str(error))
        return found

    def picture(self, kind: Picture, start_us: int, stop_us: int) -> dict[str, Any]:
        """Return the largest or the mean value of each taxel over a time, isobars, and the path of the centre.

        Returns
        -------
        dict
            `values`, row after row; `isobars`, on a grid: corners of each line; `paths` of each sensor: time (us), x
            and y, None where nothing is loaded. Places are in the array's `centre_unit`.
        """
        begin = max(0, int(np.searchsorted(self._t, start_us, side="right")) - 1)
        part = slice(begin, max(int(np.searchsorted(self._t, stop_us)), begin + 1))
        values = self._values[..., part]
        # What is not known counts in neither.
        picture = np.fmax.reduce(values, axis=-1)
        if kind == "mean":
            picture = np.nansum(values, axis=-1) / np.maximum(1, np.count_nonzero(~np.isnan(values), axis=-1))
        picture, has_path = np.nan_to_num(picture).astype(float), self.array.centre_unit is not None
        return {
            "values": np.round(picture.ravel(), 4).tolist(),
            "isobars": self._isobars(picture) if has_path and self.array.places is None else [],
            "paths": [self._path(one.columns, part) for one in self._parts.values()] if has_path else [],
        }

    def _isobars(self, picture: NDArray[np.float64]) -> list[list[list[float]]]:
        # Beyond its edges a sensor bears nothing.
        (rows, columns), (across, down) = self.array.shape, self._steps()
        x, y = np.arange(-1, columns + 1) * across, np.arange(-1, rows + 1) * down
        lines, most = contour_generator(x, y, np.pad(picture, 1)), float(picture.max(initial=0.0))
        found = [np.asarray(one) for level in _LEVELS for one in lines.lines(level * most)] if most > 0 else []
        return [np.round(one, 2).tolist() for one in found]

    def _steps(self) -> tuple[float, float]:
        """Return the distance of columns and rows of a grid, in its `centre_unit`."""
        array = self.array
        return (1.0, 1.0) if array.pitch_mm is None else (array.column_mm, array.row_mm)

    def _path(self, columns: slice, part: slice) -> list[tuple[int, float, float] | None]:
        """Return the path of the centre of a sensor, as of `Frames.centre_path`."""
        places = np.stack([one[:, columns].ravel() for one in self.array.positions()])
        values = self._values[:, columns, part].reshape(places.shape[1], -1)
        total = values.sum(axis=0, dtype=np.float64)
        is_loaded = total > _LEAST * np.nanmax(total, initial=0.0)
        path = np.nan_to_num(places).astype(np.float32) @ values / np.where(is_loaded, total, np.nan)
        some = slice(None, None, 1 + len(total) // _MOST_POINTS)
        points = zip(self._t[part][some].tolist(), *np.round(path[:, some], 3).tolist(), strict=True)
        return [None if isnan(x) else (t, x, y) for t, x, y in points]

    def _scaled(self, region: Region) -> Region:
        """Return a region whose corners are in the array's `centre_unit`, where a file has columns and rows."""
        if region.unit != "taxels" or self.array.places is not None:
            return region
        across, down = self._steps()
        corners = tuple((x * across, y * down) for x, y in region.corners)
        return replace(region, corners=corners, unit=self.array.centre_unit or "taxels")

    def _region(self, drawn: Drawn) -> Region:
        """Return a region in the array that is shown."""
        unit = self.array.centre_unit or "taxels"
        return Region(drawn.name, tuple(drawn.corners), tuple(drawn.taxels), unit)

    def regions(self, drawn: Sequence[Drawn]) -> list[Region]:
        """Return regions of the page as a file has them: of several sensors each of its own.

        Raises
        ------
        ProblemError : a region that does not fit the array, or lies on several sensors
        """
        found = []
        for region in map(self._region, drawn):
            source, part = self._part_of(region)
            found.append(replace(_shifted(region, part, -1), source=source if len(self._parts) > 1 else ""))
        return found

    def _part_of(self, region: Region) -> tuple[str, _Part]:
        """Return the sensor on which a region lies."""
        columns = np.flatnonzero(region.shares(self.array).any(axis=0))
        for source, part in self._parts.items():
            if part.columns.start <= columns[0] and columns[-1] < part.columns.stop:
                return source, part
        raise ProblemError(f"region {region.name}: lies on several sensors; draw one on each")

    def drawn(self, regions: Sequence[Region]) -> list[dict[str, Any]]:
        """Return regions as the page has them.

        Raises
        ------
        ProblemError : a region that does not fit the array, or names none of its sensors
        """
        found = []
        only = next(iter(self._parts)) if len(self._parts) == 1 else ""
        for region in regions:
            source = region.source or only
            if source not in self._parts:
                known = ", ".join(self._parts)
                raise ProblemError(f"region {region.name}: its source is {source!r}: must be one of {known}")
            on = _shifted(self._scaled(region), self._parts[source], 1)
            on.shares(self.array)
            found.append({"name": on.name, "corners": on.corners, "taxels": on.taxels})
        return found


def _moved(shown: Array, array: Array, left: int) -> float:
    """Return how far a sensor was moved to the right where it is shown, in the `centre_unit`."""
    if shown.places is not None and array.places is not None:
        there = array._there()
        return float((shown.places.x[: array.rows, left : left + array.columns][there] - array.places.x[there])[0])
    return left * (1.0 if shown.pitch_mm is None else shown.column_mm)


def _shifted(region: Region, part: _Part, sign: int) -> Region:
    """Return a region moved to where its sensor is shown, or back."""
    corners = tuple((x + sign * part.x, y) for x, y in region.corners)
    return replace(region, corners=corners, taxels=tuple((x + sign * part.columns.start, y) for x, y in region.taxels))


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
