"""The board's serial line: commands out, status lines back."""

from __future__ import annotations

import contextlib
import os
import re
import select
import socket
import termios
import time
import tty
from collections import deque
from collections.abc import Iterator
from types import TracebackType

from taxel._arguments import instance, number, shown, text, whole
from taxel._core import DeviceError, ProblemError
from taxel.wire import Command

__all__ = ["Cable"]

#: Where the noise floor stands: REG5[15:8] (Table 5.5).
_FLOOR_REGISTER, _FLOOR_MASK = 5, 0xFF00

#: Lines that are kept for `Cable.said`.
_KEPT = 256

_SPEEDS = {
    9600: termios.B9600,
    57_600: termios.B57600,
    115_200: termios.B115200,
    230_400: termios.B230400,
    460_800: termios.B460800,
    921_600: termios.B921600,
}


class Cable:
    """Write a board's registers over its serial line. A context manager.

    Parameters
    ----------
    place : str
        A serial device ("/dev/ttyUSB0"), or host:port of a serial server or an emulated board.
    baud : int
        Of a serial device, 8 data bits, no parity, 1 stop bit (reading: the manual gives no settings).
    timeout : float, s
        How long the board may take to answer.

    Raises
    ------
    OSError : the device or the server cannot be opened
    ProblemError : a place that is neither, or a speed that is none

    Examples
    --------
    >>> Cable("ttyUSB0")
    Traceback (most recent call last):
    taxel.ProblemError: place is 'ttyUSB0': must be a serial device (/dev/ttyUSB0) or host:port
    """

    def __init__(self, place: str, *, baud: int = 115_200, timeout: float = 1.0) -> None:
        self.place = text("place", place)
        self.timeout = number("timeout", timeout)
        if not 0 < self.timeout <= 3600:
            raise ProblemError(f"timeout is {shown(timeout)}: must lie between 0 and 3600 s")
        if whole("baud", baud) not in _SPEEDS:
            raise ProblemError(f"baud is {baud}: must be one of {', '.join(map(str, _SPEEDS))}")
        self._waiting = b""
        self._said: deque[str] = deque(maxlen=_KEPT)
        server = re.fullmatch(r"\[?(.+?)\]?:(\d{1,5})", place)
        if place.startswith("/"):
            self._file = os.open(place, os.O_RDWR | os.O_NOCTTY)
            try:
                tty.setraw(self._file)
                settings = termios.tcgetattr(self._file)
                settings[4] = settings[5] = _SPEEDS[baud]
                termios.tcsetattr(self._file, termios.TCSANOW, settings)
            except termios.error as error:
                os.close(self._file)
                raise DeviceError(f"{place}: no serial device ({error.args[-1]})") from None
        elif server and int(server[2]) <= 65_535:
            try:
                self._file = socket.create_connection((server[1], int(server[2])), self.timeout).detach()
            except OSError as error:
                raise OSError(error.errno, error.strerror or str(error), f"TCP {place}") from None
        else:
            raise ProblemError(f"place is {shown(place)}: must be a serial device (/dev/ttyUSB0) or host:port")
        os.set_blocking(self._file, False)

    def command(self, command: Command) -> int:
        """Write a register and return what the board says that it holds; the board's other lines are passed over.

        Raises
        ------
        DeviceError : the board refuses (its rule is named), or does not answer
        """
        instance("command", command, Command)
        os.write(self._file, command.to_bytes())
        for line in self._lines():
            answer = re.fullmatch(r"ok REG(\d)=0x([0-9A-F]{8})", line)
            if answer:
                return int(answer[2], 16)
            if line.startswith("bad "):
                said = f"REG{command.register} = 0x{command.value:08X}"
                raise DeviceError(f"{self.place}: the board refuses {said} ({line[4:]} of its registers)")
        raise DeviceError(f"{self.place}: no answer within {self.timeout:g} s: is this the board's serial line?")

    def read(self, register: int) -> int:
        """Return what a register holds (a write of REG6 with its number).

        Raises
        ------
        DeviceError : the board does not answer
        """
        return self.command(Command(6, whole("register", register, 0, 7)))

    def said(self) -> list[str]:
        """Return the board's lines since this was asked last, answers to commands included; the last 256 of them.

        Raises
        ------
        DeviceError : the board has hung up
        """
        while select.select([self._file], [], [], 0)[0]:
            self._read()
        *lines, self._waiting = self._waiting.split(b"\n")
        self._said.extend(line.decode("ascii", "replace").strip() for line in lines)
        said = list(self._said)
        self._said.clear()
        return said

    @contextlib.contextmanager
    def floor(self, ticks: int) -> Iterator[None]:
        """Set the noise floor for a while, as for a tare; the old one comes back at the end.

        Raises
        ------
        DeviceError : the board refuses, or does not answer
        """
        before = self.read(_FLOOR_REGISTER)
        floor = whole("ticks", ticks, 0, 255) << 8
        self.command(Command(_FLOOR_REGISTER, before & ~_FLOOR_MASK | floor))
        try:
            yield
        finally:
            self.command(Command(_FLOOR_REGISTER, before))

    def close(self) -> None:
        """Let go of the line."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Cable:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Cable({self.place})"

    def _lines(self) -> Iterator[str]:
        """Yield what the board says, line by line, until it has been silent for too long."""
        until = time.monotonic() + self.timeout
        while (left := until - time.monotonic()) > 0:
            line, end, rest = self._waiting.partition(b"\n")
            if end:
                self._waiting = rest
                said = line.decode("ascii", "replace").strip()
                self._said.append(said)
                yield said
            elif select.select([self._file], [], [], left)[0]:
                self._read()

    def _read(self) -> None:
        """Take what has come."""
        said = os.read(self._file, 4096)
        if not said:
            raise DeviceError(f"{self.place}: the board has hung up")
        self._waiting += said
