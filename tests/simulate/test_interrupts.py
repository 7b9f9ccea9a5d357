"""Long calls of the room simulate end soon after Ctrl-C, and calls that would never end are refused."""

from collections.abc import Callable

import numpy as np
import pytest
from interrupts import ctrl_c_after
from refusal import refused

import taxel
from taxel.simulate import Layer, Scene, Silence, play, truth
from taxel.simulate.circuit import Converter


def body(x_mm: float, y_mm: float, motion: dict[str, float]) -> dict[str, object]:
    """A large ball that is pressed into the foam."""
    ball = {"sphere": {"radius_mm": 60.0}}
    return {
        "shape": ball,
        "x_mm": x_mm,
        "y_mm": y_mm,
        "mass_g": 50.0,
        "motion": {"pressed": {"wait_ms": 0.0, **motion}},
    }


def steps() -> None:
    scene = Scene.draw(1)
    first = scene.parameters["bodies"][0]
    bodies = [{**first, "x_mm": 30.0 + 50.0 * i, "y_mm": 30.0 + 50.0 * j} for i in range(3) for j in range(3)]
    scene.replace(lead_ms=10_000.0, bodies=bodies).motion(step_us=1.0)


def law() -> None:
    pressed = body(80.0, 80.0, {"peak_n": 5.0, "speed_mm_s": 50.0, "hold_ms": 5.0})
    while True:
        Scene({"bodies": [pressed], "cells_per_pitch": 16}).motion()


def frames() -> None:
    pressed = body(80.0, 80.0, {"depth_mm": 3.0, "speed_mm_s": 1.0, "hold_ms": 60_000.0})
    play([Scene({"bodies": [pressed], "cells_per_pitch": 4})], seed=1)


def layers() -> None:
    while True:
        Layer(cells_per_pitch=16)


def silence() -> None:
    play([Silence(86_400_000.0)], seed=1)


@pytest.mark.parametrize("call", [steps, law, frames, layers, silence])
def test_ctrl_c_ends_a_long_call(call: Callable[[], None]) -> None:
    # Half a second on a quiet machine; a call that never checks would continue for minutes.
    with ctrl_c_after(0.3, answered_within=5):
        call()


@pytest.mark.parametrize("step_us", [5e-324, 1e-300, 1e-3, 0.0, np.nan, np.inf, 1000.1])
def test_a_step_of_a_scene_that_would_not_end_is_refused(step_us: float) -> None:
    with pytest.raises(taxel.Error):
        Scene.draw(1).motion(step_us=step_us)


@pytest.mark.parametrize(
    ("arguments", "argument"),
    [
        ({"every_us": np.inf}, "every_us"),
        ({"every_us": 5e-324}, "every_us"),
        ({"every_us": 1e300, "stop_us": 1e305}, "stop_us"),
        ({"every_us": 1.0, "stop_us": np.inf}, "every_us"),
        ({"every_us": np.inf, "stop_us": np.inf}, "every_us"),
        ({"stop_us": -1.0}, "stop_us"),
    ],
)
def test_a_trace_that_would_not_end_is_refused(arguments: dict[str, float], argument: str) -> None:
    with refused(argument=argument):
        Converter().trace([1.4, 1.5, 2.0, 2.5], **arguments)


def test_more_forces_than_memory_holds_are_refused() -> None:
    """A day on one taxel, scanned in 3 us: 3e10 frames."""
    with refused(taxel.SceneError):
        truth([Silence(86_400_000.0)] * 10)
