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
