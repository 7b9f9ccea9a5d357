"""Moticon insoles as taxel reads them, with the maker's step times and total force."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import numpy as np

import taxel
from taxel_studies.datasets import Trial, scored_around, table, whole_us

__all__ = ["knows", "trials"]

_SOURCE = "steps found by the maker's program (neither the first nor the last loaded frame)"


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: a ``.txt`` with a comment that names the sensor insoles."""
    return path.suffix == ".txt" and b"Sensor insoles" in path.read_bytes()[:4096]


def trials(path: Path) -> Iterator[Trial]:
    """Yield the left and the right foot of one recording.

    Reference events are those of ``steps.csv`` (from the manufacturer's reports) if the folder has it, else the markers
    in the file; they are complete from the first marker of a foot to the last.

    Yields
    ------
    Trial
        ``series["total"]`` is the manufacturer's total force in N.

    Raises
    ------
    FormatError : a file that breaks the format (names the file)
    """
    import pandas as pd  # noqa: PLC0415  takes long

    above = list(takewhile(lambda line: line.startswith("#"), path.read_text("utf-8-sig").splitlines()))
    about = dict(line[2:].split(": ", 1) for line in above[:-1] if ": " in line)
    columns = above[-1].lstrip("# ").split("\t")
    cells = pd.read_csv(path, sep="\t", skiprows=len(above), names=columns, index_col=False)
    steps = table(path.parent / "steps.csv")
    for foot, recording in taxel.open(path).sources.items():
        frames = recording.frames()
        force = next(name for name in columns if name.startswith(f"{foot} total force"))
        total = cells[force].dropna().to_numpy(np.float64)
        if len(steps):
            own = steps[(steps["recording"] == path.stem) & (steps["foot"] == foot)]
            truth = {"contact": whole_us(own["contact_s"]), "foot_off": whole_us(own["toe_off_s"])}
        else:
            truth = {
                event: np.array([note.t for note in recording.notes if note.text == event], np.int64)
                for event in ("contact", "foot_off")
            }
        yield Trial(
            name=f"{path.stem} {foot}",
            person=about.get("Sensor insoles", "moticon"),
            frames=frames,
            truth=truth,
            source=_SOURCE,
            foot=foot,
            scored=scored_around(truth),
            series={"total": total},
            about=about,
        )
