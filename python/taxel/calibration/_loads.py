"""Known loads on an array, and the gains and the exponent that they determine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from taxel._base.arguments import instance, integer, several, shown
from taxel._base.arguments import text as checked_text
from taxel._base.errors import refused
from taxel._base.messages import warn
from taxel._core import ProblemError
from taxel.array import Array
from taxel.calibration._curves import N_PER_KPA_MM2, Curve, Values, above_0
from taxel.frames import Frames

#: What a calibration may be in: force on a taxel, or pressure at it.
UNITS = ("N", "kPa")
#: Range in which an exponent is searched: conductance of a fabric and counts of common sheets are well within.
_EXPONENTS = (0.2, 5.0)
#: Exponents that miss the loads by less than this share (root mean square) count as equally good.
_ALIKE = 1e-3


class Load(NamedTuple):
    """A known load, and the sensor's readings under it.

    Parameters
    ----------
    frames : Frames
        Recorded under the load; the mean of each taxel is used.
    load : float, above 0
    unit : {"N", "kPa"}
        Total force, however it is spread, or the same pressure at every taxel.
    taxel : (int, int), optional
        Column and row of the only taxel that bears it.

    Raises
    ------
    ProblemError : values that are invalid, when `Calibration.fit` gets it

    Examples
    --------
    >>> Load(Frames([[[20.0, 10.0]]], [0]), 3.0).unit
    'N'
    """

    frames: Frames
    load: float
    unit: str = "N"
    taxel: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Measured:
    """What a load says of the taxels that read it, from their mean readings above the floor.

    Parameters
    ----------
    load : float
    above : float64, shape (rows, columns)
        Readings above rest; NaN where a taxel does not count.
    weight : float64, shape (rows, columns)
        The load's unit by that of the calibration.
    alone : bool
        Whether each taxel has to make the load by itself.
    """

    load: float
    above: Values
    weight: Values
    alone: bool

    @classmethod
    def of(
        cls, load: Load, number_of: int, array: Array, units: tuple[str, str], rest: Values, floor: float
    ) -> Measured:
        """Return what a load says; `units` are those of readings and of the calibration."""
        frames, location = instance("frames", load.frames, Frames), f"load {number_of}"
        same(array, frames.array, f"the frames of {location}", frames.unit, units[0])
        value, unit = above_0(location, load.load), checked_text("unit", load.unit, UNITS)
        if not len(frames):
            raise ProblemError(f"{location}: no frame was recorded while the load was on the array")
        above = frames.values.mean(axis=0, dtype=np.float64) - rest
        chosen = array._there() & (above > floor)
        if load.taxel is not None:
            only = several(f"{location}, taxel", load.taxel)
            if len(only) != 2:
                raise ProblemError(f"{location}, taxel is {shown(load.taxel)}: must be a column and a row")
            x, y = (integer(f"{location}, taxel", n, 0) for n in only)
            chosen &= np.arange(chosen.size).reshape(chosen.shape) == int(array.index(x, y))
        if not chosen.any():
            raise ProblemError(f"{location}: no taxel reads more than {floor:g} {units[0]} above its rest")
        weight = np.ones(array.shape)
        if unit != units[1]:
            if array.area_mm2 is None:
                raise ProblemError(
                    f"{location}: the unit is {unit}, but that of the calibration is {units[1]}; to convert, taxel "
                    f"needs the area of each taxel, which is unknown for {array!r}"
                )
            newtons = array.area_mm2 * N_PER_KPA_MM2
            weight = 1 / newtons if unit == "kPa" else newtons
        # Uniform pressure is on every taxel: one that reads nothing is broken, and no measure of the others.
        alone = unit == "kPa" or load.taxel is not None
        return cls(value, np.where(chosen, above, np.nan), weight, alone)

    def shares(self, curve: Curve, gain: float | Values = 1.0) -> Values:
        """Return the share of the load that each taxel makes, shape (rows, columns); NaN where it does not count."""
        return np.asarray(self.weight * gain * curve.values(self.above) / self.load)

    def share(self, curve: Curve, gain: float | Values = 1.0) -> float:
        """Return the share of the load that all make: the sum of forces, the mean of pressures."""
        shares = self.shares(curve, gain)
        return float(np.nanmean(shares) if self.alone else np.nansum(shares))

    def errors(self, curve: Curve, gain: Values) -> Values:
        """Return the error of each equation, as a share of the load."""
        shares = self.shares(curve, gain)
        return (shares[~np.isnan(shares)] if self.alone else np.nansum(shares, keepdims=True).reshape(1)) - 1.0


def _least(shares: Values) -> tuple[float, float]:
    """Return the gain of loads with the least squares of relative error, by the share that each is, and their mean."""
    gain = float(shares.sum() / (shares**2).sum()) if (shares > 0).any() else 1.0
    return gain, float(np.mean((gain * shares - 1.0) ** 2))


def best_exponent(measured: Sequence[Measured]) -> float:
    """Return the exponent whose best gain has the least squares of relative error."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  loads slowly

    def missed(log: float) -> float:
        return _least(np.array([load.share(Curve(math.exp(log))) for load in measured]))[1]

    # A grid comes first, as the squares may have several minima.
    grid = np.linspace(math.log(_EXPONENTS[0]), math.log(_EXPONENTS[1]), 33)
    miss = np.array([np.inf, *map(missed, grid), np.inf])
    valleys = np.flatnonzero((miss[1:-1] <= miss[:-2]) & (miss[1:-1] < miss[2:]))
    around = [(grid[max(0, k - 1)], grid[min(len(grid) - 1, k + 1)]) for k in map(int, valleys)]
    minima = [minimize_scalar(missed, bounds=bounds, method="bounded", options={"xatol": 1e-9}) for bounds in around]
    best, *others = sorted((float(minimum.fun), math.exp(float(minimum.x))) for minimum in minima)
    alike = [exponent for squares, exponent in others if squares <= max(4.0 * best[0], _ALIKE**2)]
    if alike:
        also = ", ".join(f"{exponent:.3g}" for exponent in alike)
        warn(
            f"loads: the exponent {best[1]:.3g} is used, but {also} would fit the loads as well; to be sure, add a "
            "load or give the exponent",
            stacklevel=3,
        )
    return best[1]


def gains(array: Array, curve: Curve, measured: Sequence[Measured], *, each: bool) -> tuple[Values, float]:
    """Return the gain of each taxel, and the common one."""
    common, _ = _least(np.array([load.share(curve) for load in measured]))
    by_taxel = np.full(array.shape, common)
    if not each:
        return by_taxel, common
    if not any(load.alone for load in measured):
        raise refused(
            "each", ": no load determines a single taxel; give a load of uniform pressure (kPa), or the taxel of a load"
        )
    shares = np.nan_to_num([load.shares(curve) for load in measured if load.alone])
    squares = (shares**2).sum(axis=0)
    np.divide(shares.sum(axis=0), squares, out=by_taxel, where=squares > 0)
    return by_taxel, common


def same(calibrated: Array, given: Array, subject: str, unit: str | None = None, expected: str | None = None) -> None:
    """Refuse what has other taxels, or another unit; warn of another pitch."""
    if not calibrated.fits(given):
        raise ProblemError(f"{subject}: the array is {given!r}; that of the calibration is {calibrated!r}")
    calibrated._warn_apart(given, subject, stacklevel=3)
    if unit != expected:
        raise ProblemError(f"{subject}: the unit is {unit}; the calibration needs loads in {expected}")
