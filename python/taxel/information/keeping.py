"""Whether a cheaper setting keeps enough of the bits of a dearer one: keeps, open, loses, nothing to keep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # its modules load when they are first used
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, number, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.information._labels import belonging
from taxel.information.estimate import Estimate

__all__ = ["Keeping", "keeps"]

#: Confidence of each verdict's one-sided bound.
CONFIDENCE = 0.9


@dataclass(frozen=True)
class Keeping:
    """State whether a setting keeps a share of another setting's bits.

    Attributes
    ----------
    says : {"keeps", "open", "loses", "nothing"}
        "nothing": the other setting's bits are not above 0, so that there is nothing to keep.
    margin : float, bits
        Its bits minus the share of the other setting's bits.
    error : float, bits
        Standard error of the margin, from pairs of trials or groups.
    """

    says: str
    margin: float
    error: float

    def __str__(self) -> str:
        return "nothing to keep" if self.says == "nothing" else self.says


def keeps(cheap: Estimate, dear: Estimate, *, share: float = 0.95, groups: ArrayLike | None = None) -> Keeping:
    """Judge whether a setting keeps a share of another setting's bits, on the same trials.

    Parameters
    ----------
    cheap, dear : Estimate
        Of the same trials, in the same order.
    share : float, between 0 and 1
    groups : labels, shape (trials,), optional
        If given, pairs are means of groups.

    Returns
    -------
    Keeping

    Raises
    ------
    ProblemError : estimates of other trials, or a share that is invalid

    Notes
    -----
    d = i_cheap - share * i_dear by trial, i being log2 p(response | label) / p(response); bounds at 90 %, one-sided, by
    Student's t; i_dear itself is tested against 0 in the same way. Near the edge the rule "within one standard error"
    takes too cheap a setting in 44 to 70 % of simulated cases, this rule in at most 13 % (with 40 trials a label or
    more); it leaves many open instead.

    Examples
    --------
    >>> from taxel.information import estimate
    >>> labels = ["ball", "edge"] * 40
    >>> every, some = estimate(labels, labels), estimate(labels, ["ball"] * 80)
    >>> str(keeps(every, every)), str(keeps(some, every))
    ('keeps', 'loses')
    """
    a, b = instance("cheap", cheap, Estimate).local, instance("dear", dear, Estimate).local
    part = number("share", share)
    if not 0 < part < 1:
        raise refused("share", f" is {shown(share)}: must be between 0 and 1")
    if len(a) != len(b):
        raise ProblemError(f"estimates of {len(a)} and {len(b)} trials: must be of the same trials")
    belongs = np.arange(len(a)) if groups is None else belonging(groups, len(a))

    def error_of(by_trial: NDArray[np.float64]) -> float:
        units = np.bincount(belongs, by_trial) / np.bincount(belongs)
        return float(units.std(ddof=1) / np.sqrt(len(units))) if len(units) > 1 else np.inf

    margin, error = cheap.bits - part * dear.bits, error_of(a - part * b)
    reach = float(scipy.special.stdtrit(max(1, len(np.unique(belongs)) - 1), CONFIDENCE))
    above = reach * error_of(b)
    if np.isfinite(above) and dear.bits <= above:
        return Keeping("nothing", margin, error)
    if margin > reach * error:
        return Keeping("keeps", margin, error)
    if margin < -reach * error:
        return Keeping("loses", margin, error)
    return Keeping("open", margin, error)
