"""Mutual information of a table of counts, in bits: as counted, and corrected for the small number of trials.

A table holds how often each response was given to each label: a row is a label, a column a response. Every function
takes one table or a stack of them, and all trials count alike.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import integer, numbers, shown
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
    "quadratic_extrapolation",
    "relevant_responses",
]

#: Cells that one call of NumPy works on: Ctrl-C is answered between calls.
_AT_ONCE = 1 << 20


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
    rows = table.reshape(-1, table.shape[-1])
    relevant = np.empty(len(rows), np.int64)
    for block in _blocks(*rows.shape):
        relevant[block] = _relevant(rows[block])
    return np.asarray(relevant.reshape(table.shape[:-1]))


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


def quadratic_extrapolation(counts: ArrayLike, *, repetitions: int = 20, seed: int = 0) -> float:
    """Return the mutual information in bits, extrapolated from half and a quarter of the trials to endlessly many.

    This is a second estimate beside `panzeri_treves`. Their agreement does not prove them right: both err alike where
    trials are few.

    Parameters
    ----------
    counts : int, shape (labels, responses), 0 or more
    repetitions : int, 1 or more
        Number of times the trials are dealt out.
    seed : int, 0 or more

    Returns
    -------
    float, bits, within 0 and the labels' entropy

    Raises
    ------
    ProblemError : invalid counts, or fewer than four trials

    Notes
    -----
    Strong et al. (1998), Phys. Rev. Lett. 80:197: the parabola in 1/N through the means at N, N/2 and N/4 trials.
    Parts are dealt out of the answers, so the method does not see that a classifier is worse with fewer trials.

    Examples
    --------
    >>> round(quadratic_extrapolation([[80, 20], [30, 70]]), 2)
    0.19
    """
    table = _table(counts)
    if table.ndim != 2:
        raise refused("counts", f" has shape {table.shape}: must be (labels, responses)")
    rounds, random = integer("repetitions", repetitions, 1), np.random.default_rng(integer("seed", seed, 0))
    trials = int(table.sum())
    if trials < 4:
        raise refused(
            "counts", f" contains {trials} trials: must contain at least 4, because they are divided into four parts"
        )
    cells = np.repeat(np.arange(table.size), table.ravel())
    means = [float(plug_in(table))]
    for parts in (2, 4):
        ends = np.linspace(0, trials, parts + 1).astype(int)
        tables = []
        for _ in range(rounds):
            dealt = random.permutation(cells)
            tables += [np.bincount(dealt[a:b], minlength=table.size) for a, b in pairwise(ends)]
        means.append(float(np.mean(plug_in(np.reshape(tables, (-1, *table.shape))))))
    # The value at 0 of the parabola through (1, whole), (2, half) and (4, quarter), in units of 1/N.
    at_zero = (8 * means[0] - 6 * means[1] + means[2]) / 3
    return float(np.clip(at_zero, 0.0, label_entropy(table)))


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
    bits = np.zeros_like(table)
    flat = [np.broadcast_to(x, table.shape).reshape(-1, table.shape[-1]) for x in (table, total, expected)]
    for block in _blocks(*flat[0].shape):
        here, block_total, even = (x[block] for x in flat)
        ratio = np.divide(here * block_total, even, out=np.ones_like(here), where=here > 0)
        bits.reshape(-1, table.shape[-1])[block] = np.log2(ratio)
    return np.asarray(bits)


def _once(p: NDArray[np.float64], trials: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return how probable it is to occur at least once."""
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(trials * np.log1p(-np.clip(p, 0.0, 1.0))))


def _entropy(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    rows = counts.reshape(-1, counts.shape[-1])
    total, entropy = np.maximum(rows.sum(-1, keepdims=True), 1), np.zeros(len(rows))
    for block in _blocks(*rows.shape):
        for part in _blocks(rows.shape[1], 1):
            p = rows[block, part] / total[block]
            entropy[block] -= (p * np.log2(np.where(p > 0, p, 1.0))).sum(-1)
    return np.asarray(entropy.reshape(counts.shape[:-1]) + 0.0)


def _blocks(rows: int, columns: int) -> list[slice]:
    """Return the rows of a table as slices of about `_AT_ONCE` cells."""
    step = max(1, _AT_ONCE // max(1, columns))
    return [slice(first, first + step) for first in range(0, rows, step)]


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
