"""The headers of event cameras' files, and a check that the bytes below them are whole words; faery makes none.

Sources: Prophesee's descriptions of EVT 2.0, EVT 3.0 and DAT; iniVation's of AEDAT 4.0, whose header is a flatbuffer.
"""

from __future__ import annotations

import re
import shlex
import struct
from pathlib import Path
from typing import BinaryIO

from taxel._base.messages import escaped
from taxel._core import FormatError
from taxel.formats import text

__all__ = ["ENDINGS", "check", "is_dat"]

#: The endings of these files, and how faery names what is in them.
ENDINGS: dict[str, str] = {".raw": "evt", ".dat": "dat", ".aedat4": "aedat"}
#: Bytes of a word of an encoding, by the version that a header states.
_WORDS = {"evt": {"2": 4, "3": 2}, "dat": {"1": 8, "2": 8}}
_VERSION = {
    "evt": re.compile(rb"^% *(?:evt +|format +evt)(\d[\d.]*)", re.IGNORECASE | re.MULTILINE),
    "dat": re.compile(rb"^% *Version +(\d[\d.]*)", re.MULTILINE),
}
_HEADER = 1 << 16
_AEDAT = b"#!AER-DAT4.0\r\n"
#: What begins a text in UTF-8 or UTF-16, which no event does.
_TEXTS = (b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff")


def is_dat(path: Path) -> bool:
    """Return whether a .dat is of an event camera, and no table of text: words follow its header, or begin it."""
    head = text.first_bytes(path, _HEADER)
    below = head[_end_of_lines(head) :][:64]
    # Of each event's word the upper bytes of its time are 0.
    return not head.startswith(_TEXTS) and (below[1:2] == b"\x08" or below.count(0) >= 8)


def check(path: Path) -> str:
    """Return how faery names what is in a file, which must have its header, and whole words below it.

    Raises
    ------
    FormatError : no header, one of another version, or an end within a word
    """
    kind = ENDINGS[path.suffix.lower()]
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        if kind == "aedat":
            _check_packets(path, file, size)
        else:
            _check_words(path, file, size, kind)
    return kind


def _check_words(path: Path, file: BinaryIO, size: int, kind: str) -> None:
    """Refuse a file of lines that begin with a percent sign and of words below them, unless it is whole."""
    head = file.read(_HEADER)
    end = _end_of_lines(head)
    if not end:
        if not size:
            raise FormatError(
                f"{path}: the file is empty; must have a header (lines that begin with %), and events below it"
            )
        begins = " ".join(f"{byte:02X}" for byte in head[:4])
        raise FormatError(
            f"{path}, byte 0: starts with {begins}, not with a header (lines that begin with %); the file is damaged"
        )
    found = _VERSION[kind].search(head[:end])
    version, known = ("" if found is None else found[1].decode()), _WORDS[kind]
    word = known.get(version.removesuffix(".0"))
    if word is None:
        names = " and ".join(f"{kind.upper()}{number}" for number in known)
        states = f"states {kind.upper()}{version}" if version else "states no version"
        raise FormatError(f"{path}: the header {states}; taxel reads {names}")
    # Two bytes say the type of a .dat's events and their size.
    begin = end + 2 * (kind == "dat")
    if begin >= size:
        raise FormatError(f"{path}: the file ends after its header, at byte {size}, without an event; it is damaged")
    if (size - begin) % word:
        over = (size - begin) % word
        at_word = size - over
        raise FormatError(
            f"{path}: the last word, at byte {at_word}, has {over} of {word} bytes, so the file is damaged; "
            f"taxel reads "
            f"the file without this word: head -c {at_word} {escaped(shlex.quote(str(path)))} > whole{path.suffix}"
        )


def _end_of_lines(head: bytes) -> int:
    """Return where the lines of a header end; 0 without any."""
    end = 0
    while head[end : end + 1] == b"%" and (after := head.find(b"\n", end)) >= 0:
        end = after + 1
        if head[:after].rstrip().endswith(b"\n% end"):
            break
    return end


def _check_packets(path: Path, file: BinaryIO, size: int) -> None:
    """Refuse an AEDAT 4.0 whose packets do not end where its header, or the file, does."""
    magic = file.read(len(_AEDAT))
    if not magic:
        raise FormatError(f"{path}: the file is empty; must be AEDAT 4")
    if (older := re.match(rb"#!AER-DAT([0-3])", magic)) is not None:
        raise FormatError(
            f"{path}: the header states AEDAT {older[1].decode()}; taxel reads only AEDAT 4: save the file as AEDAT 4"
        )
    if magic != _AEDAT:
        begins = " ".join(f"{byte:02X}" for byte in magic[:4])
        raise FormatError(
            f"{path}, byte 0: starts with {begins}, not with #!AER-DAT4.0; the file is damaged, or not AEDAT"
        )
    try:
        (length,) = struct.unpack("<I", file.read(4))
        if length > min(size, _HEADER):
            raise struct.error
        table = _table_at(file.read(length))
    except struct.error:
        raise FormatError(f"{path}: the header is damaged") from None
    at, end = len(_AEDAT) + 4 + length, size if table < 0 else table
    if end > size:
        raise FormatError(
            f"{path}: the file ends at byte {size}, but its table of packets would begin at byte {table}; it is damaged"
        )
    if at == end:
        raise FormatError(f"{path}: the file ends after its header, at byte {size}, without an event; it is damaged")
    while at < end:
        file.seek(at)
        packet = file.read(8)
        after = at + 8 + (struct.unpack("<I", packet[4:])[0] if len(packet) == 8 else 0)
        if len(packet) < 8 or after > end:
            raise FormatError(f"{path}: the file ends within the packet that begins at byte {at}; it is damaged")
        at = after


def _table_at(header: bytes) -> int:
    """Return where a flatbuffer of an AEDAT's header says that the table of packets is; below 0 without one.

    Raises
    ------
    struct.error : the header points out of itself
    """

    def field(slot: int, form: str) -> tuple[int, int]:
        """Return a field's place and its value."""
        (table,) = struct.unpack_from("<I", header)
        (back,) = struct.unpack_from("<i", header, table)
        if not 0 <= table - back < len(header):
            raise struct.error
        (fields,) = struct.unpack_from("<H", header, table - back)
        offset = struct.unpack_from("<H", header, table - back + 4 + 2 * slot)[0] if 4 + 2 * slot < fields else 0
        return table + offset, struct.unpack_from(form, header, table + offset)[0] if offset else -1

    # faery reads this text without a check: a damaged place would be one outside of the file.
    place, offset = field(2, "<I")
    if offset < 0:
        raise struct.error
    (length,) = struct.unpack_from("<I", header, place + offset)
    if place + offset + 4 + length > len(header):
        raise struct.error
    return field(1, "<q")[1]
