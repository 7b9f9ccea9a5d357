"""The result of ``taxel train``, as lines for people and as plain values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote
from typing import Any

from taxel._base.messages import counted
from taxel._base.times import beginning_us
from taxel.detect import Judged, Score, Trained
from taxel.detect.advice import Advice
from taxel.recorded import recorded
from taxel.recording import Recording

__all__ = ["Result"]

#: How many labels without a pair a line names.
_NAMED = 5
#: Where to find the file of a plain rule.
_RULE_FILE = "--rule FILE writes it, for taxel detect --readout FILE"


@dataclass(frozen=True)
class Result:
    """Hold what a training made, how it scored, and what may help it.

    `why` says why the scores are those on the training data; it is empty where they are held out.
    """

    opened: Sequence[Recording]
    made: Trained
    scored: Judged
    why: str
    advice: Mapping[str, Advice]
    window_ms: float
    searched: bool
    #: Where the plain rules of which labels were written.
    rules: Mapping[Path, Sequence[str]] = field(default_factory=dict)

    @property
    def how(self) -> str:
        """On which data the readout was scored, for the report, which shows its detections in the training data."""
        if self.why:
            return "on its own training data"
        one = self.scored.together
        counts = f"{one.found} of {one.events} found, {one.missed} missed, {one.false} false"
        return f"on its own training data; held out ({self.scored.how}): {counts}"

    def to_dict(self, out: Path, recipe: str | None, report: Path | None) -> dict[str, Any]:
        """Return the result as plain values for JSON."""
        result: dict[str, Any] = {
            "readout": str(out),
            "labels": list(self.made.readout.labels),
            "recipe": recipe,
            "judged_on": self.scored.how,
            "held_out": not self.why,
            "window_ms": self.window_ms,
            "recordings": [
                {"recording": one.title, "score": each.to_dict()}
                for one, each in zip(self.opened, self.scored.scores, strict=True)
            ],
            "score": self.scored.together.to_dict(),
            "plain_rule": None if self.scored.plain is None else self.scored.plain.to_dict(self.scored.together),
            "helps": {label: one.helps for label, one in self.advice.items()},
            "warnings": list(self._warnings()),
        }
        if self.made.alignments:
            result["alignment"] = {label: one.to_dict() for label, one in self.made.alignments.items()}
            for one in result["alignment"].values():
                one["unpaired"] = [{"recording": self.opened[k].title, "t_us": t} for k, t in one["unpaired"]]
        if self.rules:
            result["rules"] = {str(path): list(labels) for path, labels in self.rules.items()}
        if report is not None:
            result["report"] = str(report / "report.html")
        if self.searched:
            result["neurons"] = {label: dict(self.made.recipe.neurons[label]) for label in self.made.readout.labels}
        return result

    def page(self, out: Path, recipe: str | None, report: Path | None, tares: str, tare: str) -> list[str]:
        """Return the result as lines for people; the first says whether the scores are held out.

        One line of them, if any, is `tares`: which were taken from the recordings. Another names the command that
        detects by the readout, with the --tare, if any, that fits.
        """
        window = f"(window {self.window_ms:g} ms)"
        lines = [f"not held out, on its own training data {window}: {self.why}"]
        if not self.why:
            lines = [f"held out: {self.scored.how} {window}"]
        for label in self.made.readout.labels:
            lines += self._scores(label)
        lines += [*self._better(), *self._advised(), *self._aligned()]
        if recipe is not None:
            about = self.made.recipe.about
            lines += ["", f"recipe {recipe}" + (f": {about}" if about else "")]
        lines += [*([tares] if tares else []), repr(self.made.readout)]
        for label in self.made.readout.labels if self.searched else ():
            point = self.made.recipe.neurons[label]
            chosen = ", ".join(f"{key} {value}" for key, value in point.items() if key not in ("search", "choose"))
            lines.append(f"{label}, chosen: {chosen}")
        for one, each in zip(self.opened, self.scored.scores, strict=True):
            lines += ["", f"{one.title}:", *repr(each).split("\n")]
        if len(self.scored.scores) > 1:
            lines += ["", "all recordings:", *repr(self.scored.together).split("\n")]
        needed = [one.tare is None for one in self.made.readout.encoder._each() if hasattr(one, "tare")]
        option = f" --tare {quote(tare)}" if tare and any(needed) else ""
        lines += ["", f"written to {out}; next: taxel detect RECORDING --readout {quote(str(out))}{option}"]
        lines += [f"plain rule of {' and '.join(labels)}: written to {path}" for path, labels in self.rules.items()]
        if report is not None:
            lines.append(f"report: {report / 'report.html'}")
        return [*lines, *(f"warning: {one}" for one in self._warnings())]

    def _scores(self, label: str) -> Iterator[str]:
        """Yield how the neuron and the plain rule of a label scored on the same labels."""
        yield _line(label, "neuron", self.scored.together[label])
        plain = self.scored.plain
        rule = None if plain is None else plain.rules[label]
        if plain is None or plain.together is None:
            yield f"no plain rule for {label}" + (f": {plain.lacks}" if plain is not None else "")
        elif rule is None:
            yield f"no plain rule for {label}: none is better than to detect nothing"
        else:
            yield f"{_line(label, 'plain rule', plain.together[label])}; tuned on all: {rule._compared()}"

    def _better(self) -> Iterator[str]:
        """Yield the labels of which the plain rule is better, or as good and sooner; and the rules that are lacking."""
        plain = self.scored.plain
        if plain is None or plain.together is None:
            return
        for label in plain.better(self.scored.together):
            rule, neuron = (of[label].rank[0] for of in (plain.together, self.scored.together))
            yield f"{label}: the plain rule is better: {rule} missed and false, the neuron {neuron}; {_RULE_FILE}"
        for label in plain.sooner(self.scored.together):
            mine, its = (of[label] for of in (plain.together, self.scored.together))
            yield (
                f"{label}: the plain rule is as good and knows sooner: {mine.rank[0]} missed and false, as the neuron, "
                f"known {mine.delay.median:+.3g} ms after the label (median), the neuron {its.delay.median:+.3g} ms; "
                f"{_RULE_FILE}"
            )
        if plain.lacks:
            yield plain.lacks

    def _advised(self) -> Iterator[str]:
        """Yield what may help each label of which many are missed or false."""
        for label, (helps, because) in self.advice.items():
            one = self.scored.together[label]
            many = f"{one.missed / one.events:.0%} missed, {one.false / one.events:.0%} false"
            yield f"{label}: {many}; what may help is {helps}: {because}"

    def _warnings(self) -> Iterator[str]:
        """Yield the labels that the readout detects no better than one that detects nothing, and what may help."""
        for label in self.made.readout.labels:
            one = self.scored.together[label]
            if one.rank[0] < one.events:
                continue
            which = "labels that it was trained on" if self.why else "held-out labels"
            yield (
                f"{label}: do not rely on this readout: {one.found} of {one.events} {which} found, {one.false} false, "
                "no better than to detect nothing"
                + (f"; what may help is {self.advice[label].helps}" if label in self.advice else "")
            )

    def _aligned(self) -> Iterator[str]:
        """Yield by how much labels were moved to what the sensor felt, and which found no pair."""
        for label, one in self.made.alignments.items():
            if one.train is None:
                yield f"{label}: no input follows the labels, so they were learnt as given"
                continue
            yield (
                f"{label}: labels moved to what the sensor felt: median {one.median_ms:+.3g} ms, largest "
                f"{one.largest_ms:+.3g} ms"
            )
            unpaired = ((self.opened[k], t) for k, t in one.to_dict()["unpaired"])
            places = [
                f"{of.title} at {(t - beginning_us(recorded(of, hold=False).t)) / 1e6:.3f} s" for of, t in unpaired
            ]
            if places:
                more = f" and {len(places) - _NAMED} more" if len(places) > _NAMED else ""
                of = counted(len(places), "label")
                named = ", ".join(places[:_NAMED]) + more
                yield f"{label}: nothing was felt within 50 ms of {of}, not learnt: {named}"


def _line(label: str, by: str, one: Score) -> str:
    known = "never known" if not one.found else f"known {one.delay.median:+.3g} ms after the label (median)"
    return f"{label}, {by}: {one.found} of {one.events} found, {one.missed} missed, {one.false} false, {known}"
