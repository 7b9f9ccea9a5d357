"""Victor-Purpura distance."""

from __future__ import annotations

from taxel.metrics._metric import Pattern, distance


def victor_purpura(a: Pattern, b: Pattern, *, q: float) -> float:
    """Return the least cost of changing spike train `a` into spike train `b`.

    Removing or adding a spike costs 1, moving it by dt costs ``q * |dt|``: spikes over ``2 / q`` apart never match.

    Parameters
    ----------
    a, b : float64, shapes (n,) and (m,), ms, ascending; or SpikeTrains with equally many trains
        Either may be empty. For patterns, the sum over trains; signed trains are split into ON and OFF.
    q : float, 1/ms, 0 or more; infinite: only spikes at exactly the same time match

    Returns
    -------
    float, 0 or more; 1 is one spike removed

    Raises
    ------
    ProblemError : times not ascending or not finite (names train and spike), `q` below 0, another number of trains

    Notes
    -----
    Victor and Purpura (1996), J. Neurophysiol. 76:1310; thesis 6.3.5. Time O(n + m + pairs within ``2 / q``).

    Examples
    --------
    >>> round(victor_purpura([10.0, 20.0, 30.0], [12.0, 24.0, 30.0], q=0.1), 6)
    0.6
    """
    return distance("victor_purpura", a, b, {"q": q})
