"""Sound calls of `taxel.detect`."""

import inspect

import numpy as np

import taxel
from sound.things import ARRAY, FOUND, FRAMES, LEVELS, TARE, Sound, fresh, method, plain

READOUT = taxel.Readout(LEVELS, {"a": (taxel.Neuron(tau=2.0), [0.5] * 32)}, array=ARRAY)
RECIPE = taxel.detect.Recipe(LEVELS, {"tau": 5.0}, {"a": {"ub": 1.0}})
EXAMPLE = taxel.detect.Example(taxel.Frames(np.eye(4)[:, :, None] * np.ones(4), [0, 9000, 18000, 27000]), {"a": [9000]})


def read_out() -> taxel.detect.ReadoutStream:
    return READOUT.stream()


#: A sound call of everything public that takes anything, by its full name.
SOUND: dict[str, Sound] = {
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
}

#: What is not tried, and why.
LEFT_OUT: dict[str, str] = {
    "taxel.detect.Judged": "of judge",
    "taxel.detect.Trained": "of judge",
    "taxel.detect.Fold": "checked by judge",
    "taxel.detect.Part": "checked by judge",
    "taxel.detect.Score": "a result",
    "taxel.detect.Spread": "a result",
    "taxel.detect.Example": "checked by train",
    "taxel.detect.Outcome": "a result",
    "taxel.detect.TrainedNeuron": "checked by Readout",
    "taxel.detect.Learner": "a protocol",
}
