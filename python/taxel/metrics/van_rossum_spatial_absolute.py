"""The spatial van Rossum distance of thesis 5.12 with the absolute difference of 5.10."""

from __future__ import annotations

from taxel._base.arguments import instance
from taxel._base.parameters import defaults
from taxel.array import Array
from taxel.metrics._metric import distance
from taxel.spikes import SpikeTrains

_DEFAULT = defaults("van_rossum_spatial_absolute")


def van_rossum_spatial_absolute(
    a: SpikeTrains,
    b: SpikeTrains,
    *,
    array: Array,
    tau: float = _DEFAULT.tau,
    sigma: float = _DEFAULT.sigma,
    own_train: str = _DEFAULT.own_train,
    window: tuple[float, float] | None = _DEFAULT.window,
    step_ms: float | None = _DEFAULT.step_ms,
) -> float:
    """Return the absolute difference of two patterns smoothed in time and space, summed over taxels and time.

    The smoothing is that of `van_rossum_spatial`; the summand is ``|g_m(a) - g_m(b)|``.

    Parameters
    ----------
    a, b : SpikeTrains with one train per taxel, or several for each
        As for `van_rossum_spatial`.
    array : Array
    tau : float, ms, above 0
    sigma : float, mm, above 0
    own_train : {"twice", "once"}
        As for `van_rossum_spatial`.
    window : (start, stop), ms, optional
    step_ms : float, above 0, optional
        As for `van_rossum_absolute`.

    Returns
    -------
    float, 0 or more; ms, or a plain number with `step_ms`

    Raises
    ------
    ProblemError : another number of trains, spikes where the array has no taxel, a parameter out of range

    Notes
    -----
    Thesis 5.8 to 5.12. *Reading*: 5.12 prints ``sum over n of sqrt(g_n(a) - g_n(b))``; the square under the root and
    the sum over time are those of 5.10. Time O(spikes x taxels).

    Examples
    --------
    >>> from taxel import Array, SpikeTrains
    >>> array = Array(1, 2, pitch_mm=2.0)
    >>> a = SpikeTrains.from_lists([[10.0], []], stop=50.0)
    >>> b = SpikeTrains.from_lists([[], []], stop=50.0)
    >>> round(van_rossum_spatial_absolute(a, b, array=array), 6)
    0.947152
    """
    patterns = instance("a", a, SpikeTrains), instance("b", b, SpikeTrains)
    smoothing = {"array": array, "tau": tau, "sigma": sigma, "own_train": own_train}
    return distance("van_rossum_spatial_absolute", *patterns, {**smoothing, "window": window, "step_ms": step_ms})
