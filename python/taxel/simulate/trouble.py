"""What can be wrong on the way from touch to host: taxels with flaws, a network with faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from taxel._base.arguments import mapping, number, shown, whole
from taxel._core import ProblemError

__all__ = ["Faults", "Flaws"]


@dataclass(frozen=True)
class Flaws:
    """Say what is wrong with taxels; each flaw is 0 at first, and is drawn from a seed of its own.

    Parameters
    ----------
    gain : float
        How far gains differ: standard deviation of their logarithm.
    threshold : float, ticks
        How far thresholds differ: a taxel reads so many ticks too few (standard deviation, without sign).
    hysteresis : float, ticks
        How far a reading stays behind its way up and down; of each taxel half to three halves of it.
    drift : float, ticks a minute
        How fast readings wander: standard deviation over taxels of a steady drift.
    dead, stuck : float, share of taxels
        That read 0, or one value drawn for each, for ever.
    loose : int, lines
        With a loose contact: all of a line reads 0 now and then, for 50 ms on average, once a second.
    noise : float, ticks
        Standard deviation of one reading.
    seeds : mapping of names to int, optional
        The seed of a flaw; each of the others has 0.

    Raises
    ------
    ProblemError : a seed for no flaw, or no number

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
            number(name, getattr(self, name))
        for name, seed in mapping("seeds", {} if self.seeds is None else self.seeds).items():
            if name not in self._names():
                raise ProblemError(f"seeds: {shown(name)} is no flaw: there are {', '.join(self._names())}")
            whole(f"seeds[{name}]", seed, 0, 2**63 - 1)

    @classmethod
    def _names(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "seeds"]

    def _parts(self) -> dict[str, Any]:
        seeds = self.seeds or {}
        return {name: {"size": float(getattr(self, name)), "seed": seeds.get(name, 0)} for name in self._names()}

    def __repr__(self) -> str:
        said = [f"{name}={getattr(self, name)}" for name in self._names() if getattr(self, name)]
        said += [f"seeds={dict(self.seeds)}"] if self.seeds else []
        return f"Flaws({', '.join(said)})"


@dataclass(frozen=True)
class Faults:
    """Say what a network does to datagrams: which share each fault befalls; one datagram suffers one at most.

    Parameters
    ----------
    lost, repeated, reordered, cut, corrupted : float, 0 to 1
        Never arrive; arrive twice; are overtaken by 1 to 8 others; arrive without their end; with 1 to 8 flipped bits.
    seed : int

    Raises
    ------
    ProblemError : shares that are none (when they are used)
    """

    lost: float = 0.0
    repeated: float = 0.0
    reordered: float = 0.0
    cut: float = 0.0
    corrupted: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in self._names():
            number(name, getattr(self, name))
        whole("seed", self.seed, 0, 2**63 - 1)

    @classmethod
    def _names(cls) -> list[str]:
        return [field.name for field in fields(cls) if field.name != "seed"]

    def _parts(self) -> dict[str, Any]:
        return asdict(self)
