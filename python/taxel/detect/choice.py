"""Which of neuron and plain rule detects a label better, by their scores on what neither learnt from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel.detect.changes import CHOOSING
from taxel.detect.scoring import Score

#: Scores of neurons and of rules, one a part of a recording.
Ways: TypeAlias = tuple[Sequence[Score], ...]
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
    changed: Mapping[str, tuple[int, int]]
    """How many mistakes neuron and rule make in changed recordings, by what is changed."""

    def to_dict(self) -> dict[str, Any]:
        """Return the choice as plain values; what is infinite is None."""
        made = {
            way: {name: None if value == np.inf else value for name, value in one._asdict().items()}
            for way, one in (("neuron", self.neuron), ("rule", self.rule))
        }
        changed = {name: dict(zip(made, mistakes, strict=True)) for name, mistakes in self.changed.items()}
        return self._asdict() | made | {"changed": changed}


def chosen(labels: Sequence[str], off_ms: float, recorded: Ways, changed: Mapping[str, Ways]) -> dict[str, Choice]:
    """Return which of neuron and rule detects each label better, by scores in the same parts of recordings.

    Better is what makes fewer mistakes as recorded and with the changes of `CHOOSING`, in sum, by more than a standard
    error of the paired difference over the parts; a detection farther off than `off_ms` is half of one. Where that is
    not told apart, what knows earlier by more than `off_ms` at the median is better, then what makes fewer, then what
    knows earlier at all, then what is nearer to its label, and last the rule. Where one of them finds nothing as
    recorded, the mistakes as recorded decide alone: who finds nothing makes no mistake more when all is noise.

    Parameters
    ----------
    recorded, changed : pair of sequence of Score, ms
        Of neurons, then of rules, a score a part.
    """

    def joined(scores: Sequence[Score], label: str, what: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(one.by_label[label], what) for one in scores if label in one.by_label])

    def counts(scores: Sequence[Score], label: str) -> NDArray[np.int64]:
        """Return how many are wrong, and off, in each part, shape (parts, 2)."""
        of = [one.by_label.get(label) for one in scores]
        off = [0 if one is None else int(np.sum(np.abs(one.errors_ms) > off_ms)) for one in of]
        return np.column_stack([[0 if one is None else one.rank[0] for one in of], off])

    def made(scores: Sequence[Score], label: str) -> Made:
        known, error = joined(scores, label, "delays_ms"), np.abs(joined(scores, label, "errors_ms"))
        wrong, off = counts(scores, label).sum(axis=0).tolist()
        late = (float(np.median(known)), float(np.median(error))) if len(known) else (np.inf, np.inf)
        return Made(wrong, off, *late)

    def choice(label: str) -> Choice:
        neuron, rule = (made(scores, label) for scores in recorded)
        each = {name: [counts(scores, label) for scores in of] for name, of in {"": recorded, **changed}.items()}
        in_sum = [rules - neurons for name, (neurons, rules) in each.items() if name in ("", *CHOOSING)]
        more = np.sum(in_sum, axis=0) @ (1.0, _OFF_COST)
        by_chance = abs(more.sum()) <= (np.sqrt(len(more)) * np.std(more, ddof=1) if len(more) > 1 else 0.0)
        # Neither may have found anything.
        earlier_ms = float(np.nan_to_num(neuron.known_ms - rule.known_ms))
        if np.isinf(neuron.known_ms) != np.isinf(rule.known_ms):
            better = rule.mistakes <= neuron.mistakes
        elif not by_chance or not abs(earlier_ms) > off_ms:
            better = (more.sum(), -earlier_ms, rule.error_ms) <= (0.0, 0.0, neuron.error_ms)
        else:
            better = earlier_ms > 0.0
        wrong = {name: (int(n[:, 0].sum()), int(r[:, 0].sum())) for name, (n, r) in each.items() if name}
        return Choice(bool(better), bool(by_chance), off_ms, neuron, rule, wrong)

    return {label: choice(label) for label in labels}
