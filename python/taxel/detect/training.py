"""From labelled recordings to a readout: what `taxel train` does."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import callback, instance, parameters, shown
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.alignment import Alignment, ages_of, align
from taxel.detect.examples import Example, array_of, checked
from taxel.detect.readout import SILENCE_MS, Readout
from taxel.detect.recipe import Recipe
from taxel.detect.seen import seen
from taxel.encode import Composite
from taxel.learn import ConeR
from taxel.spikes import SpikeTrains, to_ms

__all__ = ["Trained", "train"]


#: Parameters of a learner that its rows do not depend on. Bounds could be among them, but that those of a train without
#: a spike must contain 0.
_NOT_OF_ROWS = (
    "lambdas", "kappa", "divide_b_by", "divide_c_by", "divide_d_by", "sides_b", "sides_c", "norm", "tolerance",
    "engine", "max_seconds",
)  # fmt: skip


class Trained(NamedTuple):
    """What one training made.

    Attributes
    ----------
    recipe : Recipe
        In a fold with the points that a search chose.
    learners : mapping of str to ConeR
        The fitted learners, by label.
    readout : Readout
    alignments : mapping of str to Alignment
        By how much its labels were moved to what the sensor felt, by label; empty where the recipe does not align them.
    """

    recipe: Recipe
    learners: Mapping[str, ConeR]
    readout: Readout
    alignments: Mapping[str, Alignment]


def train(
    examples: Sequence[Example],
    recipe: Recipe,
    *,
    progress: Callable[[str], object] | None = None,
) -> Readout:
    """Train a readout on labelled recordings.

    Parameters
    ----------
    examples : sequence of Example
        All of the same array. A label that an example lacks is not in it: that teaches silence.
    recipe : Recipe
    progress : function of str, optional
        Called with a line before each step.

    Returns
    -------
    Readout

    Raises
    ------
    ProblemError : no event at all of a label, an event outside its example, or examples that are invalid

    Warns
    -----
    UserWarning : what `taxel.learn.ConeR` warns of, behind the label; events out of reach by their times

    Notes
    -----
    Target = event + the encoder's latency + the trained delay (thesis 6.5; the delay is ours). The event is the label,
    or where the recipe aligns labels what the sensor felt of it.

    Examples
    --------
    >>> from taxel import Frames
    >>> from taxel.encode import LevelCrossing
    >>> frames = Frames([[[v]] for v in (0.0, 0.0, 9.0, 9.0, 0.0, 0.0)], range(0, 60_000, 10_000), unit="N")
    >>> recipe = Recipe(LevelCrossing([5.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})
    >>> train([Example(frames, {"contact": [20_000]})], recipe)
    Readout(contact; LevelCrossing(levels=[5.0]) on 1 x 1 taxels; grid, keep)
    """
    return trained(examples, recipe, progress).readout


def trained(examples: Sequence[Example], recipe: Recipe, progress: Callable[[str], object] | None) -> Trained:
    """Train a readout as `train` does, and return how its labels were aligned as well."""
    sound = checked(examples)
    report = (lambda _: None) if progress is None else callback("progress", progress)
    narrowed = instance("recipe", recipe, Recipe)._narrowed(recipe._labels(sound))
    return learn(encoded(sound, narrowed, report), narrowed, array_of(sound), report)._replace(recipe=recipe)


def encoded(examples: Sequence[Example], recipe: Recipe, report: Callable[[str], object]) -> list[Example]:
    """Return (checked) examples with the spike trains of the recipe's encoder as their sources."""
    array_of(examples)
    results = []
    for k, example in enumerate(examples):
        trains = example.source
        if not isinstance(trains, SpikeTrains):
            report(f"encoding {k + 1} of {len(examples)}")
            encoder = recipe.encoder if example.tare is None else recipe.encoder.with_tare(example.tare)
            trains = encoder.encode(trains)
        results.append(example._replace(source=trains.split_by_sign() if trains.signed else trains))
    return results


def readout_of(learners: Mapping[str, ConeR], recipe: Recipe, array: Array | None) -> Readout:
    """Return the readout of fitted learners, behind the encoder of the recipe that they were made by.

    Of a composite encoder the readout has the parts that its neurons receive; where that is one, it is the encoder.
    """
    recipe = recipe._narrowed(list(learners))
    encoder, inputs = recipe.encoder, {label: recipe.inputs_of(label) for label in learners}
    if isinstance(encoder, Composite) and len(encoder.parts) == 1:
        encoder, inputs = encoder.only(list(encoder.parts)), {}
    delays = {label: recipe._trained_delay_of(label) for label in learners}
    threshold = float(recipe.run_threshold)
    return Readout(encoder, learners, array=array, delay_ms=delays, run_threshold=threshold, inputs=inputs)


def learn(patterns: Sequence[Example], recipe: Recipe, array: Array | None, report: Callable[[str], object]) -> Trained:
    """Fit the learner of each of a recipe's labels on encoded examples; see `train`."""
    learners, alignments, ranges = {}, {}, {}
    for label in _labels_to_learn(patterns, recipe):
        fitting = Fitting(patterns, recipe, label, array, report)
        learners[label] = fitting.fit(recipe)
        ranges[label] = fitting.seen(learners[label])
        if fitting.alignment is not None:
            alignments[label] = fitting.alignment
    return Trained(recipe, learners, readout_of(learners, recipe, array)._with_seen(ranges), alignments)


def _labels_to_learn(examples: Sequence[Example], recipe: Recipe) -> tuple[str, ...]:
    labels = recipe._labels(examples)
    if not labels:
        raise ProblemError("no label in any example: there is nothing to learn")
    for label in {label for example in examples for label in example.labels} - set(labels):
        raise ProblemError(
            f"label {shown(label)} has no neuron: the recipe has {', '.join(map(repr, labels))}; "
            f"give it [neurons.{label}], or leave it out of the labels"
        )
    return labels


class Fitting:
    """The rows of one label's learner on encoded examples, for a recipe and all others that need the same.

    Raises
    ------
    ProblemError : no example has such an event, or one lies outside its example (names it)
    """

    def __init__(
        self,
        examples: Sequence[Example],
        recipe: Recipe,
        label: str,
        array: Array | None,
        report: Callable[[str], object],
    ) -> None:
        self._label = label
        self._needs = rows_of(recipe, label)
        learner, _ = recipe.learner_of(label)
        received = recipe._received(recipe._of(label))
        self._shift_ms = received.latency_ms + recipe._trained_delay_of(label)
        given = [_times(k, one, label) for k, one in enumerate(examples)]
        count = sum(map(len, given))
        if not count:
            raise ProblemError(f"{label}: no example has such an event, so it cannot be learnt")
        sources = [_inputs(k, one, recipe, label, array) for k, one in enumerate(examples)]
        self._sources, self._graded = sources, received.kind == "graded"
        ages = ages_of(received, array)
        self.alignment = align(sources, label, given, received.latency_ms, ages) if recipe.align else None
        felt = given if self.alignment is None else [self.alignment.felt(k) for k in range(len(given))]
        self._targets = [to_ms(times) + self._shift_ms for times in felt]
        trains = [_until(source, targets) for source, targets in zip(sources, self._targets, strict=True)]
        self._what = f"learning {label} from {counted(count, 'event')}"
        self._report = report
        report(self._what)
        try:
            self._rows = learner.prepare(trains, self._targets)
        except ProblemError as error:
            raise ProblemError(f"{label}: {error}") from None
        self._before: ConeR | None = None

    def fits(self, recipe: Recipe) -> bool:
        """Whether the learner that a recipe describes needs these rows."""
        return self._needs == rows_of(recipe, self._label)

    def seen(self, cone: ConeR) -> dict[str, Any]:
        """Return the range of the inputs of a fitted learner's neuron."""
        return seen(self._sources, _core.neuron_memory_ms(cone.neuron_._json()), graded=self._graded)

    def fit(self, recipe: Recipe) -> ConeR:
        """Fit the learner that a recipe describes, beginning at the fit before, if any; warnings name events."""
        cone, _ = recipe.learner_of(self._label)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self._before = self._rows.fit(
                cone,
                start=self._before,
                progress=lambda n, _rows, _objective, gap: self._report(
                    f"{self._what}, round {n}: within {gap:.1e} of the least"
                ),
            )
        for text_of in _remarks(cone, self._targets, self._shift_ms, caught):
            warnings.warn(f"{self._label}: {text_of}", stacklevel=5)
        return cone


def _times(k: int, example: Example, label: str) -> NDArray[np.int64]:
    """Return the events of a label in the encoded example k, us, ascending; refuse one outside the example."""
    source, labels, *_ = example
    assert isinstance(source, SpikeTrains)
    events = np.sort(labels.get(label, np.empty(0, np.int64)))
    times = to_ms(events)
    outside = times[(times < source.start) | (times > source.stop + SILENCE_MS)]
    if len(outside):
        raise ProblemError(
            f"example {k}: {label} at {outside[0]:g} ms lies outside it, {source.start:g} to {source.stop:g} ms"
        )
    return events


def rows_of(recipe: Recipe, label: str) -> str:
    """Return what the rows of a label's learner depend on, as text."""
    cone, delay_ms = recipe.learner_of(label)
    values = {name: value for name, value in cone.get_params().items() if name not in ("neuron", *_NOT_OF_ROWS)}
    return parameters(values | {"delay_ms": delay_ms, "inputs": sorted(recipe.inputs_of(label))})


def _inputs(k: int, example: Example, recipe: Recipe, label: str, array: Array | None) -> SpikeTrains:
    """Return the trains of the encoded example k that a label's neuron receives."""
    trains, names, encoder = example.source, recipe.inputs_of(label), recipe.encoder
    assert isinstance(trains, SpikeTrains)
    if not names or not isinstance(encoder, Composite):
        return trains
    places = encoder.places(names, array or Array(1, 1))
    if len(places) != len(trains):
        raise ProblemError(f"example {k}: {len(trains)} trains, the encoders make {len(places)}: must be equally many")
    return trains.select(places)


def _remarks(
    cone: ConeR, targets: Sequence[NDArray[np.float64]], shift_ms: float, caught: Sequence[warnings.WarningMessage]
) -> Iterator[str]:
    """Yield the warnings of a fit, which name events and examples."""
    missed = cone.unreachable_
    if missed:
        places = [f"{targets[p][k] - shift_ms:.10g} ms" + f" of example {p}" * (len(targets) > 1) for p, k in missed]
        listed = ", ".join(places[:3]) + f" and {len(places) - 3} more" * (len(places) > 3)
        yield (
            f"{len(missed)} of {sum(map(len, targets))} events are out of reach, as too few input spikes come before "
            f"them ({listed}); the rest was learnt. A larger delay_ms or tau, wider lb and ub, or another of the "
            "recipe's points (taxel train --search) may reach them"
        )
    # The learner names unreachable targets, if any, first.
    yield from (str(one.message) for one in caught[bool(missed) :])


def _until(trains: SpikeTrains, targets: NDArray[np.float64]) -> SpikeTrains:
    """Return the trains with an end after the last target, which may come after the last spike."""
    return trains.lasting(max(trains.stop, *targets, trains.start))
