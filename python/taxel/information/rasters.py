"""Inner products of all trials' rasters: smoothed in time, to several windows at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.information.sampling import SampledEvents
from taxel.spikes import to_ms

__all__ = ["event_grams", "features"]


def event_grams(spikes: SampledEvents, windows_us: Sequence[float], tau_ms: float) -> list[NDArray[np.float64]]:
    """Return the inner products of all trials' rasters, a matrix for each window after the contact.

    A raster has a value a taxel and bin; with `tau_ms` each event lasts to the window's end, falling by e in this time.

    Parameters
    ----------
    spikes : SampledEvents
    windows_us : sequence of float, us, ascending
    tau_ms : float, ms, 0 or more
        0: no smoothing.

    Returns
    -------
    list of float64, shape (trials, trials)

    Notes
    -----
    One pass over the bins: the sums to a longer window go on from those to a shorter one. Trials end within a bin of
    each other, and there each window has its own last products. Distances of these inner products are van Rossum's,
    Euclidean over all taxels.
    """
    sums = _Sums(spikes, windows_us)
    decay = np.float32(np.exp(to_ms(-spikes.period_us) / tau_ms)) if tau_ms > 0 else np.float32(0)
    there = np.bincount(spikes.taxel, minlength=1) > 0
    state = np.zeros((spikes.trials, int(there.sum())), np.float32)
    flat = spikes.trial * state.shape[1] + (np.cumsum(there) - 1)[spikes.taxel]
    begins = np.searchsorted(spikes.bin, np.arange(sums.bins + 1))
    for b in range(sums.bins):
        state *= decay
        here = slice(begins[b], begins[b + 1])
        np.add.at(state.ravel(), flat[here], spikes.value[here])
        sums.add(state)
    return sums.finish()


def features(spikes: SampledEvents, windows_us: Sequence[float]) -> list[int]:
    """Return by window how many pairs of taxel and bin hold an event in any trial, one at least."""
    bins = int(spikes.bin.max(initial=0)) + 1
    pairs, pair = np.unique(spikes.taxel * bins + spikes.bin, return_inverse=True)
    sizes = []
    for window in windows_us:
        there = np.zeros(len(pairs), bool)
        there[pair[spikes.bin < spikes.bins_to(window)[spikes.trial]]] = True
        sizes.append(max(1, int(there.sum())))
    return sizes


class _Sums:
    """Sum up the inner products of all trials, bin by bin, to several windows at once."""

    def __init__(self, spikes: SampledEvents, windows_us: Sequence[float]) -> None:
        # A silent trial adds nothing, so its end may be the last of all.
        silent = ~np.isfinite(spikes.first_us)
        ends = [spikes.bins_to(window) for window in windows_us]
        self._ends = [np.where(silent, end.max(initial=0), end) for end in ends]
        self._common = np.zeros((spikes.trials, spikes.trials))
        # Windows share one sum until the first trial ends within one of them; that window then has a separate sum.
        self._own: list[NDArray[np.float64] | None] = [None] * len(ends)
        self._bin = 0
        #: How many bins there are to the last window.
        self.bins = max((int(end.max()) for end in self._ends), default=0)

    def add(self, state: NDArray[np.float32]) -> None:
        """Add the next bin's products, of values of shape (trials, taxels)."""
        product: NDArray[np.float32] | None = None
        for k, end in enumerate(self._ends):
            inside = end > self._bin
            if self._own[k] is None and not inside.all():
                self._own[k] = self._common.copy()
            matrix = self._own[k]
            if matrix is not None and inside.any():
                product = state @ state.T if product is None else product
                chosen = np.flatnonzero(inside)
                matrix[np.ix_(chosen, chosen)] += product[np.ix_(chosen, chosen)]
        if any(matrix is None for matrix in self._own):
            self._common += state @ state.T if product is None else product
        self._bin += 1

    def finish(self) -> list[NDArray[np.float64]]:
        """Return the matrix of each window."""
        return [self._common.copy() if matrix is None else matrix for matrix in self._own]
