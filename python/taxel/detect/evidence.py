"""Find what training data show of their labels and tares without a training."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from shlex import quote
from typing import Any, NamedTuple

import numpy as np

from taxel._base.messages import are, counted
from taxel._base.times import beginning_us
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS, Alignment
from taxel.detect.cause import Cause, by_option, ordered
from taxel.detect.examples import Example
from taxel.detect.fitting import TWO_FOLDS
from taxel.detect.label_times import FeltLoads, Off, early
from taxel.detect.levels import LEAST_LEVELS, loaded_levels
from taxel.detect.mistakes import overlapping, stretch_of
from taxel.detect.recipe import Recipe
from taxel.detect.tares import TOUCH, Loaded, held_by_tare, loaded_at_rest, quiet_s
from taxel.encode import LevelCrossing, ThresholdIzhikevich
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import TIMES_NOISE, ZEROS_BEFORE, of_frames
from taxel.spikes import to_ms, to_us
from taxel.tare import Tare

#: Advice against labels that are elsewhere.
FOREIGN = "labels of this recording"
#: What makes a tare's file of a recording from when to when, s.
_MAKES_TARE = "taxel cut {} FILE.npz --from {} --to {}"
#: Labels are a question before a training if at most this share of them is near anything that was felt ...
_NEARLY_NONE = 0.1
#: ... of so many or more, or if at least this share of them has one distance from it.
_LEAST_LABELS, _NEARLY_ALL = 4, 0.9
#: Labels of several names are moved together whose distances from what was felt differ by so many windows at most.
_TOGETHER = 1.5
#: Labels are within touches that are farther from where these begin and end, ms, where labels of these are not exact.
_WITHIN_MS = 300.0
#: Among so many loads a label many labels are where one begins by chance.
_MOST_A_LABEL = 4
#: Five folds need this many labels.
FIVE_FOLDS = 10
#: Windows of counts so many times as long are looked at for a weak burst.
_LONGER = (1, 2, 4)


@dataclass(frozen=True)
class Evidence:
    """Hold the training data, and find the causes that they show without a training.

    Parameters
    ----------
    examples : sequence of Example
        As they were given, and ...
    sound : sequence of Example
        ... checked.
    plan : Recipe
        That is trained by.
    """

    examples: Sequence[Example]
    sound: Sequence[Example]
    plan: Recipe

    @cached_property
    def felt(self) -> FeltLoads:
        """When the examples were loaded."""
        return FeltLoads(self.sound)

    @cached_property
    def _counts(self) -> dict[str, int]:
        """How many labels there are of each name."""
        names = sorted({label for example in self.sound for label in example.labels})
        return {name: sum(len(example.labels.get(name, ())) for example in self.sound) for name in names}

    def without(self, places: Collection[int]) -> Evidence:
        """Return the same of the other examples."""
        left = [k for k in range(len(self.sound)) if k not in places]
        return Evidence([self.examples[k] for k in left], [self.sound[k] for k in left], self.plan)

    @property
    def is_of_one_name(self) -> bool:
        """Whether all labels have one name."""
        return len(self._counts) == 1

    @property
    def falls(self) -> str:
        """That values fall from their rest, and what turns them; empty where none do."""
        advice, measured = self._fall
        return f"{measured}: if smaller values mean more pressure, {advice} helps" if advice else ""

    @cached_property
    def _fall(self) -> tuple[str, str]:
        """Advice that turns values that fall, and that they do; empty where none do."""
        for example in self.examples:
            source = recorded(example.source, hold=False)
            if isinstance(source, Frames) and (rest := of_frames(source)).falls:
                layout, advice = rest.turning(*(getattr(example.source, name, None) for name in ("path", "_turned")))
                turned = f" after {layout} inverted them" * bool(layout)
                return advice, f"{example.name}: " * bool(example.name) + f"values fall from their rest{turned}"
        return "", ""

    @cached_property
    def _distances(self) -> dict[str, Off]:
        return self.felt.distances(self._counts)

    @cached_property
    def _best(self) -> Off | None:
        """The distance that labels agree on best, begins before others: where they are off, it is the clock's."""

        def rank(label: str) -> tuple[Any, ...]:
            off, is_end = self._distances[label], recipes.neuron_of("touch", label) == "lift"
            return off.within_ms > 0.0, -round(off.alike / off.labels, 1), is_end, off.spread_ms

        sure = (label for label, off in self._distances.items() if not off.changes_from_label)
        best = min(sure, key=rank, default=None)
        return None if best is None else self._distances[best]

    @cached_property
    def felt_apart(self) -> dict[str, Off]:
        """Labels too far from what was felt to be aligned that are not off, as what they name is felt slowly.

        And those near enough for a window, where no other name is off.
        """
        return {
            label: distance
            for label, distance in self._distances.items()
            if distance.is_far
            and (distance.changes_from_label or (abs(distance.ms) <= 2 * WINDOW_MS and not self._is_shifted))
        }

    @cached_property
    def _is_shifted(self) -> bool:
        """Whether the clock of labels is off: those that agree best are, or those of other names to the same side."""
        far = [off for off in self._distances.values() if off.is_far and not off.changes_from_label]
        best = self._best
        if best is None or not far or self.is_of_one_name:
            return False
        return best.is_far or all(off.ms * best.ms > 0 and abs(best.ms) > WINDOW_MS / 2 for off in far)

    def felt_window(self, label: str) -> tuple[float, int]:
        """Return the window that reaches from labels to where they are felt, ms: twice that of alignments at least.

        And how many loads that begin, or end, and labels have no pair within it.
        """
        off = self.felt_apart[label]
        reach_ms = max(2.0, np.ceil((abs(off.ms) + off.spread_ms / 2) / WINDOW_MS)) * WINDOW_MS
        return reach_ms, self.felt.rank(label, reach_ms)

    @cached_property
    def _early(self) -> str:
        """That the labels of each recording are at its very beginning; empty where they are not."""
        texts = [
            early(example.labels, int(source.t[0]), int(source.t[-1]))
            for example in self.sound
            if isinstance(source := example.source, Events | Frames)
            and len(source)
            and any(map(len, example.labels.values()))
        ]
        return texts[0] if texts and all(texts) else ""

    @cached_property
    def _loaded(self) -> Loaded:
        """How many taxels read above their tare while nothing touches them, and when."""
        return loaded_at_rest(self.examples, self.plan.encoder)

    @cached_property
    def _of_tare(self) -> Cause | None:
        """The fault of the tare, or a load that stays; None where nothing is."""
        held = held_by_tare(self.sound)
        if held >= TOUCH:
            measured, seconds = f"the tare contains a touch of {held} taxels", quiet_s(self.sound)
            if seconds is not None:
                return by_option("tare", "", 0, measured, f"--tare {seconds:g}", tare=seconds)
            measured += f"; to make this file, a .npz, run: {_MAKES_TARE.format('RECORDING', 'S', 'S')}"
            return Cause("tare", (), 0, measured, "a tare of a time without a touch (--tare FILE)", "--tare FILE")
        taxels, k, start_us, stop_us = self._loaded
        source = self.sound[k].source
        if taxels < TOUCH or not isinstance(source, Events | Frames) or not self.felt.are_known:
            return None
        begin_us = beginning_us(source.t[:1])
        stretch = [f"{(t - begin_us) / 1e6:.3f}" for t in (max(start_us, int(source.t[0])), stop_us)]
        tare = Tare.take(source, start_us=start_us, stop_us=stop_us)
        tried = FeltLoads([example._replace(tare=tare) for example in self.sound])
        (now, total), then = self._at_edges(self.felt), self._at_edges(tried)[0]
        where = f"{{}} of {counted(total, 'label')} {{}} where a load begins or ends"
        trial = f"with a tare of {' to '.join(stretch)} s, {where.format(then, are(then))}; now {now}"
        if 2 * (total - then) > total - now or tried.count > _MOST_A_LABEL * total:
            measured = (
                f"{taxels} taxels read above the tare while nothing touches them, and a tare of such a time does not "
                f"help ({trial}); so a load stays there, and recipes detect only where loads begin and end"
            )
            return Cause("standing_load", (), 0, measured, "")
        made = _MAKES_TARE.format(quote(self.sound[k].name), *stretch)
        measured = (
            f"{taxels} taxels read above the tare while nothing touches them; {trial}; to make this file, run: {made}"
        )
        return Cause("tare", (), 0, measured, "a tare of another time (--tare FILE.npz)", "--tare FILE.npz")

    def _at_edges(self, felt: FeltLoads) -> tuple[int, int]:
        """Return how many labels are where loads begin or end, and how many there are."""
        counts = [felt.near(label) for label in self._counts]
        _, at_edge, total = np.sum([each for each in counts if each is not None], axis=0).tolist()
        return at_edge, total

    @cached_property
    def _near(self) -> dict[str, tuple[int, int, int]]:
        """How many labels of each name are near a load, near its begin or end, and how many there are, if known."""
        near = {label: self.felt.near(label) for label in self._counts}
        return {label: counts for label, counts in near.items() if counts is not None and counts[-1]}

    def question(self) -> str:
        """Return why labels are asked about before a training; "" where they are not.

        Some are within touches; or, where loads are clear, nearly none is near anything felt, or nearly all of all
        names are off by one distance.
        """
        if self.plan.about == str(recipes.read("touch")["about"]) and (inside := self.within_touches()):
            return f"{inside}; leave them out of the labels"
        if not self.falls and not self.felt.are_clear:
            return ""
        if unfelt := self._unfelt():
            return "; ".join([unfelt, *map(str, self.refused()[:1])])
        beyond = sum(off.beyond for off in self._distances.values() if not off.changes_from_label)
        labels = {label for label, count in self._counts.items() if count}
        if beyond < _NEARLY_ALL * sum(self._counts.values()):
            return ""
        shifts = (c for c in self.refused()[:1] if c.kind == "shifted_labels" and set(c.labels) == labels)
        return next(map(str, shifts), "")

    def _unfelt(self) -> str:
        """Return how many labels are near anything felt, if nearly none is; else, and where it is not known, ""."""
        count, _, total = np.sum([*self._near.values(), (0, 0, 0)], axis=0).tolist()
        if total < _LEAST_LABELS or count > _NEARLY_NONE * total:
            return ""
        return f"{count} of {counted(total, 'label')} {are(count)} within {WINDOW_MS:.0f} ms of anything that was felt"

    def refused(self) -> tuple[Cause, ...]:
        """Return the causes that the data show of a training that was refused: all labels count as missed."""
        return ordered([cause for cause in self.causes(self._counts) if cause.kind != "few_labels"])

    def causes(self, wrong: Mapping[str, int]) -> list[Cause]:
        """Return the causes that the data show, for each of the labels of which so many are missed or false."""
        advice, measured = self._fall
        if advice and wrong:
            # What else is measured is measured upside down.
            return [Cause("falling_values", tuple(wrong), sum(wrong.values()), measured, advice)]
        while_lasting = [cause for label, count in wrong.items() for cause in self._while_lasting(label, count)]
        wrong = {label: count for label, count in wrong.items() if all(label not in c.labels for c in while_lasting)}
        shifts = list(self._shifts(wrong))
        found = [cause for label, count in wrong.items() for cause in self._of_label(label, count)]
        found += [cause for label, count in wrong.items() for cause in self._foreign(label, count)]
        return [*while_lasting, *(shifts or found)]

    def _while_lasting(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield that most labels of a name are within touches, where those of another name follow their edges."""
        near, at_edge, total = self._near.get(label, (0, 0, 0))
        if recipes.knows("touch", label) or not total:
            return
        # Labels of edges may be late; what is within touches is then far from these.
        beside = int(self.felt.felt_at(self.felt.times(label), _WITHIN_MS)[1].sum())
        is_far = label not in self._distances and 2 * beside < total
        fits = [
            name
            for name, (_, edges, count) in self._near.items()
            if name != label and (2 * edges > count or (is_far and name in self._distances))
        ]
        within = near - at_edge
        # A tare that does not fit lets touches seem to last.
        if not fits or 2 * within <= total or self._loaded.taxels >= TOUCH:
            return
        measured = (
            f"{within} of {counted(total, 'label')} {are(within)} within touches; labels of {', '.join(fits)} are "
            "where touches begin or end; no recipe detects what happens while a touch lasts"
        )
        yield Cause("label_name", (label,), wrong, measured, "labels where touches begin or end")

    def within_touches(self) -> str:
        """Return which labels are within touches, where no recipe tells anything; "" where none are."""
        if self.falls:
            return ""
        inside = [
            f"{label}: {c.measured}" for label, count in self._counts.items() for c in self._while_lasting(label, count)
        ]
        return "; ".join(inside)

    def _foreign(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield that labels are at loads as by chance, or at the beginning, as those of another recording or unit."""
        if self._early:
            yield Cause("foreign_labels", (label,), wrong, f"the labels {self._early}", "labels with times in us")
            return
        _, at_edge, total = self._near.get(label, (0, 0, 0))
        # A tare that does not fit tells nothing.
        if at_edge == total or self._loaded.taxels >= TOUCH or label in self.felt_apart:
            return
        away = total - at_edge
        if 2 * (count := int(self.felt.overlapped(label).sum())) > away:
            yield overlapping(label, count, total, wrong)
            return
        # Of few loads, and where half of the labels are felt, the others may be too weak.
        if 2 * away <= total or 2 * self.felt.count < total or not self.felt.at_edges_by_chance(at_edge, total):
            return
        measured = (
            f"{at_edge} of {counted(total, 'label')} {are(at_edge)} within {WINDOW_MS:.0f} ms of the beginning or end "
            f"of a load, no more than by chance, while the sensor felt {counted(self.felt.count, 'load')}"
        )
        yield Cause("foreign_labels", (label,), wrong, measured, FOREIGN)

    def _shifts(self, wrong: Mapping[str, int]) -> Iterator[Cause]:
        """Yield by how much labels are off, which one option moves by the distance that they agree on best.

        Labels that a hand set live need a second option, for their spread. Where other labels fit, those that a wider
        window reaches are right: what they name is felt late, or early, as the end of a slow release.
        """
        best, far = self._best, {label: off for label, off in self._distances.items() if off.is_far}
        yield from self._part_off({label: count for label, count in wrong.items() if label not in far})
        for label, distance in far.items():
            if best is None or label not in wrong or distance.changes_from_label:
                continue
            if label in self.felt_apart and not self.is_of_one_name:
                continue
            together = (best.is_far or self._is_shifted) and abs(distance.ms - best.ms) <= 2 * WINDOW_MS
            if together or distance.is_around:
                arguments = (best if together else distance).arguments
                option = " ".join(f"--{name.replace('_', '-')} {value:.0f}" for name, value in arguments.items())
                measured = f"{distance}{'; the score is then against the moved labels' * ('shift_ms' in arguments)}"
                yield by_option("shifted_labels", label, wrong[label], measured, option, **arguments)
            else:
                side = "earlier" if distance.ms > 0 else "later"
                fit = ", because the other labels fit" * (not best.is_far)
                advice = f"to move the labels of {label} {abs(distance.ms):.0f} ms {side}{fit}"
                yield Cause("shifted_labels", (label,), wrong[label], str(distance), advice)

    def _part_off(self, wrong: Mapping[str, int]) -> Iterator[Cause]:
        """Yield by how much labels of a part of a recording are off: those of all names, else of single ones."""
        for names in dict.fromkeys([tuple(self._counts), *((label,) for label in wrong)]):
            off = self.felt.part_off(names)
            stretch = "" if off is None else stretch_of(off[0], off[1].members, self.sound)
            if off is None or not stretch:
                continue
            (times, alike), side, back = off, *(("after", "earlier") if off[1].ms > 0 else ("before", "later"))
            count, distance = int(alike.members.sum()), f"{abs(alike.ms):.0f} ms"
            labels = "labels" if len(names) == len(self._counts) else f"labels of {', '.join(names)}"
            where = f"{distance} {side} where the sensor felt the others"
            measured = f"{count} of {counted(len(times), 'label')} {are(count)} {where}"
            for label in filter(names.__contains__, wrong):
                yield Cause(
                    "shifted_labels",
                    (label,),
                    wrong[label],
                    f"{measured}, all {stretch}",
                    f"to move the {labels} {stretch} {distance} {back}",
                )
            if len(names) > 1:
                return

    def _of_label(self, label: str, wrong: int) -> Iterator[Cause]:
        if (count := self._counts.get(label, 0)) < TWO_FOLDS:
            there = f"there {are(count)} only {counted(count, 'label')}"
            folds = f"a score on held-out data needs at least {TWO_FOLDS}, and five folds need {FIVE_FOLDS}"
            yield Cause("few_labels", (label,), wrong, f"{there}; {folds}", "more labels")
        if not self.plan.fit_levels:
            stretches = [(k, -np.inf, np.inf) for k in range(len(self.sound))]
            loaded = loaded_levels(self.plan.encoder, self.sound, stretches)
            if loaded is not None and loaded.within < min(LEAST_LEVELS, len(self.plan.encoder.levels)):  # type: ignore[attr-defined]
                measured = (
                    f"{loaded.within} of the encoder's levels {are(loaded.within)} within the range that loaded taxels "
                    f"read, {loaded.low:.3g} to {loaded.high:.3g}"
                )
                changes = {"fit_levels": True}
                yield by_option("levels", label, wrong, measured, "--set fit_levels=true", changes=changes)
        if self._of_tare is not None:
            yield replace(self._of_tare, labels=(label,), mistakes=wrong)
        yield from self._begun_loaded(label, wrong)

    def _begun_loaded(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield how many labels are where a recording begins loaded, of which encoders of levels see no begin."""
        encoder = self.plan.encoder
        if not isinstance(encoder, LevelCrossing | ThresholdIzhikevich):
            return
        count = 0
        for example in self.sound:
            source = example.source
            if isinstance(source, Frames) and len(source) > 1 and (source.values[0] >= min(encoder.levels)).any():
                count += int(np.count_nonzero(example.labels.get(label, np.empty(0)) <= source.t[1]))
        if count:
            measured = (
                f"{count} of {counted(self._counts[label], 'label')} {are(count)} in the first two frames of "
                "recordings whose sensor is loaded from the first frame: the encoder cannot detect its beginning"
            )
            yield Cause("begun_loaded", (label,), min(count, wrong), measured, ZEROS_BEFORE)


class _WeakBurst(NamedTuple):
    """A label without an input near it, where a file of counts has far more events than at rest."""

    window_ms: float
    events: float
    """The greatest number of events of all taxels in a window near the label."""
    rest: float
    """The mean number of events of all taxels in a window at rest."""
    by: Mapping[int, float]
    """By number of joined windows: the events above rest, as a multiple of the noise at rest."""


def weak_bursts(examples: Sequence[Example], alignment: Alignment) -> Iterator[_WeakBurst]:
    """Yield those of the labels without a pair that have a burst of events, of files of counts."""
    for k, example in enumerate(examples):
        source, tare = recorded(example.source), example.tare
        if not isinstance(source, Frames) or not are_counts(source.unit) or tare is None or len(source) < 2:
            continue
        total = np.asarray(np.nansum(source.values, axis=(1, 2), dtype=np.float64))
        resting = total[slice(*np.searchsorted(source.t, (tare.start_us, tare.stop_us)))]
        if not len(resting):
            continue
        rest, window_us = resting.mean(), float(np.median(np.diff(source.t)))
        noise = max(resting.std(), rest**0.5, 1.0)
        for t in alignment.given[alignment.unpaired & (alignment.example == k)]:
            reach_us = to_us(WINDOW_MS)
            near = total[slice(*np.searchsorted(source.t, (t - reach_us, t + reach_us)))] - rest
            by = {
                n: float(np.convolve(near, np.ones(n), "valid").max()) / (noise * n**0.5)
                for n in _LONGER
                if n <= len(near)
            }
            if by and by[1] >= TIMES_NOISE:
                yield _WeakBurst(to_ms(window_us), near.max() + rest, rest, {n: by.get(n, 0.0) for n in _LONGER})


def of_weak_bursts(examples: Sequence[Example], label: str, alignment: Alignment, mistakes: int) -> Cause | None:
    """Return the cause that most labels without a pair have a burst below the level that is learnt; else None."""
    weak = list(weak_bursts(examples, alignment))
    if 2 * len(weak) <= alignment.unpaired.sum():
        return None
    events, rest = (np.median([getattr(burst, name) for burst in weak]) for name in ("events", "rest"))
    times, most = max(_LONGER, key=lambda k: np.median([burst.by[k] for burst in weak])), weak[0].window_ms
    present, longer = (np.median([burst.by[k] for burst in weak]) for k in (1, times))
    measured = (
        f"at {counted(len(weak), 'label')} a burst of events is weaker than the level that {label} is learnt from: "
        f"at the median it has {events:.0f} events in {most:g} ms, against {rest:.0f} at rest; the difference is "
        f"{present:.3g} times the noise at rest"
    )
    advice = ""
    if times > 1:
        measured += f", and {longer:.3g} times in {times * most:g} ms"
        advice = f"frames of longer windows, --count-ms {times * most:g}"
    return Cause("levels", (label,), mistakes, measured, advice)
