"""Datagrams to events: version 2 of the wire, which shows every loss (docs: *Wire version 2*)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import whole
from taxel.array import Array
from taxel.events import Events
from taxel.wire import Columns, _bytes

__all__ = ["Counts", "Decoder", "Heard", "Status", "StreamReader", "decode"]


@dataclass(frozen=True)
class Counts:
    """Say what a decoder heard, and all that it missed, by cause.

    The sums close: ``datagrams == intact + repeated + old + short + foreign + checksum``.

    Parameters
    ----------
    datagrams, intact : int
        Given to the decoder, and decoded.
    repeated, old : int
        Came again; came more than 65 536 numbers late, so that nobody can tell.
    short, foreign, checksum : int
        Refused: too short, not of version 2 or of another board, damaged.
    missing : int
        Numbers between the first and the last of each session that never came intact.
    unknown_kind, unknown_flags, malformed : int
        Skipped; decoded all the same; bodies that end within a word.
    events, repaired, states, outside, markers : int
        Events on the array, those of them that a state gave, states, taxels outside the array, starts and stops.
    dropped, resets : int
        How often the board said that it had dropped events; resets that were noticed.
    unknown_value : int
        Differences from a value that was not heard, as the stream was joined later: their events have none.
    """

    datagrams: int
    intact: int
    repeated: int
    old: int
    short: int
    foreign: int
    checksum: int
    missing: int
    unknown_kind: int
    unknown_flags: int
    malformed: int
    events: int
    repaired: int
    states: int
    outside: int
    markers: int
    dropped: int
    resets: int
    unknown_value: int


@dataclass(frozen=True)
class Status:
    """Say what the board counted since its reset.

    Parameters
    ----------
    frames, events, dropped, datagrams, faults : int
        Frames scanned, events sent, events dropped, datagrams made before this one, comparators that had not returned.
    """

    frames: int
    events: int
    dropped: int
    datagrams: int
    faults: int


@dataclass(frozen=True, eq=False)
class Heard:
    """Hold what one datagram told.

    Parameters
    ----------
    events : Events
    until : int, us, or None
        Nothing before this comes any more with a higher sequence number; None where nothing is promised.
    intact : bool
        False where it was refused or had come before (`Decoder.counts` says why).
    """

    events: Events
    until: int | None
    intact: bool


class Decoder:
    """Turn one board's datagrams into events: each intact one once, whatever was lost, repeated, reordered or damaged.

    It belongs to the first board that it hears. Damage is never an error: it is counted.

    Parameters
    ----------
    array : Array, optional
        The sensor; the thesis' 64 x 64 where it is left out.

    Raises
    ------
    ProblemError : an argument that makes no sense

    Examples
    --------
    >>> from taxel.simulate import Board
    >>> from taxel.wire import Registers
    >>> board, decoder = Board(Registers(wire_version=2)), Decoder()
    >>> ticks = np.zeros(4096, np.uint16)
    >>> ticks[board.array.index(3, 4)] = 40
    >>> heard = [decoder.push(datagram) for datagram in board.frame(ticks)]
    >>> heard[0].events, heard[0].until
    (Events(1 events, 0 to 0 us, 64 x 64 taxels, 1 intensities), 192)
    >>> decoder.counts.intact, decoder.counts.missing
    (1, 0)
    """

    def __init__(self, *, array: Array | None = None) -> None:
        self.array = Array._of(array)
        self._core = _core.DatagramDecoder(self.array._parts())

    def push(self, datagram: Any, arrived: int | None = None) -> Heard:
        """Take a datagram.

        Parameters
        ----------
        datagram : bytes, or anything with a contiguous buffer
        arrived : int, us, optional
            The host's clock when it came; after a reset it says how much time has passed.

        Raises
        ------
        ProblemError : `datagram` is not bytes, or `arrived` not a whole number
        """
        when = None if arrived is None else whole("arrived", arrived)
        parts, until, intact = self._core.push(_bytes(datagram), when)
        return Heard(Events._from_parts(parts, self.array), until, intact)

    @property
    def counts(self) -> Counts:
        """What was heard and missed so far."""
        return Counts(**json.loads(self._core.counts()))

    @property
    def status(self) -> Status | None:
        """What the board last said of itself."""
        said = self._core.status()
        return None if said is None else Status(**json.loads(said))

    @property
    def held(self) -> NDArray[np.int32]:
        """What each taxel holds, shape (rows, columns), ticks; -1 where nothing was heard of it."""
        return self._core.held().reshape(self.array.rows, self.array.columns)

    def __repr__(self) -> str:
        c = self.counts
        return f"Decoder({self.array.rows} x {self.array.columns} taxels, {c.intact} datagrams, {c.missing} missing)"


def decode(data: Any, *, array: Array | None = None, columns: Columns | None = None) -> tuple[Events, Counts, int]:
    """Decode a whole stream of one board's datagrams, each of which has its length before it (16 bits, little-endian).

    Parameters
    ----------
    data : bytes, or anything with a contiguous buffer
    array : Array, optional
        The sensor; the thesis' 64 x 64 where it is left out.
    columns : taxel.wire.Columns, optional
        Memory that is used again, with room for ``len(data) // 2 + 32`` events: the events are views of it, good until
        it is filled again. Where it is left out they have memory of their own.

    Returns
    -------
    Events, Counts, and how many bytes belonged to no datagram

    Raises
    ------
    ProblemError : `data` is not bytes, or `columns` have too little room

    Examples
    --------
    >>> from taxel.simulate import Board
    >>> from taxel.wire import Registers
    >>> sent = Board(Registers(wire_version=2)).frame(np.full(4096, 40, np.uint16))
    >>> events, counts, skipped = decode(b"".join(len(d).to_bytes(2, "little") + d for d in sent))
    >>> len(events), counts.intact == len(sent), skipped
    (4096, True, 0)
    """
    sensor = Array._of(array)
    stream = _bytes(data)
    room, own = Columns._asked_for(columns, _core.datagram_rows(len(stream)))
    told = _core.decode_datagrams(stream, sensor._parts(), room._parts())
    rows, paired, repaired, markers, counts, skipped = told
    events = (room._given if own else room._first)(sensor, rows, paired, repaired, markers)
    return events, Counts(**json.loads(counts)), skipped


class StreamReader:
    """Cut a file or stream into datagrams, each of which has its length before it (16 bits, little-endian).

    What is no datagram is skipped byte by byte, to the next place where length, magic and checksum agree.

    Examples
    --------
    >>> from taxel.simulate import Board
    >>> from taxel.wire import Registers
    >>> sent = Board(Registers(wire_version=2)).frame(np.full(4096, 40, np.uint16))
    >>> data = b"".join(len(datagram).to_bytes(2, "little") + datagram for datagram in sent)
    >>> reader = StreamReader()
    >>> reader.push(b"noise" + data) == sent, reader.skipped
    (True, 5)
    """

    def __init__(self) -> None:
        self._core = _core.DatagramStream()

    def push(self, data: Any) -> list[bytes]:
        """Take the next bytes; return the datagrams that they complete.

        Raises
        ------
        ProblemError : `data` is not bytes
        """
        return self._core.push(_bytes(data))

    def finish(self) -> list[bytes]:
        """End the stream; return the datagrams within bytes that seemed to begin a longer one."""
        return self._core.finish()

    @property
    def skipped(self) -> int:
        """Bytes that belonged to no datagram; those that may still become one count once the stream has ended."""
        return self._core.skipped()
