"""The search of figure 6.7: one solve a realisation finds what the published rule finds."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel_studies.capacity import feasible, largest, realise


@given(step=st.integers(1, 7), start=st.integers(1, 60), capacity=st.integers(0, 300), most=st.integers(0, 60))
def test_the_search_finds_the_largest_load_that_holds(step, start, capacity, most):
    asked = []

    def holds(count: int) -> bool:
        asked.append(count)
        return count <= capacity

    assert largest(holds, start * step, step) == capacity // step * step
    assert all(count > 0 and count % step == 0 for count in asked)
    asked.clear()
    assert largest(holds, most * step, step, most * step) == min(capacity, most * step) // step * step
    assert max(asked, default=0) <= most * step
    assert len(set(asked)) == len(asked), "no load is solved twice"


PARAMS = {"inputs": 24, "classes": 3, "time": "grid", "after_spike": "keep", "margin": 1e-3, "slope": 1e-3}


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_the_published_rule_taken_literally_gives_the_same(time):
    """Start at 0.2 N; up while all realisations are feasible, down if not."""
    params = PARAMS | {"time": time, "inputs": 60, "realisations": 5}

    def all_feasible(count: int) -> bool:
        return all(feasible(params, count, seed) for seed in range(5))

    count = 12
    if all_feasible(count):
        while all_feasible(count + 3):
            count += 3
    else:
        while count > 0 and not all_feasible(count):
            count -= 3
    found = realise(params, 0)
    assert found["p"] == count
    assert found["load"] == count / 60
    assert found["limits"][-1][1] == count
