"""Matrices of distances."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import callback, integer
from taxel.metrics._metric import Pattern, listed, stated
from taxel.spikes import SpikeTrains


def pairwise(
    metric: str,
    a: SpikeTrains | Sequence[Pattern],
    b: SpikeTrains | Sequence[Pattern] | None = None,
    *,
    threads: int | None = None,
    progress: Callable[[int, int], object] | None = None,
    **parameters: Any,
) -> NDArray[np.float64]:
    """Return the distances of all patterns of `a` from all of `b`, or from each other.

    Parameters
    ----------
    metric : str
        The name of a function of `taxel.metrics`, such as ``"victor_purpura"``.
    a, b : sequence of SpikeTrains, sequence of float sequences (ms), or one SpikeTrains
        The patterns, equally many trains in each; or single trains, those of one SpikeTrains. Without `b` those of `a`
        are compared with each other.
    threads : int, 1 or more, optional
        Default: all cores. The distances do not depend on it.
    progress : function of (done, all), optional
        Called regularly with the number of pairs done and of all pairs.
    **parameters
        Parameters of the metric.

    Returns
    -------
    float64, shape (patterns of `a`, patterns of `b`)
        Entry i, j is the metric of ``a[i]`` and ``b[j]``, within rounding. Without `b` the matrix is symmetric, and 0
        on the diagonal.

    Raises
    ------
    ProblemError : no such metric, or invalid parameters or patterns (names pattern, train and spike)
    KeyboardInterrupt : Ctrl-C, within a fraction of a second

    Examples
    --------
    >>> pairwise("victor_purpura", [[10.0], [12.0], []], q=0.1).round(6).tolist()
    [[0.0, 0.2, 1.0], [0.2, 0.0, 1.0], [1.0, 1.0, 0.0]]
    """
    stating = stated(metric, parameters)
    rows, columns = listed(metric, "a", a), None if b is None else listed(metric, "b", b)
    count = None if threads is None else integer("threads", threads, 1, 4096)
    if progress is not None:
        callback("progress", progress)
    distances = _core.pairwise(stating, rows, columns, count, progress)
    return distances.reshape(rows.patterns, (columns or rows).patterns)
