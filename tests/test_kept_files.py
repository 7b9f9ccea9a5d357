"""Files that an earlier taxel wrote (commit d9d9c97) can still be read: recordings, tare, recipes, readouts."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.detect import Example, Recipe, fit

KEPT = Path(__file__).parent / "data" / "kept"
SAID = json.loads((KEPT / "said.json").read_text())


@pytest.fixture(scope="module")
def events() -> taxel.Events:
    return taxel.open(KEPT / "touches.npz").events


@pytest.mark.parametrize("ending", ["csv", "lsa", "mcap"])
def test_a_recording_has_the_same_contents(ending, events):
    held = taxel.open(KEPT / f"touches.{ending}", array=events.array).events
    for column in ("t", "x", "y", "p"):
        assert np.array_equal(getattr(held, column), getattr(events, column)), column
    assert np.array_equal(held.intensity, events.intensity)


def test_a_tare_is_that_of_the_recording(events):
    tare, again = taxel.Tare.load(KEPT / "tare.json"), taxel.Tare.take(events, stop_us=1_500_000)
    assert np.array_equal(tare.rest, again.rest)
    assert (tare.array, tare.start_us, tare.stop_us) == (again.array, again.start_us, again.stop_us)
    assert np.isnan(tare.noise).all()  # it was saved before the noise was measured


def test_a_readout_gives_the_same_detections(events):
    readout = taxel.Readout.load(KEPT / "readout.json")
    found = taxel.detect.run(readout, events, tare=taxel.Tare.load(KEPT / "tare.json"))
    assert (list(found.label), found.t.tolist()) == (SAID["label"], SAID["t"])
    assert json.loads(readout.to_json()) == json.loads((KEPT / "readout.json").read_text())


def test_the_demo_s_readout_loads():
    assert set(taxel.Readout.load(KEPT / "demo_readout.json").neurons) == {"contact", "lift"}


def test_a_recipe_trains_the_same_weights(events):
    recipe = Recipe.load(KEPT / "touch.toml")
    example = Example(events, {"contact": [2_000_000, 3_000_000, 4_000_000]}, taxel.Tare.load(KEPT / "tare.json"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        readout = fit([example], recipe)
    weights = readout.neurons["contact"].weights
    assert np.allclose(weights, SAID["weights"], rtol=0, atol=1e-5)


def test_a_recipe_in_json_and_an_encoder_load():
    learner, delay_ms = Recipe.load(KEPT / "gaitndd.json").learner_of("contact")
    wanted = json.loads((KEPT / "gaitndd.json").read_text())["neurons"]["contact"]
    assert delay_ms == wanted.pop("delay_ms")
    given = learner.get_params()
    for name, value in wanted.items():
        held = given[name] if name in given else given[f"neuron__{name}"]
        assert np.array_equal(held, value), name
    text = (KEPT / "encoder.json").read_text()
    assert json.loads(taxel.encode.Encoder.from_json(text).to_json()) == json.loads(text)
