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
    def verdict(self) -> str:
        """Whether the figure was measured and keeps the limit."""
        if self.figure is None:
            return "not measured"
        return (
            "reached" if (self.figure <= self.limit if self.at_most else self.figure >= self.limit) else "not reached"
        )


def at_least(limits: Mapping[str, float], figures: Mapping[str, float]) -> list[Goal]:
    """Return the goals of figures by name; one that is not among them was not measured."""
    return [Goal(name, figures.get(name), limit) for name, limit in limits.items()]


def at_most(limits: Mapping[str, float], figures: Mapping[str, float]) -> list[Goal]:
    """Return the goals of figures by name that must not be larger than their limits."""
    return [Goal(name, figures.get(name), limit, at_most=True) for name, limit in limits.items()]


def not_slower(result: Mapping[str, Any], *peers: str) -> list[Goal]:
    """Return the goals of ratios by name: ours is as fast as each peer."""
    return at_least(dict.fromkeys(peers, 1.0), result["ratios"])
