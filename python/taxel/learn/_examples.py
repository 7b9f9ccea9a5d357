"""The arguments of every learner: patterns with their targets."""

from __future__ import annotations

from typing import Any

from numpy import float64
from numpy.typing import NDArray

from taxel._base.arguments import floats, instance, several
from taxel.spikes import SpikeTrains

__all__ = ["examples"]


def examples(patterns: object, targets: object) -> tuple[list[tuple[Any, ...]], list[NDArray[float64]]]:
    """Return patterns and targets as the compiled part reads them; refuse other types."""
    trains = [instance(f"pattern {p}", s, SpikeTrains)._parts() for p, s in enumerate(several("patterns", patterns))]
    return trains, [floats(f"targets of pattern {p}", t, "ms") for p, t in enumerate(several("targets", targets))]
