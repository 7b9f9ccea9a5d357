"""Readouts of several encoders side by side: each neuron receives its inputs, as if it stood behind them alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from refusal import refused

from taxel import Array, Detections, Events, Frames, Neuron, Readout, Tare
from taxel.detect import Example, Fold, Part, Recipe, TrainedNeuron, fit, judge, run
from taxel.encode import FA1, ChangeEvents, Composite, ContactArea, LevelCrossing, Moments, ThresholdIzhikevich

ARRAY = Array(4, 4, 2.0)
REST = Tare.take(Frames(np.full((2, 4, 4), 50.0), [0, 1000], unit="ticks", array=ARRAY))
#: Signed, graded, unsigned, and one whose spikes come late.
PARTS = {
    "change": ChangeEvents(),
    "moments": Moments(levels=2, graded=True, ages_ms=[0.0, 1.0, 4.0], period_ms=0.2, tare=REST),
    "area": ContactArea(levels=[2, 4], tare=REST),
    "late": ThresholdIzhikevich([60.0], period_ms=0.2),
}
INPUTS = {"a": ["area"], "b": ["moments", "change"], "c": ["late", "area"], "d": None, "e": ["change"]}
DELAYS = [0.0, 1.5]


def held(seed: int, n: int = 3000) -> Events:
    """Touches of all taxels, as events with held values."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.integers(0, 60_000, n))
    level = 50 + 30 * (np.sin(t / 400) > 0) * (t < 50_000)
    ticks = level + rng.integers(0, 9, n) * (t < 50_000)
    return Events(t, rng.integers(0, 4, n), rng.integers(0, 4, n), rng.random(n) < 0.5, intensity=ticks, array=ARRAY)


def frames(seed: int) -> Frames:
    return Frames.from_events(held(seed), 200)


def neurons(seed: int, **options: object) -> dict[str, TrainedNeuron]:
    """One a label, of random weights."""
    rng = np.random.default_rng(seed)
    made = {}
    for label, names in INPUTS.items():
        parts = PARTS if names is None else names
        counts = [PARTS[name].trains(ARRAY) * (1 + PARTS[name].signed) for name in parts]
        neuron = Neuron(**({"tau": 2.0, "refractory": 1.0} | options))
        made[label] = TrainedNeuron(
            neuron, rng.normal(1.2 / sum(counts), 0.2, 2 * sum(counts)), 0.5, tuple(names or ())
        )
    return made


def composite(seed: int, **options: object) -> Readout:
    return Readout(Composite(PARTS), neurons(seed, **options), array=ARRAY, delays_ms=DELAYS)


@pytest.mark.parametrize("source", [held, frames])
@pytest.mark.parametrize("options", [{}, {"time": "grid", "step_ms": 0.2, "kernel": "exponential"}])
def test_a_neuron_detects_what_it_would_behind_its_inputs_alone(source, options) -> None:
    """`t` too, so that the latency is the largest of its own inputs."""
    readout = composite(1, **options)
    recording = source(2)
    whole = run(readout, recording)
    for label, one in readout.neurons.items():
        encoder = Composite(PARTS) if INPUTS[label] is None else Composite(PARTS).only(INPUTS[label])
        assert readout.encoder_of(label) == encoder
        alone = run(Readout(encoder, {label: one._replace(inputs=())}, array=ARRAY, delays_ms=DELAYS), recording)
        own = whole[label]
        assert len(own) > 0
        assert (own.t.tolist(), own.known.tolist()) == (alone.t.tolist(), alone.known.tolist())
        assert own.slope.tobytes() == alone.slope.tobytes()
    assert len(whole) > 30
    assert Composite(PARTS).only(INPUTS["c"]).latency_ms == PARTS["late"].latency_ms > 0


def same(one: Detections, two: Detections) -> None:
    assert sorted(zip(one.label, one.t, strict=True)) == sorted(zip(two.label, two.t, strict=True))


def test_a_recording_its_pieces_and_its_trains_give_the_same() -> None:
    events, readout = held(3), composite(4)
    whole = run(readout, events)
    stream, found = readout.stream(ARRAY), []
    for start in range(0, 61_000, 777):
        found += list(stream.push(events.between(start, start + 777)))
        found += list(stream.advance(start + 500))
    found += list(stream.advance(3_000_000))
    assert [(d.label, d.t) for d in found] == list(zip(whole.label, whole.t, strict=True))
    # What is held at the end causes spikes of the late part for as long as the readout runs on.
    same(run(readout, Composite(PARTS).encode(events)), whole[whole.known < 75_000])


def test_the_file_holds_encoders_and_inputs_and_one_without_them_stays_as_it_is(tmp_path: Path) -> None:
    readout = composite(5)
    again = Readout.load(readout.save(tmp_path / "several.json"))
    assert again == readout
    assert {label: one.inputs for label, one in again.neurons.items()} == {
        label: tuple(names or ()) for label, names in INPUTS.items()
    }
    assert sorted(json.loads(again.to_json())["encoder"]["parts"]) == sorted(PARTS)
    assert run(again, held(6), tare=REST) == run(readout, held(6))
    one = Readout(PARTS["area"], {"a": (Neuron(), [1.0] * 4)})
    assert "inputs" not in one.to_json()
    assert '"inputs"' not in json.dumps(json.loads(readout.to_json())["neurons"]["d"])


def test_nir_holds_what_is_not_graded_and_refuses_what_is(tmp_path: Path) -> None:
    pytest.importorskip("nir")
    encoder = Composite({name: PARTS[name] for name in ("area", "change", "late")})
    given = {label: one for label, one in neurons(9).items() if label in ("a", "c", "e")}
    readout = Readout(encoder, given, array=ARRAY, delays_ms=DELAYS)
    readout.to_nir(tmp_path / "several.nir")
    import nir

    graph = nir.read(tmp_path / "several.nir")
    for k, (label, one) in enumerate(given.items()):
        row = np.concatenate([graph.nodes[f"weights_{copy}"].weight[k] for copy in range(len(DELAYS))])
        received = np.tile(encoder.places(one.inputs, ARRAY), len(DELAYS))
        assert not row[~received].any(), label
        ratio = row[received] / one.weights
        np.testing.assert_allclose(ratio, ratio[0])
    with refused():
        composite(1).to_nir(tmp_path / "graded.nir")


LEARNER = {"tau": 1.0, "ub": 2.0, "lb": -2.0, "delay_ms": 1.0, "refractory": 5.0, "after_spike": "reset"}


def touches(seed: int) -> Example:
    """Touches of two strengths, labelled where they begin; with contact at each."""
    rng = np.random.default_rng(seed)
    values = np.full((600, 4, 4), 50.0)
    at = np.arange(40, 560, 65)
    strong = rng.permutation(np.arange(len(at)) % 2)
    for k, one in zip(at, strong, strict=True):
        values[k : k + 30, 1:3, 1:3] += rng.uniform(40, 50) if one else rng.uniform(10, 14)
    labels = {"contact": 1000 * at, "strong": 1000 * at[strong == 1], "weak": 1000 * at[strong == 0]}
    return Example(Frames(values, 1000 * np.arange(600), unit="ticks", array=ARRAY), labels, REST)


def recipe(**more: object) -> Recipe:
    encoder = {
        "area": {"name": "contact_area"},
        "moments": {
            "name": "moments",
            "levels": 0,
            "graded": True,
            "ages_ms": [0.0, 4.0, 6.0],
            "displacement_mm": "none",
        },
    }
    kind = {
        "inputs": ["moments"], "kernel": "alpha", "tau": 0.5, "step_ms": 1.0, "ub": 50.0, "lb": -50.0, "delay_ms": 4.0,
        "lambdas": [0.0, 0.001, 0.0, 1.0, 1.0], "divide_c_by": "targets", "divide_d_by": "targets", "norm": "square",
        "sides_c": "below", "margin": 0.1,
    }  # fmt: skip
    values = {
        "encoders": encoder,
        "align": True,
        "run_threshold": 0.9,
        "learner": LEARNER,
        "neurons": {"contact": {"inputs": ["area"]}, "strong": kind, "weak": kind},
    }
    return Recipe.from_dict(values | more)


def test_inputs_are_chosen_among_the_points_and_what_none_uses_is_not_encoded() -> None:
    examples = [touches(seed) for seed in range(4)]
    alone = [one._replace(labels={"contact": one.labels["contact"]}) for one in examples]
    strong = {"name": "contact_area", "noise_floor": 20.0}  # feels half of the touches
    points = {"contact": {"inputs": ["strong"], "choose": [{"inputs": ["area"]}]}}
    plan = recipe(encoders={"area": {"name": "contact_area"}, "strong": strong}, neurons=points)
    result = judge(alone, plan, [Fold([Part(0), Part(1), Part(2)], [Part(3)])])
    assert (result.together["contact"].missed, result.together["contact"].false) == (0, 0)
    assert result.trained[0].recipe.inputs_of("contact") == ("area",)
    assert result.trained[0].readout.encoder == ContactArea()
    # The skin's trains would be thousands; without a tare the area could not be encoded at all.
    free = recipe(
        encoders={"area": {"name": "contact_area"}, "level": {"name": "level_crossing", "levels": [60.0]}},
        neurons={"contact": {"inputs": ["level"]}},
    )
    assert fit([one._replace(tare=None) for one in alone], free).encoder == LevelCrossing([60.0])


def test_a_delay_needs_an_age_of_its_own_inputs_alone() -> None:
    made = recipe(neurons={"a": {"inputs": ["area"], "delay_ms": 3.3}})
    assert made.learner_of("a")[1] == 3.3
    with refused():
        Recipe(FA1(), {"inputs": ["skin"]}, {"a": {}})
