"""Threshold and Izhikevich pair against plain forward Euler and the published latencies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.encode import ThresholdIzhikevich

from . import oracles
from .scenes import frames_of, spikes_of, wander

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "pair": ThresholdIzhikevich([50.0, 60.0]),
    "pair, 3.4.3": ThresholdIzhikevich([60.0], published="3.4.3", begin="rest", period_ms=0.25),
}


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels: by taxel and level."""
    return (taxels[:, None] * len(encoder.levels) + np.arange(len(encoder.levels))).ravel()


@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(
    seed=seeds,
    published=st.sampled_from(["3.4.3", "6.5.1"]),
    begin=st.sampled_from(["settled", "rest"]),
    levels=st.sampled_from([[60.0], [40.0, 55.0, 60.0, 70.0]]),
    spacing=st.sampled_from([100, 192, 2000, 3333]),
)
def test_izhikevich_pairs_are_plain_forward_euler(seed, published, begin, levels, spacing):
    rng = np.random.default_rng(seed)
    samples = 400_000 // spacing
    slow = np.repeat(wander(rng, 9, 3), samples // 9 + 1, axis=0)[:samples]
    t = 31 + np.arange(samples) * spacing
    encoder = ThresholdIzhikevich(levels, published=published, begin=begin)
    spikes = encoder.encode(frames_of(t, slow))
    wanted = oracles.threshold_izhikevich(t, slow, levels, int(spikes.stop * 1000), published, begin)
    assert spikes_of(spikes) == wanted


@pytest.mark.parametrize(("published", "latency"), [("3.4.3", 20.2), ("6.5.1", 15.8)])
def test_the_published_latencies_are_met(published, latency):
    encoder = ThresholdIzhikevich([0.4], published=published)
    t = np.arange(0, 900_000, 100)
    on = (t >= 50_000) & (t < 450_000)
    spikes = encoder.encode(frames_of(t, on[:, None]))
    assert encoder.latency_ms == latency
    assert spikes.times[0] == pytest.approx(50 + latency)
    # The OFF neuron received input until 50 ms; after enough time without, its latency is that of a settled one.
    assert spikes.times[1] == pytest.approx(450 + latency, abs=2.0)
    assert spikes.values.tolist() == [1, -1]


def test_an_idle_off_neuron_fires_once_only_if_it_begins_at_rest():
    frames = frames_of(np.arange(0, 200_000, 2000), np.zeros((100, 1)))
    assert len(ThresholdIzhikevich([0.4]).encode(frames).times) == 0
    for published, latency in (("3.4.3", 20.2), ("6.5.1", 15.8)):
        spikes = ThresholdIzhikevich([0.4], published=published, begin="rest").encode(frames)
        assert (spikes.times.tolist(), spikes.values.tolist()) == ([latency], [-1.0])


@pytest.mark.parametrize(("published", "too_short", "enough"), [("3.4.3", 10.0, 21.0), ("6.5.1", 5.0, 16.0)])
def test_an_input_that_goes_too_soon_makes_no_spike(published, too_short, enough):
    encoder = ThresholdIzhikevich([0.4], published=published)
    t = np.arange(0, 400_000, 100)
    for length, spikes in ((too_short, 0), (enough, 1)):
        on = (t >= 50_000) & (t < 50_000 + 1000 * length)
        assert len(encoder.encode(frames_of(t, on[:, None])).split_by_sign()[0]) == spikes


@pytest.mark.parametrize(("published", "latency"), [("3.4.3", 34.0), ("6.5.1", 51.0)])
def test_a_spike_after_a_short_gap_comes_late(published, latency):
    t = np.arange(0, 700_000, 100)
    on = (t >= 50_000) & ~((t >= 450_000) & (t < 470_000))
    spikes = ThresholdIzhikevich([0.4], published=published).encode(frames_of(t, on[:, None])).split_by_sign()
    assert spikes[0][1] - 470 == pytest.approx(latency, abs=3.0)
