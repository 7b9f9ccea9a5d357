"""How right readouts and plain rules are on labelled data that they were not trained on."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import add
from typing import Any

import numpy as np

from taxel._base.messages import collected
from taxel._base.parallel import HERE, Workers
from taxel._base.progress import Progress
from taxel.detect.choice import Choice
from taxel.detect.examples import Example
from taxel.detect.fit import Fitter, Found, Rules, Trained
from taxel.detect.folds import Fold, Part, folds_of
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import Mistake, Score, mistakes_of, score, score_together
from taxel.detections import Detections

__all__ = ["Judged", "PlainScore", "judge", "judge_by"]


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


@dataclass(frozen=True)
class Judged:
    """Scores of readouts on data that they were not trained on.

    Attributes
    ----------
    scores : tuple of Score
        One an example that was tested, in the order of the examples: of what was chosen for each label, its neuron or
        its plain rule.
    together : Score
        All of them.
    how : str
        What was held out: recordings, blocks of time, or the given folds.
    trained : tuple of Trained
        One a fold.
    neurons : Score
        As `together`, of the neurons alone.
    plain : PlainScore
        How plain rules did that were tuned on the training part of each fold.
    mistakes : tuple of Mistake
        What the scores of each example call missed and false.
    by_rule : tuple of str
        The labels that their plain rule detects better than their neuron in all folds. The
        score of each fold is of what was better inside its training data.
    choices : mapping of str to Choice
        How the neuron and the rule of each label that has a rule compare in all folds.
    found : tuple of Detections
        What is scored, one an example that was tested.
    """

    scores: tuple[Score, ...]
    together: Score
    how: str
    trained: tuple[Trained, ...]
    neurons: Score
    plain: PlainScore
    mistakes: tuple[Mistake, ...] = ()
    by_rule: tuple[str, ...] = ()
    choices: Mapping[str, Choice] = field(default_factory=dict)
    found: tuple[Detections, ...] = ()


def judge(
    examples: Sequence[Example],
    recipe: Recipe,
    k: int | Sequence[Fold],
    *,
    window_ms: float = 50.0,
    frame_us: float | None = None,
    progress: Progress | None = None,
) -> Judged:
    """Train once a fold, and score what is detected in the data that the fold tests by the better of neuron and rule.

    Which is better is decided for each label inside the training data of the fold: no score that it rests on is of a
    readout that knew a label which the fold tests, or of a label that the fold tests.

    Parameters
    ----------
    examples : sequence of Example
    recipe : Recipe
    k : int, 2 or more; or sequence of Fold
        How many folds: of several examples whole ones are held out, of one alone stretches of time. Or the folds
        themselves; no time of an example may be tested twice.
    window_ms : float, ms
        Of the scores.
    frame_us : float, us, optional
        As in `taxel.detect.run`.
    progress : function of (step, done, all), optional
        Called before each step; of folds with how many are done, else with 0 of 0.

    Returns
    -------
    Judged

    Raises
    ------
    ProblemError : more folds than recordings, or than one recording's events allow; folds that are invalid; an event
        that is in one fold only

    Examples
    --------
    >>> from taxel.detect import Part
    >>> from taxel.encode import LevelCrossing
    >>> from taxel.spikes import SpikeTrains
    >>> recipe = Recipe(LevelCrossing([1.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})
    >>> examples = [Example(SpikeTrains.from_lists([[t]], stop=90.0), {"contact": [1000 * t]}) for t in (10, 20)]
    >>> judge(examples, recipe, [Fold([Part(0)], [Part(1)])]).together.found
    1
    """
    fitter = Fitter(examples, recipe, window_ms=window_ms, frame_us=frame_us, progress=progress)
    return judge_by(fitter, k)


def judge_by(fitter: Fitter, k: int | Sequence[Fold], workers: Workers = HERE) -> Judged:
    """Return what `judge` does, by a fitter that may have been used before; `workers` train the folds."""
    folds, how = folds_of(fitter.examples, k)
    # Another process makes a fitter of its own: what is computed once is no part of it.
    train = partial(_decided, (lambda: fitter) if workers.are_here else fitter.made_anew)
    trained: dict[int, Trained] = {}
    fitter.report(f"fold 1 of {len(folds)}", 0, len(folds))
    for n, one in workers.run(train, [fold.train for fold in folds]):
        trained[n] = one
        if len(trained) < len(folds):
            fitter.report(f"fold {len(trained) + 1} of {len(folds)}", len(trained), len(folds))
    return replace(scored(fitter, folds, [trained[n] for n in range(len(folds))]), how=how)


def _decided(fitter: Callable[[], Fitter], parts: Sequence[Part]) -> Trained:
    with collected():  # a readout that is only scored: the score shows what it misses
        return fitter().decided(parts)


def judge_training(fitter: Fitter, trained: Trained) -> Judged:
    """Return the scores on a training's own data, of which it knew all; what runs in it was decided by halves."""
    fold = Fold(fitter.whole, fitter.whole)
    judged = scored(fitter, [fold], [trained])
    return replace(judged, how="its own training data", by_rule=trained.readout.by_rule, trained=())


def scored(fitter: Fitter, folds: Sequence[Fold], trained: Sequence[Trained]) -> Judged:
    """Return the scores of neurons, of rules, and of what was chosen, in the parts that each fold tests."""
    tested = [(one, [fitter.scored(part) for part in fold.test]) for fold, one in zip(folds, trained, strict=True)]
    owns = [fitter.rules(fold.train, own=True) for fold in folds]
    parts = [part for _, each in tested for part in each]
    found = [fitter.detected(one, part, own) for (one, each), own in zip(tested, owns, strict=True) for part in each]
    by_rule = [one.readout.by_rule for one, each in tested for _ in each]
    run = [_run(one, names) for one, names in zip(found, by_rule, strict=True)]
    neurons, rules, of_own = (fitter.score([getattr(one, way) for one in found], parts) for way in Found._fields)
    best = fitter.rules(fitter.whole)
    tuned = {label: rule if rules[label].found else None for label, rule in best.items()}
    own_rules = fitter.rules(fitter.whole, own=True)
    own_score = (own_rules, of_own) if any(own_rules.values()) else None
    plain = PlainScore(tuned, None if fitter.lacks else rules, own_score, fitter.lacks)
    with_rules = [label for label in fitter.labels if tuned[label] is not None]
    choices = fitter.compared(with_rules, tested)
    better = tuple(label for label, choice in choices.items() if choice.by_rule)
    joined, truths, spans = _by_example(fitter, parts, run)
    scores = tuple(
        score(one, truth, fitter.window_ms, ends) for one, truth, ends in zip(joined, truths, spans, strict=True)
    )
    together = score_together(joined, truths, fitter.window_ms, spans)
    mistakes = mistakes_of(joined, truths, scores)
    return Judged(scores, together, "", tuple(trained), neurons, plain, mistakes, better, choices, tuple(joined))


def _run(found: Found, by_rule: Sequence[str]) -> Detections:
    """Return the detections of some labels by rules, and those of all others by neurons, in the order of `known`."""
    of_rules, of_neurons = (
        detected[np.array([(label in by_rule) == ruled for label in detected.label], np.bool_)]
        for detected, ruled in ((found.by_rules, True), (found.by_neurons, False))
    )
    both = of_rules + of_neurons
    return both[np.argsort(both.known, kind="stable")]


def _by_example(
    fitter: Fitter, parts: Sequence[Part], found: Iterable[Detections]
) -> tuple[list[Detections], list[dict[str, Any]], list[Mapping[str, Any]]]:
    """Return detections, the labels in the parts that were tested, and their spans, of each example."""
    of_example: dict[int, list[tuple[Part, Detections]]] = {}
    for part, one in zip(parts, found, strict=True):
        of_example.setdefault(part.example, []).append((part, one))
    joined, truths = [], []
    for example in sorted(of_example):
        tested, detections = zip(*of_example[example], strict=True)
        joined.append(reduce(add, detections))
        truths.append({label: np.sort(np.concatenate(fitter.labels_in(label, tested))) for label in fitter.labels})
    return joined, truths, [fitter.examples[example].spans for example in sorted(of_example)]


def _plain(rules: Rules) -> dict[str, Any]:
    return {label: None if rule is None else rule._parts for label, rule in rules.items()}
