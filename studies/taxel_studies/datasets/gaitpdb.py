"""Eight force sensors under each foot while walking (PhysioNet, Gait in Parkinson's Disease 1.0.0).

A file ``GaCo02_01.txt`` (or ``.txt.gz``) has no header and 19 columns: time in s, 8 sensors of the left foot, 8 of the
right, the two totals, all in N. ``Co`` in the name marks a healthy person, ``Pt`` a patient.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Array, FormatError, Frames, Places
from taxel.reading import InMemory
from taxel_studies.datasets import Trial, numbers, readers, scored_around, stances, table, whole_us

__all__ = ["contacts", "knows", "read", "trials"]

_NAME = re.compile(r"((Ga|Si|Ju)(Co|Pt)\d+)_\d+\.txt(\.gz)?")
_COLUMNS = ["time", *(f"{side} {k}" for side in ("left", "right") for k in range(1, 9)), "total left", "total right"]
_SOURCE = "the total force of this foot: contact above 50 N, foot-off below 25 N, stances of 0.2 s or more"
#: The sensors of a left foot, by the data set's format.txt: approximate places in arbitrary units, both feet parallel;
#: there y points forwards, here downwards. The right foot is mirrored.
_X = np.array([-500, -700, -300, -700, -300, -700, -300, -500])
_Y = np.array([800, 400, 400, 0, 0, -400, -400, -800])


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set, by its name."""
    return _NAME.fullmatch(path.name) is not None and path.is_file()


def read(path: Path, _layout: Any = None) -> list[InMemory]:
    """Return a reader of each foot, for `taxel.open`."""
    return readers(path, "gaitpdb", trials(path), labels_of="load")


def trials(path: Path) -> Iterator[Trial]:
    """Yield the left and the right foot of one walk.

    Reference events are those of ``events.csv`` if the folder has it for that person, else computed by `contacts` (by
    the same rule).

    Yields
    ------
    Trial
        Channels 0 to 7 are sensors 1 to 8 (heel to front) of either foot, at the places that the source states,
        without a unit; ``series["total"]`` is the total force in N, ``about`` has the speed of ``people.csv``.

    Raises
    ------
    FormatError : a file that breaks the format (names file and line)
    """
    match = _NAME.fullmatch(path.name)
    assert match is not None  # as `knows` says
    values, person = numbers(path, _COLUMNS), match[1]
    t = whole_us(values[:, 0])
    back = np.flatnonzero(np.diff(t) <= 0)
    if len(t) < 2 or len(back):
        line = back[0] + 2 if len(back) else 1
        raise FormatError(f"{path.name}, line {line}: must have 2 lines or more, whose times ascend")
    known, people = table(path.parent / "events.csv"), table(path.parent / "people.csv")
    # A table of people of the same name may be a user's own.
    has_speeds = {"person", "speed_m_s"} <= {*people}
    speeds = people["speed_m_s"][people["person"] == person].dropna().tolist() if has_speeds else []
    for k, foot in enumerate(("left", "right")):
        total = values[:, 17 + k]
        own = known[(known["person"] == person) & (known["foot"] == foot)] if len(known) else known
        samples = own[["contact_sample", "off_sample"]].to_numpy(np.int64) if len(own) else contacts(total)
        if samples.size and samples.max() >= len(t):
            raise FormatError(f"events.csv: {person} {foot}, sample {samples.max()} is not in {path.name}")
        truth = {"contact": t[samples[:, 0]], "foot_off": t[samples[:, 1]]}
        array = Array(1, 8, name="gaitpdb foot", places=Places(_X if foot == "left" else -_X, _Y))
        yield Trial(
            name=f"{path.name.split('.')[0]} {foot}",
            person=person,
            frames=Frames(values[:, None, 1 + 8 * k : 9 + 8 * k], t, unit="N", array=array),
            truth=truth,
            source=_SOURCE,
            foot=foot,
            group="healthy" if match[3] == "Co" else "patient",
            scored=scored_around(truth),
            series={"total": total},
            about={"speed_m_s": speeds[0]} if speeds else {},
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
    # Above 50 N a foot is loaded, below 25 N not, and between as before.
    above = total > 50
    known = np.flatnonzero(above | (total < 25))
    loaded = above[known]
    turns = np.flatnonzero(loaded[1:] != loaded[:-1]) + 1
    if len(known) and known[0] > 0 and loaded[0]:
        turns = np.append(0, turns)
    stance_times = stances(known[turns[loaded[turns]]], known[turns[~loaded[turns]]])
    return stance_times[stance_times[:, 1] - stance_times[:, 0] >= 20]
