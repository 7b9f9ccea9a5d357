"""Tables of labels as other programs write them: times with their unit or date, and texts, in columns of any name.

Two of them count their times from the beginning of their recording: the tables of BIDS, with columns `onset` and
`duration` in s, and the label tracks of Audacity, lines of begin, end and label between tabs, in s.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace

from taxel._base.arguments import shown
from taxel._base.cells import seconds_of, time_unit
from taxel._base.errors import unreadable
from taxel._base.header_table import HeaderTable
from taxel._base.messages import counted, warn
from taxel._base.number_text import float_of

__all__ = ["are_of_bids", "are_of_events", "is_of_track", "track", "with_known_columns"]

#: What the column of labels is called, the first that is there; capitals do not matter.
_LABELS = ("label", "trial_type", "event", "ereignis", "name", "marker", "annotation")
#: The columns that a table of BIDS has, and what it writes where a value is missing.
_BIDS, _MISSING = {"onset", "duration"}, "n/a"
#: What begins a line of a label track that says a range of frequencies.
_FREQUENCIES = "\\\t"
#: What the column of the recordings is called, if none is called `recording`; capitals do not matter.
_RECORDINGS = ("recording", "trial", "versuch", "file", "filename", "datei", "aufnahme")
#: What the column of the sources is called, if none is called `source`, and what sides are; capitals do not matter.
_SOURCES = ("source", "side", "foot", "seite", "fuss", "fuß")
_SIDES = {"": "", "l": "left", "links": "left", "left": "left", "r": "right", "rechts": "right", "right": "right"}
#: Columns that hold neither times of events nor labels.
_OTHERS = ("recording", "source", "host_ns", "replaces_us")
_US = {"s": 1e6, "ms": 1e3, "us": 1.0, "ns": 1e-3}
#: Names of columns that number frames: frame, Frames, frame_number, "Frame #", Bildnummer, sample.
_FRAMES = re.compile(
    r"(frame|picture|image|bild|sample)(s|er)?[ _.-]*(#|n|nr|no|num|number|nummer|id|idx|index|count)?\.?",
    re.IGNORECASE,
)
#: What is to be done with numbers of frames, which may be those of a video and count from 0 or 1: taxel does not guess.
_CONVERT = "write t_us = FRAME * 1000000 / RATE (frame 250 at 100 frames/s is at 2500000 us)"
_RIGHT = "must be label,t_us ..., or a column of texts and a column of times with its unit, for example label,time [s]"


def with_known_columns(table: HeaderTable, separator: str) -> HeaderTable:
    """Return a table with its columns named `label`, `t_us`, and, where it has them, `recording` and `source`.

    Parameters
    ----------
    table : HeaderTable
    separator : str
        Separator of its cells: unless it is a comma, numbers may have decimal commas.

    Raises
    ------
    FormatError : no column of times or of labels, a time without a unit (names line and column)

    Examples
    --------
    >>> table = HeaderTable.read("a.csv", ["Zeit;Ereignis", "02.01.1970 00:00:00,5;heel"])
    >>> list(with_known_columns(table, ";"))
    [(2, {'t_us': '86400500000', 'label': 'heel'})]
    """
    header = list(table.header)
    if header and (recording := _recording(table, separator)) is not None:
        header[recording] = "recording"
    if header and (side := _side(table)) is not None:
        header[side] = "source"
        sides = (
            (line, (*cells[:side], _SIDES[cells[side].strip().lower()], *cells[side + 1 :]))
            for line, cells in table.rows
        )
        table = replace(table, lines=tuple(sides))
    if not header or {"label", "t_us"} <= set(header):
        return replace(table, header=tuple(header))
    time = header.index("t_us") if "t_us" in header else _time(table)
    rows, name, header[time] = list(table.rows), header[time], "t_us"
    if "trial_type" in header:
        rows = [(line, cells) for line, cells in rows if cells[header.index("trial_type")].strip() != _MISSING]
    for k, (line, cells) in enumerate(rows if name != "t_us" else ()):
        us = _us(table.location, line, name, cells[time].strip(), separator)
        rows[k] = line, (*cells[:time], str(us), *cells[time + 1 :])
    if "label" not in header:
        header[_label(table, header, [cells for _, cells in rows], separator)] = "label"
    return replace(table, header=tuple(header), lines=tuple(rows))


def are_of_events(names: Sequence[str], cells: Sequence[str], *, named: bool = False) -> bool:
    """Return whether a table is one of labels, by its names and first row: it has times and a text, and nothing else.

    One that the name of its file calls so (`named`) has labels or a text beside anything: recordings are numbers.

    Examples
    --------
    >>> are_of_events(["Zeit", "Ereignis"], ["10:15:02", "heel"]), are_of_events(["time", "event"], ["0.5", "0"])
    (True, False)
    """
    if are_of_bids(names):
        return True
    kinds = ["time" if time_unit(name) is not None else name.lower() for name in names]
    labels = [k for k, kind in enumerate(kinds) if kind in _LABELS]
    if named:
        return bool(labels) or any(map(_is_text, cells))
    known = all(kind == "time" or kind in (*_LABELS, *_OTHERS, *_RECORDINGS, *_SOURCES) for kind in kinds)
    return known and kinds.count("time") == len(labels) == 1 and len(cells) == len(names) and _is_text(cells[labels[0]])


def are_of_bids(names: Sequence[str]) -> bool:
    """Return whether the columns of a table are those of BIDS."""
    return {name.lower() for name in names} >= _BIDS


def is_of_track(line: str) -> bool:
    r"""Return whether a line is the first one of a label track; those of a table of numbers have no text.

    Examples
    --------
    >>> is_of_track("0.5\t0.75\theel\n"), is_of_track("0.5\t0.75\t3\n"), is_of_track("0,5\t0,75\theel strike")
    (True, False, True)
    """
    cells = line.rstrip("\r\n").split("\t")
    return len(cells) == 3 and not any(map(math.isnan, _ends(cells))) and _is_text(cells[2])


def track(location: str, lines: Sequence[str]) -> HeaderTable:
    r"""Return a label track as a table of labels; the end of a label is its column `stop_us`.

    Labels without a name are left out, with a warning.

    Raises
    ------
    FormatError : a line that is not begin, end and label (names it)

    Examples
    --------
    >>> list(track("a.txt", ["0.5\t0.75\theel\n"]))
    [(1, {'t_us': '500000', 'stop_us': '750000', 'label': 'heel'})]
    """
    rows, unnamed = [], 0
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith(_FREQUENCIES):
            continue
        cells = line.rstrip("\r\n").split("\t", 2)
        times = _ends(cells)
        if len(cells) < 2 or not all(map(math.isfinite, times)):
            raise unreadable(
                f"{shown(line.strip())}; must be begin and end, s, and label, between tabs", location, line=number
            )
        label = "".join(cells[2:]).strip()
        unnamed += not label
        rows += [(number, (*(str(round(t * 1e6)) for t in times), label))] * bool(label)
    if unnamed:
        warn(f"{location}: left out {counted(unnamed, 'label')} without a name", stacklevel=4)
    return HeaderTable(location, ("t_us", "stop_us", "label"), tuple(rows))


def _ends(cells: Sequence[str]) -> list[float]:
    """Return begin and end of a line of a label track, s."""
    return [_number(cell, "\t") for cell in cells[:2]]


def _recording(table: HeaderTable, separator: str) -> int | None:
    """Return which column holds the names of recordings, by its name; numbers are of trials, and no names."""
    if "recording" in table.header:
        return table.header.index("recording")
    names = [name.lower() for name in table.header]
    named = (names.index(name) for name in _RECORDINGS if name in names)
    return next((k for k in named if any(_is_text(cells[k], separator) for _, cells in table.rows)), None)


def _side(table: HeaderTable) -> int | None:
    """Return which column holds the foot or the side of labels, by its name and its texts."""
    names = [name.lower() for name in table.header]
    named = () if "source" in names else (names.index(name) for name in _SOURCES if name in names)
    return next((k for k in named if all(cells[k].strip().lower() in _SIDES for _, cells in table.rows)), None)


def _time(table: HeaderTable) -> int:
    """Return which column holds the times, by its name."""
    if are_of_bids(table.header):
        return [name.lower() for name in table.header].index("onset")
    times = [k for k, name in enumerate(table.header) if name not in _OTHERS and time_unit(name) is not None]
    if len(times) == 1:
        return times[0]
    there = ", ".join(map(shown, table.header))
    if times:
        names = " and ".join(shown(table.header[k]) for k in times)
        raise unreadable(
            f"{names} all contain times: rename the column with the times of the labels to t_us, or remove the others",
            table.location,
            line=1,
        )
    missing = "t_us" if any(name.lower() in _LABELS for name in table.header) else "label"
    frames = next((name for name in table.header if _FRAMES.fullmatch(name)), None)
    counts = "" if frames is None else f"; {shown(frames)} contains numbers of frames, not times: {_CONVERT}"
    raise unreadable(
        f"column {missing!r} is missing; the columns are {there}{counts}; {_RIGHT}", table.location, line=1
    )


def _label(table: HeaderTable, header: Sequence[str], rows: Sequence[Sequence[str]], separator: str) -> int:
    """Return which column holds the labels: by its name, else the only one of texts."""
    names = [name.lower() for name in header]
    named = next((label for label in _LABELS if label in names), None)
    if named is not None:
        return names.index(named)
    texts = [
        k
        for k, name in enumerate(header)
        if name not in ("t_us", *_OTHERS, "") and rows and all(_is_text(row[k], separator) for row in rows)
    ]
    if len(texts) == 1:
        return texts[0]
    found = "column 'label' is missing"
    if texts:
        found = f"{' and '.join(shown(header[k]) for k in texts)} are texts, so the column of the labels is not clear"
    there = ", ".join(map(shown, table.header))
    raise unreadable(f"{found}; the columns are {there}; {_RIGHT}", table.location, line=1)


def _is_text(cell: str, separator: str = ";") -> bool:
    return bool(cell.strip()) and math.isnan(_number(cell, separator)) and math.isnan(seconds_of(cell.strip()))


def _us(location: str, line: int, name: str, cell: str, separator: str) -> int:
    """Return the time of a cell in whole us."""
    number, unit = _number(cell, separator), "s" if name.lower() == "onset" else time_unit(name) or ""
    if math.isnan(number):
        number, unit = seconds_of(cell), "s"
    elif not unit:
        of_frames = f"; if these are numbers of frames, {_CONVERT}" if number.is_integer() else ""
        raise unreadable(
            f"{name} is {shown(cell)}; its unit is not known; write the unit in the name of the column, "
            f"for example '{name} [s]' or (ms){of_frames}",
            location,
            line=line,
        )
    us = number * _US[unit]
    if not math.isfinite(us):
        raise unreadable(
            f"{name} is {shown(cell)}; must be a number, or a time like 2024-05-01 10:15:02.25 or "
            "01.05.2024 10:15:02,25",
            location,
            line=line,
        )
    return round(us)


def _number(cell: str, separator: str) -> float:
    """Return the number of a cell, with a decimal comma unless that is the separator; NaN for a text."""
    try:
        return float_of(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return math.nan
