"""ISI distance."""

from __future__ import annotations

from taxel._base.parameters import defaults
from taxel.metrics._metric import Pattern, distance

__all__ = ["isi_distance"]


_DEFAULT = defaults("isi_distance")


def isi_distance(a: Pattern, b: Pattern, *, window: tuple[float, float] | None = _DEFAULT.window) -> float:
    """Return how much the intervals between spikes differ, moment by moment.

    The mean over the window of ``|x - y| / max(x, y)``, where x and y are the two trains' intervals at that moment.

    Parameters
    ----------
    a, b : float64, shapes (n,) and (m,), ms, ascending; or SpikeTrains with equally many trains
        Either may be empty. Of patterns the sum over trains; signed ones are split into ON and OFF.
    window : (start, stop), ms
        From when to when. Where it is left out: the widest of the patterns' own windows; lists of times have none.

    Returns
    -------
    float, from 0 to 1 a train

    Raises
    ------
    ProblemError : no window, or a spike outside it; times not ascending or not finite (names train and spike)

    Notes
    -----
    Kreuz et al. (2007), J. Neurosci. Methods 165:151. The profile is constant between spikes; its integral is exact.
    Edges as in PySpike: before the first and after the last spike the interval is as long as up to the window's edge,
    or as the neighbouring one if that is longer; an empty train has a spike at either edge; of spikes at the same time
    one counts. Trains of the same intervals at other times have distance 0. Time O(n + m).

    Examples
    --------
    >>> isi_distance([10.0, 20.0, 30.0], [10.0, 30.0], window=(0.0, 40.0))
    0.5
    """
    return distance("isi_distance", a, b, {"window": window})
