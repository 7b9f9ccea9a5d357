"""Regions of a sensor: rectangles, polygons and sets of taxels with names, and the axis of what is loaded.

A file ``NAME.regions.json`` holds the regions of a recording: ``{"unit": "mm", "regions": [{"name": "heel",
"rectangle": [0, 0, 40, 60]}, {"name": "toes", "polygon": [[0, 200], [40, 200], [20, 260]]}, {"name": "hallux",
"taxels": [[3, 41], [4, 41]]}]}``; of several sensors each region names its own, ``"source": "left"``. Places are x to
the right and y downwards, as `Array.positions` has them: in mm, in "places" (the unit of places without one), or in
"taxels" (columns and rows of a grid); taxels are column and row.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import checked_path, finite, finite_numbers, instance, several, text
from taxel._base.documents import read_json
from taxel._base.errors import refused, unreadable
from taxel._base.files import write_whole
from taxel._core import ProblemError
from taxel.array import Array

__all__ = ["Axis", "Region", "axis", "read_regions", "write_regions"]

UNITS = ("mm", "places", "taxels")


@dataclass(frozen=True)
class Region:
    """Hold a part of a sensor.

    Parameters
    ----------
    name : str
    corners : sequence of (float, float), in `unit`
        x and y of the corners of a polygon whose sides do not cross; empty for a set of taxels.
    taxels : sequence of (int, int)
        Column and row of each taxel; empty for a polygon.
    unit : {"mm", "places", "taxels"}
        The unit of the corners.
    source : str
        Which sensor of a recording of several it is of, and its places count from; "": the only one.

    Raises
    ------
    ProblemError : no name, neither or both of corners and taxels, fewer than three corners, or sides that cross

    Examples
    --------
    >>> heel = Region.rectangle("heel", 0, -5, 15, 5)
    >>> heel.shares(Array(1, 3, pitch_mm=10.0))
    array([[0.5, 1. , 0. ]])
    """

    name: str
    corners: tuple[tuple[float, float], ...] = ()
    taxels: tuple[tuple[int, int], ...] = ()
    unit: str = "mm"
    source: str = ""

    def __post_init__(self) -> None:
        if not text("name", self.name):
            raise refused("name", " is '': must be the region's name")
        text("unit", self.unit, UNITS)
        text("source", self.source)
        corners, taxels = (_pairs(f"region {self.name}", pairs) for pairs in (self.corners, self.taxels))
        if bool(len(corners)) == bool(len(taxels)):
            raise ProblemError(f"region {self.name}: must have either corners or taxels")
        if len(corners):
            if len(corners) < 3:
                raise ProblemError(f"region {self.name}: has {len(corners)} corners; a polygon has three or more")
            if (crossing := _crossing(corners)) is not None:
                a, b = crossing
                raise ProblemError(f"region {self.name}: its sides after corners {a} and {b} cross; counted from 0")
        object.__setattr__(self, "corners", tuple(map(tuple, corners.tolist())))
        object.__setattr__(self, "taxels", tuple(map(tuple, taxels.astype(np.int64).tolist())))

    @classmethod
    def rectangle(cls, name: str, left: float, top: float, right: float, bottom: float, unit: str = "mm") -> Region:
        """Return a rectangle.

        Parameters
        ----------
        name : str
        left, top, right, bottom : float, in `unit`
        unit : {"mm", "places", "taxels"}
        """
        return cls(name, ((left, top), (right, top), (right, bottom), (left, bottom)), unit=unit)

    def shares(self, array: Array) -> NDArray[np.float64]:
        """Return which share of the area of each taxel is inside, shape (rows, columns).

        A taxel of a grid is a rectangle of the pitch around its middle; one with a place is inside or not.

        Parameters
        ----------
        array : Array

        Raises
        ------
        ProblemError : corners in another unit than the taxels' positions, a taxel that does not exist, or none inside
        """
        if Array._given(array).places is not None or len(self.taxels):
            shares = self.centred(array).astype(np.float64)
        else:
            shares = np.where(array._there(), _covered(self._polygon(array), *array.shape), 0.0)
        if not shares.any():
            raise ProblemError(f"region {self.name}: no taxel of {array!r} is in it")
        return shares

    def centred(self, array: Array) -> NDArray[np.bool_]:
        """Return which taxels have their middle inside, shape (rows, columns).

        Parameters
        ----------
        array : Array

        Raises
        ------
        ProblemError : as of `shares`
        """
        there = Array._given(array)._there()
        if len(self.taxels):
            column, row = np.array(self.taxels).T
            inside = (column >= 0) & (column < array.columns) & (row >= 0) & (row < array.rows)
            if not inside.all() or not there[row, column].all():
                k = int(np.flatnonzero(~inside)[0]) if not inside.all() else int(np.flatnonzero(~there[row, column])[0])
                raise ProblemError(
                    f"region {self.name}: taxel (column {column[k]}, row {row[k]}) is not one of {array!r}"
                )
            chosen = np.zeros(array.shape, bool)
            chosen[row, column] = True
            return chosen
        x, y = np.indices(array.shape, np.float64)[::-1] if array.places is None else array.positions()
        return _inside(self._polygon(array), x, y) & there

    def _polygon(self, array: Array) -> NDArray[np.float64]:
        """Return the corners in columns and rows of a grid, or in the unit of places."""
        of_array = array.centre_unit
        if of_array is None:
            raise ProblemError(
                f"region {self.name}: the positions of the taxels of {array!r} are not known; give a set of taxels"
            )
        corners = np.array(self.corners)
        if self.unit == "taxels" and array.places is None:
            return corners
        if self.unit != of_array:
            raise ProblemError(f"region {self.name}: is in {self.unit}, the taxels' positions are in {of_array}")
        return corners / (array.column_mm, array.row_mm) if array.places is None else corners

    def to_json(self) -> dict[str, Any]:
        """Return the region as JSON holds it, without its unit."""
        kind, places = ("taxels", self.taxels) if self.taxels else ("polygon", self.corners)
        of_source = {"source": self.source} if self.source else {}
        return {"name": self.name, **of_source, kind: [list(place) for place in places]}


def read_regions(path: str | os.PathLike[str]) -> tuple[Region, ...]:
    """Return the regions of a file.

    Parameters
    ----------
    path : path

    Raises
    ------
    FormatError : not JSON, not a list of regions, a region that is none, or two of one name (names the region)
    """
    stated = read_json(checked_path("path", path))
    listed = stated.get("regions") if isinstance(stated, dict) else None
    if not isinstance(listed, list) or not listed or not all(isinstance(one, dict) for one in listed):
        raise unreadable('must be {"unit": "mm", "regions": [{"name": ..., "rectangle" or "polygon" or ...}]}', path)
    unit, found = stated.get("unit", "mm"), list[Region]()
    for one in listed:
        name = one.get("name", "")
        try:
            match one:
                case {"rectangle": [left, top, right, bottom]}:
                    region = Region.rectangle(name, left, top, right, bottom, unit)
                case {"polygon": corners}:
                    region = Region(name, corners, unit=unit)
                case {"taxels": taxels}:
                    region = Region(name, taxels=taxels, unit=unit)
                case _:
                    raise ProblemError(
                        f"region {name}: must have rectangle (left, top, right, bottom), polygon or taxels"
                    )
            found.append(replace(region, source=one.get("source", "")))
        except ProblemError as error:
            raise unreadable(str(error), path) from None
        if name in {region.name for region in found[:-1]}:
            raise unreadable(f"region {name}: two regions have this name", path)
    return tuple(found)


def write_regions(path: str | os.PathLike[str], regions: Sequence[Region], *, overwrite: bool = False) -> None:
    """Write regions of one unit to a file.

    Parameters
    ----------
    path : path
    regions : sequence of Region
    overwrite : bool

    Raises
    ------
    ProblemError : regions in several units
    OSError : as of `taxel.report.write_whole`
    """
    each = [instance("regions", region, Region) for region in several("regions", regions)]
    units = {region.unit for region in each if not region.taxels} or {"taxels"}
    if len(units) > 1:
        raise refused("regions", f" are in {', '.join(sorted(units))}: must be in one unit")
    stated = {"unit": units.pop(), "regions": [region.to_json() for region in each]}
    write_whole(path, lambda file: file.write(json.dumps(stated, indent=1).encode()), overwrite=overwrite)


@dataclass(frozen=True)
class Axis:
    """Hold the long principal axis of a loaded shape.

    Attributes
    ----------
    x, y : float, in the array's `centre_unit`
        The middle of the loaded area.
    dx, dy : float, -1 to 1
        The direction of the axis, of length 1; downwards, or to the right where it is level.
    length, width : float, in the array's `centre_unit`
        How far the loaded taxels reach along and across it.
    """

    x: float
    y: float
    dx: float
    dy: float
    length: float
    width: float


def axis(picture: ArrayLike, array: Array, above: float = 0.0) -> Axis:
    """Return the long principal axis of the taxels of a picture, such as `Frames.maximum`, that are loaded.

    Parameters
    ----------
    picture : float64, shape (rows, columns)
    array : Array
        Of equal taxels.
    above : float, in the picture's unit
        A taxel with a greater value is loaded; all loaded taxels count alike.

    Raises
    ------
    ProblemError : fewer than three loaded taxels, which have no axis; channels

    Examples
    --------
    >>> axis([[0, 1, 1, 1, 0]], Array(1, 5, pitch_mm=10.0))
    Axis(x=20.0, y=0.0, dx=1.0, dy=0.0, length=30.0, width=10.0)
    """
    loaded = finite_numbers("picture", picture) > finite("above", above)
    if loaded.shape != Array._given(array).shape or np.count_nonzero(loaded) < 3:
        raise refused("picture", f": {np.count_nonzero(loaded)} loaded taxels; an axis needs three or more")
    places = np.stack([one[loaded] for one in array.positions()], axis=1)
    middle = places.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((places - middle).T))
    along = vectors[:, 1] * (1 if tuple(np.round(vectors[::-1, 1], 12)) > (0, 0) else -1)
    # A taxel of a grid reaches half a pitch to each side.
    half = np.zeros(2)
    if array.places is None:
        half = np.array([array.column_mm, array.row_mm] if array.pitch_mm is not None else [1.0, 1.0]) / 2
    reach = [np.ptp((places - middle) @ one) + 2 * half @ np.abs(one) for one in (along, along[::-1] * (1, -1))]
    return Axis(*map(float, (*middle, *along, *reach)))


def _pairs(name: str, pairs: object) -> NDArray[np.float64]:
    """Return pairs of finite numbers, shape (n, 2)."""
    listed = several(name, pairs)
    values = finite_numbers(name, listed) if len(listed) else np.empty((0, 2))
    if values.ndim != 2 or values.shape[1] != 2:
        raise ProblemError(f"{name}: must be a list of pairs of numbers")
    return values


def _crossing(corners: NDArray[np.float64]) -> tuple[int, int] | None:
    """Return two sides of a polygon that cross, by the corners from which they go; None if none do."""
    a, b = corners, np.roll(corners, -1, axis=0)

    def turns(p: NDArray[np.float64], q: NDArray[np.float64], r: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.sign(
            (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
        )

    i, j = np.triu_indices(len(a), 1)
    apart = (turns(a[i], b[i], a[j]) * turns(a[i], b[i], b[j]) < 0) & (
        turns(a[j], b[j], a[i]) * turns(a[j], b[j], b[i]) < 0
    )
    found = np.flatnonzero(apart)
    return (int(i[found[0]]), int(j[found[0]])) if len(found) else None


def _inside(polygon: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points are in a polygon: a ray to the right crosses an odd number of its sides."""
    inside = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 != y1:
            inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return inside


def _covered(polygon: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float64]:
    """Return which share of each cell of a grid a polygon covers; cells have size 1 around whole numbers.

    The area of a polygon below a level, in a strip of columns, is a sum over its sides of the signed integral of the
    lower of side and level. What is between two levels is the difference.
    """
    begin, end = polygon, np.roll(polygon, -1, axis=0)
    lefts = np.arange(columns)[None, :, None] - 0.5
    levels = np.arange(rows + 1)[None, None, :] - 0.5
    x0, y0, x1, y1 = (one[:, None, None] for one in (*begin.T, *end.T))
    # The part of each side in each strip, from a to b; a side that is upright has none.
    across = x1 - x0
    safe = np.where(across == 0, 1.0, across)
    a, b = np.clip(x0, lefts, lefts + 1), np.clip(x1, lefts, lefts + 1)
    ya, yb = (y0 + (one - x0) / safe * (y1 - y0) for one in (a, b))
    low, high = np.minimum(ya, yb), np.maximum(ya, yb)
    # The share of the way from low to high that is below the level, and the mean of what is.
    rise = np.where(high > low, high - low, 1.0)
    below = np.clip((levels - low) / rise, 0.0, 1.0)
    below = np.where(high > low, below, levels >= low)
    mean = below * (low + below * rise / 2 * (high > low)) + (1 - below) * levels
    return np.asarray(np.abs(np.diff(((b - a) * mean).sum(axis=0), axis=1)).T)
