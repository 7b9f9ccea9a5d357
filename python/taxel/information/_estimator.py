"""Base class of the classifiers: scikit-learn's estimator interface, without scikit-learn."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.errors import refused
from taxel._base.parameters import Parameters
from taxel._core import NotFittedError
from taxel.information._labels import words

__all__ = ["Classifier", "labelled"]


class Classifier(Parameters, ABC):
    """Base of classifiers that scikit-learn's `clone` and `cross_val_score` accept; Python checks the parameters."""

    classes_: NDArray[np.generic]
    _pairwise: ClassVar[bool] = False

    def __init__(self) -> None:
        self._check()

    @abstractmethod
    def predict(self, x: Any) -> NDArray[Any]:
        """Return a label for each trial."""

    def score(self, x: Any, y: ArrayLike) -> float:
        """Return the share of trials that are classified correctly."""
        return float(np.mean(self.predict(x) == words("y", y)))

    def __sklearn_tags__(self) -> Any:
        # Only scikit-learn calls this, so scikit-learn is installed.
        tags = sys.modules["sklearn.utils"]
        return tags.Tags(
            estimator_type="classifier",
            target_tags=tags.TargetTags(required=True),
            classifier_tags=tags.ClassifierTags(),
            input_tags=tags.InputTags(pairwise=self._pairwise),
        )

    def _fitted(self, name: str) -> Any:
        if not hasattr(self, name):
            raise NotFittedError(f"{type(self).__name__} was not fitted yet; call fit first")
        return getattr(self, name)


def labelled(y: ArrayLike, trials: int) -> tuple[NDArray[np.generic], NDArray[np.int64]]:
    """Return the classes and each trial's number among them.

    Raises
    ------
    ProblemError : another number of labels than trials, or one class
    """
    labels = words("y", y)
    if len(labels) != trials:
        raise refused("y", f" has {len(labels)} entries: must be {trials}, one a trial")
    classes, row = np.unique(labels, return_inverse=True)
    if len(classes) < 2:
        raise refused("y", f" names {len(classes)} class: must be two at least")
    return classes, row
