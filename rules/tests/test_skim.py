"""SKIM: rows against sums of kernels, weights against numpy.linalg.lstsq on the stated matrix."""

import itertools

import numpy as np
import pytest
from rule_examples import patterns

from taxel import SpikeTrains
from taxel_rules import SKIM


def wanted(pattern, targets, step, pulse):
    t = pattern.start + step * np.arange(int((pattern.stop - pattern.start) / step + 1e-9) + 1)
    return t, np.any([(t >= at - 1e-9) & (t < at + pulse - 1e-9) for at in targets] + [np.zeros(len(t), bool)], axis=0)


@pytest.mark.parametrize("step", [1.0, 0.25])
def test_rows_are_sums_of_alpha_kernels(step):
    (pattern,), _ = patterns(1, trains=7, count=1, spikes=4)
    rows = SKIM(tau=12.0, step_ms=step).rows(pattern)
    t, _ = wanted(pattern, [], step, 1.0)
    for n, train in enumerate(pattern):
        s = np.maximum(t[:, None] - train[None], 0) / 12.0
        assert rows[:, n] == pytest.approx((s * np.exp(-s)).sum(1), abs=1e-12)


@pytest.mark.parametrize(("ridge", "pulse"), [(0.0, 10.0), (0.3, 4.0)])
def test_output_weights_are_those_of_lstsq_on_the_stated_matrix(ridge, pulse):
    shown, at = patterns(2, trains=30, count=12, targets=2, spikes=5)
    skim = SKIM(tau=9.0, ridge=ridge, pulse_ms=pulse).fit(shown, at)
    a = np.concatenate([skim.rows(p) for p in shown])
    y = np.concatenate([wanted(p, t, 1.0, pulse)[1] for p, t in zip(shown, at, strict=True)]).astype(float)
    assert skim.rows_ == len(a) == len(y)
    if ridge:
        a, y = np.vstack([a, np.sqrt(ridge) * np.eye(30)]), np.concatenate([y, np.zeros(30)])
    plain = np.linalg.lstsq(a, y, rcond=None)[0]
    assert skim.weights_ == pytest.approx(plain, rel=1e-9, abs=1e-11)
    assert skim.residual_ == pytest.approx(np.sum((a @ plain - y) ** 2), rel=1e-10)


def test_trains_that_are_silent_or_alike_get_the_shortest_solution():
    (pattern,), (at,) = patterns(3, trains=10, count=1, spikes=5)
    twice = SpikeTrains.from_lists([*pattern, *pattern, [], []], stop=pattern.stop)
    once, both = SKIM(tau=9.0).fit([pattern], [at]), SKIM(tau=9.0).fit([twice], [at])
    assert both.weights_[:10] == pytest.approx(once.weights_ / 2, rel=1e-8)
    assert both.weights_[10:20] == pytest.approx(once.weights_ / 2, rel=1e-8)
    assert both.weights_[20:] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_nearly_equal_trains_cost_no_more_digits_than_lstsq_loses():
    """Normal equations would square a condition of 1e7 and be left with 2 digits."""
    (pattern,), (at,) = patterns(4, trains=6, count=1, spikes=5)
    close = SpikeTrains.from_lists([*pattern, *(t + 1e-6 for t in pattern)], stop=pattern.stop + 1)
    skim = SKIM(tau=9.0).fit([close], [at])
    a, y = skim.rows(close), wanted(close, at, 1.0, 10.0)[1].astype(float)
    assert np.linalg.cond(a) > 1e6
    plain = np.linalg.lstsq(a, y, rcond=None)[0]
    assert a @ skim.weights_ == pytest.approx(a @ plain, abs=1e-8)
    assert skim.weights_ == pytest.approx(plain, rel=1e-4)


@pytest.mark.parametrize("nonlinearity", ["tanh", "none"])
def test_a_layer_of_branches_has_fixed_weights_and_delays_then_a_kernel_then_the_compression(nonlinearity):
    (pattern,), _ = patterns(5, trains=8, count=1, spikes=4)
    options = {"tau": 9.0, "branches": 20, "spread": 3.0, "delay_ms": 15.0, "nonlinearity": nonlinearity}
    rows = SKIM(seed=1, **options).rows(pattern)
    assert rows.shape == (201, 20)
    bare = SKIM(seed=1, **{**options, "nonlinearity": "none"})
    assert rows == pytest.approx(np.tanh(bare.rows(pattern)) if nonlinearity == "tanh" else bare.rows(pattern))
    # Weights show in the answer to one input each, delays in when it begins; together they make the rows.
    alone = [
        bare.rows(SpikeTrains.from_lists([[0.0] if k == n else [] for k in range(8)], stop=200.0)) for n in range(8)
    ]
    total = np.zeros((201, 20))
    for h in range(20):
        late = np.flatnonzero(alone[0][:, h])[0]
        assert all(np.flatnonzero(a[:, h])[0] == late for a in alone)
        # alpha: U(t + 1) / U(t) = (1 + 1/s) e^{-1/tau}, which gives the time s since the delayed input
        ratio = alone[0][late + 1, h] / alone[0][late, h] * np.exp(1 / 9.0)
        delay = late - 1 / (ratio - 1)
        assert 0 <= delay <= 15.0
        for n, train in enumerate(pattern):
            s = late - delay
            weight = alone[n][late, h] / (s / 9.0 * np.exp(-s / 9.0))
            assert abs(weight) <= 3.0 * (1 + 1e-9)
            x = np.maximum(np.arange(201)[:, None] - train[None] - delay, 0) / 9.0
            total[:, h] += weight * (x * np.exp(-x)).sum(1)
    assert bare.rows(pattern) == pytest.approx(total, rel=1e-6, abs=1e-6)
    assert not np.array_equal(rows, SKIM(seed=2, **options).rows(pattern))


def count(spikes, targets, window):
    """The largest one-to-one pairing, by trying all."""
    for k in range(min(len(spikes), len(targets)), 0, -1):
        for a in itertools.combinations(range(len(spikes)), k):
            for b in itertools.combinations(range(len(targets)), k):
                if all(abs(spikes[i] - targets[j]) <= window for i, j in zip(a, b, strict=True)):
                    return k
    return 0


def test_the_threshold_is_the_best_of_those_given_on_the_training_patterns():
    shown, at = patterns(6, trains=25, count=6, targets=2, spikes=3)
    skim = SKIM(tau=9.0, within_ms=12.0).fit(shown, at)
    assert [s[0] for s in skim.scores_] == pytest.approx(np.arange(1, 10) / 10)
    for threshold, found, missed, false in skim.scores_:
        spikes = skim.predict(shown, threshold=threshold)
        assert found == sum(count(s, t, 12.0) for s, t in zip(spikes, at, strict=True))
        assert (missed, false) == (12 - found, sum(map(len, spikes)) - found)
    best = min(s[2] + s[3] for s in skim.scores_)
    assert next(s[0] for s in skim.scores_ if s[2] + s[3] == best) == skim.threshold_


def test_an_output_spike_is_the_first_row_that_reaches_the_threshold():
    shown, at = patterns(7, trains=40, count=2, targets=2, spikes=4)
    skim = SKIM(tau=9.0, step_ms=0.5).fit(shown, at)
    output = skim.output(shown[0])
    assert output == pytest.approx(skim.rows(shown[0]) @ skim.weights_, abs=1e-9)
    spikes = skim.predict(shown)[0]
    rows = np.round(spikes / 0.5).astype(int)
    assert len(rows) > 0
    assert np.all(output[rows] >= skim.threshold_)
    assert np.all(output[rows[rows > 0] - 1] < skim.threshold_)


def test_a_recording_may_be_silent_for_longer_than_a_block_of_rows():
    """A block without a spike still holds what the potentials decay from."""
    skim = SKIM(tau=10.0).fit([SpikeTrains.from_lists([[5.0], [60.0]], stop=200.0)], [[80.0]])
    at = skim.thresholds[0]
    alone, late = (
        SpikeTrains.from_lists([[before + 5.0], [before + 60.0]], stop=before + 200.0) for before in (0.0, 20_000.0)
    )
    spikes = [skim.predict([trains], threshold=at)[0] for trains in (alone, late)]
    assert len(spikes[0]) > 0
    np.testing.assert_allclose(spikes[1] - 20_000.0, spikes[0], atol=1e-6)
