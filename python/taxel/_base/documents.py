"""Reads texts, TOML and JSON that people or taxel have written: files, options, entries of a recording."""

from __future__ import annotations

import codecs
import json
import os
import re
import tomllib
from typing import Any

from taxel._base.errors import unreadable
from taxel._base.messages import first_line

#: How tomllib ends what it says about a line.
_AT_LINE = re.compile(r" \(at line (\d+), (column \d+)\)$")


#: Byte-order marks, and the encoding of what follows them.
_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


def mark_of(data: bytes) -> tuple[bytes, str]:
    r"""Return the byte-order mark that a text begins with, b"" without one, and its encoding.

    Examples
    --------
    >>> mark_of(b"\xff\xfet\0")
    (b'\xff\xfe', 'utf-16-le')
    """
    return next(((mark, name) for mark, name in _MARKS.items() if data.startswith(mark)), (b"", "utf-8"))


def read_text(path: str | os.PathLike[str]) -> str:
    """Return the text of a file (`decoded`).

    Raises
    ------
    FormatError : no text (names line and byte)
    OSError : the file is not there, or cannot be read
    """
    with open(path, "rb") as file:
        data = file.read()
    return decoded(path, data)


def decoded(path: str | os.PathLike[str], data: bytes, marked: tuple[bytes, str] | None = None) -> str:
    """Return the text of a file's bytes, UTF-8 with or without BOM, or UTF-16 with one; or as `marked` says.

    Raises
    ------
    FormatError : neither (names line and byte)
    """
    mark, encoding = marked or mark_of(data)
    try:
        return data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        # Counted in the whole file, with its BOM.
        before = error.object[: error.start].decode(encoding, "replace")
        line = len(before.replace("\r\n", "\n").replace("\r", "\n").split("\n"))
        at, name = len(mark) + error.start, encoding[:6].upper()
        text = f"not text in {name} ({error.reason}); save it as UTF-8"
        raise unreadable(text, path, line=line, byte=at) from None


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the values of a file of TOML; errors as of `read_text` and `of_toml`."""
    return of_toml(str(path), read_text(path))


def read_json(path: str | os.PathLike[str]) -> Any:
    """Return the value of a file of JSON; errors as of `read_text` and `of_json`."""
    return of_json(str(path), read_text(path))


def of_toml(location: str | None, text: str) -> dict[str, Any]:
    """Return the values of a text in TOML; `location` is the file in errors, None in memory.

    Raises
    ------
    FormatError : not TOML (names the line)
    """
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        why, at = _why(error)
        raise unreadable(f"not TOML: {why}", location, line=at) from None


def of_json(location: str | None, text: str) -> Any:
    """Return the value of a text in JSON; `location` is the file in errors, None in memory.

    Raises
    ------
    FormatError : not JSON
    """
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        why, at = _why(error)
        raise unreadable(f"not JSON: {why}", location, line=at) from None


def _why(error: Exception) -> tuple[str, int | None]:
    """Return why a text is not read, and its line where that is known."""
    if isinstance(error, json.JSONDecodeError):
        return f"{error.msg} (column {error.colno})", error.lineno
    why = first_line(error)
    if found := _AT_LINE.search(why):
        return f"{why[: found.start()]} ({found[2]})", int(found[1])
    return why, None
