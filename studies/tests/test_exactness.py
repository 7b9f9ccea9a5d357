"""The study of exactness: which spikes count as those of a target, and that exact fits are exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel_studies import exactness, load


@given(
    st.lists(st.floats(0, 1000), min_size=1, max_size=8, unique=True).map(sorted),
    st.floats(0, 0.5),
    st.floats(0.01, 1.0),
)
def test_spikes_moved_by_so_much_are_within_a_step_only_where_that_is_one(targets, moved, step) -> None:
    result = exactness._beside(np.array(targets) + moved, np.array(targets), step)
    assert result["right_count"]
    assert result["worst_ms"] == pytest.approx(moved, abs=1e-9)
    assert result["within_a_step"] == (result["worst_ms"] <= step + 1e-9)


def test_a_lost_spike_is_counted_and_is_within_no_step() -> None:
    result = exactness._beside(np.array([10.0]), np.array([10.0, 20.0]), 1.0)
    assert result == {"right_count": False, "lost": 1, "worst_ms": None, "within_a_step": False}


def test_what_was_solved_runs_exactly_without_a_clock() -> None:
    tasks = exactness.tasks(load("exactness").set("toy"))
    found = [exactness.realise(t.params, t.seed) for t in tasks if t.params["kind"] == "steps"][:4]
    solved = [one for one in found if one["status"] == "solved"]
    assert solved
    assert all(one["exact"]["worst_ms"] < 1e-6 for one in solved)
