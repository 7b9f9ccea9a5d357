"""The board on its serial line: sets registers by name, reads them back, and reconnects after the cable was pulled."""

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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Self, TypeVar

from taxel import _core
from taxel._base.arguments import flag, instance, integer, number, shown, text
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel._core import DeviceError
from taxel.array import Array
from taxel.wire import Command, Registers

__all__ = ["Cable", "Device", "Greeting", "Port", "ports"]

T = TypeVar("T")

#: Interval between attempts to reopen a line, s.
_AGAIN_S = 0.05
#: Start and stop of a recording: REG7[16] (Table 5.5).
_RECORD = 1 << 16
#: Lines that are stored for `Cable.take_lines`.
_RECENT = 256

#: The noise floor: REG5[15:8] (Table 5.5).
_FLOOR_REGISTER, _FLOOR_MASK = 5, 0xFF00

#: The line that a board sends at its reset, and on request.
_GREETING = re.compile(r"taxel-board v(\d) (\d+)x(\d+) (\d+)ch")

#: The constant of each baud rate.
_SPEEDS: dict[int, int] = {
    baud: getattr(termios, f"B{baud}") for baud in (9600, 57_600, 115_200, 230_400, 460_800, 921_600)
}


@dataclass(frozen=True)
class Port:
    """Name a serial port of the system.

    Parameters
    ----------
    place : str
        As "/dev/ttyUSB0", for `Cable` and `Device`.
    kind : {"usb", "pci", "bluetooth", "other"}
    product, maker, serial : str or None
        The description of a USB device.
    usb : (int, int) or None
        Vendor and product numbers of a USB device.

    Examples
    --------
    >>> Port("/dev/ttyUSB0", "usb", product="FT232R").place
    '/dev/ttyUSB0'
    """

    place: str
    kind: str
    product: str | None = None
    maker: str | None = None
    serial: str | None = None
    usb: tuple[int, int] | None = None


def ports() -> list[Port]:
    """Return the serial ports of the system, USB devices first.

    Pseudo-terminals, as `taxel emulate --line` makes, are not among them.

    Returns
    -------
    list of Port

    Raises
    ------
    OSError : the system does not list its ports

    Examples
    --------
    >>> all(port.place for port in ports())
    True
    """
    return [Port(**port) for port in _core.serial_ports()]


@dataclass(frozen=True)
class Greeting:
    """Hold the line in which a board describes itself.

    Parameters
    ----------
    wire_version : int, from 1 to 2
        The version of the wire.
    rows, columns : int, lines
        Sense lines and driven lines of its array.
    channels : int, 1 or more
        Channels of its converter.

    Examples
    --------
    >>> Greeting(2, 64, 64, 4).rows
    64
    """

    wire_version: int
    rows: int
    columns: int
    channels: int


class Cable:
    """Write a board's registers over its serial line. A context manager.

    Parameters
    ----------
    place : str
        A serial device ("/dev/ttyUSB0"), or host:port of a serial server or an emulated board.
    baud : int, bits/s, from 9600 to 460800
        Baud rate of a serial device; 8 data bits, no parity, 1 stop bit (reading: the manual gives no settings).
    timeout : float, s, above 0
        How long the board may take to answer.

    Attributes
    ----------
    faults : dict
        Number of faults by name, counted from the lines that were received.
    resets : int
        Number of received greetings that were not requested: the board sends one at a reset and on connecting.

    Raises
    ------
    OSError : the device or the server cannot be opened
    DeviceError : the device is not a serial device
    ProblemError : an invalid place, baud rate or timeout

    Notes
    -----
    Thesis, Appendix 1, Tables 5.1 and 5.5, and the page *Registers*.

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
            raise refused("timeout", f" is {shown(timeout)}: must be from 0 to 3600")
        if integer("baud", baud) not in _SPEEDS:
            raise refused("baud", f" is {baud}: must be one of {', '.join(map(str, _SPEEDS))}")
        self.faults: dict[str, int] = {}
        self.resets = 0
        self._recent: deque[str] = deque(maxlen=_RECENT)
        self.baud, self._file = baud, -1
        self._open()

    def _open(self) -> None:
        self._waiting, place, baud = b"", self.place, self.baud
        server = re.fullmatch(r"\[?(.+?)\]?:([0-9]{1,5})", place)
        if place.startswith("/"):
            self._file = os.open(place, os.O_RDWR | os.O_NOCTTY)
            try:
                tty.setraw(self._file)
                settings = termios.tcgetattr(self._file)
                settings[4] = settings[5] = _SPEEDS[baud]
                termios.tcsetattr(self._file, termios.TCSANOW, settings)
                # Lines that arrived before the request are not its answer.
                termios.tcflush(self._file, termios.TCIFLUSH)
            except termios.error as error:
                self.close()
                raise DeviceError(f"{place}: no serial device ({error.args[-1]})") from None
        elif server and int(server[2]) <= 65_535:
            try:
                self._file = socket.create_connection((server[1], int(server[2])), self.timeout).detach()
            except OSError as error:
                raise OSError(error.errno, error.strerror or str(error), f"TCP {place}") from None
        else:
            raise refused("place", f" is {shown(place)}: must be a serial device (/dev/ttyUSB0) or host:port")
        os.set_blocking(self._file, False)

    def command(self, command: Command) -> int:
        """Write a register and return the value that the board reports; other lines of the board are skipped.

        Parameters
        ----------
        command : Command

        Returns
        -------
        int, from 0 to 2**32 - 1
            The whole register.

        Raises
        ------
        DeviceError : the board refuses the command (the error names the rule), or does not answer
        ProblemError : no command

        Examples
        --------
        On the line of an emulated board:

        >>> import os, pty, threading
        >>> from taxel.simulate import Board
        >>> board, (end, line) = Board(), pty.openpty()
        >>> def answer(read=os.read, write=os.write):
        ...     while data := read(end, 5):
        ...         write(end, board.command(data).encode())
        >>> threading.Thread(target=answer, daemon=True).start()
        >>> with Cable(os.ttyname(line), timeout=30) as cable:
        ...     cable.command(Command(4, 140)), cable.read(4)
        (140, 140)
        """
        instance("command", command, Command)
        # A write of REG6 requests the register whose number it holds.
        register = command.value if command.register == 6 else command.register
        for line in self._answers(command):
            answer = re.fullmatch(r"ok REG(\d)=0x([0-9A-F]{8})", line)
            if answer and int(answer[1]) == register:
                return int(answer[2], 16)
            if line.startswith(f"bad REG{command.register} "):
                write = f"REG{command.register} = 0x{command.value:08X}"
                raise DeviceError(f"{self.place}: the board refuses {write} ({line[4:]} of its registers)")
        raise self._silence()

    def greeting(self) -> Greeting:
        """Request the greeting of the board (a write of 8 to REG6), as its line at reset may not have been received.

        Returns
        -------
        Greeting

        Raises
        ------
        DeviceError : the board does not answer
        """
        for line in self._answers(Command(6, 8)):
            greeting = _GREETING.fullmatch(line)
            if greeting:
                # This greeting was requested, so it does not indicate a reset.
                self.resets -= 1
                return Greeting(*(int(part) for part in greeting.groups()))
        raise self._silence()

    def listen(self) -> dict[str, int]:
        """Read the lines that have arrived, and return the number of faults so far by name ("queue": 3).

        Returns
        -------
        dict of int by str

        Raises
        ------
        OSError, DeviceError : the cable was pulled
        """
        for _ in self._lines(0.0):
            pass
        return dict(self.faults)

    def take_lines(self) -> list[str]:
        """Return the lines of the board since the last call, answers to commands included; at most the last 256.

        Returns
        -------
        list of str, one a line

        Raises
        ------
        DeviceError : the board has disconnected
        """
        self.listen()
        lines = list(self._recent)
        self._recent.clear()
        return lines

    def reopen(self, within: float = 2.0) -> Greeting:
        """Reopen the line until the board answers with its greeting; the fault counts begin again at 0.

        Parameters
        ----------
        within : float, s
            How long to try.

        Returns
        -------
        Greeting

        Raises
        ------
        DeviceError : no board answers within that time
        ProblemError : no number
        """
        until, why = time.monotonic() + number("within", within), ""
        patience, self.timeout = self.timeout, min(self.timeout, 0.25)
        try:
            while True:
                try:
                    self.close()
                    self._open()
                    self.faults.clear()
                    return self.greeting()
                except (OSError, DeviceError) as error:
                    why = str(error)
                if time.monotonic() >= until:
                    raise DeviceError(f"{self.place}: no board there after {within:g} s ({why})")
                time.sleep(_AGAIN_S)
        finally:
            self.timeout = patience

    def read(self, register: int) -> int:
        """Return the value of a register (a write of REG6 with its number).

        Parameters
        ----------
        register : int, from 0 to 7

        Returns
        -------
        int, from 0 to 2**32 - 1
            The whole register.

        Raises
        ------
        DeviceError : the board does not answer
        ProblemError : no such register
        """
        return self.command(Command(6, integer("register", register, 0, 7)))

    @contextlib.contextmanager
    def floor(self, ticks: int) -> Iterator[None]:
        """Set the noise floor within a context, as for a tare; the previous one is restored at its end.

        Parameters
        ----------
        ticks : int, ticks, from 0 to 255

        Returns
        -------
        context manager, which yields None

        Raises
        ------
        DeviceError : the board refuses, or does not answer
        ProblemError : a noise floor out of this range
        """
        before = self.read(_FLOOR_REGISTER)
        floor = integer("ticks", ticks, 0, 255) << 8
        self.command(Command(_FLOOR_REGISTER, before & ~_FLOOR_MASK | floor))
        try:
            yield
        finally:
            self.command(Command(_FLOOR_REGISTER, before))

    def close(self) -> None:
        """Close the line."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Cable:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return escaped(f"Cable({self.place})")

    def _answers(self, command: Command) -> Iterator[str]:
        """Send a command; yield the lines that the board sends after it."""
        self._require()
        os.write(self._file, command.to_bytes())
        return self._lines(self.timeout)

    def _require(self) -> None:
        if self._file < 0:
            raise DeviceError(f"{self.place}: the line is closed")

    def _silence(self) -> DeviceError:
        return DeviceError(f"{self.place}: no answer within {self.timeout:g} s: is this the board's serial line?")

    def _lines(self, seconds: float) -> Iterator[str]:
        """Yield the lines of the board until none has arrived for `seconds`; count faults among them."""
        self._require()
        until = time.monotonic() + seconds
        while True:
            line, end, rest = self._waiting.partition(b"\n")
            if end:
                self._waiting = rest
                received = line.decode("ascii", "replace").strip()
                self._recent.append(received)
                self.resets += _GREETING.fullmatch(received) is not None
                fault = re.fullmatch(r"fault (\w+) (\d+)", received)
                if fault:
                    self.faults[fault[1]] = int(fault[2])
                else:
                    yield received
                continue
            if not select.select([self._file], [], [], max(0.0, until - time.monotonic()))[0]:
                return
            more = os.read(self._file, 4096)
            if not more:
                raise DeviceError(f"{self.place}: the board has hung up")
            self._waiting += more


class Device:
    """Set a board by its registers' names, with their units; a context manager.

    Registers are read back after they are set. After the cable was pulled, the next call reconnects, and sets the
    registers again if the board was reset.

    Parameters
    ----------
    place : str
        A serial device (`ports` finds them), or host:port.
    array : Array, optional
        The sensor. Default: one of the size that the board reports.
    baud : int, bits/s, from 9600 to 460800
        Baud rate of a serial device.
    timeout : float, s, above 0
        How long the board may take to answer.
    patience : float, s
        How long to try to reconnect after the cable was pulled.

    Raises
    ------
    OSError : the line cannot be opened
    DeviceError : no board answers there, or one of another size than `array`
    ProblemError : invalid arguments

    Examples
    --------
    >>> Device("nowhere")
    Traceback (most recent call last):
    taxel.ProblemError: place is 'nowhere': must be a serial device (/dev/ttyUSB0) or host:port
    """

    def __init__(
        self,
        place: str,
        *,
        array: Array | None = None,
        baud: int = 115_200,
        timeout: float = 1.0,
        patience: float = 2.0,
    ) -> None:
        checked = None if array is None else instance("array", array, Array)
        self.patience = number("patience", patience)
        self.reconnects = 0
        self._set: Registers | None = None
        self.cable = Cable(place, baud=baud, timeout=timeout)
        try:
            self.greeting = self.cable.greeting()
            size = (self.greeting.rows, self.greeting.columns)
            thesis = Array.thesis()
            reported = thesis if thesis.shape == size else Array(*size, pitch_mm=thesis.pitch_mm)
            self.array = reported if checked is None else checked
            if self.array.shape != size:
                raise DeviceError(f"{place}: the board has {size[0]} x {size[1]} taxels, the array {self.array!r}")
        except BaseException:
            self.cable.close()
            raise

    @property
    def registers(self) -> Registers:
        """The contents of the board's registers, read now.

        Raises
        ------
        DeviceError : the board does not answer, or its registers break a rule
        """
        return self._try(self._read)

    def apply(self, registers: Registers | str) -> Registers:
        """Set all registers but `record`, or a preset by its name; return the contents of the registers afterwards.

        After each write the registers satisfy the rules. A preset does not change the version of the wire
        (`Registers.with_preset`).

        Parameters
        ----------
        registers : Registers or str
            The registers, or the name of a preset.

        Returns
        -------
        Registers

        Raises
        ------
        DeviceError : a rule is broken, the board refuses, does not answer, or reports another value afterwards
        ProblemError : no such preset

        Examples
        --------
        On the line of an emulated board:

        >>> import os, pty, threading
        >>> from taxel.simulate import Board
        >>> board, (end, line) = Board(), pty.openpty()
        >>> def answer(read=os.read, write=os.write):
        ...     while data := read(end, 5):
        ...         write(end, board.command(data).encode())
        >>> threading.Thread(target=answer, daemon=True).start()
        >>> with Device(os.ttyname(line), timeout=30) as device:
        ...     device.apply("2 kHz").noise_floor, device.set(noise_floor=7).noise_floor
        (10, 7)
        """
        if isinstance(registers, Registers):
            return self._try(lambda: self._write(registers))
        preset = text("registers", registers)
        return self._try(lambda: self._write(self._read().with_preset(preset)))

    def set(self, **fields: float) -> Registers:
        """Set some registers by name, times in us; return the contents of the registers afterwards.

        Parameters
        ----------
        **fields : float
            Values by the names of `Registers`, in their units.

        Returns
        -------
        Registers

        Raises
        ------
        DeviceError : as for `apply`
        ProblemError : no such register
        """

        def change() -> Registers:
            now = self._read()
            target = now.replace(**fields)
            then = self._write(target)
            return then if target.record == now.record else self._record(target.record)

        return self._try(change)

    def record(self, start: bool) -> Registers:
        """Start or stop a recording: a marker event, and an edge on the sync pin.

        Parameters
        ----------
        start : bool
            Start (true) or stop.

        Returns
        -------
        Registers
            The contents of the registers afterwards.

        Raises
        ------
        DeviceError : the board does not answer
        ProblemError : neither true nor false
        """
        starts = flag("start", start)
        return self._try(lambda: self._record(starts))

    @property
    def faults(self) -> dict[str, int]:
        """Number of faults by name since the board was connected: "queue", "comparator", "command"."""
        return self._try(self.cable.listen)

    def close(self) -> None:
        """Close the line; the board continues."""
        self.cable.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        g = self.greeting
        return escaped(f"Device({self.cable.place}, {g.rows} x {g.columns} taxels, {g.channels} channels)")

    def _try(self, work: Callable[[], T]) -> T:
        """Call a function; call it once more if the cable was pulled during the first call."""
        try:
            return work()
        except OSError:
            pass
        except DeviceError as error:
            if "hung up" not in str(error):
                raise
        greeting = self.cable.reopen(self.patience)
        self.reconnects += 1
        if replace(greeting, wire_version=self.greeting.wire_version) != self.greeting:
            raise DeviceError(f"{self.cable.place}: another board is there now: {greeting}")
        self.greeting = greeting
        if self._set is not None:
            self._write(self._set)
        return work()

    def _read(self) -> Registers:
        words = [0 if n == 6 else self.cable.read(n) for n in range(8)]
        return Registers.from_words(words, array=self.array, channels=self.greeting.channels)

    def _write(self, target: Registers) -> Registers:
        for command in self._read().commands_to(target):
            self.cable.command(command)
        now = self._read()
        if now.replace(record=target.record) != target:
            wrong = [n for n, (a, b) in enumerate(zip(now.words, target.words, strict=True)) if a != b and n != 7]
            differing = ", ".join(f"REG{n} is 0x{now.words[n]:08X}, not 0x{target.words[n]:08X}" for n in wrong)
            raise DeviceError(f"{self.cable.place}: the board holds something else than was written: {differing}")
        self._set = target
        return now

    def _record(self, start: bool) -> Registers:
        word = self.cable.read(7)
        self.cable.command(Command(7, word | _RECORD if start else word & ~_RECORD))
        return self._read()
