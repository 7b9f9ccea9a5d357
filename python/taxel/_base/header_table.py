"""Tables of text: cells below a line of column names, with commas, semicolons or tabs between; errors name the line."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel._base.arguments import shown
from taxel._base.errors import unreadable
from taxel._base.table_text import Text


@dataclass(frozen=True)
class HeaderTable:
    """Hold a table of text.

    Parameters
    ----------
    place : str
        The name of the file in errors.
    header : tuple of str
        The names of its columns, stripped; () for a table without lines.
    lines : tuple of (int, tuple of str)
        The line number of each row, counted from 1, and its unchanged cells; empty lines are not rows.
    """

    location: str
    header: tuple[str, ...]
    lines: tuple[tuple[int, tuple[str, ...]], ...]

    @classmethod
    def read(cls, location: str | Path, lines: Iterable[str]) -> HeaderTable:
        """Read a table.

        Parameters
        ----------
        location : str or Path
            The name of the file in errors.
        lines : iterable of str

        Raises
        ------
        FormatError : a duplicate column, an unclosed quote (names the line)

        Examples
        --------
        >>> table = HeaderTable.read("a.csv", ["label, t_us", "", "heel,400"])
        >>> table.header, list(table)
        (('label', 't_us'), [(3, {'label': 'heel', 't_us': '400'})])
        """
        rows = tuple(_rows(location, lines))
        line, first = next(iter(rows), (1, ()))
        header = tuple(name.strip() for name in first)
        repeated = next((name for name, count in Counter(header).items() if name and count > 1), None)
        if repeated is not None:
            raise unreadable(f"column {shown(repeated)} appears twice", location, line=line)
        return cls(str(location), header, rows[1:])

    def has(self, required: Sequence[str]) -> None:
        """Check that columns of these names are there; there may be others.

        Raises
        ------
        FormatError : a column is missing (names it)
        """
        missing = [name for name in required if name not in self.header]
        if missing:
            there = f"the columns are {', '.join(map(shown, self.header))}" if self.header else "the line is empty"
            raise unreadable(
                f"column {missing[0]!r} is missing; {there}; must be {','.join(required)} ...", self.location, line=1
            )

    def __iter__(self) -> Iterator[tuple[int, dict[str, str]]]:
        """Yield the line number of each row, and its cells by the names of their columns.

        Check the header first (`has`), so that a file of another kind is reported by its first line.

        Raises
        ------
        FormatError : a row of another length than the header, or a cell in a column without a name (names the line)
        """
        for line, cells in self.lines:
            if len(cells) != len(self.header):
                raise unreadable(f"{len(cells)} cells; must have {len(self.header)}", self.location, line=line)
            named = list(zip(self.header, cells, strict=True))
            stray = next((cell for name, cell in named if not name and cell.strip()), None)
            if stray is not None:
                raise unreadable(
                    f"{shown(stray)} is in a column without a name; name the column", self.location, line=line
                )
            yield line, {name: cell for name, cell in named if name}


def _rows(location: str | Path, lines: Iterable[str]) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield the rows of a table that are not empty, each with the number of its line."""
    lines = [*lines]
    names = next((line for line in lines if line.strip()), "")
    reader = csv.reader(lines, strict=True, delimiter=separator_of(names))
    line = 1
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield line, tuple(cells)
            line = reader.line_num + 1
    except csv.Error as error:
        reason = "a quote is opened and not closed" if "end of data" in str(error) else error
        raise unreadable(f"{reason}", location, line=line) from None


def separator_of(names: str) -> str:
    """Return what separates the names of a table's columns: the comma, the semicolon or the tab that is most in them.

    Examples
    --------
    >>> separator_of('label;"t_us";comment'), separator_of('label,"first; second; third",t_us'), separator_of("label")
    (';', ',', ',')
    """
    # Pairs of quotes hold no separators.
    bare = "".join(names.split('"')[::2])
    return max(",;\t", key=bare.count)


def text_of(path: Path) -> list[str]:
    """Read the lines of a text or a sheet, with their ends, as a quoted cell may contain one.

    Raises
    ------
    FormatError : not a text
    OSError : the file is not there, or cannot be read
    """
    text = Text(path)
    # A short text is known to its end, whatever its encoding.
    return [f"{line}\n" for line in (text.head and text.lines())]


def lines_of(text: str) -> list[str]:
    """Return lines with their ends, a line feed or a carriage return; U+2028 and others are part of a cell."""
    return list(io.StringIO(text, newline=""))
