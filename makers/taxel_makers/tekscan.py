"""Tekscan F-Scan insoles and I-Scan sheets: the ASCII export of a movie (``.asf``, ``.csv``, ``.txt``).

Header lines ``KEY value``, then after ``ASCII_DATA @@`` for each frame a line ``Frame 7`` (I-Scan: with its time) and a
line of cells for each row, separated by commas, ``B`` for a cell that does not exist.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from taxel import Array, Frames, ProblemError
from taxel.formats.layout import Layout
from taxel.reading import Facts, InMemory, Text, beginning, unreadable

_LENGTHS_MM = {"mm": 1.0, "millimeters": 1.0, "cm": 10.0, "centimeters": 10.0, "in": 25.4, "inches": 25.4}
#: Tekscan's names of units, and ours; any other name is not changed.
_UNITS = {"kpa": "kPa", "raw": "counts"}
_KEY = re.compile(r"([A-Z][A-Z0-9_]*)[ \t]+(\S.*?)[, \t]*")
_NUMBER = re.compile(r"\d{1,9}(\.\d{1,9})?", re.ASCII)
_FRAME = re.compile(r"Frame\s+(\d+)\s*(?:,\s*([\d.]+)\s*,)?", re.ASCII)


def knows(path: Path) -> bool:
    """Return whether a file is of this kind: its first line names the data's type."""
    is_named = path.suffix.lower() in (".asf", ".csv", ".txt")
    return is_named and beginning(path, 64).removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"DATA_TYPE")


def read(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the movie; cells that do not exist (``B``) read 0.

    Times are those that the frames state; if they state none, frame 1 is at 0 us, and times jump at a missing frame.

    Raises
    ------
    FormatError : a header without size, spacing, unit or period, or a damaged frame (names its line)
    """
    import pandas as pd  # noqa: PLC0415  takes long

    lines = list(Text(path).lines())
    data = next((k for k, line in enumerate(lines) if line.startswith("ASCII_DATA")), len(lines))
    # A comment may hold a key a second time.
    header = {found[1]: found[2] for line in reversed(lines[:data]) if (found := _KEY.fullmatch(line))}
    try:
        rows, columns, period = int(header["ROWS"]), int(header["COLS"]), float(header["SECONDS_PER_FRAME"])
        lengths = [header[key].lower().split() for key in ("ROW_SPACING", "COL_SPACING")]
        down, across = (float(number) * _LENGTHS_MM[word] for number, word in lengths)
        stated = header["UNITS"]
    except (KeyError, ValueError) as error:
        raise unreadable(
            f"the header lacks a sound ROWS, COLS, SPACING, UNITS or SECONDS_PER_FRAME: {error}", path
        ) from None
    begins = [(k, found) for k, line in enumerate(lines) if k > data and (found := _FRAME.match(line))]
    # The end of a movie may be missing.
    whole = [(k, found) for k, found in begins if k + rows < len(lines)]
    if not whole:
        raise unreadable("no whole frame follows the header", path, line=data + 1)
    cells = [line for k, _ in whole for line in lines[k + 1 : k + 1 + rows]]
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(cells)),
            header=None,
            usecols=range(columns),
            na_values="B",
            dtype=np.float32,
            skip_blank_lines=False,
        )
        # A quote that somebody left open joins lines.
        values = table.to_numpy().reshape(-1, rows, columns)
    except ValueError as error:  # of pandas' parser too
        why = str(error).splitlines()[0]
        raise unreadable(f"a frame has a cell that is no number, or too few: {why}", path) from None
    is_missing = np.isnan(values)
    differs = np.flatnonzero((is_missing != is_missing[0]).any(axis=(1, 2)))
    if len(differs):
        at = whole[differs[0]][0]
        raise unreadable("the frame has other cells that do not exist than the first", path, line=at + 1)
    seconds = [float(found[2] or "nan") for _, found in whole]
    numbered = [(int(found[1]) - 1) * period for _, found in whole]
    t = np.rint(1e6 * np.array(numbered if np.isnan(seconds).any() else seconds)).astype(np.int64)
    array = Array(rows, columns, (down, across), name=f"Tekscan {header.get('SENSOR_TYPE', 'sensor')}")
    if is_missing[0].any():
        array = Array(rows, columns, (down, across), ~is_missing[0], array.name)
    try:
        frames = Frames(np.nan_to_num(values), t, unit=_UNITS.get(stated.lower(), stated), array=array)
    except ProblemError as error:
        raise unreadable(str(error), path) from None
    lost = ("a frame that is cut off",) * (len(begins) - len(whole))
    end, _, unit = header.get("SATURATION_PRESSURE", "").partition(" ")
    # Cells are printed as whole numbers, a step of the hardware being larger.
    range_end = float(int(float(end))) if unit.strip().lower() == stated.lower() and _NUMBER.fullmatch(end) else None
    return [InMemory(Facts(path=path, array=array, kind="tekscan", range_end=range_end, lost=lost), frames)]
