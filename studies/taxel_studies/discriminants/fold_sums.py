"""Linear discriminants of all folds but one, from sums that are taken once a fold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from taxel_studies.discriminants.lda import LDA
from taxel_studies.discriminants.moments import ClassMoments, blocks, feature_table, is_exact

__all__ = ["FoldSums", "fold_predictions"]

#: Number of features from which several threads are used: NumPy and SciPy have a pool each, and while one computes the
#: threads of the other spin. At 1000 features two threads take twice as long as one.
_WORTH_THREADS = 2500


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
    Every fold's scatter stays in memory, ``folds * features ** 2 / 2`` numbers. Exact: whole numbers whose squares sum
    up below 2^24 are summed in float32 without rounding, all else in float64.

    Examples
    --------
    >>> x = [[0.0, 1.0], [1.0, 0.2], [0.5, 0.4], [0.4, 0.9], [3.0, 2.0], [4.0, 2.5], [3.5, 3.0], [3.1, 2.2]]
    >>> sums = FoldSums(x, ["ball", "ball", "edge", "edge", "rod", "rod", "pin", "pin"], [0, 1] * 4)
    >>> sums.predictions(merge={"ball": "soft", "edge": "soft", "rod": "hard", "pin": "hard"}).tolist()
    ['soft', 'soft', 'soft', 'soft', 'hard', 'hard', 'hard', 'hard']
    """

    def __init__(self, x: ArrayLike, y: ArrayLike, folds: ArrayLike) -> None:
        self._table = feature_table(x)
        self.classes, row = np.unique(np.asarray(y), return_inverse=True)
        self.folds = np.asarray(folds)
        dtype = np.float32 if is_exact(self._table) else np.float64
        self._shift = None if dtype == np.float32 else self._table.mean(0, dtype=np.float64)
        with self._threads():
            self._sums = {
                name: ClassMoments.of(
                    self._table,
                    row,
                    len(self.classes),
                    rows=np.flatnonzero(self.folds == name),
                    dtype=dtype,
                    shift=self._shift,
                )
                for name in np.unique(self.folds).tolist()
            }
            first, *others = self._sums.values()
            self._total = first
            for moments in others:
                self._total = self._total + moments

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
        model, count = LDA(ridge), self._table.shape[1]
        used = count if features is None else features
        model.classes_, into = self.classes, None
        if merge is not None:
            model.classes_, into = np.unique([merge[name] for name in self.classes.tolist()], return_inverse=True)
        shift = None if self._shift is None else self._shift[:used]
        predicted = np.empty(len(self._table), model.classes_.dtype)
        with self._threads():
            for name, moments in self._sums.items():
                training = self._total - moments
                if into is not None:
                    training = training.merged(into, len(model.classes_))
                model.fit_moments(training if used == count else training.first(used), shift)
                for block, mine in blocks(self._table[:, :used], np.flatnonzero(self.folds == name), np.float64, None):
                    predicted[mine] = model.classes_[(block @ model.coef_.T + model.intercept_).argmax(1)]
        return predicted


def fold_predictions(x: ArrayLike, y: ArrayLike, folds: ArrayLike, *, ridge: float = 0.0) -> NDArray[Any]:
    """Predict each trial by an `LDA` that was trained on all other folds, as `FoldSums` does, to which x, y, folds go.

    Each fold's sums are taken once; a training set is the whole less a fold, so ten folds cost little more than one.

    Notes
    -----
    150 000 trials of 5000 features, 300 classes, 10 folds: 3.75 TFLOP of products and 0.4 of factors.

    Examples
    --------
    >>> x = [[0.0], [4.0], [1.0], [5.0], [0.5], [4.5], [0.2], [4.2]]
    >>> fold_predictions(x, ["a", "b"] * 4, [0, 0, 0, 0, 1, 1, 1, 1]).tolist()
    ['a', 'b', 'a', 'b', 'a', 'b', 'a', 'b']
    """
    return FoldSums(x, y, folds).predictions(ridge=ridge)
