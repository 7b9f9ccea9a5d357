"""Causes of missed and false events, measured on the training data and its scores, and what helps against each."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import comb
from typing import Any, NamedTuple

import numpy as np

from taxel import _core
from taxel._base.arguments import integer, mapping, several, shown, text
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS, Alignment
from taxel.detect.examples import Example
from taxel.detect.fitting import TWO_FOLDS, Trained
from taxel.detect.label_times import TOUCH, FeltLoads, Off, early, held_by_tare, quiet_s, unlabelled_us
from taxel.detect.levels import LEAST_LEVELS, loaded_levels
from taxel.detect.loads import lacks_neighbours
from taxel.detect.plain_score import PlainScore
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import APART_US, Mistake, Score, score
from taxel.detections import Detections
from taxel.encode import ContactArea, Encoder, LevelCrossing, Moments, ThresholdIzhikevich
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import TIMES_NOISE, ZEROS_BEFORE, of_frames
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare

#: The kinds of causes. Where two concern equally many mistakes the earlier comes first: the later may follow from it.
KINDS = (
    "falling_values", "shifted_labels", "few_labels", "unlabelled_source", "levels", "foreign_labels", "tare",
    "begun_loaded", "durations", "recipe", "window", "unlabelled_time", "label_name", "plain_rule", "no_neighbours",
    "indistinct_kinds", "overfitting", "parameters",
)  # fmt: skip

#: What helps against labels that lie elsewhere.
_FOREIGN = "labels of this recording, where it was touched"
#: What makes a tare's file of a recording.
_MAKES_TARE = "taxel cut RECORDING FILE --from S --to S"
#: From which share of the events on missed or false ones are many.
_MANY = 0.05
#: Labels are a question before a training if at most this share of them lies near anything that was felt ...
_NEARLY_NONE = 0.1
#: ... of so many or more.
_LEAST_LABELS = 4
#: Labels of several names are moved together whose distances from what was felt differ by so many windows at most.
_TOGETHER = 1.5
#: How long before a label the sensor is looked at, us: as long as a tare ends before the first label.
_BEFORE_US = 20_000
#: How many labels at either end of a recording are looked at.
_LABELS = 4
#: Five folds need this many labels.
_FIVE_FOLDS = 10
#: Into so many parts a recording is divided to see a drift, at so many frames of each.
_PARTS, _LOOKS = 8, 40
#: Without frames for so long a sensor may have begun anew, us.
_GAP_US = 1_000_000
#: A touched taxel reads so many times its drift.
_TIMES = 4
#: From this share of the time before the first label and behind the last one on, some labels may be missing there.
_UNLABELLED = 0.25
#: Windows of counts so many times as long are looked at for a weak burst.
_LONGER = (1, 2, 4)
#: Kinds of touch are told apart where chance would tell as many with at most this probability.
_CHANCE = 0.05


@dataclass(frozen=True)
class Cause:
    """Hold one cause of missed and false events: what was measured, and what helps.

    Parameters
    ----------
    kind : str
        "falling_values", "shifted_labels", "few_labels", "unlabelled_source", "levels", "foreign_labels", "tare",
        "begun_loaded", "durations", "recipe", "window", "unlabelled_time", "label_name", "plain_rule",
        "no_neighbours", "indistinct_kinds", "overfitting" or "parameters"; the page on training explains each.
    labels : tuple of str
        The labels that it concerns.
    mistakes : int, 0 or more
        How many missed and false events it concerns, at most.
    measured : str
        What was measured.
    advice : str
        What helps: the option of ``taxel train`` with its value, where there is one.
    option : str
        That option, as it is typed; empty where none helps.
    arguments : mapping of str to value
        The same in Python: fields of `taxel.tasks.TrainOptions`. Those of "changes" are added to the others.

    Raises
    ------
    ProblemError : another kind, or a value of another type

    Examples
    --------
    >>> cause = Cause("shifted_labels", ("contact",), 12, "12 of 12 lie 203 ms late", "--shift-ms -203")
    >>> str(cause)
    'what may help is --shift-ms -203: 12 of 12 lie 203 ms late'
    """

    kind: str
    labels: tuple[str, ...]
    mistakes: int
    measured: str
    advice: str
    option: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if text("kind", self.kind) not in KINDS:
            raise refused("kind", f" is {shown(self.kind)}: must be one of {', '.join(KINDS)}")
        object.__setattr__(self, "labels", tuple(text("labels", label) for label in several("labels", self.labels)))
        integer("mistakes", self.mistakes, 0)
        for name in ("measured", "advice", "option"):
            text(name, getattr(self, name))
        mapping("arguments", self.arguments)

    def __str__(self) -> str:
        return f"what may help is {self.advice}: {self.measured}"

    def to_dict(self) -> dict[str, Any]:
        """Return the cause as plain values for JSON."""
        return {
            "kind": self.kind,
            "labels": list(self.labels),
            "mistakes": self.mistakes,
            "measured": self.measured,
            "advice": self.advice,
            "option": self.option,
            "arguments": dict(self.arguments),
        }


def _lie(count: int) -> str:
    return "lies" if count == 1 else "lie"


def _by_option(kind: str, label: str, mistakes: int, measured: str, option: str, **arguments: Any) -> Cause:
    """Return a cause against which an option of the training helps."""
    return Cause(kind, (label,), mistakes, measured, option, option, arguments)


def _ordered(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return causes with the same advice as one, those of most mistakes first."""
    merged: dict[tuple[str, str], Cause] = {}
    for cause in causes:
        before = merged.setdefault((cause.kind, cause.advice), cause)
        if before is cause:
            continue
        parts = cause.measured.split("; ")
        measured = [*(part for part in before.measured.split("; ") if part not in parts), *parts]
        merged[cause.kind, cause.advice] = replace(
            before,
            labels=(*before.labels, *cause.labels),
            mistakes=before.mistakes + cause.mistakes,
            measured="; ".join(measured),
        )
    return tuple(sorted(merged.values(), key=lambda cause: (-cause.mistakes, KINDS.index(cause.kind))))


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
    def _felt(self) -> FeltLoads:
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
        return f"{measured}: if less means more pressure, {advice} helps" if advice else ""

    @cached_property
    def _fall(self) -> tuple[str, str]:
        """What turns values that fall, and that they do; empty where none do."""
        for example in self.examples:
            source = recorded(example.source, hold=False)
            if isinstance(source, Frames) and (rest := of_frames(source)).falls:
                layout, advice = rest.turning(getattr(example.source, "path", None))
                turned = f" as {layout} turns them" * bool(layout)
                return advice, f"{example.name}: " * bool(example.name) + f"values fall from their rest{turned}"
        return "", ""

    @cached_property
    def _distances(self) -> dict[str, Off]:
        return self._felt.distances(self._counts)

    @cached_property
    def felt_apart(self) -> dict[str, Off]:
        """Labels too far from what was felt to be aligned, and near enough for a window, where no other name is off."""
        if not self.is_of_one_name and all(distance.is_far for distance in self._distances.values()):
            return {}
        return {
            label: distance
            for label, distance in self._distances.items()
            if distance.is_far and abs(distance.ms) <= 2 * WINDOW_MS
        }

    def felt_rank(self, label: str) -> int:
        """Return how many loads that begin, or end, and labels have no pair within twice the window of alignments."""
        return self._felt.rank(label, 2 * WINDOW_MS)

    @cached_property
    def _early(self) -> str:
        """That the labels of each recording lie at its very beginning; empty where they do not."""
        texts = [
            early(example.labels, int(source.t[0]), int(source.t[-1]))
            for example in self.sound
            if isinstance(source := example.source, Events | Frames)
            and len(source)
            and any(map(len, example.labels.values()))
        ]
        return texts[0] if texts and all(texts) else ""

    @cached_property
    def _loaded(self) -> int:
        """How many taxels read above their tare while nothing touches them."""
        return loaded_at_rest(self.examples, self.plan.encoder)

    @cached_property
    def _of_tare(self) -> tuple[str, str, dict[str, Any]]:
        """What is wrong with the tare, the option that helps, and its value in Python; empty where nothing is."""
        held = held_by_tare(self.sound)
        if held >= TOUCH:
            seconds = quiet_s(self.sound)
            by = ("--tare FILE", {}) if seconds is None else (f"--tare {seconds:g}", {"tare": seconds})
            return f"it holds a touch of {held} taxels", *by
        if self._loaded >= TOUCH:
            return f"{self._loaded} taxels read above theirs while nothing touches them", "--tare FILE", {}
        return "", "", {}

    @cached_property
    def _near(self) -> dict[str, tuple[int, int, int]]:
        """How many labels of each name lie near a load, near its begin or end, and how many there are, if known."""
        near = {label: self._felt.near(label) for label in self._counts}
        return {label: counts for label, counts in near.items() if counts is not None and counts[-1]}

    def unfelt(self) -> str:
        """Return how many labels lie near anything felt, if nearly none does; else, and where it is not known, ""."""
        count, _, total = np.sum([*self._near.values(), (0, 0, 0)], axis=0).tolist()
        if total < _LEAST_LABELS or count > _NEARLY_NONE * total:
            return ""
        return f"{count} of {counted(total, 'label')} {_lie(count)} within {WINDOW_MS:.0f} ms of anything that was felt"

    def refused(self) -> tuple[Cause, ...]:
        """Return the causes that the data show of a training that was refused: all labels count as missed."""
        return _ordered([cause for cause in self.causes(self._counts) if cause.kind != "few_labels"])

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
        """Yield that most labels of a name lie within touches, where most labels of another name lie at their edges."""
        near, at_edge, total = self._near.get(label, (0, 0, 0))
        fits = [name for name, (_, edges, count) in self._near.items() if name != label and 2 * edges > count]
        within = near - at_edge
        # A tare that does not fit lets touches seem to last.
        if recipes.knows("touch", label) or not fits or 2 * within <= total or self._loaded >= TOUCH:
            return
        measured = (
            f"{within} of {counted(total, 'label')} {_lie(within)} within touches, which {', '.join(fits)} "
            f"{'fits' if len(fits) == 1 else 'fit'}, and no recipe tells what happens while a touch lasts"
        )
        yield Cause("label_name", (label,), wrong, measured, "labels of where touches begin or end")

    def _foreign(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield at how many labels no load begins or ends; all mistakes may be by them if that is most."""
        if self._early:
            yield Cause("foreign_labels", (label,), wrong, f"the labels {self._early}", "labels with times in us")
            return
        _, at_edge, total = self._near.get(label, (0, 0, 0))
        # A tare that does not fit tells nothing.
        if at_edge == total or self._loaded >= TOUCH or label in self.felt_apart:
            return
        away = total - at_edge
        measured = (
            f"{away} of {counted(total, 'label')} {_lie(away)} more than {WINDOW_MS:.0f} ms from where a load begins "
            "or ends: they are of another recording, or off by another time each, or name what the sensor does not "
            "feel, or a tare from elsewhere does not fit"
        )
        mistakes = wrong if 2 * away > total else min(away, wrong)
        yield Cause("foreign_labels", (label,), mistakes, measured, _FOREIGN)

    def _shifts(self, wrong: Mapping[str, int]) -> Iterator[Cause]:
        """Yield by how much labels are off, which one option moves if no label is then too far off.

        Labels that a hand set live need a second option, for their spread. Where other labels fit, those that a wider
        window reaches are right: what they name is felt late, or early, as the end of a slow release.
        """
        distances = self._distances
        all_ms = [distance.ms for distance in distances.values()]
        together = bool(all_ms) and max(all_ms) - min(all_ms) <= _TOGETHER * WINDOW_MS
        shift_ms = -round((max(all_ms) + min(all_ms)) / 2) if together else 0
        within_ms = max((distance.within_ms for distance in distances.values()), default=0.0)
        for label, distance in distances.items():
            if label not in wrong or not distance.is_far:
                continue
            if label in self.felt_apart and not self.is_of_one_name:
                continue
            measured = f"{distance}; the score is then against the moved labels"
            if together:
                option, arguments = f"--shift-ms {shift_ms}", {"shift_ms": float(shift_ms)}
                if within_ms > WINDOW_MS:
                    option, arguments = f"{option} --window-ms {within_ms:.0f}", arguments | {"window_ms": within_ms}
                yield _by_option("shifted_labels", label, wrong[label], measured, option, **arguments)
            else:
                side = "earlier" if distance.ms > 0 else "later"
                advice = f"times of {label} {abs(distance.ms):.0f} ms {side} in the labels, as others fit"
                yield Cause("shifted_labels", (label,), wrong[label], measured, advice)

    def _of_label(self, label: str, wrong: int) -> Iterator[Cause]:
        if (count := self._counts.get(label, 0)) < TWO_FOLDS:
            there = f"there {'is' if count == 1 else 'are'} {count}"
            folds = f"{TWO_FOLDS} are the least to score it held out, {_FIVE_FOLDS} for five folds"
            yield Cause("few_labels", (label,), wrong, f"{there}; {folds}", "more labels")
        if not self.plan.fit_levels:
            stretches = [(k, -np.inf, np.inf) for k in range(len(self.sound))]
            loaded = loaded_levels(self.plan.encoder, self.sound, stretches)
            if loaded is not None and loaded.within < min(LEAST_LEVELS, len(self.plan.encoder.levels)):  # type: ignore[attr-defined]
                measured = (
                    f"{loaded.within} of the encoder's levels {_lie(loaded.within)} within what "
                    f"loaded taxels read, {loaded.low:.3g} to {loaded.high:.3g}"
                )
                changes = {"fit_levels": True}
                yield _by_option("levels", label, wrong, measured, "--set fit_levels=true", changes=changes)
        because, option, arguments = self._of_tare
        if because:
            advice = option if arguments else "another tare, of the time just before (--tare FILE)"
            measured = f"of the tare: {because}" + ("" if arguments else f"; {_MAKES_TARE} makes that file, a .npz")
            yield Cause("tare", (label,), wrong, measured, advice, option, arguments)
        yield from self._begun_loaded(label, wrong)
        yield from self._other_recipe(label, wrong)

    def _begun_loaded(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield how many labels lie where a recording begins loaded, of which encoders of levels see no begin."""
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
                f"{count} of {counted(self._counts[label], 'label')} {_lie(count)} in the first two frames of "
                "recordings that begin loaded, where no load begins"
            )
            yield Cause("begun_loaded", (label,), min(count, wrong), measured, ZEROS_BEFORE)

    def _other_recipe(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the recipe that fits recording and labels, if another named one is trained by."""
        used = next((name for name in recipes.names() if recipes.read(name)["about"] == self.plan.about), None)
        source = recorded(self.examples[0].source)
        if used is None or isinstance(source, SpikeTrains):
            return
        fits, why = recipes.chosen(source, list(self._counts))
        if fits != used:
            measured = f"it is made for {why}; this training took {used}"
            yield _by_option("recipe", label, wrong, measured, f"--recipe {fits}", recipe=fits)


@dataclass(frozen=True)
class Mistakes:
    """Hold the scores of a training, and find the causes of what is missed and false.

    Parameters
    ----------
    trained : Trained
    scored, learnt : Score
        Held out, and on the training data.
    each : sequence of Score
        Held out, of each example.
    searched : bool
        Whether its parameters were chosen among those of the recipe.
    plain : PlainScore, optional
        The scores of the plain rules on the labels of `scored`.
    mistakes : sequence of Mistake
        What `scored` calls missed and false, with a window of ...
    window_ms : float, ms
    """

    trained: Trained
    scored: Score
    learnt: Score
    each: Sequence[Score] = ()
    searched: bool = False
    plain: PlainScore | None = None
    mistakes: Sequence[Mistake] = ()
    window_ms: float = WINDOW_MS

    def causes(self, evidence: Evidence) -> tuple[Cause, ...]:
        """Return the causes for the labels of which more than 5 % are missed or false, those of most mistakes first."""
        wrong = {
            label: score.rank[0]
            for label, score in self.scored.by_label.items()
            if label in self.trained.readout.labels and max(score.missed, score.false) > _MANY * score.events
        }
        sources: dict[int, list[Cause]] = {}
        for label in wrong if not evidence.falls else ():
            for place, cause in self._of_sources(evidence.sound, label):
                sources.setdefault(place, []).append(cause)
        found = [cause for causes in sources.values() for cause in causes]
        if sources:
            # All else is measured on the others.
            evidence = evidence.without(sources)
            for label in wrong:
                scores = (self.each[place].by_label.get(label) for place in sources)
                wrong[label] -= sum(score.rank[0] for score in scores if score is not None)
            wrong = {label: count for label, count in wrong.items() if count > 0}
        windows = {label: list(self._window(evidence, label, mistakes)) for label, mistakes in wrong.items()}
        # Whether labels are off or felt late is not known of those of one name alone: a wider window keeps their times.
        wide = {
            cause.labels
            for causes in windows.values()
            for cause in causes
            if evidence.is_of_one_name and 2 * cause.mistakes >= wrong[cause.labels[0]]
        }
        measured = evidence.causes(wrong)
        found += [cause for cause in measured if cause.kind != "shifted_labels" or cause.labels not in wide]
        if not any(cause.kind in ("falling_values", "shifted_labels") for cause in found):
            for label, mistakes in wrong.items():
                if any(cause.kind == "label_name" and label in cause.labels for cause in found):
                    continue
                found += [*self._unlabelled_time(evidence.sound, label), *self._name(label, mistakes)]
                found += windows[label]
                # A tare that does not fit lets labels lie far from what is felt, too, and so does what is felt late.
                explained = any(cause.kind in ("foreign_labels", "tare") and label in cause.labels for cause in found)
                if not explained and label not in evidence.felt_apart:
                    found += self._unpaired(evidence.sound, label)
                # More labels and other parameters are for what nothing else explains.
                if all(2 * cause.mistakes < mistakes for cause in found if label in cause.labels):
                    found += self._of_learning(evidence, label, mistakes)
                else:
                    found += self._rule(label, mistakes)
        return _ordered([cause for cause in found if cause.mistakes > 0])

    def _of_sources(self, examples: Sequence[Example], label: str) -> Iterator[tuple[int, Cause]]:
        """Yield the sources of one recording whose labels are those of another source, or which have none beside it."""
        if len(self.each) != len(examples):
            return
        groups: dict[str, list[int]] = {}
        for k, example in enumerate(examples):
            if label not in example.unlabelled and example.group:
                groups.setdefault(example.group, []).append(k)

        def share(k: int) -> float:
            score = self.each[k].by_label.get(label)
            return score.found / score.events if score is not None and score.events else 0.0

        for group, places in groups.items():
            best = max(places, key=share)
            times = examples[best].labels.get(label, ())
            for k in places:
                score, labelled = self.each[k].by_label.get(label), examples[k].labels.get(label, ())
                if k == best or score is None or 2 * share(k) > share(best):
                    continue
                if len(labelled) and not np.array_equal(labelled, times):
                    continue
                name, other_name = (examples[place].name.removeprefix(group) for place in (k, best))
                same = f"where its labels are those of {other_name}" if len(labelled) else "which has no labels"
                measured = f"{score.missed} missed and {score.false} false in {name}, {same}"
                advice = f"a column source in the labels, {other_name} in its rows"
                yield k, Cause("unlabelled_source", (label,), score.rank[0], measured, advice)

    def _unlabelled_time(self, examples: Sequence[Example], label: str) -> Iterator[Cause]:
        """Yield that events may lack labels before the first and behind the last, where much time lies there."""
        (outside, total), scored = unlabelled_us(examples, label), self.scored[label]
        found = scored.false <= scored.missed and 2 * scored.found >= scored.events
        if not found and outside >= _UNLABELLED * total:
            yield Cause(
                "unlabelled_time",
                (label,),
                scored.rank[0],
                f"{outside / 1e6:.1f} of {total / 1e6:.1f} s lie before the first or behind the last one, and an event "
                "without its label counts as false: label those too, or cut the recording (taxel cut) to what is "
                "labelled",
                "labels of all events",
            )

    def _window(self, evidence: Evidence, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the window in which a plain rule halves what is wrong, as something is felt late or early.

        Else that which pairs what is missed with what is false, if most of it lies so near.
        """
        apart = evidence.felt_apart.get(label)
        if apart is not None and self.window_ms < 2 * WINDOW_MS and 2 * (left := evidence.felt_rank(label)) <= wrong:
            option = f"--window-ms {2 * WINDOW_MS:g} --rule FILE"
            advice = f"a wider window and the plain rule ({option})"
            within = f"within {2 * WINDOW_MS:g} ms a plain rule leaves {left} missed and false, the neuron {wrong}"
            measured = f"{apart}; {within}"
            yield Cause("window", (label,), wrong - left, measured, advice, option, {"window_ms": 2 * WINDOW_MS})
            return
        missed, false = (
            np.sort(
                [m.recording * APART_US + m.t for m in self.mistakes if (m.label, m.is_missed) == (label, is_missed)]
            )
            for is_missed in (True, False)
        )
        reach_ms = 2 * self.window_ms
        pairs = score(Detections([label] * len(false), false, false), {label: missed}, reach_ms)
        if 2 * pairs.found <= len(missed):
            return
        window_ms = float(np.ceil(np.abs(pairs.errors_ms).max()))
        measured = (
            f"{pairs.found} of {len(missed)} missed {'has' if pairs.found == 1 else 'have'} a false detection within "
            f"{reach_ms:g} ms, at most {window_ms:g} ms away"
        )
        mistakes = min(2 * pairs.found, wrong)
        yield _by_option("window", label, mistakes, measured, f"--window-ms {window_ms:g}", window_ms=window_ms)

    def _unpaired(self, examples: Sequence[Example], label: str) -> Iterator[Cause]:
        """Yield how many labels lie far from what the neuron learnt them by, or are weaker than that."""
        alignment = self.trained.alignments.get(label)
        if alignment is None or not (unpaired := int(alignment.unpaired.sum())):
            return
        mistakes = min(unpaired, self.scored[label].missed)
        weak = list(_weak_bursts(examples, alignment))
        if 2 * len(weak) <= unpaired:
            measured = (
                f"no input that {label} is learnt from lies within {WINDOW_MS:.0f} ms of {counted(unpaired, 'label')}"
            )
            yield Cause("foreign_labels", (label,), mistakes, measured, _FOREIGN)
            return
        events, rest = (np.median([getattr(burst, name) for burst in weak]) for name in ("events", "rest"))
        times, most = max(_LONGER, key=lambda k: np.median([burst.by[k] for burst in weak])), weak[0].window_ms
        present, longer = (np.median([burst.by[k] for burst in weak]) for k in (1, times))
        measured = (
            f"{len(weak)} bursts are weaker than the level that {label} is learnt from, at the median {events:.0f} "
            f"events in {most:g} ms where the rest has {rest:.0f}: {present:.3g} times its noise"
        )
        advice = "the plain rule (--rule FILE)"
        if times > 1:
            measured += f", and {longer:.3g} times in {times * most:g} ms"
            advice = f"frames of longer windows, --count-ms {times * most:g}"
        yield Cause("levels", (label,), mistakes, measured, advice)

    def _name(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield that a label without its name may be the end of a touch, where it was learnt as a kind of touch."""
        alignment = self.trained.alignments.get(label)
        kinds = self._by_touch and not recipes.knows("touch", label)
        if not kinds or self.scored[label].found or alignment is None or alignment.train is not None:
            return
        ends = ", ".join(("lift", *(name for name, kind in recipes.read("touch")["also"].items() if kind == "lift")))
        measured = (
            f"by this one it is learnt as a kind of touch, told as one begins; names of the end of a touch are {ends}"
        )
        yield Cause("label_name", (label,), wrong, measured, "another name of the label")

    def _of_learning(self, evidence: Evidence, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the causes where labels and tares are right: inputs, kinds, too few examples, parameters."""
        chance = _chance(label, self.scored, self.plain) if self.scored[label].events >= _FIVE_FOLDS else ""
        learnt = min(self.learnt[label].rank[0], wrong)
        if rules := list(self._rule(label, wrong)):
            yield from rules
            return
        if lacks_neighbours(evidence.examples) and (self._touches or chance):
            array = self.trained.readout.array
            size = "ROWSxCOLUMNSxMM" if array is None else f"{array.rows}x{array.columns}xMM"
            measured = "channels in a row at a known distance, MM mm, have neighbours; then the recipe touch fits"
            yield _by_option("no_neighbours", label, wrong, measured, f"--array {size}")
            return
        if chance and any(isinstance(encoder, Moments) for encoder in self.trained.recipe.encoder._each()):
            measured = (
                f"{chance}, from moments of the frame, as area and load, its centre, and how long a touch lasts; "
                "taxel information says whether they differ otherwise, or labels are few or mixed up"
            )
            yield Cause("indistinct_kinds", (label,), wrong, measured, "other kinds")
            return
        points = len(self.trained.recipe.points_of(label))
        others = not self.searched and points > 1
        if others:
            measured = f"{learnt} are missed or false on the training data too; it tries {points} sets of parameters"
            yield _by_option("parameters", label, learnt, measured, "--search", search=True)
        alone = self.learnt[label]
        measured = f"of those that it learnt {alone.missed} are missed, and {alone.false} are false"
        yield Cause("overfitting", (label,), wrong - learnt if others else wrong, measured, "more labels")

    def _rule(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the plain rule if it halves the mistakes, or the recipe that has its inputs, if this one has not."""
        if self.plain is None or self.plain.together is None or label not in self.plain.better(self.scored):
            return
        left, rule = self.plain.together[label].rank[0], self.plain.rules[label]
        if 2 * left > wrong:
            return
        measured = f"leaves {left} missed and false on the same labels, the neuron {wrong}"
        has_area = any(isinstance(encoder, ContactArea) for encoder in self.trained.recipe.encoder._each())
        if self._touches and not has_area:
            measured = f"the plain rule, which has its inputs, {measured}"
            yield _by_option("plain_rule", label, wrong - left, measured, "--recipe touch", recipe="touch")
            return
        lasting = rule is not None and isinstance(rule.age_ms, str)
        measured = (
            f"it {measured}{', as it knows how long touches last' * lasting}; taxel detect --readout FILE runs it"
        )
        kind = "durations" if lasting else "plain_rule"
        yield Cause(kind, (label,), wrong - left, measured, "the plain rule (--rule FILE)", "--rule FILE")

    @property
    def _by_touch(self) -> bool:
        """Whether it was trained by the recipe `touch`."""
        return self.trained.recipe.about == str(recipes.read("touch")["about"])

    @property
    def _touches(self) -> bool:
        """Whether all labels are those of the recipe `touch`, contact and lift: not contact and foot off."""
        return all(recipes.knows("touch", label) for label in self.trained.readout.labels)


class _WeakBurst(NamedTuple):
    """A label without an input near it, where a file of counts has far more events than at rest."""

    window_ms: float
    events: float
    """Most of all taxels in a window near it ..."""
    rest: float
    """... and at rest."""
    by: Mapping[int, float]
    """How many times the noise at rest the events above it are, in so many windows together."""


def _weak_bursts(examples: Sequence[Example], alignment: Alignment) -> Iterator[_WeakBurst]:
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


def _chance(label: str, scored: Score, plain: PlainScore | None) -> str:
    """Return how many of a kind of touch are told, where neuron and rule tell no more than chance would; else ""."""
    by = {"the neuron": scored} | ({} if plain is None or plain.together is None else {"the rule": plain.together})
    shares = [_by_chance(label, who, score) for who, score in by.items()]
    return ", ".join(shares) + ", as by chance" if all(shares) else ""


def _by_chance(label: str, who: str, together: Score) -> str:
    """Return how many of a kind are told, and of the others taken for it, where chance may do so (Fisher, one-sided).

    Every false detection counts as one at a touch of another kind.
    """
    kinds = [score for score in together.by_label.values() if not recipes.knows("touch", score.label)]
    kind = together[label]
    others = sum(kind.events for kind in kinds) - kind.events
    if kind not in kinds or not others:
        return ""
    right, taken = kind.found, min(kind.false, others)
    ways = sum(
        comb(kind.events, k) * comb(others, right + taken - k)
        for k in range(right, kind.events + 1)
        if k <= right + taken
    )
    if ways <= _CHANCE * comb(kind.events + others, right + taken):
        return ""
    return f"{who} tells {right} of {kind.events} and takes {taken} of {others} others for {label}"


def loaded_at_rest(examples: Sequence[Example], encoder: Encoder) -> int:
    """Return how many taxels read above the tare of their example while nothing touches it; 0 without a tare.

    A taxel counts that does so 20 ms before each of the first four labels, or of the last four: at one of four such
    moments at least a touch is yet to begin, and noise is elsewhere each time. So it is a tare that does not fit from
    the beginning, or one that the readings drifted away from. Of several examples it is the largest number.
    """
    return max((_loaded(example, encoder) for example in examples), default=0)


def _loaded(example: Example, encoder: Encoder) -> int:
    floors = [part.noise_floor for part in encoder._each() if hasattr(part, "noise_floor")]
    source = recorded(example.source)
    times = np.sort(np.concatenate([*example.labels.values(), np.empty(0, np.int64)])).astype(np.int64) - _BEFORE_US
    if example.tare is None or not floors or isinstance(source, SpikeTrains) or not len(times):
        return 0
    above = _core.touched_above(max(map(float, floors)))
    least = [
        np.min([example.tare.off(_at(source, int(t))).values for t in ends], axis=0)
        for ends in (times[:_LABELS], times[-_LABELS:])
    ]
    return max(int(np.count_nonzero(values >= above)) for values in least)


def _at(source: Events | Frames, t_us: int) -> Frames:
    """Return the frame at a time."""
    if isinstance(source, Events):
        return Frames.from_events(source, 1, t_us, t_us + 1)
    index = max(0, int(np.searchsorted(source.t, t_us, side="right")) - 1)
    return source[index : index + 1]


def count_drifted(source: Events | Frames, tare: Tare, noise_floor: float) -> int:
    """Return how many taxels drifted above a tare by more than the noise floor; 0 where it may be a load.

    A taxel counts that reads no more in the first eighth of the recording and more in the last, in nine of ten
    frames, came there little by little, or while no frame came for a second, and reads four times as much while it is
    touched: a load that stays comes at once, or is all that a taxel reads. A quarter of the taxels that were touched
    must do so, and two at least.

    Parameters
    ----------
    source : Events or Frames
    tare : Tare
    noise_floor : float, in the sensor's unit
    """
    after = source.t[source.t >= tare.stop_us]
    if not len(after):
        return 0
    if isinstance(source, Events):
        source = Frames.from_events(source, max(1, int(after[-1] - after[0]) // (_PARTS * _LOOKS)), int(after[0]))
    frames = source.between(tare.stop_us, np.inf)
    gap_stamps = frames.t[1:][np.diff(frames.t) >= max(_GAP_US, 3 * np.median(np.diff(frames.t)))]
    frames = frames[:: max(1, len(frames) // (_PARTS * _LOOKS))]
    looks = len(frames) // _PARTS
    if looks < _LOOKS // 4:
        return 0
    gaps = np.searchsorted(frames.t, gap_stamps)
    values = tare.off(frames).values[: _PARTS * looks]
    above, most = _core.touched_above(noise_floor), values.max(axis=0)
    least = np.quantile(values.reshape(_PARTS, looks, *most.shape), 0.1, axis=1)
    steps = np.diff(least, axis=0)
    # What a taxel reads otherwise after a gap, as of a sensor that began anew, is no load that came.
    for gap in gaps // looks:
        steps[max(0, gap - 1) : gap + 1] = 0
    slowly = steps.max(axis=0) <= least[-1] / 2
    count = np.count_nonzero((least[0] < above) & (least[-1] >= above) & slowly & (most >= _TIMES * least[-1]))
    return int(count) if count >= max(TOUCH, np.count_nonzero(most >= _TIMES * above) / _TIMES) else 0
