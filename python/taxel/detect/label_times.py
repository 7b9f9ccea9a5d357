"""Whether labels are at the times of what the sensor felt, and by how much they are off."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import lgamma
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.progress import reporting
from taxel._base.times import beginning_us
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.cause import Cause
from taxel.detect.examples import Example
from taxel.detect.floors import floor_of
from taxel.detect.loads import Loads, clock_of, lacks_neighbours
from taxel.detect.scoring import APART_US, score
from taxel.detect.tares import TOUCH, early_part
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.spikes import SpikeTrains, to_ms, to_us

#: The peak that noise does not reach.
PEAK = 6.0
#: Loads are clear that have this peak.
_CLEAR = 20.0
#: Distances between labels and touches are looked at up to this, ms, and are the same that differ by this.
_FARTHEST_MS, _SAME_MS = 1000.0, 50.0
#: Labels are off where this share of them has the same distance, and so many; of fewer chance may do so. They are not
#: where as many are near.
_SHARE, _LEAST = 0.8, 5
#: Marks that a hand sets live have a common distance of at most that, ms, and the same share of them is in a stretch
#: of at most that, ms; all but a few in so many standard deviations around it, in steps of that, ms.
_HAND_MS, _HAND_SPREAD_MS, _DEVIATIONS, _STEP_MS = 500.0, 170.0, 3.0, 10.0
#: Marks are around what was felt, neither early nor late, whose common distance is at most this share of the spread.
_BESIDE = 0.25
#: A load changes after its label where it has changed in the middle part of the time until it is felt, looked at so
#: often, of so many labels; what falls has fallen to that share.
_MIDDLE, _LOOKS, _MOST, _FALLEN = (0.25, 0.75), 8, 0.85, 0.75
#: A load is about as strong as others that has this share of the peak that they have at the median.
_AS_STRONG = 0.3
#: The standard deviation of normal values that have the median deviation of 1.
_NORMAL = 1.4826
#: Chance gives as many labels one distance with at most this probability.
_CHANCE = 0.01
#: Touches that are so many times as many as the labels are at some distance of them by chance.
_MOST_A_LABEL = 4
#: Labels are compared with detections up to this distance, ms, as of a clock that jumped.
_JUMP_MS = 10_000.0
#: Another rate of the labels' clock is looked for up to this factor, in steps of half a window at the last label, at
#: most so many, by so many labels. It finds half of what can be found, this share of that more than without it and than
#: with a shift, and twice as many, or half of those that are missed then.
_RATES, _STEPS, _LABELS, _MORE = 2.0, 20_000, 100, 0.2
#: Clocks often have rates of such a ratio, as 100 and 120 frames/s, with at most this chance if all fit then, and none
#: without it.
_SIMPLE = sorted({a / b for a in range(1, 7) for b in range(1, 7) if a != b and 0.5 <= a / b <= _RATES})
_LIKELY = 0.2
#: So many labels that are all in the first such share of a recording may be in another unit of time.
_SEVERAL, _FIRST = 4, 0.01


class Off(NamedTuple):
    """By how much labels of one name are after what was felt, ms; how many are there, how many of them too far, of all.

    `within_ms` is how far marks that a hand set live spread around that distance; 0 of other labels. `spread_ms` is the
    distance between the first and the last of those that are there.
    """

    ms: float
    alike: int
    beyond: int
    labels: int
    spread_ms: float
    within_ms: float = 0.0
    changes_from_label: bool = False
    """Whether the load changes after the labels: it is felt late, as what rises or falls slowly."""

    @property
    def is_far(self) -> bool:
        """Whether more than a few of the labels are too far from what was felt to be aligned."""
        return self.beyond > (1 - _SHARE) * self.alike

    @property
    def is_around(self) -> bool:
        """Whether labels that a hand set are as far before what was felt as after it, beside how far they spread."""
        return self.within_ms > WINDOW_MS and abs(self.ms) <= _BESIDE * self.within_ms

    @property
    def arguments(self) -> dict[str, float]:
        """The shift that moves labels to what was felt, and the window for their spread, by the names of options."""
        moved = {} if self.is_around else {"shift_ms": -float(round(self.ms))}
        return moved | ({"window_ms": self._reach_ms} if self.within_ms > WINDOW_MS else {})

    @property
    def _reach_ms(self) -> float:
        """The window of labels by a hand, which reaches to both sides of where they are moved to."""
        return float(self.within_ms + _STEP_MS * np.ceil(abs(self.ms) / _STEP_MS) * self.is_around)

    def __str__(self) -> str:
        if self.is_around:
            reach = f"within {self._reach_ms:.0f} ms of what the sensor felt, like keys pressed live"
            return f"{self.alike} of {self.labels} are {reach}"
        side = "after" if self.ms > 0 else "before"
        if self.changes_from_label:
            return (
                f"the load changes slowly after the labels, and is felt {abs(self.ms):.0f} ms after {self.alike} of "
                f"{self.labels} (median): the labels are not off"
            )
        hand = f" and within {self.within_ms:.0f} ms of that, like keys pressed live" if self.within_ms else ""
        return f"{self.alike} of {self.labels} are {abs(self.ms):.0f} ms {side} what the sensor felt (median){hand}"


class FeltLoads:
    """Hold when (checked) examples were loaded, to compare labels with: by area, of channels by the peak.

    Loads are measured from the beginning of a tare of the same recording, as late labels let it end in a touch.

    Parameters
    ----------
    examples : sequence of Example, checked
        Nothing is known where one has no tare, or is of spike trains.
    """

    def __init__(self, examples: Sequence[Example]) -> None:
        known = all(example.tare is not None and not isinstance(example.source, SpikeTrains) for example in examples)
        early = [
            example if (tare := early_part(example)) is None else example._replace(tare=tare) for example in examples
        ]
        stamps = [example.source.t for example in examples if isinstance(example.source, Events | Frames)]
        self._lasts_us = sum(int(t[-1] - t[0]) for t in stamps if len(t))
        self._loads, self._felt = None, {"peak": PEAK} | ({} if lacks_neighbours(examples) else {"area": TOUCH})
        if known and examples:
            clocks = [clock_of(example) for example in early]
            self._loads = Loads(early, clocks, floor_of(early), reporting(None), list(self._felt))

    def near(self, label: str) -> tuple[int, int, int] | None:
        """Return how many labels of a name are within 50 ms of a load, of its begin or end, and how many there are.

        None where it is not known.
        """
        if self._loads is None:
            return None
        times = self.times(label)
        near, at_edge = self.felt_at(times)
        return int(near.sum()), int(at_edge.sum()), len(times)

    @property
    def are_known(self) -> bool:
        """Whether it is known when the examples were loaded."""
        return self._loads is not None

    def times(self, label: str) -> NDArray[np.int64]:
        """Return the labels of a name in all examples, us on one clock."""
        assert self._loads is not None
        return self._loads.truth(label, self._loads.whole_examples)

    def felt_at(
        self, times: NDArray[np.int64], reach_ms: float = WINDOW_MS
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which times are within 50 ms, or as far as given, of a load, and which of its begin or end."""
        reach = round(to_us(reach_ms))
        near, at_edge = np.zeros(len(times), np.bool_), np.zeros(len(times), np.bool_)
        for quantity in self._felt:
            begins, ends = self._spans(quantity)
            load = np.searchsorted(begins, times + reach, side="right") - 1
            near |= (load >= 0) & (np.append(ends, 0)[load] >= times - reach)
            for edge in (begins, ends):
                at_edge |= np.diff(np.searchsorted(edge, [times - reach, times + reach]), axis=0)[0] > 0
        return near, at_edge

    def at_edges_by_chance(self, count: int, among: int) -> bool:
        """Whether chance places so many of some times within 50 ms of the begins and ends of loads."""
        covered = sum(4 * round(to_us(WINDOW_MS)) * len(self._spans(quantity)[0]) for quantity in self._felt)
        return chance_of(count, among, min(1.0, covered / max(1, self._lasts_us))) > _CHANCE

    def overlapped(self, label: str, *, stays: bool = False) -> NDArray[np.bool_]:
        """Return which labels of a name are in a load that holds two of them or more, far from its ends.

        `stays`: the load may be of an object that stays, so that labels of begins and ends alternate in it.
        """
        reach, times = round(to_us(WINDOW_MS)), self.times(label)
        if self._loads is None or not len(times):
            return np.zeros(len(times), np.bool_)
        begins, ends = self._spans(self._quantity)
        load = np.searchsorted(begins, times + reach, side="right") - 1
        # A load without an end is a tare that does not fit.
        lasting = np.append(ends % APART_US == APART_US // 2, False)[load]
        load[(load >= 0) & ((np.append(ends, 0)[load] < times - reach) | lasting)] = -1
        inside = (load >= 0) & (times - np.append(begins, 0)[load] > reach) & (np.append(ends, 0)[load] - times > reach)
        if stays:
            held: NDArray[np.bool_] = inside & (np.bincount(load + 1)[load + 1] > 1)
            return held
        # In a load whose begins and ends alternate, as of a sensor that recovers slowly, none overlaps.
        kind = {"contact": "lift", "lift": "contact"}.get(recipes.neuron_of("touch", label) or "")
        others = [self.times(name) for name in self._loads.names if kind and recipes.neuron_of("touch", name) == kind]
        between = np.searchsorted(np.sort(np.concatenate([np.empty(0, np.int64), *others])), times)
        together = (np.diff(load) == 0) & (np.diff(between) == 0)
        several: NDArray[np.bool_] = inside & np.isin(load, load[1:][together])
        return several

    @property
    def _quantity(self) -> str:
        return "area" if "area" in self._felt else "peak"

    def _spans(self, quantity: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return when loads began and ended, in order; one without an end lasts until the next, in its example."""
        assert self._loads is not None
        begins, ends = (np.sort(edge.t) for edge in self._loads.edges(quantity, self._felt[quantity], 1.0, 1))
        last = begins // APART_US * APART_US + APART_US // 2 - 1
        after = np.append(ends, np.iinfo(np.int64).max)[np.searchsorted(ends, begins)]
        return begins, np.minimum(np.minimum(after, np.append(begins[1:], last[-1:])), last)

    def unlabelled(
        self, label: str, names: Iterable[str], times: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Return which times are in or beside loads that are about as strong as those with a label, but have none.

        And when the load of each of these times begins. Ends of loads have labels of names of an end anywhere in them,
        as they may be felt late, begins those of other names beside them.
        """
        assert self._loads is not None
        begins, ends = self._spans(self._quantity)
        if not len(begins):
            return np.zeros(len(times), np.bool_), np.empty(0, np.int64)
        reach, is_end = round(to_us(2 * WINDOW_MS)), recipes.neuron_of("touch", label) == "lift"
        same = [self.times(name) for name in names if (recipes.neuron_of("touch", name) == "lift") == is_end]
        until = (ends if is_end else begins) + reach
        has = np.diff(np.searchsorted(np.sort(np.concatenate(same)), [begins - reach, until]), axis=0)[0] > 0
        peaks = self._loads.largest("peak", begins, ends)
        strong = ~has & (peaks >= _AS_STRONG * np.median(peaks[has] if has.any() else np.inf))
        load = np.searchsorted(begins, times + reach, side="right") - 1
        inside: NDArray[np.bool_] = (load >= 0) & (ends[load] + reach >= times) & strong[load]
        return inside, begins[load[inside]]

    @property
    def count(self) -> int:
        """How many loads there are."""
        return len(self._spans(self._quantity)[0])

    @property
    def are_clear(self) -> bool:
        """Whether the loads are far above the noise of the tare, at the median: no noise, and no tare of loads."""
        if self._loads is None:
            return False
        peaks = self._loads.largest("peak", *self._spans(self._quantity))
        return len(peaks) > 0 and float(np.median(peaks)) >= _CLEAR

    def rank(self, label: str, reach_ms: float) -> int:
        """Return how many labels of a name, and begins of loads, have no pair that near; or ends, if that is fewer."""
        assert self._loads is not None
        times = self._loads.truth(label, self._loads.whole_examples)
        edges = (edge for felt in self._felt.items() for edge in self._loads.edges(*felt, 1.0, 1))
        scores = (score(Detections([label] * len(t), t, known), {label: times}, reach_ms) for t, known, _ in edges)
        return min(found.rank[0] for found in scores)

    def distances(self, labels: Iterable[str]) -> dict[str, Off]:
        """Return by how much labels are after what was felt, of each name of which most are at one distance.

        What was felt are the begins of loads, or the ends of names that say so, of other names whichever more labels
        follow. Where no distance is the same, it is that of marks that a hand set live.
        """
        if self._loads is None:
            return {}
        found: dict[str, Off] = {}
        for quantity in dict.fromkeys((self._quantity, *self._felt)):
            for label in labels:
                felt = self._edges(label, quantity)
                if label not in found and (off := _distance(self.times(label), felt)) is not None:
                    found[label] = off._replace(changes_from_label=off.is_far and self._changes(label, off.ms))
        return found

    def _changes(self, label: str, ms: float) -> bool:
        """Whether most loads rise, or fall, on the way from a label to where its load begins or ends."""
        if ms >= 0 or self._loads is None:
            return False
        shares = np.linspace(*_MIDDLE, _LOOKS)[:, None]
        times, way = self.times(label), round(to_us(-ms))
        before, middle = (
            self._loads.values_at("peak", np.rint(times + way * at).astype(np.int64)).mean(axis=0)
            for at in (shares - 1.0, shares)
        )
        changes = {"contact": middle > before, "lift": (before >= PEAK) & (middle < _FALLEN * before)}
        neuron = recipes.neuron_of("touch", label)
        return bool(max(share.mean() for name, share in changes.items() if neuron in (None, name)) >= _MOST)

    def part_off(self, labels: Sequence[str]) -> tuple[NDArray[np.int64], Alike] | None:
        """Return labels of some names, and which of them are at one distance from what was felt, far from all of it.

        The distance is counted from where the other labels of their name are, as ends may be felt later than begins.
        None where most of the others are not near anything felt: no part is off then.
        """
        if self._loads is None:
            return None
        times = [self.times(label) for label in labels]
        edges = [self._edges(label, self._quantity) for label in labels]
        pairs, are_felt = [], []
        for t, felt in zip(times, edges, strict=True):
            # A name without a meaning takes the edge near which more of its labels are.
            apart, index = max((_apart(t, edge) for edge in felt), key=lambda pair: _near(*pair))
            near = np.abs(apart) <= WINDOW_MS
            usual_ms = float(np.median(apart[near])) if _near(apart, index) >= _LEAST else 0.0
            pairs.append((apart - usual_ms, index))
            are_felt.append(np.isin(np.arange(len(t)), index[near]))
        together = np.concatenate(times)
        alike = _alike(pairs, list(map(len, times)), WINDOW_MS)
        if alike is None or 2 * np.count_nonzero(np.concatenate(are_felt)) < np.count_nonzero(~alike.members):
            return None
        order = np.argsort(together, kind="stable")
        return together[order], alike._replace(members=alike.members[order])

    def _edges(self, label: str, quantity: str) -> list[NDArray[np.int64]]:
        """Return when loads begin, or end, or both, as a name of labels says which it is of."""
        assert self._loads is not None
        begins, ends = (np.sort(edge.t) for edge in self._loads.edges(quantity, self._felt[quantity], 1.0, 1))
        neuron = recipes.neuron_of("touch", label)
        return [begins] if neuron == "contact" else [ends] if neuron == "lift" else [begins, ends]


def _distance(times: NDArray[np.int64], felt: Sequence[NDArray[np.int64]]) -> Off | None:
    """Return by how much labels are after begins or ends of loads; None where it is not the same of most."""
    steady = [off for edge in felt for off in _steady(times, edge)]
    near = [off for off in steady if abs(off.ms) <= WINDOW_MS]
    found = near or steady or [off for edge in felt for off in _by_hand(times, edge)]
    return min(found, key=lambda off: (off.within_ms > 0.0, -off.alike, off.spread_ms), default=None)


class Alike(NamedTuple):
    """Times that are at one distance after others, ms, and which of the times they are."""

    ms: float
    members: NDArray[np.bool_]


def same_distance(times: NDArray[np.int64], others: NDArray[np.int64], beyond_ms: float) -> Alike | None:
    """Return which times are at one distance from others, of those that have none of these nearer than `beyond_ms`.

    None where they are fewer than five, or as many as may have one distance by chance.
    """
    return _alike([_apart(times, np.sort(others), _JUMP_MS)], [len(times)], beyond_ms, _JUMP_MS)


def _alike(
    pairs: Sequence[tuple[NDArray[np.float64], NDArray[np.int64]]],
    counts: Sequence[int],
    beyond_ms: float,
    farthest_ms: float = _FARTHEST_MS,
) -> Alike | None:
    """Return which of so many times of several kinds are at one distance from others, by the pairs of each kind."""
    first = np.cumsum([0, *counts])
    apart = np.concatenate([pair[0] for pair in pairs])
    index = np.concatenate([pair[1] + begin for pair, begin in zip(pairs, first[:-1], strict=True)])
    is_near = np.zeros(first[-1], np.bool_)
    is_near[index[np.abs(apart) <= beyond_ms]] = True
    order = np.argsort(apart, kind="stable")
    order = order[~is_near[index[order]]]
    apart, index = apart[order], index[order]
    stops = np.searchsorted(apart, apart + _SAME_MS, side="right")
    counts = [len(np.unique(index[k:stop])) for k, stop in enumerate(stops)]
    most = max(counts, default=0)
    left = int(np.count_nonzero(~is_near))
    if most < _LEAST or _by_chance(most, left, len(apart), _SAME_MS, farthest_ms) > _CHANCE:
        return None
    # Several distances have as many if touches follow one another at regular intervals.
    begin = min((k for k, count in enumerate(counts) if count == most), key=lambda k: abs(apart[k]))
    here = slice(begin, stops[begin])
    members = np.zeros(first[-1], np.bool_)
    members[index[here]] = True
    return Alike(float(np.median(apart[here])), members)


def _apart(
    times: NDArray[np.int64], felt: NDArray[np.int64], farthest_ms: float = _FARTHEST_MS
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the distances of labels from these times up to the farthest, ms, ascending, and the labels' places."""
    far = round(to_us(farthest_ms))
    reach = np.searchsorted(felt, [times - far, times + far])
    label_index = np.repeat(np.arange(len(times)), reach[1] - reach[0])
    beside = np.concatenate([np.empty(0, np.int64), *(np.arange(*span) for span in reach.T)])
    apart = to_ms(times[label_index] - felt[beside])
    order = np.argsort(apart, kind="stable")
    return apart[order], label_index[order]


def _near(apart: NDArray[np.float64], index: NDArray[np.int64]) -> int:
    """Return how many times are near enough to be aligned, by their distances."""
    return len(np.unique(index[np.abs(apart) <= WINDOW_MS]))


def _reached(times: NDArray[np.int64], felt: NDArray[np.int64]) -> int:
    """Return how many of these times are up to the farthest from a label, at most as many as there are labels.

    Labels in another unit of time, which are close together, all have the same distance from one of them.
    """
    far, ordered = round(to_us(_FARTHEST_MS)), np.sort(times)
    first, last = np.searchsorted(ordered, [felt - far, felt + far])
    return min(len(times), int(np.count_nonzero(last > first)))


def _by_hand(times: NDArray[np.int64], felt: NDArray[np.int64]) -> Iterator[Off]:
    """Yield the distance around which most labels are from these times as a hand sets them."""
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
        here = np.abs(apart - ms) <= within_ms
        yield _off(ms, spread_ms, apart, label_index, here, len(times), float(within_ms))


def _off(
    ms: float,
    spread_ms: float,
    apart: NDArray[np.float64],
    label_index: NDArray[np.int64],
    here: slice | NDArray[np.bool_],
    labels: int,
    within_ms: float = 0.0,
) -> Off:
    """Return the distance of labels whose pairs are here."""
    near = np.unique(label_index[here][np.abs(apart[here]) <= WINDOW_MS])
    alike = np.unique(label_index[here])
    return Off(ms, len(alike), len(alike) - len(near), labels, spread_ms, within_ms)


def chance_of(least: int, total: int, share: float) -> float:
    """Return how probable it is that so many of all times, at least, are in a share of all time."""
    if share >= 1.0 or not least:
        return 1.0
    # Numbers of combinations may be too large for a float.
    k = np.arange(least, total + 1)
    ways = [lgamma(total + 1) - lgamma(m + 1) - lgamma(total - m + 1) for m in k.tolist()]
    with np.errstate(divide="ignore"):
        return float(np.exp(ways + k * np.log(share) + (total - k) * np.log1p(-share)).sum())


def _by_chance(least: int, labels: int, pairs: int, spread_ms: float, farthest_ms: float = _FARTHEST_MS) -> float:
    """Return how probable it is that so many labels have pairs in one of the stretches of that length by chance."""
    stretches = 2 * farthest_ms / max(spread_ms, 1.0)
    share = min(1.0, pairs / labels / stretches)
    return stretches * chance_of(least, labels, share)


def _steady(times: NDArray[np.int64], felt: NDArray[np.int64]) -> Iterator[Off]:
    """Yield the distances that most labels have from one of these times, each ms."""
    least = max(_LEAST, _SHARE * len(times))
    if _reached(times, felt) < least or len(felt) > _MOST_A_LABEL * len(times):
        return
    apart, label_index = _apart(times, felt)
    for k, end in enumerate(np.searchsorted(apart, apart + _SAME_MS, side="right")):
        if end - k >= least and len(np.unique(label_index[k:end])) >= least:
            ms, spread_ms = float(np.median(apart[k:end])), float(apart[end - 1] - apart[k])
            yield _off(ms, spread_ms, apart, label_index, slice(k, end), len(times))


def early(labels: Mapping[str, NDArray[np.int64]], first_us: int, last_us: int) -> str:
    """Return that all labels of a recording are in its first hundredth, as times in another unit are; else "".

    Examples
    --------
    >>> early({"contact": np.array([1200, 2400, 3100, 4000])}, 0, 5_000_000)
    'are in the first 0.004 s of 5 s: are their times in us?'
    """
    times = np.concatenate([*labels.values(), np.empty(0, np.int64)])
    lasts = last_us - first_us
    latest = int(times.max(initial=first_us)) - first_us
    if len(times) < _SEVERAL or not 0 < latest < _FIRST * lasts:
        return ""
    return f"are in the first {latest / 1e6:.3g} s of {lasts / 1e6:.3g} s: are their times in us?"


def span_us(example: Example) -> tuple[int, int]:
    """Return when the first and the last of an example is, us."""
    source = example.source
    if isinstance(source, SpikeTrains):
        return round(float(to_us(source.start))), round(float(to_us(source.stop)))
    t = source.t  # type: ignore[union-attr]
    return (int(t[0]), int(t[-1])) if len(t) else (0, 0)


def unlabelled_us(examples: Sequence[Example], label: str) -> tuple[int, int]:
    """Return how long recordings last before their first label and after their last, beyond the distance of labels, us.

    And how long they last. An example without the label does not count.

    Parameters
    ----------
    examples : sequence of Example, checked
    label : str
    """
    outside = total = 0
    for example in examples:
        times = np.sort(example.labels.get(label, np.empty(0, np.int64)))
        first, last = span_us(example)
        if len(times):
            apart = int(np.diff(times).max(initial=0))
            outside += max(0, int(times[0]) - first - apart) + max(0, last - int(times[-1]) - apart)
            total += last - first
    return outside, total


def other_rate(examples: Sequence[Example], found: Sequence[Detections], window_ms: float) -> Cause | None:
    """Return that the labels' clock runs at another rate than the recording's, where labels then fit the detections.

    Parameters
    ----------
    examples : sequence of Example, checked
        The sources of one recording.
    found : sequence of Detections
        What was detected in each.
    window_ms : float, ms
    """
    zero = beginning_us(np.array([span_us(examples[0])[0]]))
    given = [
        (labels - zero, detections.t[detections.label == name] - zero)
        for example, detections in zip(examples, found, strict=True)
        for name, labels in example.labels.items()
    ]
    kinds = [(labels, np.sort(times)) for labels, times in given if len(labels) and len(times)]
    total, possible = sum(len(labels) for labels, _ in kinds), sum(min(map(len, kind)) for kind in kinds)
    last, reach = max((int(labels[-1]) for labels, _ in kinds), default=0), to_us(window_ms)
    if last <= 2 * reach or possible < 2:
        return None
    few = [(labels[:: 1 + total // _LABELS], times) for labels, times in kinds]
    steps = np.arange(-_STEPS, _STEPS + 1) * reach / (2 * last)
    rates = np.exp(steps[np.abs(steps) <= np.log(_RATES) + reach / last])
    rate = float(rates[np.argmax(_fitting(few, rates[:, None], reach))])
    pairs = [
        (labels[near], times[at[near]])
        for labels, times in kinds
        for at, near in [_beside(labels / rate, times, reach)]
    ]
    labelled, detected = (np.concatenate(each).astype(np.float64) for each in zip(*pairs, strict=True))
    rate = float(labelled @ detected / (detected @ detected)) if detected.any() else 1.0
    simple = min(_SIMPLE, key=lambda each: abs(each - rate))
    if is_simple := abs(simple - rate) * last <= reach:
        rate = simple
    now, fits = _fitting(kinds, np.array([[1.0], [rate]]), reach).tolist()
    shifts = to_us(np.arange(-_JUMP_MS, _JUMP_MS, window_ms / 2))[:, None]
    best = max(now, int(_fitting(kinds, np.ones((1, 1)), reach, shifts).max()))
    is_better = fits >= 2 * best or 2 * (total - fits) <= total - best
    if 2 * fits < possible or not is_better or fits - best < _MORE * possible:
        return None
    share = min(1.0, 2 * reach * sum(len(times) * len(labels) for labels, times in kinds) / total / last)
    by_chance = chance_of(fits, total, share)
    is_sure = len(rates) * by_chance <= _CHANCE
    if not is_sure and not (is_simple and fits == possible and not now and len(_SIMPLE) * by_chance <= _LIKELY):
        return None
    side = f"{rate:.4g} times as fast as the recording's"
    measured = (
        f"the clock of the labels runs {side}: tried with their times divided by {rate:.4g}, {fits} of {total} labels "
        f"have a detection, instead of {now}, and at most {best} with a shift"
    )
    t = examples[0].source.t  # type: ignore[union-attr]
    hz = 1e6 / float(np.median(np.diff(t))) if isinstance(examples[0].source, Frames) and len(t) > 1 else 0.0
    of_recording = (
        f", or, if these are right, a rate of {hz / rate:.4g} Hz instead of {hz:.4g} Hz in the recording" * bool(hz)
    )
    advice = f"to divide the times of the labels by {rate:.4g}, as of frames counted at another rate{of_recording}"
    names = tuple(dict.fromkeys(name for example in examples for name in example.labels))
    return Cause("other_rate", names, 2 * (fits - now), measured, advice)


def _beside(
    labels: NDArray[np.float64], times: NDArray[np.int64], reach: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the places of the times nearest to labels, and which labels have one within reach."""
    middles = (times[1:] + times[:-1]) / 2
    at = np.searchsorted(middles, labels)
    return at, np.abs(labels - times[at]) <= reach


def _fitting(
    kinds: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]],
    rates: NDArray[np.float64],
    reach: float,
    shifts: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.int64]:
    """Return how many times are within reach of a label of their kind, whose times are divided by each of the rates."""
    counts: NDArray[np.int64] = np.zeros(max(len(rates), np.size(shifts)), np.int64)
    for labels, times in kinds:
        at, near = _beside(labels / rates - shifts, times, reach)
        # Labels beside one time count once.
        latest = np.maximum.accumulate(np.where(near, at + 1, 0), axis=1)
        counts += (np.diff(latest, axis=1, prepend=0) > 0).sum(axis=1)
    return counts
