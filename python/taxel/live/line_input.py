"""Lines of text as they arrive from a serial line, a pipe, a file that grows, TCP or UDP."""

from __future__ import annotations

import contextlib
import io
import os
import queue
import select
import socket
import threading
import time
from collections.abc import Callable

from taxel import _core
from taxel._base.text_lines import ArrivedLine, TextLines

__all__ = ["LineInput"]

#: Longest line, bytes; a longer one is not a line of numbers, and what follows in it is left out.
LONGEST = 1 << 16
#: How long a read waits at most, and how often a failed line is opened again, s.
_WAIT_S = 0.05
#: How long a server may take to answer, s.
_CONNECT_S = 1.0
#: The most bytes of a read, and of a datagram that UDP can carry.
_PIECE, _DATAGRAM = 1 << 12, 1 << 16


class LineInput:
    """Read lines as they arrive.

    Parameters
    ----------
    place : str
        serial:PLACE[,baud=RATE], lines:PATH, lines+tcp:HOST:PORT or lines+udp:HOST:PORT.

    Raises
    ------
    OSError : it cannot be opened
    ProblemError : it is no place of lines
    """

    def __init__(self, place: str) -> None:
        self._kind, self._where, self._baud, self.place = _core.line_place(place)
        #: Whether it is a file on a disk, which has what was written before it is read.
        self.is_file = self._kind == "file" and os.path.isfile(self._where)
        #: Whether it is a serial port or server.
        self.is_serial = self._kind == "serial"
        #: The bytes that are in no line.
        self.lines = TextLines(LONGEST)
        self.discard, self.take_left_out = self.lines.discard, self.lines.take_left_out
        #: Whether the next line may lack its beginning: whatever sends may have begun before. A file is read from its
        #: beginning, and a datagram begins with a line.
        self._may_be_cut = not self.is_file and self._kind != "udp"
        self._is_cut, self._was_interrupted = self._may_be_cut, False
        #: Whether no more can arrive.
        self.has_ended = False
        #: Closes the place, but a port or server, which closes with the last who can read it.
        self._opened = contextlib.ExitStack()
        self._receive: Callable[[], bytes | None] | None = self._open()

    def read(self) -> list[ArrivedLine]:
        """Return the lines that arrive within 50 ms.

        Raises
        ------
        OSError : reading failed; the place is opened again, and the next line begins anew
        """
        if self._receive is None:
            time.sleep(_WAIT_S)
            # A plug that was pulled may be put back at any time.
            self._reopen()
            return []
        try:
            data = self._receive()
        except OSError as error:
            self.lines.discard()
            # A port that is open is not opened again.
            self.close()
            self._reopen()
            self._is_cut, self._was_interrupted = self._may_be_cut, True
            if error.filename is None and error.strerror is not None:
                error.filename = self.place
            raise
        if data is None:
            self.has_ended = True
            return self.lines.end(_core.now_ns())
        return self.lines.push(data, _core.now_ns())

    def take_cut(self) -> bool | None:
        """Return whether the next line may lack its beginning: then whether that is a loss; once."""
        is_cut, self._is_cut = self._is_cut, False
        return self._was_interrupted if is_cut else None

    def close(self) -> None:
        """Close the place at once: other programs may open it."""
        self._receive = None
        self._opened.close()

    def _reopen(self) -> None:
        try:
            self._receive = self._open()
        except OSError:
            self._receive = None

    def _open(self) -> Callable[[], bytes | None]:
        """Open the place; return what reads it: nothing if nothing came in time, None at the end."""
        if self._kind in ("serial", "tcp"):
            line = _core.SerialLine(self._where, self._baud, _CONNECT_S)
            return lambda: line.read(_WAIT_S)
        if self._kind == "udp":
            return self._datagrams()
        is_input = self._where == "-"
        # Without O_NONBLOCK a named pipe waits until a program writes. The buffer of the standard input is passed by.
        file = (
            io.FileIO(0, closefd=False)
            if is_input
            else io.FileIO(self._where, opener=lambda path, flags: os.open(path, flags | _NONBLOCK))
        )
        if _NONBLOCK:
            self._opened.callback(file.close)
        read = _polled(file) if _NONBLOCK else _by_thread(file)

        def piece() -> bytes | None:
            data = read()
            if data == b"":
                # A pipe without a writer, or the end of a file: a program may still write to it.
                if is_input:
                    return None
                time.sleep(_WAIT_S)
            return data or b""

        return piece

    def _datagrams(self) -> Callable[[], bytes]:
        """Return what reads datagrams of whole lines."""
        host, _, port = self._where.rpartition(":")
        host = host.strip("[]")
        receiver = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        receiver.settimeout(_WAIT_S)
        try:
            receiver.bind((host, int(port)))
        except OSError as error:
            receiver.close()
            raise OSError(error.errno, error.strerror, f"UDP {self._where}") from None
        self._opened.callback(receiver.close)

        def receive() -> bytes:
            try:
                data = receiver.recv(_DATAGRAM)
            except TimeoutError:
                return b""
            # The end of a datagram ends its last line.
            return data if data.endswith(b"\n") or not data else data + b"\n"

        return receive


_NONBLOCK: int = getattr(os, "O_NONBLOCK", 0)


def _polled(file: io.FileIO) -> Callable[[], bytes | None]:
    """Return what reads a file: None if nothing came in time, nothing at its end."""
    return lambda: file.read(_PIECE) if select.select([file], [], [], _WAIT_S)[0] else None


def _by_thread(file: io.FileIO) -> Callable[[], bytes | None]:
    """As `_polled`, in a system that cannot wait for a file and for a time at once."""
    pieces: queue.Queue[bytes] = queue.Queue(4)

    def read_ahead() -> None:
        while True:
            try:
                data = file.read(_PIECE) or b""
            except BrokenPipeError:
                # The writer of a pipe has closed it.
                data = b""
            pieces.put(data)
            if not data:
                time.sleep(_WAIT_S)

    threading.Thread(target=read_ahead, name="taxel-read", daemon=True).start()

    def read() -> bytes | None:
        try:
            return pieces.get(timeout=_WAIT_S)
        except queue.Empty:
            return None

    return read
