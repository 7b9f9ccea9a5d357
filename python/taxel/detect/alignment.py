"""Labels aligned to what the sensor felt: each moved to the input spike that its event caused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import integer
from taxel._base.messages import counted, escaped
from taxel._core import ProblemError
from taxel.detect.ages import Ages, onsets
from taxel.detect.scoring import APART_US, Tally, tally
from taxel.spikes import SpikeTrains, to_ms, to_us

#: How far from its label an input spike may be, either way, ms.
WINDOW_MS = 50.0
#: Trains with more spikes a label than that are not compared with the labels: they fire throughout.
_MOST_A_LABEL = 4
#: Trains are alike that have so many missed and false more than the best one, or that share of the labels.
_ALIKE, _ALIKE_SHARE = 2, 0.05
#: Trains of those alike count whose median distance from the labels is within this of the least, ms.
_ALIKE_MS = 2.0


@dataclass(frozen=True, eq=False, repr=False)
class Alignment:
    """Hold by how much the labels of one name were moved to what the sensor felt.

    Attributes
    ----------
    label : str
    train : int, 0 or more, optional
        The input that the labels were moved to, by its place among the encoder's trains (signed ones split into ON
        and OFF). None: no input has a spike near any label, and the labels stay as they were given.
    example : int64, shape (labels,)
        In which example each label is, by its place among those that were learnt from.
    given : int64, shape (labels,), us
        The labels as they were given, ascending in each example.
    moved_ms : float64, shape (labels,), ms
        By how much each was moved, later is positive; NaN where no spike of the train belongs to it. Such a label is
        no target.
    """

    label: str
    train: int | None
    example: NDArray[np.int64]
    given: NDArray[np.int64]
    moved_ms: NDArray[np.float64]

    @property
    def unpaired(self) -> NDArray[np.bool_]:
        """Which labels have no spike that belongs to them, shape (labels,)."""
        return np.isnan(self.moved_ms)

    @property
    def median_ms(self) -> float:
        """The median of `moved_ms`."""
        return float(np.nanmedian(self.moved_ms))

    @property
    def largest_ms(self) -> float:
        """The `moved_ms` that is farthest from 0."""
        return float(self.moved_ms[np.nanargmax(np.abs(self.moved_ms))])

    def felt(self, example: int) -> NDArray[np.int64]:
        """Return when the sensor felt the events of an example, us, ascending; those without a pair are left out.

        Parameters
        ----------
        example : int, 0 or more

        Returns
        -------
        int64, shape (events,), us

        Raises
        ------
        ProblemError : a number that is not whole, or below 0
        """
        paired = (self.example == integer("example", example, 0)) & ~self.unpaired
        felt: NDArray[np.int64] = self.given[paired] + np.rint(to_us(self.moved_ms[paired])).astype(np.int64)
        return felt

    def to_dict(self) -> dict[str, Any]:
        """Return train, median and largest move (ms), and the labels without a pair (example, us) as plain values."""
        without = np.column_stack([self.example, self.given])[self.unpaired].tolist()
        return {"train": self.train, "median_ms": self.median_ms, "largest_ms": self.largest_ms, "unpaired": without}

    def __repr__(self) -> str:
        if self.train is None:
            return escaped(f"Alignment({self.label}: {counted(len(self.given), 'label')} as given)")
        moved = f"median {self.median_ms:+.3g} ms, largest {self.largest_ms:+.3g} ms"
        return escaped(f"Alignment({self.label}: {moved}, {self.unpaired.sum()} of {len(self.given)} without a pair)")


def align(
    patterns: Sequence[SpikeTrains],
    label: str,
    given: Sequence[NDArray[np.int64]],
    by_rule: Sequence[NDArray[np.float64]] | None,
    latency_ms: float,
    ages: Ages | None = None,
) -> Alignment:
    """Return by how much the labels of one name move to what the sensor felt, which is chosen over all patterns.

    The spikes of each input train, less the latency of the encoder, are scored as if they were detections. One train
    is chosen among those with nearly the fewest missed and false: first by the most found, then by the least distance
    from the labels at the median, then by its place. It gives each label the spike that is paired with it. The least
    age represents all trains of ages, one of which fires at every sample of a touch, by the spikes at which touches
    begin.

    Parameters
    ----------
    patterns : sequence of SpikeTrains, unsigned or graded
    label : str
    given : sequence of int64, shape (events,), us
        The labels of each pattern, ascending; one or more in all.
    by_rule : sequence of float64, shape (events,), us, optional
        When a plain rule felt each of them, NaN of those that it misses: then trains are compared with these times.
    latency_ms : float, ms
    ages : Ages, optional
        The trains of ages, if there are any.

    Returns
    -------
    Alignment

    Raises
    ------
    ProblemError : patterns of different numbers of trains
    """
    for k, pattern in enumerate(patterns):
        if len(pattern) != len(patterns[0]):
            raise ProblemError(f"example {k} has {counted(len(pattern), 'train')}, example 0 has {len(patterns[0])}")
    example = np.repeat(np.arange(len(given)), [len(times) for times in given])
    labels = np.concatenate([*given])
    felt = labels.astype(np.float64) if by_rule is None else np.concatenate([*by_rule])
    known = np.flatnonzero(np.isfinite(felt))
    starts = np.array([round(float(to_us(pattern.start))) for pattern in patterns])
    truth = felt[known].astype(np.int64) + (example[known] * APART_US - starts[example[known]])
    counts = np.sum([pattern.counts for pattern in patterns], axis=0)
    if ages is not None:
        counts[list(ages.trains)] = 0
    candidates = {
        train: [pattern[train] for pattern in patterns]
        for train in np.flatnonzero((counts > 0) & (counts <= _MOST_A_LABEL * len(truth))).tolist()
    }
    if ages is not None:
        candidates[ages.trains[0]] = [onsets(pattern, ages) for pattern in patterns]
    pairs = {}
    for train, spikes in candidates.items():
        times = [np.rint(to_us(ms - latency_ms)).astype(np.int64) for ms in spikes]
        fired = np.concatenate([t + (k * APART_US - starts[k]) for k, t in enumerate(times)])
        if (of_train := tally(fired, fired, truth, round(to_us(WINDOW_MS)))) is not None:
            pairs[train] = of_train
    best = _best(pairs, len(truth))
    if best is None:
        return Alignment(label, None, example, labels, np.zeros(len(example)))
    moved = np.full(len(example), np.nan)
    place = known[pairs[best].events]
    moved[place] = pairs[best].errors_ms + to_ms(felt[place] - labels[place])
    return Alignment(label, best, example, labels, moved)


def _best(pairs: Mapping[int, Tally], labels: int) -> int | None:
    """Return the train that shows best when the events were felt; None if it has no spike near any label."""
    left = dict(pairs)
    criteria: list[tuple[Callable[[Tally], float], float]] = [
        (lambda of: of.wrong, max(_ALIKE, _ALIKE_SHARE * labels)),
        (lambda of: -len(of.detected), 0),
        (lambda of: float(np.median(np.abs(of.errors_ms))) if len(of.detected) else np.inf, _ALIKE_MS),
    ]
    for worth, more in criteria:
        least = min(map(worth, left.values()), default=0.0) + more
        left = {train: of for train, of in left.items() if worth(of) <= least}
    best = min(left, default=None)
    return None if best is None or not len(pairs[best].detected) else best
