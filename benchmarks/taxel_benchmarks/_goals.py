"""Goals of benchmarks: figures of a result that must be at least, or at most, as large as a limit.

Each benchmark has a function `goals`, which judges a result, a saved one too: `taxel bench --goals` lists them all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Goal:
    """A figure and its limit; the figure is None where it was not measured."""

    what: str
    figure: float | None
    limit: float
    at_most: bool = False

    @property
    def reached(self) -> bool:
        """Whether the figure was measured and keeps the limit."""
        if self.figure is None:
            return False
        return self.figure <= self.limit if self.at_most else self.figure >= self.limit


def at_least(limits: Mapping[str, float], figures: Mapping[str, float]) -> list[Goal]:
    """Return the goals of figures by name; one that is not among them was not measured."""
    return [Goal(name, figures.get(name), limit) for name, limit in limits.items()]


def at_most(limits: Mapping[str, float], figures: Mapping[str, float]) -> list[Goal]:
    """Return the goals of figures by name that must not be larger than their limits."""
    return [Goal(name, figures.get(name), limit, at_most=True) for name, limit in limits.items()]


def times_real_time(limits: Mapping[str, float], result: Mapping[str, Any], share: float = 1.0) -> list[Goal]:
    """Return the goals of our encoders: times real time on one core, and a share of NumPy's spikes."""
    fast = {f"taxel, {name}, times real time": limit for name, limit in limits.items()}
    equal = {f"{name}: spikes as NumPy's, share": one for name, one in result.get("equal spikes", {}).items()}
    return at_least(fast, result["ratios"]) + at_least(dict.fromkeys(equal, share), equal)


def not_slower(result: Mapping[str, Any], *peers: str) -> list[Goal]:
    """Return the goals of ratios by name: ours is as fast as each peer."""
    return at_least(dict.fromkeys(peers, 1.0), result["ratios"])
