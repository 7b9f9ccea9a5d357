"""Nested cross-validation: the other folds predict each trial, with smoothing and ridge chosen inside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from taxel._base.arguments import integer, numbers, several, shown
from taxel._base.errors import refused
from taxel.information.dual import LARGEST_RIDGE, Regressions, gram_matrix, residual
from taxel.information.folds import Split, split

__all__ = [
    "RIDGES",
    "WORTH_THREADS",
    "Matrices",
    "Nested",
    "nested_predictions",
    "predictions",
]

#: Ridges that are tried, in units of the mean variance.
RIDGES = (10.0, 1.0, 0.1)
#: Number of trials from which several threads are used for their matrices.
WORTH_THREADS = 1000


@dataclass(frozen=True, eq=False)
class Nested:
    """Hold the prediction of each trial, by training sets without it.

    Attributes
    ----------
    responses : labels, shape (trials,)
    folds : int64, shape (trials,), counted from 0
        Fold in which each trial was tested.
    chosen : dict from fold to (int, float)
        The matrix and the ridge that each fold's training trials chose among themselves.
    missing : tuple of (fold, class)
        Training sets without a class, which they cannot predict.
    """

    responses: NDArray[np.generic]
    folds: NDArray[np.int64]
    chosen: dict[int, tuple[int, float]]
    missing: tuple[tuple[int, str], ...] = ()


def nested_predictions(
    grams: Sequence[ArrayLike],
    features: Sequence[int],
    y: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    count: int = 10,
    inner: int = 5,
    ridges: Sequence[float] = RIDGES,
    seed: int = 0,
) -> Nested:
    """Predict each trial by linear discriminants of the other folds, chosen among matrices and ridges inside these.

    Parameters
    ----------
    grams : sequence of float64, shape (trials, trials), in the features' unit squared
        Inner products of all trials, a matrix for each way to see them (each smoothing); if two do equally well, the
        first is preferred.
    features : sequence of int
        Number of features that vary in each matrix.
    y : labels, shape (trials,)
    groups : labels, shape (trials,), optional
        Trials that must not be split, neither between folds nor inside them.
    count, inner : int, 2 or more
        Number of folds, and of folds among the training trials.
    ridges : sequence of float, above 0
        In units of the mean variance over features and all trials (which does not depend on labels).
    seed : int, 0 or more

    Returns
    -------
    Nested

    Raises
    ------
    ProblemError : as `taxel.information.folds`, or matrices that are invalid

    Notes
    -----
    The discriminants are linear, with one covariance of all classes (Hastie, Tibshirani and Buja 1994, J. Am. Stat.
    Assoc. 89:1255). Leaving trials out of a ridge regression is a small solve with their part
    of its residual matrix, so all folds and inner folds cost one inverse a matrix and ridge.
    """
    matrices = Matrices(grams, features)
    levels = numbers("ridges", ridges, np.float64)
    if levels.ndim != 1 or not len(levels) or not ((levels > 0) & (levels <= LARGEST_RIDGE)).all():
        raise refused("ridges", f" is {shown(ridges)}: must be numbers above 0, at most {LARGEST_RIDGE:g}")
    parts = integer("inner", inner, 2)
    dealt = split(y, matrices.trials, count=count, inner=parts, groups=groups, seed=seed)
    with threads(several=matrices.trials >= WORTH_THREADS):
        return predictions(matrices, dealt, ridges=tuple(levels.tolist()))


def predictions(matrices: Matrices, dealt: Split, *, ridges: tuple[float, ...] = RIDGES) -> Nested:
    """Predict each trial as `nested_predictions` does, from what other questions about the same trials share."""
    row = dealt.row
    ways = _Discriminants(matrices, dealt.is_class, ridges)
    best = _best(ways, dealt) if ways.count > 1 else np.zeros(len(dealt.parts), np.int64)
    predicted = np.empty(len(row), np.int64)
    for folds, out in _of_one_size([part.test for part in dealt.parts]):
        predicted[out] = ways.predict(best[folds], out)
    missing = [
        (name, str(dealt.classes[k]))
        for name, part in enumerate(dealt.parts)
        for k in np.setdiff1d(np.arange(len(dealt.classes)), row[part.train])
    ]
    chosen = {name: ways.way(int(number)) for name, number in enumerate(best)}
    return Nested(dealt.classes[predicted], dealt.fold, chosen, tuple(missing))


def _best(ways: _Discriminants, dealt: Split) -> NDArray[np.int64]:
    """Return for each fold the way that classifies most of its training trials correctly, in folds among themselves."""
    right = np.zeros((len(dealt.parts), ways.count), np.int64)
    inner = [(name, test) for name, part in enumerate(dealt.parts) for test in part.inner]
    tested = [np.concatenate([dealt.parts[name].test, test]) for name, test in inner]
    for cases, out in _of_one_size(tested):
        correct = ways.predict_all(out) == dealt.row[out]
        for case, here in zip(cases, np.swapaxes(correct, 0, 1), strict=True):
            name, test = inner[case]
            right[name] += here[:, -len(test) :].sum(1)
    return np.asarray(right.argmax(1))


def _of_one_size(sets: list[NDArray[np.int64]]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Give sets of equally many trials together: their numbers, and the trials of each."""
    sizes = np.array([len(chosen) for chosen in sets], np.int64)
    for size in np.unique(sizes):
        cases = np.flatnonzero(sizes == size)
        yield cases, np.stack([sets[case] for case in cases])


class Matrices:
    """Inner products of all trials, a matrix for each way to see them; what is computed of them serves all labels.

    Parameters
    ----------
    grams, features
        As `nested_predictions` takes them.

    Raises
    ------
    ProblemError : matrices that are invalid
    """

    def __init__(self, grams: object, features: object) -> None:
        self.squares = [gram_matrix(gram) for gram in several("grams", grams)]
        if not self.squares:
            raise refused("grams", " is []: must contain at least one matrix")
        self.trials = len(self.squares[0])
        if any(len(gram) != self.trials for gram in self.squares):
            raise refused("grams", f" have {[len(gram) for gram in self.squares]} trials: must have equally many")
        self.features = [integer("features", count, 1) for count in several("features", features)]
        if len(self.features) != len(self.squares):
            raise refused("features", f" has {len(self.features)} entries: must be {len(self.squares)}, one per matrix")
        self._residuals: dict[tuple[float, ...], NDArray[np.float64]] = {}

    def residual(self, matrix: int, ridge: float) -> NDArray[np.float64]:
        """Return the residual matrix of a matrix and a ridge in units of the mean variance."""
        square = self.squares[matrix]
        spread = float(np.trace(square) - square.mean(0).sum())
        # Where all trials are alike only rounding errors remain, which are no variance.
        unit = max(spread / self.features[matrix], 1e-9 * float(np.trace(square)) / self.trials, 1e-300)
        return residual(square, ridge * unit)

    def residuals(self, ridges: tuple[float, ...]) -> NDArray[np.float64]:
        """Return the residual matrices of all matrices and ridges, shape (matrices * ridges, trials, trials)."""
        if ridges not in self._residuals:
            ways = [(matrix, ridge) for matrix in range(len(self.squares)) for ridge in ridges]
            table = np.empty((len(ways), self.trials, self.trials))
            for k, way in enumerate(ways):
                table[k] = self.residual(*way)
            self._residuals[ridges] = table
        return self._residuals[ridges]


class _Discriminants:
    """The discriminants to choose among ("ways"): their predictions of trials that are left out."""

    def __init__(self, matrices: Matrices, is_class: NDArray[np.float64], ridges: tuple[float, ...]) -> None:
        self._ridges, self._regressions = ridges, Regressions(matrices.residuals(ridges), is_class)
        self.count = len(matrices.squares) * len(ridges)

    def way(self, number: int) -> tuple[int, float]:
        """Return the matrix and the ridge of a way."""
        return number // len(self._ridges), float(self._ridges[number % len(self._ridges)])

    def predict(self, number: NDArray[np.int64], out: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return one way's predictions of trials that are left out; number (cases,), out and result (cases, trials)."""
        return self._regressions.left_out(number, out)

    def predict_all(self, out: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return all ways' predictions of trials that are left out; shapes (cases, trials), (ways, cases, trials)."""
        number = np.repeat(np.arange(self.count), len(out))
        return self.predict(number, np.tile(out, (self.count, 1))).reshape(self.count, *out.shape)


__all__ = ["threads"]


def threads(*, several: bool) -> threadpool_limits:
    """Limit NumPy and SciPy to one thread until the context ends, unless several are worth their cost."""
    # SciPy has a separate pool of threads, which can be limited only after it is loaded.
    import_module("scipy.linalg")
    return threadpool_limits(None if several else 1)
