"""A board's logic from the comparators' pins to those of the PHY, against the emulated board."""

import ctypes

import numpy as np
import pytest

from ethernet import payload_of
from logic import built
from taxel import Array
from taxel.simulate import Board
from taxel.wire import Registers

COLUMNS, ROWS = 4, 64
ROOM, MOST = 1 << 20, 4096


class Pins:
    """The board between its pins."""

    def __init__(self, seed: int, **others: int) -> None:
        parameters = {"COLUMNS": COLUMNS, "ROWS": ROWS, "RESET_CLOCKS": 60, "BAUD_CLOCKS": 8} | others
        self.library = ctypes.CDLL(str(built(parameters=parameters, top="taxel_ethernet_board", bench="board")))
        self.library.board_new.restype = ctypes.c_void_p
        self.board = ctypes.c_void_p(self.library.board_new(COLUMNS, ROWS, seed))

    def steady(self, steady: bool) -> None:
        self.library.board_steady(self.board, int(steady))

    def button(self, pressed: bool) -> None:
        self.library.board_button(self.board, int(pressed))

    def in_reset(self) -> bool:
        return bool(self.library.board_in_reset(self.board))

    def ticks(self, ticks: np.ndarray) -> None:
        held = np.ascontiguousarray(ticks, np.uint16)
        self.library.board_ticks(self.board, held.ctypes.data_as(ctypes.c_void_p))

    def run(self, ns: int) -> bool:
        return bool(self.library.board_run(self.board, ctypes.c_uint64(ns)))

    def frames(self) -> list[bytes]:
        data, lengths = ctypes.create_string_buffer(ROOM), np.zeros(MOST, np.uint32)
        count = self.library.board_frames(self.board, data, lengths.ctypes.data_as(ctypes.c_void_p), ROOM, MOST)
        assert count >= 0
        ends = np.cumsum(lengths[:count]).tolist()
        return [data.raw[start:end] for start, end in zip([0, *ends], ends, strict=False)]


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
