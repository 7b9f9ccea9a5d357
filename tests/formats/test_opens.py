"""What strangers' files open as, kept as data: what opens rightly may not open differently by chance."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from syrupy.assertion import SnapshotAssertion

import taxel
from taxel import FormatError, Frames

from .strangers import FILES, TEXTS, written
from .test_table import ROWS

ALL = {**{f"rows: {name}": text for name, (text, _, _) in ROWS.items()}, **TEXTS, **FILES}


def source(recording: taxel.Recording) -> str:
    """Return the size, the times, the sum of the values, the unit and the names of a source."""
    table = recording.events if recording.has_events else recording.frames()
    t, size = table.t, " x ".join(map(str, table.array.shape))
    times = f"{t[0]} to {t[-1]} us, steps {np.unique(np.diff(t)).tolist()[:4]}" if len(t) else "empty"
    if not isinstance(table, Frames):
        return f"{len(t)} events of {size}: {times}, x {table.x.sum()}, on {np.count_nonzero(table.p)}"
    names = ", ".join((table.array.names or ())[:4])
    return f"{len(t)} frames of {size} ({table.unit}): {times}, sum {np.nansum(table.values):.6g}, names {names}"


def outcome(path: Path) -> dict[str, Any] | str:
    """Return what a file opens as, or how many layouts are printed, or the class of its error."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            recordings = taxel.open_all(path, **({"topic": "/palm"} if path.suffix == ".mcap" else {}))
            return {
                f"{each.name} {name}".strip(): source(one) for each in recordings for name, one in each.sources.items()
            }
    except FormatError as error:
        choices = re.findall(r"(?m)^# \d+\. (.*)$", str(error))
        why = str(error).split("\n")[0].rpartition(path.name)[2][:80]
        return f"asked: {' | '.join(choices)}" if choices else f"refused: {why}"
    except IndexError as error:
        return f"crashed: {error}"


@pytest.mark.parametrize("name", ALL)
def test_a_strangers_file_opens_as_before(name: str, tmp_path: Path, snapshot: SnapshotAssertion) -> None:
    if name.startswith("rows: "):
        path = tmp_path / "a.csv"
        path.write_text(ROWS[name.removeprefix("rows: ")][0], "utf-8")
    else:
        path = written(name, tmp_path)
    assert outcome(path) == snapshot
