"""What is measured of missed and false detections, of a training and of a readout: where they lie, beside what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.cause import Cause, by_option, lie, ordered
from taxel.detect.examples import Example, Outcome, check_examples
from taxel.detect.label_times import FeltLoads, chance_of, same_distance
from taxel.detect.scoring import APART_US, Mistake, Score, mistakes_of, score
from taxel.detections import Detections
from taxel.frames import Frames
from taxel.recording.gaps import missing_frames
from taxel.spikes import SpikeTrains, to_us

#: From which share of the events on missed or false ones are many.
MANY = 0.05
#: What is measured counts where chance brings as much with at most this probability.
_CHANCE = 0.01
#: A stretch of time has one distance where this share of its labels has it.
_STRETCH = 0.8
#: A gap in which a touch may be missed lasts that, us.
_GAP_US = 200_000
#: Detections are far too many that are false so many times as often as there are labels.
_FAR_MORE = 2
#: Fewer events missed and false are few.
_FEW = 3
#: So many times of labels are named.
_NAMED = 3


def many_wrong(scored: Score) -> dict[str, int]:
    """Return how many events are missed and false of each label of which more than 5 % are."""
    scores = (scored.by_label or {scored.label: scored}).items()
    return {label: part.rank[0] for label, part in scores if max(part.missed, part.false) > MANY * part.events}


def causes_of(outcome: Outcome, window_ms: float) -> tuple[Cause, ...]:
    """Return what concerns most of what a readout missed in an example, and what is false; none of few mistakes.

    Parameters
    ----------
    outcome : Outcome
        Its labels are those that it is scored against.
    window_ms : float, ms
        The window of the score.
    """
    scored, found = outcome.score, outcome.example._known(outcome.found)
    wrong = {} if scored is None else many_wrong(scored)
    if scored is None or sum(wrong.values()) < _FEW:
        return ()
    (example,) = check_examples([outcome.example])
    mistakes = mistakes_of([found], [example.labels], [scored])
    return ordered(Measured([example], mistakes, scored, window_ms).causes(wrong))


class _Times(NamedTuple):
    """The missed events and false detections of a label, us on one clock, ascending."""

    missed: NDArray[np.int64]
    false: NDArray[np.int64]

    def without(self, missed: NDArray[np.bool_], false: NDArray[np.bool_]) -> _Times:
        """Return the others than those that are explained."""
        return _Times(self.missed[~missed], self.false[~false])


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
    """

    def __init__(
        self,
        examples: Sequence[Example],
        mistakes: Sequence[Mistake],
        scored: Score,
        window_ms: float,
        felt: FeltLoads | None = None,
    ) -> None:
        self._examples, self._window_ms = examples, window_ms
        self._scores = scored.by_label or {scored.label: scored}
        self._felt = FeltLoads(examples) if felt is None else felt
        spans = [_span_us(example) for example in examples]
        self._lasts_us = sum(last - first for first, last in spans)
        #: What the clock of each example is moved by, so that all are on one.
        self._shifts = [k * APART_US - first for k, (first, _) in enumerate(spans)]
        self._mistakes = mistakes

    def causes(self, wrong: Mapping[str, int]) -> list[Cause]:
        """Return what concerns missed and false events of some labels, each event once."""
        return [cause for label in wrong for cause in self._of_label(label)]

    def _of_label(self, label: str) -> Iterator[Cause]:
        """Yield what concerns a label's mistakes, first what explains both of a missed and a false one."""
        left = _Times(*(self._wrong(label, is_missed=is_missed) for is_missed in (True, False)))
        count = len(left.missed) + len(left.false)
        parts = (self._in_gaps, self._near, self._at_one_distance, self._overlapped, self._at_others, self._unlabelled)
        explained = 0
        for part in parts:
            found = part(label, left)
            if found is not None:
                cause, left = found
                explained += cause.mistakes
                yield cause
        events = self._scores[label].events
        if len(left.false) > max(1, _FAR_MORE * events) and 2 * explained < count:
            measured = f"{len(left.false)} detections are false, of {counted(events, 'label')}"
            if events:
                measured += f": {len(left.false) / events:.3g} times as many"
            yield Cause("many_false", (label,), len(left.false), measured, "")

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
        """Return how many missed lie where a recording has no frames."""
        inside, first = np.zeros(len(left.missed), np.bool_), ""
        for example, by in zip(self._examples, self._shifts, strict=True):
            t = example.source.t if isinstance(example.source, Frames) else np.empty(0, np.int64)
            for begin, end in zip(*(missing_frames(t) or ((), ())), strict=True):
                here = (left.missed > begin + by) & (left.missed < end + by)
                if end - begin < _GAP_US or not here.any():
                    continue
                if not first:
                    begin_s, end_s = ((edge - t[0]) / 1e6 for edge in (begin, end))
                    first = f"{begin_s:.3f} to {end_s:.3f} s{_of(example, self._examples)}"
                inside |= here
        count = int(inside.sum())
        if not count:
            return None
        measured = f"{count} of {len(left.missed)} missed {lie(count)} where the recording has no frames, as {first}"
        return Cause("gaps", (label,), count, measured, ""), left.without(inside, np.zeros(len(left.false), np.bool_))

    def _near(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return the window that pairs what is missed with what is false, if these are most mistakes."""
        reach_ms = 2 * self._window_ms
        pairs = score(Detections([label] * len(left.false), left.false, left.false), {label: left.missed}, reach_ms)
        mistakes = 2 * pairs.found
        if 2 * pairs.found <= len(left.missed) or 2 * mistakes < len(left.missed) + len(left.false):
            return None
        least_ms, most_ms = (float(edge) for edge in (np.floor(pairs.errors_ms.min()), np.ceil(pairs.errors_ms.max())))
        window_ms = max(abs(least_ms), abs(most_ms))
        where = f"at most {window_ms:g} ms away"
        if least_ms * most_ms > 0:
            low, high = sorted((abs(least_ms), abs(most_ms)))
            where = f"{low:g} to {high:g} ms {'later' if least_ms > 0 else 'earlier'}"
        have = "has" if pairs.found == 1 else "have"
        measured = f"{pairs.found} of {len(left.missed)} missed {have} a false detection {where}"
        cause = by_option("window", label, mistakes, measured, f"--window-ms {window_ms:g}", window_ms=window_ms)
        detected, events = pairs.pairs.T
        return cause, left.without(_at(events, left.missed), _at(detected, left.false))

    def _at_one_distance(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return by how much false detections precede or follow most of what is missed."""
        alike = same_distance(left.missed, left.false, self._window_ms)
        if alike is None or 2 * (count := int(alike.members.sum())) <= len(left.missed):
            return None
        side = "earlier" if alike.ms > 0 else "later"
        labels, missed = self._labels(label), left.missed[alike.members]
        distance, stretch = (
            f"{abs(alike.ms):.0f} ms {side}",
            stretch_of(labels, np.isin(labels, missed), self._examples),
        )
        measured = f"{count} of {len(left.missed)} missed have a false detection {distance}"
        # Several names of one clock have one advice.
        advice = f"labels {abs(round(alike.ms, -1)):.0f} ms {side}, if the clock of the recording is right"
        if not stretch and abs(alike.ms) <= 2 * self._window_ms:
            advice = ""  # as what rises slowly is felt late
        if stretch:
            measured, advice = f"{measured}, all {stretch}", advice.replace("labels", f"labels {stretch}", 1)
        elif fits := [name for name, part in self._scores.items() if name != label and 2 * part.found > part.events]:
            fitting = f"{', '.join(fits)} {'fits' if len(fits) == 1 else 'fit'}"
            measured += f", while {fitting}: {label} is felt {side} there"
            advice = ""
        expected = missed - round(to_us(alike.ms))
        detected = np.array([np.argmin(np.abs(left.false - t)) for t in expected])
        is_near = np.abs(left.false[detected] - expected) <= to_us(WINDOW_MS)
        false = _at(detected[is_near], left.false)
        cause = Cause("shifted_labels", (label,), count + int(false.sum()), measured, advice)
        return cause, left.without(alike.members, false)

    def _overlapped(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many missed lie while a load lasts that holds several labels of the name."""
        if not self._felt.are_known:
            return None
        overlapped = self._felt.overlapped(label)
        inside = np.isin(left.missed, self._felt.times(label)[overlapped])
        if 2 * (count := int(inside.sum())) <= len(left.missed):
            return None
        cause = overlapping(label, int(overlapped.sum()), len(overlapped), count)
        return cause, left.without(inside, np.zeros(len(left.false), np.bool_))

    def _at_others(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many false lie at labels of another name, if most do."""
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
            f"{count} of {counted(len(left.false), 'false detection')} of {label} {lie(count)} within {reach_ms:g} ms "
            f"of labels of {name}: these inputs do not tell them apart"
        )
        cause = Cause("other_name", (label,), count, measured, "")
        return cause, left.without(np.zeros(len(left.missed), np.bool_), at)

    def _unlabelled(self, label: str, left: _Times) -> tuple[Cause, _Times] | None:
        """Return how many false lie in strong loads without a label, and how many missed far from any load's edge.

        Weak loads without a label may be noise, and labels where nothing is felt may be of weak touches.
        """
        if not self._felt.are_known:
            return None
        names = {name for example in self._examples for name in example.labels}
        strong = self._felt.strong(label, names, left.false)
        unfelt = ~self._felt.felt_at(left.missed)[1]
        count, mistakes = int(strong.sum()), int(strong.sum()) + int(unfelt.sum())
        if 2 * mistakes <= len(left.missed) + len(left.false):
            return None
        parts = []
        if count:
            parts.append(f"{count} of {len(strong)} false {lie(count)} in loads without a label, as strong as others")
        if n := int(unfelt.sum()):
            parts.append(
                f"{n} of {len(unfelt)} missed {lie(n)} more than {WINDOW_MS:.0f} ms from where a load begins or ends"
            )
        times = left.false[strong] if count else left.missed[unfelt]
        measured = f"{', and '.join(parts)}, as at {', '.join(self._place(t) for t in np.sort(times)[:_NAMED])}"
        is_most = 2 * count >= len(left.missed) + len(left.false)
        cause = Cause(
            "unlabelled_loads" if count else "unfelt_labels",
            (label,),
            mistakes,
            measured,
            "labels of these loads too" * is_most,
        )
        return cause, left.without(unfelt, strong)

    def _place(self, t: int) -> str:
        k = round(t / APART_US)
        return f"{(t - k * APART_US) / 1e6:.3f} s{_of(self._examples[k], self._examples)}"

    def _by_chance(self, count: int, among: int, covered_us: int) -> bool:
        """Whether as many times lie by chance in so much of the recordings."""
        return chance_of(count, among, min(1.0, covered_us / max(1, self._lasts_us))) > _CHANCE


def overlapping(label: str, count: int, labels: int, mistakes: int) -> Cause:
    """Return the cause that labels lie while a load of several lasts."""
    measured = (
        f"{count} of {counted(labels, 'label')} of {label} {lie(count)} while another load lasts; the recipe tells the "
        "first begin and the last end of loads that overlap"
    )
    advice = "a source or a region for each load, as left and right"
    return Cause("overlapping_loads", (label,), mistakes, measured, advice)


def stretch_of(labels: NDArray[np.int64], members: NDArray[np.bool_], examples: Sequence[Example]) -> str:
    """Return from when to when some of the labels (us, on one clock) lie in one recording; "" where it is no part.

    Nearly all labels between the first and the last there must be among them, and nearly all of them there.
    """
    # The densest stretch: each of the labels adds to it, each of the others takes away as many as `_STRETCH` allows.
    recording = np.rint(labels / APART_US).astype(int)
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
    begin_s, end_s = (float(labels[k] - recording[k] * APART_US) / 1e5 for k in (first, last))
    begin_s, end_s = np.floor(begin_s) / 10, np.ceil(end_s) / 10
    example = examples[recording[first]]
    if starts and ends:
        return f"in {example.name}" if len(examples) > 1 else ""
    where = f"from {begin_s:.1f} to {end_s:.1f} s"
    if starts or ends:
        where = f"from {begin_s:.1f} s on" if ends else f"until {end_s:.1f} s"
    return where + _of(example, examples)


def _of(example: Example, examples: Sequence[Example]) -> str:
    return f" of {example.name}" if len(examples) > 1 else ""


def _at(places: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.bool_]:
    return np.isin(np.arange(len(times)), places)


def _span_us(example: Example) -> tuple[int, int]:
    """Return when the first and the last of an example is, us."""
    source = example.source
    if isinstance(source, SpikeTrains):
        return round(float(to_us(source.start))), round(float(to_us(source.stop)))
    t = source.t  # type: ignore[union-attr]
    return (int(t[0]), int(t[-1])) if len(t) else (0, 0)
