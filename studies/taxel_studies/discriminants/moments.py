"""The primal solver of `LDA`: from sums over the trials by class, and one factor of the features' covariance."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from taxel import ProblemError

__all__ = ["ClassMoments", "Primal", "blocks", "feature_table", "is_exact", "solved"]

#: Rows that are turned into floats at a time.
_ROWS = 2048
#: The largest feature, from 0: sums of squares of larger ones overflow.
_LARGEST = 1e100
#: Whole numbers up to this size are exact in float32.
_EXACT = 2**24
#: A feature with a smaller share of variance of its own counts as dependent on the others: the scatter is singular.
_SINGULAR = 1e-10
#: The pivots of all other features must lie above it; else eigenvectors decide which features are dependent.
_CLEAR = 1e-6


class ClassMoments:
    """Hold counts, sums and the scatter of trials by class: all that a linear discriminant needs.

    Moments add and subtract, so those of a training set are the whole less the fold that is tested.

    Parameters
    ----------
    classes, features : int
    dtype : {numpy.float32, numpy.float64}
        Of the scatter. float32 is exact where values are whole numbers and trials times the largest square stay below
        2^24, as with spikes of -1, 0 and 1.

    Attributes
    ----------
    counts : int64, shape (classes,)
    sums : float64, shape (classes, features)
    scatter : shape (features * (features + 1) / 2,)
        The lower triangle of the sum of x x', in LAPACK's rectangular full packed form.
    """

    def __init__(self, classes: int, features: int, dtype: type[Any] = np.float64) -> None:
        self.counts = np.zeros(classes, np.int64)
        self.sums = np.zeros((classes, features))
        self.scatter = np.zeros(features * (features + 1) // 2, dtype)

    @classmethod
    def of(
        cls,
        x: NDArray[Any],
        y: NDArray[np.int64],
        classes: int,
        *,
        rows: NDArray[np.int64] | None = None,
        dtype: type[Any] = np.float64,
        shift: NDArray[np.float64] | None = None,
    ) -> ClassMoments:
        """Sum up trials.

        Parameters
        ----------
        x : numbers, shape (trials, features)
            Any numbers; may be a memory map, which is read by blocks of rows.
        y : int64, shape (trials,)
            The number of each trial's class.
        classes : int
        rows : int64, optional
            Which trials; all where it is left out.
        dtype : {numpy.float32, numpy.float64}
        shift : float64, shape (features,), optional
            Taken off every trial, so that values far from 0 keep their digits.
        """
        moments = cls(classes, x.shape[1], dtype)
        product, pack = (
            (scipy.linalg.blas.ssyrk, scipy.linalg.lapack.strttf)
            if dtype == np.float32
            else (scipy.linalg.blas.dsyrk, scipy.linalg.lapack.dtrttf)
        )
        square = np.zeros((x.shape[1], x.shape[1]), dtype, order="F")
        for block, mine in blocks(x, rows, dtype, shift):
            square = product(1.0, block.T, beta=1.0, c=square, lower=1, overwrite_c=1)
            label = y[mine]
            moments.counts += np.bincount(label, minlength=classes)
            which = np.zeros((classes, len(label)), dtype)
            which[label, np.arange(len(label))] = 1
            moments.sums += which @ block
        moments.scatter = pack(square, uplo="L")[0]
        return moments

    def __add__(self, other: ClassMoments) -> ClassMoments:
        return self._joined(other, np.add)

    def __sub__(self, other: ClassMoments) -> ClassMoments:
        return self._joined(other, np.subtract)

    def merged(self, into: NDArray[np.int64], classes: int) -> ClassMoments:
        """Return the sums of coarser classes: class k goes into class ``into[k]``. The scatter is shared."""
        merged = ClassMoments.__new__(ClassMoments)
        merged.counts, merged.sums = np.zeros(classes, np.int64), np.zeros((classes, self.sums.shape[1]))
        np.add.at(merged.counts, into, self.counts)
        np.add.at(merged.sums, into, self.sums)
        merged.scatter = self.scatter
        return merged

    def first(self, features: int) -> ClassMoments:
        """Return the sums of the first so many features."""
        single = self.scatter.dtype == np.float32
        unpack, pack = (
            (scipy.linalg.lapack.stfttr, scipy.linalg.lapack.strttf)
            if single
            else (scipy.linalg.lapack.dtfttr, scipy.linalg.lapack.dtrttf)
        )
        square = unpack(self.sums.shape[1], self.scatter, uplo="L")[0]
        part = ClassMoments.__new__(ClassMoments)
        part.counts, part.sums = self.counts, self.sums[:, :features]
        part.scatter = pack(np.asfortranarray(square[:features, :features]), uplo="L")[0]
        return part

    def _joined(self, other: ClassMoments, how: Callable[..., Any]) -> ClassMoments:
        joined = ClassMoments.__new__(ClassMoments)
        for name in ("counts", "sums", "scatter"):
            setattr(joined, name, how(getattr(self, name), getattr(other, name)))
        return joined


class Primal(NamedTuple):
    """Discriminants of the classes, as weights of the features.

    Attributes
    ----------
    coef : float64, shape (classes, features)
    intercept : float64, shape (classes,)
        Minus infinity for a class without trials.
    rank : int
        In how many directions the covariance within classes was inverted.
    """

    coef: NDArray[np.float64]
    intercept: NDArray[np.float64]
    rank: int


def solved(moments: ClassMoments, ridge: float, shift: NDArray[np.float64] | None = None) -> Primal:
    """Return the discriminants of sums over trials from which `shift` was taken off.

    Parameters
    ----------
    moments : ClassMoments
    ridge
        As in `LDA`.
    shift : float64, shape (features,), optional

    Raises
    ------
    ProblemError : one class, not more trials than classes, or no feature that varies
    """
    there = moments.counts > 0
    counts = moments.counts[there]
    trials = int(counts.sum())
    if len(counts) < 2 or trials <= len(counts):
        raise ProblemError(f"{trials} trials of {len(counts)} classes: must be of two classes, and more than classes")
    means, centre = moments.sums[there] / counts[:, None], moments.sums.sum(0) / trials
    within, squares = _within(moments)
    # What rounding alone leaves of a feature's sum of squares is no variance.
    rounding = 1e-13 * squares
    varying = squares - trials * centre**2 > rounding
    if not varying.any():
        raise ProblemError("x: no feature varies")
    variance = np.where(within.diagonal() > rounding, within.diagonal(), 0.0)
    variance += ridge * variance[varying].mean()
    # A feature that varies between classes alone cannot be weighed: left out, as scikit-learn's svd does.
    weighed = varying & (variance > 0)
    scale = np.divide(1.0, np.sqrt(variance), out=np.zeros_like(variance), where=weighed)
    right = np.asfortranarray(((means - centre) * scale).T)
    factor, fault = scipy.linalg.lapack.dpotrf(_scaled(within, scale), lower=1, clean=0, overwrite_a=1)
    rank = int(weighed.sum())
    if fault == 0 and factor.diagonal().min() ** 2 > _SINGULAR:
        values = scipy.linalg.lapack.dpotrs(factor, right, lower=1)[0]
    else:
        # dpotrf overwrote the matrix by its factor, so the matrix is computed again.
        del factor, within
        values, rank = _where_classes_vary(_scaled(_within(moments)[0], scale), weighed, right)
    weights = values.T * scale * trials
    coef = np.zeros((len(there), weights.shape[1]))
    intercept = np.full(len(there), -np.inf)
    coef[there] = weights
    off = centre if shift is None else centre + shift
    intercept[there] = -(weights * (means - centre)).sum(1) / 2 - weights @ off + np.log(counts / trials)
    return Primal(coef, intercept, rank)


def _within(moments: ClassMoments) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the scatter within classes (lower triangle), and the sum of squares of each feature."""
    square = scipy.linalg.lapack.dtfttr(moments.sums.shape[1], moments.scatter.astype(np.float64), uplo="L")[0]
    squares = square.diagonal().copy()
    there = moments.counts > 0
    rooted = np.asfortranarray((moments.sums[there] / np.sqrt(moments.counts[there, None])).T)
    return scipy.linalg.blas.dsyrk(-1.0, rooted, beta=1.0, c=square, lower=1, overwrite_c=1), squares


def _scaled(square: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale a lower triangle in place to a diagonal of 1; features of scale 0 stand alone."""
    for j, factor in enumerate(scale):
        square[j + 1 :, j] *= scale[j + 1 :] * factor
    np.fill_diagonal(square, 1.0)
    return square


def _where_classes_vary(
    square: NDArray[np.float64], weighed: NDArray[np.bool_], right: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    """Solve by the pseudo-inverse of a singular scatter (lower triangle), and return in how many directions.

    Spikes of an array are exactly dependent: one factor with pivots finds which (in a tenth of an eigendecomposition's
    time). Where the rank is not clear, eigenvectors decide.
    """
    where = np.flatnonzero(weighed)
    square = np.asfortranarray(square[np.ix_(where, where)])
    solution = _by_pivots(square, right[where])
    values, rank = _by_eigenvectors(square, right[where]) if solution is None else solution
    solved = np.zeros_like(right)
    solved[where] = values
    return solved, rank


def _by_pivots(square: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[NDArray[np.float64], int] | None:
    """Solve by a Cholesky factor with pivots and the null space that it gives; None where the rank is not clear.

    With features in the order of pivots the factor is [L1; L2], and the columns of [-inv(L1') L2'; 1] span the
    directions in which no class varies. What lies in these is taken off the right side and off a solution.
    """
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(square, tol=_SINGULAR, lower=1)
    if rank == len(square) or factor[rank - 1, rank - 1] ** 2 < _CLEAR:
        return None
    order = pivots - 1
    upper = np.asfortranarray(factor[:rank, :rank])
    dependence = -scipy.linalg.blas.dtrsm(1.0, upper, np.asfortranarray(factor[rank:, :rank].T), lower=1, trans_a=1)
    gram, fault = scipy.linalg.lapack.dpotrf(np.eye(dependence.shape[1]) + dependence.T @ dependence, lower=1)
    if fault != 0:
        return None

    def without_dependence(values: NDArray[np.float64]) -> NDArray[np.float64]:
        along = scipy.linalg.lapack.dpotrs(gram, dependence.T @ values[:rank] + values[rank:], lower=1)[0]
        return np.concatenate((values[:rank] - dependence @ along, values[rank:] - along))

    basic = np.zeros_like(right)
    basic[:rank] = scipy.linalg.lapack.dpotrs(upper, without_dependence(right[order])[:rank], lower=1)[0]
    solved = np.empty_like(right)
    solved[order] = without_dependence(basic)
    return solved, int(rank)


def _by_eigenvectors(square: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Solve by the directions in which classes vary at all, to a relative cut of 1e-10."""
    values, vectors = scipy.linalg.eigh(square, lower=True)
    varying = values > _SINGULAR * values[-1]
    vectors = vectors[:, varying]
    return vectors @ ((vectors.T @ right) / values[varying, None]), int(varying.sum())


def is_exact(table: NDArray[Any]) -> bool:
    """Return whether sums of products of these trials are exact in float32."""
    if table.dtype.kind not in "biu":
        return False
    largest = max(
        max(abs(int(part.min())), abs(int(part.max())))
        for part in (table[k : k + _ROWS] for k in range(0, len(table), _ROWS))
    )
    return largest**2 * len(table) <= _EXACT


def blocks(
    table: NDArray[Any], rows: NDArray[np.int64] | None, dtype: type[Any], shift: NDArray[np.float64] | None
) -> Iterator[tuple[NDArray[Any], NDArray[np.int64]]]:
    """Give trials as floats, some at a time, with their numbers."""
    every = np.arange(len(table)) if rows is None else rows
    for first in range(0, len(every), _ROWS):
        mine = every[first : first + _ROWS]
        run = len(mine) and mine[-1] - mine[0] + 1 == len(mine)
        part = table[mine[0] : mine[-1] + 1] if run else table[mine]
        block = np.ascontiguousarray(part, dtype)
        yield (block if shift is None else block - shift), mine


def feature_table(x: ArrayLike) -> NDArray[Any]:
    """Return trials by features.

    Raises
    ------
    ProblemError : a value that is not finite, or whose square overflows
    """
    table = np.asarray(x)
    if table.dtype.kind == "f":
        for first in range(0, len(table), _ROWS):
            wrong = np.argwhere(~(np.abs(table[first : first + _ROWS]) <= _LARGEST))
            if len(wrong):
                raise ProblemError(f"x[{first + wrong[0][0]}, {wrong[0][1]}] is not finite, or beyond {_LARGEST:g}")
    return table
