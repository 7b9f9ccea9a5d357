"""Tekscan F-Scan insoles and I-Scan sheets: the ASCII export of a movie (``.asf``, ``.csv``, ``.txt``).

Header lines ``KEY value``, then after ``ASCII_DATA @@`` for each frame a line ``Frame 7`` (I-Scan: with its time and
the sum of its cells) and a line of cells for each row, separated by commas, ``B`` for a cell that does not exist;
``@@`` ends the file. Only the header has the unit and the spacings.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import Growing
from taxel._base.limits import TIME_US, VALUE
from taxel._base.number_text import refuse_digits
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import candidates, files_at, sensor
from taxel.formats.trial import Trial
from taxel.frames import Frames

__all__ = ["files", "trials"]

_ENDINGS = {".asf", ".csv", ".txt"}
_BEGINS = b"DATA_TYPE"
_LENGTHS_MM = {
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetres"), 10.0),
    **dict.fromkeys(("in", "inch", "inches"), 25.4),
}
#: Tekscan's names of units, and ours; any other name is not changed.
_UNITS = {"kpa": "kPa", "raw": "counts"}
_KEY = re.compile(r"([A-Z][A-Z0-9_]*)[ \t]+(\S.*?)\s*")
_FRAME = re.compile(r"Frame\s+(\d+)\s*(?:,\s*([^,\s]*)\s*,.*?)?", re.ASCII)
_RAW_SUM = re.compile(r"Raw Sum=\s*,*\s*([^,\s]+)")


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.asf``, ``.csv`` and ``.txt`` whose first line names the data's type."""
    return [f for f in candidates(path, "*") if f.suffix.lower() in _ENDINGS and _is_export(f)]


def _is_export(path: Path) -> bool:
    return text.first_bytes(path, 64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(_BEGINS)


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the movie of one file, or of all in a folder.

    Cells that do not exist (``B``) read 0. Times are those that the frames state; if they state none, frame 1 is at 0
    us, and times jump at a missing frame.

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Trial
        `about` has the header, and the spacings as ``row_spacing_mm`` and ``column_spacing_mm``;
        ``series["raw_sum"]`` is the sum that each frame of an I-Scan file states, which must equal that of raw cells.

    Raises
    ------
    FormatError : a file that breaks the format (names file, line and cell)
    """
    for file in files_at(path, files, "Tekscan movie (text that begins with DATA_TYPE)"):
        yield _read(file)


def _read(file: Path) -> Trial:
    content = text.stream(file)
    above, begins = text.before(content, lambda line: line.rstrip(", \t") == "ASCII_DATA @@")
    if begins is None:
        raise FormatError(f"{file.name}: a line ASCII_DATA @@ must follow the header, but is missing")
    header = _Header(file, above)
    if header.text("DATA_TYPE") != "MOVIE":
        raise FormatError(
            f"{file.name}, line {header.line('DATA_TYPE')}: DATA_TYPE is "
            f"{arguments.shown(header.text('DATA_TYPE'))}; must be a MOVIE"
        )
    rows, columns = header.size("ROWS"), header.size("COLS")
    down, across = header.length_mm("ROW_SPACING"), header.length_mm("COL_SPACING")
    period, unit = header.positive("SECONDS_PER_FRAME"), header.text("UNITS")
    unit = _UNITS.get(unit.lower(), unit)
    sensor(f"{file.name}, line {header.line('ROWS')}", Array(rows, columns))
    exists: NDArray[np.bool_] | None = None
    frames = list[_Frame]()
    read = Growing(file.name, values=((rows, columns), np.float32), sums=((), np.float64))
    for frame, lines in _frames(file, content, len(above) + 2, rows):
        cells = _cells(file, lines, frame.line + 1, columns)
        there = cells != "B"
        if exists is None:
            exists = there
        elif not np.array_equal(there, exists):
            row, column = np.argwhere(there != exists)[0]
            raise FormatError(
                f"{file.name}, line {frame.line + 1 + row}: cell {column + 1} is "
                f"{arguments.shown(str(cells[row, column]))}; in frame {frames[0].number} it is "
                f"{'a number' if exists[row, column] else 'B'}"
            )
        values, raw_sum = np.zeros((rows, columns), np.float32), np.nan
        values[there] = _numbers(file, cells, there, frame.line + 1)
        match = _RAW_SUM.search(frame.text)
        if match is not None:
            raw_sum = text.number(match[1], file, frame.line, "Raw Sum")
        cell_sum = values.sum(dtype=np.float64)
        if unit == "counts" and not np.isnan(raw_sum) and raw_sum != cell_sum:
            raise FormatError(
                f"{file.name}, line {frame.line}: Raw Sum is {raw_sum:g}, but the cells add up to {cell_sum:g}"
            )
        frames.append(replace(frame, text=""))
        read.add(values=values[None], sums=[raw_sum])
    if not frames:
        raise FormatError(f"{file.name}, line {len(above) + 1}: no frame follows this line")
    t, sums = _times(file, frames, period), read.column("sums")
    about: dict[str, str | float] = {**header.values, "row_spacing_mm": down, "column_spacing_mm": across}
    array = Array(
        rows,
        columns,
        (down, across),
        None if exists is None or exists.all() else exists,
        f"Tekscan {header.values.get('SENSOR_TYPE', 'sensor')}",
    )
    return Trial(
        name=file.stem,
        person=file.stem,
        recorded=Frames(read.column("values"), t, unit=unit, array=array),
        truth={},
        source="",
        series={"raw_sum": sums} if np.isfinite(sums).all() else {},
        about=about,
    )


class _Header:
    """The lines before the data, by their keys."""

    def __init__(self, file: Path, lines: Sequence[str]) -> None:
        self.file = file
        self.values: dict[str, str] = {}
        self._lines: dict[str, int] = {}
        for k, line in enumerate(lines, start=1):
            match = _KEY.fullmatch(line.rstrip(", \t"))
            # Comment lines are free text, so a repeated key may be part of a comment.
            if match and match[1] in self.values and match[1] in _NEEDED and match[2] != self.values[match[1]]:
                raise FormatError(f"{file.name}, line {k}: {match[1]} appears a second time, with another value")
            if match:
                self.values.setdefault(match[1], match[2])
                self._lines.setdefault(match[1], k)

    def line(self, key: str) -> int:
        return self._lines[key]

    def text(self, key: str) -> str:
        if key not in self.values:
            raise FormatError(f"{self.file.name}: the line {key} is missing in the header")
        return self.values[key]

    def positive(self, key: str) -> float:
        value = text.number(self.text(key), self.file, self.line(key), key)
        if value <= 0:
            raise FormatError(f"{self.file.name}, line {self.line(key)}: {key} is {value:g}; must be above 0")
        return value

    def size(self, key: str) -> int:
        value = self.positive(key)
        if value != int(value) or value > 65_535:
            raise FormatError(f"{self.file.name}, line {self.line(key)}: {key} is {value:g}; must be from 1 to 65535")
        return int(value)

    def length_mm(self, key: str) -> float:
        words = self.text(key).split()
        if len(words) != 2 or words[1].lower() not in _LENGTHS_MM:
            cell = arguments.shown(self.text(key))
            raise FormatError(
                f"{self.file.name}, line {self.line(key)}: {key} is {cell}; must be a number and "
                "millimeters, centimeters or inches"
            )
        value = text.number(words[0], self.file, self.line(key), key) * _LENGTHS_MM[words[1].lower()]
        if not 0 < value <= VALUE:
            raise FormatError(f"{self.file.name}, line {self.line(key)}: {key} is {value:g} mm; must be above 0")
        return value


_NEEDED = {"DATA_TYPE", "ROWS", "COLS", "ROW_SPACING", "COL_SPACING", "SECONDS_PER_FRAME", "UNITS"}


@dataclass(frozen=True)
class _Frame:
    """The line that begins a frame: its number in the file, its text, the frame's number and time ("" if none)."""

    line: int
    text: str
    number: int
    time: str


def _frames(file: Path, content: Iterator[str], begin: int, rows: int) -> Iterator[tuple[_Frame, list[str]]]:
    """Yield each frame with its lines of cells; `begin` is the number of the first line."""
    at, before = begin, 0
    for row_text in content:
        line = row_text.strip()
        if not line.strip(","):
            at += 1
            continue
        if line.rstrip(",") == "@@":
            return
        match = _FRAME.fullmatch(line)
        if match is None or len(match[1]) > 15:
            raise FormatError(
                f"{file.name}, line {at}: {arguments.shown(line)}; must be the first line of a frame, like 'Frame 7'"
            )
        number = int(match[1])
        if before and number <= before:
            raise FormatError(
                f"{file.name}, line {at}: frame {number} follows frame {before}; the numbers of frames must ascend"
            )
        lines = list(islice(content, rows))
        if len(lines) < rows:
            raise FormatError(
                f"{file.name}, line {at + len(lines)}: the file ends within frame {number}; its end is missing"
            )
        yield _Frame(at, row_text, number, match[2] or ""), lines
        at, before = at + 1 + rows, number
    raise FormatError(f"{file.name}, line {at - 1}: the file ends without @@; its end is missing")


def _times(file: Path, frames: Sequence[_Frame], period: float) -> NDArray[np.int64]:
    """Return the frames' times, us: those that they state if all do, else times computed from their numbers.

    The two differ: a movie with 0.1 s for each frame states steps of 0.1 and 0.11 s.
    """
    if all(frame.time for frame in frames):
        seconds = np.array([text.number(frame.time, file, frame.line, "time") for frame in frames])
    else:
        seconds = (np.array([frame.number for frame in frames], np.float64) - 1) * period
    far = np.flatnonzero(np.abs(seconds) * 1e6 > TIME_US)
    if len(far):
        k = int(far[0])
        raise FormatError(f"{file.name}, line {frames[k].line}: time {seconds[k]:g} s; must be within 142 years of 0")
    t = np.rint(seconds * 1e6).astype(np.int64)
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(back):
        k = int(back[0])
        raise FormatError(
            f"{file.name}, line {frames[k + 1].line}: time {t[k + 1]} us is not after {t[k]} us, the time of "
            f"the frame before"
        )
    return np.asarray(t)


def _cells(file: Path, lines: Sequence[str], first_line: int, columns: int) -> NDArray[np.str_]:
    """Return the text of the cells of one frame, shape (rows, columns)."""
    rows = [[cell.strip() for cell in line.split(",")] for line in lines]
    for k, row in enumerate(rows):
        # A spreadsheet that saves the file pads all lines to the widest one, which may be that of a frame.
        while len(row) > columns and not row[-1]:
            row.pop()
        if len(row) != columns:
            raise FormatError(f"{file.name}, line {first_line + k}: {len(row)} cells; must have {columns}")
    return np.array(rows)


def _numbers(file: Path, cells: NDArray[np.str_], there: NDArray[np.bool_], first_line: int) -> NDArray[np.float64]:
    """Return the numbers of the cells that exist."""
    try:
        found = cells[there]
        refuse_digits(["".join(found.tolist())])
        values = found.astype(np.float64)
        if (np.abs(values) <= VALUE).all():
            return values
    except ValueError:
        pass  # the slow path below names the cell
    return np.array(
        [text.number(cells[row, c], file, first_line + int(row), f"cell {c + 1}") for row, c in np.argwhere(there)]
    )
