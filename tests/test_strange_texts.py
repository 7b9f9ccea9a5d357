"""Control characters of names in files are escaped where people read them, and kept in files and JSON."""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

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


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    made = strange.write(tmp_path_factory.mktemp("strange"))
    neuron = (taxel.Neuron(tau=2.0), [0.5] * 12)
    levels = taxel.encode.LevelCrossing(levels=[50.0])
    made["readout"] = made[".mcap"].parent / f"{FILE} readout.json"
    taxel.Readout(levels, {NAME: neuron, CELL: neuron}, array=strange.frames().array, unit=CELL).save(made["readout"])
    return made


#: Commands that show names of every kind: of files, sensors, topics, labels, columns and arrays.
COMMANDS: dict[str, Callable[[dict[str, Path], Path], list[list[Any]]]] = {
    "info": lambda places, _: [["info", place] for place in (*places.values(), NAME)],
    "convert": lambda places, out: [["convert", places[name], out / f"{FILE}.csv"] for name in (".mcap", "events")],
    "detect": lambda places, out: [
        ["detect", places[".mcap"], "--readout", places["readout"], "--truth", "notes", "--report", out / FILE]
    ],
    "train": lambda places, out: [
        ["train", places[".mcap"], "--labels", places["labels"], "--recipe", NAME, "-o", out / f"{FILE}.json"]
    ],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_prints_a_control_character_of_a_name(name: str, places: dict[str, Path], tmp_path: Path) -> None:
    for arguments in COMMANDS[name](places, tmp_path):
        done = run(*arguments)
        assert done.returncode in (0, 2), (arguments, done)
        for said in (done.stdout, done.stderr):
            assert not strange.wrong(said), (arguments, strange.wrong(said))
    for page in tmp_path.rglob("*.html"):
        said = page.read_text()
        assert "owned" in said
        # Libraries of the page indent by tabs.
        assert not strange.wrong(said.replace("\t", "")), page


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


def test_json_and_files_keep_the_names(places: dict[str, Path], tmp_path: Path) -> None:
    facts = json.loads(run("info", places[".mcap"], "--json").stdout)
    assert facts["file"] == str(places[".mcap"])
    assert facts["array"]["name"] == NAME
    assert facts["array"]["names"] == [f"{k}{NAME}" for k in range(6)]
    assert (facts["unit"], facts["source"], facts["lost"]) == (CELL, NAME, [NAME])
    assert set(facts["detections"]) == {NAME, CELL}
    topics = json.loads(run("info", places["bag"], "--json").stdout)["topics"]
    assert {one["topic"] for one in topics} == {f"/{NAME}", f"/b{CELL}"}
    for ending in (".mcap", ".npz", ".h5"):
        opened = taxel.open(places[ending])
        assert (opened.array.name, opened.frames().unit) == (NAME, CELL)
        assert [note.text for note in opened.notes] == ([NAME, CELL] if ending == ".mcap" else [])
    assert list(taxel.Readout.load(places["readout"]).labels) == [NAME, CELL]


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
