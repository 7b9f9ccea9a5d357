"""Decodes bytes of version 1, or datagrams of version 2, to events; splits a stream into those datagrams."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import buffer_bytes, column, flag, integer
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.array import Array
from taxel.events import Events
from taxel.wire.columns import filled
from taxel.wire.counts import Counts, Received, Status


def decode(
    data: Any,
    version: Literal[1, 2] = 1,
    *,
    array: Array | None = None,
    differences: bool = False,
    lengths: ArrayLike | None = None,
) -> Events:
    """Decode a whole stream; a `Decoder` also counts what is dropped.

    Parameters
    ----------
    data : bytes, or anything with a contiguous buffer
        Version 1: consecutive words. Version 2: datagrams of one board, each preceded by its length (16 bits,
        little-endian).
    version : {1, 2}
    array : Array, optional
        The sensor; default: the thesis' 64 x 64.
    differences : bool
        Version 1, as in `Decoder`.
    lengths : array of int, shape (datagrams,), optional
        Version 1: the length of each datagram in bytes, if `data` is consecutive datagrams. Each is then decoded
        separately, so that an intensity never belongs to a change of the datagram before.

    Returns
    -------
    Events

    Raises
    ------
    ProblemError : an invalid argument; damage in the bytes is not an error

    Notes
    -----
    Thesis, Appendix 1, Table 5.4, and the page *Wire version 2*.

    Examples
    --------
    >>> decode(bytes.fromhex("c000050304 e000280304"))
    Events(1 event, 500 to 500 us, 64 x 64 taxels, 1 intensity)
    >>> from taxel.simulate import Board
    >>> from taxel.wire import Registers
    >>> sent = Board(Registers(wire_version=2)).frame(np.full(4096, 40, np.uint16))
    >>> decode(b"".join(len(datagram).to_bytes(2, "little") + datagram for datagram in sent), version=2)
    Events(4096 events, 0 to 0 us, 64 x 64 taxels, 4096 intensities)
    """
    decoder = Decoder(version, array=array, differences=differences)
    stream = buffer_bytes(data)

    def fill(columns: Any) -> _core._Filled:
        if decoder.version == 2:
            return _core.decode_datagrams(stream, decoder.array, columns)
        if lengths is not None:
            return decoder._core.fill_datagrams(stream, column("lengths", lengths, np.int64), columns)
        return decoder._core.fill(stream, None, columns, True)

    if decoder.version == 2 and lengths is not None:
        raise refused("lengths", ": must be left out, because in version 2 each datagram begins with its length")
    return filled(decoder.array, _core.wire_rows(decoder.version, len(stream)), fill)


class Decoder:
    """Decode the bytes or datagrams of a board to events as they arrive.

    Damage is never an error: `counts` has all that was dropped, by cause. The events of version 1 do not depend on how
    the bytes are cut into pieces: the decoder resynchronises at the next first byte. A change is returned once the next
    word (which may be its intensity), the end of its datagram (`end_of_datagram`) or of the stream (`finish`) is
    reached. Each intact datagram of version 2 is decoded once, whatever was lost, repeated, reordered or damaged; the
    decoder accepts only datagrams of the board that sent the first intact datagram.

    Parameters
    ----------
    version : {1, 2}
    array : Array, optional
        The sensor; default: the thesis' 64 x 64. Events outside it are counted and dropped.
    differences : bool
        Version 1: whether intensities are differences from the last value sent (the panel's "delta intensity"), which
        the bytes do not state. They are then summed from 0, so that `Events` hold values; these are correct from the
        board's reset until an intensity is lost. A datagram of version 2 has a flag for it.

    Raises
    ------
    ProblemError : an invalid argument

    Notes
    -----
    Table 5.4, and the page *Wire version 2*. Time of version 1 is unwrapped into 64 bits: a stamp up to 0.1 s behind
    the latest time is a step back, which is counted and stays in the events; any other stamp is ahead, so that pauses
    of up to 6.45 s are unwrapped correctly. For longer pauses arrival times are needed (`push`).

    Examples
    --------
    >>> decoder = Decoder()
    >>> decoder.push(bytes.fromhex("c000050304 e00028"))
    Events(0 events, no time, 64 x 64 taxels, no intensities)
    >>> decoder.push(bytes.fromhex("0304"))
    Events(1 event, 500 to 500 us, 64 x 64 taxels, 1 intensity)
    >>> decoder.counts.words, decoder.counts.skipped
    (2, 0)

    >>> from taxel.simulate import Board
    >>> from taxel.wire import Registers
    >>> board, decoder = Board(Registers(wire_version=2)), Decoder(version=2)
    >>> ticks = np.zeros(4096, np.uint16)
    >>> ticks[board.array.index(3, 4)] = 40
    >>> [decoder.push(datagram) for datagram in board.frame(ticks)]
    [Events(1 event, 0 to 0 us, 64 x 64 taxels, 1 intensity)]
    >>> decoder.last, decoder.counts.intact, decoder.counts.missing
    (Received(until=192, intact=True), 1, 0)
    """

    def __init__(
        self,
        version: Literal[1, 2] = 1,
        *,
        array: Array | None = None,
        differences: bool = False,
    ) -> None:
        self.version = integer("version", version, 1, 2)
        self.array = Array._of(array)
        if flag("differences", differences) and self.version == 2:
            raise refused("differences", " is only for version 1: a datagram of version 2 states it")
        self._core = _core.WireDecoder(self.version, self.array, differences)

    def push(self, data: Any, arrived: int | None = None) -> Events:
        """Decode the next bytes of version 1, or a datagram of version 2; return the events that they complete.

        Parameters
        ----------
        data : bytes, or anything with a contiguous buffer
        arrived : int, us, optional
            The host's time of arrival. For version 1 it determines the wrap of the 16-bit time after a pause of more
            than 6.45 s; for version 2 the time that has passed at a reset of the board.

        Returns
        -------
        Events

        Raises
        ------
        ProblemError : `data` is not bytes, or `arrived` not a whole number

        Examples
        --------
        >>> Decoder().push(bytes.fromhex("c000050304 e000280304"))
        Events(1 event, 500 to 500 us, 64 x 64 taxels, 1 intensity)
        """
        stream = buffer_bytes(data)
        at = None if arrived is None else integer("arrived", arrived, -(2**63), 2**63 - 1)
        rows = _core.wire_rows(self.version, len(stream))
        return filled(self.array, rows, lambda columns: self._core.fill(stream, at, columns, False))

    def end_of_datagram(self) -> Events:
        """End a datagram of version 1; return the change that was pending for its intensity, if there is one.

        Returns
        -------
        Events, at most one; none for version 2, in which no event is pending

        Examples
        --------
        >>> decoder = Decoder()
        >>> len(decoder.push(bytes.fromhex("c000050304"))), len(decoder.end_of_datagram())
        (0, 1)
        """
        return Events._unchecked(**self._core.end_of_datagram(), array=self.array)

    def finish(self) -> Events:
        """End a stream of version 1; return the pending events and reset the decoder except for its counts.

        Returns
        -------
        Events, none for version 2, in which no event is pending

        Examples
        --------
        >>> decoder = Decoder()
        >>> len(decoder.push(bytes.fromhex("c000050304"))), len(decoder.finish())
        (0, 1)
        """
        return Events._unchecked(**self._core.finish(), array=self.array)

    @property
    def counts(self) -> Counts:
        """The numbers of what was read, dropped and missed so far."""
        return Counts(**self._core.counts())

    @property
    def last(self) -> Received | None:
        """The status of the last datagram of version 2; None before the first one, and for version 1."""
        last = self._core.last()
        return None if last is None else Received(*last)

    @property
    def status(self) -> Status | None:
        """The totals that a board of version 2 last sent; None before the first ones, and for version 1."""
        status = self._core.status()
        return None if status is None else Status(**status)

    @property
    def held(self) -> NDArray[np.int32]:
        """The value that each taxel holds, shape (rows, columns), ticks; -1 if unknown.

        For version 1 it is known only with `differences`; without them the latest intensity of a taxel is in the
        events.
        """
        return self._core.held().reshape(self.array.rows, self.array.columns)

    def __repr__(self) -> str:
        c, size = self.counts, f"{self.array.rows} x {self.array.columns} taxels"
        if self.version == 2:
            return f"Decoder(version 2, {size}, {counted(c.intact, 'datagram')}, {c.missing} missing)"
        return f"Decoder({size}, {counted(c.changes, 'event')}, {counted(c.skipped, 'byte')} skipped)"


class StreamReader:
    """Split a file or stream into datagrams, each preceded by its length (16 bits, little-endian).

    Bytes outside a datagram are skipped one by one, up to the next position with a valid length, magic and checksum
    (the page *Wire version 2*).

    Examples
    --------
    >>> import numpy as np
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
        """Read the next bytes; return the datagrams that they complete.

        Parameters
        ----------
        data : bytes, or anything with a contiguous buffer

        Returns
        -------
        list of bytes, one per datagram, without its length

        Raises
        ------
        ProblemError : `data` is not bytes

        Examples
        --------
        >>> StreamReader().push(b"no datagram")
        []
        """
        return self._core.push(buffer_bytes(data))

    def finish(self) -> list[bytes]:
        """End the stream; return the datagrams found in bytes that seemed to begin a longer one.

        Returns
        -------
        list of bytes, one per datagram, without its length

        Examples
        --------
        >>> reader = StreamReader()
        >>> reader.push(b"no datagram") + reader.finish(), reader.skipped
        ([], 11)
        """
        return self._core.finish()

    @property
    def skipped(self) -> int:
        """Number of bytes outside datagrams; bytes that may still begin one are counted at the end of the stream."""
        return self._core.skipped()
