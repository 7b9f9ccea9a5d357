"""Recordings whose texts are hostile: each name, note, label, unit and topic holds control characters."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel import Note
from taxel.reading import Facts, InMemory, Marks
from taxel.recording import Recording

#: What a terminal would obey, in a name: clear the screen, set its title; C1, DEL, directions, separators.
SEQUENCE = "\x1b[2J\x1b]0;owned\x07\x9b31m\x7f\x08\u202e\u2066\u200e\u200f\u061c\u2028\u2029"
#: A name that would begin a line of its own, as a message of taxel's.
NAME = f"a{SEQUENCE}\n\rtaxel: forged\tz"
#: One for cells of tables, whose lines end with a line break.
CELL = f"a{SEQUENCE}z"
#: A file's name: with a byte that is no UTF-8 too.
FILE = os.fsdecode(f"f{SEQUENCE}\ntaxel: forged\t".encode() + b"\xff\x9b")

CONTROL = re.compile("[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")


def wrong(said: str) -> str:
    """Return what is wrong with a text for people: a control character, or a forged line; "" if nothing."""
    found = CONTROL.search(said)
    if found:
        return f"{found[0]!r} in {said[max(0, found.start() - 200) : found.end() + 50]!r}"
    return next((line for line in said.split("\n") if line.startswith("taxel: forged")), "")


def pressed(n: int = 400) -> np.ndarray[Any, Any]:
    """Values of 2 x 3 taxels with a press in each 80 frames."""
    values = np.random.default_rng(3).integers(0, 3, (n, 2, 3)).astype(float)
    for k in range(40, n, 80):
        values[k : k + 30, :, 1:] += 300
    return values


def frames() -> taxel.Frames:
    """Frames of an array whose name and names of taxels are hostile, in a hostile unit."""
    array = taxel.Array(2, 3, names=[f"{k}{NAME}" for k in range(6)], name=NAME)
    return taxel.Frames(pressed(), np.arange(400) * 10_000, unit=CELL, array=array)


def recording(source: str = NAME) -> Recording:
    """Such frames with hostile notes, detections, source and remarks."""
    found = taxel.Detections([NAME, CELL], [500_000, 900_000], [500_000, 900_000], [1.0, 1.0])
    marks = Marks(notes=(Note(NAME, 300_000, 0), Note(CELL, 600_000, 0)), detections=found)
    table = frames()
    facts = Facts(path=Path("a.bag"), array=table.array, kind="ros", source=source, remarks=(NAME,), lost=(NAME,))
    return Recording.of(InMemory(facts, table, marks))


def labels(place: Path) -> Path:
    """A table of labels with hostile names."""
    rows = "".join(f'"{NAME}",{10_000 * k}\n' for k in range(40, 400, 80))
    place.write_text(f"label,t_us\n{rows}", newline="")
    return place
