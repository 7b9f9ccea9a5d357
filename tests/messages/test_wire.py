"""What the board's bytes, registers and commands say that they are wrong in."""

from typing import Any

import numpy as np
from refusal import messages

import taxel
from taxel import wire
from taxel.simulate import Board
from taxel.wire import Command, Registers

#: Registers of which each breaks a rule of the board.
BROKEN: dict[str, dict[str, Any]] = {
    "rule 1, line": {"line_read": 3.2},
    "rule 1, step": {"step_read": 0.8},
    "rule 2": {"col_change_period": 76},
    "rule 3": {"ramp": 161},
    "rule 4, bits": {"line_period": 1e9},
    "rule 4, columns": {"array": taxel.Array(64, 8), "lines": 64},
    "rule 4, lines": {"lines": 257},
    "rule 4, noise floor": {"noise_floor": 256},
    "rule 4, ramp": {"ramp": 0},
    "rule 4, step": {"step_read": 0.03, "ramp": 8},
    "rule 5": {"random_lines": True, "line_period": 10.23},
    "rule 7": {"step_period": 0.73, "step_read": 0.53, "channels": 64},
    "rule 8": {"array": taxel.Array(65, 64), "wire_version": 1},
    "channels": {"channels": 32},
    "name": {"speed": 1},
    "step of time": {"line_period": 3.001},
    "wire version": {"wire_version": 3},
}
CALLS = {
    **{f"registers, {name}": lambda _, broken=broken: Registers(**broken) for name, broken in BROKEN.items()},
    "other channels": lambda _: Registers().commands_to(Registers.preset("20.8 kHz")),
    "preset": lambda _: Registers.preset("9 kHz"),
    "register of a command": lambda _: Command(8, 0),
    "length of a command": lambda _: Command.from_bytes(b"abcd"),
    "byte of a command": lambda _: Command.from_bytes(b"abcde"),
    "no bytes": lambda _: wire.decode("text"),
    "differences of version 2": lambda _: wire.Decoder(2, differences=True),
    "version": lambda _: wire.Decoder(3),
    "times of a frame": lambda _: Board().frame(np.zeros(7, np.uint16)),
    "large array": lambda _: Board(array=taxel.Array(257, 256)),
    "lines of an array": lambda _: Board(Registers.preset("5.2 kHz"), taxel.Array(8, 8)),
}


def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
