"""The geometry of a sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, number, numbers, shown, text, whole
from taxel._core import ProblemError

__all__ = ["Array"]


@dataclass(frozen=True, eq=False, repr=False)
class Array:
    """Describe a sensor: rows, columns, the pitch of its taxels, and which of them exist.

    A taxel's index is ``row * columns + column``; x is the column, y the row.

    Parameters
    ----------
    rows, columns : int, 1 or more
    pitch_mm : float, above 0
        Distance between the centres of neighbouring taxels.
    exists : bool, shape (rows, columns), optional
        Which taxels exist; default: all.
    name : str

    Raises
    ------
    ProblemError : no row or column, a pitch that is not above 0, or `exists` of another shape

    Examples
    --------
    >>> Array(64, 64, pitch_mm=2.67, name="thesis")
    Array(thesis: 64 rows x 64 columns, 4096 taxels, 2.67 mm apart)
    """

    rows: int
    columns: int
    pitch_mm: float = 1.0
    exists: NDArray[np.bool_] | None = None
    name: str = "array"

    def __post_init__(self) -> None:
        for field in ("rows", "columns"):
            object.__setattr__(self, field, whole(field, getattr(self, field), 1, 65_535))
        pitch = number("pitch_mm", self.pitch_mm, "mm")
        if not (np.isfinite(pitch) and pitch > 0):
            raise ProblemError(f"pitch_mm is {shown(self.pitch_mm)}: must be above 0 and finite")
        object.__setattr__(self, "pitch_mm", pitch)
        text("name", self.name)
        if self.exists is not None:
            exists = numbers("exists", self.exists, np.bool_).copy()
            if exists.shape != self.shape:
                raise ProblemError(f"exists has shape {exists.shape}: must be {self.shape}")
            exists.setflags(write=False)
            object.__setattr__(self, "exists", exists)

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
        return cls.thesis() if array is None else instance("array", array, cls)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

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
        for name, place, end in (("x", column, self.columns), ("y", row, self.rows)):
            if place.size and not (place.min() >= 0 and place.max() < end):
                raise ProblemError(f"{name} reaches from {place.min()} to {place.max()}: must lie in 0 to {end - 1}")
        try:
            return np.asarray(row * self.columns + column)
        except ValueError:
            raise ProblemError(f"x has shape {column.shape}, y {row.shape}: must be equal") from None

    def region(self, x: slice, y: slice) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return first and last (exclusive) column and row of a rectangle of columns `x` and rows `y`.

        Parameters
        ----------
        x, y : slice
            Columns and rows, from the first to before the last; without a step.

        Raises
        ------
        ProblemError : no slices of whole numbers, or one with a step

        Examples
        --------
        >>> Array(8, 8).region(slice(2, 6), slice(None))
        ((2, 6), (0, 8))
        """
        limits = []
        for name, chosen, size in (("x", x, self.columns), ("y", y, self.rows)):
            if not isinstance(chosen, slice) or chosen.step not in (None, 1):
                raise ProblemError(f"{name} is {shown(chosen)}: must be a slice without a step, as slice(8, 16)")
            try:
                first, last, _ = chosen.indices(size)
            except TypeError:
                raise ProblemError(
                    f"{name} is {shown(chosen)}: a slice goes from one whole number to another"
                ) from None
            limits.append((first, last))
        return limits[0], limits[1]

    def _parts(self) -> tuple[int, int, float, str, list[bool] | None]:
        """Return the fields as the compiled part reads them."""
        exists = None if self.exists is None else [bool(e) for e in self.exists.ravel()]
        return self.rows, self.columns, self.pitch_mm, self.name, exists

    @classmethod
    def _from_parts(cls, parts: tuple[int, int, float, str, list[bool] | None]) -> Array:
        rows, columns, pitch_mm, name, exists = parts
        grid = None if exists is None else np.array(exists).reshape(rows, columns)
        return cls(rows, columns, pitch_mm, grid, name)

    def _geometry(self) -> dict[str, Any]:
        """Return the array as JSON values."""
        return dict(zip(("rows", "columns", "pitch_mm", "name", "exists"), self._parts(), strict=True))

    @classmethod
    def _from_geometry(cls, geometry: dict[str, Any]) -> Array:
        parts = (geometry[name] for name in ("rows", "columns", "pitch_mm", "name"))
        return cls._from_parts((*parts, geometry.get("exists")))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Array):
            return NotImplemented
        return self._parts() == other._parts()

    def __hash__(self) -> int:
        return hash((self.rows, self.columns, self.pitch_mm, self.name))

    def __repr__(self) -> str:
        return (
            f"Array({self.name}: {self.rows} rows x {self.columns} columns, {self.taxels} taxels, "
            f"{self.pitch_mm:g} mm apart)"
        )
