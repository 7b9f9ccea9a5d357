"""The SA-2 afferent: SA-1's equations with its own numbers, steadier and less sensitive."""

import numpy as np
import pytest

from taxel.encode import SA2

from .oracles import slow
from .scenes import of, smooth

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {"SA-2": SA2(), "SA-2, faster": SA2(period_ms=0.5, threshold=0.1)}


def test_sa2_is_its_filter_under_its_threshold():
    for seed in range(5):
        t, x = smooth(np.random.default_rng(seed), 800, 0.5)
        encoder = SA2(period_ms=0.5)
        spikes, sure = slow(encoder, t, x)
        found = of(encoder, t, x)
        assert found[found < sure] == pytest.approx(spikes)
