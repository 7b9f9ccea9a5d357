"""The changes of five rules against their formulas, and these formulas against what they stand for."""

import numpy as np
import pytest
from rule_examples import change_and_formula, kernel, patterns

from taxel import SpikeTrains
from taxel_rules import FILT, INST, PSD, SPAN, ReSuMe

BATCH = {"eta": 1.0, "initial": (0.0, 1.0), "epochs": 1, "updates": "batch"}
OF_A_TRACE = {**BATCH, "tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}


def filtered(s, tau_q=10.0):
    """The potential of an input after the filter of FILT."""
    c_m, c_s = 10 / (10 + tau_q), 5 / (5 + tau_q)
    before = 4 * (c_m * np.exp(-np.maximum(s, 0) / 10) - c_s * np.exp(-np.maximum(s, 0) / 5))
    return np.where(s > 0, before, 4 * (c_m - c_s) * np.exp(np.minimum(s, 0) / tau_q))


def window(s, amplitude, tau_w):
    return np.where(s > 0, amplitude * np.exp(-np.maximum(s, 0) / tau_w), 0.0)


def of_span(s):
    return (np.e / 2) ** 2 * (np.abs(s) + 5.0) * np.exp(-np.abs(s) / 5.0)


def psd(**options):
    return PSD(**BATCH, theta_0=2.0, **options)


#: The rule, what an input changes so long before a target, what else the formula takes, and what is added a spike.
CHANGES = {
    "FILT": (FILT(), filtered, {}, 0.0),
    "FILT, short": (FILT(tau_q=3.0), lambda s: filtered(s, 3.0), {}, 0.0),
    "INST, a target": (INST(), lambda s: kernel(s, 10.0, 5.0), {"targets": 1}, 0.0),
    "INST": (INST(), lambda s: kernel(s, 10.0, 5.0), {}, 0.0),
    "PSD": (psd(), lambda s: kernel(s, 10.0, 2.5), {"weights": (-0.5, 2)}, 0.0),
    "PSD, other times": (psd(tau_1=8.0, tau_2=3.0), lambda s: kernel(s, 8.0, 3.0), {"weights": (-0.5, 2)}, 0.0),
    "PSD, subtracting": (
        psd(tau_s=5.0, after_spike="subtract"),
        lambda s: kernel(s, 10.0, 2.5),
        {"weights": (-0.5, 2)},
        0.0,
    ),
    "ReSuMe": (ReSuMe(a=0.0, **OF_A_TRACE), lambda s: window(s, 1.0, 10.0), {}, 0.0),
    "ReSuMe, sharp": (ReSuMe(a=0.3, amplitude=2.0, tau_w=4.0, **OF_A_TRACE), lambda s: window(s, 2.0, 4.0), {}, 0.3),
    "ReSuMe, wide": (ReSuMe(a=-0.1, amplitude=0.5, tau_w=25.0, **OF_A_TRACE), lambda s: window(s, 0.5, 25.0), {}, -0.1),
    "SPAN": (SPAN(tau_a=5.0, **OF_A_TRACE), of_span, {}, 0.0),
}


@pytest.mark.parametrize("name", CHANGES)
def test_the_change_is_the_factor_of_inputs_before_targets_less_that_before_spikes(name):
    learner, factor, given, each = CHANGES[name]
    change, expected, _, fired = change_and_formula(learner, factor, **given)
    more = each * (given.get("targets", 3) - len(fired))
    assert change == pytest.approx(expected + more, rel=1e-9, abs=1e-9 if name == "SPAN" else 1e-12)


def test_the_kernel_of_filt_is_the_integral_over_the_filtered_spike():
    r = np.linspace(0, 400, 4_000_001)  # 40 time constants of the filter
    for s in (-20.0, -3.0, 0.0, 0.5, 7.0, 40.0):
        of_filter = np.trapezoid(np.exp(-r / 10.0) / 10.0 * kernel(s + r, 10.0, 5.0), r)
        assert filtered(np.array(s)) == pytest.approx(of_filter, abs=1e-6)


def test_defaults_of_inst_are_those_of_gardner_and_gruning():
    """Peak 1 mV at 7 ms; eta 600/(N n_s p), weights from 0 to 200/N."""
    (pattern,), _ = patterns(2, trains=1, count=1)
    change = INST().change([0.0], pattern, [pattern[0][0] + 6.93])[0]
    assert change == pytest.approx([1.0], abs=1e-4)
    shown, wanted = patterns(3, trains=50, count=4, targets=2)
    weights = np.array([INST(epochs=0, seed=s).fit(shown, wanted).weights_ for s in range(40)])
    assert 0 <= weights.min() < 0.01
    assert 3.99 < weights.max() <= 4.0
    start = weights[0]
    trained = INST(epochs=1, until_right=False).fit(shown, wanted, start=start)
    same = INST(epochs=1, until_right=False, eta=600 / (50 * 2 * 4)).fit(shown, wanted, start=start)
    assert trained.weights_.tobytes() == same.weights_.tobytes()


def test_the_closed_form_of_span_is_the_integral_of_input_times_target():
    tau = 5.0
    t = np.arange(0, 300, 0.001)

    def spread(at):
        s = np.maximum(t - at, 0)
        return np.e / tau * s * np.exp(-s / tau)

    for apart in (-30.0, -4.0, 0.0, 2.0, 25.0):
        pattern = SpikeTrains.from_lists([[60.0 - apart]], stop=200.0)
        change = SPAN(tau_a=tau, **OF_A_TRACE).change([0.0], pattern, [60.0])[0]
        assert change[0] == pytest.approx(np.sum(spread(60.0 - apart) * spread(60.0)) * 0.001, rel=1e-6)
