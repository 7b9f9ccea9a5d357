"""The arguments of every learner: patterns with their targets."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import float64
from numpy.typing import NDArray

from taxel._base.arguments import floats, instance, numbers, several
from taxel._core import ProblemError
from taxel.spikes import SpikeTrains

__all__ = ["examples", "windows", "with_kind"]


def examples(patterns: object, targets: object) -> tuple[list[tuple[Any, ...]], list[NDArray[float64]]]:
    """Return patterns and targets as the compiled part reads them; refuse other types."""
    trains = [instance(f"pattern {p}", s, SpikeTrains)._parts() for p, s in enumerate(several("patterns", patterns))]
    return trains, [floats(f"targets of pattern {p}", t, "ms") for p, t in enumerate(several("targets", targets))]


def windows(name: str, given: object) -> NDArray[float64] | None:
    """Return the windows in which silence counts as start, stop, start, stop ...; None for everywhere."""
    if given is None:
        return None
    ends = numbers(name, given, np.float64, "ms")  # type: ignore[arg-type]
    if ends.size and (ends.ndim != 2 or ends.shape[1] != 2):
        raise ProblemError(f"{name} has shape {ends.shape}: must hold windows, a start and a stop each")
    return ends.reshape(-1)


def with_kind(pattern: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return a pickled pattern as the compiled part reads it: those before graded trains have no kind."""
    if len(pattern) == 6:
        return pattern
    times, offsets, values, start, stop = pattern
    return times, offsets, values, "unsigned" if values is None else "signed", start, stop
