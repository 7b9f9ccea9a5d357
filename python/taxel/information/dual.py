"""Linear discriminants from the trials' inner products, for more features than trials."""

from __future__ import annotations

import numpy as np
import scipy  # its modules load when they are first used
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import finite_numbers
from taxel._base.errors import refused

__all__ = ["LARGEST_RIDGE", "Regressions", "discriminant", "gram_matrix", "residual"]

#: The largest ridge, in units of the mean variance.
LARGEST_RIDGE = 1e100
#: The largest inner product: squares of sums of them do not overflow.
_LARGEST = 1e140
#: Decimal digits to which the regression's predictions and the discriminants are rounded.
_DIGITS = 9
#: Numbers of residual matrices that are solved in one call of NumPy: Ctrl-C is answered between calls.
_CELLS = 1 << 20


def residual(square: NDArray[np.float64], level: float) -> NDArray[np.float64]:
    """Return the residual of a ridge regression on any classes, as a matrix on the trials.

    Parameters
    ----------
    square : float64, shape (trials, trials)
        Inner products of the trials, which are centred: the regression has an intercept.
    level : float, above 0
        The ridge, in the units of `square`.

    Returns
    -------
    float64, shape (trials, trials)
        The same for all labels.

    Raises
    ------
    ProblemError : not a matrix of inner products
    """
    trials, centred = len(square), _centred(square)
    least = trials * np.finfo(float).eps * float(np.abs(centred).max())
    if level < least:
        raise refused(
            "ridge",
            f": {level:.3g} in the unit of the inner products is below their rounding error; must be at least "
            f"{least:.3g}",
        )
    factor, fault = scipy.linalg.lapack.dpotrf(centred / level + np.eye(trials), lower=1, clean=1)
    if fault:
        raise refused("grams", ": a matrix has a negative eigenvalue, so it is not a matrix of inner products")
    inverse = scipy.linalg.lapack.dpotri(factor, lower=1, overwrite_c=1)[0]
    return np.asarray(inverse + np.tril(inverse, -1).T - 1 / trials)


class Regressions:
    """Ridge regressions on the classes, one for each residual matrix, as linear discriminants.

    Parameters
    ----------
    residuals : float64, shape (regressions, trials, trials)
        As `residual` returns them.
    which : float64, shape (trials, classes)
        1 if a trial belongs to a class, else 0.

    Notes
    -----
    A correction of classes by classes makes the regression the linear discriminant (Hastie, Tibshirani and Buja 1994,
    J. Am. Stat. Assoc. 89:1255). Leaving trials out is a small solve with their part of the residual matrix.
    """

    def __init__(self, residuals: NDArray[np.float64], is_class: NDArray[np.float64]) -> None:
        self._residuals, self._is_class = residuals, is_class
        self._left: NDArray[np.float64] = residuals @ is_class
        self._sums: NDArray[np.float64] = is_class.T @ self._left

    def left_out(self, number: NDArray[np.int64], out: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the classes that all other trials' discriminants predict for trials that are left out.

        Parameters
        ----------
        number : int64, shape (cases,)
            Index of the regression.
        out : int64, shape (cases, left out)
            Indices of the trials.

        Returns
        -------
        int64, shape (cases, left out)
        """
        predicted = np.empty(out.shape, np.int64)
        at_once = max(1, _CELLS // max(1, out.shape[1]) ** 2)
        for first in range(0, len(out), at_once):
            some = slice(first, first + at_once)
            predicted[some] = self._some_left_out(number[some, None], out[some])
        return predicted

    def _some_left_out(self, number: NDArray[np.int64], out: NDArray[np.int64]) -> NDArray[np.int64]:
        is_class, left = self._is_class[out], self._left[number, out]
        off = np.linalg.solve(self._residuals[number[:, :, None], out[:, :, None], out[:, None, :]], left)
        counts = self._is_class.sum(0) - is_class.sum(1)
        share = counts / counts.sum(1, keepdims=True)
        # Predictions of the regression on the other trials, summed by class, less the classes' shares.
        sums = counts[:, :, None] * np.eye(counts.shape[1]) - self._sums[number[:, 0]] + np.swapaxes(left, 1, 2) @ off
        turn, offset = discriminant(sums - counts[:, :, None] * share[:, None, :], counts)
        # Rounding errors depend on the trial's own label, so without this they would decide ties correctly.
        predicted = np.round(is_class - off - share[:, None, :], _DIGITS)
        with np.errstate(divide="ignore"):
            scores = predicted @ turn + (offset + np.log(share))[:, None, :]
        return np.asarray(np.round(scores, _DIGITS).argmax(-1))


def discriminant(
    sums: NDArray[np.float64], counts: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the factor and offset that turn ridge regressions on classes into linear discriminants.

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
    ProblemError : not square, not finite, too large or not symmetric
    """
    square = finite_numbers("gram", gram)
    if square.ndim != 2 or square.shape[0] != square.shape[1] or not len(square):
        raise refused("gram", f" has shape {square.shape}: must be (trials, trials)")
    if (largest := float(np.abs(square).max())) > _LARGEST:
        raise refused("gram", f" contains the number {largest:.3g}: numbers must be at most {_LARGEST:g}")
    if np.abs(square - square.T).max() > 1e-6 * max(largest, 1e-300):
        raise refused("gram", " is not symmetric: entry i, j is the inner product of trials i and j")
    return square


def _centred(square: NDArray[np.float64]) -> NDArray[np.float64]:
    mean = square.mean(0)
    return np.asarray(square - mean - mean[:, None] + mean.mean())
