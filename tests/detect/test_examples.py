"""What is known of an example and its score: a touch in its tare, and whether the score can be relied on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from touching import pressed

import taxel
from taxel import Detections, Tare
from taxel._base.messages import collected
from taxel.detect import Example, score
from taxel.detect.examples import array_of, unreliable
from taxel.recording.analysis.rest import touched


@given(st.integers(0, 1000), st.floats(0, 0.9))
def test_a_tare_that_ends_in_a_touch_holds_it(seed: int, share: float) -> None:
    frames, truth = pressed(seed, 5, begin_s=0.0)
    begin, end = (int(truth[label][0]) for label in ("contact", "lift"))
    until = int(begin + share * (end - begin))
    held = touched(frames, Tare.take(frames, stop_us=until))
    assert held == (4 if until - begin > 20_000 else held)
    assert touched(frames, Tare.take(frames, stop_us=begin - 20_000)) == 0


@pytest.mark.parametrize(
    ("missed", "false", "bad"), [(0, 0, False), (10, 5, False), (11, 0, True), (0, 19, False), (0, 20, True)]
)
def test_a_score_is_bad_that_misses_most_or_has_as_many_false_as_found(missed: int, false: int, bad: bool) -> None:
    truth = 1_000_000 * np.arange(1, 21)
    t = np.sort(np.concatenate([truth[missed:], 500_000 + 1_000_000 * np.arange(false)]))
    scored = score(Detections(["a"] * len(t), t, t), {"a": truth})
    assert (scored.missed, scored.false) == (missed, false)
    assert bool(unreliable("a", scored, "labels")) == bad


def test_two_feet_are_no_two_sensors_at_different_places() -> None:
    pattern = {"left": taxel.Array(2, 2, pitch_mm=5.0), "right": taxel.Array(2, 2, pitch_mm=6.0)}
    examples = [
        Example(taxel.Frames(np.zeros((2, 2, 2)), [0, 1000], array=array), {}, None, walk, f"{walk}{foot}")
        for walk in ("a ", "b ")
        for foot, array in pattern.items()
    ]
    with collected() as warned:
        array_of(examples)
    assert warned == []
    with collected() as warned:
        array_of([examples[0], examples[1]._replace(group="c ", name="c left")])
    assert len(warned) == 1
