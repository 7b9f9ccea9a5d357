"""Requests about the board: its serial line, and the source that receives its datagrams."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

from taxel._base.interfaces import interfaces
from taxel._core import ProblemError
from taxel.device import Cable
from taxel.live._requests.reasons import reasons
from taxel.wire import Command


class BoardRequests:
    """Write the board's registers, and choose where and how it is received.

    Parameters
    ----------
    listen : function of host and port
        Receives the board's datagrams on another address.
    read_source : function of a text
        Receives another source.
    delta_intensity : function of a bool
        Interprets intensities as differences, or as values.
    read_out : function of a path
        Reads the board out with another readout.
    cable : Cable or None
        The board's serial line, which `close` closes.
    """

    def __init__(
        self,
        listen: Callable[[str, int], None],
        read_source: Callable[[str], None],
        delta_intensity: Callable[[bool], None],
        read_out: Callable[[Path], None],
        cable: Cable | None,
    ) -> None:
        self._listen, self._read_source = listen, read_source
        self._delta_intensity, self._read_out = delta_intensity, read_out
        self._cable, self._lock = cable, threading.Lock()

    def close(self) -> None:
        """Close the serial line."""
        with self._lock:
            if self._cable is not None:
                self._cable.close()
                self._cable = None

    def _connected(self) -> Cable:
        if self._cable is None:
            raise ProblemError("the board's serial line is not connected")
        return self._cable

    def command(self, register: int, value: int) -> int:
        """Write a register; return the value that the board reports."""
        with reasons(), self._lock:
            return self._connected().command(Command(register, value))

    def channels(self) -> int:
        """Return the number of converter channels in the board's greeting."""
        with reasons(), self._lock:
            return self._connected().greeting().channels

    def board_lines(self) -> tuple[list[str], int]:
        """Return the board's lines since the last call, and how often it was reset."""
        with reasons(), self._lock:
            return ([], 0) if self._cable is None else (self._cable.take_lines(), self._cable.resets)

    def connect(self, address: str | None) -> None:
        """Connect the serial line to another place, or disconnect it."""
        self.close()
        if address is not None:
            with reasons():
                cable = Cable(address)
            with self._lock:
                self._cable = cable

    def listen(self, host: str, port: int) -> None:
        """Receive the board's datagrams on another address."""
        with reasons():
            self._listen(host, port)

    def read_source(self, source: str) -> None:
        """Receive another source, as a text names it."""
        with reasons():
            self._read_source(source)

    def set_differences(self, on: bool) -> None:
        """Interpret intensities as differences, or as values."""
        with reasons():
            self._delta_intensity(on)

    def addresses(self) -> list[tuple[str, str]]:
        """Return the IPv4 addresses of this machine, each with the name of its network interface."""
        with reasons():
            return [(interface.address, interface.name) for interface in interfaces()]

    def read_out(self, readout: Path) -> None:
        """Read the board out with another readout."""
        with reasons():
            self._read_out(readout)
