"""Mutual information of a table of counts, in bits: as counted, and corrected for the small number of trials.

A table holds how often each response was given to each label: a row is a label, a column a response. Every function
takes one table or a stack of them, and all trials count alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import numbers, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.information._labels import words

__all__ = [
    "confusion_matrix",
    "corrected",
    "label_entropy",
    "local_information",
    "panzeri_treves",
    "plug_in",
    "relevant_responses",
]


def confusion_matrix(
    labels: ArrayLike, responses: ArrayLike, classes: ArrayLike | None = None
) -> tuple[NDArray[np.int64], NDArray[np.generic]]:
    """Count how often each response was given to each label.

    Parameters
    ----------
    labels, responses : labels, shape (trials,)
        Of any kind that can be compared: numbers or texts.
    classes : labels, shape (classes,), optional
        The order of rows and columns. Default: all labels and responses, sorted.

    Returns
    -------
    counts : int64, shape (classes, classes)
        Row: the label; column: the response.
    classes : labels, shape (classes,)

    Raises
    ------
    ProblemError : no trials, unequal lengths, or an entry that is in no class

    Examples
    --------
    >>> counts, classes = confusion_matrix(["ball", "edge", "edge"], ["ball", "ball", "edge"])
    >>> counts.tolist(), classes.tolist()
    ([[1, 0], [1, 1]], ['ball', 'edge'])
    """
    truth, answered = words("labels", labels), words("responses", responses)
    if len(truth) != len(answered):
        raise refused("responses", f" has {len(answered)} entries: must be {len(truth)}, one per label")
    if not len(truth):
        raise refused("labels", " is []: must contain at least one trial")
    try:
        known = np.unique(np.concatenate([truth, answered]))
        order = known if classes is None else words("classes", classes)
    except TypeError:
        raise ProblemError("labels and responses are of two kinds: must both be texts, or both numbers") from None
    if len(np.unique(order)) != len(order):
        raise refused("classes", " names a response twice")
    missing = np.setdiff1d(known, order)
    if len(missing):
        raise refused("classes", f" does not name {shown(missing[0].item())}")
    rank = np.argsort(order)
    row, column = (rank[np.searchsorted(order[rank], x)] for x in (truth, answered))
    counts = np.zeros((len(order), len(order)), np.int64)
    np.add.at(counts, (row, column), 1)
    return counts, order


def label_entropy(counts: ArrayLike) -> NDArray[np.float64] | np.float64:
    """Return the labels' entropy in bits: the most information that any response can give.

    Parameters
    ----------
    counts : int, shape (..., labels, responses), 0 or more

    Returns
    -------
    float64, shape (...), bits

    Raises
    ------
    ProblemError : counts that are invalid

    Examples
    --------
    >>> float(label_entropy([[5, 5], [0, 10]]))
    1.0
    """
    return _entropy(_table(counts).sum(-1))


def plug_in(counts: ArrayLike) -> NDArray[np.float64] | np.float64:
    """Return the mutual information of label and response as counted, in bits: too high where trials are few.

    Parameters
    ----------
    counts : int, shape (..., labels, responses), 0 or more

    Returns
    -------
    float64, shape (...), bits

    Raises
    ------
    ProblemError : counts that are invalid

    Notes
    -----
    Thesis 4.1 and 5.6. Two labels that are always taken for each other keep their information.

    Examples
    --------
    >>> float(plug_in([[0, 10], [10, 0]]))
    1.0
    """
    table = _table(counts)
    flat = table.reshape(*table.shape[:-2], -1)
    bits = _entropy(table.sum(-1)) + _entropy(table.sum(-2)) - _entropy(flat)
    return np.maximum(bits, 0.0)


def relevant_responses(counts: ArrayLike) -> NDArray[np.int64]:
    """Return for each row how many of its responses can occur, by the Bayesian count of Panzeri and Treves.

    The responses that occurred are too few, and all columns are often too many. The count is the number of possible
    responses for which, after so many trials, the expected number of responses seen is the number that was seen.

    Parameters
    ----------
    counts : int, shape (..., responses), 0 or more

    Returns
    -------
    int64, shape (...)
        From the number of responses that occurred to the number of columns.

    Raises
    ------
    ProblemError : counts that are invalid

    Notes
    -----
    Panzeri and Treves (1996), Network 7:87. A response that did not occur has a share gamma of the probability, set so
    that with Laplace's rule over those that did occur the sum is 1.

    Examples
    --------
    >>> relevant_responses([[40, 5, 3, 1, 1, 0, 0, 0], [50, 0, 0, 0, 0, 0, 0, 0]]).tolist()
    [8, 1]
    """
    table = _counts(counts)
    return _relevant(table.reshape(-1, table.shape[-1])).reshape(table.shape[:-1])


def _relevant(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    trials, seen = rows.sum(-1), (rows > 0).sum(-1)
    count, most = seen.copy(), rows.shape[-1]
    share = rows / np.maximum(trials, 1)[:, None]
    off = np.abs(seen - _once(share, trials[:, None]).sum(-1))
    rising = np.flatnonzero((seen < most) & (trials > 0))
    for extra in range(1, most):
        rising = rising[seen[rising] + extra <= most]
        if not len(rising):
            break
        n, r = trials[rising, None], seen[rising, None]
        # The `extra` responses that did not occur share the probability gamma.
        gamma = extra * -np.expm1(np.log(n / (n + r)) / n)
        came = np.where(rows[rising] > 0, (1 - gamma) / (n + r) * (rows[rising] + 1), 0.0)
        expected = _once(came, n).sum(-1) + extra * _once(gamma / extra, n)[:, 0]
        now = np.abs(seen[rising] - expected)
        nearer = now < off[rising]
        rising = rising[nearer]
        off[rising], count[rising] = now[nearer], seen[rising] + extra
    return np.asarray(count)


def panzeri_treves(counts: ArrayLike) -> NDArray[np.float64] | np.float64:
    """Return the mutual information in bits, corrected for the number of trials, within 0 and the labels' entropy.

    Parameters
    ----------
    counts : int, shape (..., labels, responses), 0 or more

    Returns
    -------
    float64, shape (...), bits

    Raises
    ------
    ProblemError : counts that are invalid

    Notes
    -----
    Panzeri and Treves (1996), Network 7:87: the bias of counting is, to first order, (sum over labels of (R_s - 1) -
    (R - 1)) / (2 N ln 2), R_s and R by `relevant_responses`. Where errors spread over all other labels it still reads
    high below some 7 trials a label and response; see `Estimate.warnings`.

    Examples
    --------
    >>> round(float(plug_in([[8, 2], [3, 7]])), 3), round(float(panzeri_treves([[8, 2], [3, 7]])), 3)
    (0.191, 0.155)
    """
    table = _table(counts)
    return np.asarray(np.clip(corrected(table), 0.0, label_entropy(table)))


def corrected(counts: ArrayLike) -> NDArray[np.float64]:
    """Return the corrected information in bits as `panzeri_treves` does, but not held within 0 and the labels' entropy.

    Parameters
    ----------
    counts : int, shape (..., labels, responses), 0 or more

    Returns
    -------
    float64, shape (...), bits

    Raises
    ------
    ProblemError : counts that are invalid
    """
    table = _table(counts)
    trials = table.sum((-1, -2))
    by_label = table.sum(-1)
    occupied = np.where(by_label > 0, relevant_responses(table) - 1, 0).sum(-1)
    bias = (occupied - (relevant_responses(table.sum(-2)) - 1)) / (2 * trials * np.log(2))
    return np.asarray(plug_in(table) - bias)


def local_information(counts: ArrayLike) -> NDArray[np.float64]:
    """Return log2 p(response | label) / p(response) of each cell, in bits: its mean over trials is `plug_in`.

    Parameters
    ----------
    counts : int, shape (..., labels, responses), 0 or more

    Returns
    -------
    float64, the shape of `counts`; 0 in cells that no trial is in

    Raises
    ------
    ProblemError : counts that are invalid

    Examples
    --------
    >>> local_information([[4, 0], [0, 4]])[0, 0]
    np.float64(1.0)
    """
    table = _table(counts).astype(np.float64)
    total = table.sum((-1, -2), keepdims=True)
    expected = table.sum(-1, keepdims=True) * table.sum(-2, keepdims=True)
    return np.asarray(np.log2(np.divide(table * total, expected, out=np.ones_like(table), where=table > 0)))


def _once(p: NDArray[np.float64], trials: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how probable it is to occur at least once."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(trials * np.log1p(-np.clip(p, 0.0, 1.0))))


def _entropy(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    p = counts / np.maximum(counts.sum(-1, keepdims=True), 1)
    return np.asarray(0.0 - (p * np.log2(np.where(p > 0, p, 1.0))).sum(-1))


def _counts(counts: ArrayLike) -> NDArray[np.int64]:
    table: NDArray[np.int64] = numbers("counts", counts, np.int64)
    if table.ndim < 1 or 0 in table.shape:
        raise refused("counts", f" has shape {table.shape}: must contain at least one response")
    if table.min() < 0 or table.max() > 2**40:
        raise refused("counts", f" contains numbers from {table.min()} to {table.max()}: must be from 0 to 2^40")
    return table


def _table(counts: ArrayLike) -> NDArray[np.int64]:
    table = _counts(counts)
    if table.ndim < 2:
        raise refused("counts", f" has shape {table.shape}: must be (labels, responses)")
    if (table.sum((-1, -2)) == 0).any():
        raise refused("counts", " contains no trial")
    return table
