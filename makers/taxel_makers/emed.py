"""novel emed plates: the ``.lst`` export, a page for each frame, kPa on 64 x 95 sensors or other sizes.

Each page has a head, the numbers of the printed columns, a line for each row, which begins with the row's number, and
margins: the last column and the last line, ``Force``, are the forces of row and column in N, not sensors. Rows and
columns that are not printed were not loaded. Pages without a frame's number are summaries and are skipped.
"""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from taxel import Array, Frames, ProblemError
from taxel.formats.layout import Layout
from taxel.reading import Facts, InMemory, Text, beginning, unreadable

_NUMBER = r"(\d+(?:\.\d+)?)"
_HEAD = re.compile(
    rf"(?s)(?=.*Matrix:\s*(\d+)\s*x\s*(\d+))(?=.*Sensor size:\s*{_NUMBER}\s*x\s*{_NUMBER}\s*cm)"
    rf"(?=.*Time/picture:\s*{_NUMBER}\s*ms)",
    re.ASCII,
)
_PAGE = re.compile(r"(?m)^.*Pict-No\.:\s*(\d+)\b", re.ASCII)
#: The numbers of the columns; the lines of the rows; the forces of the columns, of which the last is that of the page.
_CELLS = re.compile(r"(?ms)^\s*((?:\d+\s+)+)Force\s*$\n(.*?)^Force\b[^\n]*?(\S+)[ \t\r]*$", re.ASCII)
#: The force in N of a cell of value 1 and area 1 cm2, by the unit of the cells.
_NEWTON = {"kPa": 0.1, "N/cm2": 1.0}


def knows(path: Path) -> bool:
    """Return whether a file is of this kind: an ``.lst`` whose head names the matrix and the time of a frame."""
    head = beginning(path) if path.suffix.lower() == ".lst" else b""
    return b"Matrix:" in head and b"Time/picture:" in head


def read(path: Path, _layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of the step; frame 1 is at 0 us.

    The file does not state its unit: it is the one in which the cells sum to the forces that the file states.

    Raises
    ------
    FormatError : no head with size and period, or a page that is cut or damaged (names its frame)
    """
    import pandas as pd  # noqa: PLC0415  takes long

    text = "\n".join(Text(path).lines())
    pages = list(_PAGE.finditer(text))
    head = _HEAD.match(text[: pages[0].end()]) if pages else None
    if head is None:
        raise unreadable("must state Matrix, Sensor size, Time/picture and Pict-No. above the first frame", path)
    columns, rows = int(head[1]), int(head[2])
    across, down, period_ms = (float(number) for number in head.groups()[2:])
    values, forces = np.zeros((len(pages), rows, columns), np.float32), np.zeros(len(pages))
    ends = [page.start() for page in pages[1:]] + [len(text)]
    for k, (page, end) in enumerate(zip(pages, ends, strict=True)):
        cells = _CELLS.search(text, page.end(), end)
        try:
            if cells is None:
                raise ValueError
            places = np.array(cells[1].split(), int) - 1
            table = pd.read_csv(io.StringIO(cells[2]), sep=r"\s+", header=None, index_col=0, dtype=np.float32)
            values[k][np.ix_(table.index.astype(int) - 1, places)] = table.iloc[:, :-1]
            forces[k] = float(cells[3])
        except (ValueError, IndexError):
            raise unreadable(f"the page of frame {page[1]} is damaged, or its end is missing", path) from None
    sums = values.sum(axis=(1, 2), dtype=np.float64) * across * down
    unit = min(_NEWTON, key=lambda name: float(np.abs(forces - _NEWTON[name] * sums).sum()))
    t = np.rint(1000 * period_ms * np.array([int(page[1]) - 1 for page in pages])).astype(np.int64)
    # The size is named as the matrix is: across first.
    array = Array(rows, columns, (10 * down, 10 * across), name="emed plate")
    try:
        frames = Frames(values, t, unit=unit, array=array)
    except ProblemError as error:
        raise unreadable(str(error), path) from None
    return [InMemory(Facts(path=path, array=array, kind="emed"), frames)]
