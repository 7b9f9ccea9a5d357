"""A readout and a plain rule hold the unit of the values that they were trained on, and refuse values in another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel import Array, Events, Frames, Readout, Tare
from taxel.detect import Example, PlainRule, Recipe, fit, judge, run, tune
from taxel.encode import LevelCrossing

#: As recordings name units; ticks are those of a board's events.
UNITS = st.sampled_from(["ticks", "counts", "as sent", "N", "mN", "kPa", "Pa", "N/cm2"])
ARRAY = Array(2, 2)
RECIPE = Recipe(LevelCrossing([5.0]), {"tau": 2.0, "ub": 2.0, "delay_ms": 1.0})


def pressed(unit: str) -> Frames:
    """Two taxels are pressed for 0.1 s, each half a second."""
    t = np.arange(200)
    values = np.zeros((200, 2, 2))
    values[t % 50 >= 40, 0] = 9.0
    return Frames(values, 10_000 * t, unit=unit, array=ARRAY)


def example(unit: str) -> Example:
    frames = pressed(unit)
    return Example(frames, {"contact": [400_000, 900_000, 1_400_000, 1_900_000]}, Tare.take(frames, stop_us=300_000))


def events() -> Events:
    return Events([0, 1000], [0, 1], [0, 0], [True, True], array=ARRAY, intensity=[9, 9])


def both(unit: str) -> list[Readout | PlainRule]:
    rule = tune([example(unit)], ["contact"])["contact"]
    assert rule is not None
    return [fit([example(unit)], RECIPE), rule]


@settings(max_examples=settings.default.max_examples // 4)
@given(UNITS, UNITS)
def test_values_in_another_unit_are_refused_by_a_file_too(own: str, other: str) -> None:
    tare = example(own).tare
    for made in both(own):
        again = type(made).from_json(made.to_json())
        assert (again.unit, again) == (own, made)
        if other == own:
            assert len(run(again, pressed(other), tare=tare))
            continue
        with refused():
            run(again, pressed(other), tare=tare)
        with refused():
            again.stream(tare=tare).push(pressed(other))


@pytest.mark.parametrize("does", [lambda x: fit(x, RECIPE), lambda x: judge(x, RECIPE, 2), tune])
def test_recordings_in_different_units_are_not_trained_on_together(does) -> None:
    with refused():
        does([example("kPa"), example("N")])
