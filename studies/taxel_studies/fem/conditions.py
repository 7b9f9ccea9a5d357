"""The conditions of Table 5.1: what is varied, and the paths that serve them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import Any

from taxel_studies.fem.indentation import Indentation

__all__ = ["TABLE_5_1", "Condition", "Table", "paths"]


@dataclass(frozen=True)
class Condition:
    """Name one contact: an object, how far it is pressed, and along which path.

    Attributes
    ----------
    diameter_mm, modulus_kpa, depth_mm, angle_deg : float
    """

    diameter_mm: float
    modulus_kpa: float
    depth_mm: float
    angle_deg: float


@dataclass(frozen=True)
class Table:
    """Hold the values of each variable; the conditions are all their combinations.

    Parameters
    ----------
    diameters_mm, moduli_kpa, depths_mm, angles_deg : sequence of float

    Examples
    --------
    >>> len(TABLE_5_1.conditions()), len(paths(TABLE_5_1.conditions()))
    (300, 75)
    """

    diameters_mm: tuple[float, ...]
    moduli_kpa: tuple[float, ...]
    depths_mm: tuple[float, ...]
    angles_deg: tuple[float, ...]

    def conditions(self) -> list[Condition]:
        """List the conditions: diameter by diameter, then by modulus, depth and angle."""
        return [Condition(*one) for one in product(self.diameters_mm, self.moduli_kpa, self.depths_mm, self.angles_deg)]


#: Table 5.1.
TABLE_5_1 = Table((2.0, 2.5, 3.0, 3.5, 4.0), (50.0, 150.0, 250.0), (0.5, 1.0, 1.5, 2.0), (0.0, 5.0, 10.0, 15.0, 20.0))


def paths(conditions: Iterable[Condition], **settings: Any) -> list[Indentation]:
    """List the indentations that serve conditions: depths that lie on one path share one, to the deepest.

    Parameters
    ----------
    conditions : iterable of Condition
    **settings
        Of `Indentation`: what the conditions leave open (``mesh_mm=0.05``).

    Raises
    ------
    ProblemError : a parameter that is invalid
    """
    deepest: dict[tuple[float, float, float], float] = {}
    for c in conditions:
        path = (c.diameter_mm, c.modulus_kpa, c.angle_deg)
        deepest[path] = max(deepest.get(path, 0.0), c.depth_mm)
    return [
        Indentation(diameter_mm=d, modulus_kpa=e, angle_deg=a, depth_mm=depth, **settings)
        for (d, e, a), depth in deepest.items()
    ]
