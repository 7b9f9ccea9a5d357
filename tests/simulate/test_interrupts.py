"""Long calls of the room simulate end soon after Ctrl-C, and calls that would never end are refused."""

import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel.simulate import Scene, Silence, truth
from taxel.simulate.circuit import Converter

#: Calls that each take 10 s or more, by what they do; the child process reports when a call is about to begin.
LONG = {
    "a scene in the shortest steps": """
        scene = Scene.draw(1)
        body = scene.parameters["bodies"][0]
        bodies = [{**body, "x_mm": 30.0 + 50.0 * i, "y_mm": 30.0 + 50.0 * j} for i in range(3) for j in range(3)]
        scene = scene.replace(lead_ms=10_000.0, bodies=bodies)
        begun()
        scene.motion(step_us=1.0)
    """,
    "the law of a body on many cells": """
        press = {"pressed": {"peak_n": 5.0, "speed_mm_s": 50.0, "hold_ms": 5.0, "wait_ms": 0.0}}
        body = {"shape": {"sphere": {"radius_mm": 60.0}}, "x_mm": 80.0, "y_mm": 80.0, "mass_g": 50.0, "motion": press}
        scene = Scene({"bodies": [body], "cells_per_pitch": 16})
        begun()
        scene.motion()
    """,
    "frames on many cells": """
        press = {"pressed": {"depth_mm": 3.0, "speed_mm_s": 1.0, "hold_ms": 60_000.0, "wait_ms": 0.0}}
        body = {"shape": {"sphere": {"radius_mm": 60.0}}, "x_mm": 80.0, "y_mm": 80.0, "mass_g": 50.0, "motion": press}
        scene = Scene({"bodies": [body], "cells_per_pitch": 4})
        begun()
        play([scene], seed=1)
    """,
    "a layer of many cells": """
        begun()
        while True:
            Layer(cells_per_pitch=16)
    """,
    "pressures on many cells": """
        layer = Layer(cells_per_pitch=16, tolerance=1e-15)
        sunk = np.random.default_rng(1).uniform(0.0, 5.0, layer.cells_mm.shape[1:])
        begun()
        while True:
            layer.press(sunk)
    """,
    "a day of silence": "begun(); play([Silence(86_400_000.0)], seed=1)",
}

CHILD = """

import numpy as np
from taxel.simulate import Layer, Scene, Silence, play

def begun():
    print("begun", flush=True)

try:
{call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_long_call(name: str) -> None:
    code = CHILD.format(call=textwrap.indent(textwrap.dedent(LONG[name]), "    "))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        try:
            assert child.stdout.readline() == "begun\n"
            with pytest.raises(subprocess.TimeoutExpired):
                child.wait(0.7)  # still in the call
            child.send_signal(signal.SIGINT)
            # Half a second on a quiet machine; a call that never checks would continue for minutes.
            assert child.wait(60) == 0
            assert child.stdout.read() == "interrupted\n"
        finally:
            child.kill()


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
