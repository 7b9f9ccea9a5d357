"""The result of a training, as lines for people and as plain values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from shlex import quote
from typing import Any

import numpy as np

from taxel._base.arguments import text
from taxel._base.messages import collected, counted, three_digits
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.detect import Judged, Outcome, Readout, Score, Trained, recipes
from taxel.detect.examples import unreliable
from taxel.detect.levels import LEAST_LEVELS
from taxel.detect.scoring import score_rows
from taxel.encode import TouchEnds
from taxel.options import TrainOptions
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.spikes import to_ms, to_us
from taxel.tare import Tare
from taxel.tasks.rest import rest

#: Largest number of unpaired labels that a warning names.
_NAMED = 5
#: Detections are known late that are known so long after their label, ms.
_LATE_MS = 500.0
#: The width of a line.
_WIDTH = 160
#: What the written readout detects a label by.
_RUNS = "; runs"
#: Readouts know at other times whose delays differ by more, ms.
_APART_MS = 1.0


@dataclass(frozen=True, eq=False)
class Training:
    """Hold what a training made, and how it scored.

    Attributes
    ----------
    options : TrainOptions
        With the recipe that was chosen.
    recordings : sequence of Recording
        Those that were trained on: each sensor is one.
    made : taxel.detect.Trained
        The readout, its recipe and learners, and by how much labels were moved.
    scored : taxel.detect.Judged
        The scores of each recording and of all, and of the plain rules beside them.
    why : str
        Why the scores are those on the training data; empty where they are held out.
    outcomes : sequence of taxel.detect.Outcome
        What the readout detects in its own training data.
    tares_us : sequence of (int, int, int), us
        From when to when the tare of each recording was taken from it, and how long it lasts; none of given tares.
    warned : tuple of str
        The warnings of the training, and, where more than 5 % of the labels of a name are missed or false, by how much
        labels are off what was felt, and what is the matter with the sensor.
    unlabelled : mapping of str to tuple of str
        The sources that no row of the labels names, by label, where rows name sources: they are neither trained nor
        scored for it.
    """

    options: TrainOptions
    recordings: Sequence[Recording]
    made: Trained
    scored: Judged
    why: str
    outcomes: Sequence[Outcome]
    tares_us: Sequence[tuple[int, int, int]]
    warned: tuple[str, ...] = ()
    unlabelled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def readout(self) -> Readout:
        """The trained readout."""
        return self.made.readout

    @property
    def score(self) -> Score:
        """The score over all recordings."""
        return self.scored.together

    @property
    def held_out(self) -> bool:
        """Whether the score is that of data that the neurons were not trained on."""
        return not self.why

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the training, and the labels that the readout detects no better than one of nothing."""
        return (*self.warned, *self.unreliable())

    @property
    def how(self) -> str:
        """On which data the readout was scored, for the report, which shows its detections in the training data."""
        if self.why:
            return "on its own training data"
        score = self.scored.together
        counts = f"{score.found} of {score.events} found, {score.missed} missed, {score.false} false"
        return f"on its own training data; held out ({self.scored.how}): {counts}"

    def __repr__(self) -> str:
        return f"Training({self.readout!r}; {self.how})"

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values for JSON."""
        several = len({recording.label for recording in self.recordings}) > 1
        result: dict[str, Any] = {
            "labels": list(self.readout.labels),
            "recipe": self.options.recipe,
            "judged_on": self.scored.how,
            "held_out": self.held_out,
            "window_ms": self.options.window_ms,
            "recordings": [
                {"recording": recording.title, "score": score.to_dict()}
                for recording, score in zip(self.recordings, self.scored.scores, strict=True)
            ],
            "score": self.scored.together.to_dict(),
            "neurons": (self.scored.neurons or self.scored.together).to_dict(),
            "by_rule": list(self.readout.by_rule),
            "mistakes": [
                {
                    "recording": self.recordings[k].name,
                    "source": self.recordings[k].label if several else "",
                    "label": label,
                    "t_us": t,
                    "missed": is_missed,
                }
                for k, label, t, is_missed in self.scored.mistakes
            ],
            "plain_rule": None if self.scored.plain is None else self.scored.plain.to_dict(),
            "shift_ms": self.options.shift_ms,
            "fitted_levels": list(self.fitted_levels),
            "chosen": dict(self.made.chosen),
            "warnings": list(self.warnings),
            "unlabelled": {label: list(sources) for label, sources in self.unlabelled.items()},
        }
        if self.made.alignments:
            result["alignment"] = {label: aligned.to_dict() for label, aligned in self.made.alignments.items()}
            for aligned in result["alignment"].values():
                unpaired = aligned["unpaired"]
                aligned["unpaired"] = [{"recording": self.recordings[k].title, "t_us": t} for k, t in unpaired]
        return result

    def lines(self) -> list[str]:
        """Return the result as lines for people; the first says whether the scores are held out."""
        window, recipe = f"(window {self.options.window_ms:g} ms)", self.options.recipe
        lines = [f"not held out, but scored on its own training data {window}: {self.why}"]
        if self.held_out:
            lines = [f"held out: {self.scored.how} {window}"]
        for label, sources in self.unlabelled.items():
            lines.append(f"{label}: neither trained nor scored on {', '.join(sources)}, which no row of labels names")
        for label in self.readout.labels:
            lines += self._scores(label)
        lines += self._aligned()
        if self.options.shift_ms:
            lines.append(f"labels moved by {self.options.shift_ms:+g} ms before training (--shift-ms)")
        lines += self._kinds()
        if recipe is not None:
            about = self.made.recipe.about
            lines.append(_cut(f"recipe {recipe}" + (f": {about}" if about else "")))
        lines += [*self._levels(), *self._tares(), _cut(repr(self.readout))]
        lines += ["", *repr(self.scored.together).split("\n")]
        if len(self.scored.scores) > 1:
            titles = [recording.title for recording in self.recordings]
            lines += ["", *score_rows(zip(titles, self.scored.scores, strict=True))]
        return lines

    def command(self, readout: str) -> str:
        """Return the command that detects by the readout in a file, with the tare, if any, of the training.

        "" if the readout cannot be relied on.

        Parameters
        ----------
        readout : str
            The file's name, as the command gives it.

        Raises
        ------
        ProblemError : no text
        """
        readout = text("readout", readout)
        if any(self.unreliable()):
            return ""
        tare = "FILE" if isinstance(self.options.tare, Tare) else self.options.tare
        if tare is None:
            tare = "" if _are_quiet(self.recordings) else self._beginning()
        option = f" --tare {quote(str(tare))}" if tare and self.readout._needs_tare else ""
        return f"taxel detect RECORDING --readout {quote(readout)}{option}"

    def _beginning(self) -> str:
        """Return the seconds at rest at the beginning of each recording, for ``--tare``; "" where none is needed."""
        if not self.tares_us or any(begin > 0 for begin, *_ in self.tares_us):
            return "SECONDS" if self.tares_us else ""
        # More than half of a recording is refused.
        return f"{min(min(end, lasts // 2) for _, end, lasts in self.tares_us) / 1e6:g}"

    @property
    def fitted_levels(self) -> tuple[float, ...]:
        """The levels of the encoder if they are of the training data, in the sensor's unit; else none."""
        return tuple(self.made.recipe.encoder.levels) if self.made.fitted_levels else ()  # type: ignore[attr-defined]

    def _kinds(self) -> Iterator[str]:
        """Yield the labels that are learnt as kinds of touch, and what ends of touches are called."""
        recipe = self.options.recipe
        if recipe is not None and (kinds := recipes.kinds(recipe, self.readout.labels)):
            yield (
                f"{', '.join(kinds)}: learnt as a kind of touch, and detected at an age of the touch; a label of the "
                f"beginning of a touch must be named {recipes.names_of(recipe, 'contact')}; a label of its end, "
                f"{recipes.names_of(recipe, 'lift')}"
            )

    def _levels(self) -> Iterator[str]:
        """Yield the levels and the noise floor that the training data gave, if they did."""
        if self.made.raised_floor is not None:
            yield (
                f"noise floor: {self.made.raised_floor:g} {self.readout.unit}, more than the noise requires, because "
                "touches then begin and end nearer to the labels; some sensors also read what only comes near them; "
                "--set encoders.NAME.noise_floor=... sets another"
            )
        if self.fitted_levels:
            levels = ", ".join(f"{level:g}" for level in self.fitted_levels)
            yield (
                f"levels: {levels} {self.readout.unit}, from the training data, because fewer than {LEAST_LEVELS} "
                "levels of the recipe are within the range that loaded taxels read; --set encoder.levels=[...] sets "
                "others"
            )

    def _tares(self) -> Iterator[str]:
        """Yield the line of which tares were taken from the recordings."""
        if not self.tares_us:
            return
        lengths = [to_ms(end - begin) for begin, end, _ in self.tares_us]
        text = f"measured separately in each of {len(lengths)} recordings, for {min(lengths):g} to {max(lengths):g} ms"
        if len(lengths) == 1:
            text = "measured in the recording from {:g} to {:g} ms".format(*map(to_ms, self.tares_us[0][:2]))
        yield f"tare: {text}; --tare sets another tare"

    def _scores(self, label: str) -> Iterator[str]:
        """Yield how the neuron and the plain rule of a label scored on the same labels, and which of them runs."""
        parts = self.readout.encoder_of(label)._each()
        when = "when the touch ends" if any(isinstance(part, TouchEnds) for part in parts) else ""
        by_rule, plain = label in self.readout.by_rule, self.scored.plain
        rule = None if plain is None else plain.rules[label]
        neuron = (self.scored.neurons or self.scored.together)[label]
        yield _line(label, "neuron", neuron, when) + self._written(label) + _RUNS * (rule is not None and not by_rule)
        if plain is None or plain.together is None:
            yield f"no plain rule for {label}" + (f": {plain.lacks}" if plain is not None else "")
        elif rule is None:
            yield f"no plain rule for {label}: none is better than to detect nothing"
        else:
            yield _line(label, "plain rule", plain.together[label]) + _RUNS * by_rule
            yield _cut(f"  tuned on all: {rule._compared()}")
        if plain is not None and plain.own is not None and (own := plain.own[0][label]) is not None:
            yield _line(label, "the labels' own rule", plain.own[1][label]) + f": {own._compared()}"

    def _written(self, label: str) -> str:
        """Return when the readout that is written knows, where folds chose other ages of a touch; else ""."""
        folds = [trained.readout.neurons for trained in self.scored.trained]
        delay_ms = self.readout.neurons[label].delay_ms
        if all(abs(delay_ms - neurons[label].delay_ms) <= _APART_MS for neurons in folds if label in neurons):
            return ""
        scores = [outcome.score.by_label[label] for outcome in self.outcomes if outcome.score is not None]
        known_ms = np.concatenate([score.delays_ms for score in scores])
        return (
            f"; for the readout that is written, {three_digits(float(np.median(known_ms)), '+')} ms"
            if len(known_ms)
            else ""
        )

    def unreliable(self) -> Iterator[str]:
        """Yield the labels of which the readout misses most, or detects no more than one of nothing."""
        labels = "labels that it was trained on" if self.why else "held-out labels"
        for label in self.readout.labels:
            if text := unreliable(label, self.scored.together[label], labels):
                yield text

    def _aligned(self) -> Iterator[str]:
        """Yield by how much labels were moved to what the sensor felt, and which found no pair."""
        for label, alignment in self.made.alignments.items():
            if alignment.train is None:
                yield f"{label}: no input follows the labels, so they were learnt as given"
                continue
            yield (
                f"{label}: labels moved to what the sensor felt: median {three_digits(alignment.median_ms, '+')} ms, "
                f"largest {three_digits(alignment.largest_ms, '+')} ms"
            )
            unpaired = ((self.recordings[k], t) for k, t in alignment.to_dict()["unpaired"])
            events = [
                f"{recording.title} at {(t - beginning_us(recorded(recording, hold=False).t)) / 1e6:.3f} s"
                for recording, t in unpaired
            ]
            if events:
                more = f" and {len(events) - _NAMED} more" if len(events) > _NAMED else ""
                labels = counted(len(events), "label")
                named = ", ".join(events[:_NAMED]) + more
                yield (
                    f"{label}: no input that {label} is learnt from is within 50 ms of {labels}, which "
                    f"{'was' if len(events) == 1 else 'were'} not learnt: {named}"
                )


def _are_quiet(recordings: Sequence[Recording]) -> bool:
    """Return whether a detection finds the rest of each recording by itself."""
    try:
        with collected():
            return all(rest(recording) for recording in recordings)
    except ProblemError:
        return False


def _cut(line: str) -> str:
    """Return a line of at most `_WIDTH` characters."""
    return line if len(line) <= _WIDTH else f"{line[: _WIDTH - 3]}..."


def _line(label: str, by: str, score: Score, when: str = "") -> str:
    """Return a score; `when` its detections are known, if that is late."""
    known = "never known"
    if score.found:
        median_ms, most_ms = score.delay.median, float(score.delays_ms.max())
        known = f"known {three_digits(median_ms, '+')} ms after the label (median)"
        if median_ms >= _LATE_MS:
            late = (
                f"known {to_us(median_ms) / 1e6:.1f} s after the label (median; at most {to_us(most_ms) / 1e6:.1f} s)"
            )
            known = f"{late}, {when}".removesuffix(", ")
    return f"{label}, {by}: {score.found} of {score.events} found, {score.missed} missed, {score.false} false, {known}"
