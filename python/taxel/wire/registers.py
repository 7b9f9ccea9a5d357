"""The board's registers: sets, presets, rules, and the commands that set one (thesis, Appendix 1, Tables 5.1, 5.5)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel import _core
from taxel._base.arguments import buffer_bytes, finite, flag, instance, integer, several, shown, text
from taxel._base.errors import refused
from taxel._core import DeviceError, ProblemError
from taxel.array import Array

#: The names of the presets (`Registers.preset`).
PRESETS: tuple[str, ...] = tuple(_core.registers_presets())

#: The names of all presets, for error messages.
QUOTED_PRESETS = ", ".join(f'"{name}"' for name in PRESETS)

#: The fields of registers.toml by name.
_FIELDS: dict[str, Any] = {field["name"]: field for field in _core.registers_fields()}
#: The fields that the registers hold in units of 10 ns; here they are in us.
_TIMES = tuple(name for name, field in _FIELDS.items() if field["unit"] == "10 ns")
_FLAGS = tuple(name for name, field in _FIELDS.items() if field["unit"] == "flag")
_MANUAL = {field["manual"]: name for name, field in _FIELDS.items() if field["manual"] != name}


@dataclass(frozen=True)
class Command:
    """Set one of the board's 32-bit registers: five bytes on the serial line (Table 5.1).

    Parameters
    ----------
    register : int, 0 to 7
    value : int, 0 to 2**32 - 1
        The whole register.

    Raises
    ------
    ProblemError : a register or a value out of these ranges

    Notes
    -----
    Thesis, Appendix 1, Table 5.1.

    Examples
    --------
    >>> Command(1, 300).to_bytes().hex()
    '900000012c'
    >>> Command.from_bytes(bytes.fromhex("900000012c"))
    Command(register=1, value=300)
    """

    register: int
    value: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "register", integer("register", self.register, 0, 7))
        object.__setattr__(self, "value", integer("value", self.value, 0, 2**32 - 1))

    def to_bytes(self) -> bytes:
        """Return the five bytes.

        Returns
        -------
        bytes, 5

        Examples
        --------
        >>> list(Command(7, 1).to_bytes())
        [240, 0, 0, 0, 1]
        """
        return _core.command_bytes(self.register, self.value)

    @classmethod
    def from_bytes(cls, data: Any) -> Command:
        """Read five bytes.

        Parameters
        ----------
        data : bytes, or anything with a contiguous buffer

        Returns
        -------
        Command

        Raises
        ------
        ProblemError : `data` is not bytes
        FormatError : not five bytes, or a byte whose top bit is wrong (names the byte)

        Examples
        --------
        >>> Command.from_bytes(Command(4, 140).to_bytes()).value
        140
        """
        return cls(*_core.command_read(buffer_bytes(data)))


class Registers:
    """The values of the board's registers, checked against the rules.

    "Line" is the driven line, the outer step of the scan; "step" the inner one, the multiplexer's. The manual's names
    (`row_change_period`, `ramp_time`, `nrows` ...) are aliases, in the manual's units (10 ns, ticks, lines less one).

    Parameters
    ----------
    array : Array, optional
        The sensor; default: the thesis' 64 x 64.
    **fields : float
        The fields that differ from those of a board at reset, by the names below or the manual's.

    Other Parameters
    ----------------
    line_period, line_read : float, us
        Time from one driven line to the next, and the part of that time in which the line is read.
    step_period, step_read : float, us
        Time from one multiplexer step to the next, and the part of that time in which the channels are read.
    ramp : int, ticks of 1/300 us
        Duration of the ramp.
    noise_floor : int, ticks
        A difference above it causes an event.
    lines : int, 1 to 256
        Driven lines.
    random_lines, mechanoreceptor, invert_comparator, frame_sync, pattern, record : bool
        Whether the lines are driven in random order, each taxel is an FA-1 afferent, a falling edge ends a sample, all
        events of a frame have the time of its start, the values of a rolling ball replace the comparators', and the
        board is recording.
    wire_version : {1, 2}
        Version 1 can address 64 x 64 taxels at most.
    threshold_rest, threshold_jump, threshold_decay : int, in 1/1024, 1/256 theta_0, 1/1024 theta_0
        FA-1 on the board, where `mechanoreceptor` is set.
    channels : {16, 64}
        Number of channels of the converter, a property of the board and not a register. A line of 64 taxels has 4 steps
        with 16 channels, one with 64.

    Raises
    ------
    DeviceError : a rule is broken (names it, with the numbers)
    ProblemError : no such field, a value that is not a number, a time that is not a multiple of 0.01 us

    Notes
    -----
    Table 5.5 and the page *Registers*. Default values are those of a board of this array at reset: up to 64 x 64
    taxels the preset "5.2 kHz".

    Examples
    --------
    >>> fast = Registers.preset("5.2 kHz")
    >>> fast.frame_us, fast.line_period, fast.row_change_period
    (192.0, 3.0, 300)
    >>> [command.register for command in fast.commands_to(Registers.preset("2 kHz"))]
    [1, 2, 3, 4, 5]
    >>> fast.replace(line_read=3.2)
    Traceback (most recent call last):
    taxel.DeviceError: line_read 3.20 us is longer than line_period 3.00 us (rule 1)
    """

    _held: dict[str, Any]

    def __init__(self, *, array: Array | None = None, **fields: float) -> None:
        sensor = Array._of(array)
        channels = integer("channels", fields.get("channels", 16), 0, 255)
        self._set(_core.registers_at_reset(sensor, channels), fields, sensor)

    def _set(self, values: dict[str, Any], fields: dict[str, float], array: Array | None) -> None:
        self.array = Array._of(array)
        raw = [(name, _raw(name, value)) for name, value in fields.items()]
        self._held = _core.registers_with(json.dumps(values), raw, self.array)

    @classmethod
    def preset(cls, name: str, *, array: Array | None = None) -> Registers:
        """Return one of `PRESETS`.

        Parameters
        ----------
        name : str, one of `PRESETS`
        array : Array, optional
            The sensor; default: the thesis' 64 x 64.

        Returns
        -------
        Registers

        Raises
        ------
        ProblemError : no such preset (names those that there are)
        DeviceError : the array has fewer lines than the preset drives

        Examples
        --------
        >>> Registers.preset("2 kHz").noise_floor
        10
        """
        return cls._of(_core.registers_preset(text("preset", name)), Array._of(array))

    @classmethod
    def _of(cls, values: dict[str, Any], array: Array, **fields: float) -> Registers:
        """Return the set that a board holds, in the registers' own units, with some fields changed."""
        registers = cls.__new__(cls)
        registers._set(values, fields, array)
        return registers

    @classmethod
    def _of_file(cls, values: dict[str, Any], array: Array) -> Registers:
        """Return the set that a file holds, in the registers' own units: its board may have had other rules."""
        registers = cls.__new__(cls)
        registers.array = array
        registers._held = _core.registers_of_file(json.dumps(values), array)
        return registers

    @classmethod
    def _of_source(cls, array: Array, rate_hz: float, bits: int) -> tuple[Registers, int]:
        """Return the registers of a board that scans another sensor's frames, and how often it halves their values."""
        values, halved = _core.registers_of_source(array, rate_hz, bits)
        return cls._of(values, array), halved

    @classmethod
    def from_words(cls, words: Sequence[int], *, array: Array | None = None, channels: int = 16) -> Registers:
        """Return the set that eight 32-bit registers hold, REG0 first; REG6 has no field.

        Parameters
        ----------
        words : sequence of int, shape (8,), 0 to 2**32 - 1
        array : Array, optional
            The sensor; default: the thesis' 64 x 64.
        channels : {16, 64}
            The number of channels of the converter, a property of the board and not a register.

        Returns
        -------
        Registers

        Raises
        ------
        DeviceError : they break a rule
        ProblemError : not eight numbers of 32 bits

        Examples
        --------
        >>> fast = Registers.preset("5.2 kHz")
        >>> Registers.from_words(fast.words) == fast
        True
        """
        eight = [integer(f"words[{n}]", word, 0, 2**32 - 1) for n, word in enumerate(several("words", words))]
        if len(eight) != 8:
            raise refused("words", f": {len(eight)} words; must be 8")
        values = _core.registers_of_words(eight, integer("channels", channels, 0, 255))
        return cls._of(values, Array._of(array))

    def replace(self, **fields: float) -> Registers:
        """Return a set with some fields changed, by taxel's names or the manual's.

        Parameters
        ----------
        **fields : float
            As in the constructor.

        Returns
        -------
        Registers

        Raises
        ------
        DeviceError, ProblemError : as for a new set

        Examples
        --------
        >>> Registers().replace(noise_floor=7).noise_floor
        7
        """
        return self._of(self._held, self.array, **fields)

    def with_preset(self, name: str) -> Registers:
        """Return a set with the values of one of `PRESETS`, with as many lines as the array has.

        A preset sets neither the version of the wire nor `record`: these stay, as do the channels, which are a property
        of the board.

        Parameters
        ----------
        name : str, one of `PRESETS`

        Returns
        -------
        Registers

        Raises
        ------
        ProblemError : no such preset for boards of that size (names those that there are)
        DeviceError : the result breaks a rule (names it)

        Examples
        --------
        >>> slow = Registers(wire_version=2).with_preset("2 kHz")
        >>> slow.line_period, slow.noise_floor, slow.wire_version
        (7.81, 10, 2)
        """
        preset = text("preset", name)
        values = _core.registers_with_preset(self._json(), preset, self.array)
        return self._of(values, self.array)

    @property
    def frame_us(self) -> float:
        """A frame's length, us: lines times line period."""
        return _core.registers_words(self._json())[1]

    @property
    def words(self) -> tuple[int, ...]:
        """The eight 32-bit registers, REG0 first."""
        return tuple(_core.registers_words(self._json())[0])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Values that are allowed but probably mistakes, a line each."""
        return tuple(_core.registers_warnings(self._json()))

    def commands_to(self, target: Registers) -> list[Command]:
        """Return the writes that change this set into another, in an order in which the board refuses none.

        `record` stays as it is: starting a recording is a separate command.

        Parameters
        ----------
        target : Registers

        Returns
        -------
        list of Command

        Raises
        ------
        DeviceError : the sets are for boards with different channels
        ProblemError : `target` is not `Registers`

        Examples
        --------
        >>> now = Registers()
        >>> now.commands_to(now.replace(noise_floor=7))
        [Command(register=5, value=4130560)]
        """
        wanted = instance("target", target, Registers)
        commands = _core.registers_commands(self._json(), wanted._json(), self.array)
        return [Command(register, value) for register, value in commands]

    def _json(self) -> str:
        return json.dumps(self._held)

    def __getattr__(self, name: str) -> Any:
        values = self.__dict__.get("_held", {})
        if name in values:
            return values[name] / 100 if name in _TIMES else values[name]
        if name in _MANUAL and values:
            value = values[_MANUAL[name]]
            return int(value) - _FIELDS[_MANUAL[name]]["offset"]
        raise AttributeError(f"Registers have no {name!r}")

    def __dir__(self) -> Sequence[str]:
        return [*super().__dir__(), *self._held, *_MANUAL]

    def __eq__(self, other: object) -> bool:
        return self._held == other._held if isinstance(other, Registers) else NotImplemented

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        fields = (f"{name}={getattr(self, name)}" for name in self._held)
        return f"Registers({', '.join(fields)})"


def fitting_presets(held: Mapping[str, Any], array: Array | None) -> Iterator[str]:
    """Yield the names of the presets that a board of an array can hold, all of them without a board."""
    for name in PRESETS:
        if array is not None:
            try:
                wanted = _core.registers_with_preset(json.dumps(held), name, array)
                _core.registers_with(json.dumps(wanted), [], array)
            except _core.Error:
                continue
        yield name


def preset_of(held: Mapping[str, Any], array: Array | None) -> str | None:
    """Return the name of the preset that registers are, whatever the version of the wire; None of other values."""
    held = {**held, "record": False}
    for name in fitting_presets(held, array):
        if array is None:
            preset = _core.registers_preset(name)
        else:
            preset = _core.registers_with_preset(json.dumps(held), name, array)
        if held == preset:
            return name
    return None


def fields_of_registers() -> list[dict[str, Any]]:
    """Return the fields of the registers, each with what a slider reaches: four times what any preset needs."""
    presets = [_core.registers_preset(name) for name in PRESETS]
    keys = ("name", "manual", "text", "unit", "least", "greatest")
    return [
        {key: field[key] for key in keys}
        | {"top": min(field["greatest"], max(255, 4 * max(int(preset[name]) for preset in presets)))}
        for name, field in _FIELDS.items()
    ]


def described(registers: Registers) -> list[tuple[str, float, str, str, str]]:
    """Return each field of a set: its name, value, unit, place in the registers, and description.

    Parameters
    ----------
    registers : Registers

    Returns
    -------
    list of (name, value, unit, place, text), one a field, in the order of the registers

    Raises
    ------
    ProblemError : not Registers

    Examples
    --------
    >>> described(Registers())[10][:4]
    ('step_read', 0.55, 'us', 'REG3[31:16]')
    """
    held, rows = instance("registers", registers, Registers), []
    for name, field in _FIELDS.items():
        low, high = field["shift"], field["shift"] + int(field["mask"]).bit_length() - 1
        bits = f"{high}:{low}" if high > low else f"{low}"
        unit = {"10 ns": "us", "flag": ""}.get(field["unit"], field["unit"])
        rows.append((name, float(getattr(held, name)), unit, f"REG{field['register']}[{bits}]", field["text"]))
    return rows


def _raw(name: str, value: object) -> int:
    """Return a field's value in the register's own unit."""
    if name in _TIMES:
        units = finite(name, value) * 100
        if not 0 <= units < 2**32:
            error = DeviceError(f" {shown(value)} us does not fit into the bits of its register (rule 4)")
            error.argument = name
            raise error
        if not abs(units - np.rint(units)) < 1e-6:
            raise refused(name, f" is {shown(value)} us: must be a whole multiple of 0.01 us")
        return int(np.rint(units))
    if _MANUAL.get(name, name) in _FLAGS:
        return int(flag(name, bool(value) if isinstance(value, int) and value in (0, 1) else value))
    try:
        return integer(name, value, 0, 2**32 - 1)
    except ProblemError:
        # The rules check numbers that fit a register's word; others are refused here.
        field = _FIELDS.get(_MANUAL.get(name, name))
        if field is None:
            raise
        least, most = (field[end] - (field["offset"] if name in _MANUAL else 0) for end in ("least", "greatest"))
        raise refused(name, f" is {shown(value)}: must be a whole number from {least} to {most}") from None


#: The length of the board's frames at reset, us.
FRAME_US: float = Registers().frame_us
