"""Inner products of all trials' rasters: smoothed in time, to several windows at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.information.sampling import Spikes
from taxel.spikes import to_ms

__all__ = ["event_grams", "features", "frame_grams"]


def event_grams(spikes: Spikes, windows_us: Sequence[float], tau_ms: float) -> list[NDArray[np.float64]]:
    """Return the inner products of all trials' rasters, a matrix for each window after the contact.

    A raster has a value a taxel and bin; with `tau_ms` each event lasts to the window's end, falling by e in this time.

    Parameters
    ----------
    spikes : Spikes
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
    ends = _ends(spikes, windows_us)
    last = max((int(end.max()) for end in ends), default=0)
    decay = np.float32(np.exp(to_ms(-spikes.period_us) / tau_ms)) if tau_ms > 0 else np.float32(0)
    active, taxel = np.unique(spikes.taxel, return_inverse=True)
    state = np.zeros((spikes.trials, len(active)), np.float32)
    begins = np.searchsorted(spikes.bin, np.arange(last + 1))
    total = np.zeros((spikes.trials, spikes.trials))
    found: list[NDArray[np.float64]] = [np.zeros_like(total) for _ in ends]
    open_ = [True] * len(ends)
    for b in range(last):
        state *= decay
        here = slice(begins[b], begins[b + 1])
        np.add.at(state, (spikes.trial[here], taxel[here]), spikes.value[here])
        _window_products(state, b, ends, total, found, open_)
    for k, still in enumerate(open_):
        if still:
            found[k] = total.copy()
    return found


def frame_grams(values: NDArray[np.float32], spikes: Spikes, windows_us: Sequence[float]) -> list[NDArray[np.float64]]:
    """Return the inner products of pictures instead of events, at the same period, aligned in the same way.

    Parameters
    ----------
    values : float32, shape (bins, trials, taxels)
        The change of each taxel since before the touch; bin 0 is that of the first event.
    spikes : Spikes
    windows_us : sequence of float, us, ascending

    Returns
    -------
    list of float64, shape (trials, trials)
    """
    ends = _ends(spikes, windows_us)
    last = min(len(values), max((int(end.max()) for end in ends), default=0))
    total = np.zeros((spikes.trials, spikes.trials))
    found: list[NDArray[np.float64]] = [np.zeros_like(total) for _ in ends]
    open_ = [True] * len(ends)
    for b in range(last):
        _window_products(values[b], b, ends, total, found, open_)
    for k, still in enumerate(open_):
        if still:
            found[k] = total.copy()
    return found


def features(spikes: Spikes, window_us: float) -> int:
    """Return how many pairs of taxel and bin hold an event in any trial, one at least."""
    kept = spikes.bin < spikes.bins_to(window_us)[spikes.trial]
    return max(1, len(np.unique(spikes.taxel[kept] * (int(spikes.bin.max(initial=0)) + 1) + spikes.bin[kept])))


def _ends(spikes: Spikes, windows_us: Sequence[float]) -> list[NDArray[np.int64]]:
    """Return each trial's bins to each window; a silent trial adds nothing wherever it ends, so it ends last."""
    silent = ~np.isfinite(spikes.first_us)
    bins = [spikes.bins_to(window) for window in windows_us]
    return [np.where(silent, one.max(initial=0), one) for one in bins]


def _window_products(
    state: NDArray[np.float32],
    b: int,
    ends: Sequence[NDArray[np.int64]],
    total: NDArray[np.float64],
    found: list[NDArray[np.float64]],
    open_: list[bool],
) -> None:
    """Add a bin's products to the common sum, and to those windows that some trials have left already."""
    product: NDArray[np.float32] | None = None
    for k, end in enumerate(ends):
        inside = end > b
        if not inside.any():
            if open_[k]:
                found[k], open_[k] = total.copy(), False
            continue
        if open_[k] and not inside.all():
            found[k], open_[k] = total.copy(), False
        if not open_[k]:
            if product is None:
                product = state @ state.T
            mine = np.flatnonzero(inside)
            found[k][np.ix_(mine, mine)] += product[np.ix_(mine, mine)]
    if any(open_):
        total += state @ state.T if product is None else product
