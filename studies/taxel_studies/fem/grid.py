"""The sub-sampling grid of figure 5.3: a sensor array's samples in time and place, laid over a course at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator

from taxel import ProblemError
from taxel_studies.fem.indentation import Course

#: Samples that are computed at a time.
_AT_ONCE = 100
#: How far beyond the grid's ends the base's nodes still matter to the spline, mm.
_BEYOND_MM = 1.0


@dataclass(frozen=True, kw_only=True)
class SamplingGrid:
    """Describe how a row of taxels under the silicone samples a contact (thesis 5.4.1). What it leaves open: (o).

    Parameters
    ----------
    taxels : int, 1 or more
    pitch_mm : float, mm, above 0
    duration_ms : float, ms, above 0
        From the first touch to full depth, at constant speed: the same for every depth.
    shift_mm : float, mm, 0 or more
        The grid is moved by up to half of this to either side, at random (o: a pitch).

    Examples
    --------
    >>> SamplingGrid().steps(0.5)
    200
    """

    taxels: int = 25
    pitch_mm: float = 0.2
    duration_ms: float = 100.0
    shift_mm: float = 0.2

    def steps(self, period_ms: float) -> int:
        """Return how many samples a period gives.

        Raises
        ------
        ProblemError : a period of which the duration is no whole number
        """
        count = round(self.duration_ms / period_ms) if period_ms > 0 else 0
        if count < 1 or abs(count * period_ms - self.duration_ms) > 1e-9 * self.duration_ms:
            raise ProblemError(f"period_ms is {period_ms:g}: must go whole times into {self.duration_ms:g} ms")
        return count

    def places_mm(self) -> NDArray[np.float64]:
        """Return where the taxels lie when the grid is not moved, float64, shape (taxels,)."""
        return np.asarray((np.arange(self.taxels) - (self.taxels - 1) / 2) * self.pitch_mm)

    def most_kpa(self, course: Course) -> float:
        """Return the largest pressure that a taxel can see on a course."""
        reach = self.places_mm()[-1] + self.shift_mm / 2
        return float(course.pressure_kpa[:, np.abs(course.x_mm) <= reach].max())

    def draw(
        self, course: Course, depth_mm: float, period_ms: float, samples: int, seed: int = 0
    ) -> NDArray[np.float32]:
        """Draw samples of a contact: each at another place and phase of the sampling.

        Parameters
        ----------
        course : Course
        depth_mm : float, mm
            Reached after `duration_ms`.
        period_ms : float, ms
        samples, seed : int

        Returns
        -------
        float32, shape (samples, steps + 1, taxels), kPa
            The first row is the rest before the touch, one period before the first sample. Beside a contact pressure
            may fall below 0.

        Notes
        -----
        Along the path by a monotone cubic, across by a cubic spline (the thesis has MATLAB's spline).
        """
        count = self.steps(period_ms)
        reached = float(course.path_mm[-1])
        random = np.random.default_rng(seed)
        phase = random.uniform(0, period_ms, samples)
        shift = random.uniform(-self.shift_mm / 2, self.shift_mm / 2, samples)
        places = self.places_mm()
        near = np.abs(course.x_mm) <= places[-1] + self.shift_mm / 2 + _BEYOND_MM
        along = PchipInterpolator(course.path_mm, course.pressure_kpa[:, near])
        across = CubicSpline(course.x_mm[near], np.eye(int(near.sum())))
        drawn = np.zeros((samples, count + 1, self.taxels), np.float32)
        for first in range(0, samples, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            t = phase[part, None] + np.arange(count) * period_ms
            path = np.minimum(t * (depth_mm / self.duration_ms), reached)
            drawn[part, 1:] = along(path) @ across(places + shift[part, None]).transpose(0, 2, 1)
        return drawn
