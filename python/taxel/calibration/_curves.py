"""Curves from readings to N or kPa: a power, a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import floats, mapping, number, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError

#: The force of a uniform pressure of 1 kPa on 1 mm2, N.
N_PER_KPA_MM2 = 1e-3

Values = NDArray[np.float64]


class Curve(Protocol):
    """Conversion of readings to values by a taxel of gain 1; both rise."""

    def values(self, readings: Values, rest: Values) -> Values:
        """Return the values of readings, each with its rest."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Return the curve as plain values, as files hold it."""
        ...

    def bent(self, exponent: float) -> Curve:
        """Return the same with another exponent of the value by what is read."""
        ...


class Power:
    """A power of the reading above rest; the gain is the value where that reading is 1."""

    def __init__(self, exponent: object) -> None:
        self.exponent = above_0("exponent", exponent)

    def values(self, readings: Values, rest: Values) -> Values:
        return np.asarray(np.maximum(readings - rest, 0.0) ** self.exponent)

    def to_dict(self) -> dict[str, Any]:
        return {"power": {"exponent": self.exponent}}

    def bent(self, exponent: float) -> Power:
        return Power(exponent)


class PointCurve:
    """Straight lines through known points; the last value holds beyond its point."""

    def __init__(self, readings: Any, values: Any) -> None:
        self.x, self.y = floats("readings", readings), floats("values", values)
        if not self.y.size or len(self.x) != len(self.y):
            raise ProblemError(
                f"the table has {counted(len(self.x), 'reading')} and {counted(len(self.y), 'value')}: must have as "
                "many readings as values, 1 or more"
            )
        for name, column in (("readings", self.x), ("values", self.y)):
            rising = np.isfinite(column) & (np.diff(column, prepend=-np.inf) > 0) & (column >= 0)
            if not rising.all():
                k = int(np.argmin(rising))
                raise ProblemError(f"{name}[{k}] is {column[k]:g}: the numbers must begin at 0 or more, and rise")
        if (self.x[0] == 0) != (self.y[0] == 0):
            raise ProblemError(
                f"the table begins with reading {self.x[0]:g}, value {self.y[0]:g}: the value must be 0 where the "
                "reading above rest is 0, and only there"
            )
        if self.x[0]:
            self.x, self.y = np.append(0.0, self.x), np.append(0.0, self.y)

    def values(self, readings: Values, rest: Values) -> Values:
        return np.asarray(np.interp(readings - rest, self.x, self.y))

    def to_dict(self) -> dict[str, Any]:
        return {"table": {"readings": self.x.tolist(), "values": self.y.tolist()}}

    def bent(self, exponent: float) -> PointCurve:  # noqa: ARG002  what a curve with an exponent takes
        raise refused("exponent", ": a table has no exponent; only the gain of a table is fitted")


def curve_of(document: Mapping[str, Any]) -> Curve:
    """Return the curve that a file describes."""
    kinds: dict[str, Any] = {"power": Power, "table": PointCurve}
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
