"""`Neuron(rearm=)` against a simulator that sums kernels point by point; cut into pieces, in files, live; refusals."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_neuron import Plain
from refusal import refused

import taxel
from taxel import Neuron, SpikeTrains
from taxel.detect import Readout, run
from taxel.encode import LevelCrossing
from taxel.learn import ConeX


@st.composite
def problems(draw: st.DrawFn) -> tuple[Neuron, np.ndarray, SpikeTrains, float]:
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    inputs, length = draw(st.integers(1, 12)), draw(st.sampled_from([40.0, 400.0]))
    exact = draw(st.booleans())
    if exact:
        # An input has the same effect on the next point and none on later ones, and weights are quarters of it: many
        # potentials are exactly at a threshold, or at a share of it.
        shape = {"kernel": "exponential", "tau": 1.0 / (50.0 * np.log(2.0)), "theta_0": 2.0**-50}
        shape |= {"theta_plus": 0.0, "step_ms": 1.0}
        weights = rng.integers(-1, 5, inputs) * 0.25
    else:
        shape = {
            "kernel": draw(st.sampled_from(["alpha", "exponential"])),
            "tau": draw(st.sampled_from([2.0, 15.0, 60.0])),
            "theta_plus": draw(st.sampled_from([0.0, 0.2])),
            "step_ms": draw(st.sampled_from([1.0, 0.3])),
        }
        weights = rng.normal(0.2, 0.5, inputs)
    neuron = Neuron(
        time="grid",
        rearm=draw(st.sampled_from([None, 1.0, 0.5, 0.25, 0.9, 0.01])),
        after_spike=draw(st.sampled_from(["keep", "keep", "ignore", "reset"])),
        first_threshold=draw(st.sampled_from(["theta_0", "printed"])),
        refractory=draw(st.sampled_from([3.0, 0.7, 12.0])),
        **shape,
    )
    lists = [np.sort(rng.uniform(-5.0, length, rng.poisson(length / (4 if exact else 12)))) for _ in range(inputs)]
    if exact or draw(st.booleans()):
        lists = [np.floor(times) for times in lists]
    graded = {}
    if not exact and draw(st.booleans()):
        values = [rng.choice([-1, 1, 1], len(times)) * 10 ** rng.uniform(-1, 1, len(times)) for times in lists]
        graded = {"values": values, "kind": "graded"}
    trains = SpikeTrains.from_lists(lists, -5.0, length, **graded)
    return neuron, weights, trains, draw(st.sampled_from([1.0, 0.5]))


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(problems())
def test_a_neuron_fires_as_the_simulator_does(problem: tuple[Neuron, np.ndarray, SpikeTrains, float]) -> None:
    neuron, weights, trains, threshold = problem
    assert neuron.run(weights, trains, threshold=threshold) == pytest.approx(
        Plain(neuron, weights, trains, threshold).run_grid(trains.stop, neuron.step_ms), abs=1e-9
    )


def test_a_potential_that_just_reaches_the_share_is_not_below_it() -> None:
    """An input of 1 halves with every ms: .5 at 2 ms, where it fires, .25 at 3 ms; the next is felt at 4 ms."""
    trains = SpikeTrains.from_lists([[1.0, 3.0]], 0.0, 30.0)
    neuron = Neuron(
        time="grid", kernel="exponential", tau=1.0 / np.log(2.0), theta_0=0.5, theta_plus=0.0, refractory=0.5
    )
    for rearm, fired in ((None, [2.0, 4.0]), (0.5, [2.0]), (0.500001, [2.0, 4.0]), (1.0, [2.0, 4.0])):
        assert neuron.set_params(rearm=rearm).run([1.0], trains).tolist() == fired


def readout() -> Readout:
    weights = np.random.default_rng(2).normal(0.1, 0.4, 32)
    one = Neuron(tau=3.0, refractory=5.0, time="grid", step_ms=0.2, rearm=0.4)
    other = Neuron(tau=9.0, refractory=5.0, time="grid", step_ms=0.2)
    neurons = {"a": (one, weights), "b": (other, weights)}
    return Readout(LevelCrossing([0.3, 0.6]), neurons, array=taxel.Array(2, 4), run_threshold=0.9)


def made_frames() -> taxel.Frames:
    random = np.random.default_rng(8)
    times = np.arange(0, 4_000_000, 2000)
    phase = random.uniform(0, 6, (1, 2, 4))
    values = np.abs(np.sin(times[:, None, None] / 2e5 + phase)) + random.normal(0, 0.02, (len(times), 2, 4))
    return taxel.Frames(values, times, array=taxel.Array(2, 4))


def test_files_hold_it_and_readouts_stream_it(tmp_path) -> None:
    one = readout()
    again = Readout.load(one.save(tmp_path / "one.json"))
    assert again == one
    assert again.neurons["a"].neuron.rearm == 0.4
    kept = json.loads(one.to_json())["neurons"]
    assert kept["a"]["neuron"]["rearm"] == 0.4
    assert "rearm" not in kept["b"]["neuron"], "a file without it is as it was"
    frames = made_frames()
    found = run(again, frames)
    trains = one.encoder.encode(frames).split_by_sign()
    for label, trained in one.neurons.items():
        offset = one.encoder.latency_ms + trained.delay_ms
        fired = trained.neuron.run(trained.weights, trains, threshold=0.9) - offset
        here = found.t[np.array([name == label for name in found.label])] / 1000.0
        assert len(here) > 5
        assert here[: len(fired)] == pytest.approx(fired, abs=1e-3)
    free = Readout.from_json(
        json.dumps(
            json.loads(one.to_json())
            | {"neurons": kept | {"a": {**kept["a"], "neuron": {**kept["a"]["neuron"], "rearm": None}}}}
        )
    )
    assert len(run(free, frames).t) > len(found.t)
    pieces, stream = [], again.stream(frames.array)
    for k in range(0, len(frames.t), 37):
        pieces += list(stream.push(frames[k : k + 37]).t)
    pieces += list(stream.advance(int(frames.t[-1]) + 1_100_000).t)
    assert pieces == found.t.tolist()


def test_who_cannot_have_it_refuses_it_by_name(tmp_path) -> None:
    with refused(argument="rearm"):
        Neuron(rearm=0.5)
    with refused(argument="rearm"):
        ConeX(neuron=Neuron(time="grid", rearm=0.5))
    pytest.importorskip("nir")
    with refused():
        readout().to_nir(tmp_path / "one.nir")
    assert not list(tmp_path.iterdir())
