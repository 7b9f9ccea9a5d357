"""Tables of text beside a layout file."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taxel
from taxel import FormatError, Frames
from taxel._base.errors import Place
from taxel.formats.layout import Layout, of_layout
from taxel.formats.table import read_table
from taxel.reading import InMemory

VALUES = np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 7.0], [6.5, 0.0, 1.0, 2.0, 3.0, 4.0], [9.0, 8.0, 7.0, 6.0, 5.0, 4.0]])


def table(folder: Path, text: str, layout: str, name: str = "step.txt") -> Any:
    (folder / name).write_text(text)
    (folder / f"{name.split('.', maxsplit=1)[0]}.layout.toml").write_text(layout)
    return taxel.open(folder / name)


def lines(values: np.ndarray, separator: str = ",") -> str:
    return "".join(separator.join(f"{v:g}" for v in row) + "\n" for row in values)


@dataclass(frozen=True)
class Opened:
    """What a file of another program holds, and the line that says how it was read."""

    sources: dict[str, taxel.Frames | taxel.Events]
    timed: bool
    layout: Layout
    said: str
    labels: tuple[tuple[str, int | None], ...]
    lost: tuple[str, ...]


def opened_by(read: Callable[[Path, Layout], list[InMemory]], path: Path, layout: str | None) -> Opened:
    beside = path.parent / "a.layout.toml"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        readers = read(path, Layout(path) if layout is None else Layout.of_text(beside, layout))
    facts = readers[0].facts
    return Opened(
        {each.facts.label.replace("board", ""): each.data for each in readers},
        facts.timed,
        Layout.of_text(beside, facts.layout),
        "".join(str(warning.message) for warning in caught),
        tuple((note.text, note.t) for note in readers[0].marked.notes),
        facts.lost,
    )


def opened(folder: Path, text: str | bytes, layout: str | None = None, name: str = "a.csv") -> Opened:
    """Open a table; the layout that is printed of it, pasted, must give the same."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    if layout is not None:
        return opened_by(read_table, path, layout)
    found = opened_by(read_table, path, None)
    assert found.said.startswith(f"{name}: read as ")
    assert "\n" not in found.said
    again = opened_by(read_table, path, of_layout(found.layout))
    assert again.sources == found.sources
    assert again.timed == found.timed
    assert {*parts(again.said)} <= {*parts(found.said)}
    assert "left out: labels" not in again.said
    return found


def parts(said: str) -> list[str]:
    """Return what a line says of how a file was read."""
    return [part for part in said.partition(" taxel")[2].partition(": ")[2].split("; ") if part]


def layouts(folder: Path, text: str, name: str = "a.csv") -> list[str]:
    """Return the layouts of a table that can be read in several ways; each must open it."""
    path = folder / name
    path.write_text(text)
    with pytest.raises(FormatError) as caught:
        read_table(path, Layout(path))
    assert caught.value.place == Place(str(path))
    printed = str(caught.value).partition("\n")[2]
    found = [part.partition("\n")[2] for part in re.split(r"(?m)^# \d+\. ", printed)[1:]]
    return [answered(path, layout) for layout in found]


def answered(path: Path, layout: str) -> str:
    """Return a layout that opens a table; what is still open is answered by the first layout that is printed."""
    for _ in range(4):
        try:
            opened_by(read_table, path, layout)
        except FormatError as error:
            printed = str(error).partition("\n")[2]
            if not printed:
                raise
            layout = re.split(r"(?m)^# \d+\. .*$", printed)[1].strip() + "\n"
        else:
            return layout
    raise AssertionError(layout)


def frames(found: Opened, source: str = "") -> tuple[list[int], list[Any]]:
    table = found.sources[source]
    assert isinstance(table, Frames)
    return table.t.tolist(), table.values.reshape(len(table), -1).tolist()
