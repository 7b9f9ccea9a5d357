"""Linear discriminants by sums over the trials: of one training set (`LDA`), and of all folds but one (`FoldSums`)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple, Self

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from taxel import ProblemError

#: Rows that are turned into floats at a time.
_ROWS = 2048
#: Whole numbers up to this size are exact in float32.
_EXACT = 2**24
#: A feature with a smaller share of variance of its own counts as dependent on the others: the scatter is singular.
_SINGULAR = 1e-10
#: The pivots of all other features must lie above it; else eigenvectors decide which features are dependent.
_CLEAR = 1e-6
#: Number of features from which several threads are used: NumPy and SciPy have a pool each, and while one computes the
#: threads of the other spin. At 1000 features two threads take twice as long as one.
_WORTH_THREADS = 2500


class _Moments(NamedTuple):
    """Counts and sums of trials by class, and the sum of x x': those of a training set are the whole less a fold."""

    counts: NDArray[np.int64]
    sums: NDArray[np.float64]
    scatter: NDArray[Any]

    def joined(self, other: _Moments, how: Callable[[Any, Any], Any]) -> _Moments:
        return _Moments(*map(how, self, other))


def _moments(
    x: NDArray[Any],
    y: NDArray[np.int64],
    classes: int,
    shift: NDArray[np.float64] | None,
    rows: NDArray[np.int64] | None = None,
) -> _Moments:
    """Sum up trials, less a shift that keeps the digits of values far from 0; whole numbers exactly without one."""
    dtype = np.float32 if shift is None else np.float64
    counts, sums = np.zeros(classes, np.int64), np.zeros((classes, x.shape[1]))
    scatter = np.zeros((x.shape[1], x.shape[1]), dtype)
    every = np.arange(len(x)) if rows is None else rows
    for first in range(0, len(every), _ROWS):
        mine = every[first : first + _ROWS]
        block: NDArray[Any] = x[mine].astype(dtype) if shift is None else x[mine] - shift
        which: NDArray[Any] = np.zeros((classes, len(mine)), dtype)
        which[y[mine], np.arange(len(mine))] = 1
        counts += np.bincount(y[mine], minlength=classes)
        sums += which @ block
        scatter += block.T @ block
    return _Moments(counts, sums, scatter)


@dataclass
class LDA:
    """Classify by linear discriminant analysis: classes with a mean each and one covariance.

    Parameters
    ----------
    ridge : float, 0 or more
        Added to the diagonal of the covariance within classes, in units of its mean variance over features that vary.

    Attributes
    ----------
    classes_ : shape (classes,)
    coef_ : float64, shape (classes, features)
    intercept_ : float64, shape (classes,)
        Minus infinity for a class without trials.
    rank_ : int
        In how many directions the covariance within classes was inverted. Less than the features that vary where
        these are linearly dependent (or trials are fewer): directions in which no class varies are left out, as by
        scikit-learn's `svd`.

    Notes
    -----
    The covariance is the scatter over the trials, and discriminants equal those of scikit-learn's
    ``LinearDiscriminantAnalysis``.

    Examples
    --------
    >>> x = [[0.0, 1.0], [1.0, 0.2], [0.5, 0.4], [3.0, 2.0], [4.0, 2.5], [3.5, 3.0]]
    >>> LDA().fit(x, ["ball"] * 3 + ["edge"] * 3).predict([[0.2, 0.5], [3.4, 2.0]])
    array(['ball', 'edge'], dtype='<U4')
    """

    ridge: float = 0.0
    classes_: NDArray[Any] = field(init=False, repr=False)
    coef_: NDArray[np.float64] = field(init=False, repr=False)
    intercept_: NDArray[np.float64] = field(init=False, repr=False)
    rank_: int = field(init=False, repr=False)

    def fit(self, x: ArrayLike, y: ArrayLike) -> Self:
        """Learn from trials by features, and a label a trial.

        Raises
        ------
        ProblemError : values that are not finite, one class, or no feature that varies
        """
        table = np.asarray(x)
        if not np.isfinite(table).all():
            raise ProblemError("x: must be finite")
        self.classes_, row = np.unique(np.asarray(y), return_inverse=True)
        shift = table.mean(0, dtype=np.float64)
        return self.fit_moments(_moments(table, row, len(self.classes_), shift), shift)

    def fit_moments(self, moments: _Moments, shift: NDArray[np.float64] | None) -> Self:
        """Learn from sums over trials from which `shift` was taken off; `classes_` is the caller's to set."""
        there = moments.counts > 0
        counts, sums = moments.counts[there], moments.sums[there]
        trials = int(counts.sum())
        if len(counts) < 2 or trials <= len(counts):
            raise ProblemError(f"{trials} trials of {len(counts)} classes: must be of two classes, more than classes")
        means, centre = sums / counts[:, None], moments.sums.sum(0) / trials
        rooted = sums / np.sqrt(counts[:, None])
        within = moments.scatter.astype(np.float64) - rooted.T @ rooted
        # What rounding alone leaves of a feature's sum of squares is no variance.
        squares = moments.scatter.diagonal().astype(np.float64)
        rounding = 1e-13 * squares
        varying = squares - trials * centre**2 > rounding
        if not varying.any():
            raise ProblemError("x: no feature varies")
        variance = np.where(within.diagonal() > rounding, within.diagonal(), 0.0)
        variance += self.ridge * variance[varying].mean()
        # A feature that varies between classes alone cannot be weighed: left out, as scikit-learn's svd does.
        weighed = np.flatnonzero(varying & (variance > 0))
        scale = 1 / np.sqrt(variance[weighed])
        square = within[np.ix_(weighed, weighed)] * scale[:, None] * scale
        np.fill_diagonal(square, 1.0)
        values, self.rank_ = _solved(square, ((means - centre)[:, weighed] * scale).T)
        self.coef_, self.intercept_ = np.zeros(moments.sums.shape), np.full(len(there), -np.inf)
        weights = np.zeros_like(means)
        weights[:, weighed] = values.T * scale * trials
        self.coef_[there] = weights
        off = centre if shift is None else centre + shift
        self.intercept_[there] = -(weights * (means - centre)).sum(1) / 2 - weights @ off + np.log(counts / trials)
        return self

    def decision_function(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return each class' discriminant, shape (trials, classes): its log probability, but for a constant a trial."""
        return np.asarray(np.asarray(x, np.float64) @ self.coef_.T + self.intercept_)

    def predict(self, x: ArrayLike) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial."""
        return np.asarray(self.classes_[self.decision_function(x).argmax(1)])


def _solved(square: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Solve by a scatter of unit diagonal, or its pseudo-inverse, and return in how many directions.

    Spikes of an array are exactly dependent: one factor with pivots finds which (in a tenth of an eigendecomposition's
    time). Where the rank is not clear, eigenvectors decide, to a relative cut of 1e-10.
    """
    factor, fault = scipy.linalg.lapack.dpotrf(square, lower=1)
    if fault == 0 and factor.diagonal().min() ** 2 > _SINGULAR:
        return scipy.linalg.cho_solve((factor, True), right), len(square)
    factor, pivots, rank, _ = scipy.linalg.lapack.dpstrf(square, tol=_SINGULAR, lower=1)
    if rank == len(square) or factor[rank - 1, rank - 1] ** 2 < _CLEAR:
        values, vectors = scipy.linalg.eigh(square)
        vectors = vectors[:, values > _SINGULAR * values[-1]]
        return vectors @ ((vectors.T @ right) / values[-vectors.shape[1] :, None]), vectors.shape[1]
    # With features in the order of pivots the factor is [L1; L2], and the columns of [-inv(L1') L2'; 1] span the
    # directions in which no class varies. What lies in these is taken off the right side and off a solution.
    lower = factor[:rank, :rank]
    null = np.concatenate(
        [-scipy.linalg.solve_triangular(lower, factor[rank:, :rank].T, lower=True, trans=1), np.eye(len(square) - rank)]
    )
    null = scipy.linalg.qr(null, mode="economic")[0]
    values = right[pivots - 1] - null @ (null.T @ right[pivots - 1])
    basic = np.zeros_like(right)
    basic[:rank] = scipy.linalg.cho_solve((lower, True), values[:rank])
    found = np.empty_like(right)
    found[pivots - 1] = basic - null @ (null.T @ basic)
    return found, int(rank)


class FoldSums:
    """Hold trials summed up by fold and class, so that many questions about the same trials share the sums.

    Parameters
    ----------
    x : numbers, shape (trials, features)
        More trials than features. int8 for spikes; may be a memory map (``numpy.load(..., mmap_mode="r")``).
    y : labels, shape (trials,)
    folds : int, shape (trials,), from 0 on
        The fold in which each trial is tested, as `taxel.information.folds` gives it.

    Attributes
    ----------
    classes : labels, shape (classes,)
    folds : int, shape (trials,)

    Notes
    -----
    Every fold's scatter stays in memory, ``folds * features ** 2`` numbers. Exact: whole numbers whose squares sum up
    below 2^24 are summed in float32 without rounding, all else in float64.

    Examples
    --------
    >>> x = [[0.0, 1.0], [1.0, 0.2], [0.5, 0.4], [0.4, 0.9], [3.0, 2.0], [4.0, 2.5], [3.5, 3.0], [3.1, 2.2]]
    >>> sums = FoldSums(x, ["ball", "ball", "edge", "edge", "rod", "rod", "pin", "pin"], [0, 1] * 4)
    >>> sums.predictions(merge={"ball": "soft", "edge": "soft", "rod": "hard", "pin": "hard"}).tolist()
    ['soft', 'soft', 'soft', 'soft', 'hard', 'hard', 'hard', 'hard']
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, folds: ArrayLike) -> None:
        self._table = np.asarray(x)
        self.classes, row = np.unique(np.asarray(y), return_inverse=True)
        self.folds = np.asarray(folds)
        whole = self._table.dtype.kind in "biu"
        largest = max(abs(int(self._table.min())), abs(int(self._table.max()))) if whole else 0
        exact = whole and largest**2 * len(self._table) <= _EXACT
        self._shift = None if exact else self._table.mean(0, dtype=np.float64)
        with self._threads():
            self._sums = {
                name: _moments(self._table, row, len(self.classes), self._shift, np.flatnonzero(self.folds == name))
                for name in np.unique(self.folds).tolist()
            }
            self._total = reduce(lambda a, b: a.joined(b, np.add), self._sums.values())

    def _threads(self) -> threadpool_limits:
        return threadpool_limits(None if self._table.shape[1] >= _WORTH_THREADS else 1)

    def predictions(
        self, *, merge: Mapping[Any, Any] | None = None, features: int | None = None, ridge: float = 0.0
    ) -> NDArray[Any]:
        """Predict each trial by an `LDA` that was trained on all other folds.

        Parameters
        ----------
        merge : mapping from class to class, optional
            What each class counts as: the trials are told apart by that, as if they had been so labelled.
        features : int, 1 or more, optional
            Only the first so many: in rasters sample by sample, what was there until some time.
        ridge
            As in `LDA`.

        Returns
        -------
        shape (trials,), of the kind of `y`, or of what it is merged into

        Raises
        ------
        ProblemError : a training set of one class
        """
        names = self.classes.tolist()
        model = LDA(ridge)
        model.classes_, into = np.unique(
            [name if merge is None else merge[name] for name in names], return_inverse=True
        )
        which = (into == np.arange(len(model.classes_))[:, None]).astype(np.int64)
        shift = None if self._shift is None else self._shift[:features]
        predicted = np.empty(len(self._table), model.classes_.dtype)
        with self._threads():
            for name, tested in self._sums.items():
                counts, sums, scatter = self._total.joined(tested, np.subtract)
                training = _Moments(which @ counts, which @ sums[:, :features], scatter[:features, :features])
                model.fit_moments(training, shift)
                mine = np.flatnonzero(self.folds == name)
                for first in range(0, len(mine), _ROWS):
                    rows = mine[first : first + _ROWS]
                    predicted[rows] = model.predict(self._table[rows, :features])
        return predicted
