"""Trials dealt out to folds: labels evenly, groups whole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import integer, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.information._labels import belonging, labelled, words

__all__ = ["Split", "TrialFold", "folds", "split"]


def folds(labels: ArrayLike, *, count: int = 10, groups: ArrayLike | None = None, seed: int = 0) -> NDArray[np.int64]:
    """Deal trials out to folds, each label as evenly as possible; trials of a group are never split.

    Parameters
    ----------
    labels : labels, shape (trials,)
        Texts or whole numbers; at least two different labels.
    count : int, 2 or more
        Number of folds; fewer if there are fewer groups.
    groups : labels, shape (trials,), optional
        Trials that must not be split between folds: of a person, a session, the variants of one trial.
    seed : int, 0 or more

    Returns
    -------
    int64, shape (trials,)
        The fold in which each trial is tested.

    Raises
    ------
    ProblemError : one label, fewer trials or groups than can be dealt out, or a label all of whose trials are in one
        group (it could never be both trained and tested)

    Examples
    --------
    >>> folds(["ball", "edge"] * 4, count=2, seed=1).tolist()
    [0, 1, 0, 0, 1, 0, 1, 1]
    """
    truth = words("labels", labels)
    parts, random = integer("count", count, 2), np.random.default_rng(integer("seed", seed, 0))
    classes, row = np.unique(truth, return_inverse=True)
    if len(classes) < 2:
        values = f"all {shown(truth[0].item())}" if len(truth) else "[]"
        raise refused("labels", f" are {values}: must be at least two different labels")
    if groups is None:
        if len(truth) < parts:
            raise ProblemError(
                f"{counted(len(truth), 'trial')} for {counted(parts, 'fold')}: must be at least one trial per fold"
            )
        alone = np.flatnonzero(np.bincount(row) < 2)
        if len(alone):
            raise ProblemError(
                f"label {shown(classes[alone[0]].item())} has one trial: must be at least two, to be trained and tested"
            )
        return _dealt(row, parts, random)
    belongs = belonging(groups, len(truth))
    for k, name in enumerate(classes):
        group_numbers = np.unique(belongs[row == k])
        if len(group_numbers) < 2:
            group = words("groups", groups)[np.flatnonzero(belongs == group_numbers[0])[0]].item()
            raise ProblemError(
                f"label {shown(name.item())}: all its trials are in group {shown(group)}, so it cannot be both "
                "trained and tested; its trials must be in at least two groups"
            )
    return _whole_groups(row, belongs, parts, random)


@dataclass(frozen=True, eq=False)
class TrialFold:
    """Trials that are tested together, those that train for them, and test sets among the latter.

    Attributes
    ----------
    test, train : int64
    inner : tuple of int64
        Empty if a label of the training trials cannot be dealt out.
    """

    test: NDArray[np.int64]
    train: NDArray[np.int64]
    inner: tuple[NDArray[np.int64], ...]


@dataclass(frozen=True, eq=False)
class Split:
    """Labelled trials dealt out to folds, and the training trials of each fold to inner folds.

    Attributes
    ----------
    classes : labels, shape (classes,)
    row : int64, shape (trials,)
        The number of each trial's class.
    fold : int64, shape (trials,)
    parts : tuple of TrialFold, one a fold
    """

    classes: NDArray[np.generic]
    row: NDArray[np.int64]
    fold: NDArray[np.int64]
    parts: tuple[TrialFold, ...]

    @property
    def is_class(self) -> NDArray[np.float64]:
        """1 where a trial is of a class, else 0; shape (trials, classes)."""
        return np.asarray(self.row[:, None] == np.arange(len(self.classes)), np.float64)


def split(
    labels: ArrayLike, trials: int, *, count: int, inner: int = 5, groups: ArrayLike | None = None, seed: int = 0
) -> Split:
    """Deal so many trials out to folds, and within each training set to `inner` folds.

    Raises
    ------
    ProblemError : as `folds`, or another number of labels
    """
    classes, row = labelled(labels, trials)
    fold = folds(labels, count=count, groups=groups, seed=seed)
    belongs = None if groups is None else belonging(groups, trials)
    parts = []
    for name in range(int(fold.max()) + 1):
        train = np.flatnonzero(fold != name)
        inner_groups = _inside(row[train], None if belongs is None else belongs[train], inner, seed)
        parts.append(TrialFold(np.flatnonzero(fold == name), train, tuple(train[group] for group in inner_groups)))
    return Split(classes, row, fold, tuple(parts))


def _inside(
    row: NDArray[np.int64], belongs: NDArray[np.int64] | None, count: int, seed: int
) -> list[NDArray[np.int64]]:
    """Return the inner test sets; none where a label cannot be dealt out."""
    try:
        fold = folds(row, count=min(count, len(row)), groups=belongs, seed=seed + 1)
    except ProblemError:
        return []
    return [np.flatnonzero(fold == k) for k in range(int(fold.max()) + 1)]


def _dealt(row: NDArray[np.int64], count: int, random: np.random.Generator) -> NDArray[np.int64]:
    """Deal label after label, on from where the last one ended, so that folds are of one size, too."""
    order = random.permutation(len(row))
    order = order[np.argsort(row[order], kind="stable")]
    fold = np.empty(len(row), np.int64)
    fold[order] = np.arange(len(row)) % count
    return fold


def _whole_groups(
    row: NDArray[np.int64], belongs: NDArray[np.int64], count: int, random: np.random.Generator
) -> NDArray[np.int64]:
    """Give group after group, the largest first, to the fold that its labels are missing from most."""
    number = int(belongs.max()) + 1
    table = np.zeros((number, int(row.max()) + 1))
    np.add.at(table, (belongs, row), 1.0)
    order = random.permutation(number)
    order = order[np.argsort(-table[order].sum(1), kind="stable")]
    counts, fold = np.zeros((min(count, number), table.shape[1])), np.empty(number, np.int64)
    for group in order:
        crowd = ((counts + table[group]) ** 2).sum(1) - (counts**2).sum(1)
        fold[group] = int(np.lexsort((counts.sum(1), crowd))[0])
        counts[fold[group]] += table[group]
    return fold[belongs]
