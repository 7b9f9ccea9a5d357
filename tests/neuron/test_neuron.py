"""The SRM0 neuron against 6.4 to 6.8 written out, stepped finely, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from draws import mixed
from interrupts import ctrl_c_after
from plain_neuron import Plain
from refusal import refused

from taxel import Neuron, SpikeTrains


def random_trains(seed, trains=20, duration=150.0, whole_ms=False):
    random = np.random.default_rng(seed)
    times = [np.sort(random.uniform(0, duration, random.integers(0, 6))) for _ in range(trains)]
    times = [t.round() if whole_ms else t for t in times]
    return random.uniform(-0.1, 0.4, trains), SpikeTrains.from_lists(times, stop=duration + 30)


KINDS = [
    {"after_spike": after, "first_threshold": first, "theta_plus": plus}
    for after in ("keep", "ignore", "reset")
    for first in ("theta_0", "printed")
    for plus in (0.0, 0.2, 1.0)
]


@pytest.mark.parametrize("kind", KINDS, ids=lambda k: "-".join(str(v) for v in k.values()))
def test_in_continuous_time_each_spike_is_the_root_that_brent_finds(kind):
    fired = 0
    for seed in range(4):
        neuron = Neuron(tau=7.0, tau_rec=[None, 5.0, 7.0, 40.0][seed], refractory=4.0, **kind)
        weights, trains = random_trains(seed)
        expected = Plain(neuron, weights, trains).run_continuous(trains.stop)
        # An output 1e-12 ms later can lose or keep an input, and the trains part from there (none does here).
        assert neuron.run(weights, trains) == pytest.approx(expected, abs=1e-9)
        fired += len(expected)
    assert fired > 10


@pytest.mark.parametrize(("kind", "tau_s"), mixed(KINDS, [None, 0.5, 6.5]))
def test_with_a_double_exponential_each_spike_is_the_root_that_brent_finds(kind, tau_s):
    fired = 0
    for seed in range(3):
        neuron = Neuron(
            tau=7.0, tau_s=tau_s, kernel="double_exponential", theta_0=0.5, tau_rec=[None, 3.0, 40.0][seed], **kind
        )
        weights, trains = random_trains(seed + 30)
        expected = Plain(neuron, weights, trains).run_continuous(trains.stop)
        assert neuron.run(weights, trains) == pytest.approx(expected, abs=1e-9)
        fired += len(expected)
    assert fired > 5


@pytest.mark.parametrize("kernel", ["double_exponential", "exponential"])
@pytest.mark.parametrize("kind", KINDS, ids=lambda k: "-".join(str(v) for v in k.values()))
def test_on_a_grid_every_kernel_fires_at_the_first_point_at_or_above_the_threshold(kernel, kind):
    for seed in range(4):
        neuron = Neuron(tau=7.0, kernel=kernel, theta_0=0.4, time="grid", **kind)
        weights, trains = random_trains(seed + 40, whole_ms=seed % 2 == 0)
        expected = Plain(neuron, weights, trains).run_grid(trains.stop, 1.0)
        assert len(expected) > 1
        assert neuron.run(weights, trains) == pytest.approx(expected, abs=1e-9)


def test_the_exponential_kernel_is_refused_in_continuous_time():
    with refused(argument="kernel"):
        Neuron(kernel="exponential")


def test_keep_fires_again_at_once_while_the_potential_stays_above_the_threshold():
    trains = SpikeTrains.from_lists([[0.0]], stop=30.0)
    fired = Neuron(tau=10.0, theta_plus=0.0).run([3.0], trains)
    assert np.diff(fired[:5]) == pytest.approx([3.0] * 4, abs=1e-12)
    assert len(Neuron(tau=10.0, theta_plus=0.0, after_spike="reset").run([3.0], trains)) == 1


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_what_counts_as_touching_the_threshold_is_in_proportion_to_it(time: str) -> None:
    trains = SpikeTrains.from_lists([[0.0]], stop=50.0)
    fired = {}
    for relative in (2e-12, 1e-10):
        weight = 0.3 * np.e * (1 - relative)
        fired[relative] = [
            len(Neuron(tau=10.0, time=time, theta_0=0.3 * unit, theta_plus=0.2 * unit).run([weight * unit], trains))
            for unit in (2.0**-40, 2.0**-10, 1.0, 2.0**10, 2.0**40)
        ]
    assert fired == {2e-12: [1] * 5, 1e-10: [0] * 5}


@pytest.mark.parametrize("after_spike", ["keep", "ignore", "reset"])
@pytest.mark.parametrize("kernel", ["alpha", "double_exponential"])
def test_an_input_at_a_crossing_to_rounding_comes_too_late_to_stop_it(kernel: str, after_spike: str) -> None:
    neuron = Neuron(kernel=kernel, tau=10.0, after_spike=after_spike, theta_plus=0.0)
    (crossing,) = neuron.run([1.2], SpikeTrains.from_lists([[0.0]], stop=12.0))[:1]
    for early in (1e-13, 1e-12, 3e-12):
        trains = SpikeTrains.from_lists([[0.0], [crossing - early], [crossing - early / 2]], stop=60.0)
        for weights in ([1.2, -3.0, -3.0], [1.2, 3.0, -6.0]):
            assert neuron.run(weights, trains)[0] == pytest.approx(crossing, abs=1e-12)
            later = neuron.run([1.2, 0.0, 0.6], trains)
            # An input that was too late for this spike counts for the next one, unless a reset discards it.
            assert (len(later) > 1) == (after_spike != "reset")
    for early in (1e-8, 9e-7, 1e-5):
        stopped = SpikeTrains.from_lists([[0.0], [crossing - early]], stop=60.0)
        assert len(neuron.run([1.2, -3.0], stopped)) == 0


@pytest.mark.parametrize("time", ["grid", "continuous"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_each_neuron_fires_as_it_does_by_itself(time: str, dtype: type) -> None:
    rng = np.random.default_rng(3)
    trains = SpikeTrains.from_lists([np.sort(rng.uniform(-5, 500.0, 10)) for _ in range(100)], -5.0, 500.0)
    weights = rng.normal(0.02, 0.1, (40, 100)).astype(dtype)
    neuron = Neuron(time=time)
    many = neuron.run_many(weights, trains, threshold=0.9)
    assert (len(many), many.start, many.stop) == (40, trains.start, trains.stop)
    assert (many.counts > 0).sum() > 20
    for row, fired in zip(weights, many, strict=True):
        assert np.array_equal(fired, neuron.run(row, trains, threshold=0.9))


TRAINS, SPIKES = 100, 200_000
WEIGHTS = np.full(TRAINS, 1e-3)
CALLS = {
    "run": lambda given: Neuron().run(WEIGHTS, given),
    "run on a grid": lambda given: Neuron(time="grid").run(WEIGHTS, given),
    "run_many": lambda given: Neuron().run_many(np.full((64, TRAINS), 1e-3), given),
    "potential": lambda given: Neuron().potential(WEIGHTS, given, np.linspace(0, SPIKES * 10.0, 20_000_000)),
}


@pytest.fixture(scope="module")
def given() -> SpikeTrains:
    """Every train has a spike in each stretch of 10 ms: sorting them by time is much of the work."""
    return SpikeTrains.from_lists([np.arange(SPIKES) * 10.0 + n * 0.0999 for n in range(TRAINS)], stop=SPIKES * 10.0)


@pytest.mark.parametrize("name", CALLS)
def test_control_c_answers_soon(name: str, given: SpikeTrains) -> None:
    # Half a second is the goal, and .15 to .27 s was measured; a loaded machine needs more.
    with ctrl_c_after(0.3, answered_within=2):
        CALLS[name](given)
