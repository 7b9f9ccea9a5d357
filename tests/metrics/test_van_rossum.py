"""Van Rossum distances: closed forms against quadrature and elephant, a metric's axioms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing import STOP, pieces, smoothed, times
from hypothesis import given
from hypothesis import strategies as st

from taxel.metrics import van_rossum

taus = st.floats(0.01, 1000)


@pytest.mark.parametrize("tau", [0.5, 7.0, 300.0])
def test_it_is_the_integral_that_quadrature_gives(tau):
    random = np.random.default_rng(3)
    for n, m in ((0, 1), (5, 0), (6, 9), (20, 20)):
        a, b = np.sort(random.uniform(0, 100, n)), np.sort(random.uniform(0, 100, m))
        t, w = pieces(a, b, tau)
        square = ((smoothed(a, t, tau) - smoothed(b, t, tau)) ** 2 * w).sum()
        assert van_rossum(a, b, tau=tau, normalisation="none") == pytest.approx(math.sqrt(square), rel=1e-9)
        assert van_rossum(a, b, tau=tau, normalisation="tau") == pytest.approx(math.sqrt(square / tau), rel=1e-9)
        assert van_rossum(a, b, tau=tau) == pytest.approx(math.sqrt(2 * square / tau), rel=1e-9)


@given(a=times, b=times, tau=taus)
def test_elephant_has_the_same_value_but_for_its_cancellation(a, b, tau):
    neo, elephant = pytest.importorskip("neo"), pytest.importorskip("elephant.spike_train_dissimilarity")
    import quantities as pq

    trains = [neo.SpikeTrain(t, units="ms", t_start=0, t_stop=STOP) for t in (a, b)]
    with np.errstate(all="ignore"), pytest.MonkeyPatch.context() as patch:
        patch.setattr(elephant.warnings, "warn", lambda *_, **__: None)
        theirs = elephant.van_rossum_distance(trains, tau * pq.ms)[0, 1]
    # Theirs is the root of a difference of sums: as far off as the root of a rounding.
    assert van_rossum(a, b, tau=tau) == pytest.approx(float(theirs), abs=1e-5)


def test_near_trains_lose_no_digits():
    # A move by dt is nearly sqrt(2 dt / tau), far below the root of a rounding of the sums.
    a = np.arange(1.0, 200.0)
    b = a.copy()
    b[100] += 1e-12
    moved = b[100] - a[100]
    assert van_rossum(a, b, tau=10.0) == pytest.approx(math.sqrt(2 * moved / 10.0), rel=1e-6)
