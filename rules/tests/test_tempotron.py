"""The Tempotron against its formula, a fine grid, and SpikingJelly 2.0.0, live and by its numbers kept as data."""

import json
from pathlib import Path

import numpy as np
import pytest
from interrupts import ctrl_c_after
from rule_examples import kernel, patterns, summed

from taxel import SpikeTrains
from taxel_rules import Tempotron

DATA = Path(__file__).parent / "data" / "tempotron" / "spikingjelly_2.0.0.json"


def drawn(seed, trains=30, spikes=3, scale=0.6):
    (pattern,), _ = patterns(seed, trains=trains, count=1, duration=300.0, spikes=spikes)
    return pattern, np.random.default_rng(seed).normal(0.1, scale, trains)


def by_grid(pattern, weights, tau, tau_s, threshold=1.0, step=0.005):
    """The highest point by looking everywhere, inputs after the first crossing left out."""
    t = np.arange(0, pattern.stop + step / 2, step)
    times, strengths = np.concatenate(list(pattern)), np.repeat(weights, pattern.counts)
    u = sum(w * kernel(t - at, tau, tau_s) for at, w in zip(times, strengths, strict=True))
    over = np.flatnonzero(u >= threshold)
    if len(over):
        spike = t[over[0]]
        early = times < spike
        u = sum(w * kernel(t - at, tau, tau_s) for at, w in zip(times[early], strengths[early], strict=True))
    at = np.argmax(u)
    return (u[at], t[at], t[over[0]] if len(over) else np.inf) if u[at] > 0 else (0.0, 0.0, np.inf)


@pytest.mark.parametrize("seed", range(10))
def test_the_highest_point_is_exact(seed):
    pattern, weights = drawn(seed, scale=0.1 if seed < 3 else 0.4)
    tempotron = Tempotron(tau=15.0, tau_s=3.75)
    v_max, t_max, t_spike = tempotron.peak(weights, pattern)
    v, t, s = by_grid(pattern, weights, 15.0, 3.75)
    assert v_max == pytest.approx(v, abs=1e-5)
    assert v_max >= v - 1e-12
    assert t_max == pytest.approx(t, abs=0.1)
    assert np.isfinite(t_spike) == np.isfinite(s)
    if np.isfinite(s):
        assert s - 0.0051 <= t_spike <= s + 1e-9


@pytest.mark.parametrize("seed", range(10))
def test_the_change_is_the_potential_of_each_input_at_the_peak(seed):
    pattern, weights = drawn(seed)
    tempotron = Tempotron()
    _, t_max, t_spike = tempotron.peak(weights, pattern)
    wrong = not np.isfinite(t_spike)
    change = tempotron.change(weights, pattern, wrong)
    heard = SpikeTrains.from_lists([t[(t < t_max) & (t < t_spike)] for t in pattern], stop=pattern.stop)
    expected = (1 if wrong else -1) * summed(heard, t_max, lambda s: kernel(s, 15.0, 3.75))
    assert change == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert not tempotron.change(weights, pattern, not wrong).any()


def test_a_potential_that_never_rises_is_corrected_at_the_peak_of_the_last_input():
    pattern, weights = drawn(4)
    tempotron = Tempotron()
    assert tempotron.peak(-np.abs(weights), pattern)[:2] == (0.0, 0.0)
    last = max(t.max() for t in pattern)
    peak_at = 15.0 * 3.75 / (15.0 - 3.75) * np.log(4)
    expected = summed(pattern, last + peak_at, lambda s: kernel(s, 15.0, 3.75))
    assert tempotron.change(-np.abs(weights), pattern, True) == pytest.approx(expected, rel=1e-9)


def test_one_epoch_carries_the_last_change_on_from_error_to_error():
    shown = [drawn(s, scale=0.0)[0] for s in (5, 6)]
    start = np.full(30, 0.001)
    trained = Tempotron(eta=1e-6, momentum=0.9, epochs=1).fit(shown, [True, True], start=start)
    ends = []
    for order in ((0, 1), (1, 0)):
        weights, before = start.copy(), np.zeros(30)
        for p in order:
            before = 1e-6 * Tempotron().change(weights, shown[p], True) + 0.9 * before
            weights = weights + before
        ends.append(weights)
    assert any(trained.weights_ == pytest.approx(end, rel=1e-12) for end in ends)
    assert trained.right_[0] == 0.0


def test_the_rate_is_that_of_the_capacity_runs_where_it_is_left_out():
    """3e-3 T / (tau N V0)."""
    shown = [drawn(7, scale=0.0)[0]]
    start = np.full(30, 0.001)
    trained = Tempotron(epochs=1).fit(shown, [True], start=start)
    v0 = 4 ** (4 / 3) / 3
    eta = 3e-3 * 300.0 / (15.0 * 30 * v0)
    assert trained.weights_ == pytest.approx(start + eta * Tempotron().change(start, shown[0], True), rel=1e-12)


def task(seed, trains, load, duration=500.0):
    random = np.random.default_rng(seed)
    count = int(trains * load)
    shown = [SpikeTrains.from_lists(random.uniform(0, duration, (trains, 1)), stop=duration) for _ in range(count)]
    return shown, random.random(count) < 0.5


def test_a_load_of_1_is_solved_and_then_every_label_is_met():
    shown, labels = task(1, 200, 1)
    tempotron = Tempotron(seed=1).fit(shown, labels)
    assert tempotron.status_ == "right"
    assert tempotron.right_[-1] == 1.0
    assert np.array_equal(tempotron.predict(shown), labels)
    again = Tempotron(seed=1).fit(shown, labels)
    assert again.weights_.tobytes() == tempotron.weights_.tobytes()
    assert Tempotron(seed=2).fit(shown, labels).weights_.tobytes() != tempotron.weights_.tobytes()


def test_control_c_and_max_seconds_keep_the_best_so_far():
    shown, labels = task(3, 100, 6)
    tempotron = Tempotron(epochs=10**9)
    with ctrl_c_after(0.3, answered_within=60):
        tempotron.fit(shown, labels)
    assert (tempotron.status_, tempotron.weights_.shape) == ("stopped", (100,))
    limited = Tempotron(epochs=10**9, max_seconds=0.2).fit(shown, labels)
    assert limited.status_ == "stopped"
    assert limited.right_[limited.best_epoch_ - 1] == limited.right_.max()


def test_spikingjelly_agrees_by_its_kept_numbers():
    for case in json.loads(DATA.read_text())["cases"]:
        pattern = SpikeTrains.from_lists(case["times_ms"], stop=case["duration_ms"])
        weights = np.array(case["weights"])
        ours = Tempotron(tau=case["tau"], tau_s=case["tau_s"]).peak(weights, pattern)
        spike = np.inf if case["t_spike"] is None else case["t_spike"]
        assert ours == pytest.approx((case["v_max"], case["t_peak"], spike), rel=1e-9, abs=1e-9)
        if case["v_max"] == 0:  # never above rest: the peak of the last input is corrected, the gradient is 0
            continue
        fired = case["t_spike"] is not None
        change = Tempotron(tau=case["tau"], tau_s=case["tau_s"]).change(weights, pattern, not fired)
        assert (-change if fired else change) == pytest.approx(np.array(case["gradient"]), rel=1e-7, abs=1e-9)
