"""Rubber in plane stress: an incompressible Yeoh solid, its stress and tangent in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: How the cofactor of a 2 x 2 matrix follows from its entries (11, 12, 21, 22).
_COFACTOR = np.array([[0, 0, 0, 1], [0, 0, -1, 0], [0, -1, 0, 0], [1, 0, 0, 0]], float)


@dataclass(frozen=True)
class Yeoh:
    """Hold the constants of an incompressible Yeoh solid: ``W = c10 x + c20 x^2 + c30 x^3``, ``x = I1 - 3``.

    Parameters
    ----------
    c10_pa : float, Pa, above 0
        A sixth of the small-strain modulus.
    c20_pa, c30_pa : float, Pa
        0: neo-Hookean.

    Notes
    -----
    In plane stress the thickness stretches by 1/J, so ``I1 = F:F + 1/J^2`` and no pressure is unknown.

    Examples
    --------
    >>> DRAGON_SKIN_10.modulus_kpa
    21.6
    """

    c10_pa: float
    c20_pa: float = 0.0
    c30_pa: float = 0.0

    @classmethod
    def of_modulus(cls, modulus_kpa: float) -> Yeoh:
        """Return the neo-Hookean solid of a small-strain modulus, in kPa."""
        return cls(1000 * modulus_kpa / 6)

    @property
    def modulus_kpa(self) -> float:
        """The small-strain Young's modulus, kPa."""
        return 6 * self.c10_pa / 1000

    def slope(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return W', kPa."""
        return np.asarray((self.c10_pa + 2 * self.c20_pa * x + 3 * self.c30_pa * x**2) / 1000)

    def energy(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the energy by volume, kPa, of deformation gradients (11, 12, 21, 22), shape (..., 4)."""
        x = _invariant(f)[0]
        return np.asarray((self.c10_pa * x + self.c20_pa * x**2 + self.c30_pa * x**3) / 1000)

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
