"""ISI distance."""

from __future__ import annotations

from taxel._base.parameters import defaults
from taxel.metrics._metric import Pattern, distance

_DEFAULT = defaults("isi_distance")


def isi_distance(a: Pattern, b: Pattern, *, window: tuple[float, float] | None = _DEFAULT.window) -> float:
    """Return the mean relative difference of the intervals between spikes.

    The mean over the window of ``|x - y| / max(x, y)``, where x and y are the intervals of the two trains at each time.

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
    Kreuz et al. (2007), J. Neurosci. Methods 165:151. The profile is constant between spikes; its integral is exact.
    Edges as in PySpike: before the first and after the last spike the interval reaches to the window's edge, or is as
    long as the neighbouring one if that is longer; an empty train has a spike at either edge; spikes at the same time
    count once. Time O(n + m).

    Examples
    --------
    >>> isi_distance([10.0, 20.0, 30.0], [10.0, 30.0], window=(0.0, 40.0))
    0.5
    """
    return distance("isi_distance", a, b, {"window": window})
