"""Spike codes of a population: rate, first-spike latency, relative latency, rank order (thesis 2.3.2, figure 2.7)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import SpikeTrains
from taxel.information import Estimate, estimate, nested_predictions

__all__ = ["Code", "FirstSpikeLatency", "RankOrder", "RateCode", "RelativeLatency", "compare_codes"]


@dataclass(frozen=True, kw_only=True)
class Code(ABC):
    """Read values of 0 to 1, one a train, from spikes, as far as the code carries them; 0 is silence in the window.

    Parameters
    ----------
    window_ms : float, ms, above 0
        How long spikes are counted.
    resolution_ms : float, ms, 0 or more
        How finely the reader can tell times; spikes closer than that came together.
    """

    window_ms: float
    resolution_ms: float = 0.0

    @abstractmethod
    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return a value a train; spikes count from the onset on (ms), which latencies are measured from."""

    def _first(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        """Return the latency of each train's first spike at or after the onset, ms; infinite where there is none."""
        first = np.full(len(trains), np.inf)
        times, train = trains.to_numpy()
        later = times >= onset
        np.minimum.at(first, train[later], times[later] - onset)
        return first

    def _rounded(self, latency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return latencies rounded down to whole steps of the resolution."""
        if not self.resolution_ms:
            return latency
        # 1e-9 keeps a time in its step that is a whole number of steps but for its rounding error.
        return np.asarray(self.resolution_ms * np.floor(latency / self.resolution_ms + 1e-9))


@dataclass(frozen=True, kw_only=True)
class RateCode(Code):
    """Read a value from the number of spikes within the window; ``most_hz`` is the rate of a value of 1.

    Examples
    --------
    >>> code = RateCode(window_ms=100.0, most_hz=100.0)
    >>> code.decode(SpikeTrains.from_lists([[], [10.0, 20.0, 30.0, 40.0, 50.0]], stop=100.0), 0.0)
    array([0. , 0.5])
    """

    most_hz: float = 1000.0

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        counts = trains.between(onset_ms, onset_ms + self.window_ms).counts
        return np.asarray(np.minimum(counts / (self.most_hz * 1e-3 * self.window_ms), 1.0))


@dataclass(frozen=True, kw_only=True)
class FirstSpikeLatency(Code):
    """Read a value from how soon after the onset the first spike comes.

    Examples
    --------
    >>> FirstSpikeLatency(window_ms=10.0).decode(SpikeTrains.from_lists([[3.0], [10.5], []], stop=20.0), 3.0)
    array([1.  , 0.25, 0.  ])
    """

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        latency = self._rounded(self._first(trains, onset_ms))
        return np.asarray(np.where(latency < self.window_ms, 1.0 - latency / self.window_ms, 0.0))


@dataclass(frozen=True, kw_only=True)
class RelativeLatency(Code):
    """Read a value from how long after the population's first spike a train's own first spike comes: no reference.

    What is read is relative to the largest value, which reads 1.

    Examples
    --------
    >>> RelativeLatency(window_ms=10.0).decode(SpikeTrains.from_lists([[5.5], [8.0], []], stop=13.0), 0.0)
    array([1.  , 0.75, 0.  ])
    """

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        since = self._since(trains, onset_ms)
        return np.asarray(np.where(since < self.window_ms, 1.0 - since / self.window_ms, 0.0))

    def _since(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        """Return how long after the population's first spike each train's own comes, ms."""
        first = self._first(trains, onset)
        return self._rounded(first - first.min()) if np.isfinite(first).any() else first


@dataclass(frozen=True, kw_only=True)
class RankOrder(RelativeLatency):
    """Read values from the order of the trains' first spikes alone.

    The first reads 1, the others the share of trains that they do not follow; those that came together share a rank.

    Examples
    --------
    >>> RankOrder(window_ms=10.0).decode(SpikeTrains.from_lists([[1.0], [8.0], [2.0], []], stop=10.0), 0.0)
    array([1.  , 0.5 , 0.75, 0.  ])
    """

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        since = self._since(trains, onset_ms)
        fired = since < self.window_ms
        values, order = np.zeros(len(since)), np.sort(since[fired])
        # Spikes at the same time share the mean of their ranks.
        before = np.searchsorted(order, since[fired]), np.searchsorted(order, since[fired], side="right")
        values[fired] = 1.0 - (sum(before) - 1.0) / 2.0 / len(since)
        return values


def compare_codes(
    trials: Sequence[SpikeTrains],
    labels: ArrayLike,
    codes: Mapping[str, Code],
    *,
    onsets_ms: ArrayLike | None = None,
    folds: int = 10,
    seed: int = 0,
) -> dict[str, Estimate]:
    """Estimate how many bits about labels each code carries from the same spikes.

    Linear discriminants classify each trial by its decoded values, trained on the other folds; the bits are those of
    the confusion matrix (`taxel.information.estimate`).

    Parameters
    ----------
    trials : sequence of SpikeTrains, equally many trains each
    labels : labels, shape (trials,)
    codes : mapping from name to Code
    onsets_ms : float64, shape (trials,), ms, optional
        The reference signal of each trial; its start where left out.
    folds : int, 2 or more
    seed : int, 0 or more
    """
    onsets = [trial.start for trial in trials] if onsets_ms is None else np.asarray(onsets_ms, np.float64).tolist()
    estimates = {}
    for name, code in codes.items():
        read = np.array([code.decode(trial, onset) for trial, onset in zip(trials, onsets, strict=True)])
        vary = max(1, int(np.count_nonzero(np.ptp(read, axis=0) > 0)))
        nested = nested_predictions([read @ read.T], [vary], labels, count=folds, seed=seed)
        estimates[name] = estimate(labels, nested.responses, seed=seed)
    return estimates
