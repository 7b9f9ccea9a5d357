"""Linear discriminant analysis: of features (`LDA`), or of the trials' inner products (`GramLDA`)."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import finite, finite_numbers, text, whole
from taxel._base.errors import refused
from taxel._base.messages import warn
from taxel._core import ProblemError
from taxel.information._estimator import Classifier, labelled
from taxel.information.dual import LARGEST_RIDGE, Regressions, gram_matrix, residual, solved_without_ridge
from taxel.information.primal import ClassMoments, blocks, feature_table, solved

__all__ = ["LDA", "GramLDA"]


class LDA(Classifier):
    """Classify by linear discriminant analysis: classes with a mean each and one covariance.

    Parameters
    ----------
    ridge : float, 0 or more
        Added to the diagonal of the covariance within classes, in units of its mean variance over features that vary.
    priors : {"training", "equal"}
        How frequent classes are taken to be.

    Attributes
    ----------
    classes_ : shape (classes,)
    coef_ : float64, shape (classes, features)
    intercept_ : float64, shape (classes,)
    rank_ : int
        In how many directions the covariance within classes was inverted. Less than the features that vary where
        these are linearly dependent (or trials are fewer): directions in which no class varies are left out, as by
        scikit-learn's `svd`.

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    From `ClassMoments` and one Cholesky factor, with pivots where features are dependent; where trials are not more
    than features, from the trials' Gram matrix, the same discriminants (`GramLDA`). The covariance is the scatter over
    the trials, and discriminants equal those of scikit-learn's ``LinearDiscriminantAnalysis``.

    Examples
    --------
    >>> x = [[0.0, 1.0], [1.0, 0.2], [0.5, 0.4], [3.0, 2.0], [4.0, 2.5], [3.5, 3.0]]
    >>> LDA().fit(x, ["ball"] * 3 + ["edge"] * 3).predict([[0.2, 0.5], [3.4, 2.0]])
    array(['ball', 'edge'], dtype='<U4')
    """

    coef_: NDArray[np.float64]
    intercept_: NDArray[np.float64]
    rank_: int

    def __init__(self, *, ridge: float = 0.0, priors: str = "training") -> None:
        self.ridge = ridge
        self.priors = priors
        super().__init__()

    def _check(self) -> None:
        _ridge(self.ridge)
        text("priors", self.priors, ("training", "equal"))

    def fit(self, x: ArrayLike, y: ArrayLike) -> Self:
        """Learn from trials.

        Parameters
        ----------
        x : numbers, shape (trials, features)
        y : labels, shape (trials,)
            Texts or whole numbers.

        Raises
        ------
        ProblemError : trials or labels that are invalid

        Examples
        --------
        >>> LDA().fit([[0.0], [1.0], [4.0], [5.0]], ["a", "a", "b", "b"]).coef_.shape
        (2, 1)
        """
        table = feature_table(x)
        self.classes_, row = labelled(y, len(table))
        if table.shape[1] < len(table) - len(self.classes_):
            shift = table.mean(0, dtype=np.float64)
            return self._from_moments(ClassMoments.of(table, row, len(self.classes_), shift=shift), shift)
        values = table.astype(np.float64)
        centre = values.mean(0)
        values -= centre
        varying = values.any(0)
        if not varying.any():
            raise refused("x", ": no feature varies")
        scale = varying.astype(np.float64)
        if self.ridge == 0:
            # Which directions are left out depends on the features' scale: their spread, as with few features.
            counts = np.bincount(row)
            means = np.stack([values[row == k].mean(0) for k in range(len(counts))])
            spread = np.sqrt(np.mean((values - means[row]) ** 2, axis=0))
            weighed = spread > 1e-7 * np.abs(values).max(0)
            scale = np.divide(1.0, spread, out=np.zeros_like(spread), where=weighed)
        values *= scale
        gram = GramLDA(features=int(varying.sum()), ridge=self.ridge, priors=self.priors).fit(values @ values.T, row)
        self.coef_ = gram.dual_.T @ values * scale
        self.intercept_ = gram.intercept_ - self.coef_ @ centre
        self.rank_ = gram.rank_
        return self

    def _from_moments(self, moments: ClassMoments, shift: NDArray[np.float64] | None = None) -> Self:
        """Learn from sums over trials from which `shift` was taken off; `classes_` is the caller's to set."""
        solution = solved(moments, _ridge(self.ridge), self.priors, shift)
        self.coef_, self.intercept_, self.rank_ = solution[:3]
        if solution.rank < solution.weighed:
            warn(
                f"LDA: features are linearly dependent within classes, so {solution.rank} of {solution.weighed} "
                "directions are weighed",
                UserWarning,
                stacklevel=3,
            )
        return self

    def decision_function(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return each class' discriminant: its log probability, but for a constant a trial.

        Parameters
        ----------
        x : numbers, shape (trials, features)

        Returns
        -------
        float64, shape (trials, classes)

        Raises
        ------
        ProblemError : not fitted, or other features

        Examples
        --------
        >>> lda = LDA().fit([[0.0], [1.0], [4.0], [5.0]], ["a", "a", "b", "b"])
        >>> lda.decision_function([[4.0]]).argmax(1)
        array([1])
        """
        weights = self._fitted("coef_")
        table = feature_table(x)
        if table.shape[1] != weights.shape[1]:
            raise refused("x", f" has {table.shape[1]} features: it was fitted to {weights.shape[1]}")
        scores = np.empty((len(table), len(weights)))
        for block, mine in blocks(table, None, np.float64, None):
            scores[mine] = block @ weights.T + self.intercept_
        return scores

    def predict(self, x: ArrayLike) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial.

        Parameters
        ----------
        x : numbers, shape (trials, features)

        Returns
        -------
        shape (trials,), of the kind of the labels

        Raises
        ------
        ProblemError : not fitted, or other features

        Examples
        --------
        >>> LDA().fit([[0.0], [1.0], [4.0], [5.0]], ["a", "a", "b", "b"]).predict([[0.5], [4.5]]).tolist()
        ['a', 'b']
        """
        scores = self.decision_function(x)
        return np.asarray(self.classes_[scores.argmax(1)])


class GramLDA(Classifier):
    """Classify by the `LDA` of features that are known by their inner products only.

    Parameters
    ----------
    features : int, 1 or more
        How many features vary: the mean variance is reckoned over them.
    ridge : float, 0 or more
        As in `LDA`, and the same discriminants. 0 leaves out the directions in which no class varies.
    priors : {"training", "equal"}

    Attributes
    ----------
    classes_ : shape (classes,)
    dual_ : float64, shape (trials, classes)
        Weights of the training trials.
    intercept_ : float64, shape (classes,)
    rank_ : int

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    With a ridge: regression on the classes by the centred Gram matrix, and a correction of classes by classes that
    makes it the discriminant (Hastie, Tibshirani and Buja 1994, J. Am. Stat. Assoc. 89:1255).

    Examples
    --------
    >>> x = np.random.default_rng(1).normal(size=(20, 400)) + np.repeat([0, 1], 10)[:, None]
    >>> lda = GramLDA(features=400, ridge=1.0).fit(x[::2] @ x[::2].T, np.repeat([0, 1], 5))
    >>> lda.predict(x[1::2] @ x[::2].T)
    array([0, 0, 0, 0, 0, 1, 1, 1, 1, 1])
    """

    _pairwise = True
    dual_: NDArray[np.float64]
    intercept_: NDArray[np.float64]
    rank_: int

    def __init__(self, *, features: int, ridge: float = 1.0, priors: str = "training") -> None:
        self.features = features
        self.ridge = ridge
        self.priors = priors
        super().__init__()

    def _check(self) -> None:
        whole("features", self.features, 1)
        _ridge(self.ridge)
        text("priors", self.priors, ("training", "equal"))

    def fit(self, gram: ArrayLike, y: ArrayLike) -> Self:
        """Learn from inner products.

        Parameters
        ----------
        gram : float64, shape (trials, trials), in the features' unit squared
            Inner products of the training trials.
        y : labels, shape (trials,)

        Raises
        ------
        ProblemError : a matrix that is not square, or labels that are invalid

        Examples
        --------
        >>> x = np.array([[0.0], [1.0], [4.0], [5.0]])
        >>> GramLDA(features=1).fit(x @ x.T, ["a", "a", "b", "b"]).classes_.tolist()
        ['a', 'b']
        """
        square = gram_matrix(gram)
        self.classes_, row = labelled(y, len(square))
        trials, classes = len(square), len(self.classes_)
        if trials <= classes:
            raise ProblemError(f"{trials} trials of {classes} classes: must be more trials than classes")
        which = np.zeros((trials, classes))
        which[np.arange(trials), row] = 1.0
        counts = which.sum(0)
        prior = counts / trials if self.priors == "training" else np.full(classes, 1 / classes)
        spread = float(np.trace(square) - ((which / counts) * (square @ which)).sum())
        if self.ridge > 0 and spread > 0:
            level = self.ridge * spread / self.features
            weights, offset = Regressions(residual(square, level)[None], which).discriminants(level)
            self.rank_ = trials - classes
        else:
            weights, offset, self.rank_ = solved_without_ridge(square, which)
        # Weights of a class sum up to 0, so that only inner products with the mean's place taken off count.
        self.dual_ = weights - weights.mean(0)
        self.intercept_ = offset + np.log(prior)
        if self.ridge > 0 and spread > 0:
            self.intercept_ -= square.mean(0) @ self.dual_
        return self

    def decision_function(self, gram: ArrayLike) -> NDArray[np.float64]:
        """Return each class' discriminant, shape (trials, classes).

        Parameters
        ----------
        gram : float64, shape (trials, training trials), in the features' unit squared
            Inner products with the training trials.

        Raises
        ------
        ProblemError : not fitted, or another number of training trials
        """
        weights = self._fitted("dual_")
        across = finite_numbers("gram", gram)
        if across.ndim != 2 or across.shape[1] != len(weights):
            raise refused("gram", f" has shape {across.shape}: must be (trials, {len(weights)})")
        return np.asarray(across @ weights + self.intercept_)

    def predict(self, gram: ArrayLike) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial.

        Parameters
        ----------
        gram : float64, shape (trials, training trials), in the features' unit squared
            Inner products with the training trials.

        Returns
        -------
        shape (trials,), of the kind of the labels

        Raises
        ------
        ProblemError : not fitted, or products with other trials

        Examples
        --------
        >>> x = np.array([[0.0], [1.0], [4.0], [5.0]])
        >>> GramLDA(features=1).fit(x @ x.T, ["a", "a", "b", "b"]).predict(np.array([[4.5]]) @ x.T).tolist()
        ['b']
        """
        return np.asarray(self.classes_[self.decision_function(gram).argmax(1)])


def _ridge(ridge: object) -> float:
    return finite("ridge", ridge, least=0.0, most=LARGEST_RIDGE)
