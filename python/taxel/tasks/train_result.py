"""The result of a training, as lines for people and as plain values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from shlex import quote
from typing import Any

import numpy as np

from taxel._base.arguments import text
from taxel._base.messages import counted, three_digits
from taxel.detect import Judged, Outcome, Readout, Score, Trained, recipes
from taxel.detect.changes import CHOOSING, TOMORROW
from taxel.detect.examples import unreliable
from taxel.detect.scoring import score_rows
from taxel.options import TrainOptions
from taxel.recording import Recording
from taxel.recording.analysis.rest import Rest
from taxel.recording.cut import span_us
from taxel.spikes import to_ms, to_us
from taxel.tare import Tare
from taxel.tasks.intervals import ByIntervals, by_intervals

#: Detections are known late that are known so long after their label, ms.
_LATE_MS = 500.0
#: The width of a line, and how many are before the table.
_WIDTH, _MOST_LINES = 160, 15


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
    rests : sequence of Rest
        The rest of each recording.
    warned : tuple of str
        The warnings of the training, and, where more than 5 % of the labels of a name are missed or false, by how much
        labels are off what was felt, and what is the matter with the sensor.
    unlabelled : tuple of str
        The sources that no row of the labels names, where rows name sources: they are left out.
    constants_ms : mapping of str to float, ms
        By how much the labels of a name were later than what was felt, of those that were: it is taken off.
    held_by : str
        The column of which recordings of one value were held out together; "": each recording alone.
    """

    options: TrainOptions
    recordings: Sequence[Recording]
    made: Trained
    scored: Judged
    why: str
    outcomes: Sequence[Outcome]
    rests: Sequence[Rest]
    warned: tuple[str, ...] = ()
    unlabelled: tuple[str, ...] = ()
    constants_ms: Mapping[str, float] = field(default_factory=dict)
    held_by: str = ""

    @property
    def readout(self) -> Readout:
        """The trained readout."""
        return self.made.readout

    @property
    def score(self) -> Score:
        """The score over all recordings."""
        return self.scored.together

    @property
    def learnt(self) -> tuple[str, ...]:
        """The labels of which the readout finds half or more, with fewer missed and false than there are labels."""
        of_label = self.score.by_label
        sound = {name for name, part in of_label.items() if part.events and not unreliable(name, part, "labels")}
        return tuple(name for name in self.readout.labels if name in sound)

    @property
    def held_out(self) -> bool:
        """Whether the score is that of data that the neurons were not trained on."""
        return not self.why

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the training, and the labels that the readout detects no better than one of nothing."""
        return (*self.warned, *self.unreliable())

    def by_intervals(self) -> dict[str, ByIntervals]:
        """Return the score by intervals of the labels that have ends."""
        of = [(each.example, found) for each, found in zip(self.outcomes, self.scored.found, strict=True)]
        lasting = {label for example, _ in of for label in example.spans}
        none, early = np.empty((0, 2), np.int64), np.array([round(to_us(self.options.window_ms)), 0])
        return {
            label: by_intervals(
                # A detection may be before its label, as far as the window allows.
                (found[found.label == label].t, example.spans.get(label, none) - early, span_us(recording))
                for (example, found), recording in zip(of, self.recordings, strict=True)
            )
            for label in sorted(lasting)
        }

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
            "held_by": self.held_by or None,
            "window_ms": self.options.window_ms,
            "recordings": [
                {"recording": recording.title, "score": score.to_dict()}
                for recording, score in zip(self.recordings, self.scored.scores, strict=True)
            ],
            "score": self.scored.together.to_dict(),
            "neurons": self.scored.neurons.to_dict(),
            "by_rule": list(self.readout.by_rule),
            "choices": {label: choice.to_dict() for label, choice in self.scored.choices.items()},
            "by_intervals": {label: one._asdict() for label, one in self.by_intervals().items()},
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
            "plain_rule": self.scored.plain.to_dict(),
            "rests": [taken.to_dict() for taken in self.rests],
            "shift_ms": self.options.shift_ms,
            "constants_ms": dict(self.constants_ms),
            "warnings": list(self.warnings),
            "unlabelled": list(self.unlabelled),
        }
        if self.made.alignments:
            result["alignment"] = {label: aligned.to_dict() for label, aligned in self.made.alignments.items()}
            for aligned in result["alignment"].values():
                unpaired = aligned["unpaired"]
                aligned["unpaired"] = [{"recording": self.recordings[k].title, "t_us": t} for k, t in unpaired]
        return result

    def lines(self) -> list[str]:
        """Return the result as lines for people; the first says whether the scores are held out.

        Before the table are at most 15 lines of 160 characters.
        """
        window = f"(window {self.options.window_ms:g} ms)"
        first = f"not held out, but scored on its own training data {window}: {self.why}"
        if self.held_out:
            first = f"held out: {self.scored.how} {window}"
            if self.held_by:
                first += f", no {self.held_by} on both sides"
            elif len({recording.title.removesuffix(recording.label) for recording in self.recordings}) > 1:
                first += "; the same person may be on both sides (--hold-out)"
        scores = [line for label in self.readout.labels for line in self._scores(label)]
        about = list(self._about())
        room = _MOST_LINES - 1 - len(about)
        if len(scores) > room:
            scores = [
                *scores[: room - 1],
                f"and {len(scores) - room + 1} more lines about labels: --json has all of them",
            ]
        lines = [_cut(line) for line in (first, *scores, *about)]
        lines += ["", *repr(self.scored.together).split("\n")]
        if len(self.scored.scores) > 1:
            titles = [recording.title for recording in self.recordings]
            lines += ["", *score_rows(zip(titles, self.scored.scores, strict=True))]
        return lines

    def _about(self) -> Iterator[str]:
        """Yield what was done with labels and recordings, and by which recipe."""
        recipe = self.options.recipe
        if self.unlabelled:
            yield f"left out, because no row of labels names this source: {', '.join(self.unlabelled)}"
        for label, ms in self.constants_ms.items():
            side = "after" if ms > 0 else "before"
            yield f"{label}: labels are {abs(ms):.0f} ms {side} what was felt; labels and t are corrected by it"
        yield from self._aligned()
        if self.options.shift_ms:
            yield f"labels moved by {self.options.shift_ms:+g} ms before training (--shift-ms)"
        yield from self._kinds()
        if recipe is not None:
            about = self.made.recipe.about
            yield f"recipe {recipe}" + (f": {about}" if about else "")
        yield from self._rests()
        yield repr(self.readout)

    def command(self, readout: str) -> str:
        """Return the command that detects by the readout in a file, with the tare, if any, of the training.

        "" if it detects no label better than nothing does.

        Parameters
        ----------
        readout : str
            The file's name, as the command gives it.

        Raises
        ------
        ProblemError : no text
        """
        readout = text("readout", readout)
        if not self.learnt:
            return ""
        tare = "FILE" if isinstance(self.options.tare, Tare) else self.options.tare
        option = f" --tare {quote(str(tare))}" if tare and self.readout._needs_tare else ""
        return f"taxel detect RECORDING --readout {quote(readout)}{option}"

    def _kinds(self) -> Iterator[str]:
        """Yield what labels were taken for: what happens within a touch, its end, or kinds of touch."""
        recipe, rules = self.options.recipe, self.readout.rules
        inside = [label for label in self.readout.labels if label in rules and rules[label].touched_ms is not None]
        if inside:
            yield f"{', '.join(inside)}: taken for what happens within a touch"
        if recipe is None:
            return
        for label in self.readout.labels:
            if label not in inside and recipes.neuron_of(recipe, label) == "lift":
                yield f"{label}: taken for the end of a touch"
        if kinds := [label for label in recipes.kinds(recipe, self.readout.labels) if label not in inside]:
            yield f"{', '.join(kinds)}: learnt as a kind of touch, and detected at an age of the touch"
            yield f"  a label of the beginning of a touch must be named {recipes.names_of(recipe, 'contact')}"
            yield f"  a label of its end must be named {recipes.names_of(recipe, 'lift')}"

    def _rests(self) -> Iterator[str]:
        """Yield the line of which rests were taken from the recordings."""
        if len(self.rests) == 1 and self.rests[0].us:
            yield f"rest: {self.rests[0]}; --tare sets another"
        elif lasts_ms := [to_ms(taken.us[1] - taken.us[0]) for taken in self.rests if taken.us]:
            lasts = f"{min(lasts_ms):g} to {max(lasts_ms):g} ms"
            yield f"rest: measured separately in each of {len(lasts_ms)} recordings, for {lasts}; --tare sets another"

    def _scores(self, label: str) -> Iterator[str]:
        """Yield which of the neuron and the plain rule of a label runs, how both did, and the rule."""
        plain = self.scored.plain
        rule = plain.rules[label]
        yield self._choice(label)
        if label in (lasting := self.by_intervals()):
            yield f"  {lasting[label]!r}; {self.score[label].again} detected again within their label"
        if plain.together is None:
            yield f"no plain rule for {label}: {plain.lacks}"
        elif rule is None:
            yield f"no plain rule for {label}: none is better than to detect nothing"
        else:
            yield f"  rule, tuned on all: {rule._compared()}"
        if plain.own is not None and (own := plain.own[0][label]) is not None:
            its = plain.own[1][label]
            yield f"{label}, the labels' own rule: {_mistakes(its)} of {its.events}: {own._compared()}"

    def _choice(self, label: str) -> str:
        """Return what runs of a label, its mistakes, when it is known, and its worst day, each beside the other's."""
        events, scored = self.scored.neurons[label].events, self.scored
        if (choice := scored.choices.get(label)) is None:
            neuron = scored.neurons[label]
            return f"{label}: neuron runs: {_mistakes(neuron)} of {events}; {_known(neuron.delay.median)}"
        names = ("rule", "neuron") if label in self.readout.by_rule else ("neuron", "rule")
        runs, other = (getattr(choice, name) for name in names)
        wrong, others = f"{counted(runs.mistakes, 'mistake')} of {events}", f"{names[1]} {other.mistakes}"
        if runs.off or other.off:
            wrong += f", {runs.off} more than {choice.off_ms:g} ms off"
            others += f", {other.off}"
        # What both make with each change, of what runs first.
        changed = {name: of if names[0] == "neuron" else of[::-1] for name, of in choice.changed.items()}
        if (other.mistakes, other.off) < (runs.mistakes, runs.off):
            in_sum = [sum(of[n] for name, of in changed.items() if name in CHOOSING) for n in (0, 1)]
            others += ", which may be chance" if choice.by_chance else f"; changed {in_sum[0]}, {names[1]} {in_sum[1]}"
        rule = scored.plain.rules[label]
        when = ", when the touch ends" * (names[0] == "rule" and rule is not None and rule.age_ms == "end")
        known = f"{_known(runs.known_ms)}{when}, {names[1]} {_late(other.known_ms)}"
        line = f"{label}: {names[0]} runs: {wrong} ({others}); {known}"
        tomorrow = max((name for name in TOMORROW if name in changed), key=changed.__getitem__, default="")
        if not tomorrow or changed[tomorrow] <= (runs.mistakes, other.mistakes):
            return line
        its, of_other = changed[tomorrow]
        return f"{line}; with {tomorrow} {its} ({names[1]} {of_other})"

    def unreliable(self) -> Iterator[str]:
        """Yield the labels of which the readout misses most, or detects no more than one of nothing."""
        labels = "labels that it was trained on" if self.why else "held-out labels"
        for label in self.readout.labels:
            if text := unreliable(label, self.scored.together[label], labels):
                yield text

    def _aligned(self) -> Iterator[str]:
        """Yield by how much labels were moved to what the sensor felt, and how many found no pair."""
        moved = []
        for label, alignment in self.made.alignments.items():
            if alignment.train is None:
                moved.append(f"{label}: no input follows, learnt as given")
                continue
            median, largest = (three_digits(ms, "+") for ms in (alignment.median_ms, alignment.largest_ms))
            without = int(alignment.unpaired.sum())
            lacking = f", {without} of {len(alignment.given)} felt by none of its inputs and not learnt" * (without > 0)
            moved.append(f"{label} by {median} ms (median; largest {largest}){lacking}")
        if moved:
            yield f"labels moved to what the sensor felt: {'; '.join(moved)}"


def _cut(line: str) -> str:
    """Return a line of at most `_WIDTH` characters."""
    return line if len(line) <= _WIDTH else f"{line[: _WIDTH - 3]}..."


def _mistakes(score: Score) -> str:
    return counted(score.rank[0], "mistake")


def _known(ms: float) -> str:
    """Return when detections are known, of the median time after their labels."""
    return f"known {_late(ms, unit=True)} after the label" if np.isfinite(ms) else "never known"


def _late(ms: float, *, unit: bool = False) -> str:
    """Return a time after a label; long ones in s."""
    if not np.isfinite(ms):
        return "never"
    return f"{to_us(ms) / 1e6:.1f} s" if ms >= _LATE_MS else three_digits(ms) + " ms" * unit
