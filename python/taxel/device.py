"""The board on its serial line: sets registers by name, reads them back, and reconnects after the cable was pulled."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from taxel import _core
from taxel._base.arguments import flag, instance, integer, number, shown, text
from taxel._base.errors import refused
from taxel._base.messages import escaped
from taxel._base.text_lines import TextLines
from taxel._core import DeviceError
from taxel.array import Array
from taxel.wire import Command, Registers

__all__ = ["Cable", "Device", "Greeting", "Port", "ports"]

T = TypeVar("T")

#: Start and stop of a recording: REG7[16] (Table 5.5).
_RECORD = 1 << 16

#: The noise floor: REG5[15:8] (Table 5.5).
_FLOOR_REGISTER, _FLOOR_MASK = 5, 0xFF00

#: The register that is written to read another one, and its value for the greeting.
_READ, _GREET = 6, 8
#: Longest wait for bytes, while a line is full, and for the greeting of a board whose line was opened again, s.
_WAIT_S, _FULL_S, _GREETING_S = 0.05, 0.005, 0.25
#: Longest line of a board, bytes, and how many lines are kept.
_LONGEST, _RECENT = 1024, 256
_TEXT = bytes(range(0x20, 0x7F)) + b"\t\n\f\r"


@dataclass(frozen=True)
class Port:
    """Name a serial port of the system.

    Parameters
    ----------
    place : str
        For example "COM3" or "/dev/ttyACM0", for `taxel.device.Cable` and `taxel.device.Device`.
    kind : {"usb", "pci", "bluetooth", "other"}
    product, maker, serial : str or None
        The description of a USB device.
    usb : (int, int) or None
        Vendor and product numbers of a USB device.

    Examples
    --------
    >>> Port("COM3", "usb", product="FT232R").place
    'COM3'
    """

    place: str
    kind: str
    product: str | None = None
    maker: str | None = None
    serial: str | None = None
    usb: tuple[int, int] | None = None


def ports() -> list[Port]:
    """Return the serial ports of the system, USB devices first.

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


class Cable(contextlib.AbstractContextManager["Cable"]):
    """Write a board's registers over its serial line. A context manager.

    Parameters
    ----------
    place : str
        A serial port ("COM3", "/dev/ttyACM0"; `ports` lists them), which one program can open at a time, or host:port
        of a serial server or an emulated board.
    baud : int, bits/s, from 300 to 4000000
        Baud rate of a serial port; 8 data bits, no parity, 1 stop bit (reading: the manual gives no settings).
    timeout : float, s, above 0
        Longest time that the board may take to answer.

    Attributes
    ----------
    faults : dict of int
        Number of faults by name, as far as lines were read.
    resets : int
        Number of received greetings that were not requested: the board sends one at a reset and on connecting.

    Raises
    ------
    OSError : the port or the server cannot be opened, or another program has opened the port
    DeviceError : the place is not a serial port
    ProblemError : an invalid place, baud rate or timeout

    Notes
    -----
    Thesis, Appendix 1, Tables 5.1 and 5.5, and the page *Registers*.

    Examples
    --------
    >>> Cable("ttyACM0")
    Traceback (most recent call last):
    taxel.ProblemError: place is "ttyACM0": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT
    """

    def __init__(self, place: str, *, baud: int = 115_200, timeout: float = 1.0) -> None:
        self.place = text("place", place)
        self.timeout = number("timeout", timeout)
        if not 0 < self.timeout <= 3600:
            raise refused("timeout", f" is {shown(timeout)}: must be from 0 to 3600")
        self._baud = integer("baud", baud, *_core.BAUDS)
        self.faults: dict[str, int] = {}
        self.resets = 0
        self._line: _core.SerialLine | None = None
        self._recent: deque[str] = deque(maxlen=_RECENT)
        #: Number of bytes that are no text, as those of a line at another baud rate.
        self._strange = 0
        self._open(self.timeout)

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
        OSError : the cable was pulled
        ProblemError : not a command

        Examples
        --------
        On the line of an emulated board:

        >>> import os, pty, threading
        >>> from taxel.simulate import Board
        >>> board, (end, line) = Board(), pty.openpty()
        >>> def answer(end=end, board=board, read=os.read, write=os.write):
        ...     while data := read(end, 5):
        ...         write(end, board.command(data).encode())
        >>> threading.Thread(target=answer, daemon=True).start()
        >>> with Cable(os.ttyname(line), timeout=30) as cable:
        ...     cable.command(Command(4, 140)), cable.read(4)
        (140, 140)
        """
        register, value = instance("command", command, Command).register, command.value
        reported = value if register == _READ else register

        def answer(kind: str, parts: Any) -> int | None:
            if kind == "refusal" and parts[0] == register:
                raise self._failed(
                    f"the board refuses REG{register} = 0x{value:08X} (REG{register} rule {parts[1]} of its registers)"
                )
            return int(parts[1]) if kind == "register" and parts[0] == reported else None

        return self._ask(command, self.timeout, answer)

    def greeting(self) -> Greeting:
        """Request the greeting of the board (a write of 8 to REG6), as its line at reset may not have been received.

        Returns
        -------
        Greeting

        Raises
        ------
        DeviceError : the board does not answer
        """
        return self._greeting(self.timeout)

    def listen(self) -> dict[str, int]:
        """Read the lines that have arrived, and return the number of faults so far by name ("queue": 3).

        Returns
        -------
        dict of int by str

        Raises
        ------
        OSError : the cable was pulled
        DeviceError : the line is closed
        """
        begun = time.monotonic()
        # A line that never pauses is no board's.
        while self._receive(0) is not None and time.monotonic() - begun < self.timeout:
            pass
        return dict(self.faults)

    def take_lines(self) -> list[str]:
        """Return the lines of the board since the last call, answers to commands included; at most the last 256.

        Returns
        -------
        list of str, one per line

        Raises
        ------
        OSError : the cable was pulled
        DeviceError : the line is closed
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
            Longest time to try.

        Returns
        -------
        Greeting

        Raises
        ------
        DeviceError : no board answers within that time
        ProblemError : not a number
        """
        within, begun, most = number("within", within), time.monotonic(), min(self.timeout, _GREETING_S)
        while True:
            self.close()
            try:
                self._open(most)
                self.faults.clear()
                return self._greeting(most)
            except (OSError, DeviceError) as error:
                if time.monotonic() - begun >= within:
                    why = (
                        f"{error.filename}: {error.strerror}"
                        if isinstance(error, OSError) and error.strerror
                        else error
                    )
                    raise self._failed(f"no board answered within {within:g} s ({why})") from None
            time.sleep(_WAIT_S)

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
        return self.command(Command(_READ, integer("register", register, 0, 7)))

    @contextlib.contextmanager
    def floor(self, ticks: int) -> Iterator[None]:
        """Set the noise floor within a context, for example for a tare; the previous floor is restored at its end.

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
        self._line = None

    def _open(self, within: float) -> None:
        line = _core.SerialLine(self.place, self._baud, within)
        self._line, self._name, self._lines = line, line.name, TextLines(_LONGEST)

    def _greeting(self, most: float) -> Greeting:
        greeting = self._ask(
            Command(_READ, _GREET), most, lambda kind, parts: Greeting(**parts) if kind == "greeting" else None
        )
        # This greeting was requested, so it does not indicate a reset.
        self.resets -= 1
        return greeting

    def _ask(self, command: Command, most: float, answer: Callable[[str, Any], T | None]) -> T:
        """Send a command; return what `answer` finds first in the lines that follow."""
        # A line that arrived before the command is not its answer.
        self.listen()
        until, strange, data = time.monotonic() + most, self._strange, command.to_bytes()
        while True:
            if data and self._line is not None:
                data = data[self._line.write(data) :]
            left = until - time.monotonic()
            if left <= 0:
                raise self._silence(most, self._strange - strange)
            for kind, parts in self._receive(min(left, _FULL_S if data else _WAIT_S)) or ():
                found = answer(kind, parts)
                if found is not None:
                    return found

    def _receive(self, within: float) -> list[tuple[str, Any]] | None:
        """Return what the lines say that arrive within a time, s; None if nothing arrives. Count faults and resets."""
        if self._line is None:
            raise self._failed("the line is closed")
        data = self._line.read(within)
        if not data:
            return None
        self._strange += len(data.translate(None, _TEXT))
        said = [line for arrived in self._lines.push(data) if (line := arrived.text.strip())]
        self._recent.extend(said)
        statuses = [status for line in said if (status := _core.status_line(line)) is not None]
        self.resets += sum(kind == "greeting" for kind, _ in statuses)
        self.faults.update(parts for kind, parts in statuses if kind == "fault")
        return statuses

    def _silence(self, most: float, strange: int) -> DeviceError:
        why = "is this the board's serial line?"
        if strange and not self._name.startswith("TCP "):
            why = f"{strange} bytes arrived that are not text: is the board's baud rate {self._baud}?"
        return self._failed(f"no answer within {most:g} s: {why}")

    def _failed(self, text: str) -> DeviceError:
        return DeviceError(f"{self._name}: {text}")

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return escaped(f"Cable({self.place})")


class Device(contextlib.AbstractContextManager["Device"]):
    """Set a board by its registers' names, with their units; a context manager.

    Registers are read back after they are set. After the cable was pulled, the next call reconnects, and sets the
    registers again if the board was reset.

    Parameters
    ----------
    place : str
        A serial port (`ports` lists them), or host:port.
    array : Array, optional
        The sensor. Default: an array of the size that the board reports.
    baud : int, bits/s, from 300 to 4000000
        Baud rate of a serial port.
    timeout : float, s, above 0
        Longest time that the board may take to answer.
    patience : float, s
        Longest time to try to reconnect after the cable was pulled.

    Raises
    ------
    OSError : the line cannot be opened
    DeviceError : no board answers there, or a board of another size than `array`
    ProblemError : invalid arguments

    Examples
    --------
    >>> Device("nowhere")
    Traceback (most recent call last):
    taxel.ProblemError: place is "nowhere": must be a serial port (COM3, /dev/ttyACM0) or HOST:PORT
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
                raise DeviceError(
                    f"{place}: the board has {size[0]} x {size[1]} taxels, but the array is {self.array!r}"
                )
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
        """Set all registers except `record`, or a preset by its name; return the contents of the registers afterwards.

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
        >>> def answer(end=end, board=board, read=os.read, write=os.write):
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
            raise DeviceError(f"{self.cable.place}: the board's registers differ from what was written: {differing}")
        self._set = target
        return now

    def _record(self, start: bool) -> Registers:
        word = self.cable.read(7)
        self.cable.command(Command(7, word | _RECORD if start else word & ~_RECORD))
        return self._read()
