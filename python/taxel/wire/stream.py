"""Streams of version 2: datagrams, each preceded by its length."""

from __future__ import annotations

from typing import Any

from taxel import _core
from taxel._base.arguments import buffer_bytes


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
