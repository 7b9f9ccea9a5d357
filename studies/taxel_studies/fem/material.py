"""Rubber in plane stress: an incompressible Yeoh solid, its stress and tangent in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel import ProblemError

#: How the cofactor of a 2 x 2 matrix follows from its entries (11, 12, 21, 22).
_COFACTOR = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], float)
#: Largest stretch at which stability is looked at.
_FARTHEST = 20.0


@dataclass(frozen=True)
class Yeoh:
    """Hold the constants of an incompressible Yeoh solid: ``W = c10 x + c20 x^2 + c30 x^3``, ``x = I1 - 3``.

    Parameters
    ----------
    c10_pa : float, Pa, above 0
        A sixth of the small-strain modulus.
    c20_pa, c30_pa : float, Pa
        0: neo-Hookean.

    Raises
    ------
    ProblemError : a law that is not stable at rest

    Notes
    -----
    In plane stress the thickness stretches by 1/J, so ``I1 = F:F + 1/J^2`` and no pressure is unknown.

    Examples
    --------
    >>> DRAGON_SKIN_10.modulus_kpa
    21.6
    >>> round(DRAGON_SKIN_10.limit)
    205
    """

    c10_pa: float
    c20_pa: float = 0.0
    c30_pa: float = 0.0

    def __post_init__(self) -> None:
        for name in ("c10_pa", "c20_pa", "c30_pa"):
            object.__setattr__(self, name, float(getattr(self, name)))
        if not np.isfinite([self.c10_pa, self.c20_pa, self.c30_pa]).all():
            raise ProblemError(
                f"c10, c20 and c30 are {self.c10_pa:g}, {self.c20_pa:g} and {self.c30_pa:g} Pa: must be finite"
            )
        if self.c10_pa <= 0:
            raise ProblemError(f"c10_pa is {self.c10_pa:g}: must be above 0, or the solid is not stable at rest")

    @classmethod
    def of_modulus(cls, modulus_kpa: float) -> Yeoh:
        """Return the neo-Hookean solid of a small-strain modulus, in kPa."""
        return cls(1000 * modulus_kpa / 6)

    @property
    def modulus_kpa(self) -> float:
        """The small-strain Young's modulus, kPa."""
        return 6 * self.c10_pa / 1000

    @property
    def limit(self) -> float:
        """The I1 - 3 at which the law loses stability: the nominal stress peaks in one of the three simple tests."""
        stretch = np.geomspace(1.0001, _FARTHEST, 20_000)
        least = np.inf
        for first, power in ((stretch**2 + 2 / stretch, 2), (stretch**2 + 1 + stretch**-2, 3)):
            least = min(least, self._peak(first - 3, stretch - stretch**-power))
        return float(min(least, self._peak(2 * stretch**2 + stretch**-4 - 3, stretch - stretch**-5)))

    def _peak(self, x: NDArray[np.float64], shape: NDArray[np.float64]) -> float:
        falls = np.flatnonzero(np.diff(self.slope(x) * shape) <= 0)
        return float(x[falls[0]]) if len(falls) else np.inf

    def slope(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return W', kPa."""
        return np.asarray((self.c10_pa + 2 * self.c20_pa * x + 3 * self.c30_pa * x**2) / 1000)

    def energy(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the energy by volume, kPa, of deformation gradients (11, 12, 21, 22), shape (..., 4)."""
        x = _invariant(f)[0]
        return np.asarray((self.c10_pa * x + self.c20_pa * x**2 + self.c30_pa * x**3) / 1000)

    def stretched(self, f: NDArray[np.float64]) -> float:
        """Return the largest I1 - 3 of deformation gradients."""
        return float(_invariant(f)[0].max())

    def stress(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the first Piola-Kirchhoff stress, kPa, shape (..., 4), by unit of the thickness at rest."""
        x, j, cofactor = _invariant(f)
        return np.asarray(self.slope(x)[..., None] * (2 * f - 2 * (j**-3)[..., None] * cofactor))

    def tangent(self, f: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return stress and its derivative by the gradient, shape (..., 4, 4)."""
        x, j, cofactor = _invariant(f)
        direction = 2 * f - 2 * (j**-3)[..., None] * cofactor
        slope = self.slope(x)
        curve = (2 * self.c20_pa + 6 * self.c30_pa * x) / 1000
        derivative = (6 * slope * j**-4)[..., None, None] * (cofactor[..., :, None] * cofactor[..., None, :])
        if self.c20_pa or self.c30_pa:
            derivative += curve[..., None, None] * (direction[..., :, None] * direction[..., None, :])
        derivative -= (2 * slope * j**-3)[..., None, None] * _COFACTOR
        derivative += (2 * slope)[..., None, None] * np.eye(4)
        return slope[..., None] * direction, derivative


def _invariant(f: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return I1 - 3, J, and the cofactor."""
    cofactor = f @ _COFACTOR
    j = f[..., 0] * f[..., 3] - f[..., 1] * f[..., 2]
    return (f * f).sum(-1) + j**-2 - 3, j, cofactor


#: Table 5.2. Its small-strain modulus is 21.6 kPa, about a tenth of what the maker's modulus at 100 % suggests.
DRAGON_SKIN_10 = Yeoh(3600.0, 25.8, -0.056)
