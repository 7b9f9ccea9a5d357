"""Control characters of names in files are escaped where people read them, and kept in files and JSON."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest
import strange
from rich.progress import Progress, TextColumn
from rich.table import Table
from rich.text import Text
from shell import run
from strange import CELL, CONTROL, FILE, NAME

import taxel
from taxel._base.messages import escaped, escaped_lines
from taxel.cli.console import Console

#: What rich moves and colours with on a terminal: no name may bring more.
OWN = re.compile(r"\x1b\[(?:[\d;]*m|\?25[lh]|\d*[ABGK]|2K)|\r")


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A recording whose names are all hostile, in a hostile folder."""
    folder = tmp_path / FILE
    folder.mkdir()
    taxel.convert(strange.recording(), folder / f"{FILE}.mcap")
    return folder / f"{FILE}.mcap"


def test_no_command_prints_a_control_character_of_a_name(place: Path, tmp_path: Path) -> None:
    labels, out = strange.labels(place.with_suffix(".csv")), tmp_path / f"{FILE}.json"
    for code, arguments in (
        (0, ("info", place)),
        (2, ("info", NAME)),
        (0, ("convert", place, tmp_path / f"{FILE}.csv")),
        (2, ("train", place, "--labels", labels, "--recipe", NAME, "-o", out)),
    ):
        done = run(*arguments)
        assert done.returncode == code, (arguments, done)
        for said in (done.stdout, done.stderr):
            assert not strange.wrong(said), (arguments, strange.wrong(said))


@pytest.mark.parametrize("terminal", [False, True])
def test_the_console_shows_texts_of_every_kind_escaped_and_takes_no_markup_of_them(terminal: bool) -> None:
    shown = io.StringIO()
    console = Console(file=shown, force_terminal=terminal, width=1000)
    table = Table(title=NAME)
    table.add_column(NAME)
    table.add_row(NAME)
    table.add_row(Text(CELL))
    for one in (
        NAME,
        f"[/{NAME}] [bold]{NAME}[/bold]",
        table,
        Text(CELL),
    ):
        console.print(one)
    with Progress(TextColumn("{task.description}", markup=False), console=console) as bar:
        bar.add_task(escaped(NAME))
    with console.status(Text(CELL)):
        pass
    text = OWN.sub("", shown.getvalue())
    assert not strange.wrong(text)
    assert "[bold]a" in text
    assert text.count("owned") > 8


def test_json_and_files_keep_the_names(place: Path) -> None:
    facts = json.loads(run("info", place, "--json").stdout)
    assert facts["file"] == str(place)
    assert facts["array"]["name"] == NAME
    assert facts["array"]["names"] == [f"{k}{NAME}" for k in range(6)]
    assert (facts["unit"], facts["source"], facts["lost"]) == (CELL, NAME, [NAME])
    assert set(facts["detections"]) == {NAME, CELL}
    opened = taxel.open(place)
    assert (opened.array.name, opened.frames().unit) == (NAME, CELL)
    assert [note.text for note in opened.notes] == [NAME, CELL]


def test_each_control_character_is_escaped_and_nothing_else() -> None:
    every = "".join(chr(k) for k in range(0x110000))
    left = {k for k, one in enumerate(every) if escaped(one) == one}
    controls = {*range(0x20), *range(0x7F, 0xA0), 0x61C, 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A)}
    assert set(range(0x110000)) - left == controls | set(range(0xD800, 0xE000))
    for one in map(chr, controls):
        assert eval(f"'{escaped(one)}'") == one
        assert escaped(escaped(one)) == escaped(one)
        assert escaped_lines(one) == (one if one == "\n" else escaped(one))
    assert CONTROL.sub("", every) == escaped_lines("".join(map(chr, sorted(left | {10}))))
