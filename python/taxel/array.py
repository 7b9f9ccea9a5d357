"""The geometry of a sensor."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, integer, number, numbers, several, shown, text
from taxel._base.columns import frozen
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped, warn
from taxel._core import ProblemError

__all__ = ["Array", "Places", "of_size"]


@dataclass(frozen=True, eq=False, repr=False)
class Places:
    """The place of each taxel of a sensor whose taxels are not evenly spaced.

    Parameters
    ----------
    x, y : float64, shape (rows, columns) or (taxels,), in `unit`
        To the right and downwards from any origin; finite. Values for a taxel that does not exist are not used.
    area : float64, of the same shape, in the square of `unit`, above 0, optional
        The area of each taxel, if it is known.
    unit : {"mm"}, optional
        Default: unknown. Places without a unit are drawn and give a centre in their own units.

    Raises
    ------
    ProblemError : `x`, `y` and `area` have different shapes, or the unit is not one of these

    Examples
    --------
    >>> Places([0.0, 10.0, 5.0], [0.0, 0.0, 8.0], unit="mm")
    Places(3 taxels, in mm, areas unknown)
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    area: NDArray[np.float64] | None = None
    unit: str | None = None

    def __post_init__(self) -> None:
        for name in ("x", "y", "area"):
            if getattr(self, name) is None and name == "area":
                continue
            values = numbers(name, getattr(self, name), np.float64).copy()
            if values.ndim not in (1, 2) or values.shape != np.shape(self.x):
                raise refused(
                    name, f" has shape {values.shape}: must be {np.shape(self.x)}, as for x: one value per taxel"
                )
            object.__setattr__(self, name, frozen(values))
        if self.unit is not None:
            text("unit", self.unit, ("mm",))

    def _placed_on(self, array: Array) -> Places:
        """Return the places in the shape of an array, which must be finite where a taxel exists."""
        there = array._there()
        changed: dict[str, NDArray[np.float64]] = {}
        for name in ("x", "y", "area"):
            values = getattr(self, name)
            if values is None:
                continue
            if values.size != there.size or (values.ndim == 2 and values.shape != there.shape):
                raise refused("places", f": {name} has shape {values.shape}: must be {array.shape}, one per taxel")
            # Files hold no NaN.
            values = np.where(there, values.reshape(there.shape), float(name == "area"))
            wrong = ~np.isfinite(values) | ((values <= 0) if name == "area" else False)
            if wrong.any():
                row, column = np.argwhere(wrong)[0]
                right = "above 0 and finite" if name == "area" else "finite"
                value = values[row, column]
                raise refused("places", f": {name} of row {row}, column {column} is {value}: must be {right}")
            changed[name] = values
        return Places(changed["x"], changed["y"], changed.get("area"), self.unit)

    def _part(self, rows: slice, columns: slice) -> Places:
        """Return the places of a rectangle."""
        area = None if self.area is None else self.area[rows, columns]
        return Places(self.x[rows, columns], self.y[rows, columns], area, self.unit)

    def _json(self) -> dict[str, Any]:
        areas = {} if self.area is None else {"area": self.area.ravel().tolist()}
        return {"x": self.x.ravel().tolist(), "y": self.y.ravel().tolist(), **areas, "unit": self.unit}

    def __eq__(self, other: object) -> bool:
        return self._json() == other._json() if isinstance(other, Places) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.x.size, self.unit))

    def __repr__(self) -> str:
        unit = "in mm" if self.unit else "without a unit"
        return f"Places({self.x.size} taxels, {unit}, areas {'unknown' if self.area is None else 'known'})"


@dataclass(frozen=True, eq=False, repr=False)
class Array:
    """Describe a sensor: rows, columns, the pitch or the places of its taxels, and which of them exist.

    A taxel's index is ``row * columns + column``; x is the column, y the row.

    Parameters
    ----------
    rows, columns : int, 1 or more
    pitch_mm : float or (float, float), mm, above 0, optional
        Distance between the centres of neighbouring taxels, or two distances: between rows and between columns.
        Default: unknown. Without it no result is in mm.
    exists : bool, shape (rows, columns), optional
        Which taxels exist; default: all.
    name : str
    places : Places, optional
        The place of each taxel, instead of a pitch.
    names : sequence of str, one per taxel, row by row, optional
        The name of each taxel, such as a column of a table; "" for one without a name.

    Raises
    ------
    ProblemError : no row or column, a pitch that is not above 0, `exists`, `places` or `names` of another shape, or
        both a pitch and places

    Notes
    -----
    A grid, with rows and columns both above 1, has a map even if its pitch is unknown: its centre of pressure is in
    columns and rows, its contact area a number of taxels. The taxels of a single row or column with neither pitch nor
    places are channels: they have curves, but no map, centre or area.

    Examples
    --------
    >>> Array(64, 64, pitch_mm=2.67, name="thesis")
    Array(thesis: 64 rows x 64 columns, 4096 taxels, 2.67 mm apart)
    >>> Array(48, 32, pitch_mm=(7.62, 5.08), name="plate")
    Array(plate: 48 rows x 32 columns, 1536 taxels, rows 7.62 mm and columns 5.08 mm apart)
    >>> Array(1, 8, name="foot")
    Array(foot: 1 row x 8 columns, 8 taxels, of unknown pitch)
    """

    rows: int
    columns: int
    pitch_mm: float | tuple[float, float] | None = None
    exists: NDArray[np.bool_] | None = None
    name: str = "array"
    places: Places | None = None
    names: Sequence[str] | None = None

    def __post_init__(self) -> None:
        for field in ("rows", "columns"):
            object.__setattr__(self, field, integer(field, getattr(self, field), 1, 65_535))
        object.__setattr__(self, "pitch_mm", None if self.pitch_mm is None else _pitch(self.pitch_mm))
        text("name", self.name)
        if self.exists is not None:
            exists = numbers("exists", self.exists, np.bool_).copy()
            if exists.shape != self.shape:
                raise refused("exists", f" has shape {exists.shape}: must be {self.shape}")
            object.__setattr__(self, "exists", frozen(exists))
        if self.places is not None:
            if self.pitch_mm is not None:
                raise ProblemError("pitch_mm and places are both given: give only one of them")
            object.__setattr__(self, "places", instance("places", self.places, Places)._placed_on(self))
        if self.names is not None:
            names = tuple(text("names", entry) for entry in several("names", self.names))
            places = self.rows * self.columns
            if len(names) != places:
                raise refused(
                    "names", f" has {counted(len(names), 'entry', 'entries')}: must be one per taxel, {places}"
                )
            object.__setattr__(self, "names", names)

    @classmethod
    def thesis(cls) -> Array:
        """Return the thesis' array: 64 x 64 taxels, 2.67 mm apart (chapter 4).

        Examples
        --------
        >>> Array.thesis()
        Array(thesis 64x64: 64 rows x 64 columns, 4096 taxels, 2.67 mm apart)
        """
        return cls(64, 64, 2.67, name="thesis 64x64")

    @classmethod
    def _of(cls, array: object) -> Array:
        """Return the given array, or the thesis' array for None."""
        return cls.thesis() if array is None else cls._given(array)

    @classmethod
    def _given(cls, array: object) -> Array:
        """Return a given array; where it is two numbers, as a shape, the error shows how to make an array of them."""
        if isinstance(array, tuple | list) and len(array) == 2 and all(type(side) is int for side in array):
            wanted = f"must be an array, for example taxel.Array({array[0]}, {array[1]})"
            raise refused("array", f" is {shown(array)}: {wanted}")
        return instance("array", array, cls)

    @classmethod
    def _beside(cls, arrays: Sequence[Array], gap: int = 0) -> tuple[Array, list[int]]:
        """Return one array of several from left to right, `gap` empty columns apart, and the first column of each.

        Rows that an array lacks do not exist there.
        """
        if len(arrays) == 1:
            return arrays[0], [0]
        *lefts, end = accumulate((array.columns + gap for array in arrays), initial=0)
        shape = max(array.rows for array in arrays), end - gap
        ats = [np.s_[: array.rows, left : left + array.columns] for array, left in zip(arrays, lefts, strict=True)]
        exists, names = np.zeros(shape, bool), np.full(shape, "", object)
        for at, array in zip(ats, arrays, strict=True):
            exists[at] = array._there()
            names[at] = "" if array.names is None else np.array(array.names, object).reshape(array.shape)
        pitches = {array.pitch_mm for array in arrays}
        beside = cls(
            *shape,
            pitches.pop() if len(pitches) == 1 else None,
            None if exists.all() else exists,
            " | ".join(dict.fromkeys(array.name for array in arrays)),
            _places_beside(arrays, ats, shape),
            names.ravel().tolist() if any(array.names is not None for array in arrays) else None,
        )
        return beside, lefts

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    @property
    def _has_neighbours(self) -> bool:
        """Whether taxels are known to be side by side: a single row or column without a pitch is channels."""
        return self.pitch_mm is not None or 1 not in self.shape or self.shape == (1, 1)

    @property
    def _has_axes(self) -> bool:
        """Whether the channels are the axes of taxels: names end in _x, _y and _z, equally many in each."""
        counts = Counter(name[-2:] for name in self.names or ())
        return self.is_channels and set(counts) == {"_x", "_y", "_z"} and len(set(counts.values())) == 1

    def _padded(self, shape: tuple[int, int]) -> Array:
        """Return a larger grid, whose first rows and columns are this array."""
        return Array(*shape, self.pitch_mm, name=self.name)

    @property
    def _is_whole_grid(self) -> bool:
        """Whether it is a grid of taxels that all exist, so that it may be padded at its far edges."""
        return self.exists is None and self.places is None and 1 not in self.shape

    def _holds(self, array: Array) -> bool:
        """Whether a smaller sensor can be the first rows and columns of this array."""
        are_grids = self._is_whole_grid and array._is_whole_grid
        return are_grids and array.rows <= self.rows and array.columns <= self.columns

    @property
    def taxels(self) -> int:
        """The number of taxels that exist."""
        return self.rows * self.columns if self.exists is None else int(np.count_nonzero(self.exists))

    def index(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.int64]:
        """Return the index ``row * columns + column`` of taxels.

        Parameters
        ----------
        x, y : int or int64, shape (n,), taxels
            Column and row.

        Returns
        -------
        int64, the shape of `x`

        Raises
        ------
        ProblemError : a column or row outside the array, or `x` and `y` of different shapes

        Examples
        --------
        >>> Array(4, 8).index([3, 0], [0, 1])
        array([3, 8])
        """
        column, row = numbers("x", x, np.int64), numbers("y", y, np.int64)
        for name, indices, end in (("x", column, self.columns), ("y", row, self.rows)):
            if indices.size and not (indices.min() >= 0 and indices.max() < end):
                raise refused(name, f" reaches from {indices.min()} to {indices.max()}: must be from 0 to {end - 1}")
        try:
            return np.asarray(row * self.columns + column)
        except ValueError:
            raise refused("x", f" has shape {column.shape}, but y has {row.shape}: must be equal") from None

    def region(self, x: slice, y: slice) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return first and last (exclusive) column and row of a rectangle of columns `x` and rows `y`.

        Parameters
        ----------
        x, y : slice
            Columns and rows, from the first to before the last; without a step.

        Raises
        ------
        ProblemError : not slices of whole numbers, or a slice with a step

        Examples
        --------
        >>> Array(8, 8).region(slice(2, 6), slice(None))
        ((2, 6), (0, 8))
        """
        limits = []
        for name, chosen, size in (("x", x, self.columns), ("y", y, self.rows)):
            if not isinstance(chosen, slice) or chosen.step not in (None, 1):
                raise refused(name, f" is {shown(chosen)}: must be a slice without a step, for example slice(8, 16)")
            try:
                first, last, _ = chosen.indices(size)
            except TypeError:
                raise refused(name, f" is {shown(chosen)}: a slice must be from one whole number to another") from None
            limits.append((first, last))
        return limits[0], limits[1]

    @property
    def row_mm(self) -> float:
        """The distance between the centres of neighbouring rows, mm.

        Raises
        ------
        ProblemError : the pitch is not known
        """
        return self._pitch("row_mm")[0]

    @property
    def column_mm(self) -> float:
        """The distance between the centres of neighbouring columns, mm.

        Raises
        ------
        ProblemError : the pitch is not known
        """
        return self._pitch("column_mm")[1]

    @property
    def area_mm2(self) -> NDArray[np.float64] | None:
        """The area of each taxel, mm2, shape (rows, columns); None if it is not known.

        Examples
        --------
        >>> Array(1, 2, pitch_mm=(2.0, 3.0)).area_mm2, Array(1, 2).area_mm2
        (array([[6., 6.]]), None)
        """
        if self.pitch_mm is not None:
            return np.full(self.shape, self.row_mm * self.column_mm)
        in_mm = self.places is not None and self.places.unit == "mm"
        return self.places.area if in_mm and self.places is not None else None

    @property
    def is_channels(self) -> bool:
        """Whether it is a single row or column with neither pitch nor places, which has no map, centre or area.

        Examples
        --------
        >>> Array(1, 8).is_channels, Array(1, 8, pitch_mm=5.0).is_channels, Array(2, 4).is_channels
        (True, False, False)
        """
        return not self._is_measured and min(self.shape) == 1

    @property
    def centre_unit(self) -> str | None:
        """The unit of a centre of pressure: "mm", "taxels" (columns and rows) or "places" (those without a unit).

        None for channels, which have no centre.
        """
        if self.places is not None:
            return self.places.unit or "places"
        if self.pitch_mm is not None:
            return "mm"
        return None if self.is_channels else "taxels"

    def positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where the taxels are: x to the right and y downwards, in `centre_unit`.

        Returns
        -------
        float64, shape (rows, columns), twice
            On a grid from the middle of the taxel in the first column and row.

        Raises
        ------
        ProblemError : channels

        Examples
        --------
        >>> Array(1, 3, pitch_mm=5.0).positions()[0]
        array([[ 0.,  5., 10.]])
        """
        if self.places is not None:
            return self.places.x, self.places.y
        if self.is_channels:
            raise ProblemError(
                f"{self.name}: {self.rows} x {self.columns} channels without a pitch or places, so their positions are "
                "not known"
            )
        down, across = (1.0, 1.0) if self.pitch_mm is None else (self.row_mm, self.column_mm)
        y, x = np.indices(self.shape, dtype=np.float64)
        return x * across, y * down

    def fits(self, array: Array) -> bool:
        """Return whether what was measured or trained on one sensor can be used on another.

        Parameters
        ----------
        array : Array

        Returns
        -------
        bool
            Whether both have the same rows, columns and taxels; neither names nor pitch nor places count.

        Raises
        ------
        ProblemError : not an array

        Examples
        --------
        >>> Array(8, 8, pitch_mm=2.67).fits(Array(8, 8)), Array(8, 8).fits(Array(8, 9))
        (True, False)
        """
        instance("array", array, Array)
        return self.shape == array.shape and np.array_equal(self._there(), array._there())

    def _warn_apart(self, array: Array, subject: str, stacklevel: int = 2) -> bool:
        """Warn, and return true, if another sensor's known pitch or places differ, for which nothing is refused."""
        known = self._is_measured and array._is_measured
        if not known or (self.pitch_mm, self.places) == (array.pitch_mm, array.places):
            return False
        differ = f"{array.name} has taxels {array._apart()}, but {self.name} has taxels {self._apart()}"
        if self._apart() == array._apart():
            differ = f"{array.name} and {self.name} have their taxels at different places"
        warn(f"{subject}: {differ}", stacklevel=stacklevel + 1)
        return True

    def _part(self, x: slice, y: slice) -> Array:
        """Return a rectangle of columns `x` and rows `y` as a separate sensor; refuse one without a taxel."""
        (left, right), (top, bottom) = self.region(x, y)
        if right <= left or bottom <= top:
            raise ProblemError(f"region {x}, {y}: no taxel of {self!r} is in it")
        rows, columns = slice(top, bottom), slice(left, right)
        exists = None if self.exists is None else self.exists[rows, columns]
        places = None if self.places is None else self.places._part(rows, columns)
        kept = np.arange(self.rows * self.columns).reshape(self.shape)[rows, columns].ravel().tolist()
        names = None if self.names is None else [self.names[k] for k in kept]
        return Array(bottom - top, right - left, self.pitch_mm, exists, self.name, places, names)

    @property
    def _is_measured(self) -> bool:
        """Whether its pitch or places are known."""
        return self.pitch_mm is not None or self.places is not None

    def _there(self) -> NDArray[np.bool_]:
        """Return which taxels exist, shape (rows, columns)."""
        return np.ones(self.shape, bool) if self.exists is None else self.exists

    def _pitch(self, purpose: str) -> tuple[float, float]:
        """Return the distances between rows and between columns, mm, for `purpose` that needs them."""
        pitch = self.pitch_mm
        if pitch is None:
            raise ProblemError(
                f"{purpose} needs distances in mm, but the pitch of {self.name} is not known: give its pitch_mm"
            )
        return pitch if isinstance(pitch, tuple) else (pitch, pitch)

    def _apart(self) -> str:
        """Return in words how far apart the taxels are."""
        if self.places is not None:
            return f"at places {'in mm' if self.places.unit else 'without a unit'}"
        if isinstance(self.pitch_mm, tuple):
            return f"rows {self.pitch_mm[0]:g} mm and columns {self.pitch_mm[1]:g} mm apart"
        return "of unknown pitch" if self.pitch_mm is None else f"{self.pitch_mm:g} mm apart"

    def _geometry(self) -> dict[str, Any]:
        """Return the array as JSON values."""
        exists = None if self.exists is None else self.exists.ravel().tolist()
        parts: dict[str, Any] = {"rows": self.rows, "columns": self.columns, "pitch_mm": self.pitch_mm}
        parts |= {"name": self.name, "exists": exists}
        parts |= {} if self.places is None else {"places": self.places._json()}
        return parts if self.names is None else parts | {"names": list(self.names)}

    @classmethod
    def _from_geometry(cls, geometry: dict[str, Any]) -> Array:
        """Return the array that a file describes."""
        pitch = geometry.get("pitch_mm")
        pitch = tuple(pitch) if isinstance(pitch, list) else pitch
        rows, columns, name = (geometry[field] for field in ("rows", "columns", "name"))
        exists, places = geometry.get("exists"), geometry.get("places")
        grid = None if exists is None else np.array(exists).reshape(rows, columns)
        of_each = None if places is None else Places(**places)
        return cls(rows, columns, pitch, grid, name, of_each, geometry.get("names"))

    def __eq__(self, other: object) -> bool:
        return self._geometry() == other._geometry() if isinstance(other, Array) else NotImplemented

    def __hash__(self) -> int:
        return hash((self.rows, self.columns, self.pitch_mm, self.name))

    def __repr__(self) -> str:
        size = f"{counted(self.rows, 'row')} x {counted(self.columns, 'column')}, {counted(self.taxels, 'taxel')}"
        return escaped(f"Array({self.name}: {size}, {self._apart()})")


def _places_beside(
    arrays: Sequence[Array], ats: Sequence[tuple[slice, slice]], shape: tuple[int, int]
) -> Places | None:
    """Return the places of arrays side by side; None unless all have them in one unit.

    Arrays that do not overlap from left to right keep their places, for example those of two feet in one system of
    coordinates; others are set half a width apart.
    """
    places = [array.places for array in arrays if array.places is not None]
    if len(places) < len(arrays) or len({sensor.unit for sensor in places}) > 1:
        return None
    across = [sensor.x[array._there()] for array, sensor in zip(arrays, places, strict=True)]
    apart = all(a.max() < b.min() for a, b in pairwise(across))
    x, y, area, right = np.zeros(shape), np.zeros(shape), np.ones(shape), 0.0
    for at, sensor, width in zip(ats, places, across, strict=True):
        x[at], y[at] = sensor.x if apart else sensor.x - width.min() + right, sensor.y
        right += 1.5 * (width.max() - width.min())
        area[at] = 1.0 if sensor.area is None else sensor.area
    known = all(sensor.area is not None for sensor in places)
    return Places(x, y, area if known else None, places[0].unit)


def _pitch(pitch: object) -> float | tuple[float, float]:
    """Return a pitch as one number, or as a pair if its two numbers differ."""
    pair = isinstance(pitch, tuple | list) or (isinstance(pitch, np.ndarray) and pitch.ndim > 0)
    if pair and len(pitch) != 2:  # type: ignore[arg-type]
        raise refused("pitch_mm", f" is {shown(pitch)}: must be a number, or two numbers, for rows and for columns")
    values = list(pitch) if pair else [pitch]  # type: ignore[call-overload]
    each = [number("pitch_mm", value) for value in values]
    if not all(np.isfinite(distance) and distance > 0 for distance in each):
        raise refused("pitch_mm", f" is {shown(pitch)}: must be above 0 and finite")
    return each[0] if each[0] == each[-1] else (each[0], each[1])


def of_size(size: str, *, of_wire: bool = True) -> Array:
    """Return the array of a size, rows x columns [x mm]; without mm, the pitch of the board's wire or none.

    Raises
    ------
    ProblemError : the text is not such a size
    """
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})(?:x(\d{1,4}(?:\.\d{1,6})?))?", size, re.ASCII)
    if match is None:
        raise refused(
            "array",
            f" is {size}: must be rows x columns, for example 64x64, or with the pitch in mm, for example 64x64x2.67",
        )
    thesis = Array.thesis()
    rows, columns, pitch = int(match[1]), int(match[2]), thesis.pitch_mm if of_wire else None
    pitch = float(match[3]) if match[3] else pitch
    same = (rows, columns, pitch) == (*thesis.shape, thesis.pitch_mm)
    try:
        return thesis if same else Array(rows, columns, pitch_mm=pitch, name=size)
    except ProblemError as error:
        raise refused("array", f" is {size}: {error}") from None
