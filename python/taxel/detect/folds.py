"""What a recipe is worth on recordings that it was not trained on, and which of its points is best there."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from operator import add
from typing import Any, NamedTuple

import numpy as np

from taxel._base.arguments import callback, flag, instance, number, whole
from taxel._core import ProblemError
from taxel.detect.readout import run
from taxel.detect.scoring import Score, score, score_together
from taxel.detect.training import Checked, Example, Pattern, Recipe, checked, encoded, learn
from taxel.detections import Detections
from taxel.spikes import to_ms

__all__ = ["Judged", "choose", "judge"]


class _Stretch(NamedTuple):
    """A part of an example, us."""

    place: int
    start: float = -np.inf
    stop: float = np.inf

    def of(self, pattern: Pattern) -> Pattern:
        """Return what of the example's pattern lies in it."""
        trains, labels = pattern
        start, stop = max(to_ms(self.start), trains.start), min(to_ms(self.stop), trains.stop)
        kept = {label: times[(times >= self.start) & (times < self.stop)] for label, times in labels.items()}
        return Pattern(trains.between(start, max(start, stop)), {label: t for label, t in kept.items() if len(t)})


class _Fold(NamedTuple):
    """What is trained on, and what is held out."""

    kept: list[_Stretch]
    held: list[_Stretch]


@dataclass(frozen=True)
class Judged:
    """Say what readouts said of what they were not trained on.

    Attributes
    ----------
    scores : tuple of Score
        One an example.
    together : Score
        All of them.
    how : str
        What was held out: recordings, or blocks of time.
    """

    scores: tuple[Score, ...]
    together: Score
    how: str


def folds(examples: Sequence[Example], k: int) -> tuple[list[_Fold], str]:
    """Return `k` ways to hold something out, each thing once, and what is held out.

    Of several examples whole ones are held out; of one alone stretches between its events, with about equally many
    events each.

    Raises
    ------
    ProblemError : more folds than examples, or than one example's events allow
    """
    sound, count = checked(examples), whole("folds", k, 2, 2**31)
    if len(sound) == 1:
        edges = [-np.inf, *_between_events(sound[0], count), np.inf]
        blocks = [_Stretch(0, *both) for both in pairwise(edges)]
        return [_Fold([b for b in blocks if b is not held], [held]) for held in blocks], f"{count} blocks of time"
    if count > len(examples):
        raise ProblemError(f"folds is {count}: must be 2 to {len(examples)}, the number of recordings")
    everything = [_Stretch(n) for n in range(len(examples))]
    ways = [_Fold([one for one in everything if one.place % count != n], everything[n::count]) for n in range(count)]
    return ways, f"whole recordings, {count} folds"


def judge(
    examples: Sequence[Example],
    recipe: Recipe,
    k: int,
    *,
    search: bool = False,
    window_ms: float = 50.0,
    frame_us: float | None = None,
    progress: Callable[[str], object] | None = None,
) -> Judged:
    """Train as often as there are folds and judge each time what was held out.

    Parameters
    ----------
    examples : sequence of Example
    recipe : Recipe
    k : int, 2 or more
        How many folds: of several examples whole ones are held out, of one alone stretches of time.
    search : bool
        Whether each neuron's point is chosen among the recipe's, inside the training data of each fold.
    window_ms : float, ms
        Of the scores.
    frame_us : float, us, optional
        As in `taxel.detect.run`.
    progress : function of str, optional

    Returns
    -------
    Judged

    Raises
    ------
    ProblemError : more folds than recordings, or than one recording's events allow; an event that is in one fold only
    """
    examples, window = checked(examples), number("window_ms", window_ms)
    told = (lambda _: None) if progress is None else callback("progress", progress)
    search = flag("search", search)
    ways, how = folds(examples, k)
    patterns = encoded(examples, instance("recipe", recipe, Recipe), told)
    said: list[list[Detections]] = [[] for _ in examples]
    for n, way in enumerate(ways):
        told(f"fold {n + 1} of {len(ways)}")
        kept = [stretch.of(patterns[stretch.place]) for stretch in way.kept]
        array = examples[0].source.array
        plan = recipe
        if search:
            inner = [examples[place] for place in sorted({stretch.place for stretch in way.kept})]
            if len(examples) == 1:
                inner = [_piece(examples[0], stretch) for stretch in way.kept]
            plan = choose(inner, recipe, window_ms=window, frame_us=frame_us, progress=told)
        with warnings.catch_warnings():
            # Of a readout that is not kept; its score says what it misses.
            warnings.simplefilter("ignore", UserWarning)
            readout = learn(kept, plan, array, told)
        for place, start, stop in way.held:
            found = run(readout, examples[place].source, tare=examples[place].tare, frame_us=frame_us)
            said[place].append(found[(found.t >= start) & (found.t < stop)])
    heard = [reduce(add, parts) for parts in said]
    labels = recipe._labels(examples)
    truths = [{label: example.labels.get(label, np.empty(0, np.int64)) for label in labels} for example in examples]
    scores = tuple(score(*both, window) for both in zip(heard, truths, strict=True))
    return Judged(scores, score_together(heard, truths, window), how)


def choose(
    examples: Sequence[Example],
    recipe: Recipe,
    *,
    k: int = 3,
    window_ms: float = 50.0,
    frame_us: float | None = None,
    progress: Callable[[str], object] | None = None,
) -> Recipe:
    """Return the recipe with, for each neuron, the point of those that it lists which is best on held-out data.

    Best is the fewest missed and false, then the smallest mean distance in time; of equals the first.

    Parameters
    ----------
    examples, recipe, window_ms, frame_us, progress
        As in `judge`.
    k : int, 2 or more
        How many folds; of fewer examples than that, as many as there are.

    Raises
    ------
    ProblemError : as `judge`
    """
    instance("recipe", recipe, Recipe)
    examples, count = checked(examples), whole("k", k, 2, 2**31)
    told = (lambda _: None) if progress is None else callback("progress", progress)
    best: dict[str, Mapping[str, Any]] = {}
    for label in recipe._labels(examples):
        points = recipe.points_of(label)
        alone = [example._replace(labels=_only(example.labels, label)) for example in examples]
        marks = []
        for n, point in enumerate(points if len(points) > 1 else ()):
            told(f"trying point {n + 1} of {len(points)} for {label}")
            tried = replace(recipe, neurons={label: point})
            ways = min(count, len(examples)) if len(examples) > 1 else count
            marks.append(_mark(judge(alone, tried, ways, window_ms=window_ms, frame_us=frame_us).together))
        best[label] = points[marks.index(min(marks))] if marks else points[0]
    return replace(recipe, neurons=best)


def _piece(example: Checked, stretch: _Stretch) -> Checked:
    source = example.source.between(stretch.start, stretch.stop)
    first = int(source.t[0]) if len(source) else 0
    # What happened just before the first event of a piece was heard first in it.
    labels = {
        label: np.maximum(times[(times >= stretch.start) & (times < stretch.stop)], first)
        for label, times in example.labels.items()
    }
    return Checked(source, {label: times for label, times in labels.items() if len(times)}, example.tare)


def _mark(one: Score) -> tuple[int, float]:
    return one.missed + one.false, float(np.abs(one.errors_ms).mean()) if one.found else np.inf


def _only(labels: Mapping[str, Any], label: str) -> dict[str, Any]:
    return {label: labels[label]} if label in labels else {}


def _between_events(example: Example, count: int) -> Iterator[float]:
    """Yield where an example is cut: in the longest pause near each share of its events, us."""
    times = np.sort(
        np.concatenate([np.asarray(t, np.int64) for t in example.labels.values()] or [np.empty(0, np.int64)])
    )
    reach = max(1, len(times) // (2 * count))
    if len(times) < 2 * count:
        raise ProblemError(f"folds is {count}: one recording with {len(times)} events has room for {len(times) // 2}")
    for n in range(1, count):
        near = np.arange(max(1, n * len(times) // count - reach + 1), min(len(times), n * len(times) // count + reach))
        widest = near[np.argmax(times[near] - times[near - 1])]
        yield float(times[widest - 1] + times[widest]) / 2
