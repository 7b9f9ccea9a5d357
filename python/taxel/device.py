"""The board on its serial line: found, set by name, read back, and found again when the cable was pulled."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import socket
import termios
import time
import tty
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Self, TypeVar

from taxel import _core
from taxel._base.arguments import flag, instance, number, shown, text, whole
from taxel._core import DeviceError, ProblemError
from taxel.array import Array
from taxel.wire import Command, Registers

__all__ = ["Cable", "Device", "Greeting", "Port", "ports"]

T = TypeVar("T")

#: How long to wait between two tries to open a line again, s.
_AGAIN_S = 0.05
#: Start and stop of a recording: REG7[16] (Table 5.5).
_RECORD = 1 << 16
#: Lines that are stored for `Cable.said`.
_KEPT = 256

#: Where the noise floor stands: REG5[15:8] (Table 5.5).
_FLOOR_REGISTER, _FLOOR_MASK = 5, 0xFF00

#: The line that a board sends at its reset, and when it is asked for it.
_GREETING = re.compile(r"taxel-board v(\d) (\d+)x(\d+) (\d+)ch")

_SPEEDS = {
    9600: termios.B9600,
    57_600: termios.B57600,
    115_200: termios.B115200,
    230_400: termios.B230400,
    460_800: termios.B460800,
    921_600: termios.B921600,
}


@dataclass(frozen=True)
class Port:
    """Name a serial port of the system.

    Parameters
    ----------
    place : str
        As "/dev/ttyUSB0": what `Cable` and `Device` take.
    kind : {"usb", "pci", "bluetooth", "other"}
    product, maker, serial : str or None
        The description of a USB device.
    usb : (int, int) or None
        Vendor and product numbers of a USB device.
    """

    place: str
    kind: str
    product: str | None = None
    maker: str | None = None
    serial: str | None = None
    usb: tuple[int, int] | None = None


def ports() -> list[Port]:
    """Return the serial ports of the system, USB devices first.

    Pseudo-terminals, as `taxel emulate --line` makes, are not among them: give their name.

    Raises
    ------
    OSError : the system cannot be asked
    """
    found = json.loads(_core.serial_ports())
    return [Port(**{**port, "usb": None if port["usb"] is None else tuple(port["usb"])}) for port in found]


@dataclass(frozen=True)
class Greeting:
    """Hold the line in which a board describes itself.

    Parameters
    ----------
    wire_version : int
        The version of the wire that it speaks.
    rows, columns : int
        Sense lines and driven lines of its array.
    channels : int
        Of its converter.
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
    baud : int
        Of a serial device, 8 data bits, no parity, 1 stop bit (reading: the manual gives no settings).
    timeout : float, s
        How long the board may take to answer.

    Attributes
    ----------
    faults : dict
        How often each fault has come, as far as its line was received.
    resets : int
        How often the board greeted without being asked, as far as its line was received: at a reset, and on connecting.

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
        self.faults: dict[str, int] = {}
        self.resets = 0
        self._said: deque[str] = deque(maxlen=_KEPT)
        self.baud, self._file = baud, -1
        self._open()

    def _open(self) -> None:
        self._waiting, place, baud = b"", self.place, self.baud
        server = re.fullmatch(r"\[?(.+?)\]?:(\d{1,5})", place)
        if place.startswith("/"):
            self._file = os.open(place, os.O_RDWR | os.O_NOCTTY)
            try:
                tty.setraw(self._file)
                settings = termios.tcgetattr(self._file)
                settings[4] = settings[5] = _SPEEDS[baud]
                termios.tcsetattr(self._file, termios.TCSANOW, settings)
                # Lines that came before are no answer to this request.
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
            raise ProblemError(f"place is {shown(place)}: must be a serial device (/dev/ttyUSB0) or host:port")
        os.set_blocking(self._file, False)

    def command(self, command: Command) -> int:
        """Write a register and return the value that the board reports; the board's other lines are skipped.

        Raises
        ------
        DeviceError : the board refuses (its rule is named), or does not answer
        """
        instance("command", command, Command)
        # A write of REG6 asks for the register that it names.
        register = command.value if command.register == 6 else command.register
        for line in self._answers(command):
            answer = re.fullmatch(r"ok REG(\d)=0x([0-9A-F]{8})", line)
            if answer and int(answer[1]) == register:
                return int(answer[2], 16)
            if line.startswith(f"bad REG{command.register} "):
                said = f"REG{command.register} = 0x{command.value:08X}"
                raise DeviceError(f"{self.place}: the board refuses {said} ({line[4:]} of its registers)")
        raise self._silence()

    def greeting(self) -> Greeting:
        """Ask the board what it is (a write of 8 to REG6), as its line at reset may not have been received.

        Raises
        ------
        DeviceError : the board does not answer
        """
        for line in self._answers(Command(6, 8)):
            said = _GREETING.fullmatch(line)
            if said:
                # It was asked for.
                self.resets -= 1
                return Greeting(*(int(part) for part in said.groups()))
        raise self._silence()

    def listen(self) -> dict[str, int]:
        """Read the lines that have come meanwhile, and return how often each fault has come so far ("queue": 3).

        Raises
        ------
        OSError, DeviceError : the cable was pulled
        """
        for _ in self._lines(0.0):
            pass
        return dict(self.faults)

    def said(self) -> list[str]:
        """Return the board's lines since this was asked last, answers to commands included; the last 256 of them.

        Raises
        ------
        DeviceError : the board has hung up
        """
        self.listen()
        said = list(self._said)
        self._said.clear()
        return said

    def reopen(self, within: float = 2.0) -> Greeting:
        """Open the line again, as often as it takes, until the board greets; what was known of its faults is forgotten.

        Raises
        ------
        DeviceError : no board is there within so many seconds
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
        """Return what a register holds (a write of REG6 with its number).

        Raises
        ------
        DeviceError : the board does not answer
        """
        return self.command(Command(6, whole("register", register, 0, 7)))

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

    def _answers(self, command: Command) -> Iterator[str]:
        """Send a command; yield the lines that the board sends then."""
        self._require()
        os.write(self._file, command.to_bytes())
        return self._lines(self.timeout)

    def _require(self) -> None:
        if self._file < 0:
            raise DeviceError(f"{self.place}: the line is closed")

    def _silence(self) -> DeviceError:
        return DeviceError(f"{self.place}: no answer within {self.timeout:g} s: is this the board's serial line?")

    def _lines(self, seconds: float) -> Iterator[str]:
        """Yield the board's lines until none has come for too long; record faults among them."""
        self._require()
        until = time.monotonic() + seconds
        while True:
            line, end, rest = self._waiting.partition(b"\n")
            if end:
                self._waiting = rest
                said = line.decode("ascii", "replace").strip()
                self._said.append(said)
                self.resets += _GREETING.fullmatch(said) is not None
                fault = re.fullmatch(r"fault (\w+) (\d+)", said)
                if fault:
                    self.faults[fault[1]] = int(fault[2])
                else:
                    yield said
                continue
            if not select.select([self._file], [], [], max(0.0, until - time.monotonic()))[0]:
                return
            more = os.read(self._file, 4096)
            if not more:
                raise DeviceError(f"{self.place}: the board has hung up")
            self._waiting += more


class Device:
    """Set a board by its registers' names, with their units; a context manager.

    What is set is read back. Where the cable was pulled, what is asked next finds the board again, and sets what was
    set before where the board has forgotten it.

    Parameters
    ----------
    place : str
        A serial device (`ports` finds them), or host:port.
    array : Array, optional
        The sensor; of the size that the board reports where it is left out.
    baud : int
    timeout : float, s
        How long the board may take to answer.
    patience : float, s
        How long it is looked for once the cable was pulled.

    Raises
    ------
    OSError : the line cannot be opened
    DeviceError : no board answers there, or one of another size than `array`
    ProblemError : arguments that make no sense

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
        self.patience = number("patience", patience)
        self.reconnects = 0
        self._set: Registers | None = None
        self.cable = Cable(place, baud=baud, timeout=timeout)
        try:
            self.greeting = self.cable.greeting()
            size = (self.greeting.rows, self.greeting.columns)
            thesis = Array.thesis()
            self.array = array or (thesis if thesis.shape == size else Array(*size, pitch_mm=thesis.pitch_mm))
            if self.array.shape != size:
                raise DeviceError(f"{place}: the board has {size[0]} x {size[1]} taxels, the array {self.array!r}")
        except BaseException:
            self.cable.close()
            raise

    @property
    def registers(self) -> Registers:
        """What the board's registers hold, read now.

        Raises
        ------
        DeviceError : the board does not answer, or holds what breaks a rule
        """
        return self._try(self._read)

    def apply(self, registers: Registers | str) -> Registers:
        """Set all registers but `record`, or a preset by its name; return what the board holds then.

        Each write on the way leaves the board with a set that keeps the rules. A preset leaves the version of the wire
        that the board speaks (`Registers.with_preset`).

        Raises
        ------
        DeviceError : a rule is broken, the board refuses, does not answer, or holds something else afterwards
        """
        if isinstance(registers, Registers):
            return self._try(lambda: self._write(registers))
        preset = text("registers", registers)
        return self._try(lambda: self._write(self._read().with_preset(preset)))

    def set(self, **fields: float) -> Registers:
        """Set some registers by name, times in us; return what the board holds then.

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

        Raises
        ------
        DeviceError : the board does not answer
        """
        on = flag("start", start)
        return self._try(lambda: self._record(on))

    @property
    def faults(self) -> dict[str, int]:
        """How often each fault has come since the board was found, by its lines: "queue", "comparator", "command"."""
        return self._try(self.cable.listen)

    def close(self) -> None:
        """Let go of the line; the board goes on."""
        self.cable.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        g = self.greeting
        return f"Device({self.cable.place}, {g.rows} x {g.columns} taxels, {g.channels} channels)"

    def _try(self, work: Callable[[], T]) -> T:
        """Do something; once more where the cable was pulled meanwhile."""
        try:
            return work()
        except OSError:
            pass
        except DeviceError as error:
            if "hung up" not in str(error):
                raise
        found = self.cable.reopen(self.patience)
        self.reconnects += 1
        if (found.rows, found.columns, found.channels) != (
            self.greeting.rows,
            self.greeting.columns,
            self.greeting.channels,
        ):
            raise DeviceError(f"{self.cable.place}: another board is there now: {found}")
        self.greeting = found
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
            said = ", ".join(f"REG{n} is 0x{now.words[n]:08X}, not 0x{target.words[n]:08X}" for n in wrong)
            raise DeviceError(f"{self.cable.place}: the board holds something else than was written: {said}")
        self._set = target
        return now

    def _record(self, start: bool) -> Registers:
        word = self.cable.read(7)
        self.cable.command(Command(7, word | _RECORD if start else word & ~_RECORD))
        return self._read()
