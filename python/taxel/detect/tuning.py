"""The plain rule that fits labelled recordings best, by one search over all quantities of a load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite, several, text
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.detect import recipes
from taxel.detect.examples import Example, check_examples
from taxel.detect.loads import CHANGES, EdgeRule, FoundTimes, Loads, Stretch, clock_of, lacks, within
from taxel.detect.plain_rule import PlainRule
from taxel.detect.scoring import APART_US, in_spans, many, tally
from taxel.spikes import SpikeTrains, to_ms, to_us

#: Levels of a quantity are so many quantiles of it where it is loaded, which tell weak loads apart, and so many
#: geometric steps from its noise to its largest value, which short events reach.
QUANTILES, STEPS = 15, 15
#: They stand on a ladder of so many a decade.
LADDER = 24
#: Parts of the level below which a load ends.
RELEASES = (0.25, 0.5, 0.75, 1.0)
#: For how long it is below that, ms.
QUIETS_MS = (0.0, 50.0)
#: So many levels of a count are geometric steps from the noise floor, or of channels from that part of it, to this
#: quantile of what loaded taxels read.
LEVELS, LEAST_SHARE, MOST = 8, 0.1, 0.5
#: A touch has settled after so long, ms; what happens within it is over once it is below these parts of its level, for
#: so long, ms: chosen on the recordings that `taxel bench grip` learns from.
SETTLING_MS, RELEASES_WITHIN, QUIETS_WITHIN_MS = 300.0, (0.25, 0.5), (0.0, 50.0, 200.0, 500.0)
#: Without its largest taxel the load of so many taxels is tried.
SPARE = 8
#: Levels of the area where a touch began, ms, each alone.
BEGIN_LEVELS_MS = (10.0, 20.0, 30.0)
#: What counts first where rules are equal: a bad taxel is not in the first, and loads are what people see.
FIRST = (("load_without_largest",), ("load", "count", "range_load"))
#: Where noise alone is, of quantities in other units than the sensor's.
_LEAST = {"range_load": 0.01, "local_load": 3.0, "local_rise": 3.0, "local_fall": 3.0}
#: Quantities that are whole numbers.
_WHOLE = ("count", "area", "begin_area")
#: So many rules are compared at once.
_ROWS = 128
#: Ages at which kinds are decided, ms.
AGES_MS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 16.0, 20.0, 30.0, 50.0)
#: A detection that is farther off than this part of the window is that part of a mistake: half a one made rules wrong
#: more often on gaitndd (foot-off, 12 people left out in fives: 199, not 136).
OFF, OFF_COST = 0.2, 0.1
#: Rules are equal whose mistakes differ by at most one, by that share of the labels, or by that part of the root of how
#: many are mistakes or off: more is chance.
EQUAL_SHARE, EQUAL_ROOT = 0.002, 0.5
#: ... and a quantity is preferred where so many levels of one rule are equal: one alone is luck.
PLATEAU = 3
#: Labels of one name may be so far off what was felt, ms; farther off they are of another clock, or of other loads.
FAR_MS = 250.0
#: They are off by one constant where of so many at least this share is within so many ms of it.
_FEWEST, _MOST, _SAME_MS = 8, 0.8, 100.0
#: ... and with it taken off, so many fewer are missed and false, and that share of the labels.
_FEWER, _FEWER_SHARE = 3, 0.05


class _RuleFit(NamedTuple):
    """How a rule does."""

    wrong: int
    """Missed and false."""
    off: int
    """How many of those that were found are off."""
    constant_ms: float
    """The median distance of what was found from the labels, less which they are off."""
    delay_ms: float
    """Median distance of `known` from the label of those that were found; infinite without any."""

    @property
    def cost(self) -> float:
        """Mistakes, of which those that are off are parts."""
        return self.wrong + OFF_COST * self.off

    def room(self, labels: int) -> float:
        """Return by how much more the cost of an equal rule for so many labels may be."""
        return float(max(1.0, EQUAL_SHARE * labels, EQUAL_ROOT * (self.wrong + self.off) ** 0.5))


_NONE = _RuleFit(2**31, 0, np.inf, np.inf)


class _Best(NamedTuple):
    fit: _RuleFit
    rule: PlainRule | None


def tune(
    examples: Sequence[Example],
    labels: Sequence[str] | None = None,
    *,
    window_ms: float = 50.0,
    noise_floor: float = 3.0,
    progress: Progress | None = None,
) -> dict[str, PlainRule | None]:
    """Return for each label the plain rule with the fewest mistakes, dated and less its constant.

    A mistake is a missed or a false detection; one that is farther off than a fifth of the window, and a frame at
    least, is a tenth of one. Rules are equal whose mistakes differ by no more than one, .2 % of the labels, and half
    the root of the number of those that are wrong or off. Of equal ones counts first the load without its largest
    taxel, then a load or a count, then any other, where three levels are equal; of these the least `known`, to a
    fifth of the window, the fewest mistakes, to .2 % of the labels, and the level in the lower quarter of those that do
    as well with the same other numbers. None is known later than the window, at the median,
    or within a touch later than that after what was felt.

    Tried are quantities of a load (`PlainRule`), each at levels that are quantiles and geometric steps of its values
    (`QUANTILES`, `STEPS`) on a ladder (`LADDER`), which end at parts of these (`RELEASES`) after a quiet time
    (`QUIETS_MS`), dated at the level or halfway to its release.

    Two labels are kinds where exactly two are nearer to onsets than to ends, or where there are only two: then
    levels of the area at each of `AGES_MS` are tried too, on a logarithmic scale, and levels of the duration as
    touches end, and hold for both where they are better for both together. Each frame that holds at one of these ages
    counts once.

    Parameters
    ----------
    examples : sequence of Example
        A label that an example lacks is not in it. Sources that are spike trains have no load; without a tare there is
        only the load by running range. Rules of the quantity whose thresholds the labels are (`Example`) are not tried.
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
    A rule that misses and invents as many as there are labels is no better than none.

    Examples
    --------
    >>> from taxel import Frames, Tare
    >>> frames = Frames([[[v, v], [0.0, 0.0]] for v in (0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> example = Example(frames, {"touch": [20_000], "removal": [50_000]}, Tare.take(frames, stop_us=20_000))
    >>> rules = tune([example], window_ms=5.0)
    >>> rules["touch"]
    PlainRule(touch: load (counts) >= 4.22, release 0.25)
    >>> rules["removal"]
    PlainRule(removal: load (counts) falls below 1.05 after 4.22 or more)
    """
    clocks = [clock_of(example) for example in examples] if isinstance(examples, Sequence) else []
    sound = check_examples(examples)
    report = reporting(progress)
    names = (
        sorted({name for example in sound for name in example.labels}) if labels is None else several("labels", labels)
    )
    names = [text("labels", name) for name in names]
    width_ms = finite("window_ms", window_ms, least=0.0, most=3.6e6)
    floor = finite("noise_floor", noise_floor, least=0.0)
    if any(isinstance(example.source, SpikeTrains) for example in sound):
        return dict.fromkeys(names)
    if why := lacks(sound):
        raise ProblemError(why)
    tuning = Tuning(Loads(sound, clocks, floor, report), names, width_ms)
    return tuning.best_rules(tuning.loads.whole_examples)


class _Outcomes(NamedTuple):
    """What rules made of the labels of one name, a row each of those that are better than to detect nothing."""

    rules: list[EdgeRule]
    error_ms: NDArray[np.float32]
    """How far the detection of each label is from it, later is positive; NaN of one that is missed."""
    delay_ms: NDArray[np.float32]
    """How far `known` is from it; likewise."""
    false: NDArray[np.int64]
    """The false detections of all, us on the one clock, and of which row each is."""
    of: NDArray[np.int64]

    @classmethod
    def joined(cls, each: Sequence[Self]) -> Self:
        """Return those of several as one."""
        first = np.cumsum([0, *(len(one.rules) for one in each)])
        of = [one.of + row for one, row in zip(each, first[:-1], strict=True)]
        errors, delays, false, rows = (
            np.concatenate(column) for column in (*zip(*(one[1:4] for one in each), strict=True), of)
        )
        return cls([rule for one in each for rule in one.rules], errors, delays, false, rows)


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
        self.loads, self._names, self._window_ms = loads, list(names), window_ms
        self._width_us = round(float(to_us(window_ms)))
        #: From how far off a detection is part of a mistake.
        self.off_ms = max(OFF * window_ms, loads.frame_ms)
        self._truth = {name: loads.truth(name, loads.whole_examples) for name in names}
        self._spans = {name: loads.spans(name) for name in names}
        self._windows = loads.windows(loads.whole_examples)
        #: The names whose labels lie within touches, most of them.
        self.within = {name for name, true in self._truth.items() if 2 * loads.inside(name, self._width_us) > len(true)}
        self._tried: set[EdgeRule] = set()
        #: Of a label at the begins and at the ends of loads.
        self._outcomes: dict[tuple[str, int], _Outcomes] = {}

    def best_rules(self, parts: Sequence[Stretch], only: str | None = None) -> dict[str, PlainRule | None]:
        """Return for each label the best rule on parts of the examples, as `tune` does on all of them.

        `only`: rules of this quantity are tried alone, also where labels are levels of it.
        """
        windows = self.loads.windows(parts)
        truth = {name: self.loads.truth(name, parts) for name in self._names}
        grid = [*_grid(self.loads, parts, only), *(_within_touches(self.loads, parts) if self.within else ())]
        edges = {name: tuple(self._best_at(name, edge, windows, grid) for edge in (0, 1)) for name in self._names}
        onsets = [name for name, pair in edges.items() if _is_onset(*pair)]
        single = {name: self._better(pair, len(truth[name])) for name, pair in edges.items()}
        kinds = onsets if len(onsets) == 2 else self._names if len(self._names) == 2 else []
        if kinds and only is None and self.loads.have_rest:
            touches: dict[float | str, FoundTimes] = {
                age: self.loads.at_age(age).between(windows) for age in self.loads.ages_ms(AGES_MS)
            }
            # What is known last is tried last.
            touches["end"] = self.loads.at_end().between(windows)
            found = self._for_kinds(touches, kinds, truth)
            if found is not None and sum(one.fit.cost for one in found) < sum(single[name].fit.cost for name in kinds):
                single |= dict(zip(kinds, found, strict=True))
        return {name: best.rule if best.fit.wrong < len(truth[name]) else None for name, best in single.items()}

    def _better(self, pair: Sequence[_Best], labels: int) -> _Best:
        """Return the better of two rules for so many labels, of equal ones the preferred, then the one nearer."""
        best = min(pair, key=lambda one: one.fit.cost)
        equal = [one for one in pair if one.fit.cost <= best.fit.cost + best.fit.room(labels)]
        return min(equal, key=lambda one: (_rank(one.rule), abs(one.fit.constant_ms)), default=best)

    def _best_at(self, name: str, edge: int, windows: NDArray[np.int64], grid: Sequence[EdgeRule]) -> _Best:
        """Return the best rule for a label at one edge of loads, in windows on the one clock."""
        labels = int(np.count_nonzero(within(self._truth[name], windows)))
        best = self._equal(self._fits(name, edge, windows, grid), labels)
        if best is None:
            return _Best(_NONE, None)
        rule, fit = best
        names = [name, None] if edge == 0 else [None, name]
        how: dict[str, Any] = {"labels": names, "noise_floor": self.loads.noise_floor, "unit": self.loads.unit}
        return _Best(fit, PlainRule(**rule._asdict(), constant_ms=float(f"{fit.constant_ms:.3g}"), **how))

    def _fits(
        self, name: str, edge: int, windows: NDArray[np.int64], rules: Sequence[EdgeRule]
    ) -> list[tuple[EdgeRule, _RuleFit]]:
        """Return how rules do in windows, of those that may be equal to the best, and are not known too late."""
        self._try([rule for rule in rules if rule not in self._tried])
        fits: list[tuple[EdgeRule, _RuleFit]] = []
        if (outcomes := self._outcomes.get((name, edge))) is None:
            return fits
        place = {rule: row for row, rule in enumerate(outcomes.rules)}
        tried = np.array([place[rule] for rule in rules if rule in place], np.int64)
        inside = np.ix_(tried, np.flatnonzero(within(self._truth[name], windows)))
        false = np.bincount(outcomes.of[within(outcomes.false, windows)], minlength=len(outcomes.rules))[tried]
        errors, delays = outcomes.error_ms[inside], outcomes.delay_ms[inside]
        least = np.isnan(errors).sum(axis=1) + false
        order, most = np.argsort(least, kind="stable"), np.inf
        for k in range(0, len(order), _ROWS):
            rows = order[k : k + _ROWS]
            if least[rows[0]] > most:
                break
            for row, fit in zip(rows.tolist(), self._of_rows(errors[rows], delays[rows], false[rows]), strict=True):
                rule = outcomes.rules[tried[row]]
                # What happens within a touch is felt later than its label.
                felt_ms = max(fit.constant_ms, 0.0) if rule.touched_ms is not None else 0.0
                if fit.delay_ms - felt_ms <= self._window_ms + self.loads.frame_ms:
                    fits.append((rule, fit))
                    most = min(most, fit.cost + fit.room(errors.shape[1]))
        return fits

    def _equal(self, tried: Sequence[tuple[EdgeRule, _RuleFit]], labels: int) -> tuple[EdgeRule, _RuleFit] | None:
        """Return the preferred of the rules that are equal to the best for so many labels; None without any.

        Of those of the preferred quantity count the ones that are known no later than a fifth of the window after the
        first of them, and of these those whose mistakes differ by no more than `EQUAL_SHARE` of the labels. It is the
        one with the most levels that do as well, at the level in the lower quarter of these.
        """
        if not tried:
            return None
        best, least = min(tried, key=lambda one: one[1].cost)
        alike: dict[EdgeRule, list[tuple[EdgeRule, _RuleFit]]] = {}
        for rule, fit in tried:
            if fit.cost <= least.cost + least.room(labels):
                alike.setdefault(rule._replace(level=1.0), []).append((rule, fit))
        first = min((_rank(rule) for rule, each in alike.items() if len(each) >= PLATEAU), default=_rank(best))
        preferred = [each for rule, each in alike.items() if _rank(rule) == first]
        late_ms = min(fit.delay_ms for each in preferred for _, fit in each) + self.off_ms
        soon = [[one for one in each if one[1].delay_ms <= late_ms] for each in preferred]
        most = min(fit.cost for each in soon for _, fit in each) + EQUAL_SHARE * labels
        widest = max(([one for one in each if one[1].cost <= most] for each in soon), key=len)
        widest.sort(key=lambda one: one[0].level)
        return widest[(len(widest) - 1) // 4]

    def _of_rows(
        self, errors_ms: NDArray[np.float32], delays_ms: NDArray[np.float32], false: NDArray[np.int64]
    ) -> Iterator[_RuleFit]:
        """Yield how rules do by their errors, NaN of labels that they miss, once the median is taken off."""
        constants_ms, known_ms = _medians(errors_ms), _medians(delays_ms)
        apart = np.abs(errors_ms - constants_ms[:, None])
        # Farther from its label than the window a detection is false, and the label missed.
        far = np.count_nonzero(apart > self._window_ms, axis=1)
        off = np.count_nonzero(apart > self.off_ms, axis=1) - far
        wrong = np.count_nonzero(np.isnan(errors_ms), axis=1) + false + 2 * far
        columns = (column.tolist() for column in (wrong, off, constants_ms, known_ms))
        return map(_RuleFit, *columns)

    def _try(self, rules: Sequence[EdgeRule]) -> None:
        """Keep what rules make of each label at either edge, some of them at once."""
        self._tried.update(rules)
        made: dict[tuple[str, int], list[_Outcomes]] = {}
        for k in range(0, len(rules), _ROWS):
            some = rules[k : k + _ROWS]
            each = [[edges.between(self._windows) for edges in self.loads.edges(rule)] for rule in some]
            for edge, (name, true) in product((0, 1), self._truth.items()):
                # A change of the load begins where the load begins or ends; it ends as it is forgotten.
                fit = [
                    k
                    for k, rule in enumerate(some)
                    if not (edge and rule.quantity in CHANGES) and (rule.touched_ms is None or name in self.within)
                ]
                outcomes = self._made([some[k] for k in fit], [each[k][edge] for k in fit], true, self._spans[name])
                if outcomes is not None:
                    made.setdefault((name, edge), []).append(outcomes)
        for key, of_key in made.items():
            self._outcomes[key] = _Outcomes.joined([*filter(None, [self._outcomes.get(key)]), *of_key])

    def _made(
        self,
        rules: Sequence[EdgeRule],
        found: Sequence[FoundTimes],
        true: NDArray[np.int64],
        spans: NDArray[np.int64],
    ) -> _Outcomes | None:
        """Return what rules make of labels by what each finds; None where none is better than to find nothing.

        Left out are those that find half as many more or fewer. Rules are one after the other on one clock, as the
        examples of each are.
        """
        sound = [k for k, one in enumerate(found) if 2 * abs(len(one.t) - len(true)) < len(true)]
        if not sound:
            return None
        of = np.repeat(np.arange(len(sound)), [len(found[k].t) for k in sound])
        t, known = (np.concatenate([getattr(found[k], name) for k in sound]) for name in ("t", "known"))
        errors, delays, is_false = self._paired(t, known, of, len(sound), true)
        is_within = np.array([rules[k].touched_ms is not None for k in sound])
        if is_within.any():
            # Of what happens within touches the window is around the median distance from the labels.
            medians = _medians(errors)
            late_us = np.rint(to_us(np.where(is_within & np.isfinite(medians), medians, 0.0))).astype(np.int64)
            errors, delays, is_false = self._paired(t - late_us[of], known, of, len(sound), true)
            errors += to_ms(late_us)[:, None]
        is_false &= ~in_spans(t, spans)
        wrong = np.isnan(errors).sum(axis=1) + np.bincount(of[is_false], minlength=len(sound))
        better = np.flatnonzero(wrong < len(true))
        place = np.full(len(sound), -1)
        place[better] = np.arange(len(better))
        is_false &= place[of] >= 0
        kept = [rules[sound[row]] for row in better]
        return _Outcomes(kept, errors[better], delays[better], t[is_false], place[of[is_false]]) if kept else None

    def _paired(
        self, t: NDArray[np.int64], known: NDArray[np.int64], of: NDArray[np.int64], rows: int, true: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]:
        """Return how far detections and `known` of several rules are from each label, and which are false."""
        begins = np.arange(rows) * (len(self.loads.whole_examples) + 1) * APART_US
        pairs = tally(t + begins[of], known + begins[of], (true + begins[:, None]).ravel(), self._width_us)
        assert pairs is not None
        is_false = np.ones(len(t), np.bool_)
        is_false[pairs.detected] = False
        errors, delays = np.full((2, rows * len(true)), np.nan, np.float32)
        errors[pairs.events], delays[pairs.events] = pairs.errors_ms, pairs.delays_ms
        return errors.reshape(rows, -1), delays.reshape(rows, -1), is_false

    def _for_kinds(
        self,
        touches: Mapping[float | str, FoundTimes],
        kinds: Sequence[str],
        truth: Mapping[str, NDArray[np.int64]],
    ) -> list[_Best] | None:
        """Return the best rule that decides between two kinds by the area at an age, or by the duration, once for each.

        None without any.
        """
        times = np.concatenate([truth[name] for name in kinds])
        order = np.argsort(times, kind="stable")
        is_second = (np.arange(len(times)) >= len(truth[kinds[0]]))[order]
        chosen: tuple[tuple[float, float], list[_Best]] | None = None
        for age, (t, known, areas) in touches.items():
            pairs = tally(t, known, times[order], self._width_us)
            detected, events = (np.empty(0, np.int64),) * 2 if pairs is None else (pairs.detected, pairs.events)
            second = is_second[events]
            if second.all() or not second.any():
                continue
            level, flipped = _between(areas[detected], second)
            below, above = reversed(kinds) if flipped else kinds
            fits = {}
            for name, is_kind in ((below, areas < level), (above, areas >= level)):
                of_kind = FoundTimes(t[is_kind], known[is_kind], areas[is_kind])
                one = self._made([EdgeRule("area", level)], [of_kind], truth[name], self._spans[name])
                fits[name] = _NONE
                if one is not None:
                    [fits[name]] = self._of_rows(one.error_ms, one.delay_ms, np.array([len(one.false)]))
            quantity = "duration" if age == "end" else "area"
            how: dict[str, Any] = {"noise_floor": self.loads.noise_floor, "unit": self.loads.unit}
            rule = PlainRule(quantity, level, age_ms=age, labels=(below, above), **how)
            best = [_Best(fits[name], rule) for name in kinds]
            rank = (sum(one.fit.wrong for one in best), max(one.fit.delay_ms for one in best))
            if chosen is None or rank < chosen[0]:
                chosen = (rank, best)
        return None if chosen is None else chosen[1]

    def constant_ms(self, name: str) -> float:
        """Return by how much the labels of a name are later than what was felt, ms; 0 where that is not so.

        Where rules miss or invent many, it is that of the begins or ends of loads of which most are within the window
        once it is taken off; else it is that of touches, of a contact or lift, if it is more than the window.
        """
        true = self._truth[name]
        grid = list(_grid(self.loads, self.loads.whole_examples, None))
        wrong = min(len(true), *(self._best_at(name, edge, self._windows, grid).fit.wrong for edge in (0, 1)))
        named = {"contact": (0,), "lift": (1,)}.get(recipes.neuron_of("touch", name) or "")
        are_many = many(wrong, len(true))
        if len(true) < _FEWEST or not self.loads.have_rest or not (are_many or named):
            return 0.0
        # Nearer to another label than to its own an edge says nothing.
        reach_us = int(min(to_us(FAR_MS + _SAME_MS), np.median(np.diff(true)) / 2))
        simple = [point for point in grid if not point.quiet_ms and "load" in point.quantity]
        found = [(len(true), np.inf, 0.0)]
        for point, edge in product(simple if are_many else [self.loads.of_touches], named or (0, 1)):
            edges = self.loads.edges(point)[edge]
            pairs = tally(edges.t, edges.known, true, reach_us)
            if pairs is None or len(pairs.detected) < _MOST * len(true):
                continue
            constant = -float(np.median(pairs.errors_ms))
            off = np.abs(pairs.errors_ms + constant)
            same, near = (int(np.count_nonzero(off <= ms)) for ms in (_SAME_MS, self._window_ms))
            if same >= _MOST * len(true):
                # What is felt of a label outside the window is missed, but nothing else is felt there.
                found.append((len(true) - near + len(edges.t) - same, float(np.median(off)), constant))
        left, _, constant = min(found)
        few = max(_FEWER, round(_FEWER_SHARE * len(true)))
        better = left <= wrong - few if are_many else left <= few and abs(constant) > self._window_ms
        return constant if better and abs(constant) <= FAR_MS else 0.0


def _grid(loads: Loads, parts: Sequence[Stretch], only: str | None) -> Iterator[EdgeRule]:
    """Yield the rules of the first search, of all quantities or of one: fewer of those that do not count first."""
    for quantity, levels in _quantities(loads, only):
        is_first = only is not None or _rank(EdgeRule(quantity, 1.0, levels=levels)) < len(FIRST)
        for level in _levels(quantity, loads.values(quantity, parts, levels), loads.noise_floor, 1 if is_first else 2):
            ends = set()
            for release in RELEASES if is_first else RELEASES[1::2]:
                # Of whole numbers some releases are the same.
                end = np.ceil(release * level) if quantity in _WHOLE else release
                # Slow loads come to a high level late, and are dated before it.
                dates = (None, (1.0 + release) / 2) if is_first and release < 1.0 else (None,)
                for date, quiet_ms in product(dates, QUIETS_MS) if end not in ends else ():
                    yield EdgeRule(quantity, level, release, quiet_ms, date, levels)
                ends.add(end)


def _within_touches(loads: Loads, parts: Sequence[Stretch]) -> Iterator[EdgeRule]:
    """Yield the rules of what happens within touches."""
    several, axes = ("moved",) * (loads.taxels > 1), ("shear_rise", "shear_fall") * loads.have_axes
    for quantity in (*several, "rise", "fall", *axes):
        values = loads.values(quantity, parts, touched_ms=SETTLING_MS)
        for level in _levels(quantity, values, loads.noise_floor, 1):
            for release, quiet_ms in product(RELEASES_WITHIN, QUIETS_WITHIN_MS):
                for date in (None, (1.0 + release) / 2):
                    yield EdgeRule(quantity, level, release, quiet_ms, date, touched_ms=SETTLING_MS)


def _quantities(loads: Loads, only: str | None) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield the quantities that examples allow, with the levels of a count; or one."""
    if only is not None:
        yield only, ()
        return
    if loads.are_frames:
        yield "range_load", ()
    if not loads.have_rest:
        return
    is_of_load = "load" in loads.labels_of
    if not is_of_load:
        if loads.taxels >= SPARE:
            yield "load_without_largest", ()
        yield "load", ()
    if loads.taxels > 1 and len(loads.readings):
        most = float(np.quantile(loads.readings, MOST))
        least = LEAST_SHARE * most if loads.are_channels else float(loads.readings.min())
        yield "count", tuple(sorted(_snapped(np.geomspace(least, most, LEVELS))))
        yield "moved", ()
    for quantity in ("rise", "fall"):
        yield quantity, ()
    # Few channels begin a touch one by one.
    if not loads.are_channels:
        for quantity in ("local_load", "local_rise", "local_fall"):
            yield quantity, ()
        for level in BEGIN_LEVELS_MS:
            yield "begin_area", (level,)


def _levels(quantity: str, values: NDArray[np.float64], floor: float, every: int) -> list[float]:
    """Return the levels of a quantity that are tried, ascending: all, or every so many."""
    least = 1.0 if quantity in _WHOLE else _LEAST.get(quantity, floor)
    loaded = values[(values >= least) & (values > 0.0)]
    if not len(loaded):
        return []
    steps = np.geomspace(least or float(loaded.min()), float(loaded.max()), STEPS)[::every]
    quantiles = np.quantile(loaded, (np.arange(QUANTILES) + 0.5) / QUANTILES)[::every]
    levels = np.concatenate([steps, quantiles])
    if quantity in _WHOLE:
        return [float(level) for level in np.unique(np.rint(levels)) if level >= 1.0]
    return sorted(_snapped(levels))


def _snapped(levels: NDArray[np.float64]) -> set[float]:
    """Return levels on a ladder, so that they are the same for most parts of the same data."""
    return {float(f"{10.0**step:.3g}") for step in np.rint(LADDER * np.log10(levels)) / LADDER}


def _rank(rule: EdgeRule | PlainRule | None) -> int:
    """Return the place of a rule where others are equal."""
    return next((k for k, names in enumerate(FIRST) if rule is not None and rule.quantity in names), len(FIRST))


def _is_onset(onset: _Best, end: _Best) -> bool:
    """Whether a label is that of the begin of a load; a load that falls begins where one ends."""
    is_fall = onset.rule is not None and onset.rule.quantity in ("fall", "shear_fall", "local_fall")
    return abs(onset.fit.constant_ms) < abs(end.fit.constant_ms) and not is_fall


def _medians(values: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the median of each row without its NaN; infinite without any."""
    ordered, count = np.sort(values, axis=1).astype(np.float64), np.count_nonzero(~np.isnan(values), axis=1)
    rows, last = np.arange(len(values)), np.maximum(count - 1, 0)
    if not values.shape[1]:
        return np.full(len(values), np.inf)
    middle = (ordered[rows, last // 2] + ordered[rows, np.minimum(count // 2, last)]) / 2
    return np.where(count > 0, middle, np.inf)


def _between(areas: NDArray[np.float64], second: NDArray[np.bool_]) -> tuple[float, bool]:
    """Return the level on log area with the fewest on its wrong side, and whether the second kind is below it.

    If levels are equal, the one in the widest gap counts; an area of 0 counts as .5.
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
