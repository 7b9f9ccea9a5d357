"""Prints what a command says: whole lines, in which control characters are escaped."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Sequence

from taxel._base.messages import escaped

#: Widest line of a page of help, characters, and the column of its texts.
WIDTH, _COLUMN = 100, 26


def say(*lines: object, err: bool = False) -> None:
    """Print each text as one line: names in strangers' files may hold line breaks and escapes of a terminal.

    Parameters
    ----------
    *lines : str
        Of a text of several lines each is given alone. JSON holds no control character, and stays as it is.
    err : bool
        Whether it is printed to standard error.
    """
    for line in lines:
        print(escaped(line), file=sys.stderr if err else sys.stdout, flush=True)


def in_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of cells as lines, in columns as wide as their widest cells."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def table(title: str, cells: list[tuple[str, str]], width: int = WIDTH) -> list[str]:
    """Return names and texts in two columns under a title; nothing of none."""
    lines = ["", f"{title}:"] if cells else []
    for name, text in cells:
        begins = f"  {name}".ljust(_COLUMN)
        indent = " " * _COLUMN
        if len(begins) > _COLUMN or not begins.endswith(" "):
            lines.append(begins.rstrip())
            begins = indent
        lines += textwrap.wrap(text, width, initial_indent=begins, subsequent_indent=indent) or [begins.rstrip()]
    return lines
