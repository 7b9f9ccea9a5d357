"""Insoles of novel (pedar) and Moticon (OpenGo): tables of both feet, by lines above them.

- pedar: the ``.asc`` export. Header lines, one of column names (``time[secs]``, then the sensors' numbers, left insole
  first), then a line for each frame, usually of 2 x 99 sensors in kPa.
- Moticon: the text export. Lines with ``#``, of which the last has the column names (separated by tabs), then a line
  for each frame: time in s; for each foot 16 pressures in N/cm2, accelerations, rates, total force in N, centre of
  pressure; then the markers of the manufacturer's step detection.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np

from taxel import Array, Frames
from taxel.formats.column_names import time_unit
from taxel.formats.layout import Layout, Table
from taxel.formats.table import read_table
from taxel.labels import Note
from taxel.reading import Facts, InMemory, Marks, Text, beginning, unreadable
from taxel.recording.kinds import Kind

#: Moticon's markers in the columns of steps, by the foot.
_MARKERS = {"left": {"11": "contact", "15": "foot_off"}, "right": {"21": "contact", "25": "foot_off"}}


def knows_pedar(path: Path) -> bool:
    """Return whether a file is of pedar: an ``.asc`` whose head names pressures."""
    return path.suffix.lower() == ".asc" and b"pressure values" in beginning(path)


def read_pedar(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the left insole, and one of the right.

    Raises
    ------
    FormatError : no line of column names of two insoles, or no table of numbers below it
    """
    head = Text(path).head
    first = next((k for k, line in enumerate(head) if line.startswith("time[secs]")), len(head))
    names = head[first].split()[1:] if first < len(head) else []
    if names.count("1") != 2:
        raise unreadable("must have a line of column names (time[secs] 1 2 ... 1 2 ...) of two insoles", path)
    second = names.index("1", 1)
    columns = [f"{'left' if k < second else 'right'} pressure {name}" for k, name in enumerate(names)]
    unit = re.search(r"pressure values in\s+(\S+)", "\n".join(head[:first]))
    how = Table(separator=" ", skip_lines=first + 1, columns=["time", *columns], time_column=1)
    return _feet(path, "pedar", Layout(path, unit=unit[1] if unit else "kPa", table=how), how)


def knows_moticon(path: Path) -> bool:
    """Return whether a file is of Moticon: a ``.txt`` with a comment that names the sensor insoles."""
    head = beginning(path, 4096).removeprefix(b"\xef\xbb\xbf") if path.suffix.lower() == ".txt" else b""
    return head.startswith(b"#") and b"Sensor insoles" in head


def read_moticon(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the left foot, and one of the right, with the maker's steps as notes.

    Raises
    ------
    FormatError : no columns of pressures, or no table of numbers below them
    """
    above = list(takewhile(lambda line: line.startswith("#"), Text(path).head))
    names = above[-1].lstrip("# ").split("\t")
    time = next((name for name in names if time_unit(name) is not None), None)
    foot = next((foot for foot in _MARKERS if not any(name.startswith(f"{foot} pressure ") for name in names)), None)
    if time is None or foot is not None:
        raise unreadable(f"must have the columns time and '{foot or 'left'} pressure 1' ...", path, line=len(above))
    how = Table(separator="\t", skip_lines=len(above), columns=names, time_column=time)
    return _feet(path, "Moticon", Layout(path, unit="N/cm2", table=how), how)


def _feet(path: Path, maker: str, layout: Layout, how: Table) -> list[InMemory]:
    """Return a reader of each foot, by the names of its columns, with its steps as notes.

    A line whose cells are empty for a foot is missing for that foot, so its times jump there.
    """
    readers = list[InMemory]()
    for foot, markers in _MARKERS.items():
        pressures = [name for name in how.columns if name.startswith(f"{foot} pressure ")]
        steps = next((name for name in how.columns if name.startswith(f"{foot} steps")), None)
        of_foot = replace(how, keep=f"{foot} pressure *", label_column=steps)
        [found] = read_table(path, replace(layout, table=of_foot))
        both = found.data
        assert isinstance(both, Frames)  # the layout says so
        there = ~np.isnan(both.values).any(axis=(1, 2))
        array = Array(1, len(pressures), name=f"{maker} insole")
        frames = Frames(both.values[there], both.t[there], unit=both.unit, array=array)
        codes = [(note.text.rpartition(" ")[2].partition(".")[0], note.t) for note in found.marked.notes]
        notes = tuple(Note(markers[code], t) for code, t in codes if code in markers)
        own = ", ".join(name for name in how.columns if name.startswith(f"{foot} ") and name not in (*pressures, steps))
        facts = Facts(
            path=path,
            array=array,
            kind=maker.lower(),
            label=foot,
            source="steps found by the maker's program" if notes else "",
            side=foot,
            lost=(*[f"columns that are not taxels: {own}"] * bool(own), *found.facts.lost[1:]),
        )
        readers.append(InMemory(facts, frames, Marks(notes=notes)))
    return readers


PEDAR, MOTICON = Kind(knows_pedar, read_pedar), Kind(knows_moticon, read_moticon)
