"""The recipe of a training: which encoder, and of each label's neuron what it is and what it receives."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from taxel._base.arguments import finite, flag, instance, integer, mapping, number, parameters, several, shown, text
from taxel._base.errors import helped, refused
from taxel._core import ProblemError
from taxel.detect import recipes
from taxel.encode import Composite, Encoder
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.spikes import to_us

__all__ = ["Recipe", "change_values", "learner_from", "with_floor"]


#: Keys of a recipe's file that a recipe does not hold: which recordings it fits, whose parameters other labels have.
_OF_THE_FILE = ("fits", "also", "within", "other")


class Point(NamedTuple):
    """Hold parameters of a neuron that a training tries.

    Attributes
    ----------
    values : mapping
        Those of all neurons not among them.
    fewer : int, 0 or more, optional
        With so many fewer mistakes it counts; None: as usual (`Recipe`).
    """

    values: Mapping[str, Any]
    fewer: int | None = None


@dataclass(frozen=True)
class Recipe:
    """Describe how to train a readout.

    Parameters
    ----------
    encoder : Encoder
        Several side by side are a `taxel.encode.Composite`, in a file tables ``[encoders.NAME]``.
    learner : mapping
        Parameters of `taxel.learn.ConeR` for all neurons, and `delay_ms`: how much later than the event a neuron is
        trained to fire, the encoder's latency apart. With a composite encoder also `inputs`: the names of the parts
        whose trains a neuron receives, in any order; default: all.
    neurons : mapping of str to mapping
        The same by label, before those for all. `choose` lists other points, each as changes of that neuron, that every
        training tries in turn: a point counts if it leaves so many `fewer` events of the training data missed or false
        than the best point before it, by default three and 5 % of the labels. Where there are any neurons, only these
        labels are learnt.
    run_threshold : float, above 0
        See `taxel.Readout`.
    about, source : str
        What it is for, and where its values come from.
    align : bool
        Whether labels are moved to what the sensor felt (`Alignment`) before they are learnt: then `t` of a detection
        is when the sensor felt the event. Meant for labels that the same input follows each time, such as contact and
        lift. Labels of the kinds of touches have no such input, so their recipes leave it off. Scores are against the
        labels as given.
    around_labels_ms : float, 0 or more, ms, optional
        What is farther from an example's first and last label is not scored, as what goes on there, such as steps, has
        no label. Default: all of it is scored, and nothing happened where no label is.

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
    around_labels_ms: float | None = None

    def __post_init__(self) -> None:
        instance("encoder", self.encoder, Encoder)
        if not finite("run_threshold", self.run_threshold) > 0:
            raise refused("run_threshold", f" is {shown(self.run_threshold)}: must be above 0 and finite")
        text("about", self.about)
        text("source", self.source)
        flag("align", self.align)
        if self.around_labels_ms is not None:
            finite("around_labels_ms", self.around_labels_ms, least=0.0)
        if not isinstance(self.neurons, Mapping):
            raise refused("neurons", f" is {shown(self.neurons)}: must be parameters by label")
        learner_from("learner", self.learner)
        for label in self.neurons:
            for k, point in enumerate(self.points_of(label)):
                self._checked(f"neurons.{label}{'.choose' * (k > 0)}", point.values)

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
        return self._checked(f"neurons.{label}", self.points_of(label)[0].values)

    def _checked(self, location: str, values: Mapping[str, Any]) -> tuple[ConeR, float]:
        """Return the learner and the delay of one point, whose inputs exist and whose delay is one of their ages."""
        learner, delay_ms = learner_from(location, {**self.learner, **values})
        try:
            parts = self._received(values)._each()
        except ProblemError as error:
            raise ProblemError(f"{location}: {error}") from None
        for part in parts:
            _check_age(location, delay_ms, part)
        return learner, delay_ms

    def _received(self, values: Mapping[str, Any]) -> Encoder:
        """Return the encoder whose trains a neuron receives: all of it, or of a composite one its `inputs`.

        Parameters
        ----------
        values : mapping
            The neuron's parameters.

        Raises
        ------
        ProblemError : `inputs` that are not parts of a composite encoder
        """
        inputs = {**self.learner, **values}.get("inputs")
        if inputs is None:
            return self.encoder
        if not isinstance(self.encoder, Composite):
            raise refused("inputs", f" is {shown(inputs)}: must be left out, because there is only one encoder")
        return self.encoder.only(several("inputs", inputs))

    def inputs_of(self, label: str) -> tuple[str, ...]:
        """Return the parts of a composite encoder that a label's neuron receives; none where it receives all trains.

        Parameters
        ----------
        label : str

        Returns
        -------
        tuple of str

        Raises
        ------
        ProblemError : a label that the recipe does not know

        Examples
        --------
        >>> from taxel.encode import Composite, ContactArea, Moments
        >>> encoder = Composite({"area": ContactArea(), "moments": Moments()})
        >>> Recipe(encoder, neurons={"contact": {"inputs": ["area"]}, "ball": {}}).inputs_of("contact")
        ('area',)
        """
        return tuple(several("inputs", {**self.learner, **self.points_of(label)[0].values}.get("inputs", ())))

    def points_of(self, label: str) -> list[Point]:
        """Return the parameters of a label's neuron, and behind them others that every training tries.

        Parameters
        ----------
        label : str

        Raises
        ------
        ProblemError : a label that the recipe does not know

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> recipe = Recipe(LevelCrossing([1.0]), {}, {"contact": {"ub": 2.0, "choose": [{"ub": 3.0, "fewer": 0}]}})
        >>> recipe.points_of("contact")
        [Point(values={'ub': 2.0}, fewer=None), Point(values={'ub': 3.0}, fewer=0)]
        """
        listed, name = self.neurons.get(text("label", label), {}), f"neurons.{label}.choose"
        if not isinstance(listed, Mapping):
            raise ProblemError(f"neurons.{label} is {shown(listed)}: must be parameters by name")
        first = {key: value for key, value in listed.items() if key != "choose"}
        points = [Point(first)]
        for point in several(name, listed.get("choose", ())):
            values = {**first, **mapping(name, point)}
            fewer = values.pop("fewer", None)
            points.append(Point(values, None if fewer is None else integer(f"{name}: fewer", fewer, 0)))
        return points

    def _with_points(self, points: Mapping[str, Sequence[Point]]) -> Recipe:
        """Return the recipe with other points of its neurons, by label."""
        neurons = {
            label: {
                **first.values,
                "choose": [{**values, **({} if fewer is None else {"fewer": fewer})} for values, fewer in others],
            }
            for label, (first, *others) in points.items()
        }
        return replace(self, neurons=neurons)

    def _without_parts(self, names: Collection[str]) -> Recipe:
        """Return the recipe without the points that receive any of some parts of a composite encoder.

        Of a neuron whose first point is among these the next one is the first; one without any other keeps it.

        Parameters
        ----------
        names : collection of str
        """
        if not isinstance(self.encoder, Composite):
            return self
        parts = self.encoder.parts

        def left(label: str) -> list[Point]:
            points = self.points_of(label)
            inputs = [{**self.learner, **point.values}.get("inputs", parts) for point in points]
            kept = [point for point, of_point in zip(points, inputs, strict=True) if not set(names) & set(of_point)]
            return kept or points

        return self._with_points({label: left(label) for label in self.neurons})

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Recipe:
        """Build a recipe from plain values, whose keys are its parameters.

        The encoder is a table with its `name` and parameters, where "none" stands for None: TOML has no word for it.
        Instead of `encoder` there may be `encoders`: several such tables by name, as the parts of one composite.
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
            raise ProblemError(f"recipe is {shown(values)}: must be a dict (names and values)")
        known = tuple(inspect.signature(cls).parameters)
        for key in values:
            if key not in (*known, "encoders", *_OF_THE_FILE):
                raise ProblemError(f"a recipe has no key {shown(key)}: its keys are {', '.join(known)}, encoders")
        arguments = {key: value for key, value in values.items() if key in known}
        return cls(**{**arguments, "encoder": _encoder_of(values)})

    @classmethod
    def load(
        cls,
        recipe: str | os.PathLike[str],
        changes: Mapping[str, Any] | None = None,
        labels: Sequence[str] | None = None,
        noise_floor: float | None = None,
    ) -> Recipe:
        """Load one of `taxel.detect.recipes.names`, or a TOML or JSON file, whose path contains a dot or a slash.

        Parameters
        ----------
        recipe : str or path
        changes : mapping, optional
            Other values by dotted key, as ``learner.tau``: those of ``learner`` come before what the recipe has for
            one neuron, those of ``neurons.LABEL`` before all.
        labels : sequence of str, optional
            What is to be learnt: a recipe that has parameters for any `other` label gets a neuron for each.
        noise_floor : float, above 0, in the sensor's unit, optional
            That of the encoders for which the recipe states none, instead of a board's 3 ticks.

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
        values = recipes.read(recipe)
        if labels is not None:
            values = recipes.for_labels(values, several("labels", labels))
        values = change_values(values, {} if changes is None else changes)
        return cls.from_dict(values if noise_floor is None else with_floor(values, noise_floor))


def _encoder_of(values: Mapping[str, Any]) -> Encoder:
    """Return the encoder of a recipe's plain values, or several as a composite."""
    single, each = values.get("encoder"), values.get("encoders")
    if isinstance(single, Mapping) == isinstance(each, Mapping):
        if single is not None and each is not None:
            raise refused("recipe", ": encoder and encoders are both given: give only one of them")
        raise helped(ProblemError("recipe: states no encoder: add [encoder]"), "encoder", "give")

    def stated(encoder: Mapping[str, Any]) -> Encoder:
        return Encoder.from_json(parameters({n: None if v == "none" else v for n, v in encoder.items()}))

    if isinstance(single, Mapping):
        return stated(single)
    assert each is not None
    parts = {}
    for name, table in each.items():
        try:
            parts[name] = stated(mapping(f"encoders.{name}", table))
        except ProblemError as error:
            raise ProblemError(f"recipe: encoders.{name}: {error}") from None
    return Composite(parts)


def with_floor(values: Mapping[str, Any], noise_floor: float) -> dict[str, Any]:
    """Return a recipe's plain values with a noise floor in each encoder that has one and does not state it.

    The least noise of a taxel belongs to the floor: it is a tenth of it, as .3 is of the board's 3 ticks.
    """
    floor = finite("noise_floor", noise_floor)
    floors = {"noise_floor": floor, "least_noise": floor / 10.0}

    def stated(table: Mapping[str, Any]) -> dict[str, Any]:
        known = inspect.signature(Encoder._by_name.get(str(table.get("name")), Encoder)).parameters
        return {**{name: value for name, value in floors.items() if name in known}, **table}

    encoders = {name: stated(table) for name, table in values.get("encoders", {}).items()}
    return {
        **values,
        **({"encoders": encoders} if encoders else {}),
        **({"encoder": stated(values["encoder"])} if "encoder" in values else {}),
    }


def change_values(values: dict[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return values changed at dotted keys; a change for all neurons takes precedence over a neuron's own value."""
    if not isinstance(changes, Mapping):
        raise refused("changes", f" is {shown(changes)}: must be values by dotted key")
    values = json.loads(json.dumps(values))
    for key in changes:
        table, _, name = text("key", key).partition(".")
        neurons = values.get("neurons")
        for neuron in neurons.values() if table == "learner" and isinstance(neurons, dict) else ():
            if isinstance(neuron, dict):
                neuron.pop(name, None)
    for key, value in changes.items():
        *tables, last = key.split(".")
        inner = values
        for table in tables:
            inner = inner.setdefault(table, {})
            if not isinstance(inner, dict):
                raise ProblemError(f"{key}: {table} is a value, so it has no keys")
        inner[last] = value
    return values


def _check_age(location: str, delay_ms: float, encoder: Encoder) -> None:
    """Refuse a delay at which none of the encoder's trains of ages begins: such a neuron fires late, or never."""
    ages = getattr(encoder, "ages_ms", None)
    if ages is not None and round(to_us(delay_ms)) not in {round(to_us(age)) for age in ages}:
        listed = ", ".join(f"{age:g}" for age in ages)
        raise ProblemError(
            f"{location}: delay_ms is {delay_ms:g}: must be one of the encoder's ages_ms, {listed}, because with any "
            "other delay the neuron fires late or never"
        )


def learner_from(name: str, values: Mapping[str, Any]) -> tuple[ConeR, float]:
    """Return the learner that plain values describe, and the delay it is trained with (ms); `name` is for errors."""
    if not isinstance(values, Mapping):
        raise refused(name, f" is {shown(values)}: must be parameters by name")
    values = {key: value for key, value in values.items() if key != "inputs"}
    delay_ms = number(f"{name}.delay_ms", values.pop("delay_ms", 0.0))
    # In a recipe a neuron's parameters stand among the learner's, which is trained on a grid whatever its clock.
    learner = [key for key in ConeR._names() if key != "neuron"]
    neuron = [key for key in Neuron._names() if key != "time"]
    for key in values:
        if key not in learner + neuron:
            raise refused(
                name,
                f": no parameter {shown(key)}: the parameters are {', '.join(neuron + learner)}, delay_ms and inputs",
            )
    of_neuron = {key: value for key, value in values.items() if key in neuron}
    of_learner = {key: value for key, value in values.items() if key not in neuron}
    return ConeR(neuron=Neuron(**of_neuron, time="grid"), **of_learner), delay_ms
