"""Nearest neighbours on pairwise distances."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import finite_numbers, numbers, whole
from taxel._base.errors import refused
from taxel.information._estimator import Classifier, labelled
from taxel.information.dual import gram_matrix

__all__ = ["NearestNeighbours", "distances_of", "majority", "squared_distances"]


class NearestNeighbours(Classifier):
    """Classify a trial by the majority of its nearest neighbours; on a tie, by the nearer ones.

    Parameters
    ----------
    neighbours : int, 1 or more

    Attributes
    ----------
    classes_ : shape (classes,)

    Raises
    ------
    ProblemError : a number of neighbours that is invalid

    Notes
    -----
    Thesis 5.6.3. Distances are of any kind: `taxel.metrics.pairwise`, or those of a Gram matrix (`distances_of`). Take
    one that is Euclidean over all trains; `taxel.metrics.van_rossum` of patterns sums over trains, which has no inner
    product and classifies 1 to 4 % fewer correctly.

    Examples
    --------
    >>> near = NearestNeighbours(neighbours=1).fit([[0.0, 3.0], [3.0, 0.0]], ["ball", "edge"])
    >>> near.predict([[1.0, 2.0]])
    array(['ball'], dtype='<U4')
    """

    _pairwise = True
    row_: NDArray[np.int64]

    def __init__(self, *, neighbours: int = 5) -> None:
        self.neighbours = neighbours
        super().__init__()

    def _check(self) -> None:
        whole("neighbours", self.neighbours, 1)

    def fit(self, distances: ArrayLike, y: ArrayLike) -> Self:
        """Store the labels of the training trials.

        Parameters
        ----------
        distances : float64, shape (trials, trials), in any unit
            Of the training trials from each other; only their number is looked at.
        y : labels, shape (trials,)

        Raises
        ------
        ProblemError : a matrix that is not square, or labels that are invalid
        """
        square = finite_numbers("distances", distances)
        if square.ndim != 2 or square.shape[0] != square.shape[1]:
            raise refused("distances", f" has shape {square.shape}: must be (trials, trials)")
        self.classes_, self.row_ = labelled(y, len(square))
        return self

    def predict(self, distances: ArrayLike) -> NDArray[Any]:
        """Return a label a trial.

        Parameters
        ----------
        distances : float64, shape (trials, training trials), in any unit
            Infinity where a training trial is no neighbour of a trial, as of itself.

        Raises
        ------
        ProblemError : not fitted, another number of training trials, or NaN

        Examples
        --------
        >>> x = np.array([0.0, 1.0, 4.0, 5.0])
        >>> fitted = NearestNeighbours().fit(np.abs(x[:, None] - x), ["a", "a", "b", "b"])
        >>> fitted.predict(np.abs(np.array([[4.2]]) - x)).tolist()
        ['b']
        """
        row = self._fitted("row_")
        across = numbers("distances", distances, np.float64)
        finite_numbers("distances", np.where(across == np.inf, 0.0, across))
        if across.ndim != 2 or across.shape[1] != len(row):
            raise refused("distances", f" has shape {across.shape}: must be (trials, {len(row)})")
        near = np.argsort(across, axis=1, kind="stable")[:, : self.neighbours]
        return np.asarray(self.classes_[majority(row[near], len(self.classes_))])


def distances_of(gram: ArrayLike) -> NDArray[np.float64]:
    """Return the Euclidean distances of trials from their inner products.

    Parameters
    ----------
    gram : float64, shape (trials, trials), in the features' unit squared

    Returns
    -------
    float64, shape (trials, trials)

    Raises
    ------
    ProblemError : a matrix that is not square or not symmetric

    Examples
    --------
    >>> distances_of([[1.0, 0.0], [0.0, 1.0]]).round(3).tolist()
    [[0.0, 1.414], [1.414, 0.0]]
    """
    return np.asarray(np.sqrt(np.maximum(squared_distances(gram_matrix(gram)), 0.0)))


def squared_distances(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared distances of inner products; rounding errors may leave some below 0."""
    length = np.diag(square)
    return np.asarray(length + length[:, None] - 2 * square)


def majority(near: NDArray[np.int64], classes: int) -> NDArray[np.int64]:
    """Return the most frequent class of each row; on a tie, the class whose members come first."""
    votes = np.zeros((len(near), classes))
    rows = np.repeat(np.arange(len(near)), near.shape[1])
    np.add.at(votes, (rows, near.ravel()), 1.0)
    # One vote outweighs all differences in place.
    place = np.tile(np.linspace(0, 1, near.shape[1]) / (near.shape[1] + 1), len(near))
    np.add.at(votes, (rows, near.ravel()), -place / near.shape[1])
    return np.asarray(votes.argmax(1))
