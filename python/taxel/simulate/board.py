"""The emulated board, as a state machine: trip times and commands in, datagrams and status lines out."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import buffer_bytes, flag, instance, integer, numbers, text
from taxel._base.errors import refused
from taxel._base.messages import escaped, plain
from taxel._base.options import option
from taxel._core import DeviceError
from taxel.array import Array
from taxel.simulate.circuit import Circuit
from taxel.wire import Registers

__all__ = ["NOT_RETURNED", "Board", "Version2", "board_options", "fitting", "lines_of", "pattern"]

#: The trip time of a comparator that had not returned when the ramp began: a fault, not a value.
NOT_RETURNED = 65_535

#: Lines that the thesis' presets are made for.
_THESIS_LINES = 64


@dataclass(frozen=True)
class Version2:
    """The options of a board that sends version 2 of the wire.

    Parameters
    ----------
    board : int, 0 to 65535
        Number of the board in version 2 of the wire: together with the sender's address it identifies a source.
    seed : int, 0 to 65535
        Number of the first session; each reset increases it by one.
    hold_us : int, us
        Time that events wait for others in their datagram: 1000 makes sparse scenes a quarter smaller, and all events
        up to 1 ms later.
    heartbeat_us : int, us
        Interval at which the board reports that nothing has happened; for 0.1 s after an event it does so in each
        frame.
    states_us : int, us
        Interval at which each value and the board's totals are sent again; 0: never.

    Raises
    ------
    ProblemError : a value out of its range

    Examples
    --------
    >>> Version2(board=3).heartbeat_us
    10000
    """

    board: int = option(0, least=0, most=65_535)
    seed: int = option(1, least=0, most=65_535)
    hold_us: int = option(0, least=0, most=30_000)
    heartbeat_us: int = option(10_000, least=0, most=10**9)
    states_us: int = option(1_000_000, least=0, most=10**9)

    def __post_init__(self) -> None:
        for field in fields(self):
            integer(field.name, getattr(self, field.name), field.metadata["min"], field.metadata["max"])


def board_options(previous: str, intensity: str, version_2: Version2 | None, asynchronous: bool) -> dict[str, Any]:
    """Return the options of a board as the compiled part expects them."""
    return {
        "previous": text("previous", previous, ("last_sent", "last_sample")),
        "intensity": text("intensity", intensity, ("value", "difference", "nothing")),
        "version_2": asdict(instance("version_2", Version2() if version_2 is None else version_2, Version2)),
        "asynchronous": flag("asynchronous", asynchronous),
    }


def lines_of(circuit: Circuit | None, asynchronous: bool) -> dict[str, Any] | None:
    """Return the lines through which taxels are read, as the compiled part expects them.

    Raises
    ------
    ProblemError : a circuit between taxels that compare by themselves
    """
    lines = None if circuit is None else instance("circuit", circuit, Circuit)._plain()
    if flag("asynchronous", asynchronous) and lines is not None:
        raise refused("asynchronous", ": must be left out if circuit is given, because these taxels share no lines")
    return lines


def fitting(preset: str | None, array: Array) -> Registers:
    """Return a preset with as many lines as an array has; default: "5.2 kHz", or that of a larger board at reset.

    Raises
    ------
    ProblemError : no such preset for an array of that size
    DeviceError : the array has more lines than the preset reads
    """
    if preset is None:
        if max(array.shape) > _THESIS_LINES:
            return Registers(array=array)
        preset = "5.2 kHz"
    values = _core.registers_preset(text("preset", preset), array)
    try:
        return Registers._of(values, array)
    except DeviceError as error:
        size = f"{array.rows} x {array.columns} taxels"
        raise DeviceError(f'preset "{preset}" cannot read {size}: {error}') from None


def pattern(frame: int, *, array: Array | None = None, ramp: int = 150) -> NDArray[np.uint16]:
    """Return what a board whose register `pattern` is set reads, instead of its comparators' values.

    Parameters
    ----------
    frame : int, 0 or more
        Frames since the pattern began; it repeats after 65536.
    array : Array, optional
        The sensor; default: the thesis' 64 x 64.
    ramp : int, ticks, 1 to 65534
        Value of the register `ramp`.

    Returns
    -------
    uint16, shape (rows, columns), ticks

    Raises
    ------
    ProblemError : a number out of these ranges

    Notes
    -----
    The formula is in *Registers*, *The pattern*.

    Examples
    --------
    >>> pattern(0)[:3, :3]
    array([[128, 112,  96],
           [112, 104,  88],
           [ 96,  88,  80]], dtype=uint16)
    """
    sensor = Array._of(array)
    y, x = (place.ravel().astype(np.uint16) for place in np.indices(sensor.shape))
    n = np.full(x.size, integer("frame", frame, 0) % 65_536, np.uint16)
    values = _core.pattern_values(sensor, x, y, n, integer("ramp", ramp, 1, 65_534))
    return values.reshape(sensor.shape)


class Board:
    """Emulate the board: scan frames of trip times into the datagrams that the real board would send.

    It has no clock: each frame advances its time. The logic on the FPGA keeps the same contract.

    Parameters
    ----------
    registers : Registers, optional
        Its registers at first. Default: as at reset; for 64 x 64 taxels the preset "5.2 kHz".
    array : Array, optional
        Up to 65 536 positions. Default: the thesis' array.
    previous : {"last_sent", "last_sample"}
        The value that a new value is compared with.
    intensity : {"value", "difference", "nothing"}
        Content of an intensity word.
    queue : int, words, 0 or more
        Room for words; a taxel whose two words find no room is dropped and counted.
    version_2 : Version2, optional
        Options of version 2 of the wire.
    circuit : Circuit, optional
        Lines that its taxels share, settling, comparators with hysteresis: the values given to `frame` pass through it
        first. Default: each taxel is read by itself. The converter's times are those of the registers.
    asynchronous : bool
        Each taxel compares by itself with what it sent last; nothing is scanned, and stamps are of 1 us, so the
        registers must hold version 2 of the wire (thesis 4.5, Table 7.1). It sends each step of ``noise_floor + 1``
        ticks when it reaches it. Its readings between two frames are on a straight line, so events leave a frame after
        they happened, with the time at which they did. Such taxels share no lines, so `circuit` must be left out.

    Raises
    ------
    ProblemError, DeviceError : arguments or registers that are invalid

    Notes
    -----
    +

    What a new value is compared with (`previous`) is open in thesis 4.3; the board's own rule is in `docs/wire.md`.

    Examples
    --------
    >>> board = Board()
    >>> ticks = np.zeros(4096, np.uint16)
    >>> board.frame(ticks)
    []
    >>> ticks[board.array.index(3, 4)] = 40
    >>> [datagram.hex(" ", 5) for datagram in board.frame(ticks)]
    ['c000010304 e000280304']
    """

    def __init__(
        self,
        registers: Registers | None = None,
        array: Array | None = None,
        *,
        previous: Literal["last_sent", "last_sample"] = "last_sent",
        intensity: Literal["value", "difference", "nothing"] = "value",
        queue: int = 16_384,
        version_2: Version2 | None = None,
        circuit: Circuit | None = None,
        asynchronous: bool = False,
    ) -> None:
        self.array = Array._of(array)
        start = Registers(array=self.array) if registers is None else instance("registers", registers, Registers)
        board = board_options(previous, intensity, version_2, asynchronous)
        board["queue"] = integer("queue", queue, 0, 2**32)
        options = {"board": board, "circuit": lines_of(circuit, asynchronous)}
        self._core = _core.WireBoard(start._json(), self.array, json.dumps(options))

    def frame(self, ticks: ArrayLike, *, most: int | None = None, accepted: ArrayLike | None = None) -> list[bytes]:
        """Scan one frame; return the datagrams that were sent.

        Parameters
        ----------
        ticks : uint16, shape (rows * columns,) or (rows, columns), ticks
            Trip times of the comparators by taxel, in 1/300 us from the ramp's start. A time at or above the ramp's
            length reads as that length; `NOT_RETURNED` is a fault.
        most : int, 0 or more, optional
            Number of datagrams that the network takes during this frame; the others wait in the queue.
        accepted : bool, shape as of `ticks`, optional
            Taxels whose events find room in the queue; events of the others are dropped and counted. Default: all, as
            far as `queue` has room.

        Returns
        -------
        list of bytes, at most 1400 each

        Raises
        ------
        ProblemError : not one trip time, or one flag, for each taxel

        Examples
        --------
        >>> [len(datagram) for datagram in Board().frame(np.full((64, 64), 100, np.uint16))][:1]
        [1400]
        """
        at_most = 2**32 if most is None else integer("most", most, 0, 2**32)
        given = numbers("ticks", ticks, np.uint16).reshape(-1)
        flags = None if accepted is None else numbers("accepted", accepted, np.bool_).reshape(-1)
        return self._core.frame(given, at_most, flags)

    def reset(self) -> None:
        """Reset it, in a new session.

        Registers are those of a board at reset, with the version of the wire that this board had at first; values, time
        and the counts of its status lines are 0. Datagrams that wait are still sent; the one that is being filled is
        discarded, with the events held in it.
        """
        self._core.reset()

    def command(self, data: Any) -> str:
        """Take command bytes as they come; return the status lines that answer them.

        Parameters
        ----------
        data : bytes
            Five bytes for each command; an incomplete command waits for its other bytes.

        Raises
        ------
        ProblemError : not bytes

        Examples
        --------
        >>> len(Board().command(bytes.fromhex("e000000000"))) > 0
        True
        """
        return self._core.command(buffer_bytes(data))

    def record(self, start: bool) -> None:
        """Start or stop a recording; if that changes anything, the board sends a marker.

        Parameters
        ----------
        start : bool

        Raises
        ------
        ProblemError : neither true nor false
        """
        self._core.record(flag("start", start))

    def faults(self) -> str:
        """Return a status line for each fault whose count has changed since the last call."""
        return self._core.faults()

    @property
    def greeting(self) -> str:
        """The line that the board sends at reset."""
        return self._core.greeting()

    @property
    def time_us(self) -> float:
        """The start of the next frame since reset, us."""
        return self._core.time_us()

    @property
    def registers(self) -> Registers:
        """The registers as written; the scan uses them from the next frame."""
        return Registers._of(self._core.registers(), self.array)

    @property
    def counts(self) -> dict[str, int]:
        """Frames, changes, words, datagrams, words sent, taxels dropped, comparators not returned."""
        return self._core.counts()

    def __repr__(self) -> str:
        return escaped(f"Board({self.greeting.strip()}, {plain(self.time_us)} us after reset)")
