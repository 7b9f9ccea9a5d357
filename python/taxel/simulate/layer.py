"""Foam bonded to the board: its response to waves of pressure, and the pressures that hold a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import finite_numbers, integer, mapping, number, parameters
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel.array import Array

__all__ = ["Layer", "Pressed"]

#: kPa in a MPa.
_KPA = 1000.0


class Pressed(NamedTuple):
    """The pressures of a layer on a body that has sunk into it.

    Attributes
    ----------
    pressure_kpa : float64, shape (rows, columns), kPa
        Pressure on the layer's surface, by taxel; nowhere negative.
    base_kpa : float64, shape (rows, columns), kPa
        Pressure at the layer's base, where the taxels are; beside the body, a bonded base is also pulled a little.
    force_n : float, N
        Force of all pressure on the surface.
    """

    pressure_kpa: NDArray[np.float64]
    base_kpa: NDArray[np.float64]
    force_n: float


class Layer:
    """Solve contact with foam that is bonded to the board: elastic, coupled, and pressed without shear.

    Parameters
    ----------
    foam : mapping, optional
        Parameters that differ from the usual foam: modulus_kpa, thickness_mm, poisson, yield_strain,
        densification_strain, exponent (losses are of motion: see `Scene`).
    array : Array, optional
        The taxels beneath; default: the thesis' array.
    cells_per_pitch : int, 1 to 16
        How many cells of the layer there are along the pitch of taxels: more than one for a touch narrower than two
        taxels.
    tolerance : float, above 0
        A solution ends when no pressure moves by more than this share of the largest.

    Raises
    ------
    SceneError : foam that is invalid; so many cells on so large an array
    ProblemError : an invalid number of cells, or an invalid tolerance

    Notes
    -----
    Carbone and Mangialardi 2008 for the face; the base's share of a wave solves the same four conditions. Contact is
    solved by projected Gauss-Seidel; with more than 600 cells (times `cells_per_pitch`), by conjugate gradients with
    FFT (Polonsky and Keer 1999). A taxel senses the mean stress of its cells. For collapse and densification, the depth
    of a body is replaced by its depth in a linear column under the same pressure (ours). That is exact for a wide
    touch, for columns and for linear foam.

    Examples
    --------
    >>> layer = Layer({"poisson": 0.1})
    >>> y, x = np.mgrid[:64, :64] * 2.67
    >>> ball = 1.0 - ((x - 80) ** 2 + (y - 80) ** 2) / (2 * 30)  # of 30 mm, 1 mm deep
    >>> round(layer.press(ball).force_n, 2)
    0.63

    One of 2 mm, 0.1 mm deep, is narrower than a taxel:

    >>> layer = Layer({"poisson": 0.1}, cells_per_pitch=4)
    >>> y, x = layer.cells_mm
    >>> round(layer.press(0.1 - ((x - 80) ** 2 + (y - 80) ** 2) / (2 * 2)).force_n, 4)
    0.0036
    """

    def __init__(
        self,
        foam: Mapping[str, float] | None = None,
        array: Array | None = None,
        *,
        cells_per_pitch: int = 1,
        tolerance: float = 1e-4,
    ) -> None:
        self.array = Array._of(array)
        self.foam: dict[str, Any] = {} if foam is None else mapping("foam", foam)
        if not 0 < number("tolerance", tolerance) < 1:
            raise refused("tolerance", f" is {tolerance:g}: must be above 0 and below 1")
        self.cells_per_pitch = integer("cells_per_pitch", cells_per_pitch, 1, 16)
        self._core = _core.Layer(
            self.array, parameters(self.foam), self.cells_per_pitch, number("tolerance", tolerance)
        )

    @property
    def cells_mm(self) -> NDArray[np.float64]:
        """Places of the cells: y and x from the first taxel, in the order in which `press` takes depths."""
        y, x = self._core.cells_mm()
        return np.stack(np.meshgrid(y, x, indexing="ij"))

    def compliance(self, waves: ArrayLike) -> NDArray[np.float64]:
        """Return the displacement of the surface by a wave of pressure.

        Parameters
        ----------
        waves : float64, any shape, 1/mm, 0 or more
            Wave numbers.

        Returns
        -------
        float64, one for each wave number, mm/kPa

        Raises
        ------
        ProblemError : an invalid wave number

        Notes
        -----
        Carbone and Mangialardi (2008), J. Mech. Phys. Solids 56:684.

        Examples
        --------
        >>> Layer({"modulus_kpa": 60.0, "thickness_mm": 10.0, "poisson": 0.0}).compliance([0.0]).round(4)
        array([0.1667])
        """
        return np.asarray(self._core.waves(_waves(waves))[0]) / _KPA

    def base_share(self, waves: ArrayLike) -> NDArray[np.float64]:
        """Return the share of a wave of pressure that arrives at the base.

        Parameters
        ----------
        waves : float64, any shape, 1/mm, 0 or more
            Wave numbers.

        Returns
        -------
        float64, one for each wave number, 0 to 1

        Raises
        ------
        ProblemError : an invalid wave number

        Examples
        --------
        >>> Layer().base_share([0.0])
        array([1.])
        """
        return np.asarray(self._core.waves(_waves(waves))[1])

    def press(self, sunk_mm: ArrayLike) -> Pressed:
        """Return the pressures that hold a body which has sunk so far below the unloaded surface.

        The solution begins at pressures that are extrapolated from the latest two calls.

        Parameters
        ----------
        sunk_mm : float64, mm, shape (rows, columns), each times `cells_per_pitch`
            Depth at each cell; below 0 where the body is still above the surface.

        Returns
        -------
        Pressed

        Raises
        ------
        ProblemError : another shape, or a depth that is not finite

        Examples
        --------
        >>> Layer().press(np.zeros((64, 64))).force_n
        0.0
        """
        sunk = finite_numbers("sunk_mm", sunk_mm)
        cells = (self.array.rows * self.cells_per_pitch, self.array.columns * self.cells_per_pitch)
        if sunk.shape != cells:
            raise refused("sunk_mm", f" has shape {sunk.shape}: must be {cells}")
        pressure, base = self._core.press(sunk.reshape(-1))
        above = _KPA * pressure.reshape(self.array.shape)
        # MPa mm^2 is N.
        force = float(pressure.sum()) * self.array.row_mm * self.array.column_mm
        return Pressed(above, _KPA * base.reshape(self.array.shape).astype(np.float64), force)

    def forget(self) -> None:
        """Begin the next touch without the pressures of the last two."""
        self._core.forget()

    def __repr__(self) -> str:
        return escaped(f"Layer({self.foam}, {self.array!r})")


def _waves(waves: ArrayLike) -> NDArray[np.float64]:
    checked = finite_numbers("waves", waves).reshape(-1)
    if not np.all(checked >= 0):
        raise refused("waves", ": must be 0 or more")
    return checked
