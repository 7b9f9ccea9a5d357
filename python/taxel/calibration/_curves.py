"""Curves from readings above rest to N or kPa: a power, or straight lines through known points."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import floats, mapping, number, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError

#: The force of a uniform pressure of 1 kPa on 1 mm2, N.
N_PER_KPA_MM2 = 1e-3

Values = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """Conversion of readings above rest to values by a taxel of gain 1; both rise.

    A power, whose gain is the value where the reading is 1; or, if there are points, straight lines through them, with
    the last value beyond.
    """

    exponent: float = 1.0
    points: tuple[Values, Values] | None = None

    def values(self, above: Values) -> Values:
        """Return the values of readings above rest."""
        if self.points is not None:
            return np.asarray(np.interp(above, *self.points))
        return np.asarray(np.maximum(above, 0.0) ** self.exponent)

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return the curve as plain values, as files hold it."""
        if self.points is None:
            return {"power": {"exponent": self.exponent}}
        return {"table": {name: of.tolist() for name, of in zip(("readings", "values"), self.points, strict=True)}}


def power(exponent: object) -> Curve:
    """Return a power of the reading."""
    return Curve(above_0("exponent", exponent))


def table(readings: Any, values: Any) -> Curve:
    """Return straight lines through points that rise, from 0 on."""
    x, y = floats("readings", readings), floats("values", values)
    if not y.size or len(x) != len(y):
        raise ProblemError(
            f"the table has {counted(len(x), 'reading')} and {counted(len(y), 'value')}: must have as many readings as "
            "values, 1 or more"
        )
    for name, column in (("readings", x), ("values", y)):
        rising = np.isfinite(column) & (np.diff(column, prepend=-np.inf) > 0) & (column >= 0)
        if not rising.all():
            k = int(np.argmin(rising))
            raise ProblemError(f"{name}[{k}] is {column[k]:g}: the numbers must begin at 0 or more, and rise")
    if (x[0] == 0) != (y[0] == 0):
        raise ProblemError(
            f"the table begins with reading {x[0]:g}, value {y[0]:g}: the value must be 0 where the reading above rest "
            "is 0, and only there"
        )
    return Curve(points=(np.append(0.0, x), np.append(0.0, y)) if x[0] else (x, y))


def curve_of(document: Mapping[str, Any]) -> Curve:
    """Return the curve that a file describes."""
    kinds: dict[str, Any] = {"power": power, "table": table}
    if len(document) != 1 or next(iter(document)) not in kinds:
        raise ProblemError(f"{shown(dict(document))}: must be one of {', '.join(kinds)}")
    ((kind, values),) = document.items()
    try:
        curve: Curve = kinds[kind](**mapping(kind, values))
    except TypeError as error:
        raise ProblemError(f"{kind}: {error}") from None
    return curve


def above_0(name: str, value: object) -> float:
    checked = number(name, value)
    if not 0 < checked < math.inf:
        raise refused(name, f" is {shown(value)}: must be above 0 and finite")
    return checked
