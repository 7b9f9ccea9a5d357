"""SPIKE distance."""

from __future__ import annotations

from taxel._base.parameters import defaults
from taxel.metrics._metric import Pattern, distance

_DEFAULT = defaults("spike_distance")


def spike_distance(a: Pattern, b: Pattern, *, window: tuple[float, float] | None = _DEFAULT.window) -> float:
    """Return the mean distance of the spikes around each time from the nearest spikes of the other train.

    Distances are taken relative to the intervals between spikes and averaged over the window.

    Parameters
    ----------
    a, b : float64, shapes (n,) and (m,), ms, ascending; or SpikeTrains with equally many trains
        Either may be empty. For patterns, the sum over trains; signed trains are split into ON and OFF.
    window : (start, stop), ms
        Window of the mean; default: the widest window of the patterns; lists of times have none.

    Returns
    -------
    float, from 0 to 1 for each train

    Raises
    ------
    ProblemError : no window, or a spike outside it; times not ascending or not finite (names train and spike)

    Notes
    -----
    Kreuz et al. (2013), J. Neurophysiol. 109:1457. The profile is linear between spikes; its integral is exact. Edges
    as in PySpike: before the first and after the last spike the interval reaches to the window's edge, or is as long as
    the neighbouring one if that is longer; an empty train has a spike at either edge; spikes at the same time count
    once. It is not a metric: the triangle inequality need not hold. Time O(n + m).

    Examples
    --------
    >>> round(spike_distance([10.0, 20.0, 30.0], [11.0, 20.0, 33.0], window=(0.0, 40.0)), 6)
    0.130982
    """
    return distance("spike_distance", a, b, {"window": window})
