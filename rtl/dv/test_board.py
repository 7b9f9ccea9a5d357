"""A board's logic from the comparators' pins to those of the PHY, against the emulated board."""

import numpy as np
import pytest

from board import COLUMNS, ROWS, Pins
from ethernet import payload_of
from taxel import Array
from taxel.simulate import Board
from taxel.wire import Registers


@pytest.mark.parametrize("seed", [12, 15, 21])
def test_frames_at_the_phys_pins_are_the_emulated_boards_datagrams(seed):
    rng = np.random.default_rng(seed)
    pins = Pins(seed)
    # Clocks that are not steady, and then lose it once more, hold everything in reset for as long as is asked.
    for steady in (False, True, False):
        pins.steady(steady)
        # Registers begin with random bits, of which an edge may come.
        for _ in range(3):
            pins.run(100)
        assert pins.in_reset()
    pins.frames()
    pins.steady(True)
    array = Array(ROWS, COLUMNS)
    registers = Registers(array=array, channels=64)
    board = Board(registers, array, queue=1 << 30)
    ticks = np.zeros((ROWS, COLUMNS), np.uint16)
    pins.ticks(ticks)
    for _ in range(2):
        assert pins.run(1_000_000)
    assert not pins.in_reset()
    expected: list[bytes] = []
    received: list[bytes] = []
    for k in range(12):
        # No more than the queue holds, which is as deep as the array: what finds no room comes a frame later.
        moves = rng.random(ticks.shape) < (1.0 if k == 3 else 0.05)
        edges = [0, 1, 2, registers.ramp - 1, registers.ramp, int(rng.integers(3, registers.ramp))]
        drawn = rng.choice(edges, ticks.shape)
        ticks = np.where(moves, drawn, ticks).astype(np.uint16)
        expected += board.frame(ticks)
        pins.ticks(ticks)
        assert pins.run(1_000_000)
        received += pins.frames()
    # What waits needs longer than the frames that it is of.
    for _ in range(30):
        assert pins.run(1_000_000)
    received += pins.frames()
    assert [payload_of(frame) for frame in received] == expected
    assert sum(map(len, expected)) > 1500
