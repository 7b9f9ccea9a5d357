"""The range of a neuron's inputs in its training data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.spikes import SpikeTrains


def seen(patterns: Sequence[SpikeTrains], memory_ms: float, *, graded: bool) -> dict[str, Any]:
    """Return the least and the largest that each input has, as a readout's file holds them.

    Of graded spikes it is their values, with 0; of others, the largest number of spikes within the neuron's memory.

    Parameters
    ----------
    patterns : sequence of SpikeTrains
        As the neuron reads them: signed ones are split.
    memory_ms : float, ms
    graded : bool
        Whether the encoder that the neuron receives is graded; a part of a composite need not be what the whole is.
    """
    if graded:
        extremes = [_extremes(pattern) for pattern in patterns]
        least = np.minimum.reduce([low for low, _ in extremes])
        most = np.maximum.reduce([high for _, high in extremes])
        return {"most": most.tolist()} | ({"least": least.tolist()} if least.any() else {})
    return {"most": np.maximum.reduce([_counts(pattern, memory_ms) for pattern in patterns]).tolist()}


def _extremes(trains: SpikeTrains) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the largest value of each train, with 0."""
    low, high = np.zeros(len(trains)), np.zeros(len(trains))
    assert trains.values is not None
    train = np.repeat(np.arange(len(trains)), trains.counts)
    np.minimum.at(low, train, trains.values)
    np.maximum.at(high, train, trains.values)
    return low, high


def _counts(trains: SpikeTrains, memory_ms: float) -> NDArray[np.int64]:
    """Return the largest number of spikes of each train within a memory, which begins with its first moment."""
    counts = np.zeros(len(trains), np.int64)
    for train in np.flatnonzero(trains.counts):
        times = trains.times[trains.offsets[train] : trains.offsets[train + 1]]
        # As the running readout counts: those at or after the spike's time less the memory.
        counts[train] = np.max(np.arange(1, len(times) + 1) - np.searchsorted(times, times - memory_ms))
    return counts
