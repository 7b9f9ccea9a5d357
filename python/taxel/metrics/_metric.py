"""A metric's parameters and patterns, on their way to the compiled part."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taxel import _core
from taxel._arguments import floats, instance, number, parameters, several, shown, text
from taxel._core import ProblemError
from taxel.array import Array
from taxel.spikes import SpikeTrains

__all__ = ["Pattern", "distance", "listed", "stated"]

Pattern = ArrayLike | SpikeTrains

_NUMBERS = ("tau", "sigma", "step_ms")
_UNITS = {"q": "1/ms", "tau": "ms", "sigma": "mm", "step_ms": "ms"}
_WORDS = {"normalisation": ("spike", "tau", "none"), "own_train": ("twice", "once")}

#: What each metric takes, as the compiled part has it.
TAKES = {
    "victor_purpura": {"q"},
    "victor_purpura_multi_unit": {"q", "k"},
    "van_rossum": {"tau", "normalisation"},
    "van_rossum_absolute": {"tau", "window", "step_ms"},
    "van_rossum_spatial": {"tau", "sigma", "array", "own_train", "normalisation"},
    "van_rossum_spatial_absolute": {"tau", "sigma", "array", "own_train", "window", "step_ms"},
    "isi_distance": {"window"},
    "spike_distance": {"window"},
}


def stated(metric: str, given: dict[str, Any]) -> str:
    """Return a metric as JSON; refuse what it does not take, and what is of another kind, by name."""
    values: dict[str, Any] = {"name": text("metric", metric, TAKES)}
    for name, value in given.items():
        if name not in TAKES[metric]:
            raise ProblemError(f"{name}: {metric} takes {', '.join(sorted(TAKES[metric]))}")
        if name in ("q", "k"):
            # JSON has no number for what is not finite.
            cost = number(name, value, _UNITS.get(name))
            values[name] = cost if math.isfinite(cost) else str(cost)
        elif name in _WORDS:
            values[name] = text(name, value, _WORDS[name])
        elif name == "array":
            values[name] = instance(name, value, Array)._geometry()
        elif name in _NUMBERS:
            if value is not None or name != "step_ms":
                values[name] = number(name, value, _UNITS.get(name))
        elif value is not None:
            ends = floats(name, value, "ms")
            if len(ends) != 2:
                raise ProblemError(f"{name} has {len(ends)} entries: must be start and stop, ms")
            values[name] = ends.tolist()
    return parameters(values)


def distance(metric: str, a: Pattern, b: Pattern, given: dict[str, Any]) -> float:
    """Return the distance of two trains or two patterns."""
    if isinstance(a, SpikeTrains) != isinstance(b, SpikeTrains):
        name, value, other = ("b", b, "a") if isinstance(a, SpikeTrains) else ("a", a, "b")
        raise ProblemError(f"{name} is {shown(value)}: must be a taxel.SpikeTrains, as {other} is")
    return _core.distance(stated(metric, given), _one("a", a), _one("b", b))


def _one(name: str, x: Pattern) -> tuple[Any, ...]:
    if isinstance(x, SpikeTrains):
        trains = x.split_by_sign() if x.signed else x
        return name, 1, len(trains), trains.times, trains.offsets, (x.start, x.stop), False
    times = floats(name, x, "ms")
    return name, 1, 1, times, np.array([0, len(times)]), None, False


def listed(name: str, x: SpikeTrains | Sequence[Pattern]) -> tuple[Any, ...]:
    """Return several patterns: the trains of one `SpikeTrains`, a list of `SpikeTrains`, or a list of times a train."""
    if isinstance(x, SpikeTrains):
        if x.signed:
            raise ProblemError(f"{name} has signed trains: choose some by split_by_sign(), or give a list of patterns")
        return name, len(x), 1, x.times, x.offsets, (x.start, x.stop), True
    entries = several(name, x)
    if not any(isinstance(entry, SpikeTrains) for entry in entries):
        times = [floats(f"{name}[{p}]", entry, "ms") for p, entry in enumerate(entries)]
        return name, len(times), 1, _joined(times), _offsets([len(t) for t in times]), None, True
    patterns = [instance(f"{name}[{p}]", entry, SpikeTrains) for p, entry in enumerate(entries)]
    window = (min(p.start for p in patterns), max(p.stop for p in patterns))
    patterns = [p.split_by_sign() if p.signed else p for p in patterns]
    trains = len(patterns[0])
    for p, pattern in enumerate(patterns):
        if len(pattern) != trains:
            raise ProblemError(f"{name}[{p}] has {len(pattern)} trains, {name}[0] has {trains}: must be equally many")
    offsets = _offsets(np.concatenate([p.counts for p in patterns]))
    return name, len(patterns), trains, _joined([p.times for p in patterns]), offsets, window, True


def _joined(times: list[Any]) -> Any:
    return np.concatenate(times) if times else np.empty(0)


def _offsets(counts: ArrayLike) -> Any:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
