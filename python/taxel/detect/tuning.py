"""The plain rule that fits labelled recordings best, by trying a grid of them on the loads of each recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite, number, several, text
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.detect import recipes
from taxel.detect.examples import Example, check_examples
from taxel.detect.loads import CHANGES, EdgeRule, FoundTimes, Loads, Stretch, clock_of, lacks, within
from taxel.detect.plain_rule import PlainRule
from taxel.detect.scoring import many, tally
from taxel.spikes import SpikeTrains, to_ms, to_us

#: Thresholds of the area, taxels.
AREAS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
#: Thresholds of the total: steps of a ladder with so many a decade, between these quantiles of its values above 0. The
#: upper quantile of readings is what they are at most.
STEPS_A_DECADE, QUANTILES = 8, (0.0, 0.95)
#: Thresholds of local loads, units of noise.
LOCAL_LOADS = (3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0)
#: Thresholds of the peak, units of noise.
PEAKS = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0, 32.0, 48.0)
#: Parts of the threshold below which a load ends.
RELEASES = (0.5, 1.0)
#: How many frames in a row decide.
FRAMES = (1, 2, 5, 10, 20)
#: Parts of its largest value below which a load ends, where its rest follows; and how many frames in a row decide then.
OF_LARGEST, FRAMES_OF_LARGEST = (0.1, 0.25, 0.5, 0.75), (1, 5)
#: Levels of a count by the unit: thesis 6.5.3.
LEVELS = {"N": (5.0, 10.0, 20.0, 30.0, 40.0, 50.0)}
#: Levels of a count in parts of the running range, and of what loaded taxels read at most; most are low, where loads
#: begin and end.
LEVEL_SHARES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.11, 0.15, 0.2, 0.3, 0.45)
#: Levels of the area where a touch began, ms, each alone.
BEGIN_LEVELS_MS = (10.0, 20.0, 30.0)
#: Numbers that a count rises to, or falls from.
COUNTS = (1, 2, 3, 4, 6, 8, 12, 16, 20, 24, 32, 48, 64, 96, 128, 192, 256)
#: The numbers that it was at most before it, or falls to, as parts of it, beside one less.
COUNT_RELEASES = (0.0, 0.25, 0.5, 0.75)
#: At so many numbers between the two a detection is dated.
DATES = 6
#: Ages at which kinds are decided, ms.
AGES_MS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 16.0, 20.0, 30.0, 50.0)
#: Rules are equally often right whose missed and false differ by at most that share of the labels: more is noise.
EQUAL_SHARE = 0.002
#: ... and so many of them within `NEAR_US`, beside one: of few labels one is noise.
NEAR_US = 10_000
#: Labels of one name may be so far off what was felt, ms; farther off they are of another clock, or of other loads.
FAR_MS = 250.0
#: They are off by one constant where of so many at least this share is within so many ms of it.
_LEAST, _MOST, _SAME_MS = 8, 0.8, 100.0
#: ... and with it taken off, so many fewer are missed and false, and that share of the labels.
_FEWER, _FEWER_SHARE = 3, 0.05


class _RuleFit(NamedTuple):
    """How a rule does."""

    wrong: int
    """Missed and false."""
    near: int
    """How many of those that were found are within `NEAR_US` of their label."""
    delay_ms: float
    """Median distance of `known` from the label of those that were found; infinite without any."""
    error_ms: float
    """Median distance of a detection from its label; infinite without any."""


class _Best(NamedTuple):
    fit: _RuleFit
    rule: PlainRule


def tune(
    examples: Sequence[Example],
    labels: Sequence[str] | None = None,
    *,
    window_ms: float = 50.0,
    noise_floor: float = 3.0,
    progress: Progress | None = None,
) -> dict[str, PlainRule | None]:
    """Return for each label the plain rule with the fewest missed and false detections, and of these the nearest one.

    Of rules whose missed and false differ by at most .2 % of the labels, the one counts with the most detections within
    10 ms of their label, and of these the one whose `known` is nearest to it at the median, before as after it: what is
    known earlier responds to something else.

    Of thresholds alike in all else that are equally right it is the middle one; so it is of the numbers that a count
    falls from.

    Tried are thresholds of the area (`AREAS`), of the total (`STEPS_A_DECADE`), of the local load, its rise and its
    fall (`LOCAL_LOADS`) and of the peak (`PEAKS`), with all numbers of frames (`FRAMES`) and releases (`RELEASES`), at
    the onset and at the end of a load; of channels those of peak and total alone. Of frames so are thresholds of total
    and peak with ends at parts of what they were at most (`OF_LARGEST`), and counts of levels that are on: levels by
    the unit (`LEVELS`), and in parts of what loaded taxels read at most and of the running range (`LEVEL_SHARES`), of
    which a load begins where the count rises to one number after it was at most another, and ends likewise, dated at a
    number between them. Of a grid so are the taxels by which a touch began (`BEGIN_LEVELS_MS`).

    Two labels are kinds where exactly two are nearer to onsets than to ends, or where there are only two: then
    thresholds of the area at each of `AGES_MS` are tried too, on a logarithmic scale, and thresholds of the duration as
    touches end, and hold for both where they are better for both together. Each frame that holds at one of these ages
    counts once.

    Parameters
    ----------
    examples : sequence of Example
        A label that an example lacks is not in it. Sources that are spike trains have no load; without a tare there are
        only counts by running range. Rules of the quantity whose thresholds the labels are (`Example`) are not tried.
    labels : sequence of str, optional
        Those to find rules for; default: all.
    window_ms : float, ms, 0 or more
        Largest distance of a detection from its label.
    noise_floor : float, 0 or more, in the sensor's unit (ticks)
        The board's.
    progress : function of (step, done, all), optional
        Called before each step; of folds with how many are done, else with 0 of 0.

    Returns
    -------
    dict of str to PlainRule or None
        None where no rule is better than to detect nothing, and where examples are spike trains: "no plain rule for
        NAME". Rules have no tare; each has one label, of kinds both.

    Raises
    ------
    ProblemError : examples that are invalid, or events without a tare

    Notes
    -----
    If rules are equal, the first counts: area before total before local loads before peak before counts, few frames
    before many. A rule that misses and invents as many as there are labels is no better than
    none.

    Examples
    --------
    >>> from taxel import Frames, Tare
    >>> frames = Frames([[[v, v], [0.0, 0.0]] for v in (0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> example = Example(frames, {"touch": [20_000], "removal": [50_000]}, Tare.take(frames, stop_us=20_000))
    >>> rules = tune([example], window_ms=5.0)
    >>> rules["touch"]
    PlainRule(touch: area >= 1, release 0.5, 1 frame)
    >>> rules["removal"]
    PlainRule(removal: area falls below 0.5 after 1 or more, 1 frame)
    """
    clocks = [clock_of(example) for example in examples] if isinstance(examples, Sequence) else []
    sound = check_examples(examples)
    report = reporting(progress)
    names = (
        sorted({name for example in sound for name in example.labels}) if labels is None else several("labels", labels)
    )
    names = [text("labels", name) for name in names]
    width_ms = finite("window_ms", window_ms, least=0.0, most=3.6e6)
    floor = number("noise_floor", noise_floor)
    if any(isinstance(example.source, SpikeTrains) for example in sound):
        return dict.fromkeys(names)
    if why := lacks(sound):
        raise ProblemError(why)
    tuning = Tuning(Loads(sound, clocks, floor, report), names, width_ms)
    return tuning.best_rules(tuning.loads.whole_examples)


class _Outcomes(NamedTuple):
    """What a rule made of the labels of one name: a row each label, then one each false detection."""

    t: NDArray[np.int64]
    """The label, or the false detection, us on the one clock."""
    error_ms: NDArray[np.float32]
    """How far its detection is from a label; NaN of one that is missed, infinite of a false detection."""
    delay_ms: NDArray[np.float32]
    """How far `known` is from it; likewise."""


class Tuning:
    """Find the best rules on parts of examples; what each rule does in all of them is computed once.

    Parameters
    ----------
    loads : Loads
    names : sequence of str
        The labels to find rules for.
    window_ms : float
        Largest distance of a detection from its label.
    """

    def __init__(self, loads: Loads, names: Sequence[str], window_ms: float) -> None:
        self.loads, self._names, self._width_us = loads, list(names), round(float(to_us(window_ms)))
        self._truth = {name: loads.truth(name, loads.whole_examples) for name in names}
        self._windows = loads.windows(loads.whole_examples)
        self._outcomes: dict[EdgeRule, dict[tuple[str, int], _Outcomes]] = {}

    def best_rules(self, parts: Sequence[Stretch], only: str | None = None) -> dict[str, PlainRule | None]:
        """Return for each label the best rule on parts of the examples, as `tune` does on all of them.

        `only`: rules of this quantity are tried alone, also where labels are thresholds of it.
        """
        truth = {name: self.loads.truth(name, parts) for name in self._names}
        points = list(_points(self.loads, parts, only))
        best = {name: self._at_edges(name, points, parts) for name in self._names}
        onsets = [name for name, pair in best.items() if _is_onset(*pair)]
        single = {name: _better(pair, len(truth[name])) for name, pair in best.items()}
        kinds = onsets if len(onsets) == 2 else self._names if len(self._names) == 2 else []
        if kinds and only is None and self.loads.have_rest:
            windows = self.loads.windows(parts)
            touches: dict[float | str, FoundTimes] = {
                age: self.loads.at_age(age).between(windows) for age in self.loads.ages_ms(AGES_MS)
            }
            # What is known last is tried last.
            touches["end"] = self.loads.at_end().between(windows)
            found = _for_kinds(touches, kinds, truth, self._width_us, self.loads.noise_floor, self.loads.unit)
            if found is not None and sum(fit.wrong for fit, _ in found) < sum(single[name].fit.wrong for name in kinds):
                single |= dict(zip(kinds, found, strict=True))
        return {name: tuned.rule if tuned.fit.wrong < len(truth[name]) else None for name, tuned in single.items()}

    def _at_edges(self, name: str, points: Sequence[EdgeRule], parts: Sequence[Stretch]) -> tuple[_Best, _Best]:
        """Return the best rule for a label at onsets, and the best at ends."""
        windows = self.loads.windows(parts)
        onset, end = (self._best_at(name, edge, points, windows) for edge in (0, 1))
        return onset, end

    def _best_at(self, name: str, edge: int, points: Sequence[EdgeRule], windows: NDArray[np.int64]) -> _Best:
        """Return the best rule for a label at one edge of loads, in windows on the one clock."""
        # A change of the load begins where the load begins or ends; it ends as it is forgotten.
        possible = [point for point in points if edge == 0 or point.quantity not in CHANGES]
        tried = [(point, found) for point in possible if (found := self._found(point).get((name, edge))) is not None]
        rule, fit = EdgeRule("peak", 4.0), _RuleFit(2**62, 0, np.inf, np.inf)
        if tried:
            rules, outcomes = zip(*tried, strict=True)
            k, fit = _best_of(outcomes, rules, edge, windows, len(self._truth[name]))
            rule = rules[k]
        labels_of = [name, None] if edge == 0 else [None, name]
        how: dict[str, Any] = {"labels": labels_of, "noise_floor": self.loads.noise_floor, "unit": self.loads.unit}
        return _Best(fit, PlainRule(**rule._asdict(), **how))

    def constant_ms(self, name: str) -> float:
        """Return by how much the labels of a name are later than what was felt, ms; 0 where that is not so.

        Where rules miss or invent many, it is that of the begins or ends of loads of which most are within the window
        once it is taken off; else it is that of touches, of a contact or lift, if it is more than the window.
        """
        parts, true = self.loads.whole_examples, self._truth[name]
        points = list(_points(self.loads, parts, None))
        wrong = min(len(true), *(best.fit.wrong for best in self._at_edges(name, points, parts)))
        named = {"contact": (0,), "lift": (1,)}.get(recipes.neuron_of("touch", name) or "")
        are_many = many(wrong, len(true))
        if len(true) < _LEAST or not self.loads.have_rest or not (are_many or named):
            return 0.0
        # Nearer to another label than to its own an edge says nothing.
        reach_us = int(min(to_us(FAR_MS + _SAME_MS), np.median(np.diff(true)) / 2))
        simple = [point for point in points if point.frames == 1 and not point.levels and point.quantity not in CHANGES]
        window_ms, found = to_ms(self._width_us), [(len(true), np.inf, 0.0)]
        for point, edge in product(simple if are_many else [self.loads.of_touches], named or (0, 1)):
            edges = self.loads.edges(point)[edge]
            pairs = tally(edges.t, edges.known, true, reach_us)
            if pairs is None or len(pairs.detected) < _MOST * len(true):
                continue
            constant = -float(np.median(pairs.errors_ms))
            off = np.abs(pairs.errors_ms + constant)
            same, near = (int(np.count_nonzero(off <= ms)) for ms in (_SAME_MS, window_ms))
            if same >= _MOST * len(true):
                # What is felt of a label outside the window is missed, but nothing else is felt there.
                found.append((len(true) - near + len(edges.t) - same, float(np.median(off)), constant))
        left, _, constant = min(found)
        few = max(_FEWER, round(_FEWER_SHARE * len(true)))
        better = left <= wrong - few if are_many else left <= few and abs(constant) > window_ms
        return constant if better and abs(constant) <= FAR_MS else 0.0

    def detected(self, rule: PlainRule | None, label: str, part: Stretch) -> FoundTimes:
        """Return what the rule of a label detects of it in a part of an example, as `taxel.detect.run` finds it."""
        if rule is None:
            return FoundTimes(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
        label_index = rule._parts["labels"].index(label)
        if isinstance(rule.age_ms, str):
            edges = self.loads.at_end()
        elif rule.age_ms is None:
            numbers = rule.quantity, rule.threshold, rule.release, rule.frames, rule.levels
            edges = self.loads.edges(EdgeRule(*numbers, rule.dated_at, rule.of_largest))[label_index]
        else:
            edges = self.loads.at_age(rule.age_ms)
        found = self.loads.off(edges.between(self.loads.windows([part])), part[0])
        if rule.age_ms is None:
            return found
        is_label = (found.value >= rule.threshold) == bool(label_index)
        return found._replace(t=found.t[is_label], known=found.known[is_label])

    def _found(self, point: EdgeRule) -> dict[tuple[str, int], _Outcomes]:
        """Return what a rule makes of each label at either edge; none where that is no better than nothing."""
        if point not in self._outcomes:
            self._outcomes[point] = {}
            for edge, edges in enumerate(self.loads.edges(point)):
                found = edges.between(self._windows)
                for name, true in self._truth.items():
                    outcomes = _outcomes(found, true, self._width_us)
                    if outcomes is not None:
                        self._outcomes[point][name, edge] = outcomes
        return self._outcomes[point]


def _points(loads: Loads, parts: Sequence[Stretch], only: str | None) -> Iterator[EdgeRule]:
    """Yield the grid, those that delay least first."""
    if loads.have_rest:
        # Channels have no local load, and their area shows edges no better than the peak.
        quantities: tuple[str, ...] = (
            ("peak", "total") if loads.are_channels else ("area", "total", "local_load", *CHANGES, "peak")
        )
        if only is not None:
            quantities = (only,)
        else:
            quantities = tuple(quantity for quantity in quantities if quantity not in loads.labels_of)
        totals = loads.values("total", parts) if "total" in quantities else np.empty(0)
        thresholds = {"area": AREAS, "total": _ladder(totals), "peak": PEAKS}
        thresholds |= dict.fromkeys(("local_load", *CHANGES), LOCAL_LOADS)
        for quantity in quantities:
            for threshold, frames, release in product(thresholds[quantity], FRAMES, RELEASES):
                yield EdgeRule(quantity, threshold, release, frames)
        for quantity in ("total", "peak"):
            if quantity not in quantities or not loads.are_frames:
                continue
            for threshold, frames, release in product(thresholds[quantity][::2], FRAMES_OF_LARGEST, OF_LARGEST):
                yield EdgeRule(quantity, threshold, release, frames, of_largest=True)
    if loads.are_frames and only is None:
        for quantity, levels in _levels(loads, parts):
            yield from _counts(quantity, levels, loads.values(quantity, parts, levels))


def _ladder(totals: NDArray[np.float64]) -> tuple[float, ...]:
    """Return thresholds of the total, which are the same for most parts of the same data."""
    totals = totals[totals > 0.0]
    if not len(totals):
        return ()
    low, high = STEPS_A_DECADE * np.log10(np.quantile(totals, QUANTILES))
    steps = np.arange(np.floor(low), np.ceil(high) + 1)
    return tuple(float(f"{step:.3g}") for step in 10.0 ** (steps / STEPS_A_DECADE))


def _levels(loads: Loads, parts: Sequence[Stretch]) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield the quantities with levels that are tried."""
    readings = loads.readings(parts) if loads.have_rest else np.empty(0)
    if len(readings):
        if loads.unit in LEVELS:
            yield "count", LEVELS[loads.unit]
        # On the ladder it is the same for most parts of the same data.
        steps = np.rint(STEPS_A_DECADE * np.log10(np.quantile(readings, QUANTILES[1])))
        most = 10.0 ** (steps / STEPS_A_DECADE)
        yield "count", tuple(float(f"{share * most:.2g}") for share in LEVEL_SHARES)
    yield "range_count", LEVEL_SHARES
    # Few channels begin a touch one by one.
    if loads.have_rest and not loads.are_channels:
        for level in BEGIN_LEVELS_MS:
            yield "begin_area", (level,)


def _counts(quantity: str, levels: tuple[float, ...], counts: NDArray[np.float64]) -> Iterator[EdgeRule]:
    """Yield rules of a count: rise to n after at most r, or fall to r after at least n, dated at a number between."""
    most = counts.max(initial=0.0)
    for n in COUNTS:
        if n > most:
            return
        for r in sorted({int(part * n) for part in COUNT_RELEASES} | {n - 1}):
            for dated_at in sorted({int(at) for at in np.linspace(r + 1, n, min(DATES, n - r))}, reverse=True):
                yield EdgeRule(quantity, n, (r + 0.5) / n, levels=levels, dated_at=float(dated_at))


def _outcomes(found: FoundTimes, true: NDArray[np.int64], width_us: int) -> _Outcomes | None:
    """Return what detections make of labels; None where they are no better than none."""
    t = found.t
    if not len(true) or abs(len(t) - len(true)) >= len(true):
        return None
    pairs = tally(t, found.known, true, width_us)
    assert pairs is not None
    missed, false = pairs.missed_events, pairs.false_detections
    if len(missed) + len(false) >= len(true):
        return None
    lost = np.full(len(missed), np.nan), np.full(len(false), np.inf)
    errors, delays = (np.abs(ms) for ms in (pairs.errors_ms, pairs.delays_ms))
    return _Outcomes(
        np.concatenate([true[pairs.events], true[missed], t[false]]),
        np.concatenate([errors, *lost]).astype(np.float32),
        np.concatenate([delays, *lost]).astype(np.float32),
    )


def _best_of(
    several: Sequence[_Outcomes],
    points: Sequence[EdgeRule],
    edge: int,
    windows: NDArray[np.int64],
    labels: int,
) -> tuple[int, _RuleFit]:
    """Return the place of the best rule in windows on the one clock, which ascend and have so many labels.

    Of thresholds alike in all else that are equally right it is the middle one: farthest from noise, and from what
    weaker loads reach.
    """
    rule = np.repeat(np.arange(len(several)), [len(outcomes.t) for outcomes in several])
    t, errors, delays = (np.concatenate(column) for column in zip(*several, strict=True))
    inside = within(t, windows)
    rule, errors, delays = rule[inside], errors[inside], delays[inside]
    found = np.isfinite(errors)
    wrong, near = (np.bincount(rule[of], minlength=len(several)) for of in (~found, errors <= to_ms(NEAR_US)))
    equal = np.flatnonzero(wrong <= wrong.min() + EQUAL_SHARE * labels)
    equal = equal[near[equal] >= near[equal].max() - 1 - EQUAL_SHARE * labels]
    rule, errors, delays = rule[found], errors[found], delays[found]
    stops = np.searchsorted(rule, np.arange(len(several)), side="right")

    def median(of: NDArray[np.float32], k: int) -> float:
        return _median(of[stops[k - 1] if k else 0 : stops[k]])

    def nearest(several: Sequence[int]) -> int:
        most = max(near[k] for k in several)
        return min((k for k in several if near[k] == most), key=lambda k: (median(delays, k), k))

    best = nearest(equal.tolist())
    alike = [k for k in equal.tolist() if k == best or _are_alike(points[k], points[best], edge)]
    thresholds = sorted({points[k].threshold for k in alike})
    middle = thresholds[(len(thresholds) - 1) // 2]
    best = nearest([k for k in alike if points[k].threshold == middle])
    return best, _RuleFit(int(wrong[best]), int(near[best]), median(delays, best), median(errors, best))


def _are_alike(one: EdgeRule, other: EdgeRule, edge: int) -> bool:
    """Whether rules differ only in their thresholds, which tell noise from loads, but not when a load begins or ends.

    Of a count that is so at ends: from which number it falls, and with it which dates are tried.
    """
    if not one.levels:
        return other == one._replace(threshold=other.threshold)
    are_of_one_count = (one.quantity, one.levels) == (other.quantity, other.levels)
    return (
        edge == 1
        and are_of_one_count
        and round(one.threshold * one.release, 1) == round(other.threshold * other.release, 1)
    )


def _is_onset(onset: _Best, end: _Best) -> bool:
    """Whether a label is that of the begin of a load; a load that falls begins where one ends."""
    return onset.fit.error_ms < end.fit.error_ms and onset.rule.quantity != "local_fall"


def _better(pair: tuple[_Best, _Best], labels: int) -> _Best:
    """Return the better of two rules for so many labels; the first where they are equal."""
    least = min(tuned.fit.wrong for tuned in pair)
    equal = [tuned for tuned in pair if tuned.fit.wrong <= least + EQUAL_SHARE * labels]
    return min(equal, key=lambda tuned: (-tuned.fit.near, tuned.fit.delay_ms))


def _median(values: NDArray[np.floating[Any]]) -> float:
    """Return the median; infinite without any. NumPy's takes ten times as long, and tens of thousands are asked for."""
    ordered, count = np.sort(values), len(values)
    return float((ordered[(count - 1) // 2] + ordered[count // 2]) / 2) if count else np.inf


def _fit(found: FoundTimes, true: NDArray[np.int64], width_us: int) -> _RuleFit:
    """Return how detections fit labels."""
    pairs = tally(found.t, found.known, true, width_us)
    if pairs is None:
        return _RuleFit(0, 0, np.inf, np.inf)
    wrong = len(pairs.missed_events) + len(pairs.false_detections)
    errors, delays = np.abs(pairs.errors_ms), np.abs(pairs.delays_ms)
    return _RuleFit(wrong, int(np.count_nonzero(errors <= to_ms(NEAR_US))), _median(delays), _median(errors))


def _for_kinds(
    touches: Mapping[float | str, FoundTimes],
    kinds: Sequence[str],
    truth: Mapping[str, NDArray[np.int64]],
    width_us: int,
    floor: float,
    unit: str | None,
) -> list[_Best] | None:
    """Return the best rule that decides between two kinds by the area at an age, or by the duration, once for each.

    None without any.
    """
    times = np.concatenate([truth[name] for name in kinds])
    order = np.argsort(times, kind="stable")
    is_second = (np.arange(len(times)) >= len(truth[kinds[0]]))[order]
    chosen: tuple[tuple[int, float], list[_Best]] | None = None
    for age, (t, known, areas) in touches.items():
        pairs = tally(t, known, times[order], width_us)
        detected, events = (np.empty(0, np.int64),) * 2 if pairs is None else (pairs.detected, pairs.events)
        second = is_second[events]
        if second.all() or not second.any():
            continue
        threshold, flipped = _between(areas[detected], second)
        below, above = reversed(kinds) if flipped else kinds
        fits = {}
        for name, is_kind in ((below, areas < threshold), (above, areas >= threshold)):
            fits[name] = _fit(FoundTimes(t[is_kind], known[is_kind], areas[is_kind]), truth[name], width_us)
        quantity = "duration" if age == "end" else "area"
        rule = PlainRule(quantity, threshold, age_ms=age, labels=(below, above), noise_floor=floor, unit=unit)
        best = [_Best(fits[name], rule) for name in kinds]
        rank = (sum(tuned.fit.wrong for tuned in best), max(tuned.fit.delay_ms for tuned in best))
        if chosen is None or rank < chosen[0]:
            chosen = (rank, best)
    return None if chosen is None else chosen[1]


def _between(areas: NDArray[np.float64], second: NDArray[np.bool_]) -> tuple[float, bool]:
    """Return the threshold on log area with the fewest on its wrong side, and whether the second kind is below it.

    If thresholds are equal, the one in the widest gap counts; an area of 0 counts as .5.
    """
    order = np.argsort(areas, kind="stable")
    logs, ones = np.log(np.maximum(areas[order], 0.5)), second[order]
    # By how many values are below: how many of the first kind are wrong above, and of the second below.
    below_first, below_second = (np.concatenate([[0], np.cumsum(mask)]) for mask in (~ones, ones))
    wrong = below_second + below_first[-1] - below_first
    flipped = len(ones) - wrong
    gaps = np.diff(logs)
    sound = np.flatnonzero(gaps > 0.0)
    if not len(sound):
        return float(np.exp(logs[0])), False
    best, flip = min(
        ((int(counts[k + 1]), -float(gaps[k]), float(np.exp((logs[k] + logs[k + 1]) / 2.0))), over)
        for over, counts in ((False, wrong), (True, flipped))
        for k in sound
    )
    return best[2], flip
