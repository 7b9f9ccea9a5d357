"""From labelled recordings to a readout: what `taxel train` does."""

from __future__ import annotations

import inspect
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import callback, finite, flag, instance, mapping, number, parameters, several, shown, text
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import recipes
from taxel.detect.alignment import Alignment, align
from taxel.detect.examples import Example, array_of, checked
from taxel.detect.readout import SILENCE_MS, Readout
from taxel.encode import Encoder
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains, to_ms, to_us

__all__ = ["Recipe", "Trained", "train"]


#: Keys of a recipe's file that a recipe does not hold: which recordings it fits, whose parameters other labels have.
_OF_THE_FILE = ("fits", "other")


@dataclass(frozen=True)
class Recipe:
    """Describe how to train a readout.

    Parameters
    ----------
    encoder : Encoder
    learner : mapping
        Parameters of `taxel.learn.ConeR` for all neurons, and `delay_ms`: how much later than the event a neuron is
        trained to fire, the encoder's latency apart.
    neurons : mapping of str to mapping
        The same by label, before those for all; a `search` lists other points, each as changes of that neuron. Where
        there are any, only these labels are learnt.
    run_threshold : float, above 0
        See `taxel.Readout`.
    about, source : str
        What it is for, and where its values come from.
    align : bool
        Whether labels are moved to what the sensor felt (`Alignment`) before they are learnt: then `t` of a detection
        is when the sensor felt the event. For labels that one input follows each time, as it does contact and lift;
        labels that say of which kind a touch is have none, so recipes for them leave it off. Scores are against the
        labels as given.

    Raises
    ------
    ProblemError : a parameter that is not known (names it) or is invalid; a `delay_ms` that is none of the encoder's
        `ages_ms`

    Examples
    --------
    >>> from taxel.encode import ContactArea
    >>> recipe = Recipe(ContactArea(), {"refractory": 15.0}, {"contact": {"tau": 0.5, "delay_ms": 0.2}})
    >>> recipe.learner_of("contact")
    (ConeR(neuron=Neuron(tau=0.5, refractory=15.0, time='grid')), 0.2)
    """

    encoder: Encoder
    learner: Mapping[str, Any] = field(default_factory=dict)
    neurons: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    run_threshold: float = 1.0
    about: str = ""
    source: str = ""
    align: bool = False

    def __post_init__(self) -> None:
        instance("encoder", self.encoder, Encoder)
        if not finite("run_threshold", self.run_threshold) > 0:
            raise ProblemError(f"run_threshold is {shown(self.run_threshold)}: must be above 0 and finite")
        text("about", self.about)
        text("source", self.source)
        flag("align", self.align)
        if not isinstance(self.neurons, Mapping):
            raise ProblemError(f"neurons is {shown(self.neurons)}: must be parameters by label")
        learner_from("learner", self.learner)
        for label in self.neurons:
            self.learner_of(text("label", label))
            for point in self.points_of(label):
                place = f"neurons.{label}.search"
                _check_age(place, learner_from(place, {**self.learner, **point})[1], self.encoder)

    def learner_of(self, label: str) -> tuple[ConeR, float]:
        """Return the learner of a label, not yet fitted, and the delay with which it is trained.

        Parameters
        ----------
        label : str

        Returns
        -------
        ConeR
        float, ms

        Raises
        ------
        ProblemError : a label that the recipe does not know, or a delay that is none of the encoder's `ages_ms`

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> Recipe(LevelCrossing([1.0]), {"delay_ms": 1.0}, {"contact": {"ub": 2.0}}).learner_of("contact")[1]
        1.0
        """
        own = self.neurons.get(text("label", label), {})
        if not isinstance(own, Mapping):
            raise ProblemError(f"neurons.{label} is {shown(own)}: must be parameters by name")
        learner, delay_ms = learner_from(f"neurons.{label}", {**self.learner, **self.points_of(label)[0]})
        _check_age(f"neurons.{label}", delay_ms, self.encoder)
        return learner, delay_ms

    def points_of(self, label: str) -> list[dict[str, Any]]:
        """Return the parameters of a label's neuron, and behind them the others that the recipe lists for a search.

        Parameters
        ----------
        label : str

        Raises
        ------
        ProblemError : a label that the recipe does not know

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> recipe = Recipe(LevelCrossing([1.0]), {}, {"contact": {"ub": 2.0, "search": [{"ub": 3.0}]}})
        >>> recipe.points_of("contact")
        [{'ub': 2.0}, {'ub': 3.0}]
        """
        own = dict(self.neurons.get(text("label", label), {}))
        listed = several(f"neurons.{label}.search", own.pop("search", ()))
        return [own, *({**own, **mapping(f"neurons.{label}.search", point)} for point in listed)]

    def _labels(self, examples: Sequence[Example]) -> tuple[str, ...]:
        """Return the labels that are learnt: the recipe's, or where it has none those of the examples."""
        return tuple(self.neurons) or tuple(sorted({label for example in examples for label in example.labels}))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Recipe:
        """Build a recipe from plain values, whose keys are its parameters.

        The encoder is a table with its `name` and parameters, where "none" stands for None: TOML has no word for it.
        What a recipe's file says of the recordings that it `fits` and of any `other` label is for `load`.

        Parameters
        ----------
        values : mapping

        Returns
        -------
        Recipe

        Raises
        ------
        ProblemError : a key that is not known (names it), or no encoder

        Examples
        --------
        >>> Recipe.from_dict({"encoder": {"name": "fa1"}, "learner": {"tau": 5.0}}).learner
        {'tau': 5.0}
        """
        if not isinstance(values, Mapping):
            raise ProblemError(f"recipe is {shown(values)}: must be values by name")
        known = tuple(inspect.signature(cls).parameters)
        for key in values:
            if key not in (*known, *_OF_THE_FILE):
                raise ProblemError(f"recipe: no key {shown(key)}: there are {', '.join(known)}")
        encoder = values.get("encoder")
        if not isinstance(encoder, Mapping):
            raise ProblemError(
                "recipe: says no encoder: name one, as --encoder contact_area or [encoder] in the recipe"
            )
        own = {key: value for key, value in values.items() if key in known}
        stated = {name: None if value == "none" else value for name, value in encoder.items()}
        return cls(**{**own, "encoder": Encoder.from_json(parameters(stated))})

    @classmethod
    def load(
        cls,
        recipe: str | os.PathLike[str],
        changes: Mapping[str, Any] | None = None,
        labels: Sequence[str] | None = None,
    ) -> Recipe:
        """Load one of `taxel.detect.recipes.names`, or a TOML or JSON file, whose path holds a dot or a slash.

        Parameters
        ----------
        recipe : str or path
        changes : mapping, optional
            Other values by dotted key, as ``learner.tau``: those of ``learner`` come before what the recipe has for
            one neuron, those of ``neurons.LABEL`` before all.
        labels : sequence of str, optional
            What is to be learnt: a recipe that has parameters for any `other` label gets a neuron for each.

        Raises
        ------
        FormatError : neither TOML nor JSON
        ProblemError : a name or key that is not known, or a value that is invalid
        FileNotFoundError : no such file

        Examples
        --------
        >>> recipe = Recipe.load("gait_insole", {"learner.tau": 20.0}, labels=["contact", "foot off"])
        >>> recipe.learner_of("foot off")[1], sorted(recipe.neurons)
        (8.0, ['contact', 'foot off'])
        """
        for key in changes if isinstance(changes, Mapping) else ():
            if text("key", key).partition(".")[0] in _OF_THE_FILE:
                raise ProblemError(
                    f"{key}: says for what a recipe's file is chosen, so a change of it does nothing: change learner "
                    "or neurons, or write a recipe of your own"
                )
        values = recipes.read(recipe)
        if labels is not None:
            values = recipes.for_labels(values, several("labels", labels))
        return cls.from_dict(changed(values, {} if changes is None else changes))


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


def changed(values: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return values changed at dotted keys; a change for all neurons takes precedence over a neuron's own value."""
    if not isinstance(changes, Mapping):
        raise ProblemError(f"changes is {shown(changes)}: must be values by dotted key")
    values = json.loads(json.dumps(values))
    for key in changes:
        table, _, name = text("key", key).partition(".")
        own = values.get("neurons")
        for neuron in own.values() if table == "learner" and isinstance(own, dict) else ():
            if isinstance(neuron, dict):
                neuron.pop(name, None)
    for key, value in changes.items():
        *tables, last = key.split(".")
        place = values
        for table in tables:
            place = place.setdefault(table, {})
            if not isinstance(place, dict):
                raise ProblemError(f"{key}: {table} is a value and holds no other")
        place[last] = value
    return values


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
    instance("recipe", recipe, Recipe)
    return learn(encoded(sound, recipe, report), recipe, array_of(sound), report)


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
    """Return the readout of fitted learners, behind the encoder of the recipe that they were made by."""
    delays = {label: recipe.learner_of(label)[1] for label in learners}
    return Readout(recipe.encoder, learners, array=array, delay_ms=delays, run_threshold=float(recipe.run_threshold))


def learn(patterns: Sequence[Example], recipe: Recipe, array: Array | None, report: Callable[[str], object]) -> Trained:
    """Fit the learner of each of a recipe's labels on encoded examples; see `train`."""
    learners, alignments = {}, {}
    for label in _labels_to_learn(patterns, recipe):
        fitting = Fitting(patterns, recipe, label, report)
        learners[label] = fitting.fit(recipe)
        if fitting.alignment is not None:
            alignments[label] = fitting.alignment
    return Trained(recipe, learners, readout_of(learners, recipe, array), alignments)


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
    """The rows of one label's learner on encoded examples, for a recipe and all others that differ in `lambdas` alone.

    Raises
    ------
    ProblemError : no example has such an event, or one lies outside its example (names it)
    """

    def __init__(
        self, examples: Sequence[Example], recipe: Recipe, label: str, report: Callable[[str], object]
    ) -> None:
        self._label = label
        self._needs = _rows_of(recipe, label)
        learner, delay_ms = recipe.learner_of(label)
        self._shift_ms = recipe.encoder.latency_ms + delay_ms
        given = [_times(k, one, label) for k, one in enumerate(examples)]
        count = sum(map(len, given))
        if not count:
            raise ProblemError(f"{label}: no example has such an event, so it cannot be learnt")
        sources: list[SpikeTrains] = [one.source for one in examples]  # type: ignore[misc]
        self.alignment = align(sources, label, given, recipe.encoder.latency_ms) if recipe.align else None
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
        return self._needs == _rows_of(recipe, self._label)

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


def _rows_of(recipe: Recipe, label: str) -> str:
    """Return what the rows of a label's learner depend on, as text."""
    cone, delay_ms = recipe.learner_of(label)
    values = {name: value for name, value in cone.get_params().items() if name not in ("lambdas", "neuron")}
    return parameters(values | {"delay_ms": delay_ms})


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


def _check_age(place: str, delay_ms: float, encoder: Encoder) -> None:
    """Refuse a delay at which none of the encoder's trains of ages begins: such a neuron fires late, or never."""
    ages = getattr(encoder, "ages_ms", None)
    if ages is not None and round(to_us(delay_ms)) not in {round(to_us(age)) for age in ages}:
        listed = ", ".join(f"{age:g}" for age in ages)
        raise ProblemError(
            f"{place}: delay_ms is {delay_ms:g}, and the encoder's ages_ms are {listed}: must be one of them, as a "
            "neuron is trained to fire where an age begins"
        )


def learner_from(name: str, values: Mapping[str, Any]) -> tuple[ConeR, float]:
    """Return the learner that plain values describe, and the delay it is trained with (ms); `name` is for errors."""
    if not isinstance(values, Mapping):
        raise ProblemError(f"{name} is {shown(values)}: must be parameters by name")
    values = dict(values)
    delay_ms = number(f"{name}.delay_ms", values.pop("delay_ms", 0.0), "ms")
    # In a recipe a neuron's parameters stand among the learner's, which is trained on a grid whatever its clock.
    cone = ConeR()
    own = [key for key in cone.get_params(deep=False) if key != "neuron"]
    neuron = [key for key in Neuron().get_params() if key != "time"]
    for key in values:
        if key not in own + neuron:
            raise ProblemError(f"{name}: no parameter {shown(key)}: there are {', '.join(neuron + own)} and delay_ms")
    nested = {f"neuron__{key}" if key in neuron else key: value for key, value in values.items()} | {
        "neuron__time": "grid"
    }
    return cone.set_params(**nested), delay_ms
