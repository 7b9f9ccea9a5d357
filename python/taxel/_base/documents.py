"""Reads TOML and JSON that anybody may have written: files, options, entries of a recording."""

from __future__ import annotations

import json
import os
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, NoReturn

from taxel._base.arguments import shown
from taxel._base.encodings import mark_of
from taxel._base.errors import placed, unreadable
from taxel._base.files import open_file
from taxel._base.limits import UNPACKED, unpacked
from taxel._base.messages import first_line
from taxel._core import FormatError

#: Bytes of a document that people write, as a layout, a recipe or a scene: 1 MiB.
BY_HAND = 1 << 20
#: Bytes of one that taxel writes, with numbers of each taxel or input, as a readout, a tare or a calibration: 256 MiB.
BY_TAXEL = 1 << 28
#: Bytes that it and its values may take in memory: 2 GiB, as of three numbers for each of 2048 x 2048 taxels.
_ROOM = 1 << 31
#: Dots in a key of TOML, for each of which tomllib goes through all before it.
_DOTS = 100
#: Tables or lists within each other.
_DEPTH = 64
#: Bytes in memory, at most: of a place in a list; of a number; of a text, beside its characters; of a list; of an
#: object; of a name in an object, with its place.
_PLACE, _NUMBER, _TEXT, _LIST, _OBJECT, _NAME = 9, 32, 60, 100, 250, 100
#: How tomllib ends what it says about a line.
_AT_LINE = re.compile(r" \(at line (\d+), (column \d+)\)$")
#: Where a string or a comment of TOML begins, and what ends a key.
_MARKS = re.compile(r"[\"'#\n,=\[\]{}]")


class NotTomlError(FormatError):
    """Says that a text is not TOML, and not that it is too long or too deep."""


def read_text(path: str | os.PathLike[str], most: int = BY_HAND, otherwise: str = "") -> str:
    """Return the text of a file (`decoded`).

    Raises
    ------
    FormatError : more than `most` bytes, no text (names line and byte), or no file but a pipe, a socket or a device
    OSError : the file is not there, or cannot be read
    """
    with open_file(path) as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise unreadable(f"more than {most} bytes; must have at most {most}", path)
    return decoded(path, data, otherwise)


def decoded(path: str | os.PathLike[str], data: bytes, otherwise: str = "") -> str:
    """Return the text of a file's bytes, UTF-8 with or without BOM, or UTF-16 with one; if neither, in `otherwise`.

    Raises
    ------
    FormatError : neither (names line and byte)
    """
    mark, encoding = mark_of(data)
    try:
        return data[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        if otherwise and not mark:
            with suppress(UnicodeDecodeError):
                return data.decode(otherwise)
        # Counted in the whole file, with its BOM.
        before = error.object[: error.start].decode(encoding, "replace")
        line = len(before.replace("\r\n", "\n").replace("\r", "\n").split("\n"))
        at, name = len(mark) + error.start, encoding[:6].upper()
        text = f"not text in {name} ({error.reason}); save it as UTF-8"
        raise unreadable(text, path, line=line, byte=at) from None


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the values of a file of TOML; errors as of `read_text` and `of_toml`."""
    return of_toml(str(path), read_text(path))


def read_json(path: str | os.PathLike[str], most: int = BY_HAND) -> Any:
    """Return the value of a file of JSON; errors as of `read_text` and `of_json`."""
    return of_json(str(path), read_text(path, most), most)


def text_of_json(path: str | os.PathLike[str]) -> str:
    """Return the text of a file of JSON that the compiled part reads; errors as of `read_text` and `object_of_json`."""
    text = read_text(path, BY_TAXEL)
    object_of_json(str(path), text)
    return text


def object_of_json(location: str | None, text: str) -> dict[str, Any]:
    """Return the object that taxel wrote in JSON, with numbers of each taxel; errors as of `of_json`."""
    first = text.lstrip(" \t\r\n")[:1] if text[:1].isspace() else text[:1]
    if first != "{":
        begins = f"begins with {shown(first)}" if first else "empty"
        raise unreadable(f"not a JSON object: {begins}; must begin with '{{'", location)
    values: dict[str, Any] = of_json(location, text, BY_TAXEL, room=_ROOM)
    return values


def of_toml(location: str | None, text: str) -> dict[str, Any]:
    """Return the values of a text in TOML.

    Parameters
    ----------
    location : str or None
        The file in errors; None in memory.
    text : str, at most 1 MiB

    Raises
    ------
    FormatError : not TOML, too long, nested too deeply, or a key with too many dots (names the line)
    """
    _check_length(location, text, BY_HAND)
    for line, key in _between_marks(text):
        if key.count(".") > _DOTS:
            raise unreadable(f"a key with {key.count('.')} dots; must have at most {_DOTS}", location, line=line)
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise _too_deep(location) from None
    except ValueError as error:
        why, at = _why(error)
        raise placed(NotTomlError(f"not TOML: {why}"), location, line=at) from None
    _check_depth(location, values)
    return values


def memory_of_json(text: str) -> int:
    """Return how many bytes a text in JSON and its values take in memory, about and at most.

    Examples
    --------
    >>> memory_of_json("[]"), memory_of_json('["a", 1, true]')
    (112, 294)
    """
    # A text of other than Latin letters has 4 bytes a character, as NumPy's always have; a part of it is in a value.
    characters = len(text) * (6 if text.isascii() else 12)
    values = text.count(",")
    numbers = max(0, values - text.count("true") - text.count("false"))
    parts = _LIST * text.count("[") + _OBJECT * text.count("{") + _NAME * text.count(":") + _TEXT * text.count('"') // 2
    return characters + _PLACE * values + _NUMBER * numbers + parts


def of_json(location: str | None, text: str, most: int = BY_HAND, *, room: int = UNPACKED) -> Any:
    """Return the value of a text in JSON.

    Parameters
    ----------
    location : str or None
        The file in errors; None in memory.
    text : str
    most : int, characters
    room : int, bytes
        How much the text and its values may take in memory, where the caller of an opening gave no limit.

    Raises
    ------
    FormatError : not JSON, as NaN and Infinity are not, a key that is twice in an object, too long, or nested too
        deeply
    """
    _check_length(location, text, most)
    unpacked(location or "text", memory_of_json(text), room)

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        values = dict(pairs)
        if len(values) < len(pairs):
            twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
            raise unreadable(f"not JSON: {shown(twice)} appears twice in one object", location)
        return values

    def refuse(constant: str) -> NoReturn:
        raise unreadable(f"not JSON: {constant} is not a number in JSON", location)

    try:
        value = json.loads(text, object_pairs_hook=once, parse_constant=refuse)
    except RecursionError:
        raise _too_deep(location) from None
    except ValueError as error:
        why, at = _why(error)
        raise unreadable(f"not JSON: {why}", location, line=at) from None
    _check_depth(location, value)
    return value


def _check_length(location: str | None, text: str, most: int) -> None:
    if len(text) > most:
        raise unreadable(f"{len(text)} characters; must have at most {most}", location)


def _why(error: ValueError) -> tuple[str, int | None]:
    """Return in plain words why a text is not read, and its line where that is known."""
    if "set_int_max_str_digits" in str(error):
        # Python's words for a long number name a function to call.
        return f"a whole number has more than {sys.get_int_max_str_digits()} digits", None
    if isinstance(error, json.JSONDecodeError):
        return f"{error.msg} (column {error.colno})", error.lineno
    why = first_line(error)
    if found := _AT_LINE.search(why):
        return f"{why[: found.start()]} ({found[2]})", int(found[1])
    return why, None


def _too_deep(location: str | None) -> FormatError:
    return unreadable(f"nested too deeply; must have at most {_DEPTH} levels", location)


def _check_depth(location: str | None, value: Any) -> None:
    """Refuse values that later steps, which call themselves for each level, could not go through."""
    level = [value]
    for _ in range(_DEPTH + 1):
        inner: list[Any] = []
        for holder in level:
            entries = holder.values() if isinstance(holder, dict) else holder if isinstance(holder, list) else ()
            # Most lists are long ones of numbers.
            if not {dict, list}.isdisjoint(map(type, entries)):
                inner += [entry for entry in entries if isinstance(entry, dict | list)]
        level = inner
        if not level:
            return
    raise _too_deep(location)


def _between_marks(text: str) -> Iterator[tuple[int, str]]:
    """Yield what may be a key of TOML, without its quoted parts, and its line: it ends at = , [ ] { } or the line."""
    at, line, key = 0, 1, ""
    while found := _MARKS.search(text, at):
        begin, mark = found.start(), found[0]
        key += text[at:begin]
        if mark in "\"'":
            # The end of a quote that is not closed is refused later.
            quote = mark * 3 if text.startswith(mark * 3, begin) else mark
            at = _end_of_quote(text, begin + len(quote), quote)
            line += text.count("\n", begin, at)
            continue
        at = begin + 1
        if mark == "#":
            at = text.find("\n", begin)
            at = len(text) if at < 0 else at
            continue
        yield line, key
        key = ""
        line += mark == "\n"
    yield line, key + text[at:]


def _end_of_quote(text: str, at: int, quote: str) -> int:
    """Return where a quoted text ends that begins at `at`; in double quotes a backslash takes the next character."""
    while (end := text.find(quote, at)) >= 0:
        if quote[0] == "'":
            return end + len(quote)
        before = text[at:end]
        if (len(before) - len(before.rstrip("\\"))) % 2 == 0:
            return end + len(quote)
        at = end + 1
    return len(text)
