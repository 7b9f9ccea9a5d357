"""What helps a training of which many events are missed or false: other labels, tare or recipe, the rule, a search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from taxel import _core
from taxel._base.messages import counted
from taxel.detect import recipes
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.examples import Example, check_examples
from taxel.detect.fitting import TWO_FOLDS, Trained
from taxel.detect.label_times import TOUCH, Off, held_by_tare, off_by, unlabelled_us
from taxel.detect.loads import lacks_neighbours
from taxel.detect.plain_score import PlainScore, floor_of
from taxel.detect.scoring import Score
from taxel.encode import ContactArea, Encoder, Moments
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import of_frames
from taxel.spikes import SpikeTrains, to_ms
from taxel.tare import Tare

#: From which share of the events on missed or false ones are many.
_MANY = 0.05
#: How long before a label the sensor is looked at, us: as long as a tare ends before the first label.
_BEFORE_US = 20_000
#: How many labels at either end of a recording are looked at.
_LABELS = 4
#: Five folds need this many labels.
_FIVE_FOLDS = 10
#: Into so many parts a recording is divided to see a drift, at so many frames of each.
_PARTS, _LOOKS = 8, 40
#: A touched taxel reads so many times its drift.
_TIMES = 4
#: From this share of the time before the first label and behind the last one on, some labels may be missing there.
_UNLABELLED = 0.25
#: Kinds of touch are told apart where chance would tell as many with at most this probability.
_CHANCE = 0.05


class Advice(NamedTuple):
    """What may help a label, how that is known, and the option of `taxel train` that it is."""

    helps: str
    because: str
    option: str | None = None


def advise(
    trained: Trained,
    examples: Sequence[Example],
    scored: Score,
    learnt: Score,
    search_s: float | None,
    plain: PlainScore | None = None,
) -> dict[str, Advice]:
    """Return what may help each label of which more than 5 % are missed or false.

    A layout file that turns values which fall from their rest, and nothing else then. Other times of the labels where
    most of them lie at one distance of more than 50 ms from what the sensor felt. More labels where there are fewer
    than four. Labels of all events where more are false than missed or less than half is found, and a quarter of the
    time or more lies before the first label or behind the last. Another name where none is found of a label that no
    input follows, as it was learnt as a kind of touch. The recipe that fits recording and labels, if a named one was
    taken that does not. Another tare where it holds a touch, where taxels read above their rest before touches begin,
    or where nothing was felt of most labels that are missed; or other labels, where nothing was felt of most. Else the
    plain rule, where it makes at most half the mistakes on the same labels; or the recipe that learns from the same
    quantities, if this one does not. For contact and lift of channels, and kinds of touch that they do not tell, their
    distance. Other kinds of touch where neither neuron nor rule tells more of them than chance would. Else more labels,
    where on its own training data the readout makes at most half the mistakes, as it learnt by heart what these data
    have. Else a search of other parameters, if the recipe lists any.

    Parameters
    ----------
    trained : Trained
    examples : sequence of Example
        The training data.
    scored, learnt : Score
        Held out, and on the training data.
    search_s : float, s, optional
        How long a search tries one set of parameters of every label; None after a search.
    plain : PlainScore, optional
        Of the plain rules, on the labels that `scored` is of.
    """
    many = [
        label
        for label, score in scored.by_label.items()
        if label in trained.readout.labels and max(score.missed, score.false) > _MANY * score.events
    ]
    if not many:
        return {}
    if fall := fallen(examples):
        return dict.fromkeys(many, Advice("falls = true in a layout file", fall))
    sound, encoder = check_examples(examples), trained.recipe.encoder
    off, touched = off_by(sound, many, floor_of(encoder)), held_by_tare(sound, floor_of(encoder))
    known = _Evidence(trained, sound, scored, learnt, search_s, plain, off, touched, loaded_at_rest(examples, encoder))
    recipe = _other_recipe(trained, examples)
    return {
        label: known.of_labels(label, recipe)
        or known.of_time(label)
        or known.of_name(label)
        or known.of_tare(label)
        or known.of_mistakes(label)
        for label in many
    }


@dataclass(frozen=True)
class _Evidence:
    """Hold what is known of a training: as in `advise`, and of labels and tares what is off, held or loaded."""

    trained: Trained
    examples: Sequence[Example]
    scored: Score
    learnt: Score
    search_s: float | None
    plain: PlainScore | None
    off: Mapping[str, Off]
    held: int
    loaded: int

    def of_labels(self, label: str, recipe: Advice | None) -> Advice | None:
        """Return what is wrong with labels, if anything is: their times, their number, or the recipe that they have."""
        if label in self.off:
            because = f"{self.off[label]}, and are aligned within {WINDOW_MS:.0f} ms only"
            return Advice("other times of the labels", because)
        scored = self.scored[label]
        if scored.events < TWO_FOLDS:
            there = f"there {'is' if scored.events == 1 else 'are'} {scored.events}"
            return Advice(
                "more labels", f"{there}; {TWO_FOLDS} are the least to score it held out, {_FIVE_FOLDS} for five folds"
            )
        return recipe

    def of_time(self, label: str) -> Advice | None:
        """Return that events may lack labels before the first and behind the last, where much time lies there."""
        (outside, total), scored = unlabelled_us(self.examples, label), self.scored[label]
        found = scored.false <= scored.missed and 2 * scored.found >= scored.events
        if found or outside < _UNLABELLED * total:
            return None
        return Advice(
            "labels of all events",
            f"{outside / 1e6:.1f} of {total / 1e6:.1f} s lie before the first or behind the last one, and an event "
            "without its label counts as false: label those too, or cut the recording (taxel cut) to what is labelled",
        )

    def of_name(self, label: str) -> Advice | None:
        """Return that a label without its name may be the end of a touch, where it was learnt as a kind of touch."""
        alignment = self.trained.alignments.get(label)
        kinds = self.trained.recipe.about == recipes.read("touch")["about"] and not recipes.knows("touch", label)
        if not kinds or self.scored[label].found or alignment is None or alignment.train is not None:
            return None
        ends = ", ".join(("lift", *(name for name, kind in recipes.read("touch")["also"].items() if kind == "lift")))
        because = (
            f"by this one it is learnt as a kind of touch, told as one begins; names of the end of a touch are {ends}"
        )
        return Advice("another name of the label", because)

    def of_tare(self, label: str) -> Advice | None:
        """Return what is wrong with a tare, if anything is."""
        alignment, scored = self.trained.alignments.get(label), self.scored[label]
        if self.held >= TOUCH:
            late_ms = 0.0 if alignment is None or alignment.train is None else -alignment.median_ms
            why = f", as labels lie {late_ms:.0f} ms after what was felt (median)" * (late_ms > to_ms(_BEFORE_US))
            return Advice(
                "another tare", f"it holds a touch of {self.held} taxels{why}; give one of seconds, or a file", "--tare"
            )
        if self.loaded >= TOUCH:
            return Advice(
                "another tare", f"{self.loaded} taxels read above theirs while nothing touches them", "--tare"
            )
        if alignment is None:
            return None
        # Where no input follows the labels none was moved.
        labels = len(alignment.given)
        unfelt = labels if alignment.train is None else int(alignment.unpaired.sum())
        if 2 * unfelt > labels and 2 * scored.found < scored.events:
            return Advice(
                "other labels, or another tare",
                f"nothing was felt of {unfelt} of {counted(labels, 'label')}: they are of another recording, or their "
                "times are off by more than 50 ms, each by another time, or they name what the sensor does not feel",
            )
        if alignment.train is not None and 2 * unfelt > scored.missed + scored.false:
            return Advice(
                "another tare",
                f"nothing was felt of {counted(unfelt, 'label')}, unless their times are off by more than 50 ms, each "
                "by another time, or they are of another recording",
            )
        return None

    def of_mistakes(self, label: str) -> Advice:
        """Return what helps against the mistakes of a readout whose labels and tares are right."""
        alone, chance = self.learnt[label], _chance(label, self.scored, self.plain)
        points = len(self.trained.recipe.points_of(label))
        wrong, learnt = self.scored[label].rank[0], alone.rank[0]
        rules = None if self.plain is None or label not in self.plain.better(self.scored) else self.plain.together
        if rules is not None and 2 * rules[label].rank[0] <= wrong:
            return _by_rule(self.trained, rules[label].rank[0], wrong)
        if lacks_neighbours(self.examples) and (_for_touch(self.trained) or chance):
            array = self.trained.readout.array
            size = "ROWSxCOLUMNSxMM" if array is None else f"{array.rows}x{array.columns}xMM"
            because = "channels in a row at a known distance, MM mm, have neighbours; then the recipe touch fits"
            return Advice(f"--array {size}", because, "--array")
        if chance and any(isinstance(encoder, Moments) for encoder in self.trained.recipe.encoder._each()):
            return Advice(
                "other kinds",
                f"{chance}: the inputs of this recipe are moments of the frame, as area and load, and its centre, "
                "which is tried where these tell too few; where kinds differ otherwise, --recipe gait_plate, whose "
                "inputs are the taxels, may tell them, and taxel information says whether they differ; or labels are "
                "few or mixed up",
                "--recipe",
            )
        if self.search_s is not None and 2 * learnt > wrong and points > 1:
            because = f"it tries {points} sets of parameters, in about {points * self.search_s:.0f} s"
            return Advice("--search", because, "--search")
        return Advice("more labels", f"of those that it learnt {alone.missed} are missed, and {alone.false} are false")


def _other_recipe(trained: Trained, examples: Sequence[Example]) -> Advice | None:
    """Return the recipe that fits recording and labels, if another named one was trained by."""
    used = next((name for name in recipes.names() if recipes.read(name)["about"] == trained.recipe.about), None)
    source = recorded(examples[0].source)
    if used is None or isinstance(source, SpikeTrains):
        return None
    fits, why = recipes.chosen(source, trained.readout.labels)
    if fits == used:
        return None
    return Advice(f"--recipe {fits}", f"it is made for {why}; this training took {used}", "--recipe")


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


def _for_touch(trained: Trained) -> bool:
    """Whether all labels are those of the recipe `touch`, contact and lift: not contact and foot off."""
    return all(recipes.knows("touch", label) for label in trained.readout.labels)


def _by_rule(trained: Trained, left: int, wrong: int) -> Advice:
    """Return the recipe that has the inputs of plain rules, if this one has not; else the rule itself."""
    because = f"leaves {left} missed and false on the same labels, the neuron {wrong}"
    if _for_touch(trained) and not any(isinstance(encoder, ContactArea) for encoder in trained.recipe.encoder._each()):
        return Advice("--recipe touch", f"the plain rule, which has its inputs, {because}", "--recipe")
    return Advice(
        "the plain rule", f"it {because}; taxel train --rule FILE writes it, and taxel detect runs it", "--rule"
    )


def fallen(examples: Sequence[Example]) -> str:
    """Return that the values of an example fall from their rest, and what turns them; "" where none do."""
    for example in examples:
        source = recorded(example.source, hold=False)
        if isinstance(source, Frames) and (rest := of_frames(source)).falls:
            return f"{example.name}: " * bool(example.name) + rest.fall(getattr(example.source, "path", None))
    return ""


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
    frames, came there little by little, and reads four times as much while it is touched: a load that stays comes at
    once, or is all that a taxel reads. A quarter of the taxels that were touched must do so, and two at least.

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
    frames = frames[:: max(1, len(frames) // (_PARTS * _LOOKS))]
    looks = len(frames) // _PARTS
    if looks < _LOOKS // 4:
        return 0
    values = tare.off(frames).values[: _PARTS * looks]
    above, most = _core.touched_above(noise_floor), values.max(axis=0)
    least = np.quantile(values.reshape(_PARTS, looks, *most.shape), 0.1, axis=1)
    slowly = np.diff(least, axis=0).max(axis=0) <= least[-1] / 2
    count = np.count_nonzero((least[0] < above) & (least[-1] >= above) & slowly & (most >= _TIMES * least[-1]))
    return int(count) if count >= max(TOUCH, np.count_nonzero(most >= _TIMES * above) / _TIMES) else 0
