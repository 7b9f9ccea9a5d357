"""Shared by studies of STDP: thresholds by how often a neuron fires before it learns, and streams presented again."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from taxel.spikes import SpikeTrains
from taxel_rules import STDP

__all__ = ["moved", "threshold", "unlearning"]

#: Halvings in the search for a threshold: to 1e-4 of it.
_HALVINGS = 16


def moved(spikes: SpikeTrains, later_ms: float) -> SpikeTrains:
    """Return the same spikes, later by a time."""
    return SpikeTrains(spikes.times + later_ms, spikes.offsets, spikes.start + later_ms, spikes.stop + later_ms)


def unlearning(level: float, taus: Mapping[str, float]) -> STDP:
    """Return a neuron that runs and never learns."""
    return STDP(threshold=level, a_plus=0.0, a_minus=0.0, **taus)


def threshold(spikes: SpikeTrains, hz: float, taus: Mapping[str, float]) -> float:
    """Return the threshold at which a neuron that has learnt nothing fires at this rate, or a little less."""
    low, high = 1e-3, float(len(spikes.offsets))
    for _ in range(_HALVINGS):
        middle = float(np.sqrt(low * high))
        fired = len(unlearning(middle, taus).partial_fit(spikes).spikes_)
        low, high = (middle, high) if 1000 * fired > hz * (spikes.stop - spikes.start) else (low, middle)
    return high
