"""Van Rossum distance."""

from __future__ import annotations

from taxel._base.parameters import defaults
from taxel.metrics._metric import Pattern, distance

_DEFAULT = defaults("van_rossum")


def van_rossum(a: Pattern, b: Pattern, *, tau: float, normalisation: str = _DEFAULT.normalisation) -> float:
    """Return the Euclidean distance of two spike trains smoothed by an exponential.

    Each spike becomes ``exp(-(t - t_i) / tau)`` after its time; the squared difference is integrated over all time,
    in closed form, and the root taken. The distance of equal trains is exactly 0.

    Parameters
    ----------
    a, b : float64, shapes (n,) and (m,), ms, ascending; or SpikeTrains with equally many trains
        Either may be empty. For patterns, the sum over trains; signed trains are split into ON and OFF.
    tau : float, ms, above 0
    normalisation : {"spike", "tau", "none"}
        Divisor of the integral: ``tau / 2``, so that the distance of one additional spike is 1, as in elephant; `tau`,
        as in van Rossum's paper, with a distance of sqrt(1/2); or none, the norm of 5.10, in sqrt(ms).

    Returns
    -------
    float, 0 or more

    Raises
    ------
    ProblemError : times not ascending or not finite (names train and spike), `tau` not above 0, another number of
        trains

    Notes
    -----
    van Rossum (2001), Neural Comput. 13:751; thesis 5.8 to 5.10. The sums are those of Houghton and Kreuz (2012),
    Network 23:48, computed on the difference of the trains, so that similar trains lose no precision. Time O(n + m).

    Examples
    --------
    >>> round(van_rossum([10.0, 20.0], [10.0, 25.0], tau=10.0), 6)
    0.887096
    >>> van_rossum([10.0], [], tau=10.0)
    1.0
    """
    return distance("van_rossum", a, b, {"tau": tau, "normalisation": normalisation})
