"""Moticon OpenGo insoles, 16 sensors a foot: the text export.

Lines with ``#``, of which the last has the column names (separated by tabs), then a row a frame: time in s; for each
foot 16 pressures in N/cm2, accelerations, rates, total force in N, centre of pressure; then the markers of the
manufacturer's step detection.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending_us
from taxel.formats.trial import MARGIN_US, Trial
from taxel.frames import Frames

__all__ = ["MARKERS", "files", "trials"]

#: Markers in the step columns: foot and event.
MARKERS = {
    11: ("left", "contact"),
    15: ("left", "foot_off"),
    21: ("right", "contact"),
    25: ("right", "foot_off"),
}
_SOURCE = "the maker's step finder (neither the first nor the last loaded frame)"


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.txt`` with a comment that names the sensor insoles."""
    candidates = sorted(path.glob("*.txt")) if path.is_dir() else [path]
    return [f for f in candidates if f.suffix == ".txt" and _is_export(f)]


def _is_export(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(4096)
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
    place = Path(arguments.path("path", path))
    paths = files(place)
    if not paths:
        raise FormatError(f"{place}: no Moticon text export in it (lines of # that name the sensor insoles)")
    steps = _steps_table((place if place.is_dir() else place.parent) / "steps.csv")
    for file in paths:
        yield from _read(file, steps.get(file.stem))


def _read(file: Path, steps: dict[tuple[str, str], list[float]] | None) -> Iterator[Trial]:
    content = text.lines(file)
    head = next((k for k, line in enumerate(content) if not line.startswith("#")), len(content))
    if head == 0 or head == len(content):
        raise FormatError(f"{file.name}, line {head + 1}: must hold lines of #, column names the last, then rows")
    names = content[head - 1].lstrip("# ").split("\t")
    about = dict(line[2:].split(": ", 1) for line in content[: head - 1] if ": " in line)
    rows = [line.split("\t") for line in content[head:]]
    first = head + 1
    for k, row in enumerate(rows):
        if len(row) != len(names):
            raise FormatError(f"{file.name}, line {first + k}: {len(row)} cells, must have {len(names)}")
    at = _column(names, r"time\b.*", file, head)
    seconds = text.numbers([[row[at]] for row in rows], file, first, ["time"])[:, 0]
    t = ascending_us(file.name, seconds, first)
    marked = _markers(rows, names, t, file, first)
    for foot in ("left", "right"):
        pressures = [k for k, name in enumerate(names) if re.match(rf"{foot} pressure \d+", name)]
        if not pressures:
            raise FormatError(f"{file.name}, line {head}: no column '{foot} pressure 1'")
        total = _column(names, rf"{foot} total force.*", file, head)
        chosen = [*pressures, total]
        there = []
        for k, row in enumerate(rows):
            empty = sum(not row[c].strip() for c in chosen)
            if empty == 0:
                there.append(k)
            elif empty < len(chosen):
                c = next(c for c in chosen if not row[c].strip())
                raise FormatError(
                    f"{file.name}, line {first + k}: {names[c]} is empty, other cells of that foot are not"
                )
        labels = [names[c] for c in chosen]
        values = np.array(
            [text.numbers([[rows[k][c] for c in chosen]], file, first + k, labels)[0] for k in there]
        ).reshape(len(there), len(chosen))
        truth = {
            event: ascending_us(f"steps.csv, {file.stem}", np.array(steps[foot, event]))
            if steps
            else marked[foot, event]
            for event in ("contact", "foot_off")
        }
        ends = [times for times in truth.values() if len(times)]
        yield Trial(
            name=f"{file.stem} {foot}",
            person=about.get("Sensor insoles", "moticon"),
            recorded=Frames(
                values[:, None, :-1],
                t[there],
                unit="N/cm2",
                array=Array(1, len(pressures), name="Moticon insole"),
            ),
            truth=truth,
            source=_SOURCE,
            foot=foot,
            scored=(min(int(e[0]) for e in ends) - MARGIN_US, max(int(e[-1]) for e in ends) + MARGIN_US)
            if ends
            else (0, 0),
            series={"total": values[:, -1]},
            about=about,
            unread=tuple(name for k, name in enumerate(names) if k not in chosen and name.startswith(f"{foot} ")),
        )


def _column(names: list[str], pattern: str, file: Path, line: int) -> int:
    for k, name in enumerate(names):
        if re.fullmatch(pattern, name):
            return k
    raise FormatError(f"{file.name}, line {line}: no column that matches {pattern!r}")


def _markers(
    rows: list[list[str]], names: list[str], t: NDArray[np.int64], file: Path, first: int
) -> dict[tuple[str, str], NDArray[np.int64]]:
    by_place: dict[tuple[str, str], list[int]] = {place: [] for place in MARKERS.values()}
    columns = [k for k, name in enumerate(names) if re.match(r"(left|right) steps", name)]
    for k, row in enumerate(rows):
        for c in columns:
            if row[c].strip():
                code = int(text.number(row[c], file, first + k, names[c]))
                if code not in MARKERS:
                    raise FormatError(f"{file.name}, line {first + k}: marker {code}; must be one of {sorted(MARKERS)}")
                by_place[MARKERS[code]].append(int(t[k]))
    return {place: np.array(times, np.int64) for place, times in by_place.items()}


def _steps_table(path: Path) -> dict[str, dict[tuple[str, str], list[float]]]:
    if not path.exists():
        return {}
    recordings: dict[str, dict[tuple[str, str], list[float]]] = {}
    for row in text.table(path, ["recording", "foot", "contact_s", "toe_off_s"]):
        places = recordings.setdefault(row["recording"], {(f, e): [] for f, e in MARKERS.values()})
        if row["foot"] not in {"left", "right"}:
            raise FormatError(f"{path.name}, line {row['line']}: foot {row['foot']!r}; must be left or right")
        for column, event in (("contact_s", "contact"), ("toe_off_s", "foot_off")):
            places[row["foot"], event].append(text.number(row[column], path, int(row["line"]), column))
    return recordings
