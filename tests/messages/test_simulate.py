"""What scenes, their files and the emulated board say that is wrong in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from refusal import messages

from taxel import Array
from taxel.simulate import Board, Flaws, FrameSequence, Layer, Scene, SceneFile, Silence, play, truth
from taxel.simulate.circuit import AdaptiveRamp, Circuit, Converter, Divider, VirtualGround
from taxel.wire import Registers

VERSION_2 = Registers(wire_version=2)
BALL = """
seed = 5
[[bodies]]
shape.sphere.radius_mm = 15
x_mm = 70
y_mm = 90
mass_g = 30
motion.dropped = { height_mm = 60, ending.left_to_rest = { rest_ms = 180, lift_mm_s = 100 } }
"""
#: What is changed in the file of a scene.
CHANGES = {
    "off the array": ("x_mm = 70", "x_mm = 700"),
    "mass": ("mass_g = 30", "mass_g = -30"),
    "no mass": ("mass_g = 30", ""),
    "material": ("mass_g = 30", 'material = "cheese"'),
    "mass and material": ("mass_g = 30", 'mass_g = 30\nmaterial = "steel"'),
    "too heavy": ("mass_g = 30", "mass_g = 1e6"),
    "lifted too early": ("rest_ms = 180", "rest_ms = 90"),
    "rolls off": (BALL.splitlines()[-1], "motion.rolled = { speed_mm_s = 300, for_ms = 900 }"),
    "two shapes": ("x_mm = 70", "x_mm = 70\nshape.edge.slope_deg = 30"),
    "misspelt": ("radius_mm", "radus_mm"),
    "motion": ("motion.dropped", "motion.thrown"),
    "seed": ("seed = 5", "seed = 1.5"),
    "preset": ("seed = 5", 'preset = "9 kHz"'),
    "preset of another array": ("seed = 5", 'preset = "128 x 128, 1 kHz"'),
    "foam": ("seed = 5", "foam.modulus_kpa = -1"),
    "soft foam": ("seed = 5", "foam.modulus_kpa = 1e300"),
    "taxels": ("seed = 5", "taxels.exponent = 3"),
    "rows": ("seed = 5", "array.rows = 0"),
    "tare": ("seed = 5", "tare_ms = -50"),
    "no table": ("seed = 5", "array = 3"),
    "one body": ("[[bodies]]", "[bodies]"),
    "no TOML": ("seed = 5", "seed = "),
    "empty": (BALL, ""),
    "no height map": ("shape.sphere.radius_mm = 15", 'shape.height_map = { file = "sole.csv", cell_mm = 1 }'),
}


def opened(change: tuple[str, str]) -> Callable[[Path], object]:
    """Return the call that opens a file of a changed scene."""

    def call(folder: Path) -> object:
        assert change[0] in BALL
        file = folder / "scene.toml"
        file.write_text(BALL.replace(*change))
        return SceneFile.open(file)

    return call


CALLS = {
    **{f"file, {name}": opened(change) for name, change in CHANGES.items()},
    "pitch unknown": lambda _: Scene.draw(0, array=Array(8, 8)),
    "too small": lambda _: Scene.draw(1, array=Array(8, 8, 2.67)),
    "no bodies": lambda _: Scene({}).motion(),
    "part of a scene": lambda _: Scene.draw(1).replace(colour="red"),
    "body": lambda _: Scene.draw(1).body(1, x_mm=5.0),
    "step": lambda _: Scene.draw(1).motion(0),
    "shares of the ramp": lambda _: FrameSequence(np.full((1, 2, 2), 1.5), 2000),
    "frames too fast": lambda _: truth([FrameSequence(np.zeros((1, 64, 64)), 10.0)]),
    "frames of another array": lambda _: truth([FrameSequence(np.zeros((1, 8, 8)), 2000)]),
    "silence": lambda _: truth([Silence(-1.0)]),
    "act": lambda _: truth(["silence"]),
    "too few frames": lambda _: play([Silence(10.0)], seed=1),
    "sensor": lambda _: play([Silence(100.0)], seed=1, sensor={"exponent": 2.0}),
    "flaw": lambda _: Flaws(dead=2.0),
    "adaptive ramp": lambda _: AdaptiveRamp(steepest=600),
    "conductance": lambda _: VirtualGround().volts([[1.0, -2.0]]),
    "no line": lambda _: Divider().volts(np.zeros((2, 0))),
    "step of a ramp": lambda _: Converter(ramp=200),
    "voltage": lambda _: Converter().ticks([[np.nan]]),
    "readout of a board": lambda _: Circuit(readout=Divider()),
    "asynchronous, version": lambda _: Board(asynchronous=True),
    "asynchronous, receptor": lambda _: Board(VERSION_2.replace(mechanoreceptor=True), asynchronous=True),
    "asynchronous, circuit": lambda _: Board(VERSION_2, circuit=Circuit(), asynchronous=True),
    "layer": lambda _: Layer({"colour": 1.0}),
    "indentation": lambda _: Layer().press(np.zeros((3, 3))),
    "ramp": lambda _: Converter(ramp=0),
}


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
