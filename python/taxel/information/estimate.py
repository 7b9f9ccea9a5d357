"""The bits that answers hold about labels, with an interval, and a test against zero."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy  # its modules load when they are first used
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import callback, finite, integer, number, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.information._labels import belonging, one_label_a_group, words
from taxel.information.bits import (
    corrected,
    label_entropy,
    local_information,
    panzeri_treves,
    plug_in,
    relevant_responses,
)

__all__ = ["Estimate", "ZeroTest", "estimate", "zero_test"]

#: Trials a label and relevant response that keep the corrected value within .05 bit (simulated, 3 to 10 labels).
TRIALS_A_RESPONSE = 7
#: Cells in memory at a time while trials are redrawn.
_CELLS = 1 << 21
#: Number of counts that distinguishes shares finely enough.
_FINE = 1 << 36


@dataclass(frozen=True, eq=False)
class Estimate:
    """Hold the information of answers about labels, all in bits.

    Attributes
    ----------
    bits : float, bits
        `corrected`, held within 0 and `most` as the interval is.
    interval : (float, float), bits
        Range of the bits when trials, or whole groups, are redrawn, shifted onto `bits`. With few trials it holds the
        truth less often than stated: an interval of 95 % in some 55 to 99 % of cases at 20 trials a label, in 78 to 95
        % at 40. If fewer trials were named wrongly than there are labels, redraws miss errors that did not occur. The
        interval then reaches down to what Fano's inequality leaves with the largest share of errors that so few allow
        (Clopper and Pearson, trial by trial).
    plug_in : float, bits
        As counted.
    corrected : float, bits
        As counted, minus the bias of Panzeri and Treves; the mean over draws. With few trials it may be below 0 or
        above `most`.
    most : float, bits
        The labels' entropy: the largest possible value.
    right : float, from 0 to 1
        The share of trials whose answer is their label.
    counts : int64, shape (draws, labels, labels)
    classes : labels, shape (labels,)
    local : float64, shape (trials,), bits
        Information of each trial's answer, the mean over draws.
    warnings : tuple of str
        Warnings about the number of trials for each label and about the interval.
    """

    bits: float
    interval: tuple[float, float]
    plug_in: float
    corrected: float
    most: float
    right: float
    counts: NDArray[np.int64]
    classes: NDArray[np.generic]
    local: NDArray[np.float64] = field(repr=False)
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as JSON holds them."""
        return {
            "bits": round(self.bits, 4),
            "interval": [round(end, 4) for end in self.interval],
            "plug_in": round(self.plug_in, 4),
            "corrected": round(self.corrected, 4),
            "most": round(self.most, 4),
            "right": round(self.right, 4),
            "warnings": list(self.warnings),
        }

    def __repr__(self) -> str:
        low, high = self.interval
        return (
            f"Estimate({self.bits:.2f} of {self.most:.2f} bits [{low:.2f} {high:.2f}], {100 * self.right:.0f} % right)"
        )


@dataclass(frozen=True)
class ZeroTest:
    """Hold the bits that are estimated where labels are shuffled before training.

    Attributes
    ----------
    shuffled : tuple of float, bits
        Corrected bits, one value for each shuffle.
    level : float, bits
        95 % of them are below it: an estimate that is not above it cannot be distinguished from 0 bits.
    p : float, from 0 to 1
        Share of shuffles that give as many bits as were found; never below 1 / (shuffles + 1).

    Notes
    -----
    Use it only as a test of zero. If the mean of the shuffled bits were subtracted, a perfect answer would lose bits.
    """

    shuffled: tuple[float, ...]
    level: float
    p: float

    def __str__(self) -> str:
        n = len(self.shuffled)
        return f"95 % below {self.level:.2f} bits; {round(self.p * (n + 1)) - 1} of {n} reach the measured bits"


def estimate(
    labels: ArrayLike,
    responses: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    redraws: int = 400,
    confidence: float = 0.95,
    seed: int = 0,
) -> Estimate:
    """Estimate how many bits responses hold about labels, with an interval.

    Parameters
    ----------
    labels : labels, shape (trials,)
        Texts or whole numbers; at least two different labels.
    responses : labels, shape (trials,) or (draws, trials)
        The answers; several draws (of the sampling's phase, of the folds) are averaged.
    groups : labels, shape (trials,), optional
        Trials that belong together (person, session, pose): whole groups are redrawn, and if there are few, Student's t
        widens the interval.
    redraws : int, 2 or more
    confidence : float, between 0 and 1
    seed : int, 0 or more

    Returns
    -------
    Estimate

    Raises
    ------
    ProblemError : one label, unequal lengths, or an entry that is not a label

    Examples
    --------
    >>> estimate(["ball"] * 40 + ["edge"] * 40, ["ball"] * 38 + ["edge"] * 42)
    Estimate(0.85 of 1.00 bits [0.57 0.99], 98 % right)
    """
    truth = words("labels", labels)
    try:
        array = np.asarray(responses)
    except (ValueError, TypeError):
        array = np.empty(0, object)
    answered = np.stack([words("responses", row) for row in np.atleast_2d(array)]) if array.size else array
    if answered.ndim != 2 or answered.shape[1] != len(truth) or not len(truth):
        raise refused(
            "responses", f" has shape {array.shape}: must be ({len(truth)},), one per label, or (draws, {len(truth)})"
        )
    share = number("confidence", confidence)
    if not 0 < share < 1:
        raise refused("confidence", f" is {shown(confidence)}: must be between 0 and 1")
    rounds, random = integer("redraws", redraws, 2), np.random.default_rng(integer("seed", seed, 0))
    if (truth.dtype.kind == "U") != (answered.dtype.kind == "U"):
        raise ProblemError("labels and responses are of two kinds: must both be texts, or both numbers")
    classes = np.union1d(truth, answered)
    row, column = (np.searchsorted(classes, names) for names in (truth, answered))
    if len(np.unique(row)) < 2:
        raise refused(
            "labels",
            f" are all {shown(truth[0].item())}: must be at least two different labels",
        )
    belongs = None if groups is None else belonging(groups, len(truth))
    cells = row * len(classes) + column
    counts = _tables(cells, np.ones((1, len(truth)), np.int64), len(classes))[0]
    most = float(label_entropy(counts[0]))
    bits = float(_held(counts[None])[0])
    local = np.mean([local_information(table).ravel()[cell] for table, cell in zip(counts, cells, strict=True)], 0)
    low, high = _interval(cells, row, belongs, len(classes), rounds, share, random)
    n = np.bincount(row)
    prior, wrong = n[n > 0] / len(truth), int((row != counts.sum(0).argmax(0)[column]).any(0).sum())
    if wrong <= len(prior):
        # With so few errors, redraws do not show where others would lie.
        low = min(low, most - bits - _left_open(prior, wrong, len(truth), share))
    relevant = relevant_responses(counts)[:, np.unique(row)].mean()
    interval = max(0.0, bits + low), min(most, bits + high)
    return Estimate(
        bits=bits,
        interval=interval,
        plug_in=float(np.mean(plug_in(counts))),
        corrected=float(np.mean(corrected(counts))),
        most=most,
        right=float(np.mean(answered == truth)),
        counts=counts,
        classes=classes,
        local=local,
        warnings=_warnings(int(n[n > 0].min()), float(relevant), interval),
    )


def zero_test(
    answer: Callable[[NDArray[Any]], ArrayLike],
    labels: ArrayLike,
    found: float,
    *,
    groups: ArrayLike | None = None,
    shuffles: int = 20,
    seed: int = 0,
) -> ZeroTest:
    """Test against zero: shuffle the labels before training, and estimate the bits again.

    Parameters
    ----------
    answer : function of labels, shape (trials,)
        Trains again on these labels and returns the responses, shape (trials,).
    labels : labels, shape (trials,)
    found : float, bits
        The estimate with the true labels.
    groups : labels, shape (trials,), optional
        If each group has a single label, the labels of whole groups are shuffled; else labels are shuffled within each
        group.
    shuffles : int, 1 or more
    seed : int, 0 or more

    Returns
    -------
    ZeroTest

    Raises
    ------
    ProblemError : labels that are invalid

    Examples
    --------
    >>> test = zero_test(lambda labels: labels, ["ball", "edge"] * 20, 1.0, shuffles=3)
    >>> len(test.shuffled)
    3
    """
    callback("answer", answer)
    truth, random = words("labels", labels), np.random.default_rng(integer("seed", seed, 0))
    belongs = None if groups is None else belonging(groups, len(truth))
    there = finite("found", found)
    if not len(truth):
        raise refused("labels", " is []: must contain at least one trial")
    classes, row = np.unique(truth, return_inverse=True)
    bits = []
    for _ in range(integer("shuffles", shuffles, 1)):
        mixed = _shuffled(row, belongs, random)
        answered = np.searchsorted(classes, words("responses", answer(classes[mixed])))
        if answered.shape != row.shape or answered.max() >= len(classes):
            raise refused("answer", " must return one of the labels for each trial")
        bits.append(
            float(panzeri_treves(_tables(mixed * len(classes) + answered, np.ones((1, len(row))), len(classes))[0]))
        )
    return ZeroTest(
        tuple(bits),
        float(np.quantile(bits, 0.95)),
        (1 + sum(b >= there for b in bits)) / (1 + len(bits)),
    )


def _shuffled(row: NDArray[np.int64], belongs: NDArray[np.int64] | None, random: Any) -> NDArray[np.int64]:
    if belongs is None:
        return np.asarray(random.permutation(row))
    if one_label_a_group(row, belongs):
        first = np.unique(belongs, return_index=True)[1]
        return np.asarray(random.permutation(row[first])[belongs])
    mixed = row.copy()
    for group in range(belongs.max() + 1):
        members = np.flatnonzero(belongs == group)
        mixed[members] = random.permutation(row[members])
    return mixed


def _tables(cells: NDArray[np.int64], weights: NDArray[Any], classes: int) -> NDArray[np.int64]:
    """Return the tables of each redraw and draw, shape (redraws, draws, labels, labels)."""
    draws = np.atleast_2d(cells)
    tables = np.zeros((len(draws), len(weights) * classes**2))
    for d, cell in enumerate(draws):
        flat = np.arange(len(weights))[:, None] * classes**2 + cell
        tables[d] = np.bincount(flat.ravel(), weights.ravel(), tables.shape[1])
    shaped = np.rint(tables).astype(np.int64).reshape(len(draws), len(weights), classes, classes).swapaxes(0, 1)
    return np.ascontiguousarray(shaped if cells.ndim == 2 else shaped[:, 0])


def _held(tables: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the corrected bits of draws, the mean over these, within 0 and the labels' entropy.

    Parameters
    ----------
    tables : int64, shape (redraws, draws, labels, labels)
        All draws of a redraw are of the same labels.

    Returns
    -------
    float64, shape (redraws,), bits
    """
    # Draws are averaged before they are limited, so perfect draws weigh slightly more than others.
    return np.asarray(np.clip(corrected(tables).mean(axis=1), 0.0, label_entropy(tables[:, 0])))


def _interval(
    cells: NDArray[np.int64],
    row: NDArray[np.int64],
    belongs: NDArray[np.int64] | None,
    classes: int,
    redraws: int,
    confidence: float,
    random: np.random.Generator,
) -> tuple[float, float]:
    """Return both ends as distances from the estimate."""
    units = np.arange(len(row)) if belongs is None else belongs
    owner = np.unique(units, return_index=True)[1]
    # Where each unit has one label, the number of units a label is part of the design, and redraws keep it.
    strata = row[owner] if belongs is None or one_label_a_group(row, belongs) else np.zeros(len(owner), np.int64)
    members = [np.flatnonzero(strata == s) for s in np.unique(strata)]
    estimates = []
    at_once = max(1, _CELLS // (len(cells) * classes**2))
    for first in range(0, redraws, at_once):
        count = min(at_once, redraws - first)
        weights = np.zeros((count, len(owner)), np.int64)
        for group in members:
            weights[:, group] = random.multinomial(len(group), np.full(len(group), 1 / len(group)), size=count)
        estimates.append(_held(_tables(cells, weights[:, units], classes)))
    redrawn = np.concatenate(estimates)
    ends = np.quantile(redrawn, [(1 - confidence) / 2, (1 + confidence) / 2]) - redrawn.mean()
    if belongs is not None:
        free = max(1, len(owner) - 1)
        wider = scipy.special.stdtrit(free, (1 + confidence) / 2) / scipy.special.ndtri((1 + confidence) / 2)
        ends *= wider * np.sqrt(len(owner) / free)
    return float(min(ends[0], 0.0)), float(max(ends[1], 0.0))


def _left_open(prior: NDArray[np.float64], wrong: int, trials: int, confidence: float) -> float:
    """Return how many bits the labels may lose where so few of so many trials were named wrongly.

    By Fano's inequality, with Clopper and Pearson's upper end for the share of errors.
    """
    share = float(scipy.special.betaincinv(wrong + 1, max(trials - wrong, 1e-9), (1 + confidence) / 2))
    even = np.where(np.eye(len(prior), dtype=bool), 1 - share, share / (len(prior) - 1))
    table = np.rint(_FINE * prior[:, None] * even)
    return float(label_entropy(table) - plug_in(table))


def _warnings(least: int, relevant: float, interval: tuple[float, float]) -> tuple[str, ...]:
    lines = []
    needed = int(np.ceil(TRIALS_A_RESPONSE * relevant))
    if least < needed:
        lines.append(
            f"only {least} trials of a label: with fewer than {needed}, the bits may be too high by more than .05"
        )
    half = (interval[1] - interval[0]) / 2
    if half > 0.1:
        lines.append(f"uncertain by {half:.2f} bit: more trials narrow it")
    return tuple(lines)
