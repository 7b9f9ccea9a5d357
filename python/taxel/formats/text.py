"""Text files of instruments: lines, cells and numbers; errors name file, line and column."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import short, shown
from taxel._base.columns import Growing
from taxel._base.encodings import as_utf_8
from taxel._base.errors import damaged, unreadable
from taxel._base.header_table import HeaderTable
from taxel._base.limits import LINE, VALUE
from taxel._base.number_text import float_of, refuse_digits
from taxel._core import FormatError

__all__ = [
    "before",
    "beginning",
    "blocks",
    "first_bytes",
    "group_rows",
    "head",
    "lines",
    "number",
    "numbers",
    "stream",
    "table",
]

#: Number of cells of a table that are in memory as texts at once, at most 4 MiB.
_CELLS = 1 << 17
#: Bytes of a text that are read at once.
_PIECE = 1 << 20
#: Characters of the lines before the data of a file.
_HEAD = 1 << 20
#: Bytes of the beginning of a text.
_BEGINNING = 1 << 16
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?", re.ASCII)
_UTF_8 = b"\xef\xbb\xbf"


def lines(path: Path) -> list[str]:
    """Read the lines of a text file, compressed by gzip or not, without line ends; `stream` holds none of them.

    The text is UTF-8 with or without BOM, UTF-16 with one, or else Latin-1, which instruments of the 1990s write.

    Raises
    ------
    FormatError : not a text, or a damaged gzip file
    """
    return list(stream(path))


def stream(path: Path) -> Iterator[str]:
    """Yield the lines of a text file as `lines` does, a piece of the file after the other.

    Raises
    ------
    FormatError : as of `lines`, or a line of more than 4 MiB
    """
    rest, number, begin = b"", 1, 0
    for piece in _pieces(path):
        if not begin and not rest and piece.startswith(_UTF_8):
            piece, begin = piece[len(_UTF_8) :], len(_UTF_8)  # noqa: PLW2901
        data = rest + piece
        # A carriage return at the end of a piece may be half of a line end.
        end = max(data.rfind(b"\n"), data.rfind(b"\r", 0, len(data) - 1)) + 1
        if len(data) - end > LINE:
            raise unreadable(f"the line has more than {LINE} bytes; must have at most {LINE}", path.name, line=number)
        found = _lines(path, data[:end], begin)
        yield from found
        rest, number, begin = data[end:], number + len(found), begin + end
    yield from _lines(path, rest, begin)


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield the bytes of a text file, unpacked."""
    with _open(path) as file:
        while piece := file.read(_PIECE):
            yield piece


def before(content: Iterator[str], ends: Callable[[str], bool]) -> tuple[list[str], str | None]:
    """Take the lines up to the first line for which `ends` returns true, which is included; the others are left.

    None stands for that line where there is none in the first 1 MiB.
    """
    taken, left = list[str](), _HEAD
    for line in content:
        if ends(line):
            return taken, line
        left -= len(line) + 1
        if left < 0:
            break
        taken.append(line)
    return taken, None


def head(path: Path) -> str:
    """Read the first line of a text file, as `lines` does, but no more of it than 64 KiB.

    Raises
    ------
    FormatError : not a text, or a damaged gzip file
    """
    return (_lines(path, _bytes(path, _BEGINNING).removeprefix(_UTF_8).partition(b"\n")[0]) or [""])[0]


def beginning(path: Path, most: int = _BEGINNING) -> list[str]:
    """Read the whole lines in the first `most` bytes of a text file, as `lines` does.

    Raises
    ------
    FormatError : not a text, a damaged gzip file, or a line of more than 4 MiB
    """
    data = _bytes(path, most)
    ended = data if len(data) < most else data[: max(data.rfind(b"\n"), data.rfind(b"\r", 0, -1)) + 1]
    if not ended and len(data) > LINE:
        raise unreadable(f"the line has more than {LINE} bytes; must have at most {LINE}", path.name, line=1)
    return _lines(path, ended.removeprefix(_UTF_8))


def first_bytes(path: Path, count: int) -> bytes:
    """Read the beginning of a file; nothing of anything else, as a folder may hold pipes, sockets and folders too."""
    try:
        with open(path, "rb") as file:
            return file.read(count)
    except (FormatError, IsADirectoryError):
        return b""


def _bytes(path: Path, most: int) -> bytes:
    with _open(path) as file:
        return file.read(most)


@contextmanager
def _open(path: Path) -> Iterator[BinaryIO]:
    """Open a text file, to be read unpacked and in UTF-8, or else in Latin-1."""
    with open(path, "rb") as raw:
        try:
            yield as_utf_8(path.name, cast(BinaryIO, gzip.GzipFile(fileobj=raw)) if path.suffix == ".gz" else raw)
        except (gzip.BadGzipFile, EOFError, zlib.error) as error:
            raise damaged(path.name, "gzip file", str(error)) from None


def _lines(path: Path, data: bytes, begin: int = 0) -> list[str]:
    """Return the lines of bytes that begin at an offset of a file."""
    if b"\0" in data:
        # Every second byte of an English text in UTF-16 is zero.
        zeros = [not data[parity:8:2].strip(b"\0") for parity in (0, 1)]
        is_utf_16 = not begin and len(data) > 3 and zeros[0] != zeros[1]
        why = (
            "the file is UTF-16 without a byte-order mark: save it as UTF-8"
            if is_utf_16
            else "the file is not a text file"
        )
        raise unreadable(f"this byte is zero; {why}", path.name, byte=begin + data.index(0))
    ends = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        content = ends.decode().split("\n")
    except UnicodeDecodeError:
        content = [_decode(line) for line in ends.split(b"\n")]
    return content[:-1] if content and not content[-1] else content


def _decode(line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode("latin-1")


def number(cell: str, path: Path, line: int, noun: str, *, unmarked: bool = False) -> float:
    """Read one finite number; `line` counts from 1, as editors do.

    `unmarked`: a layout could say what marks a missing cell, and does not; the error then names that.

    Raises
    ------
    FormatError : no finite number (names file, line and column)
    """
    text, noun = cell.strip(), noun if noun.startswith("column ") else short(noun)
    remedy = (
        f"; if this text marks a missing value, write in a layout file: [table] missing = {shown(text)}"
        if unmarked
        else ("")
    )
    try:
        value = float_of(text)
    except ValueError:
        if _DECIMAL_COMMA.fullmatch(text):
            problem = f"has a decimal comma ({shown(text)}); "
            problem += "write in a layout file: [table] decimal = ','" if unmarked else "export with decimal points"
        else:
            problem = f"is {shown(text)}, not a number" if text else "is empty, not a number"
            problem += remedy
        raise unreadable(f"{noun} {problem}", path.name, line=line) from None
    # Values of frames have 32 bits.
    if not abs(value) <= VALUE:
        raise unreadable(f"{noun} is {shown(text)}, not a finite number{remedy}", path.name, line=line)
    return value


def numbers(
    rows: Iterable[Sequence[str]],
    path: Path,
    first_line: int,
    names: Sequence[str],
    missing: frozenset[str] = frozenset(),
    *,
    unmarked: bool = False,
) -> NDArray[np.float64]:
    """Read a block of numbers with columns `names`; `first_line` is the line number of its first row.

    Rows that are made one by one are never all in memory as text. A cell that reads as one of `missing` is NaN.
    `unmarked` as of `number`.

    Raises
    ------
    FormatError : a row of another length, or a cell that is not a number (names file, line and column)
    """
    values = Growing(path.name, values=((len(names),), np.float64))
    for _, block in blocks(rows, path, first_line, names, missing, unmarked=unmarked):
        values.add(values=block)
    return np.array(values.column("values"))


def blocks(
    rows: Iterable[Sequence[str] | None],
    path: Path,
    first_line: int,
    names: Sequence[str],
    missing: frozenset[str] = frozenset(),
    *,
    unmarked: bool = False,
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield the numbers of a table as `numbers` returns them, some rows after the others, each with its first line.

    None among the rows represents a line that is not a row.

    Raises
    ------
    FormatError : as of `numbers`
    """
    for line, some in group_rows(rows, path, first_line, len(names)):
        yield line, _block(some, path, line, names, missing, unmarked)


def group_rows(
    rows: Iterable[Sequence[str] | None], path: Path, first_line: int, columns: int
) -> Iterator[tuple[int, list[Sequence[str]]]]:
    """Yield the rows of a table some after the others, each time with the first one's line; None as of `blocks`.

    Raises
    ------
    FormatError : a row of another number of cells
    """
    line, some, characters = first_line, list[Sequence[str]](), 0
    for row in rows:
        if row is None:
            if some:
                yield line, some
            line, some, characters = line + len(some) + 1, [], 0
            continue
        if len(row) != columns:
            raise unreadable(f"{len(row)} cells; must have {columns}", path.name, line=line + len(some))
        some.append(row)
        characters += sum(map(len, row))
        if len(some) * columns >= _CELLS or characters >= LINE:
            yield line, some
            line, some, characters = line + len(some), [], 0
    if some:
        yield line, some


def _block(
    rows: Sequence[Sequence[str]],
    path: Path,
    first_line: int,
    names: Sequence[str],
    missing: frozenset[str],
    unmarked: bool,
) -> NDArray[np.float64]:
    columns = len(names)
    absent = np.array([[cell in missing for cell in row] for row in rows]) if missing else None
    if missing:
        rows = [["0" if cell in missing else cell for cell in row] for row in rows]
    try:
        refuse_digits("".join(row) for row in rows)
        values = np.array(rows, dtype=np.float64).reshape(len(rows), columns)
        sound = bool((np.abs(values) <= VALUE).all())
    except ValueError:
        sound = False
    if not sound:
        # A name may be a number, as the columns of Pedar are.
        nouns = [name if name.startswith("column ") else f"column {shown(name)}" for name in names]
        values = np.array(
            [
                [number(c, path, first_line + k, n, unmarked=unmarked) for c, n in zip(row, nouns, strict=True)]
                for k, row in enumerate(rows)
            ]
        ).reshape(len(rows), columns)
    if absent is not None:
        values[absent] = np.nan
    return values


def table(path: Path, columns: Sequence[str], *, optional: bool = False) -> list[dict[str, str]]:
    """Read a comma-separated table with a header line; each row also has its ``line``; none without an optional one.

    Raises
    ------
    FormatError : a column is missing, or a row has another length than the header (names file and line)
    """
    if optional and not path.exists():
        return []
    parsed = HeaderTable.read(path.name, lines(path))
    if not parsed.header:
        raise unreadable("the file is empty; must begin with a line of column names", path.name)
    parsed.has(columns)
    return [{**cells, "line": str(line)} for line, cells in parsed]
