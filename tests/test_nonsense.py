"""Nonsense in every argument of every public function: one clear error of taxel's, or Python's own for files.

Each public callable has a sound call below; each argument in turn is replaced by each piece of nonsense. A callable
without a sound call fails the first test, so that nothing public stays untried.
"""

import inspect
import math
import re
from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from encode import test_laws as laws
from matplotlib.figure import Figure

import taxel
from taxel import _core
from taxel._base.parameters import described

mpl.use("Agg")

#: How parsers speak, and no error of taxel's.
PARSERS = r"invalid (type|value|length)|(unknown|missing|duplicate) (variant|field)|, expected |did not match|`"

NONSENSE: dict[str, Any] = {
    "None": None,
    "NaN": math.nan,
    "infinity": -math.inf,
    "minus one": -1,
    "zero": 0,
    "a half": 0.5,
    "huge": 10**30,
    "a huge float": 1e308,
    "beyond int64": 2**63,
    "true": True,
    "text": "nonsense",
    "text with a zero": "\0",
    "bytes": b"\x80\xff",
    "an object": object(),
    "a class": int,
    "a function": len,
    "nothing in a list": [],
    "NaN in a list": [math.nan],
    "None in a list": [None],
    "a ragged list": [[1.0, 2.0], [3.0]],
    "three dimensions": np.zeros((2, 3, 4)),
    "falling numbers": np.array([3.0, 2.0, -1.0]),
    "a wrong dtype": np.array(["a", "b"]),
    "complex numbers": np.array([1j, 2j]),
    "an empty dictionary": {},
    "a strange dictionary": {"nonsense": None, 3: object()},
    "a set": {1, 2},
    "another array": taxel.Array(3, 5),
    "other trains": taxel.SpikeTrains.from_lists([[1.0], [2.0]]),
    "the least float": 5e-324,
    "a span of time": np.timedelta64(5),
    "half of a surrogate pair": "\ud800",
    "a masked value": np.ma.masked,
    "an array of which one number is repeated": np.broadcast_to(np.float64(1.0), 10**9),
    "a list that holds itself": [],
}
NONSENSE["a list that holds itself"].append(NONSENSE["a list that holds itself"])

#: Drawn on again and again; where it is None a new one is made, which pyplot keeps.
AXES = Figure().add_subplot()
ARRAY = taxel.Array(4, 4, pitch_mm=2.0, name="small")
EVENTS = taxel.Events(
    [0, 200, 400], [0, 1, 2], [0, 1, 2], [True, False, True], array=ARRAY, intensity=[9, 8, 7], markers=[(0, True)]
)
FRAMES = taxel.Frames(np.ones((3, 4, 4)), [0, 192, 384], array=ARRAY)
TRAINS = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0, [[1.0, -1.0], [1.0]])
UNSIGNED = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0)
FOUND = taxel.Detections(["a", "b"], [10, 20], [11, 22], [0.5, 0.5])
TARE = taxel.Tare.take(FRAMES)
LAID = taxel.Load(FRAMES, 9.81)
CALIBRATION = taxel.Calibration.table(ARRAY, [5.0, 50.0], [1.0, 9.0], unit="N")
TICKS = taxel.Calibration.table(ARRAY, [5.0, 50.0], [1.0, 9.0], unit="N", of="ticks")
CALIBRATION_HOW = {"gain": 1.0, "rest": TARE, "floor": 0.5, "date": "2026-11-21", "note": "bench 2"}
LEVELS = taxel.encode.LevelCrossing([0.5])
READOUT = taxel.Readout(LEVELS, {"a": (taxel.Neuron(tau=2.0), [0.5] * 32)}, array=ARRAY)
RECIPE = taxel.detect.Recipe(LEVELS, {"tau": 5.0}, {"a": {"ub": 1.0}})
EXAMPLE = taxel.detect.Example(taxel.Frames(np.eye(4)[:, :, None] * np.ones(4), [0, 9000, 18000, 27000]), {"a": [9000]})
CONE_OPTIONS: dict[str, Any] = {
    "kappa": 1.2,
    "delta_t_ms": 1.0,
    "lambdas": [1.0, 1.0, 1.0, 1.0, 1.0],
    "lb": -1.0,
    "ub": 1.0,
    "divide_b_by": "targets",
    "norm": "square",
    "margin": 0.01,
    "horizon": 30.0,
    "tolerance": 1e-6,
    "engine": "native",
    "max_seconds": 60.0,
}
CONE = taxel.learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0)
CONE_X = taxel.learn.ConeX(neuron=taxel.Neuron(tau=5.0), ub=1.0)
PLAIN = TRAINS.split_by_sign()
FITTED = taxel.learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0).fit([PLAIN], [[5.0]])
SOLVED = taxel.learn.ConeX(neuron=taxel.Neuron(tau=5.0), lb=-9.0, ub=9.0).fit([PLAIN], [[5.0]])
REFUTED = taxel.learn.ConeX().fit([UNSIGNED], [[0.5]])
SCENE = taxel.simulate.Scene.draw(1)
LAYER = taxel.simulate.Layer(array=ARRAY)
CIRCUIT = taxel.simulate.circuit
REGISTERS = taxel.wire.Registers()
BYTES = taxel.wire.encode(EVENTS)

TEMPOTRON = taxel.learn.Tempotron(eta=0.1, epochs=5).fit([PLAIN], [True])
SKIM = taxel.learn.SKIM(tau=5.0).fit([PLAIN], [[5.0]])
EPOCHS = {"eta": 0.1, "initial": (0.0, 1.0), "epochs": 5, "updates": "batch", "step_ms": 0.1, "within_ms": 1.0}
EPOCHS |= {"until_right": True, "seed": 1, "max_seconds": 1.0, "theta_0": 1.0, "after_spike": "reset", "tau": 9.0}
EPOCHS |= {"tau_s": 3.0}
#: The rules that learn by epochs, each with every argument; what they share is tried again in tests/learn.
RIVALS: list[tuple[Any, dict[str, Any]]] = [
    (taxel.learn.INST, EPOCHS),
    (taxel.learn.FILT, {**EPOCHS, "tau_q": 5.0}),
    (taxel.learn.Chronotron, {**EPOCHS, "rule": "E", "tau_q": 5.0, "gamma_r": 5.0}),
    (taxel.learn.ReSuMe, {**EPOCHS, "a": 0.1, "amplitude": 2.0, "tau_w": 5.0}),
    (taxel.learn.SPAN, {**EPOCHS, "tau_a": 5.0}),
    (taxel.learn.PSD, {**EPOCHS, "tau_1": 8.0, "tau_2": 2.0, "refractory": 0.0}),
    (taxel.learn.FP, {**EPOCHS, "window_ms": 1.0}),
    (taxel.learn.HTP, {**EPOCHS, "window_ms": 1.0}),
]

FOUND_BITS = taxel.information.estimate(["a", "b"] * 4, ["a", "b"] * 4, redraws=2)
CLOUD = np.array([[0.0, 1.0], [3.0, 2.0], [0.5, 0.0], [2.0, 2.5], [1.0, 1.0], [3.5, 3.0], [0.2, 0.4], [2.5, 2.0]])
LDA = taxel.information.LDA().fit(CLOUD, [0, 1] * 4)
GRAM_LDA = taxel.information.GramLDA(features=2).fit(CLOUD @ CLOUD.T, [0, 1] * 4)
NESTED = taxel.information.nested_predictions([CLOUD @ CLOUD.T], [2], [0, 1] * 4, count=2, inner=2)
READOUTS = [
    taxel.information.ConeRReadout(tau=5.0, bound=1.0).fit([PLAIN, PLAIN], [0, 1]),
    taxel.information.TempotronReadout(epochs=3).fit([PLAIN, PLAIN], [0, 1]),
]
PRESSES = taxel.Events(
    np.arange(8) * 10_000 + 1000, np.arange(8) % 2, [0] * 8, [True] * 8, array=ARRAY, intensity=np.arange(8) * 50 + 50
)
TOUCHES = [taxel.information.LabelledTrial(PRESSES, "ab"[k % 2], k * 10_000) for k in range(8)]

Sound = Callable[[], tuple[Callable[..., Any], dict[str, Any]]]


def method(instance: Any, name: str, **arguments: Any) -> Sound:
    """A call of a method of something that calls do not change."""
    return lambda: (getattr(instance, name), arguments)


def fresh(make: Callable[[], Any], name: str, **arguments: Any) -> Sound:
    """A call of a method of something that each call gets anew."""
    return lambda: (getattr(make(), name), arguments)


def plain(function: Callable[..., Any], **arguments: Any) -> Sound:
    return lambda: (function, arguments)


def every(function: Callable[..., Iterator[Any]], **arguments: Any) -> Sound:
    """A call of a function that gives one thing after the other."""
    return lambda: (lambda **given: list(function(**given)), arguments)


def listen(**arguments: Any) -> None:
    """Begin to listen live, and stop."""
    taxel.live.Live(**arguments).stop()


def panel(**arguments: Any) -> None:
    """Begin to show a recording, and stop."""
    taxel.live.Panel(**arguments).stop()


def read_out() -> taxel.detect.ReadoutStream:
    return READOUT.stream()


#: A sound call of everything public that takes anything, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.Array": plain(taxel.Array, rows=4, columns=4, pitch_mm=1.0, exists=np.ones((4, 4)), name="small"),
    "taxel.Array.index": method(ARRAY, "index", x=1, y=2),
    "taxel.Array.region": method(ARRAY, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.Events": plain(
        taxel.Events,
        t=[1],
        x=[1],
        y=[1],
        p=[True],
        array=ARRAY,
        intensity=[5],
        present=[True],
        repaired=[True],
        markers=[(0, True)],
    ),
    "taxel.Events.between": method(EVENTS, "between", start=0, stop=300),
    "taxel.Events.region": method(EVENTS, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.Events.from_numpy": plain(taxel.Events.from_numpy, records=EVENTS.to_numpy(), array=ARRAY),
    "taxel.Events.from_tonic": plain(taxel.Events.from_tonic, records=EVENTS.to_tonic(), array=ARRAY),
    "taxel.Events.from_faery": plain(taxel.Events.from_faery, records=EVENTS.to_faery(), array=ARRAY),
    "taxel.Frames": plain(taxel.Frames, values=np.ones((2, 4, 4)), t=[0, 5], unit="N", array=ARRAY),
    "taxel.Frames.area": method(FRAMES, "area", above=0.5),
    "taxel.Frames.centre": method(FRAMES, "centre", above=0.5),
    "taxel.Frames.from_events": plain(
        taxel.Frames.from_events, events=EVENTS, period_us=100, start=0, stop=500, held=np.ones((4, 4))
    ),
    "taxel.Frames.between": method(FRAMES, "between", start=0, stop=200),
    "taxel.Frames.region": method(FRAMES, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.SpikeTrains": plain(
        taxel.SpikeTrains, times=[1.0, 2.0], offsets=[0, 1, 2], start=0.0, stop=5.0, values=[1.0, -1.0]
    ),
    "taxel.SpikeTrains.from_lists": plain(
        taxel.SpikeTrains.from_lists, times=[[1.0], []], start=0.0, stop=5.0, values=[[1.0], []]
    ),
    "taxel.SpikeTrains.between": method(TRAINS, "between", start=0.0, stop=2.0),
    "taxel.SpikeTrains.select": method(TRAINS, "select", trains=[1]),
    "taxel.SpikeTrains.delayed": method(TRAINS, "delayed", delays_ms=[0.0, 2.0]),
    "taxel.SpikeTrains.to_nwb": method(
        TRAINS, "to_nwb", path="trains.nwb", begun=datetime(2020, 1, 1), description="a walk", overwrite=True
    ),
    "taxel.SpikeTrains.from_nwb": plain(taxel.SpikeTrains.from_nwb, path="here.nwb", start=0.0, stop=30.0),
    "taxel.SpikeTrains.from_neo": plain(taxel.SpikeTrains.from_neo, trains=TRAINS.to_neo()),
    "taxel.SpikeTrains.save": method(TRAINS, "save", path="trains.npz", overwrite=True),
    "taxel.SpikeTrains.load": plain(taxel.SpikeTrains.load, path="here.npz"),
    "taxel.Detections": plain(taxel.Detections, label=["a"], t=[1], known=[2], slope=[0.5], said=[3], repaired=[True]),
    "taxel.Detections.between": method(FOUND, "between", start=0, stop=15),
    "taxel.Detections.from_numpy": plain(taxel.Detections.from_numpy, records=FOUND.to_numpy()),
    "taxel.Detections.from_neo": plain(taxel.Detections.from_neo, events=FOUND.to_neo()),
    "taxel.Detections.to_csv": method(FOUND, "to_csv", path="found.csv", overwrite=True),
    "taxel.Detections.from_csv": plain(taxel.Detections.from_csv, path="here.csv"),
    "taxel.plot.detections": plain(taxel.plot.detections, found=FOUND, ax=AXES),
    "taxel.plot.event_picture": plain(taxel.plot.event_picture, events=EVENTS, ax=AXES),
    "taxel.plot.health_map": plain(taxel.plot.health_map, health=taxel.health(EVENTS), ax=AXES),
    "taxel.plot.html": plain(taxel.plot.html, noun=TRAINS),
    "taxel.plot.overview": lambda: (
        taxel.plot.overview,
        {"recording": taxel.open("here_events.npz"), "figure": Figure()},
    ),
    "taxel.plot.pressure": lambda: (taxel.plot.pressure, {"frames": FRAMES, "above": 0.5, "figure": Figure()}),
    "taxel.plot.pressure_map": plain(taxel.plot.pressure_map, frames=FRAMES, at=200, ax=AXES),
    "taxel.plot.raster": plain(taxel.plot.raster, trains=TRAINS, ax=AXES),
    "taxel.Tare.off": method(TARE, "off", frames=FRAMES),
    "taxel.Tare.take": plain(taxel.Tare.take, x=FRAMES, start_us=0, stop_us=300, note="bench 2"),
    "taxel.Tare.from_json": plain(taxel.Tare.from_json, text=TARE.to_json()),
    "taxel.Tare.save": method(TARE, "save", path="tare.json", overwrite=True),
    "taxel.Tare.load": plain(taxel.Tare.load, path="here_tare.json"),
    "taxel.Calibration.law": plain(
        taxel.Calibration.law, array=ARRAY, ramp=150.0, sensor={"exponent": 0.8}, unit="N", **CALIBRATION_HOW
    ),
    "taxel.Calibration.table": plain(
        taxel.Calibration.table,
        array=ARRAY,
        readings=[5.0, 50.0],
        values=[1.0, 9.0],
        unit="kPa",
        of="counts",
        **CALIBRATION_HOW,
    ),
    "taxel.Calibration.fit": plain(
        taxel.Calibration.fit,
        loads=[LAID],
        unit="N",
        start=CALIBRATION,
        exponent=None,
        each=False,
        rest=None,
        floor=0.5,
        date="2026-11-21",
        note="bench 2",
    ),
    "taxel.Calibration.apply": method(CALIBRATION, "apply", frames=FRAMES, rest=TARE),
    "taxel.Calibration.readings": method(
        CALIBRATION,
        "readings",
        frames=taxel.Frames(np.ones((3, 4, 4)), [0, 192, 384], unit="N", array=ARRAY),
        rest=TARE,
    ),
    "taxel.Calibration.from_json": plain(taxel.Calibration.from_json, text=CALIBRATION.to_json()),
    "taxel.Calibration.save": method(CALIBRATION, "save", path="calibration.json", overwrite=True),
    "taxel.Calibration.load": plain(taxel.Calibration.load, path="here_calibration.json"),
    "taxel.Calibration.beside": plain(taxel.Calibration.beside, recording="here_events.npz"),
    "taxel.Neuron": plain(
        taxel.Neuron,
        kernel="double_exponential",
        tau=10.0,
        tau_s=2.0,
        theta_0=0.3,
        theta_plus=0.2,
        tau_rec=20.0,
        refractory=3.0,
        after_spike="keep",
        first_threshold="theta_0",
        time="grid",
        step_ms=0.5,
    ),
    "taxel.Neuron.run": method(taxel.Neuron(), "run", weights=[1.0] * 2, trains=UNSIGNED, threshold=1.0),
    "taxel.Neuron.run_many": method(
        taxel.Neuron(), "run_many", weights=[[1.0] * 2, [0.5] * 2], trains=UNSIGNED, threshold=1.0
    ),
    "taxel.Neuron.potential": method(
        taxel.Neuron(), "potential", weights=[1.0] * 2, trains=UNSIGNED, times=[1.0, 5.0], spikes=[2.0]
    ),
    "taxel.Readout": plain(
        taxel.Readout,
        encoder=LEVELS,
        neurons=READOUT.neurons,
        array=ARRAY,
        delay_ms={"a": 1.0},
        run_threshold=0.9,
        delays_ms=[0.0],
    ),
    "taxel.Readout.to_nir": method(READOUT, "to_nir", path="readout.nir", spike_ms=0.1, overwrite=True),
    "taxel.Readout.from_nir": plain(
        taxel.Readout.from_nir, path="here.nir", encoder=LEVELS, neuron=taxel.Neuron(), spike_ms=0.1
    ),
    "taxel.Readout.from_json": plain(taxel.Readout.from_json, text=READOUT.to_json()),
    "taxel.Readout.save": method(READOUT, "save", path="readout.json", overwrite=True),
    "taxel.Readout.load": plain(taxel.Readout.load, path="here_readout.json"),
    "taxel.Readout.stream": method(READOUT, "stream", array=ARRAY, frame_us=192.0, tare=TARE, wire_version=2),
    "taxel.detect.ReadoutStream": plain(
        taxel.detect.ReadoutStream, readout=READOUT, array=ARRAY, frame_us=192.0, tare=TARE, wire_version=2
    ),
    "taxel.detect.ReadoutStream.push": fresh(read_out, "push", x=FRAMES),
    "taxel.detect.ReadoutStream.advance": fresh(read_out, "advance", t_us=5),
    "taxel.detect.run": plain(
        taxel.detect.run, readout=READOUT, source=FRAMES, frame_us=192.0, tare=TARE, wire_version=2
    ),
    "taxel.detect.score": plain(taxel.detect.score, found=FOUND, truth={"a": [10], "b": [25]}, window_ms=50.0),
    "taxel.detect.Spread.of": plain(taxel.detect.Spread.of, values=[1.0, 2.0]),
    "taxel.detect.Part": plain(taxel.detect.Part, **dict.fromkeys(inspect.signature(taxel.detect.Part).parameters)),
    "taxel.detect.Fold": plain(taxel.detect.Fold, **dict.fromkeys(inspect.signature(taxel.detect.Fold).parameters)),
    "taxel.detect.Trained": plain(
        taxel.detect.Trained, **dict.fromkeys(inspect.signature(taxel.detect.Trained).parameters)
    ),
    "taxel.detect.Recipe": plain(
        taxel.detect.Recipe,
        encoder=LEVELS,
        learner={"tau": 5.0},
        neurons={"a": {"ub": 1.0}},
        run_threshold=1.0,
        about="a touch",
        source="made here",
    ),
    "taxel.detect.Recipe.learner_of": method(RECIPE, "learner_of", label="a"),
    "taxel.detect.Recipe.from_dict": plain(taxel.detect.Recipe.from_dict, values={"encoder": {"name": "fa1"}}),
    "taxel.detect.Recipe.load": plain(
        taxel.detect.Recipe.load, recipe="here.toml", changes={"learner.tau": 5.0}, labels=["a"]
    ),
    "taxel.detect.Recipe.points_of": method(RECIPE, "points_of", label="a"),
    "taxel.detect.judge": plain(
        taxel.detect.judge,
        examples=[EXAMPLE, EXAMPLE],
        recipe=RECIPE,
        k=2,
        search=False,
        window_ms=50.0,
        frame_us=192.0,
        progress=lambda _: None,
    ),
    "taxel.detect.choose": plain(
        taxel.detect.choose,
        examples=[EXAMPLE, EXAMPLE],
        recipe=RECIPE,
        k=2,
        window_ms=50.0,
        frame_us=192.0,
        progress=lambda _: None,
    ),
    "taxel.detect.train": plain(taxel.detect.train, examples=[EXAMPLE], recipe=RECIPE, progress=lambda _: None),
    "taxel.Labels": plain(taxel.Labels, path="here_labels.csv"),
    "taxel.Labels.named": lambda: (taxel.Labels("here_labels.csv").named, {"recording": "walk.mcap"}),
    "taxel.Labels.of": lambda: (taxel.Labels("here_labels.csv").of, {"recording": taxel.open("here_events.npz")}),
    "taxel.encode.Encoder.encode": method(LEVELS, "encode", x=FRAMES),
    "taxel.encode.Encoder.from_json": plain(taxel.encode.Encoder.from_json, text=LEVELS.to_json()),
    "taxel.encode.Encoder.transform": method(LEVELS, "transform", recordings=[FRAMES]),
    "taxel.encode.Encoder.stream": method(LEVELS, "stream", array=ARRAY),
    "taxel.encode.Encoder.trains": method(LEVELS, "trains", array=ARRAY),
    "taxel.encode.Encoder.with_tare": method(LEVELS, "with_tare", tare=TARE),
    "taxel.encode.Skin.afferents": method(taxel.encode.Skin(), "afferents", array=ARRAY),
    "taxel.encode.Afferents.trains": method(taxel.encode.Skin().afferents(ARRAY), "trains", kind="SA-1"),
    "taxel.encode.EncoderStream": plain(taxel.encode.EncoderStream, encoder=LEVELS, array=ARRAY),
    "taxel.encode.EncoderStream.push": fresh(lambda: LEVELS.stream(ARRAY), "push", x=FRAMES),
    "taxel.encode.EncoderStream.advance": fresh(lambda: LEVELS.stream(ARRAY), "advance", t_us=5),
    "taxel.encode.RunningRange": plain(
        lambda **given: taxel.encode.LevelCrossing([0.5], running_range=taxel.encode.RunningRange(**given)),
        low=10.0,
        high=95.0,
        window_s=10.0,
        renew_s=1.0,
        first_window="silent",
    ),
    **{f"taxel.learn.{rule.__name__}": plain(rule, **arguments) for rule, arguments in RIVALS},
    "taxel.learn.SKIM": plain(
        taxel.learn.SKIM,
        tau=5.0,
        kernel="double_exponential",
        tau_s=2.0,
        step_ms=1.0,
        pulse_ms=3.0,
        ridge=0.1,
        branches=5,
        spread=0.5,
        delay_ms=3.0,
        nonlinearity="tanh",
        thresholds=[0.5],
        within_ms=5.0,
        seed=1,
    ),
    "taxel.learn.SKIM.fit": method(taxel.learn.SKIM(tau=5.0), "fit", patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.SKIM.rows": method(SKIM, "rows", pattern=PLAIN),
    "taxel.learn.SKIM.output": method(SKIM, "output", pattern=PLAIN),
    "taxel.learn.SKIM.predict": method(SKIM, "predict", patterns=[PLAIN], threshold=0.5),
    "taxel.learn.Tempotron": plain(
        taxel.learn.Tempotron,
        tau=15.0,
        tau_s=4.0,
        theta_0=1.0,
        eta=0.1,
        momentum=0.5,
        initial_sd=0.1,
        epochs=5,
        seed=1,
        max_seconds=1.0,
    ),
    "taxel.learn.Tempotron.fit": method(
        TEMPOTRON, "fit", patterns=[PLAIN], labels=[True], start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel.learn.Tempotron.score": method(TEMPOTRON, "score", patterns=[PLAIN], labels=[True]),
    "taxel.learn.Tempotron.predict": method(TEMPOTRON, "predict", patterns=[PLAIN]),
    "taxel.learn.Tempotron.peak": method(TEMPOTRON, "peak", weights=[0.1] * 4, pattern=PLAIN),
    "taxel.learn.Tempotron.change": method(TEMPOTRON, "change", weights=[0.1] * 4, pattern=PLAIN, label=True),
    "taxel.learn.ConeR": plain(
        taxel.learn.ConeR,
        neuron=taxel.Neuron(tau=5.0),
        **CONE_OPTIONS,
    ),
    "taxel.learn.STDP": plain(taxel.learn.STDP, **taxel.learn.STDP().get_params()),
    "taxel.learn.STDP.partial_fit": fresh(taxel.learn.STDP, "partial_fit", piece=PLAIN),
    "taxel.learn.STDP.predict": method(taxel.learn.STDP().fit([PLAIN]), "predict", patterns=[PLAIN]),
    "taxel.learn.OnlineConeR": plain(taxel.learn.OnlineConeR, window=3, neuron=taxel.Neuron(tau=5.0), **CONE_OPTIONS),
    "taxel.learn.OnlineConeR.partial_fit": lambda: (
        taxel.learn.OnlineConeR(neuron=taxel.Neuron(tau=5.0), window=3, ub=1.0).partial_fit,
        {"pattern": PLAIN, "targets": [5.0]},
    ),
    "taxel.learn.OnlineConeR.fit": method(
        taxel.learn.OnlineConeR(neuron=taxel.Neuron(tau=5.0), window=3, ub=1.0),
        "fit",
        patterns=[PLAIN],
        targets=[[5.0]],
        start=None,
        progress=None,
    ),
    "taxel.learn.ConeR.fit": method(
        CONE, "fit", patterns=[PLAIN], targets=[[5.0]], start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel.learn.ConeR.prepare": method(CONE, "prepare", patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.ConeRProblem": plain(taxel.learn.ConeRProblem, cone=CONE, patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.ConeRProblem.fit": method(
        CONE.prepare([PLAIN], [[5.0]]), "fit", cone=CONE, start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel.learn.ConeX": plain(
        taxel.learn.ConeX,
        neuron=taxel.Neuron(tau=5.0),
        kappa=1.2,
        delta_t_ms=1.0,
        lambdas=[1.0, 1.0, 1.0],
        lb=-1.0,
        ub=[1.0] * 4,
        divide_b_by="targets",
        norm="square",
        margin=0.01,
        slope=0.01,
        horizon=30.0,
        tolerance=1e-6,
        max_seconds=10.0,
    ),
    "taxel.learn.ConeX.fit": method(
        CONE_X, "fit", patterns=[PLAIN], targets=[[5.0]], start=REFUTED, progress=lambda *_: None
    ),
    "taxel.learn.ConeX.predict": method(SOLVED, "predict", patterns=[PLAIN]),
    "taxel.learn.ConeR.predict": method(FITTED, "predict", patterns=[PLAIN]),
    "taxel.learn.ConeXProblem": plain(taxel.learn.ConeXProblem, cone=CONE_X, patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.ConeXProblem.row": method(REFUTED.problem_, "row", row=("silence", 0, 5.0), margin=True),
    "taxel.learn.ConeXProblem.target": method(REFUTED.problem_, "target", pattern=0, target=0),
    "taxel.learn.ConeXProblem.silence": method(REFUTED.problem_, "silence", pattern=0, t=5.0, margin=True),
    "taxel.learn.ConeXProblem.slope": method(REFUTED.problem_, "slope", pattern=0, target=0, margin=True),
    "taxel.learn.ConeXProblem.behind": method(REFUTED.problem_, "behind", pattern=0, target=0),
    "taxel.learn.check_certificate": plain(
        taxel.learn.check_certificate, problem=REFUTED.problem_, certificate=REFUTED.certificate_, margin=True
    ),
    "taxel.metrics.matching": plain(taxel.metrics.matching, spikes=[[1.0, 2.0]], targets=[[1.5]], window_ms=5.0),
    "taxel.metrics.f1": plain(taxel.metrics.f1, spikes=[[1.0, 2.0]], targets=[[1.5]], window_ms=5.0),
    "taxel.metrics.victor_purpura": plain(taxel.metrics.victor_purpura, a=[1.0, 2.0], b=[1.5], q=0.1),
    "taxel.metrics.victor_purpura_multi_unit": plain(
        taxel.metrics.victor_purpura_multi_unit, a=UNSIGNED, b=UNSIGNED, q=0.1, k=0.5
    ),
    "taxel.metrics.van_rossum": plain(taxel.metrics.van_rossum, a=[1.0, 2.0], b=[1.5], tau=5.0, normalisation="spike"),
    "taxel.metrics.van_rossum_absolute": plain(
        taxel.metrics.van_rossum_absolute, a=[1.0, 2.0], b=[1.5], tau=5.0, window=(0.0, 50.0), step_ms=1.0
    ),
    "taxel.metrics.van_rossum_spatial": plain(
        taxel.metrics.van_rossum_spatial,
        a=UNSIGNED,
        b=UNSIGNED,
        array=taxel.Array(1, 2),
        tau=5.0,
        sigma=2.0,
        own_train="twice",
        normalisation="spike",
    ),
    "taxel.metrics.van_rossum_spatial_absolute": plain(
        taxel.metrics.van_rossum_spatial_absolute,
        a=UNSIGNED,
        b=UNSIGNED,
        array=taxel.Array(1, 2),
        tau=5.0,
        sigma=2.0,
        own_train="twice",
        window=(0.0, 50.0),
        step_ms=1.0,
    ),
    "taxel.metrics.isi_distance": plain(taxel.metrics.isi_distance, a=[1.0, 2.0], b=[1.5], window=(0.0, 50.0)),
    "taxel.metrics.spike_distance": plain(taxel.metrics.spike_distance, a=[1.0, 2.0], b=[1.5], window=(0.0, 50.0)),
    "taxel.metrics.pairwise": plain(
        taxel.metrics.pairwise,
        metric="van_rossum",
        a=[[1.0], [2.0]],
        b=[[3.0]],
        threads=1,
        progress=lambda *_: None,
        tau=5.0,
        normalisation="spike",
    ),
    "taxel.open": plain(taxel.open, path="here_events.npz", array=ARRAY, pairing="direct", differences=False),
    "taxel.Recording.between": lambda: (taxel.open("here_events.npz").between, {"start": 0, "stop": 300}),
    "taxel.Recording.frames": lambda: (taxel.open("here_events.npz").frames, {"rate_hz": 1000.0}),
    "taxel.Recording.calibrated": lambda: (
        taxel.open("here_events.npz").calibrated,
        {"rate_hz": 1000.0, "rest": TARE},
    ),
    "taxel.cut": lambda: (
        taxel.cut,
        {
            "recording": taxel.open("here_events.npz"),
            "start_us": 0,
            "stop_us": 300,
            "columns": slice(0, 2),
            "rows": slice(0, 2),
            "label": None,
            "before_us": 10.0,
            "after_us": 10.0,
        },
    ),
    "taxel.merge": lambda: (
        taxel.merge,
        {"recordings": [taxel.open("here_events.npz")] * 2, "gap_us": 1000.0, "beside": True},
    ),
    "taxel.Recording.with_notes": lambda: (
        taxel.open("here_events.npz").with_notes,
        {"notes": [taxel.Note("heel", 100, 0)]},
    ),
    "taxel.convert": plain(
        taxel.convert, source=EVENTS, target="there.npz", frames_hz=1000.0, compression="none", overwrite=True
    ),
    "taxel.health": plain(taxel.health, recorded=EVENTS),
    "taxel.simulate.Board": plain(
        taxel.simulate.Board,
        registers=REGISTERS,
        array=None,
        previous="last_sent",
        intensity="value",
        queue=100,
        version_2=None,
        circuit=CIRCUIT.Circuit(),
        asynchronous=False,
    ),
    "taxel.simulate.Version2": plain(
        taxel.simulate.Version2, board=1, seed=2, hold_us=0, heartbeat_us=10_000, states_us=1_000_000
    ),
    "taxel.simulate.Flaws": plain(
        taxel.simulate.Flaws,
        gain=0.1,
        threshold=1.0,
        hysteresis=1.0,
        drift=1.0,
        dead=0.1,
        stuck=0.1,
        loose=1,
        noise=1.0,
        seeds={"gain": 1},
    ),
    "taxel.simulate.Faults": plain(
        taxel.simulate.Faults, lost=0.1, repeated=0.1, reordered=0.1, cut=0.1, corrupted=0.1, seed=1
    ),
    "taxel.simulate.Replay": plain(taxel.simulate.Replay, source=EVENTS, speed=1.0),
    "taxel.simulate.Replay.registers": method(taxel.simulate.Replay(EVENTS), "registers", preset="5.2 kHz"),
    "taxel.live.Source": plain(
        taxel.live.Source, array=ARRAY, rate=100.0, bits=8, noise_floor=3, to="127.0.0.1:9", board=1
    ),
    "taxel.live.Source.push": method(
        taxel.live.Source(ARRAY, 100.0, to="127.0.0.1:9"), "push", frame=np.zeros((4, 4), np.int64)
    ),
    "taxel.wire.described": plain(taxel.wire.described, registers=REGISTERS),
    "taxel.wire.Registers.from_words": plain(
        taxel.wire.Registers.from_words, words=list(REGISTERS.words), array=None, channels=16
    ),
    "taxel.simulate.Board.command": fresh(taxel.simulate.Board, "command", data=bytes.fromhex("e000000000")),
    "taxel.simulate.Board.frame": fresh(taxel.simulate.Board, "frame", ticks=np.zeros(4096, np.uint16), most=5),
    "taxel.simulate.Board.record": fresh(taxel.simulate.Board, "record", start=True),
    "taxel.wire.Columns": plain(taxel.wire.Columns, rows=100),
    "taxel.wire.Command": plain(taxel.wire.Command, register=1, value=300),
    "taxel.wire.Command.from_bytes": plain(taxel.wire.Command.from_bytes, data=taxel.wire.Command(1, 300).to_bytes()),
    "taxel.wire.Decoder": plain(taxel.wire.Decoder, version=1, array=ARRAY, pairing="direct", differences=False),
    "taxel.wire.Decoder.push": fresh(taxel.wire.Decoder, "push", data=BYTES, arrived=5),
    "taxel.wire.Decoder.push_into": fresh(
        taxel.wire.Decoder, "push_into", columns=taxel.wire.Columns(100), data=BYTES, arrived=5
    ),
    "taxel.wire.StreamReader.push": fresh(taxel.wire.StreamReader, "push", data=BYTES),
    "taxel.wire.Registers": plain(taxel.wire.Registers, array=None, noise_floor=4, line_period=3.0),
    "taxel.wire.Registers.commands_to": method(REGISTERS, "commands_to", target=REGISTERS),
    "taxel.wire.Registers.preset": plain(taxel.wire.Registers.preset, name="2 kHz", array=None),
    "taxel.wire.Registers.replace": method(REGISTERS, "replace", noise_floor=4, frame_sync=True, nrows=63),
    "taxel.wire.Registers.with_preset": plain(REGISTERS.with_preset, name="2 kHz"),
    "taxel.wire.decode": plain(
        taxel.wire.decode,
        data=BYTES,
        version=1,
        array=ARRAY,
        pairing="direct",
        differences=False,
        lengths=[len(BYTES)],
        columns=taxel.wire.Columns(100),
    ),
    "taxel.wire.encode": plain(taxel.wire.encode, events=EVENTS),
    "taxel.live.Live": plain(
        listen,
        port=0,
        host="127.0.0.1",
        remote=None,
        array=None,
        registers="5.2 kHz",
        differences=False,
        readout=None,
        tare=None,
        record="live.mcap",
        record_later=False,
        name="board",
        sources={"imu": "given,columns=a"},
        send=[],
        compression="none",
        overwrite=True,
        guard_frames=5.0,
        gap_frames=1.0,
        say=lambda _: None,
        lines=False,
        kernel_buffer_bytes=100_000,
        queue_bytes=100_000,
        readout_events=1000,
        gro=False,
    ),
    "taxel.live.Panel": plain(panel, shows="here_panel.mcap", control=None, folder=None, port=0, host="127.0.0.1"),
    "taxel.live.send": plain(
        taxel.live.send,
        datagrams=[BYTES],
        host="127.0.0.1",
        port=9,
        each=1,
        period_us=192.0,
        seconds=0.001,
        segment=False,
    ),
    "taxel.simulate.Pictures": plain(taxel.simulate.Pictures, values=np.zeros((3, 64, 64)), period_us=192.0),
    "taxel.simulate.Scene": plain(lambda **given: taxel.simulate.Scene(**given).motion(), parameters=SCENE.parameters),
    "taxel.simulate.Scene.draw": plain(taxel.simulate.Scene.draw, seed=1, index=0, left_to_rest=False, array=None),
    "taxel.simulate.Scene.motion": method(SCENE, "motion", step_us=100.0, array=None),
    "taxel.simulate.Scene.replace": lambda: (
        lambda **given: SCENE.replace(**given).motion(),
        {"foam": {"dashpot_ms": 0.0}, "lead_ms": 5.0},
    ),
    "taxel.simulate.Scene.body": lambda: (
        lambda n, **given: SCENE.body(n, **given).motion(),
        {"n": 0, "x_mm": 80.0, "mass_g": 30.0},
    ),
    "taxel.simulate.play": plain(
        taxel.simulate.play,
        acts=[taxel.simulate.Silence(10.0)],
        seed=1,
        preset="5.2 kHz",
        tare_ms=3.0,
        array=None,
        sensor={},
        wire=2,
        circuit=None,
        asynchronous=True,
        watch=lambda _: None,
    ),
    "taxel.simulate.circuit.Fabric": plain(CIRCUIT.Fabric, rest_us=0.1, touch_us=1.0, exponent=0.8),
    "taxel.simulate.circuit.Fabric.conductance": method(CIRCUIT.Fabric(), "conductance", force_n=[0.0, 1.0]),
    "taxel.simulate.circuit.Fabric.force": method(CIRCUIT.Fabric(), "force", conductance_us=[0.0, 1.0]),
    "taxel.simulate.circuit.VirtualGround": plain(
        CIRCUIT.VirtualGround,
        v_trans=0.5,
        feedback_kohm=47.0,
        gain=1e3,
        offset_mv=2.0,
        switch_ohm=2.5,
        wire_ohm=1.0,
        rail_v=3.3,
        seed=1,
    ),
    "taxel.simulate.circuit.Divider": plain(
        CIRCUIT.Divider, supply_v=5.0, resistor_kohm=10.0, switch_ohm=2.5, wire_ohm=1.0, idle="floating"
    ),
    "taxel.simulate.circuit.Converter": plain(
        CIRCUIT.Converter,
        shape="linear",
        ramp=150,
        hysteresis_v=0.1,
        settle_us=0.05,
        amplifier_us=0.7,
        discharge_us=0.02,
        wait_us=0.2,
        step_us=0.75,
        line_us=3.0,
        steps=4,
    ),
    "taxel.simulate.circuit.Converter.ticks": method(CIRCUIT.Converter(), "ticks", volts=[[1.4, 2.0]]),
    "taxel.simulate.circuit.Converter.ramp_volts": method(CIRCUIT.Converter(), "ramp_volts", ticks=[1.0, 9.0]),
    "taxel.simulate.circuit.Converter.ramp_ticks": method(CIRCUIT.Converter(), "ramp_ticks", volts=[1.0, 9.0]),
    "taxel.simulate.circuit.Converter.trace": method(
        CIRCUIT.Converter(), "trace", line_v=[1.4, 1.5, 2.0, 2.5], every_us=0.1, stop_us=6.0
    ),
    "taxel.simulate.circuit.AdaptiveRamp": plain(
        CIRCUIT.AdaptiveRamp,
        converter=CIRCUIT.Converter(),
        steepest=38,
        gentlest=510,
        moves_ticks=4.0,
        noise_ticks=2.0,
    ),
    "taxel.simulate.circuit.AdaptiveRamp.convert": method(
        CIRCUIT.AdaptiveRamp(), "convert", volts=np.full((9, 4, 8), 1.5), period_us=20.0
    ),
    "taxel.simulate.circuit.Circuit": plain(
        CIRCUIT.Circuit, readout=CIRCUIT.VirtualGround(), converter=CIRCUIT.Converter()
    ),
    "taxel.simulate.circuit.Circuit.ticks": method(CIRCUIT.Circuit(), "ticks", conductance_us=[[1.0, 2.0]]),
    "taxel.simulate.truth": plain(
        taxel.simulate.truth, acts=[taxel.simulate.Silence(10.0)], preset="5.2 kHz", array=None
    ),
    "taxel.simulate.Layer": plain(taxel.simulate.Layer, foam={}, array=ARRAY, cells_per_pitch=2, tolerance=1e-4),
    "taxel.simulate.Layer.press": method(LAYER, "press", sunk_mm=np.full((4, 4), 0.5)),
    "taxel.simulate.Layer.forget": method(LAYER, "forget"),
    "taxel.simulate.Layer.compliance": method(LAYER, "compliance", waves=[0.1]),
    "taxel.simulate.Layer.base_share": method(LAYER, "base_share", waves=[0.1]),
    "taxel.simulate.Silence": plain(
        lambda **given: taxel.simulate.play([taxel.simulate.Silence(**given)], seed=1, tare_ms=3.0), ms=10.0
    ),
    "taxel.information.confusion_matrix": plain(
        taxel.information.confusion_matrix, labels=["a", "b"], responses=["a", "a"], classes=["a", "b"]
    ),
    **{
        f"taxel.information.{name}": plain(getattr(taxel.information, name), counts=[[5, 1], [2, 4]])
        for name in ("label_entropy", "local_information", "panzeri_treves", "plug_in", "relevant_responses")
    },
    "taxel.information.quadratic_extrapolation": plain(
        taxel.information.quadratic_extrapolation, counts=[[5, 1], [2, 4]], repetitions=2, seed=1
    ),
    "taxel.information.estimate": plain(
        taxel.information.estimate,
        labels=["a", "b"] * 4,
        responses=["a", "b"] * 4,
        groups=["x", "y", "z", "z"] * 2,
        redraws=5,
        confidence=0.9,
        seed=1,
    ),
    "taxel.information.zero_test": plain(
        taxel.information.zero_test,
        answer=lambda labels: labels,
        labels=["a", "b"] * 4,
        found=1.0,
        groups=["x", "y"] * 4,
        shuffles=2,
        seed=1,
    ),
    "taxel.information.folds": plain(
        taxel.information.folds, labels=["a", "b"] * 4, count=2, groups=["x", "x", "y", "y"] * 2, seed=1
    ),
    "taxel.information.keeps": plain(
        taxel.information.keeps, cheap=FOUND_BITS, dear=FOUND_BITS, share=0.9, groups=["x", "y"] * 4
    ),
    "taxel.information.LDA": plain(taxel.information.LDA, ridge=0.1, priors="equal"),
    "taxel.information.LDA.fit": method(taxel.information.LDA(), "fit", x=CLOUD, y=[0, 1] * 4),
    "taxel.information.LDA.predict": method(LDA, "predict", x=CLOUD),
    "taxel.information.LDA.decision_function": method(LDA, "decision_function", x=CLOUD),
    "taxel.information.fold_predictions": plain(
        taxel.information.fold_predictions,
        x=CLOUD,
        y=[0, 1] * 4,
        folds=[0, 0, 0, 0, 1, 1, 1, 1],
        ridge=0.1,
        priors="training",
        keep="folds",
        progress=lambda *_: None,
    ),
    "taxel.information.FoldSums": plain(
        taxel.information.FoldSums, x=CLOUD, y=[0, 1] * 4, folds=[0, 0, 0, 0, 1, 1, 1, 1], keep="folds", progress=print
    ),
    "taxel.information.FoldSums.predictions": method(
        taxel.information.FoldSums(CLOUD, ["a", "b"] * 4, [0, 0, 0, 0, 1, 1, 1, 1]),
        "predictions",
        merge={"a": "x", "b": "y"},
        features=1,
        ridge=0.1,
        priors="training",
        progress=lambda *_: None,
    ),
    "taxel.information.GramLDA": plain(taxel.information.GramLDA, features=2, ridge=0.1, priors="equal"),
    "taxel.information.GramLDA.fit": method(
        taxel.information.GramLDA(features=2), "fit", gram=CLOUD @ CLOUD.T, y=[0, 1] * 4
    ),
    "taxel.information.GramLDA.predict": method(GRAM_LDA, "predict", gram=CLOUD @ CLOUD.T),
    "taxel.information.GramLDA.decision_function": method(GRAM_LDA, "decision_function", gram=CLOUD @ CLOUD.T),
    "taxel.information.NearestNeighbours": plain(taxel.information.NearestNeighbours, neighbours=1),
    "taxel.information.NearestNeighbours.fit": method(
        taxel.information.NearestNeighbours(), "fit", distances=CLOUD @ CLOUD.T, y=[0, 1] * 4
    ),
    "taxel.information.NearestNeighbours.predict": method(
        taxel.information.NearestNeighbours().fit(CLOUD @ CLOUD.T, [0, 1] * 4), "predict", distances=CLOUD @ CLOUD.T
    ),
    "taxel.information.distances_of": plain(taxel.information.distances_of, gram=CLOUD @ CLOUD.T),
    "taxel.information.nested_predictions": plain(
        taxel.information.nested_predictions,
        grams=[CLOUD @ CLOUD.T],
        features=[2],
        y=[0, 1] * 4,
        groups=["x", "x", "y", "y"] * 2,
        count=2,
        inner=2,
        ridges=[1.0],
        neighbours=(),
        seed=1,
    ),
    "taxel.information.training_curve": plain(
        taxel.information.training_curve,
        grams=[CLOUD @ CLOUD.T],
        features=[2],
        y=[0, 1] * 4,
        nested=NESTED,
        sizes=[2],
        seed=1,
    ),
    "taxel.information.RateCode": plain(taxel.information.RateCode, window_ms=10.0, resolution_ms=0.0, most_hz=100.0),
    **{
        f"taxel.information.{name}": plain(getattr(taxel.information, name), window_ms=10.0, resolution_ms=0.5)
        for name in ("FirstSpikeLatency", "RelativeLatency", "RankOrder")
    },
    "taxel.information.Code.encode": method(
        taxel.information.RankOrder(window_ms=10.0), "encode", values=[0.5, 1.0], onset_ms=1.0
    ),
    "taxel.information.Code.decode": method(
        taxel.information.RateCode(window_ms=10.0), "decode", trains=UNSIGNED, onset_ms=1.0
    ),
    "taxel.information.compare_codes": plain(
        taxel.information.compare_codes,
        trials=[UNSIGNED] * 8,
        labels=[0, 1] * 4,
        codes={"rank": taxel.information.RankOrder(window_ms=10.0)},
        onsets_ms=[0.0] * 8,
        groups=list(range(8)),
        folds=2,
        seed=1,
    ),
    "taxel.information.ConeRReadout": plain(taxel.information.ConeRReadout, tau=5.0, bound=1.0, max_seconds=1.0),
    "taxel.information.ConeRReadout.fit": method(
        taxel.information.ConeRReadout(tau=5.0, bound=1.0), "fit", patterns=[PLAIN, PLAIN], y=[0, 1]
    ),
    "taxel.information.TempotronReadout": plain(
        taxel.information.TempotronReadout, tau=5.0, epochs=3, max_seconds=1.0, seed=1
    ),
    "taxel.information.TempotronReadout.fit": method(
        taxel.information.TempotronReadout(epochs=3), "fit", patterns=[PLAIN, PLAIN], y=[0, 1]
    ),
    **{
        f"taxel.information.{type(readout).__name__}.{name}": method(readout, name, patterns=[PLAIN])
        for readout in READOUTS
        for name in ("predict", "decision_function")
    },
    "taxel.information.LabelledTrial": plain(
        taxel.information.LabelledTrial,
        source=EVENTS,
        label="a",
        start_us=0,
        stop_us=500,
        group="x",
        parameters={"radius": "5"},
        name="one",
    ),
    "taxel.information.read_trials": lambda: (
        taxel.information.read_trials,
        {"table": "here_trials.csv", "recordings": [taxel.open("here_events.npz")], "window_ms": 0.1},
    ),
    "taxel.information.notes_as_trials": lambda: (
        taxel.information.notes_as_trials,
        {"recordings": [taxel.open("here_events.npz").with_notes([taxel.Note("ball", 0, 0)])], "window_ms": 0.1},
    ),
    "taxel.information.recordings_as_trials": lambda: (
        taxel.information.recordings_as_trials,
        {"recordings": [taxel.open("here_events.npz")], "window_ms": 0.1},
    ),
    "taxel.information.answer": plain(
        taxel.information.answer,
        trials=TOUCHES,
        encoder=taxel.encode.ChangeEvents(),
        window_ms=5.0,
        windows_ms=[2.0],
        periods_ms=[1.0],
        taxels=[1],
        pools=[2],
        taxels_at_ms=1.0,
        draws=1,
        folds=2,
        shuffles=1,
        classifiers=["neighbours"],
        seed=1,
        progress=lambda *_: None,
    ),
    "taxel.formats.trials": every(taxel.formats.trials, path="pdb", format="gaitpdb"),
}

#: Functions to be called: a function of another kind is the caller's to blame, and its own error comes out.
CALLED = {"answer", "progress", "say", "watch"}

for encoder in laws.ENCODERS.values():
    # One sound call of each encoder of the registry: its first example.
    SOUND.setdefault(f"taxel.encode.{type(encoder).__name__}", plain(type(encoder), **encoder.get_params(deep=False)))

for metric in _core.metric_names():
    # And of each metric that has no more to be asked than defaults say.
    distance = getattr(taxel.metrics, metric, None)
    if distance is not None and not described(metric)["required"]:
        SOUND.setdefault(f"taxel.metrics.{metric}", plain(distance, a=UNSIGNED, b=UNSIGNED))

#: What is not tried, and why.
LEFT_OUT = {
    "taxel.encode.Afferents": "what Skin.afferents returns",
    "taxel.learn.STDP.fit": "does not look at its targets; its patterns are tried in tests/learn/test_stdp.py",
    "taxel.simulate.Track": "what Scene.motion returns",
    "taxel.simulate.SceneFile": "what SceneFile.open returns",
    "taxel.simulate.SceneFile.open": "reads files; tried in tests/simulate/test_scene_files.py",
    "taxel.simulate.Pressed": "what Layer.press returns",
    "taxel.Error": "raised, not called",
    "taxel.FormatError": "raised, not called",
    "taxel.ProblemError": "raised, not called",
    "taxel.DeviceError": "raised, not called",
    "taxel.SceneError": "raised, not called",
    "taxel.BoardChange": "of a recording",
    "taxel.Clock": "of a recording",
    "taxel.device.Cable": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.command": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.floor": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.read": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.reopen": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device.apply": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device.record": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Greeting": "a result",
    "taxel.device.Port": "a result",
    "taxel.live.Live.expect_version": "tried with version 2's own tests",
    "taxel.simulate.Pipe": "needs a pipe; tried in tests/simulate/test_emulate.py",
    "taxel.simulate.Pipe.registers": "of a pipe",
    "taxel.Clock.host_ns": "of a recording",
    "taxel.detect.Judged": "of judge",
    "taxel.detect.Trained": "of judge",
    "taxel.detect.Fold": "checked by judge",
    "taxel.detect.Part": "checked by judge",
    "taxel.Clock.board_us_at": "of a recording",
    "taxel.Datagrams": "of a recording",
    "taxel.Health": "a result",
    "taxel.Label": "a row of Labels",
    "taxel.Load": "what Calibration.fit checks",
    "taxel.Note": "of a recording",
    "taxel.Zeroing": "of a recording",
    "taxel.Recording": "made by taxel.open",
    "taxel.Recording.on_clock": "needs a recording of several sources; tried in tests/recording",
    "taxel.detect.Score": "a result",
    "taxel.detect.Spread": "a result",
    "taxel.detect.Example": "checked by train",
    "taxel.detect.TrainedNeuron": "checked by Readout",
    "taxel.detect.Learner": "a protocol",
    "taxel.formats.Format": "a result",
    "taxel.information.Code": "abstract: its kinds are tried",
    "taxel.formats.Trial": "a result",
    "taxel.NotFittedError": "raised, not called",
    "taxel.encode.Encoder.fit": "does nothing",
    "taxel.metrics.Matching": "a result",
    "taxel.learn.Certificate": "a result",
    "taxel.learn.Margin": "a result",
    "taxel.learn.Row": "a name, checked by ConeXProblem.row",
    "taxel.information.Answer": "a result",
    "taxel.information.Control": "a result",
    "taxel.information.Estimate": "a result",
    "taxel.information.LDA.from_moments": "for FoldSums, which checks",
    "taxel.information.Nested": "a result",
    "taxel.information.Point": "a result",
    "taxel.information.Verdict": "a result",
    "taxel.information.ZeroTest": "a result",
    "taxel.live.Said": "a result",
    "taxel.live.Summary": "a result",
    "taxel.live.heard": "takes what Live said",
    "taxel.live.Panel.listen": "begins a Live, which checks",
    "taxel.live.Bridge": "needs a wheel of its own; tried in tests/bridge",
    "taxel.live.Remote": "needs a wheel of its own; tried in tests/bridge",
    "taxel.live.PanelClient": "connects to a panel; tried in tests/live/test_client.py",
    "taxel.live.PanelClient.play": "asks a panel; tried in tests/live/test_client.py",
    "taxel.live.Viewer": "needs an extra and begins a process; tried in tests/live",
    "taxel.live.Viewing": "a result",
    "taxel.live.Viewer.wait": "waits",
    "taxel.live.Panel.delta_intensity": "begins a Live; its flag is checked, and tests/panel tries it",
    "taxel.live.Live.next": "waits",
    "taxel.live.Live.note": "tried with Live's own tests",
    "taxel.live.Live.record": "tried with trials' own tests",
    "taxel.live.Live.zero": "tried with Live's own tests",
    "taxel.live.Live.sample": "tried with Live's own tests",
    "taxel.live.Live.source_address": "tried with Live's own tests",
    "taxel.simulate.circuit.Converted": "a result",
    "taxel.simulate.circuit.Trace": "a result",
    "taxel.simulate.Contact": "a result",
    "taxel.simulate.Motion": "a result",
    "taxel.simulate.Played": "a result",
    "taxel.simulate.EmulatorReport": "a result",
    "taxel.simulate.emulate": "plays in real time; its arguments are those of play, tried there",
    "taxel.wire.Counts": "a result",
    "taxel.wire.Received": "a result",
    "taxel.wire.Status": "a result",
    "taxel.wire.StreamReader": "takes nothing",
}


def modules() -> list[Any]:
    """The package and the rooms that it offers; the command line has exit codes instead, and tests of its own."""
    rooms = [room for name in taxel.__all__ if inspect.ismodule(room := getattr(taxel, name))]
    return [taxel, *rooms, taxel.simulate.circuit]


def public() -> dict[str, Any]:
    """Every public callable once, by its shortest name: functions, classes, and what classes define themselves."""
    names: dict[int, str] = {}
    found: dict[str, Any] = {}
    for module in modules():
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not callable(value) or id(value) in names:
                continue
            full = f"{module.__name__}.{name}"
            names[id(value)] = full
            found[full] = value
            if inspect.isclass(value) and not issubclass(value, BaseException):
                for part, member in vars(value).items():
                    held = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                    if not part.startswith("_") and part != "plot" and inspect.isfunction(held):
                        found[f"{full}.{part}"] = held
    return {name: value for name, value in found.items() if takes(value) or name in SOUND or name in LEFT_OUT}


def takes(value: Any) -> set[str]:
    """The names of what a callable takes; ``**`` takes names of its own."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except ValueError:  # exceptions that the compiled part makes
        return set()
    named = {p.name for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)}
    return named - {"self", "cls"}


def test_every_public_callable_has_a_sound_call() -> None:
    there = public()
    untried = sorted(set(there) - set(SOUND) - set(LEFT_OUT))
    gone = sorted((set(SOUND) | set(LEFT_OUT)) - set(there))
    assert (untried, gone) == ([], []), "add a sound call to SOUND, or a reason to LEFT_OUT; take out what is gone"


@pytest.mark.usefixtures("somewhere")
def test_every_argument_of_a_sound_call_is_there_to_be_tried() -> None:
    there = public()
    for name, sound in SOUND.items():
        assert takes(there[name]) <= set(sound()[1]), name


@pytest.fixture
def somewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    FOUND.to_csv("here.csv")
    TRAINS.save("here.npz")
    TARE.save("here_tare.json")
    CALIBRATION.save("here_calibration.json")
    TICKS.save("here_events.calibration.json")
    READOUT.save("here_readout.json")
    READOUT.to_nir("here.nir")
    TRAINS.to_nwb("here.nwb")
    taxel.convert(EVENTS, "here_events.npz")
    (tmp_path / "here.toml").write_text('[encoder]\nname = "fa1"\n')
    taxel.convert(EVENTS, tmp_path / "here_panel.mcap")
    (tmp_path / "here_labels.csv").write_text("label,t_us\na,5\n")
    (tmp_path / "here_trials.csv").write_text("recording,t_us,label\nhere_events,0,a\n")
    (tmp_path / "pdb").mkdir()
    row = "\t".join(["0"] * 18)
    (tmp_path / "pdb" / "GaCo01_01.txt").write_text("\n".join(f"{k / 100}\t{row}" for k in range(50)) + "\n")
    return tmp_path


@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("name", SOUND)
def test_a_sound_call_is_sound(name: str) -> None:
    function, arguments = SOUND[name]()
    function(**arguments)


@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("name", SOUND)
def test_nonsense_in_each_argument_is_one_clear_error(name: str) -> None:
    faults = []
    for argument in SOUND[name]()[1]:
        for kind, nonsense in NONSENSE.items():
            if argument in CALLED and callable(nonsense):
                continue
            function, arguments = SOUND[name]()
            try:
                function(**{**arguments, argument: nonsense})
            except (taxel.Error, OSError) as error:
                said = str(error)
                if not said or "\n" in said or "a bug in taxel" in said or re.search(PARSERS, said):
                    faults.append(f"{argument} = {kind}: {type(error).__name__}: {said!r}")
            except BaseException as error:  # what else comes out is a fault, a panic too
                faults.append(f"{argument} = {kind}: {type(error).__name__}: {error}")
    assert not faults, "\n".join(["", *faults])
