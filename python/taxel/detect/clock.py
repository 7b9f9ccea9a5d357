"""One robust fit of a clock, repeated on what is left: the offset and the rate that put labels on detections.

The same fit compares labels with the begins and ends of loads.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel._base.times import beginning_us
from taxel.detect import recipes
from taxel.detect.examples import Example, Outcome
from taxel.detect.floors import early_part, floor_of
from taxel.detect.loads import touches
from taxel.recorded import recorded
from taxel.spikes import SpikeTrains, to_us

#: Labels are looked for so far from their detections, ms.
FAR_MS = 10_000.0
#: The least of these distances, ms, that explains most of what can be explained is that of a fit, ...
REACHES_MS = (50.0, 100.0, 200.0)
#: ... which most is.
_MOST = 0.8
#: A jump, or a part that is off, is a second fit, the part behind it a third.
_FITS = 3
#: A fit has so many labels or more, this share of all, and chance makes as many with at most this probability, all
#: places together.
_LEAST, _LEAST_SHARE, _CHANCE = 4, 0.05, 0.01
#: Labels are off that are so far from their detections, ms, and so many times as far as they spread.
_OFF_MS, _SPREADS = 50.0, 2.5
#: Where labels are off, so are this share of those there, with another rate of the labels or the detections there;
#: there is between these quantiles of their times.
_STRETCH, _ENDS = 0.35, (0.1, 0.9)
#: Another rate explains so many labels more, as a share of those that can be explained and as a number.
_MORE, _MORE_LABELS = 0.2, 2
#: Rates are looked for up to this one, and from its inverse on.
_FASTEST = 2.0
#: The rate is looked for in so many first labels of each kind, up to that time, ms, then in twice as long a time, and
#: so on.
_FIRST, _FIRST_MS = 60, 200_000.0
#: So many pairs of labels and detections are looked at then.
_PAIRS = 30_000
#: Names that are longer together, letters, are counted, and the name of a recording is cut at its beginning.
_NAMES = 24
#: So many places of offset, or of offset and rate, are refined.
_PLACES = 20

_Times: TypeAlias = NDArray[np.float64]
#: Labels, and detections or edges of loads of the same kind, ms from the recording's beginning, both ascending.
Kinds: TypeAlias = Mapping[Any, tuple[_Times, _Times]]


class ClockFit(NamedTuple):
    """An offset and a rate that put labels on detections.

    Attributes
    ----------
    shift_ms : float, ms
        By how much labels are later; with another rate, at the beginning, on the clock of the detections.
    rate : float
        How many ms of labels pass in a ms of detections.
    reach_ms : float, ms
        How far labels are from detections at most, once both are taken away.
    pairs : mapping of kind to NDArray, shape (pairs, 2), ms
        The labels and detections that it puts together.
    of : int
        How many labels there were to be explained.
    """

    shift_ms: float
    rate: float
    reach_ms: float
    pairs: Mapping[Any, NDArray[np.float64]]
    of: int

    @property
    def explained(self) -> int:
        """How many labels it explains."""
        return sum(map(len, self.pairs.values()))

    @property
    def spread_ms(self) -> float:
        """How far from that clock its labels are, the standard deviation."""
        apart = [pairs[:, 0] / self.rate - self.shift_ms - pairs[:, 1] for pairs in self.pairs.values()]
        return float(np.std(np.concatenate(apart))) if self.pairs else 0.0

    @property
    def is_off(self) -> bool:
        """Whether the labels that it explains have another offset or rate than their detections."""
        return self.rate != 1.0 or abs(self.shift_ms) > _OFF_MS


def explain(kinds: Kinds) -> list[ClockFit]:
    """Return the fits that explain most labels in turn, each on what those before it leave.

    Parameters
    ----------
    kinds : mapping of kind to (labels, detections), ms, ascending
        Only times of one kind, as of one label in one recording, are put together; all kinds have one clock.

    Examples
    --------
    >>> found = np.array([700.0, 2100.0, 2900.0, 4600.0, 5200.0])
    >>> [fit] = explain({"contact": (found + 320.0, found)})
    >>> round(fit.shift_ms), fit.rate, fit.explained, fit.of
    (320, 1.0, 5, 5)
    """
    kinds = {kind: pair for kind, pair in kinds.items() if len(pair[0]) and len(pair[1])}
    possible = sum(min(map(len, pair)) for pair in kinds.values())
    best: list[ClockFit] = []
    for reach_ms in REACHES_MS:
        fits = list(_in_turn(kinds, reach_ms))
        if _explained(fits) > _explained(best):
            best = fits
        if _explained(best) >= _MOST * possible:
            break
    return best


def _explained(fits: Sequence[ClockFit]) -> int:
    return sum(fit.explained for fit in fits)


def _in_turn(kinds: Kinds, reach_ms: float) -> Iterator[ClockFit]:
    """Yield fits at one reach, each on what is left, until chance may make them."""
    all_kinds, least = kinds, max(_LEAST, _LEAST_SHARE * sum(len(labels) for labels, _ in kinds.values()))
    for _ in range(_FITS):
        kinds = {kind: pair for kind, pair in kinds.items() if len(pair[0]) and len(pair[1])}
        if not kinds:
            return
        shift_ms, rate, tried = _clock(kinds, reach_ms)
        if rate == 1.0:
            # Labels that spread farther on one side than the reach do not move it.
            wide = np.concatenate(list(_pairs(kinds, shift_ms, rate, 2 * reach_ms).values()))
            shift_ms = float(np.median(wide[:, 0] - wide[:, 1])) if len(wide) else shift_ms
        of = sum(len(labels) for labels, _ in kinds.values())
        fit = ClockFit(shift_ms, rate, reach_ms, _pairs(kinds, shift_ms, rate, reach_ms), of)
        by_chance = tried * _chance(kinds, fit)
        if fit.is_off:
            fit = fit._replace(pairs=_together(all_kinds, fit))
            if rate == 1.0 and abs(shift_ms) < _SPREADS * fit.spread_ms:
                return
        if fit.explained < least or by_chance > _CHANCE:
            return
        fit = fit._replace(pairs={kind: pairs for kind, pairs in fit.pairs.items() if len(pairs)})
        yield fit
        kinds = {kind: _without(pair, fit.pairs[kind]) if kind in fit.pairs else pair for kind, pair in kinds.items()}


def _together(kinds: Kinds, fit: ClockFit) -> dict[Any, NDArray[np.float64]]:
    """Return the pairs of those kinds of which most labels, or most detections, there are explained."""
    times = np.concatenate([pairs[:, 0] for pairs in fit.pairs.values()])
    if not len(times):
        return {}
    begin, end = np.quantile(times, _ENDS)
    together = {}
    for kind, pairs in fit.pairs.items():
        labels, found = kinds[kind]
        at = labels, (found + fit.shift_ms) * fit.rate
        given, detected = (np.count_nonzero((each >= begin) & (each <= end)) for each in at)
        there = np.count_nonzero((pairs[:, 0] >= begin) & (pairs[:, 0] <= end))
        # With another rate, few labels of a long recording may be detected.
        if len(pairs) and there >= _STRETCH * (given if fit.rate == 1.0 else min(given, detected)):
            together[kind] = pairs
    return together


def _without(pair: tuple[_Times, _Times], pairs: NDArray[np.float64]) -> tuple[_Times, _Times]:
    labels, found = (times[~np.isin(times, pairs[:, k])] for k, times in enumerate(pair))
    return labels, found


def _clock(kinds: Kinds, reach_ms: float) -> tuple[float, float, int]:
    """Return the shift and the rate that explain most, and among how many places they were found."""
    kinds = {kind: pair for kind, pair in kinds.items() if len(pair[0]) and len(pair[1])}
    possible = sum(min(map(len, pair)) for pair in kinds.values())
    flat = [_refined(kinds, float(shift), 1.0, reach_ms) for shift in _shifts(kinds, reach_ms)]
    shift, rate, weight = max([(0.0, 1.0, _weight(kinds, 0.0, 1.0, reach_ms)), *flat], key=lambda at: at[2])
    tried = 1 if abs(shift) <= reach_ms else round(2 * FAR_MS / reach_ms)
    if weight >= _MOST * possible:
        return shift, rate, tried
    places, rates = _places(kinds, reach_ms)
    lines = [_refined(kinds, *place, reach_ms, is_flat=False) for place in places]
    line = max(lines, key=lambda at: at[2], default=(0.0, 1.0, 0.0))
    if line[2] >= weight + max(_MORE_LABELS, _MORE * possible):
        return line[0], line[1], round(2 * FAR_MS / reach_ms) * rates
    return shift, rate, tried


def _shifts(kinds: Kinds, reach_ms: float) -> NDArray[np.float64]:
    """Return the shifts at which most differences of labels and detections are, those of most first."""
    apart = []
    for labels, found in kinds.values():
        edges = np.searchsorted(found, [labels - FAR_MS, labels + FAR_MS])
        apart += [label - found[first:last] for label, first, last in zip(labels, *edges, strict=True)]
    differences = np.sort(np.concatenate(apart))
    if not len(differences):
        return differences
    until = np.searchsorted(differences, differences + reach_ms, side="right")
    counts, shifts = until - np.arange(len(until)), []
    for _ in range(_PLACES):
        k = int(np.argmax(counts))
        if counts[k] < 2:
            break
        shifts.append(float(np.median(differences[k : until[k]])))
        counts[np.abs(differences - differences[k]) < reach_ms] = 0
    return np.array(shifts)


def _places(kinds: Kinds, reach_ms: float) -> tuple[list[tuple[float, float]], int]:
    """Return the shifts and rates at which most first labels are on detections, and how many rates were tried."""
    pairs: list[NDArray[np.float64]] = []
    for labels, found in kinds.values():
        grid = np.meshgrid(_first(labels), found[: 2 * _FIRST], indexing="ij")
        pairs.append(np.stack([side.ravel() for side in grid]))
        if sum(pair.shape[1] for pair in pairs) > _PAIRS:
            break
    first_labels, first_found = np.concatenate(pairs, axis=1)
    if not len(first_labels):
        return [], 1
    steps = int(np.log(_FASTEST) * max(float(first_labels.max()), reach_ms) / reach_ms)
    rates = np.exp(np.linspace(-np.log(_FASTEST), np.log(_FASTEST), 2 * steps + 1))
    bins = int(2 * FAR_MS / reach_ms)
    table = np.empty((len(rates), bins - 1), np.int64)
    for k, rate in enumerate(rates):
        places = (first_labels / rate - first_found + FAR_MS) / reach_ms
        counts = np.bincount(places[(places >= 0) & (places < bins)].astype(np.int64), minlength=bins)
        table[k] = counts[1:] + counts[:-1]
    best = np.argsort(-table, axis=None, kind="stable")[: 2 * _PLACES]
    at = zip(*np.unravel_index(best, table.shape), strict=True)
    return [(float((shift + 1) * reach_ms - FAR_MS), float(rates[k])) for k, shift in at], len(rates)


def _first(labels: _Times) -> _Times:
    return labels[:_FIRST][labels[:_FIRST] <= _FIRST_MS]


def _refined(
    kinds: Kinds, shift_ms: float, rate: float, reach_ms: float, *, is_flat: bool = True
) -> tuple[float, float, float]:
    """Return shift and rate by the pairs that they make, and how much these weigh."""
    last = max(float(labels[-1]) for labels, _ in kinds.values())
    until = last if is_flat else max(float(_first(labels)[-1:].sum()) for labels, _ in kinds.values())
    for _ in range(100):
        part = {kind: (labels[labels <= until], found) for kind, (labels, found) in kinds.items()}
        pairs = np.concatenate(list(_pairs(part, shift_ms, rate, reach_ms).values()))
        if len(pairs) < (2 if is_flat else _LEAST):
            break
        before = shift_ms, rate
        if is_flat:
            shift_ms = float(np.median(pairs[:, 0] - pairs[:, 1]))
        else:
            slope, begin = np.polyfit(pairs[:, 1], pairs[:, 0], 1)
            if not 1 / _FASTEST <= slope <= _FASTEST:
                break
            shift_ms, rate = float(begin / slope), float(slope)
        if until >= last and np.allclose(before, (shift_ms, rate), rtol=0.0, atol=1e-9):
            break
        until = min(2 * until, last)
    return shift_ms, rate, _weight(kinds, shift_ms, rate, reach_ms)


def _weight(kinds: Kinds, shift_ms: float, rate: float, reach_ms: float) -> float:
    """Return how many labels a clock explains; one at the reach counts half, so that the sharper fit wins."""
    total = 0.0
    for pairs in _pairs(kinds, shift_ms, rate, reach_ms).values():
        total += float(np.sum(1.0 - np.abs(pairs[:, 0] / rate - shift_ms - pairs[:, 1]) / (2 * reach_ms)))
    return total


def _pairs(kinds: Kinds, shift_ms: float, rate: float, reach_ms: float) -> dict[Any, NDArray[np.float64]]:
    """Return labels with the detections that they are on, one to one."""
    pairs = {}
    for kind, (labels, found) in kinds.items():
        at = labels / rate - shift_ms
        if not len(found) or not len(at):
            pairs[kind] = np.empty((0, 2))
            continue
        behind = np.clip(np.searchsorted(found, at), 1, max(1, len(found) - 1))
        before = behind - 1
        behind = np.minimum(behind, len(found) - 1)
        nearest = np.where(np.abs(found[before] - at) <= np.abs(found[behind] - at), before, behind)
        apart = np.abs(found[nearest] - at)
        order = np.argsort(apart, kind="stable")
        order = order[apart[order] <= reach_ms]
        _, first = np.unique(nearest[order], return_index=True)
        kept = np.sort(order[first])
        pairs[kind] = np.stack([labels[kept], found[nearest[kept]]], axis=1)
    return pairs


def _chance(kinds: Kinds, fit: ClockFit) -> float:
    """Return the probability that as many labels or more are on detections that are anywhere."""
    from scipy.special import bdtrc  # noqa: PLC0415  slow to import, needed by few commands

    times = np.concatenate([times for pair in kinds.values() for times in pair])
    both = sum(len(labels) * len(found) for labels, found in kinds.values())
    near = min(1.0, 2 * fit.reach_ms * both / fit.of / max(float(np.ptp(times)), 1.0))
    return float(bdtrc(fit.explained - 1, fit.of, near))


def off_detections(outcomes: Sequence[Outcome], error_ms: Mapping[str, float]) -> list[str]:
    """Return by how much labels are off their detections, a line for each fit of which they are, or two names are.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Their labels have one clock, which each recording begins anew.
    error_ms : mapping of str to float, ms
        By how much detections of each label were late in the training.
    """
    of_kinds = {}
    for k, outcome in enumerate(outcomes):
        known = outcome.compared
        for label, times in outcome.example.labels.items():
            of_label = known.t[np.array([each == label for each in known.label], np.bool_)]
            of_kinds[k, label] = np.asarray(times, np.int64), of_label - round(to_us(error_ms.get(label, 0.0)))
    examples = [outcome.example for outcome in outcomes]
    kinds = _of_clock(examples, of_kinds)
    return [
        *filter(None, [exchanged(kinds)]),
        *(_lines(examples, kinds, "their detection", "detections") or _apart(kinds, "their detection")),
    ]


def off_loads(examples: Sequence[Example], missed: Collection[str] | None = None) -> list[str]:
    """Return by how much labels are off the begins and ends of loads, a line for each fit of which they are.

    Parameters
    ----------
    examples : sequence of Example, checked
    missed : collection of str, optional
        The names of which most labels are missed: others may be off, as loads of foam end late. Default: all.
    """
    kinds = beside_loads(examples)
    lines = _lines(examples, kinds, "where a load begins or ends", "loads")
    named = {kind: pair for kind, pair in kinds.items() if missed is None or kind[1] in missed}
    return lines or list(_apart(named, "where a load begins or ends"))


def exchanged(kinds: Kinds) -> str:
    """Return that the labels of two names are where the other one was felt; "" where they are not."""
    names = sorted({label for _, label in kinds})
    others = dict(zip(names, reversed(names), strict=True))
    crossed = {
        (k, label): (times, kinds.get((k, others[label]), (times, times[:0]))[1])
        for (k, label), (times, _) in kinds.items()
    }
    own, of_other = (sum(map(len, _pairs(each, 0.0, 1.0, REACHES_MS[0]).values())) for each in (kinds, crossed))
    total = sum(len(times) for times, _ in kinds.values())
    if len(names) != 2 or own > (1.0 - _MOST) * total or of_other < max(_LEAST, _MOST * total):
        return ""
    both = " and ".join(names)
    return f"{of_other} of {total} labels are where the other of {both} is felt: are the two names exchanged?"


def beside_loads(examples: Sequence[Example]) -> dict[tuple[int, str], tuple[_Times, _Times]]:
    """Return the labels of each example, and the begins or ends of loads that they are of.

    Labels of contacts are compared with begins, those of lifts with ends, all others with both.

    Parameters
    ----------
    examples : sequence of Example, checked
        Nothing is known where one has no tare, or is of spike trains.
    """
    # Late labels let a tare end in a touch.
    early = [example if (tare := early_part(example)) is None else example._replace(tare=tare) for example in examples]
    found = touches(early, floor_of(early))
    if found is None:
        return {}
    loads, *edges_of_loads = found
    of_kinds = {}
    for k, example in enumerate(examples):
        here = loads.windows([(k, -np.inf, np.inf)])
        begins, ends = (loads.off(edge.between(here), k).t for edge in edges_of_loads)
        for label, times in example.labels.items():
            edges = {"contact": begins, "lift": ends}.get(recipes.neuron_of("touch", label) or "")
            of_kinds[k, label] = times, np.concatenate([begins, ends]) if edges is None else edges
    return _of_clock(examples, of_kinds)


def _of_clock(
    examples: Sequence[Example], of_kinds: Mapping[tuple[int, str], tuple[NDArray[np.int64], NDArray[np.int64]]]
) -> dict[tuple[int, str], tuple[_Times, _Times]]:
    """Return labels and what they are compared with from the beginning of each example, ms, ascending."""
    first_us = [_first_us(example) for example in examples]
    return {
        (k, label): (np.sort(labels - first_us[k]) / 1e3, np.sort(found - first_us[k]) / 1e3)
        for (k, label), (labels, found) in of_kinds.items()
    }


def _lines(
    examples: Sequence[Example], kinds: Mapping[tuple[int, str], tuple[_Times, _Times]], where: str, clock: str
) -> list[str]:
    """Return the fits of which labels are off as lines."""
    total = sum(len(labels) for labels, _ in kinds.values())
    fits, lines = explain(kinds), []
    # Detections are a little early or late, which those that are in place show.
    usual_ms = next((fit.shift_ms for fit in fits if not fit.is_off), 0.0)
    for fit in fits:
        if not fit.is_off:
            continue
        shift_ms = fit.shift_ms - usual_ms * (fit.rate == 1.0)
        by_ms, side = abs(shift_ms), "after" if shift_ms > 0 else "before"
        text = f"{by_ms:.0f} ms {side} {where}" + ", beside the others" * bool(usual_ms)
        if fit.rate != 1.0:
            text = f"{fit.rate:.4f} times as late as {clock}, and {by_ms:.0f} ms {side} them at the beginning"
        some = sorted({label for _, label in fit.pairs})
        names = ", ".join(some) if sum(map(len, some)) <= _NAMES else counted(len(some), "name")
        option = f" (--shift-ms {-fit.shift_ms:.0f})" if fit.rate == 1.0 and fit.explained >= _MOST * total else ""
        at = _stretch(examples, kinds, fit)
        lines.append(f"{names}: {fit.explained} of {total} labels are {text}, within {fit.reach_ms:.0f} ms{at}{option}")
    return lines


def _apart(kinds: Kinds, where: str) -> Iterator[str]:
    """Yield the names of which half of the labels are off by no one shift, though something is felt as often."""
    pairs = _pairs(kinds, 0.0, 1.0, REACHES_MS[0])
    for name in sorted({label for _, label in kinds}):
        of_name = [kind for kind in kinds if kind[1] == name]
        total, found = (sum(len(kinds[kind][side]) for kind in of_name) for side in (0, 1))
        apart = total - sum(len(pairs[kind]) for kind in of_name)
        if total >= _LEAST and found >= _MOST * total and 2 * apart >= total:
            off = f"{apart} of {total} labels are more than {REACHES_MS[0]:.0f} ms off {where}"
            yield f"{name}: {off}, by no one shift: are they of this recording, and in time? --window-ms allows more"


def _stretch(examples: Sequence[Example], kinds: Mapping[tuple[int, str], Any], fit: ClockFit) -> str:
    """Return from when to when the labels of a fit are, and in which recordings, where others are beside them."""
    places = sorted({k for k, _ in fit.pairs})
    among = "" if len(places) == len(examples) else f" in {len(places)} of {len(examples)} recordings"
    if len(places) > 1 or fit.explained >= _MOST * sum(
        len(labels) for (k, _), (labels, _) in kinds.items() if k in places
    ):
        return among if len(places) > 1 or not among else f" in {examples[places[0]].name[-_NAMES:]}"
    first_us = _first_us(examples[places[0]])
    begin_ms = (first_us - beginning_us(np.array([first_us]))) / 1e3
    times = np.concatenate([pairs[:, 0] for pairs in fit.pairs.values()]) + begin_ms
    of_one = f" in {examples[places[0]].name[-_NAMES:]}" if among else ""
    return f", from {times.min() / 1e3:.1f} to {times.max() / 1e3:.1f} s{of_one}"


def _first_us(example: Example) -> int:
    """Return when an example begins, us."""
    source = recorded(example.source, hold=False)
    if isinstance(source, SpikeTrains):
        return round(float(to_us(source.start)))
    return int(source.t[0]) if len(source.t) else 0
