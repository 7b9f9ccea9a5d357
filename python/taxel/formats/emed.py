"""novel emed plates: the ``.lst`` export, a page for each frame, kPa on 64 x 95 sensors or other sizes.

Each page has a head, the numbers of the printed columns, a line for each row, which begins with the row's number, and
margins: the last column and the last line, ``Force``, are the forces of row and column in N, not sensors. Rows and
columns that are not printed were not loaded. Pages without a frame's number are summaries and are skipped.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import Growing
from taxel._base.limits import TIME_US
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import candidates, files_at, sensor
from taxel.formats.trial import Trial
from taxel.frames import Frames
from taxel.spikes import to_us

__all__ = ["files", "trials"]

_MARGIN = "Force"
#: Characters of a page.
_PAGE = 1 << 26
_NUMBER = r"(\d{1,9}(?:\.\d{1,9})?)"
_HEAD = {
    "matrix": re.compile(r"Matrix:\s*(\d{1,5})\s*x\s*(\d{1,5})", re.ASCII),
    "size": re.compile(rf"Sensor size:\s*{_NUMBER}\s*x\s*{_NUMBER}\s*cm", re.ASCII),
    "period": re.compile(rf"Time/picture:\s*{_NUMBER}\s*ms", re.ASCII),
}
_FRAME_LINE = re.compile(r"Pict-No\.:\s*(\d{1,9})\b", re.ASCII)
#: The force in N of a cell of value 1 and area 1 cm2, by the unit of the cells.
_NEWTON = {"kPa": 0.1, "N/cm2": 1.0}


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.lst`` whose head names the matrix and the time of a frame."""
    return [f for f in candidates(path, "*") if f.suffix.lower() == ".lst" and _is_export(f)]


def _is_export(path: Path) -> bool:
    head = text.first_bytes(path, 65_536)
    return b"Matrix:" in head and b"Time/picture:" in head


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the step of a file, or of all files in a folder.

    Frame 1 is at 0 us. The file does not state its unit: it is the one in which the cells sum to the forces that the
    file states. A page whose cells do not sum to its force is an error.

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Trial
        ``series["total"]`` is the force that each page states, N.

    Raises
    ------
    FormatError : a file that breaks the format (names file and line)
    """
    for file in files_at(path, files, "emed .lst"):
        yield _read(file)


@dataclass(frozen=True)
class _Page:
    """One frame: its number with the line, the sum of its cells, how many are not 0, the force it states."""

    number: int
    line: int
    sum: float
    loaded: int
    force: float
    force_line: int


def _pages(at: int, begin: str, content: Iterator[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield the lines of each page, with the number of the first; the first page begins at line `at` with `begin`."""
    page, size = [begin], 0
    for line in content:
        if _FRAME_LINE.search(line):
            yield at, page
            at, page, size = at + len(page), [], 0
        page.append(line)
        size += len(line)
        if size > _PAGE:
            break  # no page has so many rows: it ends without its forces
    yield at, page


def _read(file: Path) -> Trial:
    content = text.stream(file)
    above, begin = text.before(content, lambda line: _FRAME_LINE.search(line) is not None)
    shape, size, period = _head(file, [*above, *([] if begin is None else [begin])], len(above))
    if begin is None:
        raise FormatError(f"{file.name}: no page states the number of its frame, for example Pict-No.: 1")
    area, pages = size[0] * size[1], list[_Page]()
    read = Growing(file.name, values=(shape, np.float32))
    for first, lines in _pages(len(above) + 1, begin, content):
        page, indices, cells = _page(file, lines, first, shape)
        if pages and page.number <= pages[-1].number:
            raise FormatError(
                f"{file.name}, line {page.line}: frame {page.number} follows frame {pages[-1].number}; the numbers of "
                "frames must ascend"
            )
        frame = np.zeros((1, *shape), np.float32)
        frame[0][np.ix_(*indices)] = cells
        read.add(values=frame)
        pages.append(page)
    t = np.rint(to_us((np.array([page.number for page in pages], np.float64) - 1) * period))
    if t[-1] > TIME_US or (np.diff(t) <= 0).any():
        raise FormatError(
            f"{file.name}: {period:g} ms per frame; must be .001 ms or more, and all frames must end within 142 years"
        )
    # The size is named as the matrix is: across first.
    array = Array(*shape, pitch_mm=(10 * size[1], 10 * size[0]), name="emed plate")
    return Trial(
        name=file.stem,
        person=file.stem,
        recorded=Frames(read.column("values"), t.astype(np.int64), unit=_unit(file, pages, area), array=array),
        truth={},
        source="",
        series={"total": np.array([page.force for page in pages])},
        about={"sensor_cm": f"{size[0]:g} x {size[1]:g}"},
    )


def _head(file: Path, content: Sequence[str], first: int) -> tuple[tuple[int, int], tuple[float, float], float]:
    """Return rows and columns, the size of a sensor in cm, and ms between frames; `first` lines are above pages."""
    head = "\n".join(content)
    matches = {name: pattern.search(head) for name, pattern in _HEAD.items()}
    expected = {"matrix": "Matrix: 64x95", "size": "Sensor size: 0.500x0.500 cm", "period": "Time/picture:10.0 ms"}
    for name, match in matches.items():
        if match is None:
            raise FormatError(f"{file.name}, line {first + 1}: a line like '{expected[name]}' is missing above")
    values = {name: tuple(float(n) for n in match.groups()) for name, match in matches.items() if match is not None}
    for name, numbers in values.items():
        if min(numbers) <= 0:
            raise FormatError(f"{file.name}, line {first + 1}: the {name} above is 0; must be like '{expected[name]}'")
    # The columns are named first, so the printed rows begin after the first number.
    columns, rows = (int(n) for n in values["matrix"])
    if max(rows, columns) > 65_535:
        raise FormatError(f"{file.name}: the matrix has {columns} x {rows} cells; must have at most 65535 on each side")
    sensor(file.name, Array(rows, columns))
    return (rows, columns), (values["size"][0], values["size"][1]), values["period"][0]


def _page(
    file: Path, content: Sequence[str], line: int, shape: tuple[int, int]
) -> tuple[_Page, tuple[NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]]:
    """Return a page, the rows and columns that it prints, and their cells; `line` is the number of its first line."""
    match = _FRAME_LINE.search(content[0])
    assert match is not None  # the page was found by this pattern
    end, before = len(content), line - 1
    head = next((k for k in range(1, end) if content[k].strip()), end)
    names = content[head].split() if head < end else []
    if len(names) < 2 or names[-1] != _MARGIN:
        raise FormatError(
            f"{file.name}, line {before + head + 1}: a line of column numbers that ends in {_MARGIN} is missing here"
        )
    last = next((k for k in range(head + 1, end) if content[k].startswith(_MARGIN)), None)
    if last is None:
        raise FormatError(f"{file.name}, line {before + end}: frame {match[1]} ends without the line {_MARGIN}")
    lines = (row.split() for row in content[head + 1 : last])
    labels = ["row", *(f"column {n}" for n in names[:-1]), _MARGIN]
    read = text.numbers(lines, file, before + head + 2, labels)
    margin = content[last].split()
    if len(margin) != len(names) + 1:
        raise FormatError(f"{file.name}, line {before + last + 1}: {len(margin) - 1} forces; must have {len(names)}")
    numbers = np.array([text.number(n, file, before + head + 1, "column number") for n in names[:-1]])
    indices = (
        _indices(file, before + head + 2, "row", read[:, 0], shape[0], step=1),
        _indices(file, before + head + 1, "column", numbers, shape[1], step=0),
    )
    cells, force = read[:, 1:-1], text.number(margin[-1], file, before + last + 1, _MARGIN)
    page = _Page(int(match[1]), line, float(cells.sum()), int(np.count_nonzero(cells)), force, before + last + 1)
    return page, indices, cells


def _indices(
    file: Path, line: int, noun: str, numbers: NDArray[np.float64], most: int, *, step: int
) -> NDArray[np.int64]:
    """Convert numbers that count from 1 to indices; they must ascend and be on the plate."""
    wrong = (numbers != np.rint(numbers)) | (numbers < 1) | (numbers > most)
    wrong |= np.diff(numbers, prepend=0) <= 0
    if wrong.any():
        k = int(np.flatnonzero(wrong)[0])
        raise FormatError(
            f"{file.name}, line {line + step * k}: {noun} is {numbers[k]:g}; must be whole numbers from 1 to {most} "
            "that ascend"
        )
    return np.asarray(numbers.astype(np.int64) - 1)


def _unit(file: Path, pages: Sequence[_Page], area_cm2: float) -> str:
    """Return the unit in which the cells sum to the forces that the pages state.

    Cells and forces are rounded to hundredths; a page that agrees with neither unit is damaged.
    """
    sums = np.array([page.sum for page in pages]) * area_cm2
    forces = np.array([page.force for page in pages])
    rounding = 0.006 + 0.005 * area_cm2 * np.array([page.loaded for page in pages])
    fits = {unit: np.abs(forces - factor * sums) <= rounding for unit, factor in _NEWTON.items()}
    unit = max(fits, key=lambda name: int(fits[name].sum()))
    wrong = np.flatnonzero(~fits[unit])
    if len(wrong):
        page, found_force = pages[int(wrong[0])], _NEWTON[unit] * sums[wrong[0]]
        raise FormatError(
            f"{file.name}, line {page.force_line}: {_MARGIN} is {page.force:g} N, but the cells of frame "
            f"{page.number} add up to {found_force:g} N ({unit} on {area_cm2:g} cm2)"
        )
    return unit
