"""An emulated board on a pseudo-terminal and UDP, in a thread of the tests."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from loopback import free_port

from taxel import Array
from taxel.simulate import NOT_RETURNED, Board
from taxel.wire import Registers

ARRAY = Array(16, 16)


class Emulated:
    """A board on a pseudo-terminal and UDP, far slower than its clock; `spoil` may change what it sends."""

    def __init__(
        self, port: int, registers: Registers, ticks: Any, spoil: Callable[[int, bytes], bytes | None]
    ) -> None:
        self.board, self.ticks, self.spoil, self.port = Board(registers, ARRAY), ticks, spoil, port
        self.ours, theirs = os.openpty()
        tty.setraw(theirs)
        self.theirs, self.place = theirs, os.ttyname(theirs)
        os.set_blocking(self.ours, False)
        self.over, self.one_at_a_time = threading.Event(), threading.Lock()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self) -> None:
        random, count, frames = np.random.default_rng(1), 0, 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            while not self.over.wait(0.001):
                noisy = self.ticks + random.integers(-1, 2, self.ticks.shape)
                values = np.where(self.ticks == NOT_RETURNED, NOT_RETURNED, noisy.clip(0)).astype(np.uint16)
                with self.one_at_a_time:
                    with contextlib.suppress(BlockingIOError):
                        os.write(self.ours, self.board.command(os.read(self.ours, 5)).encode())
                    datagrams = self.board.frame(values)
                for datagram in datagrams:
                    count += 1
                    spoiled = self.spoil(count, datagram)
                    if spoiled is not None:
                        link.sendto(spoiled, ("127.0.0.1", self.port))
                frames += 1
                # A board sends its faults now and then; a line that is not read fills up.
                if frames % 10 == 0:
                    with contextlib.suppress(BlockingIOError):
                        os.write(self.ours, self.board.faults().encode())

    def reset(self) -> None:
        """Begin anew, as after a loss of power: what was set is lost, and the board greets."""
        with self.one_at_a_time:
            self.board.reset()
            os.write(self.ours, self.board.greeting.encode())

    def close(self) -> None:
        self.over.set()
        self.thread.join()
        os.close(self.ours)
        os.close(self.theirs)


@contextlib.contextmanager
def emulated(
    ticks: Any = None, spoil: Callable[[int, bytes], bytes | None] = lambda _, datagram: datagram, **fields: float
) -> Iterator[Emulated]:
    board = Emulated(
        free_port(),
        Registers(array=ARRAY, **fields),
        np.full(ARRAY.shape, 20, np.int64) if ticks is None else ticks,
        spoil,
    )
    try:
        yield board
    finally:
        board.close()
