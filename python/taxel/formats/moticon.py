"""Moticon OpenGo insoles, 16 sensors for each foot: the text export.

Lines with ``#``, of which the last has the column names (separated by tabs), then a row for each frame: time in s; for
each foot 16 pressures in N/cm2, accelerations, rates, total force in N, centre of pressure; then the markers of the
manufacturer's step detection.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import Growing
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending, candidates, files_at, whole_us
from taxel.formats.trial import Trial, scored_around
from taxel.frames import Frames

__all__ = ["MARKERS", "files", "trials"]

#: Markers in the step columns: foot and event.
MARKERS = {
    11: ("left", "contact"),
    15: ("left", "foot_off"),
    21: ("right", "contact"),
    25: ("right", "foot_off"),
}
_SOURCE = "steps found by the maker's program (neither the first nor the last loaded frame)"


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.txt`` with a comment that names the sensor insoles."""
    return [f for f in candidates(path, "*.txt") if f.suffix == ".txt" and _is_export(f)]


def _is_export(path: Path) -> bool:
    head = text.first_bytes(path, 4096)
    return head.lstrip(b"\xef\xbb\xbf").startswith(b"#") and b"Sensor insoles" in head


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the left and the right foot of one recording, or of all in a folder.

    A row whose cells are empty for a foot is missing for that foot, so its times jump there. Reference events are those
    of ``steps.csv`` (from the manufacturer's reports) if the folder has it, else the markers in the file; they are
    complete from the first marker of a foot to the last.

    Yields
    ------
    Trial
        ``series["total"]`` is the manufacturer's total force in N.

    Raises
    ------
    FormatError : a file that breaks the format (names file, line and column)
    """
    paths = files_at(path, files, "Moticon text export (lines that begin with # and name the sensor insoles)")
    steps = _steps_table(paths[0].parent / "steps.csv")
    for file in paths:
        yield from _read(file, steps.get(file.stem))


def _read(file: Path, steps: dict[tuple[str, str], list[float]] | None) -> Iterator[Trial]:
    content = text.stream(file)
    above, begin = text.before(content, lambda line: not line.startswith("#"))
    head = len(above)
    if head == 0 or begin is None:
        raise FormatError(
            f"{file.name}, line {head + 1}: the file must begin with lines that begin with #, of which the last "
            "contains the names of columns; rows must follow"
        )
    names = above[-1].lstrip("# ").split("\t")
    about = dict(line[2:].split(": ", 1) for line in above[:-1] if ": " in line)
    first = head + 1
    at = _column(names, r"time\b.*", file, head)
    chosen = {foot: _columns(names, foot, file, head) for foot in ("left", "right")}
    t = Growing(file.name, t=((), np.int64))
    read = {
        foot: Growing(file.name, t=((), np.int64), values=((len(columns) - 1,), np.float32), total=((), np.float64))
        for foot, columns in chosen.items()
    }
    marked: dict[tuple[str, str], list[int]] = {marker: [] for marker in MARKERS.values()}
    table = (line.split("\t") for line in chain([begin], content))
    for line, rows in text.group_rows(table, file, first, len(names)):
        seconds = text.numbers([[row[at]] for row in rows], file, line, ["time"])[:, 0]
        times = whole_us(file.name, seconds, line)
        t.add(t=times)
        _mark(marked, rows, names, times, file, line)
        for foot, columns in chosen.items():
            there = [k for k, row in enumerate(rows) if _is_there(row, columns, names, file, line + k)]
            labels, cells = [names[c] for c in columns], [[rows[k][c] for c in columns] for k in there]
            values = _numbers(cells, file, [line + k for k in there], labels)
            read[foot].add(t=times[there], values=values[:, :-1], total=values[:, -1])
    ascending(file.name, t.column("t"), first)
    steps_location = f"steps.csv, {file.stem}"
    for foot, columns in chosen.items():
        readings = read[foot]
        truth = {
            event: ascending(steps_location, whole_us(steps_location, np.array(steps[foot, event])))
            if steps
            else np.array(marked[foot, event], np.int64)
            for event in ("contact", "foot_off")
        }
        yield Trial(
            name=f"{file.stem} {foot}",
            person=about.get("Sensor insoles", "moticon"),
            recorded=Frames(
                readings.column("values")[:, None],
                readings.column("t"),
                unit="N/cm2",
                array=Array(1, len(columns) - 1, name="Moticon insole"),
            ),
            truth=truth,
            source=_SOURCE,
            foot=foot,
            scored=scored_around(truth),
            series={"total": readings.column("total")},
            about=about,
            unread=tuple(name for k, name in enumerate(names) if k not in columns and name.startswith(f"{foot} ")),
        )


def _column(names: list[str], pattern: str, file: Path, line: int) -> int:
    for k, name in enumerate(names):
        if re.fullmatch(pattern, name):
            return k
    raise FormatError(f"{file.name}, line {line}: no column matches {pattern!r}")


def _columns(names: list[str], foot: str, file: Path, line: int) -> list[int]:
    """Return which columns are the pressures and, last, the total force of a foot."""
    pressures = [k for k, name in enumerate(names) if re.match(rf"{foot} pressure \d+", name)]
    if not pressures:
        raise FormatError(f"{file.name}, line {line}: column '{foot} pressure 1' is missing")
    return [*pressures, _column(names, rf"{foot} total force.*", file, line)]


def _is_there(row: Sequence[str], columns: list[int], names: list[str], file: Path, line: int) -> bool:
    """Return whether a foot has values in a row; a row that has some of them is an error."""
    empty = [c for c in columns if not row[c].strip()]
    if empty and len(empty) < len(columns):
        raise FormatError(
            f"{file.name}, line {line}: {names[empty[0]]} is empty; must have a number, because other cells of "
            f"this foot have one"
        )
    return not empty


def _numbers(cells: list[list[str]], file: Path, lines: list[int], labels: list[str]) -> NDArray[np.float64]:
    """Return the numbers of rows that have values; where one is none, the row is read by itself to name its line."""
    try:
        return text.numbers(cells, file, 0, labels)
    except FormatError:
        return np.concatenate([text.numbers([row], file, at, labels) for row, at in zip(cells, lines, strict=True)])


def _mark(
    marked: dict[tuple[str, str], list[int]],
    rows: Sequence[Sequence[str]],
    names: list[str],
    t: NDArray[np.int64],
    file: Path,
    first: int,
) -> None:
    """Add the markers of some rows."""
    columns = [k for k, name in enumerate(names) if re.match(r"(left|right) steps", name)]
    for k, row in enumerate(rows):
        for c in columns:
            if row[c].strip():
                code = int(text.number(row[c], file, first + k, names[c]))
                if code not in MARKERS:
                    raise FormatError(
                        f"{file.name}, line {first + k}: marker is {code}; must be one of {sorted(MARKERS)}"
                    )
                marked[MARKERS[code]].append(int(t[k]))


def _steps_table(path: Path) -> dict[str, dict[tuple[str, str], list[float]]]:
    recordings: dict[str, dict[tuple[str, str], list[float]]] = {}
    for row in text.table(path, ["recording", "foot", "contact_s", "toe_off_s"], optional=True):
        times = recordings.setdefault(row["recording"], {(f, e): [] for f, e in MARKERS.values()})
        if row["foot"] not in {"left", "right"}:
            raise FormatError(f"{path.name}, line {row['line']}: foot is {row['foot']!r}; must be left or right")
        for column, event in (("contact_s", "contact"), ("toe_off_s", "foot_off")):
            times[row["foot"], event].append(text.number(row[column], path, int(row["line"]), column))
    return recordings
