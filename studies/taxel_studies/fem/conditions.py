"""The conditions of Table 5.1: what is varied, and the paths that serve them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from taxel_studies.fem.indentation import Indentation


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


#: Table 5.1: the values of each variable.
TABLE_5_1: dict[str, list[float]] = {
    "diameters_mm": [2.0, 2.5, 3.0, 3.5, 4.0],
    "moduli_kpa": [50.0, 150.0, 250.0],
    "depths_mm": [0.5, 1.0, 1.5, 2.0],
    "angles_deg": [0.0, 5.0, 10.0, 15.0, 20.0],
}


def conditions(table: Mapping[str, Any]) -> list[Condition]:
    """List all combinations of a table: diameter by diameter, then by modulus, depth and angle.

    Examples
    --------
    >>> len(conditions(TABLE_5_1)), len(paths(conditions(TABLE_5_1)))
    (300, 75)
    """
    return [Condition(*one) for one in product(*(table[name] for name in TABLE_5_1))]


def paths(conditions: Iterable[Condition], **settings: Any) -> list[Indentation]:
    """List the indentations that serve conditions: depths that lie on one path share one, to the deepest.

    Parameters
    ----------
    conditions : iterable of Condition
    **settings
        Of `Indentation`: what the conditions leave open (``mesh_mm=0.05``).
    """
    deepest: dict[tuple[float, float, float], float] = {}
    for c in conditions:
        path = (c.diameter_mm, c.modulus_kpa, c.angle_deg)
        deepest[path] = max(deepest.get(path, 0.0), c.depth_mm)
    return [
        Indentation(diameter_mm=d, modulus_kpa=e, angle_deg=a, depth_mm=depth, **settings)
        for (d, e, a), depth in deepest.items()
    ]
