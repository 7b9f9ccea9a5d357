"""Lines of text out of bytes as they arrive; each byte is in a line or counted."""

from __future__ import annotations

import re
from dataclasses import dataclass

#: Control characters but for the tab.
_NO_TEXT = re.compile("[\x00-\x08\x0a-\x1f\x7f-\x9f]")


@dataclass(frozen=True)
class ArrivedLine:
    """Hold a line as it arrived.

    Parameters
    ----------
    text : str
    at_ns : int, ns since 1970
    size : int
        Bytes.
    is_cut : bool
        Whether it is only the beginning of a line that is too long.
    is_text : bool
        Whether its bytes are text.
    """

    text: str
    at_ns: int
    size: int = 0
    is_cut: bool = False
    is_text: bool = True


class TextLines:
    r"""Cut bytes into lines, which a line feed, a carriage return or both end; each byte is in a line or counted.

    Parameters
    ----------
    longest : int
        A longer line is returned up to there, and its rest is left out.

    Examples
    --------
    >>> lines = TextLines(8)
    >>> [line.text for line in lines.push(b"1,2\r") + lines.push(b"\n3,") + lines.push(b"4\n5")]
    ['1,2', '3,4']
    >>> lines.discard()
    >>> lines.take_left_out()
    (0, 1)
    """

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._rest = b""
        #: Whether the line goes on of which the beginning was returned, as it is too long.
        self._is_beyond = False
        #: Whether the last line ended in a carriage return: a line feed behind it belongs to the same end.
        self._is_returned = False
        self._in_no_line = self._unfinished = 0

    def push(self, data: bytes, at_ns: int = 0) -> list[ArrivedLine]:
        """Return the lines that bytes complete, which arrived at `at_ns`."""
        if not data:
            return []
        if self._is_returned and data[0] == 0x0A:
            data = data[1:]
        self._is_returned = data.endswith(b"\r")
        # Of bytes no other characters end a line.
        ended = (self._rest + data).splitlines()
        self._rest = b"" if data.endswith((b"\n", b"\r")) or not ended else ended.pop()
        lines = []
        if ended and self._is_beyond:
            self._in_no_line += len(ended.pop(0))
            self._is_beyond = False
        lines += [self._line(line, at_ns) for line in ended]
        if self._is_beyond:
            self._in_no_line += len(self._rest)
            self._rest = b""
        elif len(self._rest) > self._longest:
            lines.append(self._line(self._rest, at_ns))
            self._is_beyond, self._rest = True, b""
        return lines

    def end(self, at_ns: int = 0) -> list[ArrivedLine]:
        """Return the last line, which lacks its end."""
        rest, self._rest = self._rest, b""
        return [self._line(rest, at_ns)] if rest else []

    def discard(self) -> None:
        """Leave out what arrived of a line that has not ended: what comes next does not continue it."""
        self._unfinished += len(self._rest)
        self._rest, self._is_beyond = b"", False

    def take_left_out(self) -> tuple[int, int]:
        """Return the number of bytes that cannot be part of a line, and of unfinished lines, since the last call."""
        left_out = self._in_no_line, self._unfinished
        self._in_no_line = self._unfinished = 0
        return left_out

    def _line(self, data: bytes, at_ns: int) -> ArrivedLine:
        line = data[: self._longest]
        self._in_no_line += len(data) - len(line)
        text = line.decode("utf-8", "replace")
        is_text = "\ufffd" not in text and (text.isprintable() or _NO_TEXT.search(text) is None)
        return ArrivedLine(text, at_ns, len(line), len(line) < len(data), is_text)
