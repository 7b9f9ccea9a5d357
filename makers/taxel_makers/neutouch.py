"""NeuTouch skins of two fingers: the text ``.tact``, a line an event, ``is_negative taxel unix_s``.

1 is a decrease; some files have two more times behind. The taxels, 0 to 79, have no places
(T. Taunyazov and others, Event-Driven Visual-Tactile Sensing and Learning for Robots, RSS 2020).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from taxel import Array
from taxel.formats.layout import Layout, Table
from taxel.formats.table import read_table
from taxel.reading import InMemory, Text


def knows(path: Path) -> bool:
    """Return whether a file is of this kind, by its ending."""
    return path.is_file() and path.suffix.lower() == ".tact"


def read(path: Path, layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the events, on a row of 80 taxels, or on the rows and columns of a layout.

    Raises
    ------
    FormatError : no table of events
    """
    more = ["later", "last"][: max(map(len, map(str.split, Text(path).head[:9])), default=3) - 3]
    how = Table(
        separator=" ",
        columns=["is_negative", "taxel", "time", *more],
        time_column="time",
        leave_out=more,
        events=True,
    )
    stated = replace(layout or Layout(path), table=how)
    readers = read_table(path, stated, Array(1, 80, name="NeuTouch"))
    return [replace(each, facts=replace(each.facts, kind="neutouch")) for each in readers]
