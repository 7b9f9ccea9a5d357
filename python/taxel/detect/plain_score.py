"""The plain rules beside a readout: tuned on the same training data, scored on the same labels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance
from taxel._base.progress import Progress
from taxel.detect.examples import Example, name_of
from taxel.detect.floors import floor_of
from taxel.detect.loads import Clock, Loads, Stretch
from taxel.detect.plain_rule import PlainRule
from taxel.detect.scoring import Score, score_together
from taxel.detect.tuning import best_rules
from taxel.detections import Detections
from taxel.spikes import SpikeTrains


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
    lacks : str
        What kept rules from being tried; empty where they were.
    """

    rules: Mapping[str, PlainRule | None]
    together: Score | None
    lacks: str = ""

    def sooner(self, than: Score) -> tuple[str, ...]:
        """Return the labels of which the rule has as few missed and false as another score and is known sooner.

        Parameters
        ----------
        than : Score
            Of a readout, on the same labels.

        Returns
        -------
        tuple of str

        Raises
        ------
        ProblemError : no Score

        Examples
        --------
        >>> from taxel.detect import score
        >>> true, early, late = {"contact": [1000]}, Detections(["contact"], [1100], [1200]), [1500]
        >>> plain = PlainScore({"contact": PlainRule("area", 2)}, score(early, true))
        >>> plain.sooner(score(Detections(["contact"], [1100], late), true))
        ('contact',)
        """
        return self._where(
            than, lambda a, b: a.rank[0] == b.rank[0] and bool(a.found) and a.delay.median < b.delay.median
        )

    def better(self, than: Score) -> tuple[str, ...]:
        """Return the labels of which the rule finds some, with fewer missed and false than another score.

        Parameters
        ----------
        than : Score
            Of a readout, on the same labels.

        Returns
        -------
        tuple of str

        Raises
        ------
        ProblemError : no Score

        Examples
        --------
        >>> from taxel.detect import score
        >>> true = {"contact": [1000]}
        >>> plain = PlainScore({"contact": PlainRule("area", 2)}, score(Detections(["contact"], [1100], [1200]), true))
        >>> plain.better(score(Detections([], [], []), true))
        ('contact',)
        """
        return self._where(than, lambda a, b: bool(a.found) and a.rank[0] < b.rank[0])

    def _where(self, than: Score, holds: Callable[[Score, Score], bool]) -> tuple[str, ...]:
        """Return the labels with a rule whose score fulfils a condition with the score in `than`."""
        others = instance("than", than, Score).by_label
        scores = {} if self.together is None else self.together.by_label
        ruled = [label for label in others if self.rules.get(label) is not None]
        return tuple(label for label in ruled if holds(scores[label], others[label]))

    def to_dict(self, than: Score) -> dict[str, Any]:
        """Return the rules, their score, and the labels of which they are better, as plain values.

        Parameters
        ----------
        than : Score
            As of `better`.

        Returns
        -------
        dict

        Raises
        ------
        ProblemError : no Score
        """
        return {
            "rules": {label: None if rule is None else _without_training(rule) for label, rule in self.rules.items()},
            "score": None if self.together is None else self.together.to_dict(),
            "better": list(self.better(than)),
            "sooner": list(self.sooner(than)),
            "lacks": self.lacks,
        }


def plain_score(
    examples: Sequence[Example],
    labels: Sequence[str],
    clocks: Sequence[Clock],
    ways: Sequence[tuple[Sequence[Stretch], Sequence[Stretch]]],
    truths: Sequence[Mapping[str, NDArray[np.int64]]],
    window_ms: float,
    report: Progress,
) -> PlainScore:
    """Tune rules on the training parts of each of `ways`, and score them on its tested parts.

    Parameters
    ----------
    examples : sequence of Example, checked
    labels : sequence of str
    clocks : sequence of (float or None, int)
        Of each example.
    ways : sequence of (parts, parts)
        What is trained on, and what is tested; none: all examples are both.
    truths : sequence of mapping of str to int64, us
        The labels of each example that is tested, in order.
    window_ms : float
    report : function of (step, done, all)
    """
    lacking = [
        k for k, example in enumerate(examples) if example.tare is None or isinstance(example.source, SpikeTrains)
    ]
    if lacking:
        why = f"{name_of(lacking[0], examples[lacking[0]])} has no tare" if len(examples) > 1 else "there is no tare"
        return PlainScore(dict.fromkeys(labels), None, f"{why} to measure a load from")
    loads = Loads(examples, clocks, floor_of(examples), report)
    report("tuning plain rules", 0, 0)
    rules = best_rules(loads, labels, loads.whole_examples, window_ms)
    detections: dict[int, list[Detections]] = {}
    for n, (train, test) in enumerate(ways or [(loads.whole_examples, loads.whole_examples)]):
        if ways:
            report(f"tuning plain rules, fold {n + 1} of {len(ways)}", 0, 0)
        fold_rules = best_rules(loads, labels, train, window_ms) if ways else rules
        for part in test:
            detections.setdefault(part[0], []).append(_detect(loads, fold_rules, part))
    joined = [reduce(add, detections[index]) for index in sorted(detections)]
    together = score_together(joined, truths, window_ms)
    rules = {label: rule if together[label].found else None for label, rule in rules.items()}
    return PlainScore(rules, together)


def _detect(loads: Loads, rules: Mapping[str, PlainRule | None], part: Stretch) -> Detections:
    """Return what the rule of each label detects of it in a part of an example."""
    detections = Detections([], [], [])
    for label, rule in rules.items():
        if rule is None or not loads.labelled([label], [part]):
            continue
        label_index = rule._parts["labels"].index(label)
        if isinstance(rule.age_ms, str):
            edges = loads.at_end()
        elif rule.age_ms is None:
            edges = loads.edges(rule.quantity, rule.threshold, rule.release, rule.frames)[label_index]
        else:
            edges = loads.at_age(rule.age_ms)
        found = loads.off(edges.between(loads.windows([part])), part[0])
        if rule.age_ms is not None:
            is_label = (found.value >= rule.threshold) == bool(label_index)
            found = found._replace(t=found.t[is_label], known=found.known[is_label])
        detections += Detections([label] * len(found.t), found.t, found.known)
    return detections


def _without_training(rule: PlainRule) -> dict[str, Any]:
    """Return the parts of a rule but the summary of its training, which has a mark for each taxel."""
    return {name: part for name, part in rule._parts.items() if name != "training"}
