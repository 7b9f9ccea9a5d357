"""Conversion of a metric's parameters and patterns for the compiled part."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import floats, instance, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._base.parameters import ranges
from taxel.array import Array
from taxel.spikes import SpikeTrains

Pattern = ArrayLike | SpikeTrains


class Patterns(NamedTuple):
    """Several patterns of equally many trains, one behind the other; `listed`: an error names them by their number."""

    name: str
    patterns: int
    trains: int
    times: NDArray[np.float64]
    offsets: NDArray[np.int64]
    listed: bool


def stated(metric: str, options: Mapping[str, Any]) -> str:
    """Return a metric as JSON for the compiled part, which checks it."""
    name = text("metric", metric)
    return parameters({"name": name, **{key: _plain(name, key, value) for key, value in options.items()}})


def _plain(metric: str, name: str, value: Any) -> Any:
    if name == "array":
        return instance(name, value, Array)._geometry()
    known = ranges(metric).get(name, {})
    if "infinite" in known:
        # JSON has no infinite numbers; for parameters that may be infinite the compiled part reads the text.
        cost = number(name, value)
        return cost if math.isfinite(cost) else str(cost)
    return value


def distance(metric: str, a: Pattern, b: Pattern, options: Mapping[str, Any]) -> float:
    """Return the distance of two trains or two patterns."""
    if isinstance(a, SpikeTrains) != isinstance(b, SpikeTrains):
        name, value, wanted = ("b", b, "a") if isinstance(a, SpikeTrains) else ("a", a, "b")
        raise refused(name, f" is {shown(value)}: must be a taxel.SpikeTrains, as {wanted} is")
    return _core.distance(stated(metric, options), _one(metric, "a", a), _one(metric, "b", b))


def _one(metric: str, name: str, x: Pattern) -> Patterns:
    if isinstance(x, SpikeTrains):
        trains = _unvalued(metric, x)
        return Patterns(name, 1, len(trains), trains.times, trains.offsets, False)
    times = floats(name, x)
    return Patterns(name, 1, 1, times, np.array([0, len(times)]), False)


def listed(metric: str, name: str, x: SpikeTrains | Sequence[Pattern]) -> Patterns:
    """Return several patterns: the trains of one `SpikeTrains`, a list of `SpikeTrains`, or a list of times a train."""
    if isinstance(x, SpikeTrains):
        if x.signed:
            raise refused(name, " has signed trains: choose some by split_by_sign(), or give a list of patterns")
        x._ungraded(metric)
        return Patterns(name, len(x), 1, x.times, x.offsets, True)
    entries = several(name, x)
    if not any(isinstance(entry, SpikeTrains) for entry in entries):
        times = [floats(f"{name}[{p}]", entry) for p, entry in enumerate(entries)]
        return Patterns(name, len(times), 1, _joined(times), _offsets([len(t) for t in times]), True)
    patterns = [instance(f"{name}[{p}]", entry, SpikeTrains) for p, entry in enumerate(entries)]
    patterns = [_unvalued(metric, p) for p in patterns]
    trains = len(patterns[0])
    for p, pattern in enumerate(patterns):
        if len(pattern) != trains:
            raise refused(
                name, f"[{p}] has {counted(len(pattern), 'train')}, {name}[0] has {trains}: must be equally many"
            )
    offsets = _offsets(np.concatenate([p.counts for p in patterns]))
    return Patterns(name, len(patterns), trains, _joined([p.times for p in patterns]), offsets, True)


def _unvalued(metric: str, trains: SpikeTrains) -> SpikeTrains:
    """Return trains without values: signed ones are split by sign, graded ones are refused."""
    return trains.split_by_sign() if trains.signed else trains._ungraded(metric)


def _joined(times: list[Any]) -> Any:
    return np.concatenate(times) if times else np.empty(0)


def _offsets(counts: ArrayLike) -> Any:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
