"""Flaws of taxels and faults of a network, for an emulated board."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from taxel._base.arguments import finite, integer, mapping, shown
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel._core import ProblemError

__all__ = ["Faults", "Flaws"]


@dataclass(frozen=True)
class Flaws:
    """Set the flaws of taxels; each is 0 where it is left out, and is drawn from a separate seed.

    Parameters
    ----------
    gain : float, 0 or more
        Standard deviation of the logarithm of the taxels' gains.
    threshold : float, ticks, 0 or more
        Standard deviation of the taxels' thresholds: the number of ticks by which a taxel reads too little.
    hysteresis : float, ticks, 0 or more
        Lag of a reading when the value rises or falls; for each taxel between half and three halves of this number.
    drift : float, ticks a minute, 0 or more
        Standard deviation over taxels of a steady drift of their readings.
    dead, stuck : float, share of taxels, from 0 to 1
        Taxels that always read 0, or one value that is drawn for each.
    loose : int, lines, 0 or more
        Number of lines with a loose contact: all taxels of such a line read 0 about once a second, for 50 ms on
        average.
    noise : float, ticks, 0 or more
        Standard deviation of one reading.
    seeds : mapping of names to int, 0 or more, optional
        Seeds of flaws; a flaw that is not named has the seed 0.

    Raises
    ------
    ProblemError : a size outside its range, a seed for no flaw, or a seed that is not a whole number

    Examples
    --------
    >>> Flaws(gain=0.1, dead=0.01, seeds={"dead": 7})
    Flaws(gain=0.1, dead=0.01, seeds={'dead': 7})
    """

    gain: float = 0.0
    threshold: float = 0.0
    hysteresis: float = 0.0
    drift: float = 0.0
    dead: float = 0.0
    stuck: float = 0.0
    loose: int = 0
    noise: float = 0.0
    seeds: Mapping[str, int] | None = None

    def __post_init__(self) -> None:
        for name in self._names():
            if name == "loose":
                integer(name, self.loose, 0)
            else:
                finite(name, getattr(self, name), least=0.0, most=1.0 if name in ("dead", "stuck") else math.inf)
        for name, seed in mapping("seeds", {} if self.seeds is None else self.seeds).items():
            if name not in self._names():
                raise refused("seeds", f": {shown(name)} is not known: must be one of {', '.join(self._names())}")
            integer(f"seeds[{name}]", seed, 0, 2**63 - 1)

    @classmethod
    def _names(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "seeds"]

    def _parts(self) -> dict[str, Any]:
        seeds = self.seeds or {}
        return {name: {"size": float(getattr(self, name)), "seed": seeds.get(name, 0)} for name in self._names()}

    def __repr__(self) -> str:
        settings = [f"{name}={getattr(self, name)}" for name in self._names() if getattr(self, name)]
        settings += [f"seeds={dict(self.seeds)}"] if self.seeds else []
        return escaped(f"Flaws({', '.join(settings)})")


@dataclass(frozen=True)
class Faults:
    """Set the share of datagrams to which each fault of a network happens; one datagram has one fault at most.

    Parameters
    ----------
    lost, repeated, reordered, cut, corrupted : float, share of datagrams, from 0 to 1, together at most 1
        Shares of datagrams that never arrive; that arrive twice; that arrive after 1 to 8 later datagrams; that arrive
        without their end; that arrive with 1 to 8 flipped bits.
    seed : int, 0 or more

    Raises
    ------
    ProblemError : a share outside 0 to 1, shares that are more than 1 together, or a seed that is not a whole number

    Examples
    --------
    >>> Faults(lost=0.1, seed=1).lost
    0.1
    """

    lost: float = 0.0
    repeated: float = 0.0
    reordered: float = 0.0
    cut: float = 0.0
    corrupted: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        shares = [finite(name, getattr(self, name), least=0.0, most=1.0) for name in self._names()]
        if sum(shares) > 1:
            raise ProblemError(f"{', '.join(self._names())} are {sum(shares):g} together: must be at most 1")
        integer("seed", self.seed, 0, 2**63 - 1)

    @classmethod
    def _names(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "seed"]

    def _parts(self) -> dict[str, Any]:
        return asdict(self)
