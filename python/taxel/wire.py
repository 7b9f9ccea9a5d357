"""Bytes to events and back: the board's wire, version 1 (thesis, Appendix 1, sections 3 to 5)."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import column, flag, instance, number, several, shown, text, whole
from taxel._base.columns import frozen
from taxel._core import DeviceError, ProblemError
from taxel.array import Array
from taxel.events import Events

__all__ = [
    "FRAME_US",
    "PRESETS",
    "Columns",
    "Command",
    "Counts",
    "Decoder",
    "Registers",
    "decode",
    "described",
    "encode",
]

#: The names that `Registers.preset` knows.
PRESETS: tuple[str, ...] = tuple(_core.registers_presets())

_PAIRINGS = ("direct", "taxel")

#: Rows from which on NumPy asks for large pages for the narrowest column too (from 4 MB on): the first write to each
#: small page costs more than what is written there.
_LARGE = 1 << 22


def _bytes(data: object) -> NDArray[np.uint8]:
    """Return the bytes of anything with a contiguous buffer, without a copy."""
    if isinstance(data, np.ndarray) and data.dtype != np.uint8:
        raise ProblemError(f"data is an array of {data.dtype}: must be bytes or uint8")
    try:
        view = memoryview(data)  # type: ignore[arg-type]
        return np.frombuffer(view.cast("B"), np.uint8) if view.nbytes else np.empty(0, np.uint8)
    except (TypeError, ValueError, BufferError):
        raise ProblemError(f"data is {shown(data)}: must be bytes, or anything with a contiguous buffer") from None


def _on_a_line(n: int, dtype: Any) -> NDArray[Any]:
    """Return memory for n values that begins on a cache line, as the decoder writes whole lines fastest."""
    size = np.dtype(dtype).itemsize
    memory = np.empty(n + 64 // size, dtype)
    first = -memory.__array_interface__["data"][0] % 64 // size
    return memory[first : first + n]


def _rows(data: NDArray[np.uint8]) -> int:
    """Return how many events bytes may hold, with what waits from before."""
    return len(data) // 5 + 2


def encode(events: Events) -> bytes:
    """Write events as bytes: each change, its intensity next to it, markers before the first event not earlier.

    Parameters
    ----------
    events : Events
        On columns and rows 0 to 63.

    Returns
    -------
    bytes, 5 a change, 5 an intensity, 5 a marker

    Raises
    ------
    ProblemError : a column or row above 63, which version 1 cannot say

    Notes
    -----
    Table 5.4. Version 1 holds times to 100 us, cut down as the board counts, and modulo 6.5536 s: a reader gets back
    whole silences of up to 6.45 s.

    Examples
    --------
    >>> events = Events([500], [3], [4], [True], array=Array(64, 64), intensity=[40])
    >>> encode(events).hex(" ", 5)
    'c000050304 e000280304'
    """
    return _core.wire_encode(instance("events", events, Events)._parts())


def decode(
    data: Any,
    *,
    array: Array | None = None,
    pairing: Literal["direct", "taxel"] = "direct",
    differences: bool = False,
    lengths: ArrayLike | None = None,
    columns: Columns | None = None,
) -> Events:
    """Read a whole stream of bytes; see `Decoder`, which also counts what is dropped.

    Parameters
    ----------
    data : bytes, or anything with a contiguous buffer
    array : Array, optional
        The sensor; the thesis' 64 x 64 where it is left out.
    pairing : {"direct", "taxel"}
    differences : bool
    lengths : array of int, shape (datagrams,), optional
        Bytes of each datagram, where `data` is datagrams one behind the other: then each is heard by itself, so that no
        intensity belongs to a change of the datagram before.
    columns : Columns, optional
        Memory that is used again, with room for ``len(data) // 5 + 2`` events: the events are views of it, good until
        it is filled again. With pairing "taxel", and where it is left out, they have memory of their own.

    Returns
    -------
    Events

    Raises
    ------
    ProblemError : an argument that makes no sense; damage in the bytes is no error

    Examples
    --------
    >>> decode(bytes.fromhex("c000050304 e000280304"))
    Events(1 events, 500 to 500 us, 64 x 64 taxels, 1 intensities)
    """
    decoder = Decoder(array=array, pairing=pairing, differences=differences)
    stream = _bytes(data)
    room, own = Columns._asked_for(columns, _rows(stream))
    if lengths is not None:
        each = column("lengths", lengths, np.int64)
        rows, paired, markers = decoder._core.fill_datagrams(stream, each, room._parts())
    else:
        rows, paired, markers = decoder._fill(room, stream, None, last=pairing == "direct")
    events = (room._given if own else room._first)(decoder.array, rows, paired, None, markers)
    if pairing == "taxel":
        heard, events = events.markers, decoder.finish()
        events.markers = heard
    return events


@dataclass(frozen=True)
class Counts:
    """Say what a decoder saw, and all that it dropped, by cause.

    The sums close at any time: ``bytes == 5 * words + skipped``, and ``words == changes + intensities + unpaired +
    markers + contradictory + outside``. The bytes of a word that is not complete count when it is, or is given up.

    Parameters
    ----------
    bytes, words : int
        Bytes read, and complete words.
    skipped : int
        Bytes that belong to no complete word.
    short : int
        Events cut off by the next first byte, or by the end.
    changes : int
        Changes on the array: the rows of `Events`.
    intensities, unpaired : int
        Intensities that found their change, and those that did not.
    markers : int
        Starts and stops.
    contradictory : int
        Words that say intensity and marker at once.
    outside : int
        Changes and intensities outside the array.
    back : int
        Changes and markers behind the latest time, which are kept.
    """

    bytes: int
    words: int
    skipped: int
    short: int
    changes: int
    intensities: int
    unpaired: int
    markers: int
    contradictory: int
    outside: int
    back: int


class Columns:
    """Keep memory for decoded events, to be filled again and again (`Decoder.push_into`, `decode`).

    Fresh memory costs more than decoding: the first write to each page is a call of the kernel.

    Parameters
    ----------
    rows : int, 1 or more
        How many events there is room for; ``len(data) // 5 + 2`` is enough for `data`.

    Raises
    ------
    ProblemError : no whole number, or below 1

    Examples
    --------
    >>> columns, decoder = Columns(1000), Decoder()
    >>> decoder.push_into(columns, bytes.fromhex("c000050304 c000060304"))
    Events(1 events, 500 to 500 us, 64 x 64 taxels, no intensities)
    """

    def __init__(self, rows: int) -> None:
        self._lay_out(whole("rows", rows, 1, 2**48), _on_a_line)

    def _lay_out(self, n: int, memory: Callable[[int, Any], NDArray[Any]]) -> None:
        try:
            self.t: NDArray[np.int64] = memory(n, np.int64)
            self.x: NDArray[np.uint16] = memory(n, np.uint16)
            self.y: NDArray[np.uint16] = memory(n, np.uint16)
            self.intensity: NDArray[np.uint16] = memory(n, np.uint16)
            self.p: NDArray[np.bool_] = memory(n, np.bool_)
            self.present: NDArray[np.bool_] = memory(n, np.bool_)
        except MemoryError:
            raise ProblemError(f"rows is {n}: there is no memory for so many") from None

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"Columns(room for {len(self)} events)"

    def _parts(
        self,
    ) -> tuple[
        NDArray[np.int64],
        NDArray[np.uint16],
        NDArray[np.uint16],
        NDArray[np.uint16],
        NDArray[np.uint8],
        NDArray[np.uint8],
    ]:
        p, present = self.p.view(np.uint8), self.present.view(np.uint8)
        return self.t, self.x, self.y, self.intensity, p, present

    @classmethod
    def _fresh(cls, rows: int) -> Columns:
        """Return columns with room for `rows` events, to be filled once (`_given`), which own their memory whole."""
        columns = cls.__new__(cls)
        columns._lay_out(max(rows, _LARGE) if rows >= _LARGE // 4 else rows, np.empty)
        return columns

    @classmethod
    def _asked_for(cls, columns: Columns | None, rows: int) -> tuple[Columns, bool]:
        """Return the caller's columns, or fresh ones for so many rows; and whether they are fresh."""
        return (cls._fresh(rows), True) if columns is None else (instance("columns", columns, cls), False)

    def _first(
        self,
        array: Array,
        rows: int,
        paired: bool,
        repaired: NDArray[np.bool_] | None,
        markers: Sequence[tuple[int, bool]],
    ) -> Events:
        """Return the first rows as events that are views of the columns."""
        ticks, present = (self.intensity[:rows], self.present[:rows]) if paired else (None, None)
        t, x, y, p = self.t[:rows], self.x[:rows], self.y[:rows], self.p[:rows]
        return Events._unchecked(t, x, y, p, array, ticks, present, repaired, tuple(markers))

    def _given(
        self,
        array: Array,
        rows: int,
        paired: bool,
        repaired: NDArray[np.bool_] | None,
        markers: Sequence[tuple[int, bool]],
    ) -> Events:
        """Return the first rows as events that own the columns; memory that no event needs is given back."""
        for filled in vars(self).values():
            filled.resize(rows, refcheck=False)
            frozen(filled)
        return self._first(array, rows, paired, repaired, markers)


class Decoder:
    """Turn bytes into events as they come: the same events wherever the bytes are cut.

    Damage is never an error: the decoder finds its place at the next first byte and counts what it skipped
    (`counts`). A change waits for the next word, which may be its intensity, for the end of its datagram
    (`end_of_datagram`) or of the stream (`finish`), and no longer.

    Parameters
    ----------
    array : Array, optional
        The sensor; the thesis' 64 x 64 where it is left out. Events outside it are counted and dropped.
    pairing : {"direct", "taxel"}
        Which change an intensity belongs to. "direct": the word before it, if that is a change of the same taxel.
        "taxel": the latest change of that taxel that has none yet, for boards that order otherwise; all events then
        wait for `finish`, so it is for whole recordings.
    differences : bool
        Whether intensities are differences from the last value sent (the panel's "delta intensity"), which bytes do
        not show. They are then added up from 0, so that `Events` hold values; right from the board's reset on and
        until an intensity is lost.

    Raises
    ------
    ProblemError : an argument that makes no sense

    Notes
    -----
    Table 5.4. Time is unwrapped into 64 bits: a stamp up to 0.1 s behind the latest time is a step back (counted,
    kept), any other lies ahead, so silences of up to 6.45 s are right. Arrival times tell how long a longer one was.

    Examples
    --------
    >>> decoder = Decoder()
    >>> decoder.push(bytes.fromhex("c000050304 e00028"))
    Events(0 events, no time, 64 x 64 taxels, no intensities)
    >>> decoder.push(bytes.fromhex("0304"))
    Events(1 events, 500 to 500 us, 64 x 64 taxels, 1 intensities)
    >>> decoder.finish()
    Events(0 events, no time, 64 x 64 taxels, no intensities)
    >>> decoder.counts.words, decoder.counts.skipped
    (2, 0)
    """

    def __init__(
        self,
        *,
        array: Array | None = None,
        pairing: Literal["direct", "taxel"] = "direct",
        differences: bool = False,
    ) -> None:
        self.array = Array._of(array)
        text("pairing", pairing, _PAIRINGS)
        self._core = _core.WireDecoder(self.array._parts(), pairing, flag("differences", differences))

    def push(self, data: Any, arrived: int | None = None) -> Events:
        """Take the next bytes; return the events that they complete.

        Parameters
        ----------
        data : bytes, or anything with a contiguous buffer
        arrived : int, us, optional
            The host's clock when the bytes came. It chooses the wrap of the 16-bit time after a silence of more than
            6.45 s.

        Returns
        -------
        Events

        Raises
        ------
        ProblemError : `data` is not bytes, or `arrived` not a whole number
        """
        return self._take(data, arrived, last=False)

    def _take(self, data: Any, arrived: int | None, *, last: bool) -> Events:
        """Return the events of bytes, which may be the last ones, in memory of their own."""
        data = _bytes(data)
        columns = Columns._fresh(_rows(data))
        rows, paired, markers = self._fill(columns, data, arrived, last=last)
        return columns._given(self.array, rows, paired, None, markers)

    def push_into(self, columns: Columns, data: Any, arrived: int | None = None) -> Events:
        """Take the next bytes into memory that is used again; return the events as views of it.

        The events are good until the columns are filled again: copy what is to be kept.

        Parameters
        ----------
        columns : Columns
            With room for ``len(data) // 5 + 2`` events.
        data : bytes, or anything with a contiguous buffer
        arrived : int, us, optional
            As in `push`.

        Returns
        -------
        Events

        Raises
        ------
        ProblemError : too little room, or as `push`
        """
        rows, paired, markers = self._fill(instance("columns", columns, Columns), _bytes(data), arrived, last=False)
        return columns._first(self.array, rows, paired, None, markers)

    def _fill(
        self, columns: Columns, data: NDArray[np.uint8], arrived: int | None, *, last: bool
    ) -> tuple[int, bool, list[tuple[int, bool]]]:
        """Fill columns, and end the stream where it is the last; return rows, whether with intensities, markers."""
        when = None if arrived is None else whole("arrived", arrived)
        return self._core.fill(data, when, columns._parts(), last)

    def end_of_datagram(self) -> Events:
        """Say that a datagram ends here; return the change that waited for its intensity, if there is one."""
        return Events._from_parts(self._core.end_of_datagram(), self.array)

    def finish(self) -> Events:
        """End the stream; return the rest. The decoder is then as new, but for its counts."""
        return Events._from_parts(self._core.finish(), self.array)

    @property
    def counts(self) -> Counts:
        """What was seen and dropped so far."""
        return Counts(*self._core.counts())

    def __repr__(self) -> str:
        c = self.counts
        return (
            f"Decoder({self.array.rows} x {self.array.columns} taxels, {c.changes} events, {c.skipped} bytes skipped)"
        )


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
    ProblemError : out of these ranges

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
        object.__setattr__(self, "register", whole("register", self.register, 0, 7))
        object.__setattr__(self, "value", whole("value", self.value, 0, 2**32 - 1))

    def to_bytes(self) -> bytes:
        """Return the five bytes."""
        return _core.command_bytes(self.register, self.value)

    @classmethod
    def from_bytes(cls, data: Any) -> Command:
        """Read five bytes.

        Raises
        ------
        FormatError : not five bytes, or a top bit out of place (names the byte)
        """
        return cls(*_core.command_read(_bytes(data)))


#: The fields as registers.toml has them, by name.
_FIELDS: dict[str, Any] = {field["name"]: field for field in json.loads(_core.registers_fields())}
#: Fields in units of 10 ns in the registers, in us here.
_TIMES = tuple(name for name, field in _FIELDS.items() if field["unit"] == "10 ns")
_FLAGS = tuple(name for name, field in _FIELDS.items() if field["unit"] == "flag")
_MANUAL = {field["manual"]: name for name, field in _FIELDS.items() if field["manual"] != name}


class Registers:
    """Hold what the board's registers say; a set that breaks a rule cannot be made.

    "Line" is the driven line, the outer step of the scan; "step" the inner one, the multiplexer's. The manual's names
    (`row_change_period`, `ramp_time`, `nrows` ...) are aliases, in the manual's units (10 ns, ticks, lines less one).

    Parameters
    ----------
    line_period, line_read : float, us
        Time from one driven line to the next, and the part of it in which the line is read.
    step_period, step_read : float, us
        Time from one multiplexer step to the next, and the part of it in which the channels are read.
    ramp : int, ticks of 1/300 us
        How long the ramp rises.
    noise_floor : int, ticks
        A difference above it makes an event.
    lines : int, 1 to 256
        Driven lines.
    random_lines, mechanoreceptor, invert_comparator, frame_sync, record : bool
    wire_version : {1, 2}
        Version 1 names 64 x 64 taxels at most.
    threshold_rest, threshold_jump, threshold_decay : int, in 1/1024, 1/256 theta_0, 1/1024 theta_0
        FA-1 on the board, where `mechanoreceptor` is set.
    channels : {16, 64}
        Of the converter: the board's build, not a register. A line of 64 taxels has 4 steps with 16, one with 64.
    array : Array, optional
        The sensor; the thesis' 64 x 64 where it is left out.

    Raises
    ------
    DeviceError : a rule is broken (says which, with the numbers)
    ProblemError : no such field, a value that is no number, a time that is no multiple of 0.01 us

    Notes
    -----
    Table 5.5 and the page *Registers*; what is left out is as a board of this array holds it at reset: up to 64 x 64
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
        channels = whole("channels", fields.get("channels", 16), 0, 255)
        self._set(json.loads(_core.registers_at_reset(sensor._parts(), channels)), fields, sensor)

    def _set(self, held: dict[str, Any], fields: dict[str, float], array: Array | None) -> None:
        self.array = Array._of(array)
        raw = [(name, _raw(name, value)) for name, value in fields.items()]
        self._held = json.loads(_core.registers_with(json.dumps(held), raw, self.array._parts()))

    @classmethod
    def preset(cls, name: str, *, array: Array | None = None) -> Registers:
        """Return one of `PRESETS`.

        Raises
        ------
        ProblemError : no such preset (names those that there are)
        DeviceError : the array has fewer lines than the preset drives
        """
        registers = cls.__new__(cls)
        registers._set(json.loads(_core.registers_preset(text("preset", name))), {}, array)
        return registers

    @classmethod
    def _of(cls, held: dict[str, Any], array: Array) -> Registers:
        """Return the set that a file or a board holds, in the registers' own units."""
        registers = cls.__new__(cls)
        registers._set(held, {}, array)
        return registers

    @classmethod
    def _of_source(cls, array: Array, rate_hz: float, bits: int) -> tuple[Registers, int]:
        """Return what a board holds that scans another sensor's frames, and how often it halves their values."""
        held, halved = _core.registers_of_source(array._parts(), rate_hz, bits)
        return cls._of(json.loads(held), array), halved

    @classmethod
    def from_words(cls, words: Sequence[int], *, array: Array | None = None, channels: int = 16) -> Registers:
        """Return the set that eight 32-bit registers hold, REG0 first; of REG6 nothing is looked at.

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
        held: dict[str, Any] = {"channels": whole("channels", channels, 0, 255)}
        eight = [whole(f"words[{n}]", word, 0, 2**32 - 1) for n, word in enumerate(several("words", words))]
        if len(eight) != 8:
            raise ProblemError(f"words: {len(eight)}, must be 8")
        for name, field in _FIELDS.items():
            value = (eight[field["register"]] >> field["shift"] & field["mask"]) + field["offset"]
            held[name] = bool(value) if name in _FLAGS else value
        return cls._of(held, Array._of(array))

    def replace(self, **fields: float) -> Registers:
        """Return a set with some fields changed, by taxel's names or the manual's.

        Raises
        ------
        DeviceError, ProblemError : as for a new set
        """
        registers = Registers.__new__(Registers)
        registers._set(self._held, fields, self.array)
        return registers

    def with_preset(self, name: str) -> Registers:
        """Return a set that took over one of `PRESETS`, with as many lines as the array has.

        A preset says neither which version of the wire the board speaks nor whether a recording runs: these stay, as
        do the channels, which are the board's build.

        Raises
        ------
        ProblemError : no such preset for boards of that size (names those that there are)
        DeviceError : the board could not hold it (names the rule)

        Examples
        --------
        >>> slow = Registers(wire_version=2).with_preset("2 kHz")
        >>> slow.line_period, slow.noise_floor, slow.wire_version
        (7.81, 10, 2)
        """
        named = text("preset", name)
        held = json.loads(_core.registers_with_preset(self._json(), named, self.array._parts()))
        return self._of(held, self.array)

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
        """What is allowed but hardly meant (rules 5 and 6), a line each."""
        return tuple(_core.registers_check(self._json(), self.array._parts()))

    def commands_to(self, target: Registers) -> list[Command]:
        """Return the writes that lead from this set to another, in an order in which none is refused on the way.

        `record` stays as it is: starting a recording is a command of its own.

        Raises
        ------
        DeviceError : the sets are for boards with different channels
        """
        other = instance("target", target, Registers)
        commands = _core.registers_commands(self._json(), other._json(), self.array._parts())
        return [Command(register, value) for register, value in commands]

    def _json(self) -> str:
        return json.dumps(self._held)

    def __getattr__(self, name: str) -> Any:
        held = self.__dict__.get("_held", {})
        if name in held:
            return held[name] / 100 if name in _TIMES else held[name]
        if name in _MANUAL and held:
            value = held[_MANUAL[name]]
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


def described(registers: Registers) -> list[tuple[str, float, str, str, str]]:
    """Return each field of a set: its name, value, unit, place in the registers, and what it is for.

    Examples
    --------
    >>> described(Registers())[9][:4]
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
        units = number(name, value) * 100
        if not abs(units - np.rint(units)) < 1e-6:
            raise ProblemError(f"{name} is {shown(value)} us: must be a whole multiple of 0.01 us")
        if not 0 <= units < 2**32:
            raise DeviceError(f"{name} {shown(value)} us does not fit its bits (rule 4)")
        return int(np.rint(units))
    if _MANUAL.get(name, name) in _FLAGS:
        return int(flag(name, bool(value) if isinstance(value, int) and value in (0, 1) else value))
    try:
        return whole(name, value, 0, 2**32 - 1)
    except ProblemError:
        # A number that a register's word could hold is judged by the rules, others here.
        field = _FIELDS.get(_MANUAL.get(name, name))
        if field is None:
            raise
        least, most = (field[end] - (field["offset"] if name in _MANUAL else 0) for end in ("least", "greatest"))
        raise ProblemError(f"{name} is {shown(value)}: must be a whole number from {least} to {most}") from None


#: The length of the board's frames at reset, us.
FRAME_US: float = Registers().frame_us
