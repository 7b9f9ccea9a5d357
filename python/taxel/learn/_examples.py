"""The arguments of every learner: patterns with their targets."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import float64
from numpy.typing import NDArray

from taxel._base.arguments import floats, instance, numbers, several, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.spikes import SpikeTrains


def examples(patterns: object, targets: object) -> tuple[list[SpikeTrains], list[NDArray[float64]]]:
    """Return patterns and targets as the compiled part reads them; refuse other types."""
    if isinstance(patterns, SpikeTrains):
        raise refused("patterns", f" is one SpikeTrains ({patterns!r}): must be a list of them, one per pattern")
    trains = [instance(f"pattern {p}", s, SpikeTrains) for p, s in enumerate(several("patterns", patterns))]
    if not np.iterable(targets):
        raise refused(
            "targets", f" is {shown(targets)}: must be a list of times (ms) for each pattern, for example [[20.0], []]"
        )
    times = []
    of_pattern: Any
    for p, of_pattern in enumerate(several("targets", targets)):
        if isinstance(of_pattern, int | float | np.number) or (type(of_pattern) is np.ndarray and of_pattern.ndim == 0):
            raise ProblemError(
                f"targets of pattern {p} is {shown(of_pattern)}: must be a list of times (ms), empty for none"
            )
        times.append(floats(f"targets of pattern {p}", of_pattern))
    return trains, times


def windows(name: str, given: object) -> NDArray[float64] | None:
    """Return the windows in which silence counts as start, stop, start, stop ...; None for everywhere."""
    if given is None:
        return None
    ends = numbers(name, given, np.float64)  # type: ignore[arg-type]
    if ends.size and (ends.ndim != 2 or ends.shape[1] != 2):
        raise refused(name, f" has shape {ends.shape}: must contain windows, each with a start and a stop")
    return ends.reshape(-1)
