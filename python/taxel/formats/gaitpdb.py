"""Eight force sensors under each foot while walking (PhysioNet, Gait in Parkinson's Disease 1.0.0).

A file ``GaCo02_01.txt`` (or ``.txt.gz``) has no header and 19 columns: time in s, 8 sensors of the left foot, 8 of the
right, the two totals, all in N. ``Co`` in the name marks a healthy person, ``Pt`` a patient.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import Growing
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending, candidates, files_at, whole_us
from taxel.formats.layout import load_packaged
from taxel.formats.trial import Trial, scored_around, stances
from taxel.frames import Frames

__all__ = ["contacts", "files", "trials"]

#: Reference events are where this quantity of a foot passes thresholds.
LABELS_OF = "total"
_NAME = re.compile(r"((Ga|Si|Ju)(Co|Pt)\d+)_\d+\.txt(\.gz)?")
_COLUMNS = [
    "time",
    *(f"{side} {k}" for side in ("left", "right") for k in range(1, 9)),
    "total left",
    "total right",
]
_SOURCE = "the total force of this foot: contact above 50 N, foot-off below 25 N, stances of 0.2 s or more"


def files(path: Path) -> list[Path]:
    """Find the files of this format, by their names."""
    return [f for f in candidates(path, "*_*.txt*") if _NAME.fullmatch(f.name)]


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the left and the right foot of one walk, or of all in a folder.

    Reference events are those of ``events.csv`` if the folder has it for that person, else computed by `contacts` (by
    the same rule).

    Yields
    ------
    Trial
        Channels 0 to 7 are sensors 1 to 8 (heel to front) of either foot, at the places that the source states,
        without a unit; ``series["total"]`` is the total force in N.

    Raises
    ------
    FormatError : a file that breaks the format (names file, line and column)
    """
    paths = files_at(path, files, "file such as GaCo02_01.txt")
    layout, foot_of = load_packaged("gaitpdb"), Array(1, 8, name="gaitpdb foot")
    known = _events_table(paths[0].parent / "events.csv")
    for file in paths:
        match = _NAME.fullmatch(file.name)
        assert match is not None  # as `files` chose it
        person = match[1]
        feet = ((8,), np.float32)
        read = Growing(file.name, t=((), np.int64), left=feet, right=feet, totals=((2,), np.float64))
        for line, rows in text.blocks((line.split("\t") for line in text.stream(file)), file, 1, _COLUMNS):
            t = whole_us(file.name, rows[:, 0], line)
            read.add(t=t, left=rows[:, 1:9], right=rows[:, 9:17], totals=rows[:, 17:])
        t = ascending(file.name, read.column("t"))
        if len(t) < 2:
            raise FormatError(f"{file.name}: the file has fewer than 2 lines; must have 2 or more")
        totals = read.column("totals").T
        for foot, total in zip(("left", "right"), totals, strict=True):
            samples = known[person, foot] if (person, foot) in known else contacts(total)
            if samples.size and samples.max() >= len(t):
                raise FormatError(
                    f"events.csv: {person} {foot}, sample {samples.max()} is not in {file.name}, which has "
                    f"{len(t)} lines"
                )
            truth = {"contact": t[samples[:, 0]], "foot_off": t[samples[:, 1]]}
            yield Trial(
                name=f"{file.name.split('.')[0]} {foot}",
                person=person,
                recorded=Frames(read.column(foot).reshape(-1, 1, 8), t, unit="N", array=layout.array(8, foot_of, foot)),
                truth=truth,
                source=_SOURCE,
                foot=foot,
                group="healthy" if match[3] == "Co" else "patient",
                scored=scored_around(truth),
                series={"total": total},
            )


def contacts(total: NDArray[np.float64]) -> NDArray[np.int64]:
    """Find stances in a foot's total force.

    Parameters
    ----------
    total : float64, shape (samples,), N, 100 samples a second

    Returns
    -------
    int64, shape (stances, 2)
        The first sample above 50 N and the next one below 25 N; only stances that begin after the first sample, end
        within the recording and last 20 samples (0.2 s) or more.

    Examples
    --------
    >>> contacts(np.repeat([0.0, 60.0, 30.0, 0.0], 30))
    array([[30, 90]])
    """
    total = arguments.floats("total", total)
    # Above 50 N a foot is loaded, below 25 N not, and between as before.
    above = total > 50
    known = np.flatnonzero(above | (total < 25))
    loaded = above[known]
    turns = np.flatnonzero(loaded[1:] != loaded[:-1]) + 1
    if len(known) and known[0] > 0 and loaded[0]:
        turns = np.append(0, turns)
    stance_times = stances(known[turns[loaded[turns]]], known[turns[~loaded[turns]]])
    return stance_times[stance_times[:, 1] - stance_times[:, 0] >= 20]


def _events_table(path: Path) -> dict[tuple[str, str], NDArray[np.int64]]:
    walks: dict[tuple[str, str], list[list[int]]] = {}
    for row in text.table(path, ["person", "foot", "contact_sample", "off_sample"], optional=True):
        samples = [int(text.number(row[c], path, int(row["line"]), c)) for c in ("contact_sample", "off_sample")]
        if not 0 <= samples[0] < samples[1]:
            raise FormatError(
                f"{path.name}, line {row['line']}: contact is {samples[0]}, off is {samples[1]}; must ascend"
            )
        walks.setdefault((row["person"], row["foot"]), []).append(samples)
    return {key: np.array(rows, np.int64) for key, rows in walks.items()}
