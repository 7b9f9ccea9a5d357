"""Curves from readings to N or kPa: a power, a table."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import floats, mapping, number, numbers, shown
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
    """Straight lines through known points, of one taxel for all or of each; the last value holds beyond its point."""

    def __init__(self, readings: Any, values: Any) -> None:
        self.x, self.y = numbers("readings", readings, np.float64), floats("values", values)
        if self.x.ndim not in (1, 3) or not self.y.size or len(self.x) != len(self.y):
            points = len(self.x) if self.x.ndim else 0
            raise ProblemError(
                f"the table has {counted(points, 'reading')} and {counted(len(self.y), 'value')}: must have as "
                f"many readings "
                "as values, 1 or more; the shape of readings is (points,), or (points, rows, columns) if taxels differ"
            )
        for name, column in (("readings", self.x), ("values", self.y)):
            rising = np.isfinite(column) & (np.diff(column, axis=0, prepend=-np.inf) > 0) & (column >= 0)
            wrong = np.argwhere(~rising)
            if len(wrong):
                position = tuple(wrong[0])
                index = "".join(f"[{k}]" for k in position)
                raise ProblemError(
                    f"{name}{index} is {column[position]:g}: the numbers must begin at 0 or more, and rise"
                )
        at_rest = self.x[0] == 0
        if np.any(at_rest != (self.y[0] == 0)):
            first = float(np.ravel(self.x[0])[0])
            raise ProblemError(
                f"the table begins with reading {first:g}, value {self.y[0]:g}: the value must be 0 where the reading "
                "above rest is 0, and only there"
            )
        if not np.any(at_rest):
            self.x, self.y = np.concatenate([0 * self.x[:1], self.x]), np.append(0.0, self.y)

    def values(self, readings: Values, rest: Values) -> Values:
        above = readings - rest
        if self.x.ndim == 1:
            return np.asarray(np.interp(above, self.x, self.y))
        by_taxel = np.broadcast_to(above, np.broadcast_shapes(above.shape, self.x.shape[1:]))
        out = np.empty(by_taxel.shape)
        for row, column in np.ndindex(self.x.shape[1:]):
            out[..., row, column] = np.interp(by_taxel[..., row, column], self.x[:, row, column], self.y)
        return out

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
