"""Cross-validation of a recipe, and the choice among its points on held-out data."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from itertools import pairwise
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite, flag, instance, integer, several, shown, window
from taxel._base.errors import refused
from taxel._base.messages import collected, counted, warn
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.detect.ages import in_frames
from taxel.detect.examples import Example, array_of, check_examples, unit_of
from taxel.detect.fitting import (
    EncodedExamples,
    Fitting,
    Known,
    Trained,
    learn,
    possible,
    readout_of,
    rows_of,
)
from taxel.detect.levels import fit_levels
from taxel.detect.loads import Clock, clock_of
from taxel.detect.plain_score import PlainScore, RulesBeside
from taxel.detect.raised_floor import fit_floor
from taxel.detect.readout import Readout, run
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import Mistake, Score, mistakes_of, score, score_together
from taxel.detections import Detections
from taxel.spikes import SpikeTrains, to_ms

__all__ = ["Fold", "Judged", "Part", "count_of_folds", "judge"]

#: Into how many folds the training data of a fold are split for a search, where nothing else is stated.
INNER = 3
#: Into how many folds examples are split at most by default.
_MOST = 5
#: A recording is cut so long before the end of a pause between its events, if that is at least so long, us.
_CUT_US, _LONG_US = 250_000, 1_000_000


class Part(NamedTuple):
    """A whole example, or a stretch of one.

    Attributes
    ----------
    example : int, 0 or more
        Its place among the examples.
    start, stop : float, us
        The part has what happens in ``start <= t < stop``; all of it where they are left out.

    Raises
    ------
    ProblemError : values that are invalid, when `judge` gets it

    Examples
    --------
    >>> Part(0, stop=1000.0)
    Part(example=0, start=-inf, stop=1000.0)
    """

    example: int
    start: float = -np.inf
    stop: float = np.inf


class Fold(NamedTuple):
    """The parts that train and the parts that test.

    Attributes
    ----------
    train, test : sequence of Part
    inner : sequence of Fold
        Folds of the training data that a search chooses in; three are made where there are none.

    Raises
    ------
    ProblemError : values that are invalid, when `judge` gets it

    Examples
    --------
    >>> Fold(train=[Part(0), Part(1)], test=[Part(2, 0, 5_000_000)]).test[0].stop
    5000000
    """

    train: Sequence[Part]
    test: Sequence[Part]
    inner: Sequence[Fold] = ()


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
    plain : PlainScore, optional
        How plain rules did that were tuned on the training part of each fold.
    mistakes : tuple of Mistake
        What the scores of each example call missed and false.
    neurons : Score, optional
        As `together`, of the neurons alone.
    by_rule : tuple of str
        The labels that their plain rule detects better than their neuron in all folds: with fewer missed and false, or
        as few and known earlier. The score of each fold is of what was better in the other folds.
    """

    scores: tuple[Score, ...]
    together: Score
    how: str
    trained: tuple[Trained, ...] = ()
    plain: PlainScore | None = None
    mistakes: tuple[Mistake, ...] = ()
    neurons: Score | None = None
    by_rule: tuple[str, ...] = ()


def judge(
    examples: Sequence[Example],
    recipe: Recipe,
    k: int | Sequence[Fold],
    *,
    search: bool = False,
    window_ms: float = 50.0,
    frame_us: float | None = None,
    progress: Progress | None = None,
) -> Judged:
    """Train once a fold, and score what is detected in the data that the fold tests by the better of neuron and rule.

    Which is better is decided for each label and fold by the scores of the other folds, so a fold says nothing of what
    detects in it.

    Parameters
    ----------
    examples : sequence of Example
    recipe : Recipe
    k : int, 2 or more; or sequence of Fold
        How many folds: of several examples whole ones are held out, of one alone stretches of time. Or the folds
        themselves; no time of an example may be tested twice.
    search : bool
        Whether each neuron's point is chosen among the recipe's, inside the training data of each fold.
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
    >>> from taxel.encode import LevelCrossing
    >>> recipe = Recipe(LevelCrossing([1.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})
    >>> examples = [Example(SpikeTrains.from_lists([[t]], stop=90.0), {"contact": [1000 * t]}) for t in (10, 20)]
    >>> judge(examples, recipe, [Fold([Part(0)], [Part(1)])]).together.found
    1
    """
    examples, window, clocks = _check_arguments(examples, window_ms, frame_us)
    report = reporting(progress)
    search = flag("search", search)
    ways, how = _folds(examples, k)
    recipe_in_frames = in_frames(instance("recipe", recipe, Recipe), examples, clocks)
    recipe = possible(recipe_in_frames, examples)
    patterns = EncodedExamples(examples, recipe, report, search=search)
    array, unit = array_of(examples), unit_of(examples)
    labels = recipe._labels(examples)
    beside = RulesBeside(examples, labels, clocks, window, report)
    trained: list[Trained] = []
    found = []
    for n, fold in enumerate(ways):
        report(f"fold {n + 1} of {len(ways)}", n, len(ways))
        plan = fit_levels(fit_floor(recipe, examples, fold.train), examples, fold.train)
        encoded = patterns
        if plan is not recipe:
            encoded = EncodedExamples(examples, plan, report, search=search)
        if search:
            inner = fold.inner or INNER
            chosen = _choose(examples, encoded.patterns, encoded.plan, inner, fold.train, window, clocks, report)
            plan = replace(plan, neurons=chosen.neurons)
        with collected():  # a readout that is only scored: the score shows what it misses
            parts_of = partial(_parts_of, fold.train)
            trained_fold = learn(encoded.part(parts_of), plan, array, report)
        of_fold = replace(recipe_in_frames, encoder=plan.encoder, neurons=plan.neurons)._at(trained_fold.recipe.neurons)
        trained.append(trained_fold._replace(recipe=of_fold, readout=trained_fold.readout._with(unit=unit)))
        report(f"tuning plain rules, fold {n + 1} of {len(ways)}", 0, 0)
        by_neurons = [_detect(trained[-1].readout, examples, part, clocks) for part in fold.test]
        found.append(_Found(by_neurons, *beside.in_parts(fold.train, fold.test)))
    judged = _judged(examples, [fold.test for fold in ways], labels, found, beside, window)
    return replace(judged, how=how, trained=tuple(trained))


def judge_by_training(
    examples: Sequence[Example],
    labels: Sequence[str],
    clocks: Sequence[Clock],
    by_neurons: Sequence[Detections],
    window_ms: float,
    report: Progress,
) -> Judged:
    """Return the scores on (checked) examples of neurons that were trained on them, and of rules likewise."""
    beside = RulesBeside(examples, labels, clocks, window_ms, report)
    parts = [Part(n) for n in range(len(examples))]
    found = [_Found(list(by_neurons), *beside.in_parts(parts, parts))]
    judged = _judged(examples, [parts], labels, found, beside, window_ms, held_out=False)
    return replace(judged, how="its own training data")


class _Found(NamedTuple):
    """What was detected in each part that a fold tests."""

    by_neurons: list[Detections]
    by_rules: list[Detections]
    by_own: list[Detections]
    """By the labels' own rules."""


def _judged(
    examples: Sequence[Example],
    tested: Sequence[Sequence[Part]],
    labels: Sequence[str],
    found: Sequence[_Found],
    beside: RulesBeside,
    window: float,
    *,
    held_out: bool = True,
) -> Judged:
    """Return the scores of neurons, of rules, and of the better of both, for the parts that each fold tests.

    `held_out`: which is better is decided by the other folds.
    """

    def true_in(part: Part) -> dict[str, NDArray[np.int64]]:
        nothing = np.empty(0, np.int64)
        return {label: np.sort(_inside(examples[part.example].labels.get(label, nothing), part)) for label in labels}

    def in_examples(by_folds: Iterable[Sequence[Detections]]) -> list[Detections]:
        of_example: dict[int, list[Detections]] = {}
        for parts, detections in zip(tested, by_folds, strict=True):
            for part, one in zip(parts, detections, strict=True):
                of_example.setdefault(part.example, []).append(one)
        return [reduce(add, of_example[example]) for example in sorted(of_example)]

    truths, in_folds = _truths(examples, tested, labels), [[true_in(part) for part in parts] for parts in tested]
    pairs = [
        (score_together(one.by_neurons, truth, window), score_together(one.by_rules, truth, window))
        for one, truth in zip(found, in_folds, strict=True)
    ]
    chosen = []
    for n, one in enumerate(found):
        by_others = by_rule(labels, pairs[:n] + pairs[n + 1 :] if held_out else pairs)
        chosen.append([chosen_of(*both, by_others) for both in zip(one.by_neurons, one.by_rules, strict=True)])
    joined = in_examples(chosen)
    scores = tuple(score(*compared, window) for compared in zip(joined, truths, strict=True))
    mistakes = mistakes_of(joined, truths, scores)
    together = [score_together(in_examples(by), truths, window) for by in zip(*found, strict=True) if all(by)]
    neurons, *ruled = together
    plain = beside.scored(*ruled)
    whole = score_together(joined, truths, window)
    runs = by_rule([label for label in labels if plain.rules[label] is not None], pairs)
    return Judged(scores, whole, "", (), plain, mistakes, neurons, runs)


def by_rule(labels: Sequence[str], pairs: Sequence[tuple[Score, Score]]) -> tuple[str, ...]:
    """Return the labels that rules detect better than neurons, by scores of both on the same events, neurons first.

    They have fewer missed and false, or as few and are known earlier at the median.
    """

    def worth(label: str, of: int) -> tuple[int, float]:
        each = [pair[of].by_label[label] for pair in pairs if label in pair[of].by_label]
        delays = np.concatenate([np.empty(0), *(one.delays_ms for one in each)])
        return sum(one.rank[0] for one in each), float(np.median(delays)) if len(delays) else np.inf

    return tuple(label for label in labels if worth(label, 1) < worth(label, 0))


def chosen_of(neurons: Detections, rules: Detections, by_rule: Sequence[str]) -> Detections:
    """Return the detections of some labels by rules, and those of all others by neurons, in the order of `known`."""
    of_rules, of_neurons = (
        found[np.array([(label in by_rule) == ruled for label in found.label], np.bool_)]
        for found, ruled in ((rules, True), (neurons, False))
    )
    both = of_rules + of_neurons
    return both[np.argsort(both.known, kind="stable")]


def _check_arguments(
    examples: Sequence[Example], window_ms: float, frame_us: float | None
) -> tuple[list[Example], float, list[Clock]]:
    """Return checked examples, the window of scores (ms), and the clock of each example."""
    if frame_us is not None:
        finite("frame_us", frame_us, "us", least=1.0, most=3.6e9)
    clocks = [clock_of(example, frame_us) for example in examples] if isinstance(examples, Sequence) else []
    return check_examples(examples), finite("window_ms", window_ms, "ms", least=0.0, most=3.6e6), clocks


def _choose(
    examples: Sequence[Example],
    patterns: Sequence[Example],
    recipe: Recipe,
    folds: Sequence[Fold] | int,
    parts: Sequence[Part],
    window: float,
    clocks: Sequence[Clock],
    report: Progress,
) -> Recipe:
    """Return the recipe with the best point of each neuron; `patterns` are the examples as spike trains.

    The folds are given, or how many of `parts` are made for each label.
    """
    best: dict[str, Mapping[str, Any]] = {}
    for label in recipe._labels(examples):
        points = recipe.points_of(label)
        choices = {key: value for key, value in recipe.neurons.get(label, {}).items() if key == "choose"}
        best[label] = points[0] | choices
        if len(points) == 1:
            continue
        ways = _folds_for(label, examples, parts, folds) if isinstance(folds, int) else folds
        if not ways:
            warn(
                f"{label}: too few events to choose its parameters on held-out data, because two folds need 4: the "
                "recipe's first parameters are used",
                stacklevel=4,
            )
        else:
            plans = [replace(recipe, neurons={label: point}) for point in points]
            marks = _marks(_only(examples, label), _only(patterns, label), plans, label, ways, window, clocks, report)
            best[label] = points[marks.index(min(marks))] | choices
    return replace(recipe, neurons=best)


def _marks(
    examples: Sequence[Example],
    patterns: Sequence[Example],
    plans: Sequence[Recipe],
    label: str,
    folds: Sequence[Fold],
    window: float,
    clocks: Sequence[Clock],
    report: Progress,
) -> list[tuple[int, float]]:
    """Return the `Score.rank` over all folds of each of several recipes for one label.

    Except the first, a recipe that cannot be learnt from a fold's training data ranks behind all others.
    """
    array = array_of(examples)
    detections: list[dict[int, list[Detections]]] = [{} for _ in plans]
    refused: set[int] = set()
    needs = [rows_of(plan, label) for plan in plans]
    in_turn = sorted(range(len(plans)), key=lambda m: needs.index(needs[m]))
    for n, fold in enumerate(folds):
        training = [_of(part, patterns) for part in fold.train]
        rows: Fitting | None = None
        known: Known = {}
        for m in in_turn:
            plan = plans[m]
            report(f"trying parameters {m + 1} of {len(plans)} for {label}, on part {n + 1} of {len(folds)}", 0, 0)
            if m in refused:
                continue
            if rows is None or not rows.fits(plan):
                try:
                    rows = Fitting(training, plan, label, array, reporting(None), known=known)
                except ProblemError:  # as where two labels are within a longer refractory time
                    if m == 0:
                        raise
                    refused.add(m)
                    continue
            with collected():  # a readout that is only scored: the score shows what it misses
                readout = readout_of({label: rows.fit(plan)}, {label: rows.delay_ms}, plan, array)
            for part in fold.test:
                found = _detect(readout, _read(examples, patterns, readout, part), part, clocks)
                detections[m].setdefault(part.example, []).append(found)
    truths = _truths(examples, [fold.test for fold in folds], (label,))
    return [
        (sys.maxsize, np.inf)
        if m in refused
        else score_together([reduce(add, by_example[example]) for example in sorted(by_example)], truths, window).rank
        for m, by_example in enumerate(detections)
    ]


def _read(examples: Sequence[Example], patterns: Sequence[Example], readout: Readout, part: Part) -> Sequence[Example]:
    """Return the examples as spike trains where a readout detects the same in them, except `known`.

    It does if it receives all of them, and the grid of its neurons, which begins at a whole number of steps, is theirs.
    """
    trains = patterns[part.example].source
    assert isinstance(trains, SpikeTrains)
    neurons = readout.neurons.values()
    steps = [trains.start / neuron.neuron.step_ms for neuron in neurons]
    on_grid = all(abs(step - round(step)) < 1e-9 for step in steps)
    return patterns if on_grid and all(len(neuron.weights) == len(trains) for neuron in neurons) else examples


def _detect(readout: Readout, examples: Sequence[Example], part: Part, clocks: Sequence[Clock]) -> Detections:
    example, (frame_us, version) = examples[part.example], clocks[part.example]
    detections = run(readout, example.source, tare=example.tare, frame_us=frame_us, wire_version=version)  # type: ignore[arg-type]
    return example._known(detections[(detections.t >= part.start) & (detections.t < part.stop)])


def _of(part: Part, patterns: Sequence[Example]) -> Example:
    """Return the part of an example's spike trains and labels."""
    trains, labels, *_ = pattern = patterns[part.example]
    assert isinstance(trains, SpikeTrains)
    start, stop = max(to_ms(part.start), trains.start), min(to_ms(part.stop), trains.stop)
    inside = {label: _inside(times, part) for label, times in labels.items()}
    return pattern._replace(
        source=trains.between(start, max(start, stop)), labels={label: t for label, t in inside.items() if len(t)}
    )


def _parts_of(parts: Sequence[Part], patterns: Sequence[Example]) -> list[Example]:
    return [_of(part, patterns) for part in parts]


def _inside(times: NDArray[np.int64], part: Part) -> NDArray[np.int64]:
    return times[(times >= part.start) & (times < part.stop)]


def _truths(
    examples: Sequence[Example], parts_of_folds: Sequence[Sequence[Part]], labels: Sequence[str]
) -> list[dict[str, NDArray[np.int64]]]:
    """Return, of each example that is tested, the events in its tested parts, by label."""
    tested: dict[int, list[Part]] = {}
    for part in (part for parts in parts_of_folds for part in parts):
        tested.setdefault(part.example, []).append(part)
    nothing = np.empty(0, np.int64)
    return [
        {
            label: np.sort(
                np.concatenate(
                    [_inside(examples[example].labels.get(label, nothing), part) for part in tested[example]]
                )
            )
            for label in labels
        }
        for example in sorted(tested)
    ]


def _only(examples: Sequence[Example], label: str) -> list[Example]:
    return [
        example._replace(labels={name: t for name, t in example.labels.items() if name == label})
        for example in examples
    ]


def count_of_folds(examples: Sequence[Example]) -> tuple[int, str]:
    """Return into how many folds (checked) examples are split by default; 0 where they cannot be, and why.

    At most five, not more than half the events of the rarest label, of several examples not more than these. Each
    label must be in the training data of every fold.
    """
    counts = {label: 0 for example in examples for label in example.labels}
    for example in examples:
        for label, times in example.labels.items():
            counts[label] += len(times)
    rarest = min(counts, key=lambda label: counts[label])
    parts = [Part(n) for n in range(len(examples))]
    recordings = len(_group(examples, parts))
    most = min(_MOST, counts[rarest] // 2, *([recordings] if recordings > 1 else []))
    if most < 2:
        return 0, f"{counted(counts[rarest], 'label')} of {rarest}, but two folds need 4"
    for count in range(most, 1, -1):
        lacking = [_lacks(examples, fold.train, counts) for fold in _split(examples, parts, count)]
        if not any(lacking):
            return count, ""
    where = "recording" if recordings > 1 else "stretch of the recording"
    return 0, f"all events {next(filter(None, lacking))} are in the same {where}"


def _lacks(examples: Sequence[Example], parts: Sequence[Part], labels: Iterable[str]) -> str | None:
    """Return a label of which no event is in any of these parts, if there is one."""
    nothing = np.empty(0, np.int64)
    for label in labels:
        if not any(len(_inside(examples[part.example].labels.get(label, nothing), part)) for part in parts):
            return label
    return None


def _folds(examples: Sequence[Example], k: int | Sequence[Fold]) -> tuple[Sequence[Fold], str]:
    """Return folds, made or given, and what they hold out."""
    if isinstance(k, Sequence) and not isinstance(k, str):
        return _check_folds(k, len(examples)), f"{len(k)} given folds"
    count = integer("folds", k, 2, 2**31)
    parts = [Part(n) for n in range(len(examples))]
    recordings = len(_group(examples, parts))
    if recordings > 1 and count > recordings:
        raise refused("folds", f" is {count}: must be at most {recordings}, the number of recordings")
    how = f"{count} blocks of time" if recordings == 1 else f"whole recordings, {count} folds"
    return _split(examples, parts, count), how


def _group(examples: Sequence[Example], parts: Sequence[Part]) -> list[list[Part]]:
    """Return the parts of each recording: those of examples of one group together."""
    groups: dict[object, list[Part]] = {}
    for part in parts:
        groups.setdefault(examples[part.example].group or part.example, []).append(part)
    return list(groups.values())


def _check_folds(folds: Sequence[Fold], examples: int) -> list[Fold]:
    """Return folds with the places of examples as whole numbers; refuse those that make no sense."""
    if not len(folds):
        raise refused("folds", " is empty: must be one Fold or more")
    tested: dict[int, list[Part]] = {}
    sound = []
    for n, fold in enumerate(folds):
        if not isinstance(fold, Fold):
            raise ProblemError(f"fold {n} is {shown(fold)}: must be a Fold")
        train, test, inner = (several(f"fold {n}: {name}", getattr(fold, name)) for name in fold._fields)
        if not train or not test:
            raise ProblemError(f"fold {n} is {shown(fold)}: must be a Fold with parts to train on and parts to test")
        train, test = ([_check_part(f"fold {n}", part, examples) for part in parts] for parts in (train, test))
        for part in test:
            if any(part.start < trained.stop and trained.start < part.stop for trained in tested.get(part.example, ())):
                raise ProblemError(f"fold {n}: {shown(part)} is tested twice")
            tested.setdefault(part.example, []).append(part)
        sound.append(Fold(train, test, _check_folds(inner, examples) if inner else inner))
    return sound


def _check_part(where: str, part: object, examples: int) -> Part:
    if not isinstance(part, Part) or not 0 <= (example := integer(f"{where}: example", part.example)) < examples:
        raise ProblemError(f"{where}: {shown(part)} is not a Part of {examples} examples")
    start, stop = window("us", part.start, part.stop)
    if not start < stop:
        raise ProblemError(f"{where}: {shown(part)} must start before it stops")
    return Part(example, start, stop)


def _split(examples: Sequence[Example], parts: Sequence[Part], count: int) -> list[Fold]:
    """Return folds that test each part once.

    Of several recordings whole ones are tested; of one alone stretches between its events, with about equally many
    each.
    """
    groups = _group(examples, parts)
    if len(groups) == 1:
        (group,) = groups
        events = np.sort(np.concatenate([_only_inside(examples[part.example], part) for part in group]))
        edges = (-np.inf, *_between_events(events, count), np.inf)
        stretches = [[_within(part, *span) for part in group] for span in pairwise(edges)]
        groups = [filled for each in stretches if (filled := [part for part in each if part.start < part.stop])]
    return _deal(groups, count)


def _within(part: Part, start: float, stop: float) -> Part:
    """Return the part between two times; it does not start before it stops where nothing is between them."""
    return Part(part.example, max(part.start, start), min(part.stop, stop))


def _folds_for(label: str, examples: Sequence[Example], parts: Sequence[Part], count: int) -> list[Fold]:
    """Return folds of parts in which the point of a label's neuron is chosen: each has events of it to train on.

    Those of all labels alike where they do; else folds by its own events, to test as well; none where it has too few.
    """
    with contextlib.suppress(ProblemError):
        folds = _split(examples, parts, count)
        if not any(_lacks(examples, fold.train, [label]) for fold in folds):
            return folds
    of_label = _only(examples, label)
    groups = _group(examples, parts)
    events = [sum(len(_only_inside(of_label[part.example], part)) for part in group) for group in groups]
    having = [group for group, count_of in zip(groups, events, strict=True) if count_of]
    others = [group for group, count_of in zip(groups, events, strict=True) if not count_of]
    if len(having) > 1:
        return _deal([*having, *others], min(count, len(having)))
    if sum(events) < 4:
        return []
    silent = [part for group in others for part in group]
    folds = _split(of_label, having[0], min(count, sum(events) // 2))
    return [Fold([*fold.train, *silent], fold.test) for fold in folds]


def _deal(groups: Sequence[Sequence[Part]], count: int) -> list[Fold]:
    """Return folds that test each group of parts once."""
    count = min(count, len(groups))
    return [
        Fold(
            [part for k, group in enumerate(groups) if k % count != n for part in group],
            [part for group in groups[n::count] for part in group],
        )
        for n in range(count)
    ]


def _only_inside(example: Example, part: Part) -> NDArray[np.int64]:
    """Return the times of all events in a part of an example, ascending."""
    return np.sort(_inside(np.concatenate([*example.labels.values(), np.empty(0, np.int64)]), part))


def _between_events(times: NDArray[np.int64], count: int) -> Iterator[float]:
    """Yield where a part is cut: in the longest pause near each share of its events, us."""
    reach = max(1, len(times) // (2 * count))
    if len(times) < 2 * count:
        raise refused(
            "folds",
            f" is {count}: must be at most {len(times) // 2}, because each fold of a recording needs two events, and "
            f"there are {len(times)}",
        )
    for n in range(1, count):
        near = np.arange(max(1, n * len(times) // count - reach + 1), min(len(times), n * len(times) // count + reach))
        before, after = max(((times[k - 1], times[k]) for k in near), key=lambda pause: pause[1] - pause[0])
        # A touch that lasts may fill the most of a long pause, and what it is may be known when it ends.
        yield float(after - _CUT_US if after - before >= _LONG_US else (before + after) / 2)
