"""The FA-2 afferent against its filter as SciPy integrates it, and against what is known of the fibre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel import Array
from taxel.encode import FA2

from . import oracles
from .scenes import of, smooth

REPAIRED = "silent"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "FA-2": FA2(),
    "FA-2 of coarse samples": FA2(period_ms=0.5, corner_ms=3.0, refractory_ms=0.0),
}


@settings(max_examples=2 * settings.default.max_examples, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), period=st.sampled_from([0.05, 0.1, 0.2]))
def test_fa2_is_its_filter_under_its_threshold(seed, period):
    rng = np.random.default_rng(seed)
    t, x = smooth(rng, round(100 / period), period)
    x = x + (8 * np.minimum(t / 20, 1) * np.sin(2 * np.pi * 0.15 * t)).astype(np.float32)
    e = FA2(period_ms=period, corner_ms=rng.uniform(0.5, 2), jump=rng.uniform(0.002, 0.02))
    high = [e.corner_ms, 0.0], [e.corner_ms, 1.0]
    spikes, sure = oracles.afferent(t, x, [high, high, ([1.0], [e.membrane_ms, 1.0])], e, settled=0.0)
    found = of(e, t, x)
    assert len(found)
    assert found[found < sure] == pytest.approx(spikes)


def test_periods_in_which_it_feels_nothing_are_refused():
    with refused(argument="period_ms"):
        FA2(period_ms=2.0).stream(Array(1, 1))
