"""Causes of what a training leaves missed and false, measured on its data and its scores, and what helps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Any

import numpy as np

from taxel._base.messages import are, counted, escaped
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.cause import Cause, by_option, ordered
from taxel.detect.evidence import FIVE_FOLDS, Evidence, of_weak_bursts
from taxel.detect.examples import Example
from taxel.detect.fitting import UNLEARNT, Trained
from taxel.detect.folds import Judged
from taxel.detect.label_times import unlabelled_us
from taxel.detect.mistakes import Measured, many_wrong
from taxel.detect.plain_score import PlainScore
from taxel.detect.scoring import Mistake, Score
from taxel.encode import Moments

#: From this share of the time before the first label and behind the last one on, some labels may be missing there.
_UNLABELLED = 0.25
#: Kinds of touch are distinguished where chance would distinguish as many with at most this probability.
_CHANCE = 0.05
#: Part of a recording is off if so many labels are, which are missed; so many recordings are named.
_LEAST_OFF, _NAMED = 5, 5
#: Causes that do not say why labels have too few input spikes.
_NO_REASON = (
    "few_labels", "unlabelled_time", "unlabelled_loads", "durations", "plain_rule", "indistinct_kinds", "overfitting",
    "many_false", "unknown",
)  # fmt: skip


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
    plain : PlainScore, optional
        The scores of the plain rules on the labels of `scored`.
    mistakes : sequence of Mistake
        What `scored` calls missed and false, with a window of ...
    window_ms : float, ms
    tried : function of float, float (ms), optional
        Scores the same training in another window, with labels moved by so much, on the same folds.
    """

    trained: Trained
    scored: Score
    learnt: Score
    each: Sequence[Score] = ()
    plain: PlainScore | None = None
    mistakes: Sequence[Mistake] = ()
    window_ms: float = WINDOW_MS
    tried: Callable[[float, float], Judged] | None = None

    def causes(self, evidence: Evidence) -> tuple[Cause, ...]:
        """Return the causes for the labels of which more than 5 % are missed or false, those of most mistakes first."""
        wrong = {label: n for label, n in many_wrong(self.scored).items() if label in self.trained.readout.labels}
        each = self.each
        sources: dict[int, list[Cause]] = {}
        for label in wrong if not evidence.falls else ():
            for place, cause in self._of_sources(evidence.sound, label):
                sources.setdefault(place, []).append(cause)
        found = [cause for causes in sources.values() for cause in causes]
        mistakes = [mistake for mistake in self.mistakes if mistake.recording not in sources]
        beside = Measured(evidence.sound, mistakes, self.scored, self.window_ms, evidence.felt) if mistakes else None
        if sources:
            # All else is measured on the others.
            evidence, each = evidence.without(sources), [each[k] for k in range(len(each)) if k not in sources]
            for label in wrong:
                scores = (self.each[place].by_label.get(label) for place in sources)
                wrong[label] -= sum(score.rank[0] for score in scores if score is not None)
            wrong = {label: count for label, count in wrong.items() if count > 0}
        where = [] if beside is None or evidence.falls else beside.causes(wrong)
        late = [cause for label, count in wrong.items() for cause in self._felt_late(evidence, label, count)]
        where = late + [c for c in where if c.kind != "window" or all(c.labels != cause.labels for cause in late)]
        shown = self._tried_shifts([cause for cause in evidence.causes(wrong) if not self._contradicts(cause)])
        if not any(cause.kind in ("falling_values", "shifted_labels") for cause in shown):
            shown += _off_in_parts(evidence, each, wrong)
        where = self._tried_windows(where)
        wide = {c.labels for c in where if c.kind == "window" and 2 * c.mistakes >= wrong[c.labels[0]]}
        for cause in shown:
            # What a window mends needs no other tare. Whether labels are off or felt late is not known of those of one
            # name alone: a wider window keeps their times.
            mended = ("tare", "shifted_labels") if evidence.is_of_one_name else ("tare",)
            if cause.kind not in mended or cause.labels not in wide:
                found.append(cause)
        if not any(cause.kind in ("falling_values", "shifted_labels") for cause in found):
            for label, count in wrong.items():
                if not any(cause.kind == "label_name" and label in cause.labels for cause in found):
                    found += self._of_label(evidence, label, count, found, where)
        return ordered([cause for cause in found if cause.mistakes > 0])

    def _of_label(
        self, evidence: Evidence, label: str, wrong: int, found: Sequence[Cause], where: Sequence[Cause]
    ) -> list[Cause]:
        """Return what else concerns a label, beside what was found, and where its mistakes are."""
        known = [cause for cause in found if label in cause.labels]
        # A load that stays holds all labels.
        stays = any(cause.kind == "standing_load" for cause in known)
        where = [c for c in where if label in c.labels and not (stays and c.kind == "overlapping_loads")]
        causes = [*self._unlabelled_time(evidence.sound, label), *where]
        # Labels are far from what is felt where a tare does not fit, and where a load is felt late, too.
        unpaired = ("foreign_labels", "unfelt_labels", "tare", "standing_load")
        if not any(cause.kind in unpaired for cause in known) and label not in evidence.felt_apart:
            causes += self._unpaired(evidence.sound, label)
        explained = max(sum(c.mistakes for c in where), max((c.mistakes for c in (*known, *causes)), default=0))
        if any(cause.kind == "other_name" for cause in where) and (indistinct := list(self._indistinct(label, wrong))):
            return [*(cause for cause in causes if cause.kind != "other_name"), *indistinct]
        # What a training may learn otherwise is for what nothing else explains.
        rest = self._rule(label, wrong) if 2 * explained >= wrong else self._of_learning(label, wrong)
        return [*causes, *rest]

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
            if 2 * share(best) < 1:
                continue
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
                advice = f"a column source in the labels, with {other_name} in its rows"
                yield k, Cause("unlabelled_source", (label,), score.rank[0], measured, advice)

    def _unlabelled_time(self, examples: Sequence[Example], label: str) -> Iterator[Cause]:
        """Yield that events may lack labels before the first and behind the last, where that is much time."""
        (outside, total), scored = unlabelled_us(examples, label), self.scored[label]
        found = scored.false <= scored.missed and 2 * scored.found >= scored.events
        if not found and outside >= _UNLABELLED * total:
            yield Cause(
                "unlabelled_time",
                (label,),
                scored.rank[0],
                f"{outside / 1e6:.1f} of {total / 1e6:.1f} s are before the first or after the last label, and an "
                "event without its label counts as false: label these events too, or cut the recording (taxel cut) to "
                "the labelled part",
                "labels of all events",
            )

    def _felt_late(self, evidence: Evidence, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the window in which a plain rule halves what is wrong, as something is felt late or early."""
        if label not in evidence.felt_apart:
            return
        apart, (reach_ms, left) = evidence.felt_apart[label], evidence.felt_window(label)
        if self.window_ms < reach_ms and 2 * left <= wrong:
            option = f"--window-ms {reach_ms:g}"
            yield by_option("window", label, wrong - left, str(apart), option, window_ms=reach_ms)
        elif apart.changes_from_label:
            yield Cause("window", (label,), wrong, str(apart), "")

    def _tried_windows(self, where: Sequence[Cause]) -> list[Cause]:
        """Return causes with a wider window as advice only where a trial of it leaves at most half of the mistakes."""
        window_ms = max(
            (cause.arguments["window_ms"] for cause in where if cause.kind == "window" and cause.option), default=0.0
        )
        tried = None if self.tried is None or not window_ms else self.tried(window_ms, 0.0)
        return [self._with_trial(cause, window_ms, tried) if cause.kind == "window" else cause for cause in where]

    def _tried_shifts(self, shown: Sequence[Cause]) -> list[Cause]:
        """Return causes without shifts in a wider window, as of a hand, of which a trial leaves more mistakes."""
        tried: dict[str, Judged] = {}
        found = []
        for cause in shown:
            if cause.kind != "shifted_labels" or "window_ms" not in cause.arguments or self.tried is None:
                found.append(cause)
                continue
            if cause.option not in tried:
                tried[cause.option] = self.tried(cause.arguments["window_ms"], cause.arguments.get("shift_ms", 0.0))
            if left := _left(cause.labels[0], self.scored, tried[cause.option].together):
                found.append(replace(cause, measured=f"{cause.measured}; {left}"))
        return found

    def _with_trial(self, cause: Cause, window_ms: float, tried: Judged | None) -> Cause:
        """Return that mistakes are beyond the window, with what neuron or rule left of them within a wider one."""
        (label,), rules = cause.labels, None if tried is None or tried.plain is None else tried.plain.together
        for by, score in (("", None if tried is None else tried.together), ("the plain rule leaves ", rules)):
            if cause.option and score is not None and (left := _left(label, self.scored, score, by)):
                option = f"--window-ms {window_ms:g}{' --rule FILE' * bool(by)}"
                advice = f"a wider window and the plain rule ({option})" if by else option
                measured, arguments = f"{cause.measured}; {left}", {"window_ms": window_ms}
                return replace(cause, measured=measured, advice=advice, option=option, arguments=arguments)
        return replace(cause, advice="", option="", arguments={})

    def _contradicts(self, cause: Cause) -> bool:
        """Whether most labels that are as of another recording by what was felt were found held out."""
        return cause.kind == "foreign_labels" and any(
            2 * score[label].found > score[label].events for score in self._by.values() for label in cause.labels
        )

    @property
    def _by(self) -> dict[str, Score]:
        """The scores of the neuron and, if there is one, of the plain rule."""
        rule = None if self.plain is None else self.plain.together
        return {"the neuron": self.scored} | ({} if rule is None else {"the rule": rule})

    def _unpaired(self, examples: Sequence[Example], label: str) -> Iterator[Cause]:
        """Yield how many labels are far from what the neuron learnt them by, or are weaker than that."""
        alignment = self.trained.alignments.get(label)
        if alignment is None or not (unpaired := int(alignment.unpaired.sum())):
            return
        mistakes = min(unpaired, self.scored[label].missed)
        if (weaker := of_weak_bursts(examples, label, alignment, mistakes)) is not None:
            yield weaker
            return
        measured = f"no input that {label} is learnt from is within {WINDOW_MS:.0f} ms of {counted(unpaired, 'label')}"
        yield Cause("unfelt_labels", (label,), mistakes, measured, "")

    def _of_learning(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the causes where labels and tares are right: inputs, kinds, too few examples; or that there is none."""
        if rules := list(self._rule(label, wrong)):
            yield from rules
            return
        if indistinct := list(self._indistinct(label, wrong)):
            yield from indistinct
            return
        alone = self.learnt[label]
        if 2 * alone.rank[0] <= wrong:
            measured = (
                f"on the training data {alone.missed} of {counted(alone.events, 'label')} {are(alone.missed)} missed, "
                f"and {counted(alone.false, 'detection')} {are(alone.false)} false"
            )
            yield Cause("overfitting", (label,), wrong, measured, "more labels")
            return
        yield Cause("unknown", (label,), wrong, "no cause was found in the data", "")

    def _indistinct(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield that neuron and rule tell no more of a kind of touch than chance would."""
        moments = any(isinstance(encoder, Moments) for encoder in self.trained.recipe.encoder._each())
        if moments and (chance := self._by_chance(label)):
            measured = (
                f"{chance}, from moments of the frame, for example area, load and centre, and from how long a touch "
                "lasts; taxel information shows whether the kinds differ otherwise; the labels may also be few or "
                "mixed up"
            )
            yield Cause("indistinct_kinds", (label,), wrong, measured, "other kinds")

    def _by_chance(self, label: str) -> str:
        """Return how many of a kind are detected, where chance would detect as many and they are enough; else ""."""
        shares = [_by_chance(label, who, score) for who, score in self._by.items()]
        enough = self.scored[label].events >= FIVE_FOLDS
        return ", ".join(shares) + ", no better than chance" if enough and all(shares) else ""

    def _rule(self, label: str, wrong: int) -> Iterator[Cause]:
        """Yield the plain rule if it halves the mistakes."""
        if self.plain is None or self.plain.together is None or label not in self.plain.better(self.scored):
            return
        left, rule = self.plain.together[label].rank[0], self.plain.rules[label]
        if 2 * left > wrong:
            return
        measured = f"leaves {left} missed and false on the same labels; the neuron leaves {wrong}"
        lasting = rule is not None and isinstance(rule.age_ms, str)
        measured = (
            f"it {measured}{'; the rule knows how long touches last' * lasting}; taxel detect --readout FILE runs the "
            "rule"
        )
        kind = "durations" if lasting else "plain_rule"
        yield Cause(kind, (label,), wrong - left, measured, "the plain rule (--rule FILE)", "--rule FILE")


def by_recipe(name: str, scored: Score, tried: Score, causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return causes with that another recipe, which was tried on the same folds, makes at most half the mistakes."""
    found = [
        by_option("recipe", label, wrong - tried[label].rank[0], measured, f"--recipe {name}", recipe=name)
        for label, wrong in many_wrong(scored).items()
        if (measured := _left(label, scored, tried))
    ]
    return ordered([*causes, *found])


def _left(label: str, scored: Score, tried: Score, by: str = "") -> str:
    """Return what a trial on the same folds left of a label's mistakes, if it is at most half of them; else ""."""
    left, left_now = (f"{score[label].missed} missed, {score[label].false} false" for score in (tried, scored))
    halved = 2 * tried[label].rank[0] <= scored[label].rank[0]
    return f"tried on the same folds: {by}{left}, while this training has {left_now}" if halved else ""


def without_explained(warnings: Sequence[str], causes: Sequence[Cause]) -> tuple[str, ...]:
    """Return warnings without those of too few input spikes where a cause of the same label explains them."""
    known = tuple(f"{escaped(label)}: " for c in causes if c.kind not in _NO_REASON for label in c.labels)
    return tuple(text for text in warnings if not (UNLEARNT in text and text.startswith(known)))


def with_settings(warnings: Sequence[str], given: Mapping[str, Any]) -> tuple[str, ...]:
    """Return warnings with the settings that were given, where events have too few input spikes."""
    settings = ", ".join(f"{key}={value}" for key, value in given.items())
    ending = f"; settings that were given: {settings}" * bool(settings)
    return tuple(f"{text}{ending}" if UNLEARNT in text else text for text in warnings)


def _off_in_parts(evidence: Evidence, each: Sequence[Score], wrong: Mapping[str, int]) -> Iterator[Cause]:
    """Yield in which parts of several recordings labels are off, if these have most mistakes."""
    if len(each) != len(evidence.sound) or len(each) == 1:
        return
    found: dict[str, list[tuple[str, Cause]]] = {label: [] for label in wrong}
    for k, (example, score) in enumerate(zip(evidence.sound, each, strict=True)):
        many = {label: s.rank[0] for label in wrong if (s := score.by_label.get(label)) and s.missed >= _LEAST_OFF}
        alone = evidence.without([place for place in range(len(each)) if place != k]) if many else None
        for cause in alone.causes(many) if alone is not None else ():
            if cause.kind == "shifted_labels" and ("shift_ms" in cause.arguments or not cause.option):
                found[cause.labels[0]].append((example.name, cause))
    for label, parts in found.items():
        mistakes = sum(cause.mistakes for _, cause in parts)
        if 2 * mistakes > wrong[label]:
            more = f" and of {counted(len(parts) - _NAMED, 'other recording')} alike" if len(parts) > _NAMED else ""
            advice = ", ".join(f"of {name} {_moved(cause)}" for name, cause in parts[:_NAMED])
            measured = "; ".join(f"{name}: {cause.measured.partition(', all ')[0]}" for name, cause in parts[:_NAMED])
            yield Cause("shifted_labels", (label,), mistakes, measured, f"to move the labels {advice}{more}")


def _moved(cause: Cause) -> str:
    """Return how the labels of a recording are to be moved."""
    ms = cause.arguments.get("shift_ms", 0.0)
    distance = f"{abs(ms):.0f} ms {'earlier' if ms < 0 else 'later'}"
    return distance if cause.option else cause.advice.removeprefix("to move the labels ").removeprefix("of ")


def _by_chance(label: str, who: str, together: Score) -> str:
    """Return how many touches of a kind are detected, and how many others as it, where chance may do so.

    Fisher's exact test, one-sided. Every false detection counts as one at a touch of another kind.
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
    return f"{who} recognises {right} of {kind.events} and mistakes {taken} of {others} others for {label}"
