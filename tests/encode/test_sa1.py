"""The SA-1 afferent against its filter as SciPy integrates it, and against what is known of the fibre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.encode import SA1

from . import oracles
from .scenes import frames_of

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "SA-1": SA1(),
    "SA-1, every sample": SA1(period_ms=0.2, threshold=0.01, jump=0.02, refractory_ms=0.0),
}


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels."""
    return taxels


def slow(encoder, t, x):
    """Spikes of a slowly adapting afferent by the oracle, ms, and how far they are sure."""
    e = encoder
    # (1 + onset) - onset / (1 + s onset_ms) - loss / (1 + s loss_ms), over 1 + s membrane_ms.
    recent, long, membrane = ([tau, 1.0] for tau in (e.onset_ms, e.loss_ms, e.membrane_ms))
    both = np.polymul(recent, long)
    top = (1 + e.onset) * both - e.onset * np.pad(long, (1, 0)) - e.loss * np.pad(recent, (1, 0))
    return oracles.afferent(t, x, [(top, both), ([1.0], membrane)], e, settled=1 - e.loss)


def smooth(rng, n, period):
    """A pressure that begins at 0 and wanders smoothly, some of it below 0, ms and ticks."""
    t = np.arange(n) * period
    waves = rng.uniform(0.5, 60, 4), rng.uniform(0, 2 * np.pi, 4), rng.uniform(5, 30, 4)
    x = 45 + sum(a * np.sin(2 * np.pi * f * t / 1000 + phase) for f, phase, a in zip(*waves, strict=True))
    return t, (x * np.minimum(t / 20, 1)).astype(np.float32)


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


def of(encoder, t, x):
    return encoder.encode(frames_of(np.rint(t * 1000).astype(int), np.asarray(x)[:, None]))[0]


def test_a_held_pressure_is_told_for_as_long_and_38_percent_slower_after_12_s():
    """Burgess et al. 1983: 0.65 mm at 0.4 mm/s, so a ramp of 1.6 s; 21 fibres declined by 38 % in 12 s of holding."""
    t = np.arange(0, 14_500.0)
    spikes = of(SA1(), t, pressed(t, 65.0))
    first, last = rate(spikes, 1725, 2725), rate(spikes, 12_725, 13_725)
    assert 1 - last / first == pytest.approx(0.38, abs=0.03)
    assert len(spikes[spikes < 100]) == 0
