"""Linear discriminants of all folds but one, from sums that are taken once a fold."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import callback, instance, numbers, text, whole
from taxel._base.errors import refused
from taxel.information._estimator import labelled
from taxel.information._labels import words
from taxel.information._threads import threads
from taxel.information.lda import LDA
from taxel.information.primal import ClassMoments, blocks, feature_table, is_exact

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
    keep : {"folds", "total"}
        "folds": every fold's scatter stays in memory, ``folds * features ** 2 / 2`` numbers (of four bytes for spikes,
        eight else). "total": only their sum stays and each is reckoned again for each question, for very many features.
    progress : function of (done, all), optional
        Folds summed. What it raises ends the work.

    Attributes
    ----------
    classes : labels, shape (classes,)
    folds : int64, shape (trials,), from 0 on

    Raises
    ------
    ProblemError : shapes that do not fit

    Notes
    -----
    Exact: whole numbers whose squares sum up below 2^24 are summed in float32 without rounding, all else in float64.

    Examples
    --------
    >>> x = [[0.0, 1.0], [1.0, 0.2], [0.5, 0.4], [0.4, 0.9], [3.0, 2.0], [4.0, 2.5], [3.5, 3.0], [3.1, 2.2]]
    >>> sums = FoldSums(x, ["ball", "ball", "edge", "edge", "rod", "rod", "pin", "pin"], [0, 1] * 4)
    >>> sums.predictions(merge={"ball": "soft", "edge": "soft", "rod": "hard", "pin": "hard"}).tolist()
    ['soft', 'soft', 'soft', 'soft', 'hard', 'hard', 'hard', 'hard']
    """

    def __init__(
        self,
        x: ArrayLike,
        y: ArrayLike,
        folds: ArrayLike,
        *,
        keep: str = "folds",
        progress: Callable[[int, int], object] | None = None,
    ) -> None:
        text("keep", keep, ("folds", "total"))
        if progress is not None:
            callback("progress", progress)
        self._table = feature_table(x)
        self.classes, self._row = labelled(y, len(self._table))
        self.folds = numbers("folds", folds, np.int64)
        if self.folds.shape != (len(self._table),):
            raise refused("folds", f" has shape {self.folds.shape}: must be ({len(self._table)},), one a trial")
        self._names = np.unique(self.folds)
        if len(self._names) < 2:
            raise refused("folds", f" names {len(self._names)}: must be two at least")
        self._dtype = np.float32 if is_exact(self._table) else np.float64
        self._shift = None if self._dtype == np.float32 else self._table.mean(0, dtype=np.float64)
        self._sums: dict[int, ClassMoments] = {}
        total: ClassMoments | None = None
        with threads(several=self._table.shape[1] >= _WORTH_THREADS):
            for k, name in enumerate(self._names):
                moments = self._summed(name)
                total = moments if total is None else total + moments
                if keep == "folds":
                    self._sums[int(name)] = moments
                del moments
                if progress is not None:
                    progress(k + 1, len(self._names))
        assert total is not None  # there are two folds at least
        self._total = total

    def _summed(self, name: np.int64) -> ClassMoments:
        if int(name) in self._sums:
            return self._sums[int(name)]
        mine = np.flatnonzero(self.folds == name)
        return ClassMoments.of(
            self._table, self._row, len(self.classes), rows=mine, dtype=self._dtype, shift=self._shift
        )

    def predictions(
        self,
        *,
        merge: dict[Any, Any] | None = None,
        features: int | None = None,
        ridge: float = 0.0,
        priors: str = "training",
        progress: Callable[[int, int], object] | None = None,
    ) -> NDArray[Any]:
        """Predict each trial by an `LDA` that was trained on all other folds.

        Parameters
        ----------
        merge : dict from class to class, optional
            What each class counts as: the trials are told apart by that, as if they had been so labelled.
        features : int, 1 or more, optional
            Only the first so many: in rasters sample by sample, what was there until some time.
        ridge, priors
            As in `LDA`.
        progress : function of (done, all), optional
            Folds predicted. What it raises ends the work.

        Returns
        -------
        shape (trials,), of the kind of `y`, or of what it is merged into

        Raises
        ------
        ProblemError : a training set of one class, a class that is merged into none
        """
        if progress is not None:
            callback("progress", progress)
        model = LDA(ridge=ridge, priors=priors)
        count = self._table.shape[1]
        used = count if features is None else whole("features", features, 1, count)
        classes, into = self.classes, None
        if merge is not None:
            merge = instance("merge", merge, dict)
            missing = [name for name in self.classes.tolist() if name not in merge]
            if missing:
                raise refused("merge", f" says nothing of class {missing[0]!r}")
            classes, into = np.unique(
                words("merge", [merge[name] for name in self.classes.tolist()]), return_inverse=True
            )
        model.classes_ = classes
        shift = None if self._shift is None else self._shift[:used]
        predicted = np.empty(len(self._table), classes.dtype)
        with threads(several=self._table.shape[1] >= _WORTH_THREADS):
            for k, name in enumerate(self._names):
                training = self._total - self._summed(name)
                if into is not None:
                    training = training.merged(into, len(classes))
                model._from_moments(training if used == count else training.first(used), shift)
                for block, mine in blocks(self._table[:, :used], np.flatnonzero(self.folds == name), np.float64, None):
                    predicted[mine] = classes[(block @ model.coef_.T + model.intercept_).argmax(1)]
                if progress is not None:
                    progress(k + 1, len(self._names))
        return predicted


def fold_predictions(
    x: ArrayLike,
    y: ArrayLike,
    folds: ArrayLike,
    *,
    ridge: float = 0.0,
    priors: str = "training",
    keep: str = "folds",
    progress: Callable[[int, int], object] | None = None,
) -> NDArray[Any]:
    """Predict each trial by an `LDA` that was trained on all other folds.

    Each fold's sums are taken once; a training set is the whole less a fold, so ten folds cost little more than one.

    Parameters
    ----------
    x : numbers, shape (trials, features)
    y : labels, shape (trials,)
    folds : int, shape (trials,), from 0 on
        As in `FoldSums`, which answers several questions about the same trials.
    ridge : float, 0 or more
    priors : {"training", "equal"}
        As in `LDA`.
    keep : {"folds", "total"}
        As in `FoldSums`.
    progress : function of (done, all), optional
        Steps: a fold summed, a fold predicted. What it raises ends the work.

    Returns
    -------
    shape (trials,), of the kind of `y`

    Raises
    ------
    ProblemError : shapes that do not fit, or a training set of one class

    Notes
    -----
    150 000 trials of 5000 features, 300 classes, 10 folds: 3.75 TFLOP of products and 0.4 of factors.

    Examples
    --------
    >>> x = [[0.0], [4.0], [1.0], [5.0], [0.5], [4.5], [0.2], [4.2]]
    >>> fold_predictions(x, ["a", "b"] * 4, [0, 0, 0, 0, 1, 1, 1, 1]).tolist()
    ['a', 'b', 'a', 'b', 'a', 'b', 'a', 'b']
    """
    if progress is not None:
        callback("progress", progress)

    def part(begun: int) -> Callable[[int, int], object] | None:
        return None if progress is None else lambda done, every: progress(begun * every + done, 2 * every)

    sums = FoldSums(x, y, folds, keep=keep, progress=part(0))
    return sums.predictions(ridge=ridge, priors=priors, progress=part(1))
