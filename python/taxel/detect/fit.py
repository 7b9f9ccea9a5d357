"""From labelled recordings to a readout: what `taxel train` fits to all of them, and to each part that it judges by."""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import finite, instance, parameters, several, shown
from taxel._base.messages import collected, counted, warn
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.ages import in_frames
from taxel.detect.alignment import WINDOW_MS, Alignment
from taxel.detect.board import noise_floor
from taxel.detect.changes import CHOOSING, LOADED, OF_FRAMES, TOMORROW, changed
from taxel.detect.choice import Choice, Ways, chosen
from taxel.detect.detector import raised
from taxel.detect.drift import followed, rest_of
from taxel.detect.examples import Example, array_of, check_examples, frame_ms, name_of, sizes_of, unit_of
from taxel.detect.fitted_point import FittedPoint, Inputs
from taxel.detect.floors import floor_alone, floor_of
from taxel.detect.folds import Fold, Part, inside, split, whole
from taxel.detect.loads import Loads, clock_of, lacks, lacks_neighbours
from taxel.detect.plain_rule import PlainRule
from taxel.detect.readout import SILENCE_MS, Readout
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import Score, score_together, tally
from taxel.detect.trained import TrainedNeuron
from taxel.detect.tuning import OFF, Tuning
from taxel.detections import Detections
from taxel.encode import Composite, Encoder, LocalLoad, Moments
from taxel.events import Events
from taxel.frames import Frames
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.wire import FRAME_US

#: How many fewer events a point must leave missed or false to count before the first of those to choose from.
_FEWER = 3
#: ... and that share of the labels: of many labels some were never felt.
_FEWER_SHARE = 0.05
#: A rule that finds this share of the labels of its training says when they were felt.
_ALIGNS = 0.95
_NO_FRAMES = np.empty(0, np.int64)
#: The rule of each label; None where none is better than to detect nothing.
Rules = Mapping[str, PlainRule | None]


class Trained(NamedTuple):
    """Hold what one training made.

    Attributes
    ----------
    recipe : Recipe
        With the points that were chosen.
    learners : mapping of str to ConeR or TrainedNeuron
        The fitted learners, by label; a neuron that never fires where nothing was felt and a rule detects the label.
    readout : Readout
        Their neurons and the plain rules, and which of both runs.
    alignments : mapping of str to Alignment
        By how much its labels were moved to what the sensor felt, by label; empty where the recipe does not align them.
    """

    recipe: Recipe
    learners: Mapping[str, ConeR | TrainedNeuron]
    readout: Readout
    alignments: Mapping[str, Alignment]


def fit(
    examples: Sequence[Example],
    recipe: Recipe,
    *,
    by_rule: Sequence[str] | None = None,
    window_ms: float = 50.0,
    progress: Progress | None = None,
) -> Readout:
    """Train a readout on labelled recordings: of each label a neuron and a plain rule, of which the better one runs.

    Parameters
    ----------
    examples : sequence of Example
        All of the same array. A label that an example lacks is not in it: that teaches silence.
    recipe : Recipe
    by_rule : sequence of str, optional
        The labels that their rule is to detect, as `taxel.detect.judge` finds them. Default: found by halves (Notes).
    window_ms : float, ms, 0 or more
        Largest distance of a detection from its label, for rules and for the choice.
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
    or where the recipe aligns labels what the sensor felt of it. Which of neuron and rule is better is found by
    training on each half of the data and detecting in the other, as it was recorded and as it might be on another day
    (`taxel.detect.changes`): what makes fewer mistakes by more than a standard error over the recordings, else what
    knows earlier by more than a fifth of the window, then what makes fewer.

    Examples
    --------
    >>> from taxel import Frames
    >>> from taxel.encode import LevelCrossing
    >>> frames = Frames([[[v]] for v in (0.0, 0.0, 9.0, 9.0, 0.0, 0.0)], range(0, 60_000, 10_000), unit="N")
    >>> recipe = Recipe(LevelCrossing([5.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})
    >>> fit([Example(frames, {"contact": [20_000]})], recipe)
    Readout(contact; LevelCrossing(levels=[5.0]) on 1 x 1 taxels; grid, keep)
    """
    stated = None if by_rule is None else several("by_rule", by_rule)
    fitter = Fitter(examples, recipe, window_ms=window_ms, progress=progress)
    trained = fitter.fit().readout
    return trained._with_rules(trained.rules, fitter.by_rule(fitter.whole) if stated is None else stated)


class Found(NamedTuple):
    """What a training detects in a part of an example."""

    by_neurons: Detections
    by_rules: Detections
    by_own: Detections
    """By the labels' own rules, of the quantity whose thresholds labels are."""


class _Received(NamedTuple):
    """What a neuron receives: the encoder, or some parts of a composite one, and its trains of each example."""

    encoder: Encoder
    latency_ms: float
    trains: Sequence[SpikeTrains]


class Fitter:
    """Fit readouts to parts of labelled examples; what all of them need is computed once.

    Parameters
    ----------
    examples : sequence of Example
    recipe : Recipe
    window_ms : float, ms
        Of scores.
    frame_us : float, us, optional
        As in `taxel.detect.run`.
    absorb_s : float, s, optional
        After how long a load that stays is rest, in frames; 0: the rest stays. Default: `taxel.detect.drift.rest_of`.
    progress : function of (step, done, all), optional

    Raises
    ------
    ProblemError : examples that are invalid, labels that the recipe does not know
    """

    def __init__(
        self,
        examples: Sequence[Example],
        recipe: Recipe,
        *,
        window_ms: float = 50.0,
        frame_us: float | None = None,
        absorb_s: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        if frame_us is not None:
            finite("frame_us", frame_us, least=1.0, most=3.6e9)
        clocks = [clock_of(example, frame_us) for example in examples] if isinstance(examples, Sequence) else []
        checked, self.clocks = check_examples(examples), clocks
        of_board = max(noise_floor(example[0]) for example in examples)
        #: By which loads are measured, in the sensor's unit.
        self.noise_floor = max(floor_of(checked), of_board)
        self._rest = rest_of(checked, self.noise_floor, absorb_s)
        self.examples = [followed(example, self._rest) for example in checked]
        self.window_ms = finite("window_ms", window_ms, least=0.0, most=3.6e6)
        self.report = reporting(progress)
        #: Makes the same fitter in another process, where nobody is told of its progress.
        self.made_anew = partial(Fitter, examples, recipe, window_ms=window_ms, frame_us=frame_us, absorb_s=absorb_s)
        #: All of the examples.
        self.whole = whole(self.examples)
        recipe = _above(instance("recipe", recipe, Recipe), of_board)
        self._in_frames = in_frames(recipe, self.examples, clocks)
        self._recipe = _possible(self._in_frames, self.examples)
        if self._rest is not None and self._rest["absorb_s"]:
            self._recipe = replace(self._recipe, encoder=_from_tare(self._recipe.encoder))
        self.array, self._unit = array_of(self.examples), unit_of(self.examples)
        self._pads = len(sizes_of(examples)) > 0
        self.labels = _labels_to_learn(self.examples, recipe)
        #: What keeps rules from being tried; empty where they are.
        self.lacks = lacks(self.examples)
        self._loads = None if self.lacks else Loads(self.examples, clocks, self.noise_floor, self.report)
        self._tuning = None if self._loads is None else Tuning(self._loads, self.labels, self.window_ms)
        # The quantity whose thresholds the labels are.
        self._own = min((example.labels_of for example in self.examples if example.labels_of), default=None)
        self._trains: dict[str, _Received] = {}
        self._read: Callable[[int], Example] = self.examples.__getitem__

    @cached_property
    def _changed(self) -> dict[str, Fitter]:
        """Fitters like this one that detect in other readings, by what is changed; they learn nothing."""
        if (loads := self._loads) is None:
            return {}

        @lru_cache(maxsize=1)
        def read(name: str, k: int) -> Example:
            return followed(changed(self.examples[k], name, self.noise_floor, loads.loaded_us[k]), self._rest)

        def reading(name: str) -> Fitter:
            other = copy(self)
            other._read, other._trains = partial(read, name), {}
            other._loads = Loads(self.examples, self.clocks, self.noise_floor, self.report, other._read)
            if name == LOADED:
                other.examples = [example._since(t) for example, t in zip(self.examples, loads.loaded_us, strict=True)]
            return other

        apply = CHOOSING if loads.taxels < 2 else CHOOSING | TOMORROW
        return {name: reading(name) for name in apply if loads.are_frames or name not in OF_FRAMES}

    def compared(
        self,
        labels: Sequence[str],
        trained: Sequence[tuple[Trained, Sequence[Part]]],
        changes: Collection[str] = (*CHOOSING, *TOMORROW),
    ) -> dict[str, Choice]:
        """Return which of neuron and rule detects each label better in parts that a training did not learn from."""
        if not labels:
            return {}
        parts = [part for _, each in trained for part in each]

        def scores(fitter: Fitter) -> Ways:
            found = [fitter.detected(one, part) for one, each in trained for part in each]
            return tuple(
                fitter.scores([getattr(one, way) for one in found], parts) for way in ("by_neurons", "by_rules")
            )

        changed = {name: scores(fitter) for name, fitter in self._changed.items() if name in changes}
        return chosen(labels, self.off_ms, scores(self), changed)

    def fit(self, parts: Sequence[Part] | None = None) -> Trained:
        """Return neurons and rules of parts of the examples, by default of all; the neurons run."""
        parts = self.whole if parts is None else parts
        plan, rules = self._recipe, self.rules(parts)
        learners: dict[str, ConeR | TrainedNeuron] = {}
        delays, alignments = {}, {}
        points: dict[str, Mapping[str, Any]] = {}
        for label in rules:
            try:
                best = self._best(label, parts, rules[label])
            except ProblemError as error:
                if error.hint != "unfelt" or rules[label] is None:
                    raise
                warn(f"{label}: its neuron feels nothing and never fires; its plain rule detects it", stacklevel=3)
                silent, points[label] = self._silent(label), plan.points_of(label)[0].values
                learners[label], delays[label] = silent, silent.delay_ms
                continue
            learners[label], points[label], delays[label] = best.learner, best.point, best.delay_ms
            if best.alignment is not None:
                alignments[label] = best.alignment
        plan = replace(plan, neurons=points)
        known = {label: rule for label, rule in rules.items() if rule is not None}
        readout = _readout_of(learners, delays, plan, array=self.array, unit=self._unit, rules=known)
        return Trained(plan, learners, readout._with(pads=self._pads, rest=self._rest), alignments)

    def _silent(self, label: str) -> TrainedNeuron:
        """Return a neuron that never fires."""
        learner, delay_ms = self._recipe.learner_of(label)
        trains = self._received(self._recipe.points_of(label)[0].values).trains
        return TrainedNeuron(learner._on_grid(), np.zeros(len(trains[0])), delay_ms)

    def decided(self, parts: Sequence[Part]) -> Trained:
        """Return neurons and rules of parts of the examples; what is better by halves of these parts runs."""
        trained = self.fit(parts)
        return trained._replace(readout=trained.readout._with_rules(trained.readout.rules, self.by_rule(parts)))

    def by_rule(self, parts: Sequence[Part]) -> tuple[str, ...]:
        """Return the labels that rules detect better than neurons, each judged on the half that it did not learn from.

        On the same parts where they cannot be halved.
        """
        if self._tuning is None:
            return ()
        try:
            halves = [fold for fold in split(self.examples, parts, 2) if self._has_all(fold.train)]
        except ProblemError:
            halves = []
        fitted: list[tuple[Trained, Sequence[Part]]] = []
        for fold in halves or [Fold(parts, parts)]:
            with collected(), contextlib.suppress(ProblemError):
                fitted.append((self.fit(fold.train), [self.scored(part) for part in fold.test]))
        better = self.compared(self.labels, fitted, CHOOSING) if fitted else {}
        return tuple(label for label, choice in better.items() if choice.by_rule)

    def _has_all(self, parts: Sequence[Part]) -> bool:
        """Whether parts have an event of each label."""
        return all(len(np.concatenate(self.labels_in(label, parts))) for label in self.labels)

    def rules(self, parts: Sequence[Part], *, own: bool = False) -> Rules:
        """Return the plain rule of each label, tuned on parts of the examples; or the labels' own rules."""
        if self._tuning is None or (own and self._own is None):
            return dict.fromkeys(self.labels)
        return self._tuning.best_rules(parts, self._own if own else None)

    def scored(self, part: Part) -> Part:
        """Return what is scored of a part of an example: by the recipe, no more than what is near its labels."""
        around, times = self._recipe.around_labels_ms, self.examples[part.example].labels.values()
        if around is None or not any(map(len, times)):
            return part
        t, around_us = np.concatenate(list(times)), float(to_us(around))
        return Part(part.example, max(part.start, t.min() - around_us), min(part.stop, t.max() + around_us))

    def detected(self, trained: Trained, part: Part, own: Rules | None = None) -> Found:
        """Return what the neurons and the rules of a training detect in a part, and what the labels' own rules do."""
        by_neurons = self._by_neurons(trained, part)
        return Found(by_neurons, self._by_rules(trained.readout.rules, part), self._by_rules(own or {}, part))

    def _by_neurons(self, trained: Trained, part: Part) -> Detections:
        """Return what the neurons detect in a part of an example, as `taxel.detect.run` finds it in the whole."""
        source = self.examples[part.example].source
        labels: list[str] = []
        columns: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]] = []
        for label, neuron in trained.readout.neurons.items():
            received = self._received(trained.recipe.points_of(label)[0].values)
            inputs = received.trains[part.example]
            if not isinstance(source, SpikeTrains):
                inputs = _from_first_spike(inputs, neuron.neuron)
            inputs = inputs.lasting(inputs.stop + SILENCE_MS)
            spikes, slopes = neuron.neuron._run(neuron.weights, inputs, trained.readout.run_threshold)
            t = np.rint(to_us(spikes - received.latency_ms - neuron.delay_ms)).astype(np.int64)
            inside = (t >= part.start) & (t < part.stop)
            labels += [label] * int(inside.sum())
            known = _known(spikes[inside], source, *self.clocks[part.example])
            columns.append((t[inside], known, slopes[inside]))
        t, known, slopes = (np.concatenate(column) for column in zip(*columns, strict=True))
        order = np.argsort(known, kind="stable")
        return Detections([labels[k] for k in order], t[order], known[order], slopes[order])

    def _by_rules(self, rules: Rules, part: Part) -> Detections:
        """Return what the rule of each label detects of it in a part of an example."""
        if self._loads is None or not rules:
            return Detections([], [], [])
        found = {label: self._loads.detected(rule, label, part) for label, rule in rules.items()}
        labels = [label for label, one in found.items() for _ in one.t]
        t, known = (np.concatenate([getattr(one, name) for one in found.values()]) for name in ("t", "known"))
        order = np.argsort(t, kind="stable")
        return Detections([labels[k] for k in order], t[order], known[order])

    def constants_ms(self) -> dict[str, float]:
        """Return by how much the labels of each name are later than what was felt, ms, of those that are."""
        constants = {} if self._tuning is None else {label: self._tuning.constant_ms(label) for label in self.labels}
        return {label: ms for label, ms in constants.items() if ms}

    @property
    def off_ms(self) -> float:
        """From how far off a detection is part of a mistake, ms."""
        return OFF * self.window_ms if self._tuning is None else self._tuning.off_ms

    @property
    def within(self) -> set[str]:
        """The labels that lie within touches, most of them."""
        return set() if self._tuning is None else self._tuning.within

    def labels_in(self, label: str, parts: Sequence[Part]) -> list[NDArray[np.int64]]:
        """Return the events of a label in parts of the examples, us, ascending."""
        nothing = np.empty(0, np.int64)
        return [np.sort(inside(self.examples[part.example].labels.get(label, nothing), part)) for part in parts]

    def scores(self, found: Sequence[Detections], parts: Sequence[Part]) -> list[Score]:
        """Return the score of detections in each part of the examples."""
        return [self.score([detected], [part]) for detected, part in zip(found, parts, strict=True)]

    def score(self, found: Sequence[Detections], parts: Sequence[Part]) -> Score:
        """Return the score of detections in parts of the examples, as one."""
        each = {label: self.labels_in(label, parts) for label in self.labels}
        truths = [{label: times[n] for label, times in each.items()} for n in range(len(parts))]
        return score_together(found, truths, self.window_ms, [self.examples[part.example].spans for part in parts])

    def _received(self, point: Mapping[str, Any]) -> _Received:
        """Return what a neuron with these parameters receives of all examples."""
        key = json.dumps({**self._recipe.learner, **point}.get("inputs"), default=str)
        if key not in self._trains:
            encoder = self._recipe._received(point)
            trains = [self._encoded(k, encoder, point) for k in range(len(self.examples))]
            self._trains[key] = _Received(encoder, encoder.latency_ms, trains)
        return self._trains[key]

    def _encoded(self, k: int, received: Encoder, point: Mapping[str, Any]) -> SpikeTrains:
        example, encoder = self._read(k), self._recipe.encoder
        trains = example.source
        if isinstance(trains, SpikeTrains):
            trains = trains.split_by_sign() if trains.signed else trains
            if received == encoder or not isinstance(encoder, Composite):
                return trains
            places = encoder.places(point["inputs"], self.array or Array(1, 1))
            if len(places) != len(trains):
                trains_text = f"{counted(len(trains), 'train')}, but the encoders make {len(places)}"
                raise ProblemError(f"{name_of(k, example)}: {trains_text}: must be equally many")
            return trains.select(places)
        self.report(f"encoding {k + 1} of {len(self.examples)}", 0, 0)
        with_rest = received if example.tare is None else received.with_tare(example.tare)
        trains = with_rest.encode(trains)
        return trains.split_by_sign() if trains.signed else trains

    def _best(self, label: str, parts: Sequence[Part], rule: PlainRule | None) -> FittedPoint:
        """Return the first of the points to choose from, or a later one that leaves fewer events missed or false.

        They are tried in turn. A later one counts if it leaves as many fewer as its `fewer` says, else `_FEWER`, and
        `_FEWER_SHARE` of the labels, as some more or less are chance; with 0 it counts if it leaves no more. A later
        point that cannot be learnt is left out. If the first felt nothing, which counts as all labels missed, a later
        one must leave as many fewer, or none. Warnings are those of the point that counts.
        """
        points = self._recipe.points_of(label)
        felt = self._felt(label, parts, rule) if self._recipe.align else None
        count = sum(map(len, self.labels_in(label, parts)))
        best, refused = None, None
        try:
            best = self._fitted(label, points[0].values, parts, felt)
        except ProblemError as error:
            if error.hint != "unfelt":
                raise
            refused = error
        usual = max(_FEWER, _FEWER_SHARE * count)
        for point, stated in points[1:]:
            fewer = usual if stated is None else stated
            wrong, fewer = (count, min(max(1, fewer), count)) if best is None else (best.wrong, fewer)
            if wrong < fewer:
                continue
            with contextlib.suppress(ProblemError):
                second = self._fitted(label, point, parts, felt)
                if second.wrong <= wrong - fewer:
                    best = second
        if best is None:
            assert refused is not None
            raise refused
        # What happens within a touch is for rules.
        for caught in () if rule is not None and rule.touched_ms is not None else best.caught:
            warn(caught, stacklevel=4)
        return best

    def _fitted(
        self,
        label: str,
        point: Mapping[str, Any],
        parts: Sequence[Part],
        felt: Sequence[NDArray[np.float64]] | None,
    ) -> FittedPoint:
        """Return one point of a label's neuron, fitted."""
        received = self._received(point)
        cut = [_cut(received.trains[part.example], part) for part in parts]
        given = self.labels_in(label, parts)
        inputs = Inputs(label, received.encoder, cut, given, felt, parts, self.examples, self.array, self.report)
        return inputs.fitted(self._recipe, point)

    def _felt(self, label: str, parts: Sequence[Part], rule: PlainRule | None) -> list[NDArray[np.float64]] | None:
        """Return when a rule felt each event of a label in parts, us, NaN of those that it misses; None if many are."""
        labels = self.labels_in(label, parts)
        if rule is None or self._loads is None:
            return None
        times = [np.full(len(each), np.nan) for each in labels]
        for felt, given, part in zip(times, labels, parts, strict=True):
            # The trains of what was felt come at its own time, which the rule's constant is not taken off.
            t = self._loads.detected(rule, label, part).t + round(float(to_us(rule.constant_ms)))
            if (pairs := tally(t, t, given, round(to_us(WINDOW_MS)))) is not None:
                felt[pairs.events] = t[pairs.detected]
        count = sum(map(len, labels))
        return times if np.isfinite(np.concatenate(times)).sum() >= _ALIGNS * count else None


def _from_first_spike(trains: SpikeTrains, neuron: Neuron) -> SpikeTrains:
    """Return trains that begin where a stream's neuron does: its grid begins at or before its first spike."""
    first = float(trains.times.min(initial=trains.stop))
    start = first if neuron.time == "continuous" else min(first, np.floor(first / neuron.step_ms) * neuron.step_ms)
    return SpikeTrains(trains.times, trains.offsets, float(start), trains.stop, trains.values, kind=trains.kind)


def _known(
    crossings_ms: NDArray[np.float64], source: object, frame_us: float | None, wire_version: int
) -> NDArray[np.int64]:
    """Return when crossings in a source are known, us: at the end of a frame, of spike trains at once."""
    if isinstance(source, Frames):
        period_us = to_us(frame_ms(source)) if frame_us is None else frame_us
        return _core.frame_ends(crossings_ms, float(period_us), wire_version, source.t)
    if isinstance(source, Events):
        return _core.frame_ends(crossings_ms, FRAME_US if frame_us is None else frame_us, wire_version, _NO_FRAMES)
    known: NDArray[np.int64] = np.rint(to_us(crossings_ms)).astype(np.int64)
    return known


def _above(recipe: Recipe, noise_floor: float) -> Recipe:
    """Return a recipe whose encoder has noise floors of so much at least."""
    parts = json.loads(recipe.encoder.to_json())
    above = raised(parts, noise_floor)
    return recipe if above == parts else replace(recipe, encoder=Encoder.from_json(parameters(above)))


def _from_tare(encoder: Encoder) -> Encoder:
    """Return an encoder whose local loads are from the tare, where the rest of all that is read follows.

    Their own rest, which follows what is far in 20 s, swallows presses of half a minute (fingers: 154 of 550).
    """
    if isinstance(encoder, Composite):
        return Composite({name: _from_tare(part) for name, part in encoder.parts.items()})
    return copy(encoder).set_params(rest="tare") if isinstance(encoder, LocalLoad) else encoder


def _possible(recipe: Recipe, examples: Sequence[Example]) -> Recipe:
    """Return the recipe without the points to choose from that (checked) examples do not allow.

    The local load requires a tare; channels have no neighbours, so that only encoders that need none remain, and their
    noise alone must not load them.
    """
    if lacks_neighbours(examples) and isinstance(recipe.encoder, Composite):
        near = {name for name, part in recipe.encoder.parts.items() if part._needs_neighbours}
        recipe = recipe._without_parts(near)
        assert isinstance(recipe.encoder, Composite)
        parts = {
            name: copy(part).set_params(noise_floor=floor_alone(examples, part.noise_floor, kinds=len(recipe.neurons)))
            if isinstance(part, Moments)
            else part
            for name, part in recipe.encoder.parts.items()
        }
        recipe = replace(recipe, encoder=Composite(parts))
    if isinstance(recipe.encoder, Composite) and any(example.tare is None for example in examples):
        by_tare = {name for name, part in recipe.encoder.parts.items() if isinstance(part, LocalLoad)}
        recipe = recipe._without_parts(by_tare)
    return recipe


def _readout_of(
    learners: Mapping[str, ConeR | TrainedNeuron], delays_ms: Mapping[str, float], recipe: Recipe, **parts: Any
) -> Readout:
    """Return the readout of fitted learners with their delays, behind the encoder of the recipe that made them.

    Of a composite encoder the readout has the parts that its neurons receive; where that is one, it is the encoder.
    """
    encoder, inputs = recipe.encoder, {label: recipe.inputs_of(label) for label in learners}
    if isinstance(encoder, Composite):
        used = {name for label in learners for name in recipe.inputs_of(label) or encoder.parts}
        encoder = encoder.only(sorted(used))
        inputs = inputs if isinstance(encoder, Composite) else {}
    threshold = float(recipe.run_threshold)
    return Readout(encoder, learners, delay_ms=delays_ms, run_threshold=threshold, inputs=inputs, **parts)


def _labels_to_learn(examples: Sequence[Example], recipe: Recipe) -> tuple[str, ...]:
    """Return the labels that are learnt: the recipe's, or where it has none those of the examples."""
    given = sorted({label for example in examples for label in example.labels})
    labels = tuple(recipe.neurons) or tuple(given)
    if not labels:
        raise ProblemError("no label in any example: there is nothing to learn")
    for label in set(given) - set(labels):
        raise ProblemError(
            f"label {shown(label)} has no neuron: the recipe has {', '.join(map(repr, labels))}; "
            f"give it a section, {_setting(label)}, or leave it out of the labels"
        )
    return labels


def _setting(label: str) -> str:
    """Return how a parameter of a label's neuron is written in a recipe, and as an option."""
    quote = "" if re.fullmatch(r"[\w-]+", label, re.ASCII) else '"'
    return f"[neurons.{quote}{label}{quote}] in a recipe or --set {quote}neurons.{label}.tau=0.5{quote}"


def _cut(trains: SpikeTrains, part: Part) -> SpikeTrains:
    """Return the spike trains of an example in a part of it."""
    start, stop = max(to_ms(part.start), trains.start), min(to_ms(part.stop), trains.stop)
    return trains.between(start, max(start, stop))
