"""What no argument may be: each is refused by name, in one line, at once."""

from unittest.mock import ANY

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import Detections, Frames, SpikeTrains
from taxel._base import arguments
from taxel.calibration import Calibration
from taxel.detect import Recipe
from taxel.encode import LevelCrossing
from taxel.simulate import Faults, Flaws


def twisted() -> list[object]:
    """A list that holds itself twice: each level down is twice as long."""
    own: list[object] = [1.0]
    own += [own, own]
    return own


@pytest.mark.parametrize("value", ["a\ud800.mcap", "a\0b", "", b"here"])
def test_what_is_no_path_is_refused(value):
    with refused(argument="path"):
        taxel.open(value)


@pytest.mark.parametrize("rate", [5e-324, 1e-300, 1e-12, np.nan, np.inf, 0.0, -1.0])
def test_a_rate_without_whole_us_is_refused(tmp_path, rate):
    events = taxel.Events([0, 200], [0, 1], [0, 1], [True, False], array=taxel.Array(2, 2), intensity=[5, 6])
    taxel.convert(events, tmp_path / "two.npz")
    with refused(argument="rate_hz"):
        taxel.open(tmp_path / "two.npz").frames(rate)


FRAMES = Frames(np.ones((1, 1, 3)), [0], array=taxel.Array(1, 3, pitch_mm=1.0))
TABLE = Calibration.table(taxel.Array(1, 3), [10.0], [1.0], unit="N", reading_unit="counts")

NAN = {
    "Calibration.apply": lambda nan: TABLE.apply(Frames(np.ones((1, 1, 3)), [0], array=TABLE.array), rest=nan),
    "Calibration.apply, one taxel": lambda nan: TABLE.apply(
        Frames(np.ones((1, 1, 3)), [0], array=TABLE.array), rest=[[0.0, nan, 0.0]]
    ),
    "Frames.area": lambda nan: FRAMES.area(above=nan),
    "Recipe": lambda nan: Recipe(LevelCrossing([0.5]), {}, {}, run_threshold=nan),
    "Detections": lambda nan: Detections(["a", "b"], [1, 2], [2, 3], [0.5, nan]),
    "SpikeTrains": lambda nan: SpikeTrains([1.0], [0, 1], 0.0, 5.0, [nan]),
    "SpikeTrains.from_lists": lambda nan: SpikeTrains.from_lists([[1.0], [2.0]], values=[[1.0], [nan]]),
    **{
        f"Faults({name})": lambda nan, name=name: Faults(**{name: nan})
        for name in ("lost", "repeated", "reordered", "cut", "corrupted", "seed")
    },
    **{
        f"Flaws({name})": lambda nan, name=name: Flaws(**{name: nan})
        for name in ("gain", "threshold", "hysteresis", "drift", "dead", "stuck", "loose", "noise")
    },
}


@pytest.mark.parametrize("name", NAN)
def test_nan_is_refused_by_name(name):
    with refused(argument=ANY):
        NAN[name](float("nan"))


@pytest.mark.parametrize("wrong", ["soon", float("nan"), -1.0, float("inf")])
def test_arguments_that_a_call_does_not_need_are_checked_too(tmp_path, wrong):
    events = taxel.Events([0, 200], [0, 1], [0, 1], [True, False], array=taxel.Array(2, 2))
    taxel.convert(events, tmp_path / "two.npz")
    recording = taxel.open(tmp_path / "two.npz")
    for name in ("before_us", "after_us"):
        with refused(argument=name):
            taxel.cut(recording, **{name: wrong})
    example = taxel.detect.Example(SpikeTrains.from_lists([[10.0]], stop=90.0), {"a": [10_000]})
    recipe = Recipe(LevelCrossing([0.5]), {"tau": 5.0}, {"a": {"ub": 1.0}})
    for name in ("window_ms", "frame_us"):
        with refused(argument=name):
            taxel.detect.judge([example, example], recipe, 2, **{name: wrong})


def test_a_value_in_an_error_is_one_short_line():
    assert arguments.shown([0.0] * 10**7) == arguments.shown([0.0] * 100)
    assert arguments.shown([[0.0] * 10**7] * 3) == arguments.shown([[0.0] * 100] * 3)
    assert arguments.shown("a" * 10**8) == "'" + "a" * 56 + "..."
    assert len(arguments.shown(twisted())) <= 60
    assert arguments.shown("\ud800").encode()
    assert arguments.shown([1, "two", (3.0, None)]) == "[1, 'two', (3.0, None)]"
