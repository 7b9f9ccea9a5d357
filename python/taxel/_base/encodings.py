"""Encodings of texts: UTF-8, with or without a byte-order mark, and UTF-16 with one."""

from __future__ import annotations

import codecs

_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


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
