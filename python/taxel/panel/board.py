"""The board behind the live source: its serial line, and its registers as far as they are known."""

from __future__ import annotations

import contextlib
import json
import threading
import time
from typing import Any

from taxel import _core
from taxel._base.errors import refused
from taxel._core import DeviceError, ProblemError
from taxel.array import Array
from taxel.device import Cable
from taxel.wire import Command, Registers

#: The registers that can be read; REG6 asks for them.
_READABLE = (0, 1, 2, 3, 4, 5, 7)

#: Value of REG7 while a recording runs (Table 5.5).
_RECORD = 1 << 16

#: How long another program may have the line that it took, s.
_TAKEN_S = 2.0

#: Registers that are not set by hand.
_APART = {"record": " is written when a recording starts or stops", "channels": " is a property of the board"}


class Board:
    """Read and write a board's registers over its serial line; methods that do so take long, and one does at a time.

    Parameters
    ----------
    cable : Cable or None
    """

    def __init__(self, cable: Cable | None) -> None:
        self._cable, self._resets = cable, 0
        self._lock = threading.Lock()
        #: In the registers' own units.
        self.registers: dict[str, Any] = Registers()._held
        #: Whether they were read from the board, and whether it has answered since it was connected.
        self.known = self._has_answered = False
        #: When the line was lost, s of the monotonic clock.
        self._lost_s: float | None = None

    @property
    def is_connected(self) -> bool:
        """Whether there is a serial line."""
        return self._cable is not None

    @property
    def place(self) -> str | None:
        """The place of the serial line."""
        return None if self._cable is None else self._cable.place

    def connect(self, cable: Cable) -> None:
        """Use a serial line from now on."""
        self._cable, self._resets, self._lost_s = cable, 0, None
        self.known = self._has_answered = False

    def close(self) -> None:
        """Close the serial line."""
        with self._lock:
            if self._cable is not None:
                self._cable.close()
                self._cable = None

    @property
    def is_due(self) -> bool:
        """Whether registers are read again: the board has answered once, or the line was lost a while ago."""
        lost_s = self._lost_s
        return self.is_connected and (self._has_answered if lost_s is None else time.monotonic() - lost_s > _TAKEN_S)

    def was_reset(self) -> bool:
        """Return whether the board has reported a reset since the last call."""
        with self._lock:
            if self._cable is None or self._lost_s is not None:
                return False
            try:
                self._cable.take_lines()
            except (DeviceError, OSError):
                self._lost_s = time.monotonic()
            before, self._resets = self._resets, self._cable.resets
            return before != self._resets

    def read(self, *, again: bool = False) -> None:
        """Read all registers; a line that was lost, as to another program, is opened again.

        Parameters
        ----------
        again : bool
            Whether the number of channels is known, for which a board without a greeting is waited for.

        Raises
        ------
        DeviceError : the line gives no answer, or is lost
        OSError : the line cannot be opened again
        """
        with self._lock:
            cable = self._connected()
            try:
                if self._lost_s is not None:
                    cable.reopen(within=0.0)
                    self._lost_s = None
                channels = self.registers["channels"]
                if not again:
                    # It is no register: it is in the board's greeting. A board without one has as many as it had.
                    with contextlib.suppress(DeviceError):
                        channels = cable.greeting().channels
                words = [cable.read(n) if n in _READABLE else 0 for n in range(8)]
            except (DeviceError, OSError) as error:
                self.known = False
                if isinstance(error, OSError) or self._lost_s is not None:
                    self._lost_s = time.monotonic()
                raise
            self.registers = _core.registers_of_words(words, channels)
            self.known = self._has_answered = True

    def set(self, values: dict[str, Any], array: Array) -> None:
        """Write registers by name; all, or none where a rule is broken."""
        fields = []
        for name, value in values.items():
            if type(value) not in (bool, int) or not 0 <= value < 2**32:
                raise refused(name, ": must be a whole number, 0 or more, in the unit of the register")
            if name in _APART:
                raise refused(name, _APART[name])
            fields.append((name, int(value)))
        self._know()
        try:
            self._write(_core.registers_with(json.dumps(self.registers), fields, array), array)
        except (DeviceError, ProblemError) as error:
            if error.argument is None:
                # A rule of several registers: the field is the one that its text names first.
                text = str(error)
                error.argument = min((n for n in values if n in text), key=text.index, default=None)
                error.args = (text.removeprefix(error.argument or ""),)
            raise

    def apply(self, preset: str, array: Array) -> None:
        """Write the registers of a preset."""
        self._know()
        self._write(_core.registers_with_preset(json.dumps(self.registers), preset, array), array)

    def record(self, on: bool) -> None:
        """Write the register that marks a recording."""
        with self._lock:
            self._connected().command(Command(7, _RECORD if on else 0))
        self.registers = self.registers | {"record": on}

    def _connected(self) -> Cable:
        if self._cable is None:
            raise ProblemError("the board's serial line is not connected: give --control to taxel live")
        return self._cable

    def _know(self) -> None:
        self._connected()
        if not self.known:
            self.read()

    def _write(self, target: dict[str, Any], array: Array) -> None:
        held = self.registers
        commands = _core.registers_commands(json.dumps(held), json.dumps(target), array)
        try:
            with self._lock:
                for register, value in commands:
                    self._connected().command(Command(register, value))
        except (DeviceError, OSError):
            # What the board holds now is not certain; the error is that of the write.
            self.known = False
            self.read()
            raise
        self.registers = target | {"record": held["record"]}
