"""Refuses a table or arrays of another program that no layout file describes, with the lines of one that reads them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.archive import stored_names
from taxel._base.messages import counted
from taxel._core import FormatError
from taxel.formats import text
from taxel.formats.layout import UNITS_US, advice
from taxel.recording.kinds import kind_of
from taxel.recording.read_foreign import ARRAYS, arrays_of, is_foreign, listed, shapes_of, time_of, unit_of

__all__ = ["are_spike_trains", "refuse_without_layout"]

#: Cells that tables hold where a value is missing.
_MISSING = ("", "nan", "NaN", "NA", "-", "null")
#: A column without a name is one of times if it ascends for so many lines.
_ASCENDS = 20
_NO_RATE = "# rate_hz = 100  # pictures a second: the file does not say it, and without it pictures are numbered"


def refuse_without_layout(path: Path) -> None:
    """Refuse a table or arrays that taxel did not write and no layout describes, with the layout that reads them.

    Its lines hold what the file says; what it does not say is a comment.

    Raises
    ------
    FormatError : it is such a file, or a damaged one
    """
    if are_spike_trains(path):
        raise FormatError(
            f"{path}: spike trains, as taxel encode writes them, no recording; taxel info describes them, and "
            "taxel.SpikeTrains.load reads them"
        )
    if not is_foreign(path) or (path.suffix.lower() == ".npz" and not stored_names(path)):
        return
    if path.suffix.lower() in (".csv", ".h5", ".hdf5"):
        kind_of(path)  # refuses what is not of the kind that its name says
    if path.suffix.lower() not in ARRAYS:
        lines = text.beginning(path)
        said = _of_table(lines)
        if said is None:
            _refuse_decimal_commas(path, lines)
            return
        holds, lines = said
        says = "says how to read it"
    else:
        there = shapes_of(path)
        name = next((name for name, shape in there.items() if len(shape) in (2, 3)), None)
        if name is None:
            raise FormatError(
                f"{path}: holds {listed(there)}; must be t, x, y, p (events), values, t (pictures), or, with a layout "
                "file, an array of pictures x rows x columns or pictures x taxels (docs/files.md)"
            )
        holds, lines = listed(there), _of_arrays(path, name, there)
        says = "says which are the pictures" if len(there) > 1 else "says what it is"
    written = "\n".join(lines)
    raise FormatError(f"{path}: holds {holds}, not written by taxel; {advice(path, says)}:\n{written}")


def are_spike_trains(path: Path) -> bool:
    """Return whether a file holds the arrays that `SpikeTrains.save` writes."""
    is_npz = path.suffix.lower() == ".npz" and path.is_file()
    return is_npz and {"times", "offsets", "start", "stop"} <= set(stored_names(path))


def _of_arrays(path: Path, name: str, there: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the layout of the array of a name."""
    count, *shape = there[name]
    time = next((one for one, of in there.items() if of == (count,) and unit_of(one) is not None), None)
    times = [] if time is None else [f"time = {_quoted(time)}", *_unit(time, arrays_of(path, [time])[time])]
    data = [f"array = {_quoted(name)}"] * bool(name) + times
    return [*_size(shape), *([_NO_RATE] if time is None else []), *(["[data]", *data] if data else [])]


def _of_table(lines: Sequence[str]) -> tuple[str, list[str]] | None:
    """Return what a table holds, and its layout; None of a text that does not end in lines of numbers."""
    there = [(k, line) for k, line in enumerate(lines) if line.strip()]
    # The separator that makes most columns of numbers.
    cells = {mark: [_cells(line, mark) for _, line in there] for mark in (",", ";", "\t", " ")}
    fits = {mark: len(rows[-1]) for mark, rows in cells.items() if rows and _are_numbers(rows[-1])}
    if not fits:
        return None
    separator = max(fits, key=lambda mark: fits[mark])
    rows, columns = cells[separator], fits[separator]
    first = len(rows)
    while first and len(rows[first - 1]) == columns and _are_numbers(rows[first - 1]):
        first -= 1
    named = first > 0 and len(rows[first - 1]) == columns
    body, skipped = rows[first:], there[first - named][0]
    table = [f"separator = {_quoted(separator)}"] * (separator != ",") + [f"skip_lines = {skipped}"] * (skipped > 0)
    names = rows[first - 1] if named else []
    time = time_of(names)
    leading = np.array([_number(row[0]) for row in body])
    if time is not None:
        column = np.array([_number(row[time]) for row in body])
        table += [f"time_column = {_quoted(names[time])}", *_unit(names[time], column)]
    elif not named and columns > 1 and len(body) >= _ASCENDS and (np.diff(leading) > 0).all():
        time = 0
        table += ["time_column = 1  # it ascends; leave this out if it is a taxel", *_unit("", leading)]
    missing = {cell for row in body for cell in row if not math.isfinite(_number(cell))}
    table += [f"missing = {_quoted(cell)}" for cell in sorted(missing - {"nan"} or missing)[-1:]]
    size = _size([columns - (time is not None)])
    holds = f"a table of {counted(columns, 'column')}"
    return holds, [*size, *([_NO_RATE] if time is None else []), *(["[table]", *table] if table else [])]


def _refuse_decimal_commas(path: Path, lines: Sequence[str]) -> None:
    """Refuse a table with a line that would hold numbers if its commas were decimal points."""
    for number, line in enumerate(lines, 1):
        for mark in (";", "\t", " "):
            cells = _cells(line, mark)
            if len(cells) > 1 and _are_numbers([cell.replace(",", ".", 1) for cell in cells]):
                for k, cell in enumerate(cells, 1):
                    if cell not in _MISSING:
                        text.number(cell, path, number, f"column {k}")


def _size(shape: Sequence[int]) -> list[str]:
    """Return the lines that say rows and columns, of pictures of rows x columns, or of so many taxels."""
    if len(shape) == 2:
        return [f"rows = {shape[0]}", f"columns = {shape[1]}"]
    taxels = shape[0]
    return ["rows = 1", f"columns = {taxels}  # if they are a grid row by row: its rows and columns"]


def _unit(name: str, times: NDArray[np.float64]) -> list[str]:
    """Return the line that says the unit of times: that in their name, else s, and what rate that makes."""
    said = (unit_of(name) or "").replace("µ", "u")
    unit = said if said in UNITS_US else "s"
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    notes = [f"{1e6 / (step * UNITS_US[unit]):.4g} pictures/s"] if step > 0 else []
    notes += ['or "ms" or "us"'] * (not said)
    return [f"time_unit = {_quoted(unit)}" + "  # " * bool(notes) + ", ".join(notes)]


def _cells(line: str, separator: str) -> list[str]:
    return [cell.strip() for cell in (line.split() if separator == " " else line.split(separator))]


def _are_numbers(cells: Sequence[str]) -> bool:
    """Whether cells are numbers, at least one of them, or marks of missing values."""
    finite = [math.isfinite(_number(cell)) for cell in cells]
    return any(finite) and all(one or cell in _MISSING for one, cell in zip(finite, cells, strict=True))


def _number(cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        return math.nan


def _quoted(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)
