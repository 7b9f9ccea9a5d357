"""Sound calls of `taxel.detect`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, FOUND, FRAMES, LEVELS, TARE, Sound, fresh, method, plain

READOUT = taxel.Readout(LEVELS, {"a": (taxel.Neuron(tau=2.0), [0.5] * 32)}, array=ARRAY)
RULE = taxel.detect.PlainRule("area", 2)
RECIPE = taxel.detect.Recipe(LEVELS, {"tau": 5.0}, {"a": {"ub": 1.0}})
EXAMPLE = taxel.detect.Example(taxel.Frames(np.eye(4)[:, :, None] * np.ones(4), [0, 9000, 18000, 27000]), {"a": [9000]})


ALIGNMENT = taxel.detect.Alignment("a", 0, np.zeros(2, np.int64), np.array([0, 9000]), np.array([1.5, np.nan]))


def read_out() -> taxel.detect.ReadoutStream:
    return READOUT.stream()


def judged(folds: Any) -> taxel.detect.Judged:
    folds = folds if isinstance(folds, int) else [folds]
    return taxel.detect.judge([EXAMPLE, EXAMPLE], RECIPE, folds)


SCORE = taxel.detect.score(FOUND, {"a": [10], "b": [25]})
PLAIN = taxel.detect.PlainScore({"a": RULE, "b": None}, SCORE)


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.Readout": plain(
        taxel.Readout,
        encoder=LEVELS,
        neurons=READOUT.neurons,
        array=ARRAY,
        unit="N",
        delay_ms={"a": 1.0},
        run_threshold=0.9,
        delays_ms=[0.0],
        inputs=None,
    ),
    "taxel.Readout.encoder_of": method(READOUT, "encoder_of", label="a"),
    "taxel.Readout.trains_of": method(READOUT, "trains_of", label="a", trains=LEVELS.encode(FRAMES)),
    "taxel.Readout.to_nir": method(READOUT, "to_nir", path="readout.nir", spike_ms=0.1, overwrite=True),
    "taxel.Readout.from_json": plain(taxel.Readout.from_json, text=READOUT.to_json()),
    "taxel.Readout.save": method(READOUT, "save", path="readout.json", overwrite=True),
    "taxel.Readout.load": plain(taxel.Readout.load, path="here_readout.json"),
    "taxel.Readout.stream": method(READOUT, "stream", array=ARRAY, frame_us=192.0, tare=TARE, wire_version=2),
    "taxel.detect.ReadoutStream": plain(
        taxel.detect.ReadoutStream, readout=READOUT, array=ARRAY, frame_us=192.0, tare=TARE, wire_version=2
    ),
    "taxel.detect.ReadoutStream.push": fresh(read_out, "push", x=FRAMES),
    "taxel.detect.ReadoutStream.advance": fresh(read_out, "advance", t_us=5),
    "taxel.detect.PlainRule": plain(
        taxel.detect.PlainRule,
        quantity="area",
        threshold=2,
        release=1.0,
        frames=1,
        age_ms=5.0,
        labels=("small", "large"),
        noise_floor=3.0,
        unit="N",
        tare=TARE,
    ),
    "taxel.detect.PlainRule.from_json": plain(taxel.detect.PlainRule.from_json, text=RULE.to_json()),
    "taxel.detect.PlainRule.save": method(RULE, "save", path="rule.json", overwrite=True),
    "taxel.detect.PlainRule.load": plain(taxel.detect.PlainRule.load, path="here_rule.json"),
    "taxel.detect.PlainRule.stream": method(RULE, "stream", array=ARRAY, frame_us=192.0, tare=TARE, wire_version=2),
    "taxel.detect.load": plain(taxel.detect.load, path="here_rule.json"),
    "taxel.detect.tune": plain(
        taxel.detect.tune,
        examples=[taxel.detect.Example(FRAMES, {"a": [1000]}, TARE)],
        labels=["a"],
        window_ms=50.0,
        noise_floor=3.0,
        progress=lambda *_: None,
    ),
    "taxel.detect.run": plain(
        taxel.detect.run, readout=READOUT, source=FRAMES, frame_us=192.0, tare=TARE, wire_version=2
    ),
    "taxel.detect.score": plain(taxel.detect.score, found=FOUND, truth={"a": [10], "b": [25]}, window_ms=50.0),
    "taxel.detect.Spread.from_values": plain(taxel.detect.Spread.from_values, values=[1.0, 2.0]),
    "taxel.detect.Recipe": plain(
        taxel.detect.Recipe,
        encoder=LEVELS,
        learner={"tau": 5.0},
        neurons={"a": {"ub": 1.0}},
        run_threshold=1.0,
        about="a touch",
        source="made here",
        align=True,
        fit_levels=False,
    ),
    "taxel.detect.Recipe.learner_of": method(RECIPE, "learner_of", label="a"),
    "taxel.detect.Recipe.from_dict": plain(taxel.detect.Recipe.from_dict, values={"encoder": {"name": "fa1"}}),
    "taxel.detect.Recipe.load": plain(
        taxel.detect.Recipe.load, recipe="here.toml", changes={"learner.tau": 5.0}, labels=["a"], noise_floor=2.0
    ),
    "taxel.detect.Recipe.inputs_of": method(RECIPE, "inputs_of", label="a"),
    "taxel.detect.Recipe.points_of": method(RECIPE, "points_of", label="a"),
    "taxel.detect.judge": plain(
        taxel.detect.judge,
        examples=[EXAMPLE, EXAMPLE],
        recipe=RECIPE,
        k=2,
        search=False,
        window_ms=50.0,
        frame_us=192.0,
        progress=lambda *_: None,
    ),
    "taxel.detect.choose": plain(
        taxel.detect.choose,
        examples=[EXAMPLE, EXAMPLE],
        recipe=RECIPE,
        k=2,
        window_ms=50.0,
        frame_us=192.0,
        progress=lambda *_: None,
    ),
    "taxel.detect.fit": plain(taxel.detect.fit, examples=[EXAMPLE], recipe=RECIPE, progress=lambda *_: None),
    "taxel.detect.Part": plain(
        lambda **given: judged(taxel.detect.Fold([taxel.detect.Part(0)], [taxel.detect.Part(**given)])),
        example=1,
        start=0.0,
        stop=30_000.0,
    ),
    "taxel.detect.Fold": plain(
        lambda **given: judged(taxel.detect.Fold(**given)),
        train=[taxel.detect.Part(0)],
        test=[taxel.detect.Part(1)],
        inner=[],
    ),
    "taxel.detect.Example": plain(
        lambda **given: taxel.detect.fit([taxel.detect.Example(**given)], RECIPE),
        source=EXAMPLE.source,
        labels={"a": [9000]},
        tare=None,
        group="walk",
        name="walk 1",
        unlabelled=(),
    ),
    "taxel.detect.PlainScore.sooner": method(PLAIN, "sooner", than=SCORE),
    "taxel.detect.PlainScore.better": method(PLAIN, "better", than=SCORE),
    "taxel.detect.PlainScore.to_dict": method(PLAIN, "to_dict", than=SCORE),
    "taxel.detect.Alignment.felt": method(ALIGNMENT, "felt", example=0),
    "taxel.detect.TrainedNeuron": plain(
        lambda **given: taxel.Readout(LEVELS, {"a": taxel.detect.TrainedNeuron(**given)}, array=ARRAY),
        neuron=taxel.Neuron(tau=2.0),
        weights=[0.5] * 32,
        delay_ms=1.0,
        inputs=(),
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.detect.Alignment": lambda: ALIGNMENT,
    "taxel.detect.PlainScore": lambda: PLAIN,
    "taxel.detect.Judged": lambda: judged(2),
    "taxel.detect.Trained": lambda: judged(2).trained[0],
    "taxel.detect.Score": lambda: taxel.detect.score(FOUND, {"a": [10], "b": [25]}),
    "taxel.detect.Spread": lambda: taxel.detect.Spread.from_values([1.0, 2.0]),
    "taxel.detect.Outcome": lambda: taxel.detect.Outcome("walk", EXAMPLE, FOUND),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
