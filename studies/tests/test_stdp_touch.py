"""STDP on touches: what belongs to a touch, by hand; trains against board events; a neuron trained on a few touches."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import SpikeTrains
from taxel_studies import stdp_touch
from taxel_studies.stdp_touch import Play


@pytest.fixture(scope="module")
def play():
    return stdp_touch.played({**stdp_touch.PARAMETERS, "touches": 12}, 3)


def test_a_spike_belongs_to_the_touch_before_it_for_a_while():
    contacts = np.array([100.0, 300.0, 500.0])
    times = np.array([50.0, 99.8, 130.0, 290.0, 305.0, 310.0])
    np.testing.assert_allclose(stdp_touch.latencies(times, contacts), [-0.2, 5.0, np.inf])
    nothing = SpikeTrains.from_lists([[]], stop=600.0)
    result = stdp_touch.judged(times, Play(nothing, contacts, np.array([True, False, False])), 0.0)
    assert result == {"same": 1.0, "other": 0.5, "latency_ms": 2.4, "beside": 2}
    late = stdp_touch.judged(times, Play(nothing, contacts, np.array([True, False, True])), 200.0)
    assert (late["same"], late["other"], late["latency_ms"]) == (0.0, 1.0, 5.0)


def test_trains_tell_of_touches_and_of_hardly_anything_else(play):
    assert len(play.contacts) == len(play.same) == 12
    assert 0 < play.same.sum() < 12
    assert len(play.spikes) == 2 * 4096
    since = play.spikes.times - play.contacts[np.maximum(np.searchsorted(play.contacts, play.spikes.times) - 1, 0)]
    within = (since > 0) & (since < stdp_touch.TOUCH_MS)
    assert within.mean() > 0.9
    rises = np.concatenate([play.spikes[k] for k in range(0, 8192, 2)])
    falls = np.concatenate([play.spikes[k] for k in range(1, 8192, 2)])

    def late(times):
        after = times - play.contacts[np.maximum(np.searchsorted(play.contacts, times) - 1, 0)]
        return np.median(after[(after > 0) & (after < stdp_touch.TOUCH_MS)])

    assert late(rises) < late(falls)  # what is pressed is let go


def test_the_touch_that_comes_again_is_felt_on_one_place(play):
    def middle(contact):
        x, y = [], []
        for taxel in np.flatnonzero(np.diff(play.spikes.offsets)[::2]):
            count = np.count_nonzero(np.abs(play.spikes[2 * taxel] - contact - 5) < 5)
            x += [taxel % 64] * count
            y += [taxel // 64] * count
        return np.array([np.median(x), np.median(y)])

    places = np.array([middle(contact) for contact in play.contacts])
    again, others = places[play.same], places[~play.same]
    assert np.ptp(again, axis=0).max() < 4 < np.ptp(others, axis=0).max()


def test_it_fires_at_touches_that_it_has_not_heard():
    result = stdp_touch.realise({**stdp_touch.PARAMETERS, "touches": 30}, 1)
    assert result["learnt"]["same"] >= 0.8
    assert result["learnt"]["beside"] == 0
    assert result["learnt"]["latency_ms"] < result["untrained"]["latency_ms"]
