"""Encodings of texts: UTF-8, with or without a byte-order mark, and UTF-16 with one."""

from __future__ import annotations

import codecs
import io
from typing import BinaryIO

from taxel._base.errors import unreadable

_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
#: Bytes of UTF-16 that are converted at once.
_PIECE = 1 << 16


def mark_of(data: bytes) -> tuple[bytes, str]:
    r"""Return the byte-order mark that a text begins with, b"" without one, and its encoding.

    Examples
    --------
    >>> mark_of("Größe".encode("utf-16-le"))
    (b'', 'utf-8')
    >>> mark_of(b"\xff\xfet\0")
    (b'\xff\xfe', 'utf-16-le')
    """
    return next(((mark, name) for mark, name in _MARKS.items() if data.startswith(mark)), (b"", "utf-8"))


def as_utf_8(name: str, file: BinaryIO) -> BinaryIO:
    """Return a text as UTF-8: a file in UTF-16 is converted as it is read, any other file is returned itself.

    Parameters
    ----------
    name : str
        For errors, which are raised as it is read.
    file : binary file, at its beginning
    """
    begin = file.read(2)
    file.seek(0)
    mark, encoding = mark_of(begin)
    return io.BufferedReader(_Converted(name, file, encoding), _PIECE) if mark else file


class _Converted(io.RawIOBase):
    """Reads a file in UTF-16 as UTF-8."""

    def __init__(self, name: str, file: BinaryIO, encoding: str) -> None:
        self._name, self._file = name, file
        self._decoder = codecs.getincrementaldecoder(encoding)()
        self._rest, self._read = b"", 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        while not self._rest:
            # Half of a character may end the piece before it.
            begin = self._read - len(self._decoder.getstate()[0])
            piece = self._file.read(_PIECE)
            self._read += len(piece)
            try:
                text = self._decoder.decode(piece, final=not piece)
            except UnicodeDecodeError as error:
                text = f"not text in UTF-16 ({error.reason}); save it as UTF-8"
                raise unreadable(text, self._name, byte=begin + error.start) from None
            # The first character is the mark.
            self._rest = text.removeprefix("\ufeff").encode() if not begin else text.encode()
            if not piece:
                break
        size = min(len(buffer), len(self._rest))
        buffer[:size], self._rest = self._rest[:size], self._rest[size:]
        return size
