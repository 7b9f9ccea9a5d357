"""Simulated touch: a ball on foam, and the emulated board that feels it.

A scene says what happens to the ball. `play` lets a board feel acts as fast as it goes,
`emulate` in real time over UDP.
"""

from taxel.simulate.acts import Act, Contact, Motion, Pictures, Scene, Silence
from taxel.simulate.board import EmulatorReport, Played, emulate, play, truth

__all__ = [
    "Act",
    "Contact",
    "EmulatorReport",
    "Motion",
    "Pictures",
    "Played",
    "Scene",
    "Silence",
    "emulate",
    "play",
    "truth",
]
