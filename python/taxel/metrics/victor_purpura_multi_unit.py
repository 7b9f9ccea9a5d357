"""Victor-Purpura distance between patterns of many units."""

from __future__ import annotations

from taxel._base.arguments import instance
from taxel.metrics._metric import distance
from taxel.spikes import SpikeTrains


def victor_purpura_multi_unit(a: SpikeTrains, b: SpikeTrains, *, q: float, k: float) -> float:
    """Return the least cost of changing pattern `a` into pattern `b`, where a spike may also change its train.

    Removing or adding a spike costs 1, moving it by dt costs ``q * |dt|``, moving it to another train costs `k`. With
    ``k = 0`` the trains are pooled; with k of 2 or more they are separate, and this is `victor_purpura` summed over
    trains.

    Parameters
    ----------
    a, b : SpikeTrains with equally many trains
        Signed trains are split into ON and OFF, which are separate trains.
    q : float, 1/ms, 0 or more; infinite: only spikes at exactly the same time match
    k : float, 0 or more

    Returns
    -------
    float, 0 or more; 1 is one spike removed

    Raises
    ------
    ProblemError : `q` or `k` below 0, another number of trains
    KeyboardInterrupt : Ctrl-C, within a fraction of a second

    Notes
    -----
    Aronov (2003), J. Neurosci. Methods 124:175. Exact, as a matching of least cost between the spikes of both patterns,
    by shortest augmenting paths; only pairs that cost less than 2 are compared. For n spikes with p such pairs time
    O(n (p + n log n)) at worst, about O(p) with few conflicts, independent of the number of trains; memory O(n).

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> a = SpikeTrains.from_lists([[10.0], []], stop=50.0)
    >>> b = SpikeTrains.from_lists([[], [13.0]], stop=50.0)
    >>> [round(victor_purpura_multi_unit(a, b, q=0.1, k=k), 6) for k in (0.0, 0.5, 2.0)]
    [0.3, 0.8, 2.0]
    """
    patterns = instance("a", a, SpikeTrains), instance("b", b, SpikeTrains)
    return distance("victor_purpura_multi_unit", *patterns, {"q": q, "k": k})
