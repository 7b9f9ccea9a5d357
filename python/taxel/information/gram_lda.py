"""Linear discriminant analysis from the trials' inner products: for far more features than trials."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import number, numbers, shown, text, whole
from taxel._core import ProblemError
from taxel.information._estimator import Classifier, labelled

__all__ = ["GramLDA", "discriminant", "gram_matrix"]

#: Directions in which classes vary less than this share of the largest count as none.
_CUT = 1e-10


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
    ProblemError : a parameter that makes no sense

    Notes
    -----
    With a ridge: regression on the classes by the centred Gram matrix, and a correction of classes by classes that
    makes it the discriminant (Hastie, Tibshirani and Buja 1994, J. Am. Stat. Assoc. 89:1255; `discriminant`).

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
        if not 0 <= number("ridge", self.ridge) < np.inf:
            raise ProblemError(f"ridge is {shown(self.ridge)}: must be 0 or more, and finite")
        text("priors", self.priors, ("training", "equal"))

    def fit(self, gram: ArrayLike, y: ArrayLike) -> Self:
        """Learn from inner products.

        Parameters
        ----------
        gram : shape (trials, trials)
            Inner products of the training trials.
        y : shape (trials,)

        Raises
        ------
        ProblemError : a matrix that is not square, or labels that make no sense
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
        mean = which / counts
        spread = float(np.trace(square) - (mean * (square @ which)).sum())
        if self.ridge > 0 and spread > 0:
            level = self.ridge * spread / self.features
            centred = _centred(square)
            weights = np.linalg.solve(centred + level * np.eye(trials), which - counts / trials)
            sums = which.T @ (centred @ weights)
            turn, offset = discriminant(sums, counts)
            self.dual_ = weights @ turn
            self.intercept_ = offset + np.log(prior)
            self.rank_ = trials - classes
        else:
            within = square - mean @ (which.T @ square)
            within -= (within @ mean) @ which.T
            values, vectors = np.linalg.eigh((within + within.T) / 2)
            kept = values > _CUT * max(values[-1], np.finfo(float).tiny)
            if not kept.any():
                raise ProblemError("gram: nothing varies within classes")
            vectors = vectors[:, kept]
            across = square @ (mean - 1 / trials)
            across -= mean @ (which.T @ across)
            weights = (vectors / values[kept] ** 2) @ (vectors.T @ across) * trials
            weights -= mean @ (which.T @ weights)
            self.dual_ = weights
            reach = square @ weights
            self.intercept_ = np.log(prior) - np.diag((mean + 1 / trials).T @ reach) / 2
            self.rank_ = int(kept.sum())
        # Weights of a class sum up to 0, so that only inner products with the mean's place taken off count.
        middle = square.mean(0)
        self.dual_ -= self.dual_.mean(0)
        if self.ridge > 0 and spread > 0:
            self.intercept_ -= middle @ self.dual_
        return self

    def decision_function(self, gram: ArrayLike) -> NDArray[np.float64]:
        """Return each class' discriminant, shape (trials, classes).

        Parameters
        ----------
        gram : shape (trials, training trials)
            Inner products with the training trials.

        Raises
        ------
        ProblemError : not fitted, or another number of training trials
        """
        weights = self._fitted("dual_")
        across = numbers("gram", gram, np.float64)
        if across.ndim != 2 or across.shape[1] != len(weights):
            raise ProblemError(f"gram has shape {across.shape}: must be (trials, {len(weights)})")
        return np.asarray(across @ weights + self.intercept_)

    def predict(self, gram: ArrayLike) -> NDArray[Any]:
        """Return the class of the largest discriminant, trial by trial."""
        return np.asarray(self.classes_[self.decision_function(gram).argmax(1)])


def discriminant(sums: NDArray[np.float64], counts: NDArray[np.float64]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return what turns ridge regressions on classes into linear discriminants.

    Parameters
    ----------
    sums : float64, shape (..., classes, classes)
        What the regression says of the training trials, summed by their class (rows), the classes' shares taken off.
    counts : float64, shape (..., classes)
        Training trials by class; a class without any gets no discriminant.

    Returns
    -------
    turn : float64, shape (..., classes, classes)
        Discriminants are what the regression says of a trial (less the shares), times this ...
    offset : float64, shape (..., classes)
        ... plus this, plus the logarithm of the prior; minus infinity without trials.

    Notes
    -----
    With T the total scatter and its ridge, M the classes' centred means, N their counts, the regression's coefficients
    are T^-1 M'N. The scatter within is T - M'NM, so by Woodbury W^-1 M' = T^-1 M'N [N^-1/2 (1 - A)^-1 N^-1/2], where
    A = N^1/2 M T^-1 M' N^1/2 is made of `sums`.
    """
    there = counts > 0
    root = np.divide(1.0, np.sqrt(counts), out=np.zeros_like(counts, dtype=np.float64), where=there)
    classes = counts.shape[-1]
    a = sums * root[..., :, None] * root[..., None, :]
    inverse = np.linalg.inv(np.eye(classes) - (a + np.swapaxes(a, -1, -2)) / 2)
    turn = inverse * root[..., :, None] * root[..., None, :] * counts.sum(-1)[..., None, None]
    means = sums * (root**2)[..., :, None]
    offset = -np.einsum("...kj,...jk->...k", means, turn) / 2
    return turn, np.where(there, offset, -np.inf)


def gram_matrix(gram: ArrayLike) -> NDArray[np.float64]:
    """Return a square matrix of inner products.

    Raises
    ------
    ProblemError : not square, not finite or not symmetric
    """
    square: NDArray[np.float64] = numbers("gram", gram, np.float64)
    if square.ndim != 2 or square.shape[0] != square.shape[1] or not len(square):
        raise ProblemError(f"gram has shape {square.shape}: must be (trials, trials)")
    if not np.isfinite(square).all():
        raise ProblemError("gram is not finite")
    if np.abs(square - square.T).max() > 1e-6 * max(np.abs(square).max(), 1e-300):
        raise ProblemError("gram is not symmetric: entry i, j is the inner product of trials i and j")
    return square


def _centred(square: NDArray[np.float64]) -> NDArray[np.float64]:
    mean = square.mean(0)
    return np.asarray(square - mean - mean[:, None] + mean.mean())
