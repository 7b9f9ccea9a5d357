"""The neuron on graded trains: values multiply weights, in one neuron and in many."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_neuron import Plain

from taxel import Neuron, SpikeTrains


@st.composite
def problems(draw, decades=6):
    """A neuron, weights and graded trains: values over twelve decades, some inputs 1e-10 ms apart."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    inputs = draw(st.integers(1, 12))
    lists = []
    for _ in range(inputs):
        times = rng.uniform(0, 120, rng.integers(0, 5))
        close = times[: rng.integers(0, 3)] + rng.choice([1e-10, 1e-7, 1e-3])
        lists.append(np.sort(np.concatenate([times, close])))
    sizes = 10.0 ** rng.uniform(-decades, decades)
    values = [rng.choice([-1, 1], len(t)) * sizes * 10.0 ** rng.uniform(-1, 1, len(t)) for t in lists]
    values = [np.clip(v, -1e6, 1e6) for v in values]
    neuron = Neuron(
        time=draw(st.sampled_from(["grid", "continuous"])),
        kernel=draw(st.sampled_from(["alpha", "double_exponential"])),
        after_spike=draw(st.sampled_from(["keep", "ignore", "reset"])),
        first_threshold=draw(st.sampled_from(["theta_0", "printed"])),
        tau=draw(st.sampled_from([4.0, 15.0])),
        step_ms=draw(st.sampled_from([1.0, 0.3])),
    )
    trains = SpikeTrains.from_lists(lists, stop=150.0, values=values, kind="graded")
    weights = rng.normal(0.1, 0.6, inputs) / draw(st.sampled_from([1.0, sizes]))
    return neuron, weights, trains


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(problems())
def test_potentials_are_sums_of_weight_times_value_times_kernel(problem):
    neuron, weights, trains = problem
    plain, times = Plain(neuron, weights, trains), np.linspace(0, 150, 60)
    found = neuron.potential(weights, trains, times)
    for t, potential in zip(times, found, strict=True):
        size = np.abs(plain.w[plain.s < t]).sum()
        assert potential == pytest.approx(plain.potential(t, []), rel=1e-9, abs=1e-12 * size)


@settings(max_examples=120, deadline=None)
@given(problems())
def test_spikes_are_those_of_the_plain_sums(problem):
    neuron, weights, trains = problem
    plain = Plain(neuron, weights, trains)
    fired = neuron.run(weights, trains)
    for k, t in enumerate(fired):
        # At each spike the potential has come to the threshold; between spikes it is below it.
        above = plain.above(t, list(fired[:k]))
        slope = np.abs(plain.w).sum() / neuron.tau
        rounding = 1e-11 * np.abs(plain.w).sum() + slope * 1e-12 * 150
        assert above >= -rounding - 1e-11
        before = fired[k - 1] + neuron.refractory if k else 0.0
        assert k == 0 or t > fired[k - 1] + neuron.refractory - 1e-9
        if neuron.time == "continuous" and t > before + 1e-6:
            assert abs(above) <= rounding + 1e-10
    ends = [*(fired + neuron.refractory), np.inf]
    for k, (begin, end) in enumerate(zip([0.0, *ends[:-1]], [*fired, 150.0], strict=True)):
        inner = np.linspace(begin, end, 42)[1:-1]
        if neuron.time == "grid":
            inner = np.arange(np.ceil(begin / neuron.step_ms + 1e-6), np.ceil(end / neuron.step_ms - 1e-6))
            inner = inner * neuron.step_ms
        for t in inner[(inner > begin) & (inner < end)]:
            assert plain.above(t, list(fired[:k])) <= 1e-11 * (1 + np.abs(plain.w).sum())
