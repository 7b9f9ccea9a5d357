"""novel pedar insoles: the ``.asc`` export, usually 2 x 99 sensors in kPa.

Some header lines, one of column names (``time[secs]``, then the sensors' numbers, left insole first), then a line for
each frame.
"""

from __future__ import annotations

import re
from pathlib import Path

from taxel._base.errors import unreadable
from taxel._base.table_text import Text, beginning
from taxel.array import Array
from taxel.formats.layout import Layout, Table
from taxel.formats.table import read_table
from taxel.frames import Frames
from taxel.reading import Facts, InMemory


def knows(path: Path) -> bool:
    """Return whether a file is of this kind: an ``.asc`` whose head names pressures."""
    return path.suffix.lower() == ".asc" and b"pressure values" in beginning(path)


def read(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the left insole, and one of the right.

    Raises
    ------
    FormatError : no line of column names of two insoles, or no table of numbers below it
    """
    head = Text(path).head
    first = next((k for k, line in enumerate(head) if line.startswith("time[secs]")), len(head))
    names = head[first].split() if first < len(head) else []
    begins = [k for k, name in enumerate(names) if name == "1"]
    if len(begins) != 2:
        raise unreadable("must have a line of column names (time[secs] 1 2 ... 1 2 ...) of two insoles", path)
    unit = re.search(r"pressure values in\s+(\S+)", "\n".join(head[:first]))
    columns = [f"sensor {k}" for k in range(1, len(names))]
    how = Table(separator=" ", skip_lines=first + 1, columns=["time", *columns], time_column=1)
    [found] = read_table(path, Layout(path, unit=unit[1] if unit else "kPa", table=how))
    both = found.data
    assert isinstance(both, Frames)  # the layout says so
    readers = list[InMemory]()
    for foot, part in (("left", slice(0, begins[1] - 1)), ("right", slice(begins[1] - 1, len(columns)))):
        values = both.values[:, :, part]
        array = Array(1, values.shape[2], name="pedar insole")
        facts = Facts(path=path, array=array, kind="pedar", label=foot, side=foot, lost=found.facts.lost)
        readers.append(InMemory(facts, Frames(values, both.t, unit=both.unit, array=array)))
    return readers
