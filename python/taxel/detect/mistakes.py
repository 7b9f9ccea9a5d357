"""Measure missed and false detections, of a training and of a readout: where they are, beside what."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import are, counted, of_names, ranged
from taxel._base.times import beginning_us
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.cause import Cause, by_option, ordered
from taxel.detect.examples import Example, Outcome, check_examples
from taxel.detect.exchanged import exchanged_names
from taxel.detect.label_times import PEAK, FeltLoads, chance_of, other_rate, same_distance, span_us
from taxel.detect.scoring import APART_US, Mistake, Score, mistakes_of, score, score_together
from taxel.detections import Detections
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.gaps import missing_frames
from taxel.spikes import to_us

#: From which share of the events on missed or false ones are many.
MANY = 0.05
#: What is measured counts where chance brings as much with at most this probability.
_CHANCE = 0.01
#: A stretch of time has one distance where this share of its labels has it.
_STRETCH = 0.8
#: A gap in which a touch may be missed lasts that, us.
_GAP_US = 200_000
#: Names of labels that are as far from detections as others within this are moved together, ms.
_SAME_MS = 50.0
#: Labels or detections are those where loads begin or end if this share more of them is there than of the others.
_FITS = 0.3
#: Labels are a cause in a recording unlike the training only if this share of them is found.
_FOUND = 0.8
#: Detections are far too many that are false so many times as often as there are labels.
_FAR_MORE = 2
#: Fewer events missed and false are few.
_FEW = 3
#: A single label tells no cause of how far detections are.
_SEVERAL = 2
#: Labels of a recording are all off where this share of them has a detection at the same distance.
_NEARLY_ALL = 0.85
#: So many times of labels are named.
_NAMED = 3
#: A load changes slowly that takes so long, ms, from the first to the second part of its change, and no longer from its
#: label to the first. It is looked at so often for so long, ms, which is as far as its detection may be.
_BEGUN, _MADE, _MADE_MS = 0.1, 0.8, 2 * WINDOW_MS
_LOOKS, _SLOW_MS = 51, 500.0


def many_wrong(scored: Score) -> dict[str, int]:
    """Return how many events are missed and false of each label of which more than 5 % are."""
    scores = (scored.by_label or {scored.label: scored}).items()
    return {label: part.rank[0] for label, part in scores if max(part.missed, part.false) > MANY * part.events}


def unreliable(label: str, scored: Score, labels: str, on: str = "this readout") -> str:
    """Return that a score of a label is too bad to rely on; "" where it is not.

    Parameters
    ----------
    label : str
    scored : Score
    labels : str
        What its events are called.
    on : str
        What is not to be relied on.
    """
    if (
        not scored.events
        or not scored.rank[0]
        or (scored.rank[0] < scored.events and 2 * scored.missed <= scored.events)
    ):
        return ""
    worth = ", no better than to detect nothing" if scored.rank[0] >= scored.events else ""
    return (
        f"{label}: do not rely on {on}: {scored.found} of {scored.events} {labels} found, {scored.false} false{worth}"
    )


def score_of(outcomes: Sequence[Outcome], window_ms: float) -> Score:
    """Return the score of the detections in several examples as one."""
    found = [outcome.example._known(outcome.found) for outcome in outcomes]
    return score_together(found, [outcome.example.labels for outcome in outcomes], window_ms)


def causes_of(
    outcomes: Sequence[Outcome],
    window_ms: float,
    differences: Sequence[Sequence[str]] = (),
    standing: Standing | None = None,
) -> tuple[Cause, ...]:
    """Return what concerns most of what a readout missed, and what is false; none of few mistakes.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Those of one recording, whose sources have one clock. Their labels are those that they are scored against.
    window_ms : float, ms
        The window of the scores.
    differences : sequence of sequence of str
        In what each differs from the training, as `taxel.detect.training_data.unlike` says.
    standing : Standing, optional
        A load of theirs that stays.
    """
    scored = score_of(outcomes, window_ms)
    wrong = many_wrong(scored)
    if sum(wrong.values()) < _FEW:
        return ()
    examples = check_examples([outcome.example for outcome in outcomes])
    found = [example._known(outcome.found) for example, outcome in zip(examples, outcomes, strict=True)]
    if (rate := other_rate(examples, found, window_ms)) is not None:
        return (rate,)
    scores = [cast("Score", outcome.score) for outcome in outcomes]
    mistakes = mistakes_of(found, [example.labels for example in examples], scores)
    measured = Measured(examples, mistakes, scored, window_ms, differences=differences, standing=standing)
    names = list(exchanged_names(outcomes, window_ms))
    others = {label: count for label, count in wrong.items() if all(label not in cause.labels for cause in names)}
    # That far too many are false is what `unreliable` says.
    return ordered([*names, *(cause for cause in measured.causes(others) if cause.kind != "many_false")])


class Standing(NamedTuple):
    """A load that stays, as of an object or a stuck taxel: what it is, and the option that helps, as of `Cause`."""

    text: str
    option: str = ""
    arguments: Mapping[str, float] = {}


class _Times(NamedTuple):
    """The missed events and false detections of a label, us on one clock, ascending."""

    missed: NDArray[np.int64]
    false: NDArray[np.int64]

    @property
    def total(self) -> int:
        """How many there are."""
        return len(self.missed) + len(self.false)

    def without(self, missed: NDArray[np.bool_], false: NDArray[np.bool_]) -> _Times:
        """Return the others than those that are explained."""
        return _Times(self.missed[~missed], self.false[~false])

    def without_times(self, shift: _Shift) -> _Times:
        """Return the others than those of a shift."""
        return self.without(np.isin(self.missed, shift.missed), np.isin(self.false, shift.false))


class _Shift(NamedTuple):
    """How far the missed labels of a name are behind false detections, ms, and which they are."""

    label: str
    ms: float
    missed: NDArray[np.int64]
    false: NDArray[np.int64]
    total: int
    """How many were missed."""


class Measured:
    """Measure the missed events and false detections of examples whose labels are known.

    Parameters
    ----------
    examples : sequence of Example, checked
    mistakes : sequence of Mistake
        What was missed and false in them, ...
    scored : Score
        ... by this score of all of them, with a window of ...
    window_ms : float, ms
    felt : FeltLoads, optional
        When the examples were loaded.
    differences : sequence of sequence of str
        In what each of them differs from the training of the readout.
    standing : Standing, optional
        A load of one of them that stays.
    """

    def __init__(
        self,
        examples: Sequence[Example],
        mistakes: Sequence[Mistake],
        scored: Score,
        window_ms: float,
        felt: FeltLoads | None = None,
        differences: Sequence[Sequence[str]] = (),
        standing: Standing | None = None,
    ) -> None:
        self._examples, self._window_ms = examples, window_ms
        self._scores = scored.by_label or {scored.label: scored}
        self._felt = FeltLoads(examples) if felt is None else felt
        spans = [span_us(example) for example in examples]
        self._lasts_us = sum(last - first for first, last in spans)
        #: What the clock of each example is moved by, so that all are on one.
        self._shifts = [k * APART_US - first for k, (first, _) in enumerate(spans)]
        self._mistakes, self._standing = mistakes, standing
        self._differences = {k: texts for k, texts in enumerate(differences) if texts}

    def causes(self, wrong: Mapping[str, int]) -> list[Cause]:
        """Return what concerns missed and false events of some labels, each event once."""
        found: list[Cause] = []
        left = {label: _Times(*(self._wrong(label, is_missed=missed) for missed in (True, False))) for label in wrong}
        # What differs from the training may be felt later.
        differ = {label for label in wrong if self._differs(left[label])}
        for label in wrong:
            if (gap := self._in_gaps(label, left[label])) is not None:
                cause, left[label] = gap
                found.append(cause)
        for label in wrong:
            if (slow := self._slow(label, left[label])) is not None:
                cause, left[label] = slow
                found.append(cause)
        for group in self._groups(left):
            is_near = abs(group[0].ms) <= 2 * self._window_ms
            # What rises slowly is felt late, and what falls slowly early: a clock is off by the same for both.
            if is_near and (len(group) == 1 or differ.intersection(shift.label for shift in group)):
                continue
            if (shifted := self._of_shift(group, is_near=is_near)) is not None:
                found.append(shifted)
                for shift in group:
                    left[shift.label] = left[shift.label].without_times(shift)
        for label in wrong:
            if label not in differ and (near := self._near(label, left[label])) is not None:
                cause, left[label] = near
                found.append(cause)
        for label in wrong:
            known = sum(cause.mistakes for cause in found if label in cause.labels)
            found += self._of_label(label, left[label], known)
        return found

    def _of_label(self, label: str, left: _Times, explained: int) -> Iterator[Cause]:
        """Yield what else concerns a label's mistakes, of which so many are explained."""
        count = explained + left.total
        parts = (self._overlapped, self._at_others, self._unlabelled, self._inside)
        for part in (self._unlabelled, self._unlike) if self._differs(left) else parts:
            found = part(label, left)
            if found is not None:
                cause, left = found
                explained += cause.mistakes
                yield cause
        events = self._scores[label].events
        if len(left.false) > max(1, _FAR_MORE * events) and 2 * explained < count:
            false = len(left.false)
            more = f"{false / events:.3g} times as many as the labels ({events})" if events else "there are no labels"
            measured = f"{false} detections are false: {more}"
            yield Cause("many_false", (label,), false, measured, "")

    def _differs(self, left: _Times) -> bool:
        """Whether most of what is wrong is in examples that differ from the training."""
        return 0 < left.total < 2 * sum(int(self._in_unlike(t).sum()) for t in left)

    def _in_unlike(self, t: NDArray[np.int64]) -> NDArray[np.bool_]:
        return np.isin(_example_of(t), list(self._differences))

    def _unlike(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return in what the examples with most mistakes differ from the training."""
        if not self._differs(left):  # what is in loads without a label is explained by then
            return None
        members = [self._in_unlike(t) for t in left]
        places = np.unique(np.concatenate([_example_of(t)[here] for t, here in zip(left, members, strict=True)]))
        measured = "; ".join(of_names([("", text) for k in places for text in self._differences[k]], 1))
        count = sum(int(here.sum()) for here in members)
        advice = "to train on recordings like these too"
        return Cause("unlike_training", (label,), count, measured, advice), left.without(*members)

    def _wrong(self, label: str, *, is_missed: bool) -> NDArray[np.int64]:
        """Return the times of what is missed or false."""
        times = [
            m.t + self._shifts[m.recording] for m in self._mistakes if (m.label, m.is_missed) == (label, is_missed)
        ]
        return np.sort(np.array(times, np.int64))

    def _labels(self, label: str) -> NDArray[np.int64]:
        """Return the labels of a name."""
        pairs = zip(self._examples, self._shifts, strict=True)
        each = [example.labels.get(label, np.empty(0, np.int64)) + shift for example, shift in pairs]
        return np.sort(np.concatenate(each))

    def _in_gaps(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many missed are where a recording has no frames, and how many false at the first ones behind."""
        inside, behind, first = np.zeros(len(left.missed), np.bool_), np.zeros(len(left.false), np.bool_), ""
        for k, (example, by) in enumerate(zip(self._examples, self._shifts, strict=True)):
            for begin, end in long_gaps(example):
                here = (left.missed > begin + by) & (left.missed < end + by)
                soon = _is_behind(left.false - by, begin, end)
                if not (here.any() or soon.any()):
                    continue
                if not first:
                    edges = " to ".join(f"{self._seconds(edge + by):.3f}" for edge in (begin, end))
                    first = f"{edges} s{_of(self._examples[k], self._examples)}"
                inside |= here
                behind |= soon
        missed, false = int(inside.sum()), int(behind.sum())
        if not missed and not false:
            return None
        parts = []
        if missed:
            among = counted(len(inside), "missed label")
            parts.append(f"{missed} of {among} {are(missed)} where the recording has no frames")
        if false:
            among = counted(len(behind), "false detection")
            parts.append(f"{false} of {among} {are(false)} at the first frames behind such a gap")
        measured = f"{', and '.join(parts)}, for example {first}"
        return Cause("gaps", (label,), missed + false, measured, ""), left.without(inside, behind)

    def _slow(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return that most missed have a false detection behind them, as the load changes slowly from the label."""
        if self._felt._loads is None:
            return None
        pairs = score(Detections([label] * len(left.false), left.false, left.false), {label: left.missed}, _SLOW_MS)
        detected, events = pairs.pairs[pairs.errors_ms > 0].T
        later_ms, falls = pairs.errors_ms[pairs.errors_ms > 0], recipes.neuron_of("touch", label) == "lift"
        after_ms = np.linspace(0.0, _SLOW_MS, _LOOKS)
        times = left.missed[events] + np.rint(to_us(after_ms)).astype(np.int64)[:, None]
        load = self._felt._loads.values_at("peak", times)
        change = load[0] - load if falls else load - load[0]
        most = change.max(axis=0, initial=PEAK)
        begun_ms, made_ms = (after_ms[(change >= part * most).argmax(axis=0)] for part in (_BEGUN, _MADE))
        is_slow = (made_ms - begun_ms >= np.maximum(begun_ms, _MADE_MS)) & (later_ms <= made_ms)
        if 2 * int(is_slow.sum()) <= len(left.missed) or is_slow.sum() < _SEVERAL:
            return None
        here = later_ms <= later_ms[is_slow].max()
        count = int(here.sum())
        measured = (
            f"{count} of {len(left.missed)} missed labels have a false detection "
            f"{ranged(later_ms[here].min(), later_ms[here].max())} ms later, because the load "
            f"{'falls' if falls else 'rises'} slowly: {label} is felt later there"
        )
        is_missed, is_false = _at(events[here], left.missed), _at(detected[here], left.false)
        return Cause("window", (label,), 2 * count, measured, ""), left.without(is_missed, is_false)

    def _near(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return the window that pairs what is missed with what is false, if these are most mistakes."""
        reach_ms = 2 * self._window_ms
        pairs = score(Detections([label] * len(left.false), left.false, left.false), {label: left.missed}, reach_ms)
        mistakes = 2 * pairs.found
        is_most = 2 * pairs.found > len(left.missed) and 2 * mistakes >= left.total
        if not is_most or pairs.found < _SEVERAL:
            return None
        least_ms, most_ms = (float(edge) for edge in (np.floor(pairs.errors_ms.min()), np.ceil(pairs.errors_ms.max())))
        window_ms = max(abs(least_ms), abs(most_ms))
        where = f"at most {window_ms:g} ms away"
        if least_ms * most_ms > 0:
            low, high = sorted(np.abs([pairs.errors_ms.min(), pairs.errors_ms.max()]))
            where = f"{ranged(low, high)} ms {'later' if least_ms > 0 else 'earlier'}"
        measured = f"{pairs.found} of {len(left.missed)} missed labels have a false detection {where}"
        cause = by_option("window", label, mistakes, measured, f"--window-ms {window_ms:g}", window_ms=window_ms)
        detected, events = pairs.pairs.T
        return cause, left.without(_at(events, left.missed), _at(detected, left.false))

    def _at_one_distance(self, label: str, left: _Times) -> _Shift | None:
        """Return by how much most of what is missed is behind false detections."""
        alike = same_distance(left.missed, left.false, self._window_ms)
        if alike is None or 2 * int(alike.members.sum()) <= len(left.missed):
            return None
        return self._at_distance(label, left, alike.ms, left.missed[alike.members])

    def _at_distance(self, label: str, left: _Times, ms: float, missed: NDArray[np.int64]) -> _Shift:
        """Return what is missed with the false detections that are so much before it."""
        expected = missed - round(to_us(ms))
        false = left.false[_near(left.false, expected)]
        return _Shift(label, ms, missed, false, len(left.missed))

    def _groups(self, left: Mapping[str, _Times]) -> Iterator[list[_Shift]]:
        """Yield the shifts of names that are at one distance, those of most labels first.

        A name of which too few are missed to tell a distance has that of others, if most of its missed or of its false
        are at it, or more than by chance.
        """
        shifts = [shift for label, times in left.items() if (shift := self._at_one_distance(label, times)) is not None]
        shifts.sort(key=lambda shift: -len(shift.missed))
        few = dict.fromkeys(left.keys() - {shift.label for shift in shifts})
        while shifts:
            ms = shifts[0].ms
            group = [shift for shift in shifts if abs(shift.ms - ms) <= _SAME_MS]
            for label in sorted(few):
                missed, false = left[label]
                at = missed[_near(missed - round(to_us(ms)), false)]
                is_most = 2 * len(at) > min(len(missed), len(false))
                covered_us = 2 * round(to_us(WINDOW_MS)) * len(false)
                if len(at) >= _SEVERAL and (is_most or not self._by_chance(len(at), len(missed), covered_us)):
                    del few[label]
                    group.append(self._at_distance(label, left[label], ms, at))
            yield group
            shifts = [shift for shift in shifts if abs(shift.ms - ms) > _SAME_MS]

    def _of_shift(self, group: Sequence[_Shift], *, is_near: bool) -> Cause | None:
        """Return the cause that labels of some names are at one distance from false detections, maybe near them."""
        names = tuple(shift.label for shift in group)
        missed, false = (np.sort(np.concatenate([shift[k] for shift in group])) for k in (2, 3))
        labels = np.sort(np.concatenate([self._labels(label) for label in names]))
        ms = float(np.median([shift.ms for shift in group]))
        side = "earlier" if ms > 0 else "later"
        are_all = self._following(names, ms) >= _NEARLY_ALL * len(labels)
        telling, members = self._telling(names, ms)
        stretch = "" if are_all else stretch_of(telling, members, self._examples)
        distance = f"{abs(ms):.0f} ms"
        count = len(missed)
        measured = (
            f"{count} of {sum(shift.total for shift in group)} missed labels have a false detection {distance} {side}"
        )

        def cause(measured: str, advice: str, option: str = "", kind: str = "shifted_labels") -> Cause:
            arguments = {"shift_ms": float(-round(ms))} if option else {}
            return Cause(kind, names, count + len(false), measured, advice, option, arguments)

        if stretch:
            by = f"{abs(round(ms, -1)):.0f} ms {side}"
            advice = f"to move the labels {stretch} {by}, if the clock of the recording is right"
            return cause(f"{measured}, all {stretch}", advice)
        fits = [name for name, part in self._scores.items() if name not in names and 2 * part.found > part.events]
        if fits:
            # Among far too many detections some are at one distance.
            wrong = sum(len(self._wrong(name, is_missed=False)) for name in names)
            if self._differs(_Times(missed, false)) or wrong > len(labels):
                return None
            names_fit = f"{', '.join(fits)} {'fits' if len(fits) == 1 else 'fit'}"
            return cause(f"{measured}, while {names_fit}: {', '.join(names)} {are(len(names))} felt {side} there", "")
        if not are_all and count < _STRETCH * len(labels):
            places = _example_of(telling)
            each = [places == k for k in np.unique(_example_of(missed)).tolist()]
            where = [stretch_of(telling[here], members[here], self._examples) for here in each]
            measured += f", the other {len(labels) - count} of {len(labels)} labels do not"
            more = f" and in {counted(len(where) - 1, 'other recording')} alike" if len(where) > 1 else ""
            shifted = (
                f"to move the labels {where[0]}{more} {abs(round(ms, -1)):.0f} ms {side}, if the clock of the "
                "recording is right"
            )
            return cause(measured, shifted if all(where) else "")
        fitting = self._fitting(labels, false)
        return None if is_near and not fitting else _of_clock(cause, ms, measured, fitting)

    def _following(self, names: Sequence[str], ms: float) -> int:
        """Return how many labels of some names have a detection at this distance before them, found or missed."""
        count = 0
        for name in names:
            false, expected = self._wrong(name, is_missed=False), self._wrong(name, is_missed=True) - round(to_us(ms))
            near = np.abs(self._scores[name].errors_ms + ms) <= WINDOW_MS
            count += int(np.count_nonzero(_near(expected, false)) + np.count_nonzero(near))
        return count

    def _telling(self, names: Sequence[str], ms: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the labels of some names that tell whether they are at a distance, and which have a detection at it.

        A label that is found tells that it is not, unless a detection is there too; a missed one without tells nothing.
        """
        times, members = [], []
        for name in names:
            labels, false = self._labels(name), self._wrong(name, is_missed=False)
            is_missed, expected = np.isin(labels, self._wrong(name, is_missed=True)), labels - round(to_us(ms))
            at = _near(expected, false)
            paired = labels[~is_missed] + np.rint(to_us(self._scores[name].errors_ms)).astype(np.int64)
            tells = at | ~(is_missed | _near(expected, np.sort(paired)))
            times.append(labels[tells])
            members.append(at[tells])
        order = np.argsort(np.concatenate(times), kind="stable")
        return np.concatenate(times)[order], np.concatenate(members)[order]

    def _fitting(self, labels: NDArray[np.int64], detections: NDArray[np.int64]) -> str:
        """Return whether the labels or the detections are where loads begin or end; "" where neither or both do."""
        if not self._felt.are_known or not len(labels) or not len(detections):
            return ""
        of_labels, of_detections = (float(self._felt.felt_at(times)[1].mean()) for times in (labels, detections))
        if abs(of_labels - of_detections) < _FITS:
            return ""
        return "labels" if of_labels > of_detections else "detections"

    def _overlapped(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many missed are while a load lasts that holds several labels of the name."""
        if not self._felt.are_known:
            return None
        overlapped = self._felt.overlapped(label, stays=self._standing is not None)
        inside = np.isin(left.missed, self._felt.times(label)[overlapped])
        if 2 * (count := int(inside.sum())) <= len(left.missed):
            return None
        if self._standing is not None:
            text, option, arguments = self._standing
            measured = (
                f"{text}; {count} of {counted(len(inside), 'missed label')} of {label} {are(count)} within that time"
            )
            cause = by_option("standing_load", label, count, measured, option, **arguments)
            return cause, left.without(inside, np.zeros(len(left.false), np.bool_))
        # Loads that overlap have labels of their other edges too; without such labels a load holds a label too many.
        names = {name for example in self._examples for name in example.labels} - {label}
        if names and not any(2 * int(self._felt.overlapped(name).sum()) >= count for name in names):
            return None
        cause = overlapping(label, int(overlapped.sum()), len(overlapped), count)
        return cause, left.without(inside, np.zeros(len(left.false), np.bool_))

    def _at_others(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many false are at labels of another name, if most do."""
        reach_ms = 2 * self._window_ms
        reach, best = round(to_us(reach_ms)), (0, "", np.zeros(0, np.bool_))
        for name in sorted({name for example in self._examples for name in example.labels} - {label}):
            times = self._labels(name)
            at = np.diff(np.searchsorted(times, [left.false - reach, left.false + reach]), axis=0)[0] > 0
            if at.sum() > best[0] and not self._by_chance(int(at.sum()), len(at), 2 * reach * len(times)):
                best = int(at.sum()), name, at
        count, name, at = best
        if 2 * count <= len(left.false):
            return None
        measured = (
            f"{count} of {counted(len(left.false), 'false detection')} of {label} {are(count)} within {reach_ms:g} ms "
            f"of labels of {name}: these inputs do not distinguish the two"
        )
        cause = Cause("other_name", (label,), count, measured, "")
        return cause, left.without(np.zeros(len(left.missed), np.bool_), at)

    def _unlabelled(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many false are in strong loads without a label, and how many missed far from any load's edge.

        Weak loads without a label may be noise, and labels where nothing is felt may be of weak touches.
        """
        scored = self._scores[label]
        # In a recording unlike the training, loads of noise or chatter look like touches where much is missed or false.
        sound = scored.found >= _FOUND * scored.events >= 2 * _FOUND * len(left.false)
        if not self._felt.are_known or (self._differs(left) and not sound):
            return None
        names = {name for example in self._examples for name in example.labels}
        is_end = recipes.neuron_of("touch", label) == "lift"
        same = [name for name in sorted(names) if (recipes.neuron_of("touch", name) == "lift") == is_end]
        strong, _ = self._felt.unlabelled(label, names, left.false)
        unfelt = ~self._felt.felt_at(left.missed)[1]
        count, mistakes = int(strong.sum()), int(strong.sum()) + int(unfelt.sum())
        if 2 * mistakes <= left.total:
            return None
        touches, parts = "", []
        if count:
            # A touch of which several kinds are detected is one.
            false = np.concatenate([self._wrong(name, is_missed=False) for name in same])
            begins = np.unique(self._felt.unlabelled(label, names, false)[1])
            touches = (
                f"{counted(len(begins), 'touch', 'touches')} without a label of {', '.join(same)} {are(len(begins))} "
                f"detected, about as strong as labelled ones, for example at {self._places(begins)}; "
            )
            parts.append(f"{count} of {counted(len(strong), 'false detection')} {are(count)} in such touches")
        if n := int(unfelt.sum()):
            example = f", for example at {self._places(left.missed[unfelt])}"
            parts.append(
                f"{n} of {counted(len(unfelt), 'missed label')} {are(n)} more than {WINDOW_MS:.0f} ms from "
                f"where a load begins or ends{example * (not count)}"
            )
        is_most = 2 * count >= left.total
        cause = Cause(
            "unlabelled_loads" if count else "unfelt_labels",
            (label,),
            mistakes,
            f"{touches}{', and '.join(parts)}",
            "to label these touches too" * is_most,
        )
        return cause, left.without(unfelt, strong)

    def _inside(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many false are inside loads, far from where these begin and end, if most are."""
        if not self._felt.are_known:
            return None
        near, at_edge = self._felt.felt_at(left.false)
        inside = near & ~at_edge
        if 2 * (count := int(inside.sum())) <= len(inside):
            return None
        measured = (
            f"{count} of {counted(len(inside), 'false detection')} {are(count)} inside a load, more than "
            f"{WINDOW_MS:.0f} ms from its beginning and end, for example at {self._places(left.false[inside])}"
        )
        cause = Cause("unlabelled_loads", (label,), count, measured, "")
        return cause, left.without(np.zeros(len(left.missed), np.bool_), inside)

    def _places(self, times: NDArray[np.int64]) -> str:
        return ", ".join(map(self._place, np.sort(times)[:_NAMED].tolist()))

    def _place(self, t: int) -> str:
        return f"{self._seconds(t):.3f} s{_of(self._examples[int(_example_of(t))], self._examples)}"

    def _seconds(self, t: int) -> float:
        return _seconds(t, self._examples)

    def _by_chance(self, count: int, among: int, covered_us: int) -> bool:
        """Whether as many times are by chance in so much of the recordings."""
        return chance_of(count, among, min(1.0, covered_us / max(1, self._lasts_us))) > _CHANCE


def _of_clock(cause: Callable[..., Cause], ms: float, measured: str, fits: str) -> Cause:
    """Return the cause that all labels are at one distance from detections, of which one fits what was felt."""
    side, back, shift_ms, distance = "earlier", "later", -round(ms), f"{abs(ms):.0f} ms"
    is_late, was = "late", "early"
    if ms < 0:
        side, back, is_late, was = back, side, was, is_late
    if fits == "detections":
        measured += "; the detections are where loads begin or end, the labels are not"
        return cause(measured, f"to move the labels by {shift_ms} ms (--shift-ms {shift_ms})", f"--shift-ms {shift_ms}")
    if fits == "labels":
        measured += f"; the labels are where loads begin or end: the labels of the training were {was}"
        advice = f"to train on labels that are {distance} {back} (taxel train --shift-ms {-shift_ms})"
        return cause(measured, advice, kind="shifted_training")
    measured += f": either these labels are {is_late} or the labels of the training were {was}"
    advice = f"to look where a load begins (taxel view); --shift-ms {shift_ms} moves the labels"
    return cause(measured, advice)


def overlapping(label: str, count: int, labels: int, mistakes: int) -> Cause:
    """Return the cause that labels are within a load of several."""
    measured = (
        f"{count} of {counted(labels, 'label')} of {label} {are(count)} at times when another load lasts; if loads "
        "overlap, the recipe detects only the first begin and the last end"
    )
    advice = "a separate source or region for each load, for example left and right"
    return Cause("overlapping_loads", (label,), mistakes, measured, advice)


def stretch_of(labels: NDArray[np.int64], members: NDArray[np.bool_], examples: Sequence[Example]) -> str:
    """Return from when to when some of the labels (us, on one clock) are in one recording; "" where it is not a part.

    Nearly all labels between the first and the last there must be among them, and nearly all of them there.
    """
    # The densest stretch: each of the labels adds to it, each of the others takes away as many as `_STRETCH` allows.
    recording = _example_of(labels)
    best, first, last, worth, begin = 0.0, 0, -1, 0.0, 0
    for k, is_member in enumerate(members):
        if worth <= 0 or recording[k] != recording[begin]:
            worth, begin = 0.0, k
        worth += 1 if is_member else -_STRETCH / (1 - _STRETCH)
        if worth > best:
            best, first, last = worth, begin, k
    if members[first : last + 1].sum() < _STRETCH * members.sum():
        return ""
    here = np.flatnonzero(recording == recording[first])
    starts, ends = first == here[0], last == here[-1]
    # Rounded so that the first and the last are within.
    begin_s, end_s = (10 * _seconds(labels[k], examples) for k in (first, last))
    begin_s, end_s = np.floor(begin_s) / 10, np.ceil(end_s) / 10
    example = examples[recording[first]]
    if starts and ends:
        return _of(example, examples).replace(" of", "in", 1)
    where = f"from {begin_s:.1f} to {end_s:.1f} s"
    if starts or ends:
        where = f"from {begin_s:.1f} s to the end" if ends else f"until {end_s:.1f} s"
    return where + _of(example, examples)


def long_gaps(example: Example) -> list[tuple[int, int]]:
    """Return the gaps in which a touch may be missed, as the times of the last frame before and the first one after."""
    source = recorded(example.source, hold=False)
    t = source.t if isinstance(source, Frames) else np.empty(0, np.int64)
    edges = zip(*(each.tolist() for each in missing_frames(t) or ()), strict=True)
    return [(begin, end) for begin, end in edges if end - begin >= _GAP_US]


def behind_gaps(example: Example, found: Detections) -> NDArray[np.bool_]:
    """Return which detections may have happened in a gap, as they are in one or at the first frames behind it."""
    behind = np.zeros(len(found), np.bool_)
    for begin, end in long_gaps(example):
        behind |= _is_behind(found.t, begin, end)
    return behind


def _is_behind(t: NDArray[np.int64], begin: int, end: int) -> NDArray[np.bool_]:
    return (t > begin) & (t <= end + round(to_us(WINDOW_MS)))


def _example_of(t: NDArray[np.int64] | int) -> NDArray[np.int64]:
    """Return the places of the examples in which times on the one clock are."""
    return np.rint(np.asarray(t) / APART_US).astype(np.int64)


def _seconds(t: int, examples: Sequence[Example]) -> float:
    """Return a time on the one clock as text counts those of its example, s."""
    k = int(_example_of(t))
    first, _ = span_us(examples[k])
    return float(t - k * APART_US + first - beginning_us(np.array([first]))) / 1e6


def _of(example: Example, examples: Sequence[Example]) -> str:
    if len(examples) == 1:
        return ""
    is_of_one = len({each.group for each in examples}) == 1
    return f" of {example.name.removeprefix(example.group) if is_of_one else example.name}"


def _near(times: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which times have one of the others, which ascend, within the distance of an alignment."""
    reach = round(to_us(WINDOW_MS))
    near: NDArray[np.bool_] = np.diff(np.searchsorted(others, [times - reach, times + reach]), axis=0)[0] > 0
    return near


def _at(places: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.isin(np.arange(len(times)), places)
