"""Text files of instruments: lines, cells and numbers; errors name file, line and column."""

from __future__ import annotations

import gzip
import re
import zlib
from collections.abc import Iterable, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.header_table import HeaderTable
from taxel._base.limits import TEXT, VALUE
from taxel._base.number_text import float_of, refuse_digits
from taxel._core import FormatError

__all__ = ["beginning", "head", "lines", "number", "numbers", "table"]

#: Number of rows of a table that are in memory as cells of text at once.
_AT_ONCE = 4096
#: Bytes of the beginning of a text.
_BEGINNING = 1 << 16
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?", re.ASCII)


def lines(path: Path) -> list[str]:
    """Read the lines of a text file, compressed by gzip or not, without line ends.

    The text is UTF-8 with or without BOM, or else Latin-1, which instruments of the 1990s write.

    Raises
    ------
    FormatError : not a text, or a damaged gzip file
    """
    data = _bytes(path, TEXT + 1)
    if len(data) > TEXT:
        raise FormatError(f"{path.name}: more than {TEXT} bytes of text; at most that are read")
    return _lines(path, data)


def head(path: Path) -> str:
    """Read the first line of a text file, as `lines` does, but no more of it than 64 KiB.

    Raises
    ------
    FormatError : not a text, or a damaged gzip file
    """
    return (_lines(path, _bytes(path, _BEGINNING).partition(b"\n")[0]) or [""])[0]


def beginning(path: Path) -> list[str]:
    """Read the whole lines in the first 64 KiB of a text file, as `lines` does.

    Raises
    ------
    FormatError : not a text, or a damaged gzip file
    """
    data = _bytes(path, _BEGINNING)
    return _lines(path, data if len(data) < _BEGINNING else data[: data.rfind(b"\n") + 1])


def _bytes(path: Path, most: int) -> bytes:
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            return file.read(most)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise FormatError(f"{path.name}: not a whole gzip file ({error}); get it again") from None


def _lines(path: Path, data: bytes) -> list[str]:
    if b"\0" in data:
        is_utf_16 = data.startswith((b"\xff\xfe", b"\xfe\xff"))
        why = "it is in UTF-16: save it as UTF-8" if is_utf_16 else "this is not a text file"
        raise FormatError(f"{path.name}, byte {data.index(0)}: a zero byte; {why}")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    content = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return content[:-1] if content and not content[-1] else content


def number(cell: str, path: Path, line: int, what: str, *, unmarked: bool = False) -> float:
    """Read one finite number; `line` counts from 1, as editors do.

    `unmarked`: a layout could say what marks a missing cell, and does not; the error then names that.

    Raises
    ------
    FormatError : no finite number (names file, line and column)
    """
    text = cell.strip()
    remedy = f"; if it marks a missing value, say in a layout file: [table] missing = {shown(text)}" if unmarked else ""
    try:
        value = float_of(text)
    except ValueError:
        if _DECIMAL_COMMA.fullmatch(text):
            problem = f"has a decimal comma ({shown(text)}); export with decimal points"
        else:
            problem = f"is {shown(text)}, not a number" if text else "is empty, not a number"
            problem += remedy
        raise FormatError(f"{path.name}, line {line}: {what} {problem}") from None
    # Values of pictures have 32 bits.
    if not abs(value) <= VALUE:
        raise FormatError(f"{path.name}, line {line}: {what} is {shown(text)}, not a finite number{remedy}")
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
    rows, blocks, line = iter(rows), [np.empty((0, len(names)))], first_line
    while block := list(islice(rows, _AT_ONCE)):
        blocks.append(_block(block, path, line, names, missing, unmarked))
        line += len(block)
    return np.concatenate(blocks)


def _block(
    rows: Sequence[Sequence[str]],
    path: Path,
    first_line: int,
    names: Sequence[str],
    missing: frozenset[str],
    unmarked: bool,
) -> NDArray[np.float64]:
    columns = len(names)
    for k, row in enumerate(rows):
        if len(row) != columns:
            raise FormatError(f"{path.name}, line {first_line + k}: {len(row)} cells, must have {columns}")
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
        values = np.array(
            [
                [number(c, path, first_line + k, n, unmarked=unmarked) for c, n in zip(row, names, strict=True)]
                for k, row in enumerate(rows)
            ]
        ).reshape(len(rows), columns)
    if absent is not None:
        values[absent] = np.nan
    return values


def table(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    """Read a comma-separated table with a header line; each row also has its ``line``.

    Raises
    ------
    FormatError : a column is missing, or a row has another length than the header (names file and line)
    """
    parsed = HeaderTable.read(path.name, lines(path))
    if not parsed.header:
        raise FormatError(f"{path.name}: empty; must begin with a line of column names")
    parsed.has(columns)
    return [{**cells, "line": str(line)} for line, cells in parsed]
