"""Sends the frames of any sensor that Python can read, as a board does."""

from __future__ import annotations

import os
import socket

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import instance, integer, number, numbers, text
from taxel._base.errors import refused
from taxel._base.messages import counted, plain
from taxel.array import Array
from taxel.live.sending import PORT
from taxel.simulate.board import Board, Version2
from taxel.wire import Registers


class Source:
    """Send frames of any sensor as a board does: they become events by the board's rules, in datagrams of version 2.

    Any receiver of a board can receive them: `Live`, ``taxel record``, ``taxel live``, with this array and, as
    `registers`, these registers.

    Parameters
    ----------
    array : Array
        The sensor.
    rate : float, 1/s, above 0
        Frames per second; each push advances the source's clock by one frame.
    bits : int, 1 to 16
        Bits of the values. If the board resolves fewer bits at this rate, values are shifted right by `shift`.
    noise_floor : int, 0 to 255
        A change above it makes an event.
    to : str
        Address and port that the datagrams are sent to.
    board : int, 0 to 65535
        Number of the board, by which receivers distinguish sources on one address.

    Raises
    ------
    ProblemError : arguments that are invalid
    OSError : a socket cannot be opened

    Examples
    --------
    >>> from taxel.live import Live
    >>> array = Array(2, 3, name="six")
    >>> with Live(0, host="127.0.0.1", array=array) as live:
    ...     host, port = live.address
    ...     source = Source(array, 100.0, bits=12, to=f"{host}:{port}")
    ...     events = [source.push(np.full((2, 3), value)) for value in (0, 700, 702, 900)]
    >>> events
    [0, 6, 0, 6]
    """

    def __init__(
        self,
        array: Array,
        rate: float,
        *,
        bits: int = 16,
        noise_floor: int = 3,
        to: str = f"127.0.0.1:{PORT}",
        board: int = 0,
    ) -> None:
        self.array = instance("array", array, Array)
        registers, self.shift = Registers._of_source(self.array, number("rate", rate), integer("bits", bits, 1, 16))
        self.bits = int(bits)
        self.registers = registers.replace(noise_floor=integer("noise_floor", noise_floor, 0, 255))
        session = int.from_bytes(os.urandom(2), "little")
        version_2 = Version2(board=integer("board", board, 0, 65_535), seed=session)
        self._board = Board(self.registers, self.array, version_2=version_2)
        _, address, _, _ = _core.line_place(f"lines+udp:{text('to', to)}")
        host, _, port = address.rpartition(":")
        self._to = (host.strip("[]"), int(port))
        # A socket that is connected fails where nothing receives; a board sends regardless.
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)

    def push(self, frame: ArrayLike) -> int:
        """Send the events of the next frame; return how many there are.

        Parameters
        ----------
        frame : int, shape (rows, columns) or flat, 0 to 2**bits - 1
            Readings that are not whole numbers are scaled before: ``np.rint(readings / full * (2**bits - 1))``, `full`
            the greatest reading.

        Raises
        ------
        ProblemError : another shape, or a value that is not a whole number of that many bits (names the taxel)
        OSError : the system refuses to send
        """
        ticks = np.minimum(self._whole(frame) >> self.shift, self.registers.ramp)
        before = self._board.counts["changes"]
        for datagram in self._board.frame(ticks.astype(np.uint16)):
            self._socket.sendto(datagram, self._to)
        return self._board.counts["changes"] - before

    def _whole(self, frame: ArrayLike) -> NDArray[np.int64]:
        """Return a frame's values as rows x columns; refuse those that the bits cannot hold."""
        values, shape, most = numbers("frame", frame, np.float64), self.array.shape, 2**self.bits - 1
        if values.shape not in (shape, (shape[0] * shape[1],)):
            right = f"{shape[0]} x {shape[1]} (rows x columns), or {shape[0] * shape[1]} row by row"
            raise refused("frame", f": has shape {' x '.join(map(str, values.shape)) or 'one number'}; must be {right}")
        values = values.reshape(shape)
        is_whole = values == np.rint(values)
        wrong = np.argwhere(~(is_whole & (values >= 0) & (values <= most)))
        if len(wrong):
            row, column = (int(k) for k in wrong[0])
            value = float(values[row, column])
            scaled = (
                f"; scale the readings first: np.rint(readings / full * {most}), where full is the greatest reading"
            )
            raise refused(
                "frame",
                f": row {row}, column {column} is {plain(value)}; must be a whole number from 0 to {most} "
                f"({counted(self.bits, 'bit')})" + scaled * (not is_whole[row, column]),
            )
        return values.astype(np.int64)

    def __repr__(self) -> str:
        rows, columns = self.array.shape
        return f"Source({rows} x {columns} taxels, {1e6 / self.registers.frame_us:g} frames/s)"
