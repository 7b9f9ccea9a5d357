"""STDP on walking: a made-up foot whose steps are known, thresholds by rate, strides and phases by hand."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import SpikeTrains
from taxel_studies import stdp_walk, unlabelled
from taxel_studies.gait.pieces import Piece

TAUS = {name: stdp_walk.PARAMETERS[name] for name in ("tau_m", "tau_s", "tau_plus", "tau_minus")}
TRAINS, STEPS = 60, 60


def foot(seed=1, jitter_ms=3.0, pattern=True):
    """Return a walk: at each step half of the trains fire in one order (or in any), and all of them now and then."""
    rng = np.random.default_rng(seed)
    contacts = 500.0 + np.cumsum(rng.normal(1100, 40, STEPS))
    stop = float(contacts[-1] + 1000)
    order = rng.uniform(0, 60, TRAINS // 2)
    times = []
    for train in range(TRAINS):
        mine = [rng.uniform(0, stop, rng.poisson(stop / 2000))]
        if train < TRAINS // 2:
            at = contacts if pattern else rng.uniform(0, stop, STEPS)
            mine.append(at + order[train] + rng.normal(0, jitter_ms, STEPS))
        times.append(np.sort(np.clip(np.concatenate(mine), 0, stop - 1)))
    spikes = SpikeTrains.from_lists(times, start=0.0, stop=stop)
    return Piece("made up", "made up", "nobody", "none", spikes, {"contact": contacts}, (0.0, stop))


def test_it_finds_the_steps_of_a_made_up_foot_without_labels():
    result = stdp_walk.train_and_test(foot(), stdp_walk.PARAMETERS)
    assert stdp_walk.finds_stride(result["learnt"])
    assert result["learnt"]["once"] > 0.9
    assert -10 < result["learnt"]["phase_ms"] < 80
    assert result["learnt"]["strides"] == pytest.approx(STEPS / 2, abs=2)
    assert 5 < result["strong"] <= TRAINS // 2


def test_where_nothing_repeats_there_is_nothing_to_find():
    for seed in range(3):
        result = stdp_walk.train_and_test(foot(seed, pattern=False), stdp_walk.PARAMETERS)
        assert not stdp_walk.finds_stride(result["learnt"])


@pytest.mark.parametrize("hz", [0.1, 1.0])
def test_a_threshold_is_the_least_at_which_a_neuron_fires_so_often(hz):
    spikes = foot(2).spikes
    level = unlabelled.threshold(spikes, hz, TAUS)
    fired = [
        1000 * len(unlabelled.unlearning(share * level, TAUS).partial_fit(spikes).spikes_) / spikes.stop
        for share in (1.0, 0.9)
    ]
    assert fired[0] <= hz < fired[1]


def test_spikes_are_told_by_stride_and_pauses_are_none():
    contacts = np.array([0.0, 1000.0, 2000.0, 5000.0, 6000.0, 7000.0])
    counts, phased, length = stdp_walk.phases(np.array([100.0, 1250.0, 1500.0, 3000.0, 6900.0]), contacts, 0.0, 8000.0)
    np.testing.assert_array_equal(counts, [1, 2, 0, 1])  # the pause from 2 to 5 s is no stride
    assert phased == [(100.0, 0.1), (1250.0, 0.25), (1500.0, 0.5), (6900.0, 0.9)]
    assert length == 1000.0


def test_spikes_just_before_contact_wander_as_little_as_those_just_after():
    piece = foot(3)
    contacts = piece.truth["contact"]
    for later in (-30.0, 30.0):
        result = stdp_walk.judged(contacts + later, piece, 0.0)
        assert result["phase_ms"] == pytest.approx(later, abs=2)
        assert result["wanders_ms"] < 5
