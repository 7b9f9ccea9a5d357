"""Simulated touch: bodies on foam, and the emulated board that reads them.

A scene describes the motion of bodies. `play` plays acts to a board as fast as possible. `emulate` sends UDP in real
time: acts, a recording, or the frames of another sensor. `Board` is the board alone, one frame at a time.
`taxel.simulate.circuit` simulates what is between touch and board: fabric, lines, converter.
"""

from taxel.simulate import circuit
from taxel.simulate.acts import Act, Contact, FrameSequence, Motion, Scene, Silence, Track
from taxel.simulate.board import NOT_RETURNED, Board, Version2, pattern
from taxel.simulate.emulator import Played, emulate, play, truth
from taxel.simulate.emulator_report import EmulatorReport
from taxel.simulate.layer import Layer, Pressed
from taxel.simulate.replay import Replay
from taxel.simulate.scene_file import SceneFile
from taxel.simulate.trouble import Faults, Flaws

__all__ = [
    "NOT_RETURNED",
    "Act",
    "Board",
    "Contact",
    "EmulatorReport",
    "Faults",
    "Flaws",
    "FrameSequence",
    "Layer",
    "Motion",
    "Played",
    "Pressed",
    "Replay",
    "Scene",
    "SceneFile",
    "Silence",
    "Track",
    "Version2",
    "circuit",
    "emulate",
    "pattern",
    "play",
    "truth",
]
