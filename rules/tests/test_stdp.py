"""STDP against the paper's equations, summed over all inputs on a fine grid, and against a pattern that repeats."""

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest
from draws import seeds
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import SpikeTrains
from taxel_rules import STDP


def plainly(e, trains, stop, step=0.002):
    """Spikes and weights by the sums of the paper, every `step` ms; inputs and changes one by one."""
    weights = np.full(len(trains), e.initial)
    peak = np.log(e.tau_m / e.tau_s) * e.tau_m * e.tau_s / (e.tau_m - e.tau_s)
    scale = 1 / (np.exp(-peak / e.tau_m) - np.exp(-peak / e.tau_s))
    inputs = sorted((t, n) for n, train in enumerate(trains) for t in train)
    heard, spikes, k, below = [], [], 0, True
    last = np.full(len(trains), -np.inf)
    for t in np.arange(0, stop, step):
        while k < len(inputs) and inputs[k][0] <= t:
            at, n = inputs[k]
            heard.append((at, weights[n]))
            fired = spikes[-1] if spikes else -np.inf
            if last[n] < fired:
                weights[n] = max(0, weights[n] - e.a_minus * np.exp(-(at - fired) / e.tau_minus))
            last[n] = at
            k += 1
        p = 0.0
        if heard:
            u = t - np.array([h[0] for h in heard])
            p += scale * np.dot([h[1] for h in heard], np.exp(-u / e.tau_m) - np.exp(-u / e.tau_s))
        if spikes:
            s = t - spikes[-1]
            slow, fast = np.exp(-s / e.tau_m), np.exp(-s / e.tau_s)
            p += e.threshold * (e.k1 * slow - e.k2 * (slow - fast))
        if p >= e.threshold and below:
            before = spikes[-1] if spikes else -np.inf
            for n in np.flatnonzero(last > before):
                weights[n] = min(1, weights[n] + e.a_plus * np.exp(-(t - last[n]) / e.tau_plus))
            spikes.append(t)
            heard, below = [], False
        elif p < e.threshold:
            below = True
    return np.array(spikes), weights


@pytest.mark.parametrize("seed", seeds(6, quick=2))
def test_spikes_and_weights_are_those_of_the_paper_s_sums(seed):
    rng = np.random.default_rng(seed)
    trains = [np.sort(rng.uniform(0, 120, rng.integers(0, 9))) for _ in range(12)]
    stdp = STDP(threshold=rng.uniform(1.0, 2.5), a_plus=0.1, a_minus=0.08, k1=rng.uniform(1, 2), k2=rng.uniform(2, 4))
    stdp.fit([SpikeTrains.from_lists(trains, start=0.0, stop=150.0)])
    spikes, weights = plainly(stdp, trains, 150.0)
    assert len(spikes)
    assert stdp.spikes_ == pytest.approx(spikes, abs=0.01)
    assert stdp.weights_ == pytest.approx(weights, abs=1e-3)


def noise(rng, trains, seconds, hz=64):
    """Poisson trains, ms."""
    return [np.sort(rng.uniform(0, 1000 * seconds, rng.poisson(hz * seconds))) for _ in range(trains)]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), cuts=st.sets(st.integers(1, 999), max_size=6))
def test_pieces_teach_what_the_whole_does(seed, cuts):
    rng = np.random.default_rng(seed)
    whole = SpikeTrains.from_lists(noise(rng, 60, 1), start=0.0, stop=1000.0)
    at_once, piecewise, spikes = STDP(threshold=15.0).partial_fit(whole), STDP(threshold=15.0), []
    edges = [0, *sorted(cuts), 1000]
    for a, b in pairwise(edges):
        lists = [train[(train >= a) & (train < b)] for train in whole]
        piecewise.partial_fit(SpikeTrains.from_lists(lists, start=float(a), stop=float(b)))
        spikes.append(piecewise.spikes_)
    assert np.concatenate(spikes) == pytest.approx(at_once.spikes_, abs=1e-6)
    assert piecewise.weights_ == pytest.approx(at_once.weights_, abs=1e-9)
    assert len(at_once.spikes_)
    assert at_once.weights_.min() >= 0
    assert at_once.weights_.max() <= 1


def test_it_finds_a_pattern_that_repeats_and_fires_at_nothing_else():
    """A small stream: 400 inputs, half of them repeat 50 ms a third of the time."""
    rng = np.random.default_rng(5)
    pattern = [np.sort(rng.uniform(0, 50, 3)) for _ in range(200)]
    starts, lists = np.arange(100, 20_000, 150.0), noise(rng, 400, 20, 60)
    for n in range(200):
        clear = lists[n][((lists[n] - 100) % 150 > 50) | (lists[n] < 100)]
        lists[n] = np.sort(np.concatenate([clear, (starts[:, None] + pattern[n]).ravel()]))
    stdp = STDP(threshold=100.0).fit([SpikeTrains.from_lists(lists, start=0.0, stop=20_000.0)])
    late = stdp.spikes_[stdp.spikes_ > 15_000]
    since = (late - 100) % 150
    assert (since < 20).all()
    assert len(np.unique((late - 100) // 150)) >= 0.98 * np.count_nonzero(starts > 15_000)
    strong = np.flatnonzero(stdp.weights_ > 0.5)
    # Chance is a half.
    assert np.mean(strong < 200) > 0.85


def test_what_was_learnt_goes_on_in_a_copy_from_rest_and_is_read_without_learning():
    rng = np.random.default_rng(2)
    first = SpikeTrains.from_lists(noise(rng, 60, 1), start=0.0, stop=1000.0)
    stdp = STDP(threshold=15.0).partial_fit(first)
    other = pickle.loads(pickle.dumps(stdp))
    assert np.array_equal(other.predict([first])[0], stdp.predict([first])[0])
    before = other.weights_.copy()
    other.predict([first])
    assert np.array_equal(other.weights_, before)
    again = copy.deepcopy(stdp).partial_fit(first)
    assert not np.array_equal(again.weights_, before)
    assert again.spikes_[0] == pytest.approx(stdp.predict([first])[0][0])


def test_a_piece_of_the_past_or_of_other_trains_is_refused_and_nothing_is_taken():
    rng = np.random.default_rng(3)
    lists = noise(rng, 20, 1)
    stdp = STDP(threshold=5.0).partial_fit(SpikeTrains.from_lists(lists, start=0.0, stop=1000.0))
    weights = stdp.weights_.copy()
    with pytest.raises(taxel.ProblemError, match="the piece begins at 0 ms: must begin at 1000 ms or later"):
        stdp.partial_fit(SpikeTrains.from_lists(lists, start=0.0, stop=1000.0))
    with pytest.raises(taxel.ProblemError, match="the piece has 2 trains: must have 20"):
        stdp.partial_fit(SpikeTrains.from_lists([[], []], start=2000.0, stop=3000.0))
    assert np.array_equal(stdp.weights_, weights)


@pytest.mark.parametrize(("threshold", "fires"), [(4.74, True), (4.76, False)])
def test_it_fires_between_inputs_where_the_potential_peaks_above_the_threshold(threshold, fires):
    """Ten inputs at once: a peak of 10 x 0.475 = 4.75, ln(tau_m / tau_s) tau_m tau_s / (tau_m - tau_s) later."""
    neuron = STDP(threshold=threshold).fit([SpikeTrains.from_lists([[5.0]] * 10, stop=200.0)])
    assert len(neuron.spikes_) == fires
    if fires:
        after = neuron.spikes_[0] - 5.0
        assert 4.3 < after <= 4.621
        gained = 0.475 + neuron.a_plus * np.exp(-after / neuron.tau_plus)
        assert neuron.weights_ == pytest.approx(np.full(10, gained), abs=1e-12)
