"""`Neuron(rearm=)` against a simulator that sums kernels point by point; in files; refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_neuron import Plain
from refusal import refused

import taxel
from taxel import Neuron, SpikeTrains
from taxel.detect import Readout
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


def test_who_cannot_have_it_refuses_it_by_name(tmp_path) -> None:
    with refused(argument="rearm"):
        Neuron(rearm=0.5)
    with refused(argument="rearm"):
        ConeX(neuron=Neuron(time="grid", rearm=0.5))
    pytest.importorskip("nir")
    neuron = Neuron(time="grid", rearm=0.4)
    one = Readout(LevelCrossing([0.3]), {"a": (neuron, np.ones(16))}, array=taxel.Array(2, 4))
    assert Readout.from_json(one.to_json()).neurons["a"].neuron.rearm == 0.4
    with refused():
        one.to_nir(tmp_path / "one.nir")
    assert not list(tmp_path.iterdir())
