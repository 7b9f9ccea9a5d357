"""The neuron of the rules that learn by epochs, against sums of kernels written out."""

import numpy as np
import pytest
from rule_examples import kernel, patterns, peak

from taxel import ProblemError, SpikeTrains
from taxel_rules import INST, PSD, SKIM

TAU, TAU_S, THETA = 10.0, 5.0, 15.0


def fire(pattern, weights, psp, tau, theta, after_spike, step=0.1, refractory=0.0):
    """Output spikes by the definition: at each grid point the sum of all kernels and of all resets."""
    fired, fallen = [], []
    times = np.concatenate(list(pattern))
    strengths = np.repeat(weights, pattern.counts)
    for k in range(int(pattern.stop / step + 1e-9) + 1):
        t = k * step
        count = times <= t + 1e-9
        if after_spike == "reset" and fired:
            count &= times > fired[-1] + 1e-9
        u = np.sum(strengths[count] * psp(t - times[count]))
        u -= sum(v * np.exp(-(t - at) / tau) for at, v in fallen)
        if fallen and fired and t - fired[-1] <= refractory + 1e-9:
            fallen.append((t, u))
            continue
        if u >= theta:
            fired.append(t)
            if after_spike != "reset":
                fallen.append((t, theta if after_spike == "subtract" else u))
    return np.array(fired)


@pytest.mark.parametrize("after_spike", ["subtract", "membrane", "reset"])
@pytest.mark.parametrize("seed", [1, 2])
def test_spikes_are_those_of_the_sum_of_kernels(after_spike, seed):
    (pattern,), _ = patterns(seed, trains=60, count=1, spikes=3)
    weights = np.random.default_rng(seed).uniform(-2, 6, 60)
    neuron = INST(after_spike=after_spike)
    fired = neuron.change(weights, pattern, [100.0])[1]
    plain = fire(pattern, weights, lambda s: kernel(s, TAU, TAU_S), TAU, THETA, after_spike)
    assert len(plain) > 2
    assert fired == pytest.approx(plain, abs=1e-9)


@pytest.mark.parametrize(("tau", "refractory"), [(10.0, 0.0), (10.0, 3.0), (12.0, 0.7)])
def test_a_double_exponential_current_is_filtered_once_more(tau, refractory):
    (pattern,), _ = patterns(3, trains=60, count=1, spikes=3)
    weights = np.random.default_rng(3).uniform(-0.5, 1.5, 60)
    fine = np.arange(0, 200, 0.001)
    current = peak(10.0, 2.5) * (np.exp(-fine / 10.0) - np.exp(-fine / 2.5))
    driven = np.zeros_like(fine)
    for k in range(1, len(fine)):  # the membrane's own equation, by Heun's method
        driven[k] = (driven[k - 1] * (1 - 0.0005 / tau) + 0.0005 / tau * (current[k] + current[k - 1])) / (
            1 + 0.0005 / tau
        )

    def psp(s):
        return np.interp(s, fine, driven)

    psd = PSD(eta=1.0, initial=(0, 0), epochs=1, updates="batch", theta_0=1.0, tau=tau, refractory=refractory)
    fired = psd.change(weights, pattern, [100.0])[1]
    plain = fire(pattern, weights, psp, tau, 1.0, "membrane", refractory=refractory)
    assert len(plain) > 2
    assert fired == pytest.approx(plain, abs=1e-9)


def test_a_grid_of_more_points_than_can_be_had_is_one_clear_error_beforehand():
    trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    for call in (
        lambda: INST(step_ms=1e-9).fit([trains], [[20.0]]),
        lambda: SKIM(step_ms=1e-9).fit([trains], [[20.0]]),
        lambda: SKIM(step_ms=1e-9).rows(trains),
    ):
        with pytest.raises(
            ProblemError, match=r"step_ms is 0.000000001 ms: makes 6.0e10 grid points, more than the limit of"
        ):
            call()
