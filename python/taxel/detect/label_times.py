"""Whether the labels of a training are at the times of what the sensor felt, and whether a tare holds a touch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.progress import reporting
from taxel._core import ProblemError
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.examples import Example
from taxel.detect.floors import floor_of
from taxel.detect.loads import Loads, clock_of, lacks_neighbours
from taxel.detect.scoring import score
from taxel.detections import Detections
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare

#: The number of loaded taxels of the smallest touch, and the peak that noise does not reach.
TOUCH, PEAK = 2.0, 6.0
#: Distances between labels and touches are looked at up to this, ms, and are the same that differ by this.
_FARTHEST_MS, _SAME_MS = 1000.0, 50.0
#: Labels are off where this share of them has the same distance, and so many; of fewer chance may do so. They are not
#: where as many are near.
_SHARE, _LEAST = 0.8, 5
#: Marks that a hand sets live have a common distance of at most that, ms, and the same share of them lies in a stretch
#: of at most that, ms; all but a few in so many standard deviations around it, in steps of that, ms.
_HAND_MS, _HAND_SPREAD_MS, _DEVIATIONS, _STEP_MS = 500.0, 170.0, 3.0, 10.0
#: The standard deviation of normal values that have the median deviation of 1.
_NORMAL = 1.4826
#: Chance brings as many labels to one distance with at most this probability.
_CHANCE = 0.01
#: Touches that are so many times as many as the labels are at some distance of them by chance.
_MOST_A_LABEL = 4
#: So many labels that all lie in the first such share of a recording may be in another unit of time.
_SEVERAL, _FIRST = 4, 0.01
#: This share of a tare, at its beginning, holds no touch.
_EARLY = 0.25
#: These shares of a tare are looked at for a touch, to say how much of it is quiet.
_SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, _EARLY)
#: A taxel varies more than its noise at the beginning from so many times that on, and this part of the noise floor.
_TIMES, _OF_FLOOR = 3.0, 6.0


class Off(NamedTuple):
    """By how much labels of one name lie after what was felt, ms; how many lie there, how many of them too far, of all.

    `within_ms` is how far marks that a hand set live spread around that distance; 0 of other labels.
    """

    ms: float
    alike: int
    beyond: int
    labels: int
    within_ms: float = 0.0

    @property
    def is_far(self) -> bool:
        """Whether more than a few of the labels lie too far from what was felt to be aligned."""
        return self.beyond > (1 - _SHARE) * self.alike

    def __str__(self) -> str:
        side = "after" if self.ms > 0 else "before"
        hand = f" and within {self.within_ms:.0f} ms of that, as keys pressed live" if self.within_ms else ""
        return f"{self.alike} of {self.labels} lie {abs(self.ms):.0f} ms {side} what the sensor felt (median){hand}"


class FeltLoads:
    """Hold when (checked) examples were loaded, to compare labels with: by area, of channels by the peak.

    Loads are measured from the beginning of a tare that is of its own recording, as late labels let it end in a touch.

    Parameters
    ----------
    examples : sequence of Example, checked
        Nothing is known where one has no tare, or is of spike trains.
    """

    def __init__(self, examples: Sequence[Example]) -> None:
        known = all(example.tare is not None and not isinstance(example.source, SpikeTrains) for example in examples)
        early = [example if (tare := _early(example)) is None else example._replace(tare=tare) for example in examples]
        self._loads, self._felt = None, {"peak": PEAK} | ({} if lacks_neighbours(examples) else {"area": TOUCH})
        if known and examples:
            clocks = [clock_of(example) for example in early]
            self._loads = Loads(early, clocks, floor_of(early), reporting(None), list(self._felt))

    def near(self, label: str) -> tuple[int, int, int] | None:
        """Return how many labels of a name lie within 50 ms of a load, of its begin or end, and how many there are.

        None where it is not known.
        """
        if self._loads is None:
            return None
        reach = round(to_us(WINDOW_MS))
        times = self._loads.truth(label, self._loads.whole_examples)
        near, at_edge = np.zeros(len(times), np.bool_), np.zeros(len(times), np.bool_)
        for quantity, threshold in self._felt.items():
            edges = begins, ends = [np.sort(edge.t) for edge in self._loads.edges(quantity, threshold, 1.0, 1)]
            near |= np.searchsorted(begins, times + reach, side="right") > np.searchsorted(ends, times - reach)
            for edge in edges:
                at_edge |= np.diff(np.searchsorted(edge, [times - reach, times + reach]), axis=0)[0] > 0
        return int(near.sum()), int(at_edge.sum()), len(times)

    def rank(self, label: str, reach_ms: float) -> int:
        """Return how many labels of a name, and begins of loads, have no pair that near; or ends, if that is fewer."""
        assert self._loads is not None
        times = self._loads.truth(label, self._loads.whole_examples)
        edges = (edge for felt in self._felt.items() for edge in self._loads.edges(*felt, 1.0, 1))
        scores = (score(Detections([label] * len(t), t, known), {label: times}, reach_ms) for t, known, _ in edges)
        return min(found.rank[0] for found in scores)

    def distances(self, labels: Iterable[str]) -> dict[str, Off]:
        """Return by how much labels lie after what was felt, of each name of which most lie at one distance.

        What was felt are the begins or the ends of loads, whichever more labels follow. Where no distance is the same,
        it is that of marks that a hand set live.
        """
        if self._loads is None:
            return {}
        quantity = "area" if "area" in self._felt else "peak"
        felt = [edge.t for edge in self._loads.edges(quantity, self._felt[quantity], 1.0, 1)]
        found = {}
        for label in labels:
            times = self._loads.truth(label, self._loads.whole_examples)
            steady = [felt_edge for edge in felt for felt_edge in _steady(times, edge)]
            near = [felt_edge for felt_edge in steady if abs(felt_edge[0].ms) <= WINDOW_MS]
            by_hand = [] if steady else [felt_edge for edge in felt for felt_edge in _by_hand(times, edge)]
            if alike := near or steady:
                found[label], _ = min(alike, key=lambda found_edge: (-found_edge[0].alike, found_edge[1]))
            elif by_hand:
                found[label], _ = min(by_hand, key=lambda found_edge: found_edge[1])
        return found


def _apart(times: NDArray[np.int64], felt: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distances of labels from these times up to the farthest, ms, ascending, and the labels' places."""
    far = round(to_us(_FARTHEST_MS))
    reach = np.searchsorted(felt, [times - far, times + far])
    label_index = np.repeat(np.arange(len(times)), reach[1] - reach[0])
    beside = np.concatenate([np.arange(*span) for span in reach.T])
    apart = to_ms(times[label_index] - felt[beside])
    order = np.argsort(apart, kind="stable")
    return apart[order], label_index[order]


def _reached(times: NDArray[np.int64], felt: NDArray[np.int64]) -> int:
    """Return how many of these times lie up to the farthest from a label, at most as many as there are labels.

    Labels in another unit of time, which lie close together, all have the same distance from one of them.
    """
    far, ordered = round(to_us(_FARTHEST_MS)), np.sort(times)
    first, last = np.searchsorted(ordered, [felt - far, felt + far])
    return min(len(times), int(np.count_nonzero(last > first)))


def _by_hand(times: NDArray[np.int64], felt: NDArray[np.int64]) -> Iterator[tuple[Off, float]]:
    """Yield the distance around which most labels lie from these times as a hand sets them, with its spread, ms."""
    least = int(np.ceil(max(_LEAST, _SHARE * len(times))))
    if _reached(times, felt) < least or len(felt) > _MOST_A_LABEL * len(times):
        return
    apart, label_index = _apart(times, felt)
    counts, begin, narrowest = np.zeros(len(times), np.int64), 0, (np.inf, 0, 0)
    for end, label in enumerate(label_index, start=1):
        counts[label] += 1
        while np.count_nonzero(counts) >= least:
            narrowest = min(narrowest, (float(apart[end - 1] - apart[begin]), begin, end))
            counts[label_index[begin]] -= 1
            begin += 1
    spread_ms, *stretch = narrowest
    if spread_ms > _HAND_SPREAD_MS or _by_chance(least, len(times), len(apart), spread_ms) > _CHANCE:
        return
    ms = float(np.median(apart[slice(*stretch)]))
    nearest = np.full(len(times), np.inf)
    np.minimum.at(nearest, label_index, np.abs(apart - ms))
    within_ms = _STEP_MS * np.ceil(_DEVIATIONS * _NORMAL * float(np.median(nearest)) / _STEP_MS)
    if abs(ms) <= _HAND_MS:
        yield _off(ms, apart, label_index, np.abs(apart - ms) <= within_ms, len(times), float(within_ms)), spread_ms


def _off(
    ms: float,
    apart: NDArray[np.float64],
    label_index: NDArray[np.int64],
    here: slice | NDArray[np.bool_],
    labels: int,
    within_ms: float = 0.0,
) -> Off:
    """Return the distance of labels whose pairs lie here."""
    near = np.unique(label_index[here][np.abs(apart[here]) <= WINDOW_MS])
    alike = np.unique(label_index[here])
    return Off(ms, len(alike), len(alike) - len(near), labels, within_ms)


def _by_chance(least: int, labels: int, pairs: int, spread_ms: float) -> float:
    """Return how probable it is that so many labels have pairs in one of the stretches of that length by chance."""
    stretches = 2 * _FARTHEST_MS / max(spread_ms, 1.0)
    share = min(1.0, pairs / labels / stretches)
    return stretches * sum(comb(labels, k) * share**k * (1 - share) ** (labels - k) for k in range(least, labels + 1))


def _steady(times: NDArray[np.int64], felt: NDArray[np.int64]) -> Iterator[tuple[Off, float]]:
    """Yield the distances that most labels have from one of these times, each with its spread, ms."""
    least = max(_LEAST, _SHARE * len(times))
    if _reached(times, felt) < least or len(felt) > _MOST_A_LABEL * len(times):
        return
    apart, label_index = _apart(times, felt)
    for k, end in enumerate(np.searchsorted(apart, apart + _SAME_MS, side="right")):
        if end - k >= least and len(np.unique(label_index[k:end])) >= least:
            off = _off(float(np.median(apart[k:end])), apart, label_index, slice(k, end), len(times))
            yield off, float(apart[end - 1] - apart[k])


def early(labels: Mapping[str, NDArray[np.int64]], first_us: int, last_us: int) -> str:
    """Return that all labels of a recording lie in its first hundredth, as times in another unit do; else "".

    Examples
    --------
    >>> early({"contact": np.array([1200, 2400, 3100, 4000])}, 0, 5_000_000)
    'lie in the first 0.004 s of 5 s: are their times in us?'
    """
    times = np.concatenate([*labels.values(), np.empty(0, np.int64)])
    lasts = last_us - first_us
    latest = int(times.max(initial=first_us)) - first_us
    if len(times) < _SEVERAL or not 0 < latest < _FIRST * lasts:
        return ""
    return f"lie in the first {latest / 1e6:.3g} s of {lasts / 1e6:.3g} s: are their times in us?"


def unlabelled_us(examples: Sequence[Example], label: str) -> tuple[int, int]:
    """Return how long recordings last further before their first label and behind their last than labels lie apart, us.

    And how long they last. Of an example without the label nothing counts.

    Parameters
    ----------
    examples : sequence of Example, checked
    label : str
    """
    outside = total = 0
    for example in examples:
        times = np.sort(example.labels.get(label, np.empty(0, np.int64)))
        if isinstance(example.source, SpikeTrains):
            first, last = (round(to_us(edge)) for edge in (example.source.start, example.source.stop))
        else:
            t = example.source.t  # type: ignore[union-attr]
            first, last = (int(t[0]), int(t[-1])) if len(t) else (0, 0)
        if len(times):
            apart = int(np.diff(times).max(initial=0))
            outside += max(0, int(times[0]) - first - apart) + max(0, last - int(times[-1]) - apart)
            total += last - first
    return outside, total


def held_by_tare(examples: Sequence[Example]) -> int:
    """Return how many taxels vary far more in the tare of an example than at its beginning, as a touch is in it.

    Of several examples it is the largest number. A tare that is not of its own recording says nothing: 0.

    Parameters
    ----------
    examples : sequence of Example, checked
    """
    return max((_held(example, 1.0) for example in examples), default=0)


def quiet_s(examples: Sequence[Example]) -> float | None:
    """Return how many seconds at the beginning of each recording hold no touch, of its tare; None if not known.

    Parameters
    ----------
    examples : sequence of Example, checked
    """
    least = []
    for example in examples:
        tare, source = example.tare, example.source
        if _early(example) is None or tare is None or tare.start_us > int(source.t[0]):  # type: ignore[union-attr]
            return None
        share = next(share for share in _SHARES if _held(example, share) < TOUCH)
        least.append(share * (tare.stop_us - tare.start_us) / 1e6)
    seconds = min(least, default=0.0)
    digits = 10 ** (2 - int(np.floor(np.log10(seconds)))) if seconds > 0 else 1
    return float(np.floor(seconds * digits) / digits) if seconds > 0 else None


def _held(example: Example, share: float) -> int:
    """Return how many taxels vary far more in that share of a tare than at its beginning."""
    early, late = _early(example), _early(example, share)
    if early is None or late is None:
        return 0
    floor = floor_of([example._replace(tare=early)])
    noise, more = early.noise, floor / _OF_FLOOR
    source = example.source
    if isinstance(source, Frames) and are_counts(source.unit):
        # Few events show neither their noise nor that one more is chance.
        first, last = (len(source.between(tare.start_us, tare.stop_us)) for tare in (early, late))
        noise = np.maximum(noise, (np.nanmean(early.rest) + 1.0 / (first * noise.size)) ** 0.5)
        more = max(more, last**-0.5)
    return int(np.count_nonzero(late.noise > _TIMES * noise + more))


def _early(example: Example, share: float = _EARLY) -> Tare | None:
    """Return the beginning of a tare that is of its own recording; None of another."""
    tare, source = example.tare, example.source
    if tare is None or isinstance(source, SpikeTrains):
        return None
    try:
        tare_again = Tare.take(source, start_us=tare.start_us, stop_us=tare.stop_us)
        early = tare.start_us + round(share * (tare.stop_us - tare.start_us))
        return (
            Tare.take(source, start_us=tare.start_us, stop_us=early)
            if np.array_equal(tare_again.rest, tare.rest, equal_nan=True)
            else None
        )
    except ProblemError:
        return None
