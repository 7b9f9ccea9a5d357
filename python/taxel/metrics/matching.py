"""Spikes against targets: found, missed, false."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import floats, number, several
from taxel._base.errors import refused
from taxel._base.parameters import defaults

_DEFAULT = defaults("matching")


class Matching(NamedTuple):
    """Hold how spikes match targets, over all patterns.

    Parameters
    ----------
    found, missed, false : int, 0 or more
        Number of targets with a matched spike, of targets without, and of spikes without a target.
    errors_ms : float64, shape (found,), ms
        Spike minus target; negative for an early spike.

    Examples
    --------
    >>> Matching(found=3, missed=1, false=0, errors_ms=np.array([0.1, 0.0, -0.2])).f1
    0.8571428571428571
    """

    found: int
    missed: int
    false: int
    errors_ms: NDArray[np.float64]

    @property
    def f1(self) -> float:
        """Twice the number of targets found, divided by the number of targets and spikes; 1 without either."""
        events = 2 * self.found + self.missed + self.false
        return 2 * self.found / events if events else 1.0


def matching(
    spikes: Sequence[ArrayLike], targets: Sequence[ArrayLike], *, window_ms: float = _DEFAULT.window_ms
) -> Matching:
    """Match spikes with targets, pattern by pattern.

    The matching has as many pairs as the window allows, one spike a target, in the order of time; among the matchings
    of that size it has the least sum of distances. Times are compared with a resolution of 1 ns.

    Parameters
    ----------
    spikes, targets : sequence of float sequences, ms, ascending
        One list a pattern.
    window_ms : float, ms, from 0 to 3.6e6
        Largest distance of a spike from its target, in either direction.

    Returns
    -------
    Matching

    Raises
    ------
    ProblemError : not equally many patterns, times that do not ascend, or an invalid window

    Notes
    -----
    The window is that of thesis 6.5.2; here every unmatched spike is false, near a target or not. `taxel.detect.score`
    uses the same matching.

    Examples
    --------
    >>> found = matching([[10.0, 95.0]], [[12.0, 200.0]])
    >>> found.found, found.missed, found.false, found.errors_ms, found.f1
    (1, 1, 1, array([-2.]), 0.5)
    """
    fired = [floats(f"spikes[{p}]", times) for p, times in enumerate(several("spikes", spikes))]
    target_times = [floats(f"targets[{p}]", times) for p, times in enumerate(several("targets", targets))]
    if len(fired) != len(target_times):
        raise refused("targets", f": {len(target_times)} lists for {len(fired)} patterns; must be one per pattern")
    pairs = _core.match_spikes(fired, target_times, number("window_ms", window_ms))
    errors = [fired[p][j] - target_times[p][i] for p, matched in enumerate(pairs) for j, i in matched]
    matched = len(errors)
    return Matching(
        matched, sum(map(len, target_times)) - matched, sum(map(len, fired)) - matched, np.array(errors, np.float64)
    )


def f1(spikes: Sequence[ArrayLike], targets: Sequence[ArrayLike], *, window_ms: float = _DEFAULT.window_ms) -> float:
    """Return F1 of spikes against targets: the harmonic mean of how many targets are found and how many spikes right.

    Parameters
    ----------
    spikes, targets : sequence of float sequences, ms, ascending
    window_ms : float, ms, from 0 to 3.6e6
        As in `matching`.

    Returns
    -------
    float, 0 to 1
        1 if there is neither a target nor a spike.

    Raises
    ------
    ProblemError : as `matching`

    Examples
    --------
    >>> f1([[10.0, 95.0], []], [[12.0, 200.0], []])
    0.5
    """
    return matching(spikes, targets, window_ms=window_ms).f1
