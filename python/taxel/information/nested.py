"""Nested cross-validation: the other folds predict each trial, with smoothing and ridge chosen inside them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, numbers, several, shown, whole
from taxel._core import ProblemError
from taxel.information._estimator import labelled
from taxel.information._labels import belonging
from taxel.information.dual import Regression, gram_matrix, left_out
from taxel.information.folds import folds as dealt
from taxel.information.neighbours import majority, squared_distances

__all__ = ["RIDGES", "Nested", "nested_predictions", "training_curve"]

#: Ridges that are tried, in units of the mean variance.
RIDGES = (10.0, 1.0, 0.1)


@dataclass(frozen=True, eq=False)
class Nested:
    """Hold the prediction of each trial, by training sets without it.

    Attributes
    ----------
    responses : labels, shape (trials,)
    folds : int64, shape (trials,), from 0 on
        In which each trial was tested.
    chosen : dict from fold to (int, float)
        Which matrix and which ridge (or how many neighbours) that fold's training trials chose among themselves.
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
    neighbours: Sequence[int] = (),
    seed: int = 0,
) -> Nested:
    """Predict each trial by linear discriminants of the other folds, chosen among matrices and ridges inside these.

    Parameters
    ----------
    grams : sequence of float64, shape (trials, trials), in the features' unit squared
        Inner products of all trials, a matrix for each way to see them (each smoothing); those first are preferred
        where they do as well.
    features : sequence of int
        How many features vary in each.
    y : labels, shape (trials,)
    groups : labels, shape (trials,), optional
        What must not be split, neither between folds nor inside them.
    count, inner : int, 2 or more
        Folds, and folds among the training trials.
    ridges : sequence of float, above 0
        In units of the mean variance over features and trials (of all trials: it knows no label).
    neighbours : sequence of int, 1 or more
        So many nearest neighbours are tried instead of discriminants, where any are named.
    seed : int, 0 or more

    Returns
    -------
    Nested

    Raises
    ------
    ProblemError : as `taxel.information.folds`, or matrices that are invalid

    Notes
    -----
    The discriminants are those of `GramLDA`. Leaving trials out of a ridge regression is a small solve with their part
    of its residual matrix, so all folds and inner folds cost one inverse a matrix and ridge.
    """
    squares, sizes = _matrices(grams, features)
    trials = len(squares[0])
    levels = numbers("ridges", ridges, np.float64)
    if levels.ndim != 1 or not len(levels) or not ((levels > 0) & np.isfinite(levels)).all():
        raise ProblemError(f"ridges is {shown(ridges)}: must be numbers above 0")
    nearest = [whole("neighbours", k, 1) for k in several("neighbours", neighbours)]
    classes, row = labelled(y, trials)
    fold = dealt(y, count=count, groups=groups, seed=seed)
    belongs = None if groups is None else belonging(groups, trials)
    if nearest:
        ways: _Ways = _Neighbours(squares, row, len(classes), nearest)
    else:
        ways = _Discriminants(squares, sizes, row, len(classes), levels)
    predicted, chosen, missing = np.empty(trials, np.int64), {}, []
    for name in range(int(fold.max()) + 1):
        test, train = np.flatnonzero(fold == name), np.flatnonzero(fold != name)
        absent = np.setdiff1d(np.arange(len(classes)), row[train])
        missing += [(name, str(classes[k])) for k in absent]
        right = np.zeros(ways.count)
        if ways.count > 1:
            for part in _inside(row[train], None if belongs is None else belongs[train], inner, seed):
                held = train[part]
                right += (ways.predict(test, held)[:, len(test) :] == row[held]).sum(1)
        best = int(right.argmax())
        predicted[test] = ways.predict(test, np.empty(0, np.int64), best)[0]
        chosen[name] = ways.way(best)
    return Nested(classes[predicted], fold, chosen, tuple(missing))


def training_curve(
    grams: Sequence[ArrayLike],
    features: Sequence[int],
    y: ArrayLike,
    nested: Nested,
    sizes: Sequence[int],
    *,
    seed: int = 0,
) -> list[NDArray[np.generic]]:
    """Predict all trials again, by training on only so many trials a label.

    Parameters
    ----------
    grams, features, y
        As they were given to `nested_predictions`.
    nested : Nested
        What that returned, by discriminants: folds, matrix and ridge stay as they were chosen.
    sizes : sequence of int
        Training trials a label, drawn within each fold's training set.
    seed : int, 0 or more

    Returns
    -------
    list of arrays, shape (trials,), one a size

    Raises
    ------
    ProblemError : matrices and labels that do not fit
    """
    squares, features = _matrices(grams, features)
    classes, row = labelled(y, len(squares[0]))
    random, curve = np.random.default_rng(whole("seed", seed, 0)), []
    used = sorted(set(instance("nested", nested, Nested).chosen.values()))
    if len(nested.folds) != len(row) or any(matrix >= len(squares) for matrix, _ in used):
        raise ProblemError("nested is of other trials or matrices")
    ways = {
        (matrix, ridge): _Discriminants([squares[matrix]], [features[matrix]], row, len(classes), np.array([ridge]))
        for matrix, ridge in used
    }
    for size in several("sizes", sizes):
        predicted = np.empty(len(row), np.int64)
        for name, way in nested.chosen.items():
            test, train = np.flatnonzero(nested.folds == name), np.flatnonzero(nested.folds != name)
            mixed = random.permutation(train)
            sample = np.concatenate([mixed[row[mixed] == k][: whole("sizes", size, 1)] for k in range(len(classes))])
            predicted[test] = ways[way].predict(test, np.setdiff1d(train, sample))[0, : len(test)]
        curve.append(classes[predicted])
    return curve


def _matrices(grams: object, features: object) -> tuple[list[NDArray[np.float64]], list[int]]:
    squares = [gram_matrix(one) for one in several("grams", grams)]
    if not squares:
        raise ProblemError("grams is []: must hold a matrix at least")
    if any(len(one) != len(squares[0]) for one in squares):
        raise ProblemError(f"grams are of {[len(one) for one in squares]} trials: must all be of the same")
    sizes = [whole("features", one, 1) for one in several("features", features)]
    if len(sizes) != len(squares):
        raise ProblemError(f"features has {len(sizes)} entries: must be {len(squares)}, one a matrix")
    return squares, sizes


def _inside(
    row: NDArray[np.int64], belongs: NDArray[np.int64] | None, count: int, seed: int
) -> list[NDArray[np.int64]]:
    """Return the inner test sets; none where a label cannot be dealt out, so that the first way is taken."""
    try:
        fold = dealt(row, count=min(count, len(row)), groups=belongs, seed=seed + 1)
    except ProblemError:
        return []
    return [np.flatnonzero(fold == k) for k in range(int(fold.max()) + 1)]


class _Ways(ABC):
    """The classifiers to choose among ("ways"): their predictions of trials that are left out."""

    count: int

    @abstractmethod
    def predict(self, test: NDArray[np.int64], held: NDArray[np.int64], only: int | None = None) -> NDArray[np.int64]:
        """Return the predictions of `test` and `held` when both are left out, by way; shape (ways, trials)."""

    @abstractmethod
    def way(self, number: int) -> tuple[int, float]:
        """Return the matrix and the ridge or number of neighbours of a way."""


class _Discriminants(_Ways):
    def __init__(
        self,
        squares: list[NDArray[np.float64]],
        features: list[int],
        row: NDArray[np.int64],
        classes: int,
        ridges: NDArray[np.float64],
    ) -> None:
        which = np.zeros((len(row), classes))
        which[np.arange(len(row)), row] = 1.0
        self.ridges = ridges
        self.regressions = []
        for square, size in zip(squares, features, strict=True):
            spread = float(np.trace(square) - square.mean(0).sum())
            # Where all trials are alike only rounding errors remain, which are no variance.
            unit = max(spread / size, 1e-9 * float(np.trace(square)) / len(row), 1e-300)
            self.regressions += [Regression(square, which, ridge * unit) for ridge in ridges]
        self.count = len(self.regressions)

    def way(self, number: int) -> tuple[int, float]:
        return number // len(self.ridges), float(self.ridges[number % len(self.ridges)])

    def predict(self, test: NDArray[np.int64], held: NDArray[np.int64], only: int | None = None) -> NDArray[np.int64]:
        ways = self.regressions if only is None else [self.regressions[only]]
        return left_out(ways, np.concatenate([test, held]))


class _Neighbours(_Ways):
    def __init__(
        self, squares: list[NDArray[np.float64]], row: NDArray[np.int64], classes: int, nearest: list[int]
    ) -> None:
        self.row, self.classes, self.nearest = row, classes, nearest
        self.order = [np.argsort(squared_distances(one), axis=1, kind="stable") for one in squares]
        self.count = len(squares) * len(nearest)

    def way(self, number: int) -> tuple[int, float]:
        return number // len(self.nearest), float(self.nearest[number % len(self.nearest)])

    def predict(self, test: NDArray[np.int64], held: NDArray[np.int64], only: int | None = None) -> NDArray[np.int64]:
        out = np.concatenate([test, held])
        training = np.ones(len(self.row), bool)
        training[out] = False
        ways = range(self.count) if only is None else [only]
        predicted = np.empty((len(ways), len(out)), np.int64)
        for k, number in enumerate(ways):
            order = self.order[number // len(self.nearest)][out]
            near = order[training[order]].reshape(len(out), -1)[:, : self.nearest[number % len(self.nearest)]]
            predicted[k] = majority(self.row[near], self.classes)
        return predicted
