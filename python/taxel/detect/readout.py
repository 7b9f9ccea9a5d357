"""Trained neurons with names, and the encoder that they were trained behind."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import floats, instance, integer, mapping, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel._base.saved import read
from taxel._core import NotFittedError, ProblemError
from taxel.array import Array
from taxel.detect.detector import _Detector, detector, tare_text
from taxel.detect.exchange import write_nir
from taxel.detect.plain_rule import PlainRule
from taxel.detect.trained import TrainedNeuron
from taxel.detections import Detections
from taxel.encode import Composite, Encoder
from taxel.events import Events
from taxel.frames import Frames
from taxel.neuron import Neuron
from taxel.recorded import recorded, unit_of
from taxel.recording import Recording
from taxel.recording.analysis.rest import Rest, is_stated, rest
from taxel.spikes import SpikeTrains, to_us
from taxel.tare import GivenTare, Tare
from taxel.wire import FRAME_US

#: Detection goes on for so long after the last event, ms.
SILENCE_MS = 1000.0


class FittedLearner(Protocol):
    """A fitted learner, as a readout needs it."""

    neuron_: Neuron
    weights_: NDArray[np.float64]


#: What the file of a rule has that its part of a readout's lacks.
_OF_FILE = ("format", "version", "tare", "rest", "training")
#: What detects the labels of a readout: for each what was better in training, or its plain rule, or its neuron.
USES = ("better", "rule", "neuron")


class Readout(_Detector):
    """Hold trained neurons with names, the encoder that they were trained behind, and plain rules that may run instead.

    Parameters
    ----------
    encoder : Encoder
        With its parameters: they belong to the readout. A tare belongs to a board and a day and may be given later.
    neurons : mapping of str to a fitted learner, or to (Neuron, weights), with a delay in ms, with inputs
        By label. All of the same `time` and `after_spike`; others are refused. Weights in mV, one per train of the
        encoder; where its spikes are signed first all ON trains, then all OFF (`SpikeTrains.split_by_sign`).
    array : Array, optional
        The sensor that it was trained on; it then accepts no other. Left out, any will do that gives as many
        trains.
    unit : str, optional
        The unit of the values that it was trained on ("ticks" of a board's events); it then accepts no other.
    delay_ms : float, or mapping of str to float, ms, 0 or more
        How much later than the event the neurons were trained to fire, the encoder's latency apart: target = event +
        latency + delay. A detection's `t` takes both off again.
    run_threshold : float, above 0
        A factor on every threshold after training; below 1 the neurons fire on less, and earlier.
    delays_ms : float64, shape (delays,), ms, 0 or more, ascending
        Every train is an input once at each of these delays, as `SpikeTrains.delayed` copies it; weights are then one a
        copy: first all trains at the first delay, then all at the second.
    inputs : mapping of str to sequence of str, optional
        By label, the parts of a `taxel.encode.Composite` whose trains a neuron receives, in any order; its weights are
        one per train of these, in the encoder's order. A neuron that has none receives all trains.
    rules : mapping of str to PlainRule, optional
        By label, the plain rule of the same events. A tare that it holds is not kept.
    by_rule : sequence of str
        The labels that their rule detects, not their neuron.

    Raises
    ------
    ProblemError : parts that are invalid or do not belong together (names the label)

    Notes
    -----
    Reading: the thesis has no `run_threshold`, and 6.3.2 objects that a threshold below the trained one is crossed
    earlier than intended. That price is paid for events a little weaker than the weakest trained one.

    Examples
    --------
    >>> from taxel import Array, Frames, Neuron
    >>> from taxel.encode import LevelCrossing
    >>> encoder = LevelCrossing([10.0])
    >>> readout = Readout(encoder, {"contact": (Neuron(tau=2.0), [1.0, 0.0]), "lift": (Neuron(tau=2.0), [0.0, 1.0])})
    >>> readout
    Readout(contact, lift; LevelCrossing(levels=[10.0]); continuous, keep)
    >>> frames = Frames([[[v]] for v in (0.0, 0.0, 20.0, 20.0, 20.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> run(readout, frames)
    Detections(2: contact 1, lift 1; 20979 to 50979 us)
    """

    _WHAT = "readout"

    def __init__(
        self,
        encoder: Encoder,
        neurons: Mapping[str, FittedLearner | TrainedNeuron | tuple[Any, ...]],
        *,
        array: Array | None = None,
        unit: str | None = None,
        delay_ms: float | Mapping[str, float] = 0.0,
        run_threshold: float = 1.0,
        delays_ms: ArrayLike = (0.0,),
        inputs: Mapping[str, Sequence[str]] | None = None,
        rules: Mapping[str, PlainRule] | None = None,
        by_rule: Sequence[str] = (),
    ) -> None:
        instance("encoder", encoder, Encoder)
        if not isinstance(neurons, Mapping) or not neurons:
            raise refused("neurons", f" is {shown(neurons)}: must be trained neurons by label, one or more")
        named = {} if inputs is None else mapping("inputs", inputs)
        for label in named:
            if label not in neurons:
                raise refused("inputs", f": no neuron {shown(label)}: the neurons are {', '.join(map(str, neurons))}")
        trained = {
            text("label", label): _neuron_of(label, trained_neuron, delay_ms, named.get(label))
            for label, trained_neuron in neurons.items()
        }
        if not isinstance(delay_ms, Mapping):
            # Also where each neuron comes with its own.
            number("delay_ms", delay_ms)
        first = next(iter(trained.values())).neuron
        core = _core.make_readout(
            parameters(
                {
                    "encoder": json.loads(encoder.to_json()),
                    "array": None if array is None else instance("array", array, Array)._geometry(),
                    "unit": None if unit is None else text("unit", unit),
                    "time": first.time,
                    "after_spike": first.after_spike,
                    "run_threshold": number("run_threshold", run_threshold),
                    "delays_ms": floats("delays_ms", delays_ms),
                    "neurons": {
                        label: {
                            "neuron": json.loads(trained_neuron.neuron._json()),
                            "delay_ms": trained_neuron.delay_ms,
                            "inputs": list(trained_neuron.inputs),
                            "weights": trained_neuron.weights,
                        }
                        for label, trained_neuron in trained.items()
                    },
                    "rules": _rule_parts({} if rules is None else mapping("rules", rules)),
                    "by_rule": [text("by_rule", label) for label in several("by_rule", by_rule)],
                }
            )
        )
        self._hold(core)

    @staticmethod
    def _check(text: str) -> str:
        return _core.check_readout(text)

    @property
    def encoder(self) -> Encoder:
        """The encoder with its parameters."""
        return Encoder.from_json(json.dumps(self._parts["encoder"]))

    @property
    def array(self) -> Array | None:
        """The sensor, or None where any will do."""
        geometry = self._parts["array"]
        return None if geometry is None else Array._from_geometry(geometry)

    @property
    def neurons(self) -> dict[str, TrainedNeuron]:
        """The trained neurons by label."""
        return {
            label: TrainedNeuron(
                Neuron(**stored["neuron"]),
                np.array(stored["weights"], np.float64),
                stored["delay_ms"],
                tuple(stored.get("inputs", ())),
            )
            for label, stored in self._parts["neurons"].items()
        }

    def _neuron(self, label: str) -> TrainedNeuron:
        """Return the neuron of a label; refuse one that there is not."""
        if text("label", label) not in self.labels:
            raise ProblemError(f"label {shown(label)} is not one of {', '.join(self.labels)}")
        return self.neurons[label]

    def encoder_of(self, label: str) -> Encoder:
        """Return the encoder whose trains a neuron receives: the readout's, or of a composite one its own inputs.

        Parameters
        ----------
        label : str

        Returns
        -------
        Encoder

        Raises
        ------
        ProblemError : no neuron of that label
        """
        encoder, inputs = self.encoder, self._neuron(label).inputs
        return encoder.only(inputs) if inputs and isinstance(encoder, Composite) else encoder

    def trains_of(self, label: str, trains: SpikeTrains) -> SpikeTrains:
        """Return what a neuron receives of the spikes that the encoder made: its inputs, at each delay.

        Parameters
        ----------
        label : str
        trains : SpikeTrains
            Of the readout's encoder.

        Returns
        -------
        SpikeTrains
            One a weight of the neuron, unsigned or graded.

        Raises
        ------
        ProblemError : no neuron of that label, or not the encoder's trains
        """
        instance("trains", trains, SpikeTrains)
        inputs = trains.split_by_sign() if trains.signed else trains
        received = _receives(self.encoder, self._neuron(label), self.array, 1)
        return (inputs if received is None else inputs.select(received)).delayed(self.delays_ms)

    @property
    def rules(self) -> dict[str, PlainRule]:
        """The plain rules by label, of labels that have one."""
        return {label: PlainRule._from_parts(parts) for label, parts in self._parts.get("rules", {}).items()}

    @property
    def by_rule(self) -> tuple[str, ...]:
        """The labels that their plain rule detects, not their neuron; one without a rule is never detected."""
        return tuple(self._parts.get("by_rule", ()))

    def using(self, use: str) -> Readout:
        """Return the readout with every label detected in one way.

        Parameters
        ----------
        use : {"better", "rule", "neuron"}
            What was better in training: the readout itself; its plain rule, or nothing where it has none; its neuron.

        Returns
        -------
        Readout

        Raises
        ------
        ProblemError : another word
        """
        text("use", use, USES)
        return self if use == "better" else self._with(by_rule=list(self.labels) if use == "rule" else [])

    def _with_rules(self, rules: Mapping[str, PlainRule], by_rule: Sequence[str] = ()) -> Readout:
        """Return the readout with other plain rules.

        Parameters
        ----------
        rules : mapping of str to PlainRule
            By label.
        by_rule : sequence of str
            The labels that their rule detects.

        Returns
        -------
        Readout

        Raises
        ------
        ProblemError : labels or rules that do not fit
        """
        return self._with(rules=_rule_parts(rules), by_rule=[text("by_rule", label) for label in by_rule])

    @property
    def _needs_tare(self) -> bool:
        by_rule, rules = self.by_rule, self.rules
        if any(rules[label]._needs_tare for label in by_rule if label in rules):
            return True
        runs = set(self.labels) - set(by_rule)
        return bool(runs) and any(part.tare is None for part in self.encoder._each() if hasattr(part, "tare"))

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels that it detects."""
        return tuple(self._parts["neurons"])

    @property
    def time(self) -> str:
        """For which time the neurons were trained: "grid" or "continuous"."""
        return str(self._parts["time"])

    @property
    def after_spike(self) -> str:
        """With what remaining after a spike the neurons were trained: "keep", "ignore" or "reset"."""
        return str(self._parts["after_spike"])

    @property
    def run_threshold(self) -> float:
        """The factor on every threshold after training."""
        return float(self._parts["run_threshold"])

    def _accepts(self, array: Array) -> bool:
        """Whether it can read out a sensor: its own, or if it was trained on several sizes a smaller one, padded."""
        sensor = self.array
        return sensor is None or sensor.fits(array) or (self._parts.get("pads", False) and sensor._holds(array))

    @property
    def delays_ms(self) -> NDArray[np.float64]:
        """The delays at each of which every train is an input, ms."""
        return np.array(self._parts.get("delays_ms", [0.0]), np.float64)

    def to_nir(
        self, path: str | os.PathLike[str], *, spike_ms: float | None = None, overwrite: bool = False
    ) -> list[str]:
        """Write the readout as a NIR graph (HDF5, SI units) for other simulators and for chips.

        Parameters
        ----------
        path : path
        spike_ms : float, ms, above 0, optional
            How long a spike of value 1 lasts for the reader. Left out, spikes are Dirac pulses, as NIR's equations have
            them. A simulator that adds 1 in the step of the spike wants its step here: snnTorch 0.1.
        overwrite : bool

        Returns
        -------
        list of str
            A line for each thing that NIR cannot hold.

        Raises
        ------
        FileExistsError : the file is there already and `overwrite` is false
        ProblemError : exponential kernels together with others
        ImportError : nir is not installed (``pip install 'taxel[nir]'``)

        Notes
        -----
        Input, for each delay a `Delay` (where above 0) and a `Linear`, then `CubaLIF` (alpha kernel: both time
        constants equal) or `LIF` (exponential kernel).
        """
        neurons = {label: trained._replace(weights=self._spread(trained)) for label, trained in self.neurons.items()}
        parts = self.encoder, neurons, self.delays_ms, self.run_threshold
        lost = write_nir(path, *parts, spike_ms=spike_ms, overwrite=overwrite)
        return lost + [f"the plain rule that detects {label}: the graph has its neuron" for label in self.by_rule]

    def _spread(self, trained: TrainedNeuron) -> NDArray[np.float64]:
        """Return one weight a train of the whole encoder, at each delay: 0 of those that the neuron lacks."""
        received = _receives(self.encoder, trained, self.array, len(self.delays_ms))
        if received is None:
            return trained.weights
        if np.count_nonzero(received) != len(trained.weights):
            raise ProblemError("NIR: a readout of encoders whose trains depend on the array must state its array")
        spread = np.zeros(len(received))
        spread[received] = trained.weights
        return spread

    def __repr__(self) -> str:
        array = self.array
        taxels = "" if array is None else f" on {array.rows} x {array.columns} taxels"
        threshold = "" if self.run_threshold == 1.0 else f", threshold x {self.run_threshold:g}"
        return escaped(
            f"Readout({', '.join(self.labels)}; {self.encoder!r}{taxels}; {self.time}, {self.after_spike}{threshold}"
            f"{f'; by rule: {by_rule}' if (by_rule := ', '.join(self.by_rule)) else ''})"
        )


def used(readout: Readout | PlainRule, use: str) -> Readout | PlainRule:
    """Return what detects each label as `Readout.using` says; a plain rule is no neuron."""
    if isinstance(readout, Readout):
        return readout.using(use)
    if text("use", use, USES) == "neuron":
        raise refused("use", " is 'neuron': must be 'better' or 'rule', because a plain rule is given")
    return readout


def rest_for(readout: _Detector, recording: Recording, tare: GivenTare | None = None) -> Rest | None:
    """Return the rest of a recording; None of one without a rest by its unit, if the readout needs none.

    None of one of another sensor too, which the readout refuses.
    """
    if not readout._accepts(recording.array):
        return None
    return rest(recording, tare) if is_stated(recording, tare) or readout._needs_tare else None


def run(
    readout: _Detector,
    source: Recording | Events | Frames | SpikeTrains,
    *,
    frame_us: float | None = None,
    tare: Tare | None = None,
    wire_version: int | None = None,
    begin_us: int | None = None,
) -> Detections:
    """Return what a readout or a plain rule detects in a whole recording: the same as it would have detected live.

    Time moves on for a second of silence after the end, so that what came last is detected too. Taxels that were
    zeroed while a recording was made (`Recording.zeroings`) are zeroed here as well; its events alone are not.

    Parameters
    ----------
    readout : Readout or PlainRule
    source : Recording, Events, Frames or SpikeTrains
        Spike trains are those that a readout's encoder makes: a crossing is `known` when it happens, and nothing else
        of this signature applies.
    frame_us : float, us, optional
        How long the board's frame lasts, at whose end a crossing is `known`. Left out: what the recording's registers
        hold; of frames, their median distance; else 192, the board at reset.
    tare : Tare, optional
        The taxels' rest, where the encoder needs one and has none. Left out: that of the recording, as `taxel detect`
        finds it.
    wire_version : int, from 1 to 2, optional
        Version of the wire that stamped the events: 1 counts 100 us (a stamp may be before its frame), 2 counts us.
        Left out: what the recording's registers hold, else 1.
    begin_us : int, us, optional
        Nothing is detected before it: the end of a fresh tare, as live. Spike trains have none.

    Returns
    -------
    Detections
        In the order in which they became known, in which a stream has them too.

    Raises
    ------
    ProblemError : another array or unit than the readout was trained on, a tare that is missing, events without
        intensities where the encoder reads them

    Examples
    --------
    >>> from taxel import Frames, Neuron
    >>> from taxel.encode import LevelCrossing
    >>> readout = Readout(LevelCrossing([10.0]), {"contact": (Neuron(tau=2.0), [1.0, 0.0], 0.5)})
    >>> found = run(readout, Frames([[[0.0]], [[12.0]], [[12.0]]], [0, 10_000, 20_000]))
    >>> found.t, found.known
    (array([10479]), array([20000]))
    """
    how = (frame_us, tare, wire_version, begin_us)
    return run_watched(readout, source, *how)[0]


def run_watched(
    readout: _Detector,
    source: Recording | Events | Frames | SpikeTrains,
    frame_us: float | None = None,
    tare: Tare | None = None,
    wire_version: int | None = None,
    begin_us: int | None = None,
) -> tuple[Detections, tuple[int, int] | None]:
    """Return what `run` does, and since when (us) so many taxels at rest have left the noise floor of the training.

    None of frames that did not, and of all else.
    """
    checked = detector("readout", readout)
    if isinstance(source, Recording) and tare is None:
        checked._check_unit(unit_of(recorded(source, hold=False)))
        taken = rest_for(checked, source)
        tare = None if taken is None else taken._needed(source)
    text = checked._for(source, tare).to_json()
    period = None if frame_us is None else number("frame_us", frame_us)
    version = None if wire_version is None else integer("wire_version", wire_version, 1, 2)
    given, zeroings = tare_text(tare), []
    if begin_us is not None:
        begin_us = integer("begin_us", begin_us, -(2**52), 2**52)
    if isinstance(source, Recording):
        if source.registers is not None:
            version = source.registers.wire_version if version is None else version
        period = source.frame_us if period is None else period
        zeroings = [(z.t, z.x, z.y, z.rest) for z in source.zeroings]
        source = recorded(source)
    if isinstance(source, SpikeTrains):
        if not isinstance(readout, Readout):
            raise refused(
                "source",
                f" is {shown(source)}: must be a taxel.Recording, taxel.Events or taxel.Frames, for a plain rule",
            )
        return _run_spikes(readout, source), None
    if isinstance(source, Events | Frames):
        readout._check_unit(unit_of(source))
        for array in (readout.array, None if tare is None else tare.array):
            if array is not None:
                array._warn_apart(source.array, "the recording")
    if isinstance(source, Events):
        period, version = FRAME_US if period is None else period, version or 1
        columns = _core.readout_run_events(text, source, period, version, given, zeroings, begin_us)
        return Detections._from_parts(columns), None
    if not isinstance(source, Frames):
        raise refused(
            "source", f" is {shown(source)}: must be a taxel.Recording, taxel.Events, taxel.Frames or taxel.SpikeTrains"
        )
    columns, left = _core.readout_run_frames(text, source, period, given, zeroings, begin_us)
    return Detections._from_parts(columns), left


def _receives(encoder: Encoder, trained: TrainedNeuron, array: Array | None, delays: int) -> NDArray[np.bool_] | None:
    """Return which of the encoder's trains, at each delay, a neuron receives; None where it receives all."""
    if not trained.inputs or not isinstance(encoder, Composite):
        return None
    return np.tile(encoder.places(trained.inputs, array or Array(1, 1)), delays)


def _rule_parts(rules: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain rules as parts of a readout's file, which holds what the data of their training were like."""
    parts = {text("label", label): instance(f"{label}: rule", rule, PlainRule)._parts for label, rule in rules.items()}
    return {
        label: {name: part for name, part in of_rule.items() if name not in _OF_FILE}
        for label, of_rule in parts.items()
    }


def _run_spikes(readout: Readout, trains: SpikeTrains) -> Detections:
    """Return what the neurons of a readout detect in the spikes that its encoder made."""
    if readout.by_rule:
        raise refused(
            "source",
            f" is {shown(trains)}: has no load for the plain rule of {', '.join(readout.by_rule)}; "
            'Readout.using("neuron") runs the neurons',
        )
    detections = Detections([], [], [])
    for label, trained in readout.neurons.items():
        inputs = readout.trains_of(label, trains)
        spikes, slopes = trained.neuron._run(
            trained.weights, inputs.lasting(inputs.stop + SILENCE_MS), readout.run_threshold
        )
        offset_ms = readout.encoder_of(label).latency_ms + trained.delay_ms
        t, known = (np.rint(to_us(ms)).astype(np.int64) for ms in (spikes - offset_ms, spikes))
        detections += Detections([label] * len(spikes), t, known, slopes)
    return detections[np.argsort(detections.known, kind="stable")]


def _neuron_of(
    label: str, learner: Any, delay_ms: float | Mapping[str, float], inputs: Sequence[str] | None
) -> TrainedNeuron:
    """Return a neuron with weights, delay and inputs, given a learner or a tuple."""
    if isinstance(delay_ms, Mapping):
        if label not in delay_ms:
            raise refused("delay_ms", f": the value for {label!r} is missing")
        delay_ms = delay_ms[label]
    delay, named = delay_ms, () if inputs is None else inputs
    if isinstance(learner, tuple) and len(learner) in (2, 3, 4):
        neuron, weights, *others = learner
        delay = others[0] if others else delay
        named = others[1] if len(others) > 1 and inputs is None else named
    elif hasattr(learner, "weights_") and hasattr(learner, "neuron_"):
        neuron, weights = learner.neuron_, learner.weights_
    else:
        if hasattr(learner, "fit"):
            raise NotFittedError(f"{label}: {shown(learner)} is not fitted")
        raise ProblemError(f"{label}: {shown(learner)} must be a fitted learner, or (Neuron, weights)")
    instance(f"{label}: neuron", neuron, Neuron)
    return TrainedNeuron(
        neuron,
        floats(f"{label}: weights", weights),
        number(f"{label}: delay_ms", delay),
        tuple(text(f"{label}: inputs", name) for name in several(f"{label}: inputs", named)),
    )


def load(path: str | os.PathLike[str]) -> Readout | PlainRule:
    """Read the file of a readout or of a plain rule, whichever it is.

    Parameters
    ----------
    path : path

    Returns
    -------
    Readout or PlainRule

    Raises
    ------
    FormatError : neither, or one of another version (names the file)
    FileNotFoundError : no such file
    """

    def of_text(text: str) -> Readout | PlainRule:
        return PlainRule.from_json(text) if _core.is_plain_rule(text) else Readout.from_json(text)

    return read(path, "readout", of_text)
