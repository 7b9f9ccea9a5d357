"""The SA-1 afferent against its filter as SciPy integrates it, and against what is known of the fibre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.encode import SA1

from .oracles import slow
from .scenes import of, smooth

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "SA-1": SA1(),
    "SA-1, every sample": SA1(period_ms=0.2, threshold=0.01, jump=0.02, refractory_ms=0.0),
}


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(seed=seeds, period=st.sampled_from([0.1, 0.25, 0.5, 1.0]))
def test_sa1_is_its_filter_under_its_threshold(seed, period):
    """In continuous time other spikes follow: where the potential turns beside the threshold, one may fire alone."""
    rng = np.random.default_rng(seed)
    t, x = smooth(rng, round(400 / period), period)
    encoder = SA1(
        onset=rng.uniform(0, 2), loss=rng.uniform(0, 1), onset_ms=rng.uniform(20, 400), jump=rng.uniform(0.05, 0.5)
    )
    encoder.period_ms = period
    spikes, sure = slow(encoder, t, x)
    found = of(encoder, t, x)
    assert found[found < sure] == pytest.approx(spikes)


def pressed(t, depth, ramp_ms=1625.0, hold_ms=12_500.0):
    """A ramp and a hold, ticks."""
    return np.interp(t, [100, 100 + ramp_ms, 100 + ramp_ms + hold_ms], [0, depth, depth]).astype(np.float32)


def rate(spikes, start, stop):
    """Spikes/s between two times in ms."""
    return 1000 * np.count_nonzero((spikes >= start) & (spikes < stop)) / (stop - start)


def test_a_held_pressure_is_told_for_as_long_and_38_percent_slower_after_12_s():
    """Burgess et al. 1983: 0.65 mm at 0.4 mm/s, so a ramp of 1.6 s; 21 fibres declined by 38 % in 12 s of holding."""
    t = np.arange(0, 14_500.0)
    spikes = of(SA1(), t, pressed(t, 65.0))
    first, last = rate(spikes, 1725, 2725), rate(spikes, 12_725, 13_725)
    assert 1 - last / first == pytest.approx(0.38, abs=0.03)
    assert len(spikes[spikes < 100]) == 0
