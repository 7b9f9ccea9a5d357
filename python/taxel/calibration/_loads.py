"""Known loads on an array, and the gains and the exponent that they determine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


class CalibratedArray(NamedTuple):
    """Sensor to calibrate: its array, the units of its readings and of the result, its rest, and the floor above it."""

    array: Array
    reading_unit: str
    unit: str
    rest: Values
    floor: float


class LoadEquations(NamedTuple):
    """The equations of a load: its taxels, their weights and the value; from mean readings above the floor."""

    load: float
    weight: float | Values
    readings: Values
    rest: Values
    chosen: NDArray[np.bool_]
    alone: bool
    """Whether each chosen taxel has to make the load by itself."""

    @classmethod
    def from_load(cls, load: Load, number_of: int, sensor: CalibratedArray) -> LoadEquations:
        frames, location = instance("frames", load.frames, Frames), f"load {number_of}"
        same(sensor.array, frames.array, f"the frames of {location}", frames.unit, sensor.reading_unit)
        value, unit = above_0(location, load.load), checked_text("unit", load.unit, UNITS)
        if not len(frames):
            raise ProblemError(f"{location}: no frame was recorded while the load was on the array")
        rest = sensor.rest
        readings = frames.values.mean(axis=0, dtype=np.float64)
        chosen = sensor.array._there() & ~np.isnan(rest)
        if load.taxel is not None:
            only = several(f"{location}, taxel", load.taxel)
            if len(only) != 2:
                raise ProblemError(f"{location}, taxel is {shown(load.taxel)}: must be a column and a row")
            x, y = (integer(f"{location}, taxel", n, 0) for n in only)
            index = int(sensor.array.index(x, y))
            chosen &= np.arange(chosen.size).reshape(chosen.shape) == index
        rest = np.nan_to_num(rest)
        loaded = chosen & (readings > rest + sensor.floor)
        if not loaded.any():
            raise ProblemError(
                f"{location}: no taxel reads more than {sensor.floor:g} {sensor.reading_unit} above its rest"
            )
        weight: float | Values = 1.0
        if unit != sensor.unit:
            areas = sensor.array.area_mm2
            if areas is None:
                raise ProblemError(
                    f"{location}: the unit is {unit}, but that of the calibration is {sensor.unit}; to convert, "
                    f"taxel needs "
                    f"the area of each taxel, which is unknown for {sensor.array!r}"
                )
            weight = 1 / (areas * N_PER_KPA_MM2) if unit == "kPa" else areas * N_PER_KPA_MM2
        alone = unit == "kPa" or load.taxel is not None
        # Uniform pressure is on every taxel: one that reads nothing is broken, and no measure of the others.
        return cls(value, weight, readings, rest, loaded, alone)

    def by_taxel(self, curve: Curve, gain: float | Values = 1.0) -> Values:
        """Return the value of each chosen taxel, in the load's own unit; 0 elsewhere."""
        values = self.weight * gain * curve.values(self.readings, self.rest)
        return np.where(self.chosen, values, 0.0)

    def total(self, curve: Curve, gain: float | Values = 1.0) -> float:
        """Return the value of all chosen taxels: the sum of forces, the mean of pressures."""
        readings = self.by_taxel(curve, gain)[self.chosen]
        return float(readings.mean() if self.alone else readings.sum())

    def errors(self, curve: Curve, gain: Values) -> Values:
        """Return the error of each equation, as a share of the load."""
        if self.alone:
            return np.asarray(self.by_taxel(curve, gain)[self.chosen] / self.load - 1.0)
        return np.array([self.total(curve, gain) / self.load - 1.0])


def _least(totals: Sequence[float], loads: Sequence[float]) -> tuple[float, float]:
    """Return the gain with the least squares of relative error, and their mean."""
    share = np.array(totals) / np.array(loads)
    gain = float(share.sum() / (share**2).sum()) if (share > 0).any() else 1.0
    return gain, float(np.mean((gain * share - 1.0) ** 2))


def best_exponent(curve: Curve, equations: Sequence[LoadEquations]) -> float:
    """Return the exponent whose best gain has the least squares of relative error."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  loads slowly

    loads = [load.load for load in equations]

    def missed(log: float) -> float:
        bent = curve.bent(math.exp(log))
        return _least([load.total(bent) for load in equations], loads)[1]

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
            f"loads: the exponent {best[1]:.3g} is used, but {also} would fit the loads as well; to be sure, "
            f"add a load "
            "or give the exponent",
            stacklevel=3,
        )
    return best[1]


def gains(array: Array, curve: Curve, equations: Sequence[LoadEquations], each: bool) -> tuple[Values, float]:
    """Return the gain of each taxel, and the common one."""
    common, _ = _least([load.total(curve) for load in equations], [load.load for load in equations])
    by_taxel = np.full(array.shape, common)
    if not each:
        return by_taxel, common
    if not any(load.alone for load in equations):
        raise refused(
            "each", ": no load determines a single taxel; give a load of uniform pressure (kPa), or the taxel of a load"
        )
    share = np.array([load.by_taxel(curve) / load.load for load in equations if load.alone])
    squares = (share**2).sum(axis=0)
    np.divide(share.sum(axis=0), squares, out=by_taxel, where=squares > 0)
    return by_taxel, common


def same(calibrated: Array, given: Array, subject: str, unit: str | None = None, expected: str | None = None) -> None:
    """Refuse what has other taxels, or another unit; warn of another pitch."""
    if not calibrated.fits(given):
        raise ProblemError(f"{subject}: the array is {given!r}; that of the calibration is {calibrated!r}")
    calibrated._warn_apart(given, subject, stacklevel=3)
    if unit != expected:
        raise ProblemError(f"{subject}: the unit is {unit}; the calibration needs loads in {expected}")
