"""Learners from options in one list, those of the neuron among them, and trains from times."""

from __future__ import annotations

from typing import Any, TypeVar

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, ConeX

Cone = TypeVar("Cone", ConeX, ConeR)


def made(kind: type[Cone], **options: Any) -> Cone:
    """A learner; what is a neuron's goes to its neuron, which is left out where it would be all default."""
    names = Neuron().get_params()
    own = {name: value for name, value in options.items() if name in names}
    if issubclass(kind, ConeR):
        own.setdefault("time", "grid")
    rest = {name: value for name, value in options.items() if name not in names}
    return kind(neuron=Neuron(**own) if own else None, **rest)


def lists(*times: list[float]) -> SpikeTrains:
    """A train for each list of times, ms, in a window of 100 ms."""
    return SpikeTrains.from_lists(times, stop=100.0)
