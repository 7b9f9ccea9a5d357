"""Spike codes of a population: rate, first-spike latency, relative latency, rank order; writing and reading (2.3.2)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import finite_numbers, floats, instance, mapping, number, several, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.information.estimate import Estimate, estimate
from taxel.information.nested import nested_predictions
from taxel.spikes import SpikeTrains

__all__ = ["Code", "FirstSpikeLatency", "RankOrder", "RateCode", "RelativeLatency", "compare_codes"]


@dataclass(frozen=True, kw_only=True)
class Code(ABC):
    """Write values of 0 to 1, one a train, as spikes, and read them back: as far as the code carries them.

    Parameters
    ----------
    window_ms : float, ms, above 0
        How long spikes are counted.
    resolution_ms : float, ms, 0 or more
        How finely the reader can tell times; spikes closer than that came together.

    Raises
    ------
    ProblemError : a window or a resolution that is invalid
    """

    window_ms: float
    resolution_ms: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < number("window_ms", self.window_ms, "ms") < math.inf:
            raise refused("window_ms", f" is {shown(self.window_ms)}: must be above 0 and finite")
        if not 0 <= number("resolution_ms", self.resolution_ms, "ms") < math.inf:
            raise refused("resolution_ms", f" is {shown(self.resolution_ms)}: must be 0 or more")

    def encode(self, values: ArrayLike, onset_ms: float = 0.0) -> SpikeTrains:
        """Write values as spikes.

        Parameters
        ----------
        values : float64, shape (trains,), 0 to 1
            0 is silence.
        onset_ms : float, ms
            When the stimulus began.

        Raises
        ------
        ProblemError : values outside 0 to 1

        Examples
        --------
        >>> FirstSpikeLatency(window_ms=10.0).encode([0.5], onset_ms=3.0).times
        array([8.])
        """
        checked, onset = floats("values", values), number("onset_ms", onset_ms, "ms")
        if checked.ndim != 1 or not ((checked >= 0) & (checked <= 1)).all():
            raise refused("values", f" are {shown(values)}: must be numbers of 0 to 1, one a train")
        if not math.isfinite(onset):
            raise refused("onset_ms", f" is {onset}: must be finite")
        lists = [onset + np.asarray(times) for times in self._times(checked)]
        return SpikeTrains.from_lists(lists, start=onset, stop=onset + self.window_ms)

    def decode(self, trains: SpikeTrains, onset_ms: float | None = None) -> NDArray[np.float64]:
        """Read values from spikes.

        Parameters
        ----------
        trains : SpikeTrains
        onset_ms : float, ms, optional
            The reference signal; the trains' start where it is left out. Codes that need none begin at the first spike.

        Returns
        -------
        float64, shape (trains,), 0 to 1
            0 where a train is silent within the window.

        Raises
        ------
        ProblemError : no spike trains, or an onset that is no number

        Examples
        --------
        >>> FirstSpikeLatency(window_ms=10.0).decode(SpikeTrains.from_lists([[5.0]], stop=10.0))
        array([0.5])
        """
        instance("trains", trains, SpikeTrains)._ungraded(type(self).__name__)
        onset = trains.start if onset_ms is None else number("onset_ms", onset_ms, "ms")
        return self._values(trains, onset)

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

    @abstractmethod
    def _times(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]: ...

    @abstractmethod
    def _values(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]: ...


@dataclass(frozen=True, kw_only=True)
class RateCode(Code):
    """Encode a value by the number of spikes within the window.

    Parameters
    ----------
    window_ms, resolution_ms
        As of `Code`; a count needs no resolution.
    most_hz : float, above 0
        The rate of a value of 1.

    Raises
    ------
    ProblemError : a window, a resolution or a rate that is invalid

    Examples
    --------
    >>> code = RateCode(window_ms=100.0, most_hz=100.0)
    >>> code.encode([0.0, 0.5, 1.0]).counts
    array([ 0,  5, 10])
    >>> code.decode(code.encode([0.0, 0.5, 1.0]))
    array([0. , 0.5, 1. ])
    """

    most_hz: float = 1000.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < number("most_hz", self.most_hz, "Hz") < math.inf:
            raise refused("most_hz", f" is {shown(self.most_hz)}: must be above 0 and finite")
        if self.most_hz * self.window_ms > 1e9:
            raise refused("most_hz", f" is {self.most_hz}: at most 1e6 spikes fit a window")

    def _times(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        counts = np.rint(values * self.most_hz * 1e-3 * self.window_ms).astype(np.int64)
        # Each spike lies in the middle of its share of the window, so none lies at the window's edges.
        return [(np.arange(n) + 0.5) * self.window_ms / max(1, n) for n in counts]

    def _values(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        counts = trains.between(onset, onset + self.window_ms).counts
        return np.asarray(np.minimum(counts / (self.most_hz * 1e-3 * self.window_ms), 1.0))


@dataclass(frozen=True, kw_only=True)
class FirstSpikeLatency(Code):
    """Encode a value by how soon after a reference signal the first spike comes: one spike a train.

    Parameters
    ----------
    window_ms : float, ms, above 0
    resolution_ms : float, ms, 0 or more
        As in `Code`.

    Raises
    ------
    ProblemError : a window or a resolution that is invalid

    Examples
    --------
    >>> code = FirstSpikeLatency(window_ms=10.0)
    >>> [times.tolist() for times in code.encode([1.0, 0.25, 0.0])]
    [[0.0], [7.5], []]
    >>> code.decode(code.encode([1.0, 0.25, 0.0]))
    array([1.  , 0.25, 0.  ])
    """

    def _times(self, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        return [np.array([(1.0 - value) * self.window_ms] if value > 0 else []) for value in values]

    def _values(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        latency = self._rounded(self._first(trains, onset))
        return np.asarray(np.where(latency < self.window_ms, 1.0 - latency / self.window_ms, 0.0))


@dataclass(frozen=True, kw_only=True)
class RelativeLatency(FirstSpikeLatency):
    """Encode a value by how long after the population's first spike a train's own first spike comes: no reference.

    What is read is relative to the largest value, which reads 1.

    Parameters
    ----------
    window_ms : float, ms, above 0
    resolution_ms : float, ms, 0 or more
        As in `Code`.

    Raises
    ------
    ProblemError : a window or a resolution that is invalid

    Examples
    --------
    >>> code = RelativeLatency(window_ms=10.0)
    >>> code.decode(code.encode([0.75, 0.5, 0.0], onset_ms=3.0), onset_ms=0.0)
    array([1.  , 0.75, 0.  ])
    """

    def _values(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        first = self._first(trains, onset)
        since = self._rounded(first - first.min()) if np.isfinite(first).any() else first
        return np.asarray(np.where(since < self.window_ms, 1.0 - since / self.window_ms, 0.0))


@dataclass(frozen=True, kw_only=True)
class RankOrder(RelativeLatency):
    """Encode values by the order of the trains' first spikes alone.

    The first reads 1, the others the share of trains that they do not follow; those that came together share a rank.

    Parameters
    ----------
    window_ms : float, ms, above 0
    resolution_ms : float, ms, 0 or more
        As in `Code`.

    Raises
    ------
    ProblemError : a window or a resolution that is invalid

    Examples
    --------
    >>> code = RankOrder(window_ms=10.0)
    >>> code.decode(code.encode([0.9, 0.2, 0.8, 0.0]))
    array([1.  , 0.5 , 0.75, 0.  ])
    """

    def _values(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        first = self._first(trains, onset)
        if not np.isfinite(first).any():
            return np.zeros(len(first))
        since = self._rounded(first - first.min())
        fired = since < self.window_ms
        values = np.zeros(len(first))
        order = np.sort(since[fired])
        before = np.searchsorted(order, since[fired]), np.searchsorted(order, since[fired], side="right")
        values[fired] = 1.0 - (sum(before) - 1.0) / 2.0 / len(
            first
        )  # spikes at the same time share the mean of their ranks
        return values


def compare_codes(
    trials: Sequence[SpikeTrains],
    labels: ArrayLike,
    codes: Mapping[str, Code],
    *,
    onsets_ms: ArrayLike | None = None,
    groups: ArrayLike | None = None,
    folds: int = 10,
    seed: int = 0,
) -> dict[str, Estimate]:
    """Estimate how many bits about labels each code carries from the same spikes.

    Linear discriminants classify each trial by its decoded values, trained on the other folds; the bits are those of
    the confusion matrix (`estimate`).

    Parameters
    ----------
    trials : sequence of SpikeTrains, equally many trains each
    labels : labels, shape (trials,)
    codes : mapping from name to Code
    onsets_ms : float64, shape (trials,), ms, optional
        The reference signal of each trial; its start where left out.
    groups : labels, shape (trials,), optional
        What must not be split between folds.
    folds : int, 2 or more
    seed : int, 0 or more

    Returns
    -------
    dict from name to Estimate

    Raises
    ------
    ProblemError : trials of different populations, no code, or labels that `estimate` refuses

    Notes
    -----
    Thesis 2.3.2, figure 2.7.

    Examples
    --------
    >>> code = FirstSpikeLatency(window_ms=10.0)
    >>> trials = [code.encode([0.1 + 0.8 * (k % 2) + 0.01 * k]) for k in range(8)]
    >>> round(compare_codes(trials, ["soft", "hard"] * 4, {"first": code}, folds=2)["first"].right, 2)
    1.0
    """
    patterns = [instance("trials", trial, SpikeTrains) for trial in several("trials", trials)]
    by_name: dict[str, Code] = mapping("codes", codes)
    for name, code in by_name.items():
        if not isinstance(code, Code):
            raise refused("codes", f"[{name}] is {shown(code)}: must be a taxel.information.Code")
    if not by_name:
        raise refused("codes", " is empty: name at least one")
    if not patterns or len({len(pattern) for pattern in patterns}) > 1:
        raise ProblemError("trials must be one or more, with equally many trains each")
    given = [pattern.start for pattern in patterns] if onsets_ms is None else onsets_ms
    onsets = finite_numbers("onsets_ms", given, "ms").ravel().tolist()
    if len(onsets) != len(patterns):
        raise refused("onsets_ms", f" has {len(onsets)} entries: must be {len(patterns)}, one a trial")
    estimates = {}
    for name, code in by_name.items():
        read = np.array([code.decode(pattern, onset) for pattern, onset in zip(patterns, onsets, strict=True)])
        vary = max(1, int(np.count_nonzero(np.ptp(read, axis=0) > 0)))
        nested = nested_predictions([read @ read.T], [vary], labels, groups=groups, count=folds, seed=seed)
        estimates[name] = estimate(labels, nested.responses, groups=groups, seed=seed)
    return estimates
