"""Ours and peers are measured in turn, by one clock, BLAS in one thread; a ratio is that of the rounds."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from taxel_benchmarks import _rounds


class Clock:
    """A clock that calls move on, and what was called."""

    def __init__(self) -> None:
        self.now, self.called = 0.0, ""

    def run(self, name: str, *seconds: float) -> Callable[[], None]:
        """Return a run that takes these seconds, call by call, again and again."""
        left: list[float] = []

        def call() -> None:
            left[:] = left or seconds
            self.now += left.pop(0)
            self.called += name

        return call


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    one = Clock()
    times = SimpleNamespace(process_time=lambda: one.now, perf_counter=lambda: 2 * one.now)
    monkeypatch.setattr(_rounds, "time", times)
    return one


def test_each_runs_once_to_warm_up_and_then_all_in_turn(clock: Clock) -> None:
    runs = {"a": clock.run("a", 9.0, 1.0, 2.0, 4.0), "b": clock.run("b", 5.0)}
    found = _rounds.measure(runs, rounds=3, work=6.0)
    assert clock.called == "abababab"
    assert found["a"]["cpu_s"] == {"median": 2.0, "quartiles": [1.5, 3.0], "rounds": [1.0, 2.0, 4.0]}
    assert (found["a"]["wall_s"]["median"], found["a"]["rate"], found["a"]["stable"]) == (4.0, 3.0, False)
    assert found["b"]["stable"]
    _rounds.measure(runs, rounds=1, warm_up=False)
    assert clock.called == "abababab" + "ab"


def test_a_ratio_is_the_median_of_those_of_the_rounds(clock: Clock) -> None:
    """A machine that is three times slower in some rounds leaves it; so does work that differs."""
    runs = {"ours": clock.run("o", 1.0, 1.0, 3.0), "peer": clock.run("p", 1.0, 4.0, 3.0, 2.0)}
    found = _rounds.measure(runs, rounds=3)
    # Rounds: ours 1, 3, 1, the peer 4, 3, 2.
    assert found["ours"]["cpu_s"]["rounds"] == [1.0, 3.0, 1.0]
    ratios, spread = _rounds.compared(found, {"much": ("ours", "peer")})
    assert ratios == {"much": 2.0}
    assert spread == {"much": [1.5, 3.0]}
    found["ours"]["rate"] *= 10
    assert _rounds.compared(found, {"much": ("ours", "peer")})[0] == {"much": 20.0}


def test_blas_has_one_thread() -> None:
    counts: list[int] = []

    def call() -> None:
        np.ones((8, 8)) @ np.ones((8, 8))
        counts.extend(one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas")

    with threadpool_limits(2):
        call()
        assert 2 in counts
        counts.clear()
        _rounds.measure({"one": call}, rounds=2)
    assert counts
    assert set(counts) == {1}


def test_a_pair_with_a_peer_that_is_left_out_is_not_compared(clock: Clock) -> None:
    runs = {"ours": clock.run("o", 1.0), "there": clock.run("t", 2.0)}
    pairs = {"there": ("ours", "there"), "absent": ("ours", "absent")}
    found = _rounds.measured(runs, pairs, rounds=2)
    assert found["ratios"] == {"there": 2.0}
    assert found["spread"] == {"there": [2.0, 2.0]}
    assert found["stable"]
