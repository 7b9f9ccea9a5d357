"""A board's logic between the comparators' pins and those of the PHY, as an object of Python."""

from __future__ import annotations

import ctypes

import numpy as np

from verilated import built

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
        """Say whether the clocks are steady."""
        self.library.board_steady(self.board, int(steady))

    def button(self, pressed: bool) -> None:
        """Hold the button, or let it go."""
        self.library.board_button(self.board, int(pressed))

    def in_reset(self) -> bool:
        """Return whether the PHY is held in reset."""
        return bool(self.library.board_in_reset(self.board))

    def ticks(self, ticks: np.ndarray) -> None:
        """Set the trip times of reads to come: shape (rows, columns)."""
        held = np.ascontiguousarray(ticks, np.uint16)
        self.library.board_ticks(self.board, held.ctypes.data_as(ctypes.c_void_p))

    def run(self, ns: int) -> bool:
        """Run to the next frame's edge, for so many ns at most; return whether it came."""
        return bool(self.library.board_run(self.board, ctypes.c_uint64(ns)))

    def frames(self) -> list[bytes]:
        """Return the frames of Ethernet that ended since this was last asked."""
        data, lengths = ctypes.create_string_buffer(ROOM), np.zeros(MOST, np.uint32)
        count = self.library.board_frames(self.board, data, lengths.ctypes.data_as(ctypes.c_void_p), ROOM, MOST)
        assert count >= 0
        ends = np.cumsum(lengths[:count]).tolist()
        return [data.raw[start:end] for start, end in zip([0, *ends], ends, strict=False)]
