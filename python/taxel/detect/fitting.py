"""From labelled recordings to a readout: what `taxel train` does."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import instance, parameters, shown
from taxel._base.errors import helped
from taxel._base.messages import are, collected, counted, warn
from taxel._base.progress import Progress, reporting
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.ages import (
    ACTS_AFTER_MS,
    Ages,
    EndedTouches,
    ages_of,
    end_train,
    in_frames,
    later_us,
    silent_windows,
)
from taxel.detect.alignment import WINDOW_MS, Alignment, align, align_by
from taxel.detect.examples import Example, array_of, check_examples, name_of, sizes_of, unit_of
from taxel.detect.floors import floor_alone
from taxel.detect.followed import FOLLOWED_MS, Followed, distinct, follow, only, silence
from taxel.detect.levels import fit_levels
from taxel.detect.loads import clock_of, lacks_neighbours
from taxel.detect.raised_floor import fit_floor
from taxel.detect.readout import SILENCE_MS, Readout
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import Score, score_together
from taxel.detect.seen import seen
from taxel.detections import Detections
from taxel.encode import Composite, Encoder, LocalLoad, Moments, TouchEnds
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains, to_ms, to_us

#: Parameters of a learner that its rows do not depend on. Bounds could be among them, but that those of a train without
#: a spike must contain 0.
_NOT_OF_ROWS = (
    "lambdas", "kappa", "divide_b_by", "divide_c_by", "divide_d_by", "sides_b", "sides_c", "norm", "tolerance",
    "engine", "max_seconds",
)  # fmt: skip


#: How many fewer events a point must leave missed or false to count before the first of those to choose from.
_FEWER = 3
#: ... and that share of the labels: of many labels some were never felt.
_FEWER_SHARE = 0.05
#: Two folds need this many labels.
TWO_FOLDS = 4
#: A first input that is later than that after its label, ms, is of something else.
_MOST_WAIT_MS = 100.0
#: Where a neuron waits for its first inputs, those of this share of the labels have come.
_MOST_LABELS = 0.9
#: Why events cannot be learnt that have too few inputs.
UNLEARNT = "cannot be learnt, because too few input spikes come before them"
#: What is nearer to a point of a neuron's grid than this part of a step is there.
_SAME_STEP = 1e-3
#: With so many of the quantities that follow the labels best a point is tried.
_FOLLOWED = 2


#: Which quantities follow the labels of one name in the same examples, by the inputs that they are among.
Known: TypeAlias = dict[tuple[str, ...], list[Followed]]


class Trained(NamedTuple):
    """Hold what one training made.

    Attributes
    ----------
    recipe : Recipe
        With the points that were chosen, in a fold by its search too.
    learners : mapping of str to ConeR
        The fitted learners, by label.
    readout : Readout
    alignments : mapping of str to Alignment
        By how much its labels were moved to what the sensor felt, by label; empty where the recipe does not align them.
    fitted_levels : bool
        Whether the encoder's levels are of the training data (`Recipe`).
    raised_floor : float, in the sensor's unit, optional
        The noise floor, where labels raised it above what the noise requires.
    chosen : mapping of str to str
        For each label, the chosen point of `choose`, the first one, and the mistakes of both in the training data.
    """

    recipe: Recipe
    learners: Mapping[str, ConeR]
    readout: Readout
    alignments: Mapping[str, Alignment]
    fitted_levels: bool = False
    raised_floor: float | None = None
    chosen: Mapping[str, str] = {}


def fit(
    examples: Sequence[Example],
    recipe: Recipe,
    *,
    progress: Progress | None = None,
) -> Readout:
    """Train a readout on labelled recordings.

    Parameters
    ----------
    examples : sequence of Example
        All of the same array. A label that an example lacks is not in it: that teaches silence.
    recipe : Recipe
    progress : function of (step, done, all), optional
        Called before each step; of folds with how many are done, else with 0 of 0.

    Returns
    -------
    Readout

    Raises
    ------
    ProblemError : no event at all of a label, an event outside its example, or examples that are invalid

    Warns
    -----
    UserWarning : what `taxel.learn.ConeR` warns of, behind the label; events that cannot be learnt by their times

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
    >>> fit([Example(frames, {"contact": [20_000]})], recipe)
    Readout(contact; LevelCrossing(levels=[5.0]) on 1 x 1 taxels; grid, keep)
    """
    return fit_aligned(examples, recipe, progress).readout


def fit_aligned(examples: Sequence[Example], recipe: Recipe, progress: Progress | None) -> Trained:
    """Train a readout as `fit` does, and return how its labels were aligned as well."""
    sound, clocks = check_examples(examples), [clock_of(example) for example in examples]
    report = reporting(progress)
    recipe = in_frames(instance("recipe", recipe, Recipe), sound, clocks)
    parts = [(k, -np.inf, np.inf) for k in range(len(sound))]
    by_noise = recipe.encoder
    recipe = fit_floor(recipe, sound, parts)
    floor = max((getattr(part, "noise_floor", 0.0) for part in recipe.encoder._each()), default=0.0)
    raised_floor = floor if recipe.encoder != by_noise else None
    stated = recipe.encoder
    recipe = fit_levels(recipe, sound, parts)
    possibly = possible(recipe, sound)
    unit = unit_of(sound)
    trained = learn(EncodedExamples(sound, possibly, report), possibly, array_of(sound), report)
    return trained._replace(
        recipe=recipe._at(trained.recipe.neurons),
        readout=trained.readout._with(unit=unit, pads=len(sizes_of(examples)) > 0),
        fitted_levels=recipe.encoder != stated,
        raised_floor=raised_floor,
    )


def possible(recipe: Recipe, examples: Sequence[Example]) -> Recipe:
    """Return the recipe without the points to choose from that (checked) examples do not allow.

    The local load requires a tare; channels have no neighbours, so that only encoders that need none remain. Contact
    and lift of channels, without kinds of touch, are not detected as touches end, which is later than by the peak.
    """
    if lacks_neighbours(examples) and isinstance(recipe.encoder, Composite):
        near = {name for name, part in recipe.encoder.parts.items() if part._needs_neighbours}
        if all(near & set(recipe.inputs_of(label)) for label in recipe.neurons):
            near |= {name for name, part in recipe.encoder.parts.items() if isinstance(part, TouchEnds)}
        recipe = _counting_alone(recipe._without_parts(near), examples)
    return recipe._without_choices(LocalLoad.name) if any(example.tare is None for example in examples) else recipe


def _counting_alone(recipe: Recipe, examples: Sequence[Example]) -> Recipe:
    """Return a recipe for channels, whose noise alone must not load them."""
    assert isinstance(recipe.encoder, Composite)
    parts = {
        name: copy(part).set_params(noise_floor=floor_alone(examples, part.noise_floor, kinds=len(recipe.neurons)))
        if isinstance(part, Moments | TouchEnds)
        else part
        for name, part in recipe.encoder.parts.items()
    }
    return replace(recipe, encoder=Composite(parts))


class EncodedExamples:
    """The (checked) examples as spike trains of a recipe's encoder; what only points to choose from need when they do.

    Parameters
    ----------
    search : bool
        Whether the points of a search are needed too; then all is encoded at once.
    """

    def __init__(self, examples: Sequence[Example], recipe: Recipe, report: Progress, *, search: bool = False) -> None:
        labels = recipe._labels(examples)
        given = search or any(isinstance(example.source, SpikeTrains) for example in examples)
        #: The recipe with the parts of `patterns`.
        self.plan = recipe._narrowed(labels, search=search, choices=given)
        #: The examples as the trains that the first points receive.
        self.patterns = encode_examples(examples, self.plan, report)
        self._others: dict[str, Sequence[Example]] = {}
        self._encode: Callable[[Recipe], Sequence[Example]] = lambda plan: encode_examples(examples, plan, report)

    def receiving(self, plan: Recipe) -> tuple[Recipe, Sequence[Example]]:
        """Return a recipe for one point of one label with the parts that the trains are of, and these trains."""
        (label,) = plan.neurons
        narrowed = plan._narrowed([label])
        have, need = (recipe.encoder._each() for recipe in (self.plan, narrowed))
        if all(part in have for part in need):
            return replace(plan, encoder=self.plan.encoder), self.patterns
        key = narrowed.encoder.to_json()
        if key not in self._others:
            self._others[key] = self._encode(narrowed)
        return narrowed, self._others[key]

    def part(self, part_of: Callable[[Sequence[Example]], list[Example]]) -> EncodedExamples:
        """Return a part of all examples, which shares their trains."""
        part = copy(self)
        part.patterns = part_of(self.patterns)
        part._others = {}
        part._encode = lambda plan: part_of(self.receiving(plan)[1])
        return part


def encode_examples(examples: Sequence[Example], recipe: Recipe, report: Progress) -> list[Example]:
    """Return (checked) examples with the spike trains of the recipe's encoder as their sources."""
    array_of(examples)
    results = []
    for k, example in enumerate(examples):
        trains = example.source
        if not isinstance(trains, SpikeTrains):
            report(f"encoding {k + 1} of {len(examples)}", 0, 0)
            encoder = recipe.encoder if example.tare is None else recipe.encoder.with_tare(example.tare)
            trains = encoder.encode(trains)
        results.append(example._replace(source=trains.split_by_sign() if trains.signed else trains))
    return results


def readout_of(
    learners: Mapping[str, ConeR], delays_ms: Mapping[str, float], recipe: Recipe, array: Array | None
) -> Readout:
    """Return the readout of fitted learners with their delays, behind the encoder of the recipe that made them.

    Of a composite encoder the readout has the parts that its neurons receive; where that is one, it is the encoder.
    """
    recipe = recipe._narrowed(list(learners))
    encoder, inputs = recipe.encoder, {label: recipe.inputs_of(label) for label in learners}
    if isinstance(encoder, Composite) and len(encoder.parts) == 1:
        encoder, inputs = encoder.only(list(encoder.parts)), {}
    threshold = float(recipe.run_threshold)
    return Readout(encoder, learners, array=array, delay_ms=delays_ms, run_threshold=threshold, inputs=inputs)


def learn(examples: EncodedExamples, recipe: Recipe, array: Array | None, report: Progress) -> Trained:
    """Fit the learner of each of a recipe's labels on encoded examples; see `fit`."""
    learners, delays, alignments, ranges, chosen = {}, {}, {}, {}, {}
    points = dict(recipe.neurons)
    for label in _labels_to_learn(examples.patterns, recipe):
        best, first_wrong = _best(examples, recipe, label, array, report)
        fitting, learners[label], points[label] = best.fitting, best.learner, best.point
        if differs := _differing(best.point, recipe._choices_of(label)[0]):
            by, by_first = differs
            chosen[label] = (
                f"learnt with {by}: {best.wrong} missed and false in the training data; with {by_first}: {first_wrong}"
            )
        delays[label], ranges[label] = fitting.delay_ms, fitting.seen(learners[label])
        if fitting.alignment is not None:
            of_all = np.array(fitting.places)[fitting.alignment.example]
            alignments[label] = replace(fitting.alignment, example=of_all)
    plan = replace(recipe, neurons=points) if recipe.neurons else recipe
    return Trained(
        plan, learners, readout_of(learners, delays, plan, array)._with(seen=ranges), alignments, chosen=chosen
    )


class _FittedPoint(NamedTuple):
    """One point of a label's neuron, fitted."""

    wrong: int
    """Events of the training data missed or false; 0 where nothing is chosen."""
    fitting: Fitting
    learner: ConeR
    point: Mapping[str, Any]
    caught: list[str]


def _differing(point: Mapping[str, Any], first: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return by what a point and the first one differ, as text; None where they do not."""
    keys = [key for key in dict(point) | dict(first) if point.get(key) != first.get(key)]
    if "inputs" in keys:  # the rest suits these
        keys = ["inputs"]

    def text(values: Mapping[str, Any]) -> str:
        of_key = {key: values.get(key, "as of all") for key in keys}
        return ", ".join(f"input {' and '.join(v)}" if key == "inputs" else f"{key} {v}" for key, v in of_key.items())

    return (text(point), text(first)) if keys else None


def _best(
    examples: EncodedExamples, recipe: Recipe, label: str, array: Array | None, report: Progress
) -> tuple[_FittedPoint, int]:
    """Return the first of the points to choose from, or a later one that leaves fewer events missed or false.

    And how many the first one leaves.

    They are tried in turn. A later one counts if it leaves as many fewer as its `fewer` says, else `_FEWER`, and
    `_FEWER_SHARE` of the labels, as some more or less are chance; with 0 it counts if it leaves no more. Where an
    encoder has quantities that labels may follow, a point is tried with each of the `_FOLLOWED` that follow them best.
    Where most events are missed whose targets come before the inputs that tell them, as with the true onsets of slow
    steps, the neuron is trained to fire after the first input. A later point that cannot be learnt is left out. If the
    first felt nothing, which counts as all labels missed, a later one must leave as many fewer, or none. Warnings are
    those of the point that counts.
    """
    points = recipe._choices_of(label)
    known: Known = {}

    def fitted(point: Mapping[str, Any], rank: int) -> _FittedPoint:
        plan, patterns = examples.receiving(replace(recipe, neurons={label: point}))
        with collected() as caught:
            fitting = Fitting(patterns, plan, label, array, report, rank, known)
            learner = fitting.fit(plan)
        if len(points) == 1 and not fitting.precedes_input(learner):
            return _FittedPoint(0, fitting, learner, point, caught)
        found = fitting.score(learner, plan.run_threshold)
        if fitting.precedes_input(learner) and 2 * found.missed > fitting.count:
            with collected() as caught_later:
                later = Fitting(patterns, plan, label, array, report, rank, known, behind_input=True)
                by_later = later.fit(plan)
            found_later = later.score(by_later, plan.run_threshold)
            if found_later.rank < found.rank:
                caught = [_waits(label, fitting, learner, later), *caught_later]
                found, fitting, learner = found_later, later, by_later
        return _FittedPoint(found.rank[0], fitting, learner, point, caught)

    count = sum(len(pattern.labels.get(label, ())) for pattern in examples.patterns)
    best, refused = None, None
    try:
        best = fitted(points[0], 0)
    except ProblemError as error:
        if error.hint != "unfelt":
            raise
        refused = error
    usual, first_wrong = max(_FEWER, _FEWER_SHARE * count), count if best is None else best.wrong
    for point, stated in zip(points[1:], recipe._fewer_of(label), strict=True):
        fewer = usual if stated is None else stated
        wrong, fewer = (count, min(max(1, fewer), count)) if best is None else (best.wrong, fewer)
        if wrong < fewer:
            continue
        others = []
        received = recipe._received({**recipe.learner, **point})
        several = received._quantities() or end_train(received, array) is not None
        for rank in range(_FOLLOWED if several else 1):
            with contextlib.suppress(ProblemError):
                others.append(fitted(point, rank))
        second = min(others, key=lambda fit: fit.wrong, default=None)
        if second is not None and second.wrong <= wrong - fewer:
            best = second
    if best is None:
        assert refused is not None
        raise refused
    for caught in best.caught:
        warn(caught, stacklevel=5)
    return best, first_wrong


def _waits(label: str, planned: Fitting, early: ConeR, later: Fitting) -> str:
    """Return the warning that a neuron waits for its inputs, as those of a learner come behind its targets."""
    count, more_ms = len(early.unreachable_), later.delay_ms - planned.delay_ms
    return (
        f"{label}: {count} of {counted(planned.count, 'label')} {'comes' if count == 1 else 'come'} before the first "
        f"input: the neuron waits for this input, and {label} is known {more_ms:.3g} ms later"
    )


def _labels_to_learn(examples: Sequence[Example], recipe: Recipe) -> tuple[str, ...]:
    labels = recipe._labels(examples)
    if not labels:
        raise ProblemError("no label in any example: there is nothing to learn")
    for label in {label for example in examples for label in example.labels} - set(labels):
        raise ProblemError(
            f"label {shown(label)} has no neuron: the recipe has {', '.join(map(repr, labels))}; "
            f"give it a section, {_setting(label)}, or leave it out of the labels"
        )
    return labels


def _setting(label: str) -> str:
    """Return how a parameter of a label's neuron is written in a recipe, and as an option."""
    quote = "" if re.fullmatch(r"[\w-]+", label, re.ASCII) else '"'
    return f"[neurons.{quote}{label}{quote}] in a recipe or --set {quote}neurons.{label}.tau=0.5{quote}"


class Fitting:
    """The rows of one label's learner on encoded examples, for a recipe and all others that need the same.

    Of an encoder with quantities that labels may follow it has those of one alone: the best, or the one `rank` behind
    it. Of one of touches as they end it has first the duration alone, then all. Which follow the labels is `known` from
    other fits to the same examples, and is added to it.

    Raises
    ------
    ProblemError : no example has such an event, or one is outside its example (names it); too few quantities
    """

    def __init__(
        self,
        examples: Sequence[Example],
        recipe: Recipe,
        label: str,
        array: Array | None,
        report: Progress,
        rank: int = 0,
        known: Known | None = None,
        *,
        behind_input: bool = False,
    ) -> None:
        self._label, self._needs = label, rows_of(recipe, label)
        #: The places of the examples that say when the label happened; the others are left out.
        self.places = [k for k, example in enumerate(examples) if label not in example.unlabelled]
        examples = [examples[k] for k in self.places]
        learner, delay_ms = recipe.learner_of(label)
        received = recipe._received(recipe._of(label))
        ages, self._ends = ages_of(received, array), end_train(received, array)
        #: How much later than the event the neuron is trained to fire, ms, the encoder's latency apart. Where an age of
        #: the touch begins then it is later: a spike at that age acts after its time, or at once where the potential
        #: jumps.
        neuron = learner._on_grid()
        acts_after_ms = ACTS_AFTER_MS if neuron.kernel == "exponential" else neuron.step_ms
        self.delay_ms = delay_ms + (0.0 if ages is None else acts_after_ms)
        label_times = self._label_times = [_times(k, example, label) for k, example in enumerate(examples)]
        if not self.count:
            raise ProblemError(f"{label}: no example has such an event, so it cannot be learnt")
        sources = [_inputs(k, example, recipe, label, array) for k, example in enumerate(examples)]
        self._graded = received.kind == "graded"
        quantities = received._quantities() if recipe.align else {}
        followed = None
        self.alignment: Alignment | None = None
        if quantities:
            known = {} if known is None else known
            if (inputs := recipe.inputs_of(label)) not in known:
                known[inputs] = follow(sources, label, label_times, received.latency_ms, list(quantities))
            followers = known[inputs]
            if len(followers) <= rank and rank:
                raise ProblemError(f"{label}: {counted(len(followers), 'quantity', 'quantities')} follow it")
            followed = followers[rank] if followers else None
            self.alignment = align_by(label, label_times, followed and (followed.train, followed.score))
        elif recipe.align:
            how = received.latency_ms, ages, self._ends
            self.alignment = align(sources, label, label_times, *how, alone=_learns_one(received))
        self._names = [name_of(k, example) for k, example in enumerate(examples)]
        self._inputs, self._sources = sources, self._received(sources, received, quantities, followed, rank)
        felt = label_times if self.alignment is None else [self.alignment.felt(k) for k in range(len(label_times))]
        for name, times in zip(self._names, felt, strict=True):
            self._check_apart(name, times, neuron.refractory)
        later = self._later(sources, felt, ages, delay_ms, received.latency_ms if behind_input else None)
        shift_ms = received.latency_ms + self.delay_ms
        self._targets = [
            self._at(to_ms(t + more) + shift_ms, neuron, trains.start)
            for trains, t, more in zip(sources, felt, later, strict=True)
        ]
        if self._ends is None:
            self.delay_ms += to_ms(float(np.median(np.concatenate(later))))
        self._shift_ms = received.latency_ms + self.delay_ms
        lasting = self._until_targets(self._sources)
        trains = lasting if self._graded or self.alignment is None else self._until_targets(distinct(self._sources))
        self._check_felt(trains)
        silent = self._silent(followed, sources, lasting, ages, neuron)
        self._what, self._report = f"learning {label} from {counted(self.count, 'event')}", report
        report(self._what, 0, 0)
        try:
            self._rows = learner.prepare(trains, self._targets, silence=silent)
        except ProblemError as error:
            raise ProblemError(f"{label}: {error}") from None
        self._before: ConeR | None = None

    def _received(
        self,
        sources: Sequence[SpikeTrains],
        received: Encoder,
        quantities: Mapping[int, Sequence[int]],
        followed: Followed | None,
        rank: int,
    ) -> list[SpikeTrains]:
        """Return the trains that the neuron learns from, of those that it receives."""
        if followed is not None:
            return [only(trains_of, quantities[followed.train]) for trains_of in sources]
        if self._ends is not None and rank == 0:
            # Beside the duration the last train alone, which is 1: how large touches are may be learnt by heart.
            return [only(trains_of, [self._ends.train, len(trains_of) - 1]) for trains_of in sources]
        train = None if self.alignment is None else self.alignment.train
        if train is not None and _learns_one(received):
            return [only(trains_of, [train]) for trains_of in sources]
        return list(sources)

    def _later(
        self,
        sources: Sequence[SpikeTrains],
        felt: Sequence[NDArray[np.int64]],
        ages: Ages | None,
        delay_ms: float,
        behind_input_ms: float | None,
    ) -> list[NDArray[np.int64]]:
        """Return how much later than the trained delay after what was felt each target is, us.

        Targets behind the first inputs have the latency of the encoder in `behind_input_ms`.
        """
        if self._ends is not None:
            if self.alignment is None or self.alignment.train is None:
                edge = "ends" if self._ends.at_end else "that ended begins"
                raise ProblemError(f"{self._label}: no touch {edge} near its labels, to which they must be aligned")
            if not self._ends.at_end:
                return [_lasted(source, self._ends.train, times) for source, times in zip(sources, felt, strict=True)]
        if ages is not None and self.alignment is not None and self.alignment.train == ages.trains[0]:
            return [later_us(source, ages, to_ms(t), delay_ms) for source, t in zip(sources, felt, strict=True)]
        wait_ms = 0.0 if behind_input_ms is None else _first_input_ms(sources, felt, behind_input_ms)
        return [np.full(len(times), round(to_us(wait_ms)), np.int64) for times in felt]

    def _at(self, targets: NDArray[np.float64], neuron: Neuron, start: float) -> NDArray[np.float64]:
        """Return targets; those as touches end at the first point behind these ends of the grid that begins at `start`.

        There a potential that jumped is greatest, and silence before the target must not be asked of it.
        """
        if self._ends is None:
            return targets
        return start + neuron.step_ms * np.floor((targets - start) / neuron.step_ms + _SAME_STEP)

    @property
    def count(self) -> int:
        """The number of events."""
        return sum(map(len, self._label_times))

    def precedes_input(self, cone: ConeR) -> bool:
        """Whether most labels, which are not aligned, are so early that no neuron can fire by their targets."""
        return self.alignment is None and self._ends is None and 2 * len(cone.unreachable_) > self.count

    def _until_targets(self, sources: Sequence[SpikeTrains]) -> list[SpikeTrains]:
        """Return trains with an end after the last target, which may come after the last spike."""
        pairs = zip(sources, self._targets, strict=True)
        return [trains.lasting(max(trains.stop, *targets, trains.start)) for trains, targets in pairs]

    def _silent(
        self,
        followed: Followed | None,
        sources: Sequence[SpikeTrains],
        trains: Sequence[SpikeTrains],
        ages: Ages | None,
        neuron: Neuron,
    ) -> list[NDArray[np.float64]] | None:
        """Return the windows in which the neuron must be silent; None where it must at any time but at targets."""
        if ages is not None and neuron.kernel == "exponential":
            return [silent_windows(train, ages, t, neuron) for train, t in zip(trains, self._targets, strict=True)]
        if followed is not None:
            return silence(followed, sources, self._targets, self._unpaired(), self._shift_ms, neuron.step_ms)
        return None

    def _check_apart(self, name: str, times: NDArray[np.int64], refractory_ms: float) -> None:
        """Refuse labels, as they were felt, closer to each other than the neuron can fire."""
        times = np.sort(times)
        for k in np.flatnonzero(np.diff(times) <= to_us(refractory_ms))[:1]:
            before, t = times[k : k + 2].tolist()
            raise ProblemError(
                f"{self._label}: {name} has a label at {t} us, {t - before} us after the previous label; labels must "
                f"be more than {refractory_ms:g} ms apart, because the neuron fires once in that time: are the times "
                "in us, and is each label listed once?"
            )

    def _check_felt(self, trains: Sequence[SpikeTrains]) -> None:
        """Refuse an example with targets and without any spike up to them."""
        for name, train, times in zip(self._names, trains, self._targets, strict=True):
            if len(times) and not len(train.times):
                where = name if len(trains) > 1 else "the recording"
                events = counted(len(times), "event")
                error = ProblemError(
                    f"{self._label}: the sensor felt nothing in {where} up to the last of its {events}"
                )
                raise helped(error, "tare", "unfelt")

    def fits(self, recipe: Recipe) -> bool:
        """Whether the learner that a recipe describes needs these rows."""
        return self._needs == rows_of(recipe, self._label)

    def _unpaired(self) -> list[NDArray[np.float64]]:
        """Return the labels of each example that were not aligned, ms."""
        alignment = self.alignment
        assert alignment is not None
        return [
            to_ms(alignment.given[alignment.unpaired & (alignment.example == k)]) for k in range(len(self._label_times))
        ]

    def score(self, cone: ConeR, run_threshold: float) -> Score:
        """Return the score of a fitted learner on these examples, against the labels as given."""
        neuron = cone._on_grid()
        neuron.set_params(theta_0=run_threshold * neuron.theta_0)
        found, truths = [], []
        for source, times in zip(self._sources, self._label_times, strict=True):
            t = np.rint(to_us(neuron.run(cone.weights_, source) - self._shift_ms)).astype(np.int64)
            if self._ends is not None and not self._ends.at_end:
                t = EndedTouches.from_trains(source, self._ends.train).begin_of(t)
            found.append(Detections([self._label] * len(t), t, t))
            truths.append({self._label: times})
        return score_together(found, truths, FOLLOWED_MS)

    def seen(self, cone: ConeR) -> dict[str, Any]:
        """Return the range of the inputs of a fitted learner's neuron, those too that it does not learn from."""
        return seen(self._inputs, _core.neuron_memory_ms(cone.neuron_._json()), graded=self._graded)

    def fit(self, recipe: Recipe) -> ConeR:
        """Fit the learner that a recipe describes, beginning at the fit before, if any; warnings name events."""
        cone, _ = recipe.learner_of(self._label)
        with collected() as caught:
            self._before = self._rows.fit(
                cone,
                start=self._before,
                progress=lambda n, _rows, _objective, gap: self._report(
                    f"{self._what}, round {n}: weights at most {gap:.2%} from the best", 0, 0
                ),
            )
        begins = [_begin_ms(source) for source in self._sources]
        found = self.score(cone, recipe.run_threshold).found if cone.unreachable_ else 0
        for text_of in _remarks(cone, self._targets, self._names, self._shift_ms, begins, found, caught):
            warn(f"{self._label}: {text_of}", stacklevel=5)
        return cone


def _learns_one(encoder: Encoder) -> bool:
    """Whether a neuron learns from one of an encoder's trains alone."""
    return all(part._learns_one for part in encoder._each())


def _first_input_ms(sources: Sequence[SpikeTrains], felt: Sequence[NDArray[np.int64]], latency_ms: float) -> float:
    """Return how long after its label the first input spike comes, ms, of nine in ten labels that have one."""
    waits = []
    for source, times in zip(sources, felt, strict=True):
        spikes, labels = np.append(np.sort(source.times), np.inf), to_ms(times) + latency_ms
        waits.append(spikes[np.searchsorted(spikes, labels - WINDOW_MS)] - labels)
    wait = np.concatenate(waits)
    wait = wait[wait <= _MOST_WAIT_MS]
    return max(0.0, float(np.quantile(wait, _MOST_LABELS))) if len(wait) else 0.0


def _lasted(source: SpikeTrains, duration: int, felt: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how long the touches last that began at some times, us."""
    touches = EndedTouches.from_trains(source, duration)
    return touches.lasted[touches.beginning_near(felt)] if len(felt) else np.zeros(0, np.int64)


def _times(k: int, example: Example, label: str) -> NDArray[np.int64]:
    """Return the events of a label in the encoded example k, us, ascending; refuse one outside the example."""
    source, labels, *_ = example
    assert isinstance(source, SpikeTrains)
    events = np.sort(labels.get(label, np.empty(0, np.int64)))
    times = to_ms(events)
    outside = times[(times < source.start) | (times > source.stop + SILENCE_MS)]
    if len(outside):
        at, start, stop = (ms - _begin_ms(source) for ms in (outside[0], source.start, source.stop))
        raise ProblemError(
            f"{name_of(k, example)}: {label} at {at:.3f} ms is outside the trains, {start:.3f} to {stop:.3f} ms"
        )
    return events


def rows_of(recipe: Recipe, label: str) -> str:
    """Return what the rows of a label's learner depend on, as text."""
    cone, delay_ms = recipe.learner_of(label)
    values = {name: value for name, value in cone.get_params().items() if name not in ("neuron", *_NOT_OF_ROWS)}
    return parameters(values | {"delay_ms": delay_ms, "inputs": sorted(recipe.inputs_of(label))})


def _begin_ms(trains: SpikeTrains) -> float:
    """Return the time that text counts from, ms: the trains' first if they count from 1970, else 0."""
    return to_ms(beginning_us(np.array([round(float(to_us(trains.start)))])))


def _inputs(k: int, example: Example, recipe: Recipe, label: str, array: Array | None) -> SpikeTrains:
    """Return the trains of the encoded example k that a label's neuron receives."""
    trains, names, encoder = example.source, recipe.inputs_of(label), recipe.encoder
    assert isinstance(trains, SpikeTrains)
    if not names or not isinstance(encoder, Composite):
        return trains
    received = encoder.places(names, array or Array(1, 1))
    if len(received) != len(trains):
        trains_text = f"{counted(len(trains), 'train')}, but the encoders make {len(received)}"
        raise ProblemError(f"{name_of(k, example)}: {trains_text}: must be equally many")
    return trains.select(received)


def _remarks(
    cone: ConeR,
    targets: Sequence[NDArray[np.float64]],
    names: Sequence[str],
    shift_ms: float,
    begins_ms: Sequence[float],
    found: int,
    caught: Sequence[str],
) -> Iterator[str]:
    """Yield the warnings of a fit, which name events and examples; `found`: how many of the events it finds."""
    missed, count = cone.unreachable_, sum(map(len, targets))
    if missed:
        at = [(targets[p][k] - shift_ms - begins_ms[p], f" of {names[p]}" * (len(targets) > 1)) for p, k in missed]
        times_and_names = [f"{ms:.10g} ms{name}" for ms, name in at]
        listed = ", ".join(times_and_names[:3]) + f" and {len(times_and_names) - 3} more" * (len(times_and_names) > 3)
        why = f"{UNLEARNT} ({listed})"
        if found > count - len(missed):
            yield (
                f"the inputs of {len(missed)} of {counted(count, 'label')} come too late to fire at the label "
                f"({listed}); the neuron fires later, and finds {found} of {count}"
            )
        elif count < TWO_FOLDS:
            there = f"there {are(count)} {counted(count, 'event')} to learn from"
            yield f"{there}; {len(missed)} {why}"
        else:
            yield f"{len(missed)} of {count} events {why}" + "; the others were" * (len(missed) < count)
    # The learner names unreachable targets, if any, first.
    yield from caught[bool(missed) :]
