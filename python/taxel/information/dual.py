"""The dual solver of `LDA`: from the trials' inner products, for more features than trials."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import numbers
from taxel._core import ProblemError

__all__ = ["Regression", "gram_matrix", "left_out", "solved_without_ridge"]

#: Directions in which classes vary less than this share of the largest count as none.
_CUT = 1e-10
#: Decimal digits to which the regression's predictions and the discriminants are rounded.
_DIGITS = 9


class Regression:
    """Ridge regression on the classes by the centred Gram matrix, with an intercept, and its discriminants.

    Parameters
    ----------
    square : float64, shape (trials, trials)
        Inner products of the trials.
    which : float64, shape (trials, classes)
        1 where a trial is of a class, else 0.
    level : float, above 0
        The ridge, in the units of `square`.

    Raises
    ------
    ProblemError : a matrix of no inner product

    Notes
    -----
    A correction of classes by classes makes the regression the linear discriminant (Hastie, Tibshirani and Buja 1994,
    J. Am. Stat. Assoc. 89:1255). Leaving trials out is a small solve with their part of the residual matrix.
    """

    def __init__(self, square: NDArray[np.float64], which: NDArray[np.float64], level: float) -> None:
        from scipy.linalg import lapack  # noqa: PLC0415  loads slowly

        trials = len(which)
        factor, fault = lapack.dpotrf(_centred(square) / level + np.eye(trials), lower=1, clean=1)
        if fault:
            raise ProblemError("grams: a matrix has a direction of negative length, so it is of no inner product")
        inverse = lapack.dpotri(factor, lower=1, overwrite_c=1)[0]
        self.which, self.level = which, level
        #: The share of the classes that the regression leaves over, as a matrix on the trials.
        self.residual: NDArray[np.float64] = inverse + np.tril(inverse, -1).T - 1 / trials
        self.left: NDArray[np.float64] = self.residual @ which
        self.sums: NDArray[np.float64] = which.T @ self.left

    def discriminants(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weights of the trials (trials, classes), and what is added to a class (without its prior)."""
        counts = self.which.sum(0)
        turn, offset = _discriminant(np.diag(counts) - np.outer(counts, counts) / counts.sum() - self.sums, counts)
        return self.left / self.level @ turn, offset


def left_out(regressions: list[Regression], out: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the classes that all other trials' discriminants predict for the trials `out`; (regressions, trials)."""
    which = regressions[0].which
    mine = np.ix_(out, out)
    left = np.stack([one.left[out] for one in regressions])
    off = np.linalg.solve(np.stack([one.residual[mine] for one in regressions]), left)
    counts = which.sum(0) - which[out].sum(0)
    share = counts / counts.sum()
    # Predictions of the regression on the other trials, summed by class, less the classes' shares.
    sums = np.diag(counts) - np.stack([one.sums for one in regressions]) + np.swapaxes(left, 1, 2) @ off
    turn, offset = _discriminant(sums - counts[:, None] * share, np.broadcast_to(counts, (len(off), len(counts))))
    # Rounding errors depend on the trial's own label, so without this they would decide ties correctly.
    predicted = np.round(which[out] - off - share, _DIGITS)
    with np.errstate(divide="ignore"):
        scores = predicted @ turn + (offset + np.log(share))[:, None, :]
    return np.asarray(np.round(scores, _DIGITS).argmax(-1))


def solved_without_ridge(
    square: NDArray[np.float64], which: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return discriminants that leave out the directions in which no class varies.

    Parameters
    ----------
    square : float64, shape (trials, trials)
    which : float64, shape (trials, classes)

    Returns
    -------
    tuple
        The weights of the trials (trials, classes), what is added to a class (without its prior), and the number of
        directions that are weighed.

    Raises
    ------
    ProblemError : nothing varies within classes
    """
    trials, mean = len(which), which / which.sum(0)
    within = square - mean @ (which.T @ square)
    within -= (within @ mean) @ which.T
    values, vectors = np.linalg.eigh((within + within.T) / 2)
    varying = values > _CUT * max(values[-1], np.finfo(float).tiny)
    if not varying.any():
        raise ProblemError("gram: nothing varies within classes")
    vectors = vectors[:, varying]
    across = square @ (mean - 1 / trials)
    across -= mean @ (which.T @ across)
    weights = (vectors / values[varying] ** 2) @ (vectors.T @ across) * trials
    weights -= mean @ (which.T @ weights)
    reach = square @ weights
    return weights, -np.diag((mean + 1 / trials).T @ reach) / 2, int(varying.sum())


def _discriminant(
    sums: NDArray[np.float64], counts: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what turns ridge regressions on classes into linear discriminants.

    Parameters
    ----------
    sums : float64, shape (..., classes, classes)
        The regression's predictions of the training trials, summed by their class (rows), less the classes' shares.
    counts : float64, shape (..., classes)
        Training trials by class; a class without any gets no discriminant.

    Returns
    -------
    turn : float64, shape (..., classes, classes)
        Discriminants are the regression's prediction of a trial (less the shares), times this ...
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
