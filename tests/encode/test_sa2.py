"""The SA-2 afferent: SA-1's equations with its own numbers, steadier and less sensitive."""

import numpy as np
import pytest

from taxel.encode import SA1, SA2

from .test_sa1 import of, pressed, rate, slow, smooth

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {"SA-2": SA2(), "SA-2, faster": SA2(period_ms=0.5, threshold=0.1)}


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels."""
    return taxels


def test_sa2_is_its_filter_under_its_threshold():
    for seed in range(5):
        t, x = smooth(np.random.default_rng(seed), 800, 0.5)
        encoder = SA2(period_ms=0.5)
        spikes, sure = slow(encoder, t, x)
        found = of(encoder, t, x)
        assert found[found < sure] == pytest.approx(spikes)


def test_it_is_four_times_less_sensitive_and_steadier_than_sa1():
    t = np.arange(0, 4000.0)

    def least(encoder):
        found = next(d for d in np.arange(1, 60, 0.25) if len(of(encoder, t, pressed(t, d, 100.0))))
        return float(found)

    assert least(SA2()) / least(SA1()) > 4
    x = pressed(t, 100.0, 100.0)
    falls = []
    for encoder in (SA1(), SA2()):
        spikes = of(encoder, t, x)
        falls.append(rate(spikes, 3000, 4000) / rate(spikes, 200, 400))
    assert falls[1] > falls[0]
