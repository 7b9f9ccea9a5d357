"""The van Rossum distance as equation 5.10 of the thesis is printed."""

from __future__ import annotations

from taxel._base.parameters import defaults
from taxel.metrics._metric import Pattern, distance

_DEFAULT = defaults("van_rossum_absolute")


def van_rossum_absolute(
    a: Pattern,
    b: Pattern,
    *,
    tau: float,
    window: tuple[float, float] | None = _DEFAULT.window,
    step_ms: float | None = _DEFAULT.step_ms,
) -> float:
    """Return the absolute difference of two smoothed spike trains, summed over time.

    Each spike becomes ``exp(-(t - t_i) / tau)`` after its time, as for `van_rossum`; but the absolute difference, as
    printed in 5.10, is summed over time instead of its square.

    Parameters
    ----------
    a, b : float64, shapes (n,) and (m,), ms, ascending; or SpikeTrains with equally many trains
        Either may be empty. For patterns, the sum over trains; signed trains are split into ON and OFF.
    tau : float, ms, above 0
    window : (start, stop), ms, optional
        The interval of the sum, 0 to T in 5.10; default: all time.
    step_ms : float, above 0, optional
        Step of a sum over points from the window's start (multiples of the step without a window), both ends included;
        default: the integral over time.

    Returns
    -------
    float, 0 or more; ms, or a plain number with `step_ms`

    Raises
    ------
    ProblemError : times not ascending or not finite (names train and spike), a parameter out of range, another number
        of trains

    Notes
    -----
    *Reading*: the thesis calls 5.10 a Euclidean norm and prints ``sum over t of sqrt((f_a - f_b)^2)``; `van_rossum`
    with ``normalisation="none"`` is the norm. Integral and sum are exact, as the difference between spikes is one
    exponential.

    Examples
    --------
    >>> van_rossum_absolute([10.0], [], tau=5.0)
    5.0
    >>> round(van_rossum_absolute([10.0], [12.0], tau=5.0, window=(0.0, 50.0), step_ms=1.0), 6)
    3.636716
    """
    return distance("van_rossum_absolute", a, b, {"tau": tau, "window": window, "step_ms": step_ms})
