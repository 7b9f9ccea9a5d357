"""Trials dealt out to folds: labels evenly, groups whole."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import shown, whole
from taxel._core import ProblemError
from taxel.information._labels import belonging, words

__all__ = ["folds"]


def folds(labels: ArrayLike, *, count: int = 10, groups: ArrayLike | None = None, seed: int = 0) -> NDArray[np.int64]:
    """Deal trials out to folds, each label as evenly as can be; trials of a group are never split.

    Parameters
    ----------
    labels : labels, shape (trials,)
        Texts or whole numbers; two at least.
    count : int, 2 or more
        Folds; fewer where there are fewer groups.
    groups : labels, shape (trials,), optional
        What must not be split between folds: a person, a session, the variants of one trial.
    seed : int, 0 or more

    Returns
    -------
    int64, shape (trials,)
        The fold in which each trial is tested.

    Raises
    ------
    ProblemError : one label, fewer trials or groups than can be dealt out, or a label all of whose trials lie in one
        group (it could never be both trained and tested)

    Examples
    --------
    >>> folds(["ball", "edge"] * 4, count=2, seed=1).tolist()
    [0, 1, 0, 0, 1, 0, 1, 1]
    """
    truth = words("labels", labels)
    parts, random = whole("count", count, 2), np.random.default_rng(whole("seed", seed, 0))
    classes, row = np.unique(truth, return_inverse=True)
    if len(classes) < 2:
        values = f"all {shown(truth[0].item())}" if len(truth) else "[]"
        raise ProblemError(f"labels are {values}: must be two at least, or there is nothing to tell")
    if groups is None:
        if len(truth) < parts:
            raise ProblemError(f"{len(truth)} trials for {parts} folds: must be a trial a fold at least")
        alone = np.flatnonzero(np.bincount(row) < 2)
        if len(alone):
            raise ProblemError(
                f"label {shown(classes[alone[0]].item())} has one trial: must be two at least, to be trained and tested"
            )
        return _dealt(row, parts, random)
    belongs = belonging(groups, len(truth))
    for k, name in enumerate(classes):
        mine = np.unique(belongs[row == k])
        if len(mine) < 2:
            group = words("groups", groups)[np.flatnonzero(belongs == mine[0])[0]].item()
            raise ProblemError(
                f"label {shown(name.item())}: all its trials lie in group {shown(group)}, so it could never be both "
                f"trained and tested; must be two groups at least"
            )
    return _whole_groups(row, belongs, parts, random)


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
    held, fold = np.zeros((min(count, number), table.shape[1])), np.empty(number, np.int64)
    for group in order:
        crowd = ((held + table[group]) ** 2).sum(1) - (held**2).sum(1)
        fold[group] = int(np.lexsort((held.sum(1), crowd))[0])
        held[fold[group]] += table[group]
    return fold[belongs]
