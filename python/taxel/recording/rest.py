"""The rest of a recording's taxels: what they read while nothing touches them, and where that is known from."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.frames import Frames

__all__ = ["FORCE_UNITS", "Picture", "Rest", "found", "loaded_above", "ticks_by_unit", "tracked"]

#: Units of force and pressure: an unloaded taxel reads 0 in them.
FORCE_UNITS = ("N", "mN", "kPa", "Pa", "N/cm2")
#: Reading: the noise floor of the board's fast presets, ticks ...
NOISE_FLOOR = 3.0
#: ... in another unit, the range of a recording's values counts as so many ticks.
RANGE_TICKS = 150.0

#: Reading: what a taxel reads in a quiet stretch is not its rest, but a load that stood still, if in more than this
#: share of all pictures it reads less by so many ticks.
LOADED_SHARE, LOADED_TICKS = 0.1, 8.0

#: Pictures in order: their times, us, and their values by taxel, NaN where a taxel has none.
Picture = tuple[NDArray[np.int64], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Rest:
    """Hold what taxels read at rest, and where it is known from.

    Parameters
    ----------
    source : {"tare", "calibration", "unit", "quiet", "none"}
        A given tare; the calibration's own rest; 0, as the values are force or pressure; a quiet stretch; nothing.
    values : float64, one a taxel, in the sensor's unit
        NaN for a taxel whose rest is not known. That of a quiet stretch is where the rest is tracked from.
    quiet_us : (int, int), us, optional
        The quiet stretch.
    zeroed : int
        Number of taxels that were zeroed while recording: from then on their rest is what was given.
    """

    source: str
    values: NDArray[np.float64]
    quiet_us: tuple[int, int] | None = None
    zeroed: int = 0

    def __str__(self) -> str:
        """Return the line of ``taxel info``."""
        words = {
            "tare": "the given tare",
            "calibration": "the calibration's",
            "unit": "0, as the values are force or pressure",
            "none": "not known, as no half second was quiet with nothing on it; give --tare",
        }
        text = words.get(self.source, "")
        if self.quiet_us is not None:
            first, end = (us / 1e6 for us in self.quiet_us)
            text = f"a quiet stretch, {first:.3f} to {end:.3f} s, tracked from there"
        return text + f"; {self.zeroed} zeroed" * bool(self.zeroed)

    def described(self) -> dict[str, object]:
        """Return source, quiet stretch and number of zeroed taxels as JSON values."""
        return {"source": self.source, "quiet_us": self.quiet_us, "zeroed": self.zeroed}


def loaded_above(scale: float) -> float:
    """Return from how much above rest a taxel counts as loaded, in the sensor's unit."""
    return float(_core.touched_above(NOISE_FLOOR)) / scale


def ticks_by_unit(frames: Frames) -> float:
    """Return the ticks by the unit of pictures: the range of their values counts as that of a board's ramp."""
    if frames.unit == "ticks":
        return 1.0
    values = frames.values[np.isfinite(frames.values)] if len(frames) else frames.values
    span = float(np.ptp(values)) if values.size else 0.0
    return RANGE_TICKS / span if span else 1.0


def found(pictures: Callable[[], Iterable[Picture]], taxels: int, columns: int, scale: float = 1.0) -> Rest:
    """Return the rest that a quiet stretch of pictures shows (`_core.TrackedRest`), or none.

    Parameters
    ----------
    pictures : function
        Returns the pictures in order, each time it is called.
    taxels, columns : int
    scale : float
        Ticks by the sensor's unit.
    """
    rest = _core.TrackedRest(columns, NOISE_FLOOR, np.full(taxels, np.nan))
    for t, values in pictures():
        rest.above(t, np.ascontiguousarray(values * np.float32(scale)).reshape(-1))
    unknown = np.full(taxels, np.nan)
    if rest.quiet is None:
        return Rest("none", unknown)
    begins, below, known = rest.begins / scale, np.zeros(taxels, np.int64), np.zeros(taxels, np.int64)
    for _, values in pictures():
        below += np.count_nonzero(values < begins - LOADED_TICKS / scale, axis=0)
        known += np.count_nonzero(~np.isnan(values), axis=0)
    begins[below > LOADED_SHARE * known] = np.nan
    return Rest("none", unknown) if np.isnan(begins).all() else Rest("quiet", begins, rest.quiet)


def tracked(rest: Rest, pictures: Iterable[Picture], columns: int, scale: float = 1.0) -> Iterable[Picture]:
    """Yield pictures above a rest that is tracked, from a quiet stretch or from the first values; 0 below it."""
    at = _core.TrackedRest(columns, NOISE_FLOOR, rest.values * scale)
    for t, values in pictures:
        above = at.above(t, np.ascontiguousarray(values * np.float32(scale)).reshape(-1))
        yield t, above.reshape(values.shape) / np.float32(scale)
