"""What every learner is given: patterns with their targets, and a limit of time."""

from __future__ import annotations

from typing import Any

from numpy import float64
from numpy.typing import NDArray

from taxel._arguments import floats, instance, number, several, shown
from taxel._core import ProblemError
from taxel.spikes import SpikeTrains

__all__ = ["examples", "seconds"]


def examples(patterns: object, targets: object) -> tuple[list[tuple[Any, ...]], list[NDArray[float64]]]:
    """Return patterns and targets as the compiled part takes them; refuse what is none, by name."""
    trains = [instance(f"pattern {p}", s, SpikeTrains)._parts() for p, s in enumerate(several("patterns", patterns))]
    return trains, [floats(f"targets of pattern {p}", t, "ms") for p, t in enumerate(several("targets", targets))]


def seconds(value: object) -> float | None:
    """Return a limit of time; refuse one that is not above 0."""
    if value is None:
        return None
    limit = number("max_seconds", value, "s")
    if not limit > 0:
        raise ProblemError(f"max_seconds is {shown(value)}: must be above 0")
    return limit
