"""Binary: whether a taxel's value has reached a level."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

_DEFAULT = defaults("binary")


@dataclass(kw_only=True, eq=False, repr=False)
class Binary(Encoder):
    """Give a spike of 1 when a taxel's value reaches the level, and of -1 when it falls below.

    Parameters
    ----------
    level : float, in the sensor's unit, above 0
    period_ms : float, ms, whole us
        How often values are sampled.

    Raises
    ------
    ProblemError : an invalid parameter
    """

    name = "binary"

    level: float = _DEFAULT.level
    period_ms: float = _DEFAULT.period_ms
