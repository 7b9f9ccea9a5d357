"""The thesis' van Rossum distance with a spatial kernel."""

from __future__ import annotations

from taxel._base.arguments import instance
from taxel._base.parameters import defaults
from taxel.array import Array
from taxel.metrics._metric import distance
from taxel.spikes import SpikeTrains

_DEFAULT = defaults("van_rossum_spatial")


def van_rossum_spatial(
    a: SpikeTrains,
    b: SpikeTrains,
    *,
    array: Array,
    tau: float = _DEFAULT.tau,
    sigma: float = _DEFAULT.sigma,
    own_train: str = _DEFAULT.own_train,
    normalisation: str = _DEFAULT.normalisation,
) -> float:
    """Return the Euclidean distance of two patterns smoothed in time and over the array.

    Each spike becomes ``exp(-(t - t_i) / tau)`` after its time (5.8) and adds ``exp(-d / sigma)`` times that to the
    taxel at distance d (5.11). The squared differences are integrated over all time, in closed form, and summed over
    taxels; the root of that is the distance. The distance of equal patterns is exactly 0.

    Parameters
    ----------
    a, b : SpikeTrains with one train per taxel, or several for each
        Signed trains are split into ON and OFF. If each taxel has several trains (all of one kind, then all of the
        next), each kind is smoothed separately.
    array : Array
        The positions of the taxels; those that do not exist must have no spikes and are ignored.
    tau : float, ms, above 0
        0.4 in the thesis.
    sigma : float, mm, above 0
        2 in the thesis.
    own_train : {"twice", "once"}
        How often a train counts at its own taxel: by itself and in the sum, as 5.11 is printed, or in the sum only.
    normalisation : {"spike", "tau", "none"}
        As for `van_rossum`.

    Returns
    -------
    float, 0 or more

    Raises
    ------
    ProblemError : another number of trains, spikes where the array has no taxel, a parameter out of range

    Notes
    -----
    Thesis 5.8 to 5.12. *Reading*: 5.12 prints ``sum over n of sqrt(g_n(a) - g_n(b))``, without time or square; this is
    the Euclidean norm over taxels and time that its left side denotes. Time O(spikes x taxels).

    Examples
    --------
    >>> from taxel import Array, SpikeTrains
    >>> array = Array(1, 2, pitch_mm=2.0)
    >>> a = SpikeTrains.from_lists([[10.0], []], stop=50.0)
    >>> b = SpikeTrains.from_lists([[], [10.0]], stop=50.0)
    >>> round(van_rossum_spatial(a, b, array=array, own_train="once"), 6)
    0.893953
    """
    patterns = instance("a", a, SpikeTrains), instance("b", b, SpikeTrains)
    smoothing = {"array": array, "tau": tau, "sigma": sigma, "own_train": own_train}
    return distance("van_rossum_spatial", *patterns, {**smoothing, "normalisation": normalisation})
