"""Multi-unit Victor-Purpura: the matching of least cost against scipy's, its limits, a metric's axioms."""

from __future__ import annotations

import numpy as np
import pytest
from drawing import pattern, patterns
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused
from scipy.optimize import linear_sum_assignment

from taxel import SpikeTrains
from taxel.metrics import victor_purpura, victor_purpura_multi_unit

costs = st.just(0.0) | st.floats(1e-3, 5)
relabelling = st.just(0.0) | st.floats(0, 3)


def assigned(a, b, q, k):
    """The least cost by scipy: every spike against every other, and against nothing."""
    (s, x), (t, y) = a.to_numpy(), b.to_numpy()
    cost = np.ones((len(s) + len(t),) * 2)
    cost[: len(s), : len(t)] = q * np.abs(s[:, None] - t) + k * (x[:, None] != y)
    cost[len(s) :, len(t) :] = 0.0
    return cost[linear_sum_assignment(cost)].sum()


@given(a=patterns(3), b=patterns(3), q=costs, k=relabelling)
def test_scipy_finds_no_cheaper_matching(a, b, q, k):
    assert victor_purpura_multi_unit(a, b, q=q, k=k) == pytest.approx(assigned(a, b, q, k), abs=1e-9)


@pytest.mark.parametrize(("q", "k"), [(0.02, 0.3), (0.1, 1.0), (0.005, 0.05), (1.0, 0.5)])
def test_nor_does_it_among_hundreds_of_spikes_that_compete(q, k):
    random = np.random.default_rng(5)
    for _ in range(5):
        a, b = pattern(random, 10, 30.0, 200.0), pattern(random, 10, 33.0, 200.0)
        assert victor_purpura_multi_unit(a, b, q=q, k=k) == pytest.approx(assigned(a, b, q, k), abs=1e-9)


@given(a=patterns(4), b=patterns(4), q=costs)
def test_free_relabelling_pools_the_trains_and_dear_relabelling_keeps_them_apart(a, b, q):
    pooled = victor_purpura(np.sort(a.times), np.sort(b.times), q=q)
    assert victor_purpura_multi_unit(a, b, q=q, k=0.0) == pytest.approx(pooled, abs=1e-9)
    apart = sum(victor_purpura(x, y, q=q) for x, y in zip(a, b, strict=True))
    for k in (2.0, 7.5, np.inf):
        assert victor_purpura_multi_unit(a, b, q=q, k=k) == pytest.approx(apart, abs=1e-9)
    assert victor_purpura(a, b, q=q) == pytest.approx(apart, abs=1e-9)


@given(a=patterns(2), b=patterns(2), k=relabelling)
def test_at_infinite_q_only_spikes_at_the_same_time_match(a, b, k):
    assert victor_purpura_multi_unit(a, b, q=np.inf, k=k) == pytest.approx(assigned(a, b, 1e12, k), abs=1e-6)


@given(a=patterns(3), b=patterns(3), c=patterns(3), q=st.floats(1e-3, 5), k=st.floats(1e-3, 3))
def test_it_is_a_metric(a, b, c, q, k):
    ab, bc, ac = (victor_purpura_multi_unit(x, y, q=q, k=k) for x, y in ((a, b), (b, c), (a, c)))
    assert victor_purpura_multi_unit(a, a, q=q, k=k) == 0
    assert victor_purpura_multi_unit(b, a, q=q, k=k) == pytest.approx(ab, abs=1e-9)
    assert ac <= ab + bc + 1e-9
    if a == b:
        assert ab == 0
    elif ab == 0:  # times that differ by less than q can say
        assert a.times == pytest.approx(b.times, abs=1e-9 / q)


def test_arguments_that_make_no_sense_are_one_clear_error_each():
    a, b = SpikeTrains.from_lists([[1.0], []]), SpikeTrains.from_lists([[1.0]])
    for parameters, argument in (
        ({"a": a, "b": b, "q": 1.0, "k": 1.0}, None),
        ({"a": a, "b": a, "q": -1.0, "k": 1.0}, "q"),
        ({"a": a, "b": a, "q": 1.0, "k": float("nan")}, "k"),
        ({"a": [1.0], "b": a, "q": 1.0, "k": 1.0}, "a"),
    ):
        with refused(argument=argument):
            victor_purpura_multi_unit(**parameters)
