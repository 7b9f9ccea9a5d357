"""Moticon OpenGo insoles, 16 sensors for each foot: the text export.

Lines with ``#``, of which the last has the column names (separated by tabs), then a line for each frame: time in s; for
each foot 16 pressures in N/cm2, accelerations, rates, total force in N, centre of pressure; then the markers of the
manufacturer's step detection.
"""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import numpy as np

from taxel._base.errors import unreadable
from taxel._base.table_text import Text, beginning
from taxel.array import Array
from taxel.formats.column_names import time_unit
from taxel.formats.layout import Layout, Table
from taxel.formats.table import read_table
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import Facts, InMemory, Marks

#: Markers in the columns of steps, by the foot.
MARKERS = {"left": {"11": "contact", "15": "foot_off"}, "right": {"21": "contact", "25": "foot_off"}}


def knows(path: Path) -> bool:
    """Return whether a file is of this kind: a ``.txt`` with a comment that names the sensor insoles."""
    head = beginning(path, 4096).removeprefix(b"\xef\xbb\xbf") if path.suffix.lower() == ".txt" else b""
    return head.startswith(b"#") and b"Sensor insoles" in head


def read(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the left foot, and one of the right, with the maker's steps as notes.

    A line whose cells are empty for a foot is missing for that foot, so its times jump there.

    Raises
    ------
    FormatError : no columns of pressures, or no table of numbers below them
    """
    above = list(takewhile(lambda line: line.startswith("#"), Text(path).head))
    names = above[-1].lstrip("# ").split("\t")
    time = next((name for name in names if time_unit(name) is not None), None)
    readers = list[InMemory]()
    for foot, markers in MARKERS.items():
        pressures = [name for name in names if name.startswith(f"{foot} pressure ")]
        if time is None or not pressures:
            raise unreadable(f"must have the columns time and '{foot} pressure 1' ...", path, line=len(above))
        steps = next((name for name in names if name.startswith(f"{foot} steps")), None)
        how = Table(
            separator="\t",
            skip_lines=len(above),
            columns=names,
            time_column=time,
            keep=f"{foot} pressure *",
            label_column=steps,
        )
        [found] = read_table(path, Layout(path, unit="N/cm2", table=how))
        both = found.data
        assert isinstance(both, Frames)  # the layout says so
        there = ~np.isnan(both.values).any(axis=(1, 2))
        array = Array(1, len(pressures), name="Moticon insole")
        frames = Frames(both.values[there], both.t[there], unit=both.unit, array=array)
        codes = [(note.text.rpartition(" ")[2].partition(".")[0], note.t) for note in found.marked.notes]
        notes = tuple(Note(markers[code], t) for code, t in codes if code in markers)
        own = ", ".join(name for name in names if name.startswith(f"{foot} ") and name not in (*pressures, steps))
        facts = Facts(
            path=path,
            array=array,
            kind="moticon",
            label=foot,
            source="steps found by the maker's program" if notes else "",
            side=foot,
            lost=(f"columns that are not taxels: {own}", *found.facts.lost[1:]),
        )
        readers.append(InMemory(facts, frames, Marks(notes=notes)))
    return readers
