"""Which of neuron and plain rule detects a label better, by their scores on what neither learnt from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.detect.scoring import Score

#: Of how many mistakes a detection is that is far off its label, where neuron and rule are compared.
_OFF_COST = 0.5


class Made(NamedTuple):
    """What one of neuron and rule made of the labels of a name."""

    mistakes: int
    """Missed and false."""
    off: int
    """How many detections are farther off their label than is right."""
    known_ms: float
    """Median time from label to `known`; infinite where nothing was found."""
    error_ms: float
    """Median distance of `t` from the label, either way; infinite where nothing was found."""


class Choice(NamedTuple):
    """Which of neuron and rule of a label is better."""

    by_rule: bool
    by_chance: bool
    """Whether their mistakes differ by no more than by chance, so that what knows much earlier is better."""
    off_ms: float
    """From how far off its label a detection is half a mistake."""
    neuron: Made
    rule: Made

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as plain values; what is infinite is None."""
        made = {
            way: {name: None if value == np.inf else value for name, value in one._asdict().items()}
            for way, one in (("neuron", self.neuron), ("rule", self.rule))
        }
        return self._asdict() | made


def chosen(labels: Sequence[str], off_ms: float, neurons: Sequence[Score], rules: Sequence[Score]) -> dict[str, Choice]:
    """Return which of neuron and rule detects each label better, by scores in the same parts of recordings.

    Better is what makes fewer mistakes, by more than a standard error of the paired difference over the parts; a
    detection farther off than `off_ms` is half of one. Where that is not told apart, what knows earlier by more than
    `off_ms` at the median is better, then what makes fewer, then what is nearer to its label, and last the rule.
    """

    def joined(scores: Sequence[Score], label: str, what: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(one.by_label[label], what) for one in scores if label in one.by_label])

    def made(scores: Sequence[Score], label: str) -> tuple[Made, NDArray[np.float64]]:
        of = [one.by_label.get(label) for one in scores]
        counts = [(0, 0) if one is None else (one.rank[0], int((np.abs(one.errors_ms) > off_ms).sum())) for one in of]
        wrong, off = np.array(counts).T
        known, error = joined(scores, label, "delays_ms"), np.abs(joined(scores, label, "errors_ms"))
        late = (float(np.median(known)), float(np.median(error))) if len(known) else (np.inf, np.inf)
        return Made(int(wrong.sum()), int(off.sum()), *late), wrong + _OFF_COST * off

    def choice(label: str) -> Choice:
        (neuron, its_cost), (rule, cost) = made(neurons, label), made(rules, label)
        more = cost - its_cost
        by_chance = abs(more.sum()) <= (np.sqrt(len(more)) * np.std(more, ddof=1) if len(more) > 1 else 0.0)
        earlier_ms = neuron.known_ms - rule.known_ms
        if not by_chance or not abs(earlier_ms) > off_ms:
            better = (more.sum(), rule.error_ms) <= (0.0, neuron.error_ms)
        else:
            better = earlier_ms > 0.0
        return Choice(bool(better), bool(by_chance), off_ms, neuron, rule)

    return {label: choice(label) for label in labels}
