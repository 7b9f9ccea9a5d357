"""Linear discriminant analysis: of features (`LDA`), or of the trials' inner products (`GramLDA`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import ProblemError
from taxel.information.dual import discriminant, gram_matrix, residual
from taxel_studies.discriminants.moments import ClassMoments, blocks, feature_table, solved

__all__ = ["LDA", "GramLDA"]


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
    rank_ : int
        In how many directions the covariance within classes was inverted. Less than the features that vary where
        these are linearly dependent (or trials are fewer): directions in which no class varies are left out, as by
        scikit-learn's `svd`.

    Notes
    -----
    From `ClassMoments` and one Cholesky factor, with pivots where features are dependent; with a ridge, where trials
    are not more than features, from the trials' Gram matrix, the same discriminants (`GramLDA`). The covariance is the
    scatter over the trials, and discriminants equal those of scikit-learn's ``LinearDiscriminantAnalysis``.

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
        table = feature_table(x)
        self.classes_, row = np.unique(np.asarray(y), return_inverse=True)
        if self.ridge == 0 or table.shape[1] < len(table) - len(self.classes_):
            shift = table.mean(0, dtype=np.float64)
            return self.fit_moments(ClassMoments.of(table, row, len(self.classes_), shift=shift), shift)
        values = table.astype(np.float64)
        centre = values.mean(0)
        values -= centre
        varying = values.any(0)
        if not varying.any():
            raise ProblemError("x: no feature varies")
        gram = GramLDA(int(varying.sum()), self.ridge).fit(values @ values.T, row)
        self.coef_ = gram.dual_.T @ values
        self.intercept_ = gram.intercept_ - self.coef_ @ centre
        self.rank_ = len(table) - len(self.classes_)
        return self

    def fit_moments(self, moments: ClassMoments, shift: NDArray[np.float64] | None = None) -> Self:
        """Learn from sums over trials from which `shift` was taken off; `classes_` is the caller's to set."""
        self.coef_, self.intercept_, self.rank_ = solved(moments, self.ridge, shift)
        return self

    def decision_function(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return each class' discriminant, shape (trials, classes): its log probability, but for a constant a trial."""
        table = feature_table(x)
        scores = np.empty((len(table), len(self.coef_)))
        for block, mine in blocks(table, None, np.float64, None):
            scores[mine] = block @ self.coef_.T + self.intercept_
        return scores

    def predict(self, x: ArrayLike) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial."""
        return np.asarray(self.classes_[self.decision_function(x).argmax(1)])


@dataclass
class GramLDA:
    """Classify by the `LDA` of features that are known by their inner products only.

    Parameters
    ----------
    features : int, 1 or more
        How many features vary: the mean variance is reckoned over them.
    ridge : float, above 0
        As in `LDA`, and the same discriminants.

    Attributes
    ----------
    classes_ : shape (classes,)
    dual_ : float64, shape (trials, classes)
        Weights of the training trials.
    intercept_ : float64, shape (classes,)

    Notes
    -----
    Regression on the classes by the centred Gram matrix, and a correction of classes by classes that makes it the
    discriminant (Hastie, Tibshirani and Buja 1994, J. Am. Stat. Assoc. 89:1255).

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(20, 400)) + np.repeat([0, 1], 10)[:, None]
    >>> lda = GramLDA(features=400).fit(x[::2] @ x[::2].T, np.repeat([0, 1], 5))
    >>> lda.predict(x[1::2] @ x[::2].T)
    array([0, 0, 0, 0, 0, 1, 1, 1, 1, 1])
    """

    features: int
    ridge: float = 1.0
    classes_: NDArray[Any] = field(init=False, repr=False)
    dual_: NDArray[np.float64] = field(init=False, repr=False)
    intercept_: NDArray[np.float64] = field(init=False, repr=False)

    def fit(self, gram: ArrayLike, y: ArrayLike) -> Self:
        """Learn from the inner products of the training trials, shape (trials, trials), and a label a trial.

        Raises
        ------
        ProblemError : a matrix that is of no inner product, a ridge that its rounding loses, or too few trials
        """
        square = gram_matrix(gram)
        self.classes_, row = np.unique(np.asarray(y), return_inverse=True)
        trials, classes = len(square), len(self.classes_)
        if classes < 2 or trials <= classes:
            raise ProblemError(f"{trials} trials of {classes} classes: must be of two classes, and more than classes")
        which = np.zeros((trials, classes))
        which[np.arange(trials), row] = 1.0
        counts = which.sum(0)
        spread = float(np.trace(square) - ((which / counts) * (square @ which)).sum())
        if spread <= 0:
            raise ProblemError("gram: nothing varies within classes")
        level = self.ridge * spread / self.features
        left = residual(square, level) @ which
        sums = np.diag(counts) - np.outer(counts, counts) / trials - which.T @ left
        turn, offset = discriminant(sums, counts)
        weights = left / level @ turn
        # Weights of a class sum up to 0, so that only inner products with the mean's place taken off count.
        self.dual_ = weights - weights.mean(0)
        self.intercept_ = offset + np.log(counts / trials) - square.mean(0) @ self.dual_
        return self

    def decision_function(self, gram: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return each class' discriminant from inner products with the training trials, (trials, training trials)."""
        return np.asarray(gram @ self.dual_ + self.intercept_)

    def predict(self, gram: NDArray[np.float64]) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial."""
        return np.asarray(self.classes_[self.decision_function(gram).argmax(1)])
