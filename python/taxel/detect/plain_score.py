"""The plain rules beside a readout: tuned on the same training data, scored on the same labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taxel._base.progress import Progress
from taxel.detect.examples import Example
from taxel.detect.floors import floor_of
from taxel.detect.loads import Clock, EdgeRule, Loads, Stretch, lacks
from taxel.detect.plain_rule import PlainRule
from taxel.detect.scoring import Score
from taxel.detect.tuning import Tuning
from taxel.detections import Detections

#: The rule of each label; None where none is better than to detect nothing.
Rules = Mapping[str, PlainRule | None]


@dataclass(frozen=True)
class PlainScore:
    """Scores of plain rules on the labels that readouts were scored on.

    Attributes
    ----------
    rules : mapping of str to PlainRule or None
        The rule of each label, tuned on all examples; None where none is better than to detect nothing, or where those
        of the folds find nothing held out.
    together : Score or None
        Of the rules that were tuned on the training part of each fold; where a fold has no rule for a label, all its
        labels are missed. None where no quantity can be computed.
    own : tuple of (mapping of str to PlainRule or None, Score), optional
        The same of the labels' own rules, which are those of the quantity whose thresholds the labels are.
    lacks : str
        What kept rules from being tried; empty where they were.
    """

    rules: Rules
    together: Score | None
    own: tuple[Rules, Score] | None = None
    lacks: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the rules and their score, and those of the labels' own rules, as plain values."""
        return {
            "rules": _plain(self.rules),
            "score": None if self.together is None else self.together.to_dict(),
            "own": None if self.own is None else {"rules": _plain(self.own[0]), "score": self.own[1].to_dict()},
            "lacks": self.lacks,
        }


class RulesBeside:
    """Tune rules on parts of (checked) examples, and detect by them in others.

    Parameters
    ----------
    examples : sequence of Example, checked
    labels : sequence of str
    clocks : sequence of (float or None, int)
        Of each example.
    window_ms : float
    report : function of (step, done, all)
    """

    def __init__(
        self,
        examples: Sequence[Example],
        labels: Sequence[str],
        clocks: Sequence[Clock],
        window_ms: float,
        report: Progress,
    ) -> None:
        self.labels = tuple(labels)
        #: What keeps rules from being tried; empty where they are.
        self.lacks = lacks(examples)
        self._tuning: Tuning | None = None
        if not self.lacks:
            self._tuning = Tuning(Loads(examples, clocks, floor_of(examples), report), labels, window_ms)
        # The quantity whose thresholds the labels are.
        self._own = min((example.labels_of for example in examples if example.labels_of), default=None)

    def in_parts(self, train: Sequence[Stretch], test: Sequence[Stretch]) -> tuple[list[Detections], list[Detections]]:
        """Return what rules tuned on parts of the examples detect in others; and the labels' own rules, if any."""
        if self._tuning is None:
            return [Detections([], [], []) for _ in test], []
        rules, own = self._tuning.best_rules(train), []
        if self._own is not None:
            own_rules = self._tuning.best_rules(train, self._own)
            own = [self.detected(own_rules, part) for part in test]
        return [self.detected(rules, part) for part in test], own

    def scored(self, together: Score, own: Score | None = None) -> PlainScore:
        """Return the rules tuned on all examples with the scores of rules, and of the labels' own rules."""
        if self._tuning is None:
            return PlainScore(dict.fromkeys(self.labels), None, lacks=self.lacks)
        whole = self._tuning.loads.whole_examples
        best = self._tuning.best_rules(whole)
        rules = {label: rule if together[label].found else None for label, rule in best.items()}
        return PlainScore(rules, together, None if own is None else (self._tuning.best_rules(whole, self._own), own))

    def detected(self, rules: Rules, part: Stretch) -> Detections:
        """Return what the rule of each label detects of it in a part of an example."""
        detections = Detections([], [], [])
        for label, rule in rules.items():
            if rule is None or self._tuning is None or not self._tuning.loads.labelled([label], [part]):
                continue
            loads, label_index = self._tuning.loads, rule._parts["labels"].index(label)
            if isinstance(rule.age_ms, str):
                edges = loads.at_end()
            elif rule.age_ms is None:
                numbers = rule.quantity, rule.threshold, rule.release, rule.frames, rule.levels
                edges = loads.edges(EdgeRule(*numbers, rule.dated_at, rule.of_largest))[label_index]
            else:
                edges = loads.at_age(rule.age_ms)
            found = loads.off(edges.between(loads.windows([part])), part[0])
            if rule.age_ms is not None:
                is_label = (found.value >= rule.threshold) == bool(label_index)
                found = found._replace(t=found.t[is_label], known=found.known[is_label])
            detections += Detections([label] * len(found.t), found.t, found.known)
        return detections


def _plain(rules: Rules) -> dict[str, Any]:
    return {label: None if rule is None else rule._parts for label, rule in rules.items()}
