"""Victor-Purpura distance: the cost of each step, a metric's axioms, and elephant's value."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.metrics import victor_purpura

times = st.lists(st.floats(0, 500, allow_nan=False), max_size=12).map(sorted)
# Elephant takes the least subnormal cost for infinite.
costs = st.just(0.0) | st.floats(1e-9, 5)


@pytest.mark.parametrize(
    ("a", "b", "q", "expected"),
    [
        ([], [], 1.0, 0.0),
        ([5.0], [], 1.0, 1.0),
        ([], [1.0, 2.0], 0.3, 2.0),
        ([10.0], [13.0], 0.1, 0.3),
        ([10.0], [40.0], 0.1, 2.0),
        ([10.0, 20.0, 30.0], [12.0, 24.0, 30.0], 0.1, 0.6),
        ([1.0, 2.0], [5.0, 6.0, 7.0], 0.0, 1.0),
        ([1.0, 2.0, 2.0], [2.0, 2.0, 9.0], np.inf, 2.0),
    ],
)
def test_adding_and_removing_cost_1_and_moving_costs_q_a_ms(a, b, q, expected):
    assert victor_purpura(a, b, q=q) == pytest.approx(expected, abs=1e-12)


@given(a=times, b=times, q=costs)
@settings(deadline=None)
def test_elephant_has_the_same_value(a, b, q):
    neo, elephant = pytest.importorskip("neo"), pytest.importorskip("elephant.spike_train_dissimilarity")
    import quantities as pq

    trains = [neo.SpikeTrain(t, units="ms", t_start=0, t_stop=500) for t in (a, b)]
    theirs = elephant.victor_purpura_distance(trains, cost_factor=q / pq.ms)[0, 1]
    assert victor_purpura(a, b, q=q) == pytest.approx(float(theirs), abs=1e-9)


@given(a=times, b=times, c=times, q=costs)
def test_it_is_a_metric(a, b, c, q):
    ab, bc, ac = victor_purpura(a, b, q=q), victor_purpura(b, c, q=q), victor_purpura(a, c, q=q)
    assert victor_purpura(a, a, q=q) == 0
    assert ab == pytest.approx(victor_purpura(b, a, q=q), abs=1e-9)
    assert ac <= ab + bc + 1e-9
    assert 0 <= ab <= len(a) + len(b)
    if q > 0 and ab < 1e-12:
        assert a == pytest.approx(b, abs=1e-9 / q)
