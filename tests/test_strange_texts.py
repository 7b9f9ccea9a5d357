"""Control characters of strangers' texts are escaped where people read them, and kept in files and JSON."""

from __future__ import annotations

import ast
import csv
import io
import json
import os
import pty
import re
import select
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import strange
import typer
from loopback import free_port
from rich.console import Group
from rich.panel import Panel
from rich.progress import Progress, TextColumn
from rich.table import Table
from rich.text import Text
from shell import run
from strange import CELL, CONTROL, FILE, NAME

import taxel
from taxel._base.messages import escaped, escaped_lines, warn
from taxel.cli import app
from taxel.cli.console import Console

#: What rich moves and colours with on a terminal: no name may bring more.
OWN = re.compile(r"\x1b\[(?:[\d;]*m|\?25[lh]|\d*[ABGK]|2K)|\r")


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    made = strange.write(tmp_path_factory.mktemp("strange"))
    folder = made[".mcap"].parent
    neuron = (taxel.Neuron(tau=2.0), [0.5] * 12)
    levels = taxel.encode.LevelCrossing(levels=[50.0])
    made["readout"] = folder / f"{FILE} readout.json"
    taxel.Readout(levels, {NAME: neuron, CELL: neuron}, array=strange.frames().array, unit=CELL).save(made["readout"])
    made["other readout"] = folder / f"{FILE} other.json"
    other = taxel.Array(2, 3, pitch_mm=3.0, name=NAME)
    taxel.Readout(levels, {NAME: neuron}, array=other, unit=NAME).save(made["other readout"])
    made["spikes"] = folder / f"{FILE} spikes.npz"
    levels.encode(strange.frames()).save(made["spikes"])
    made["scene"] = folder / f"{FILE}.toml"
    made["scene"].write_text(f"{strange.toml(NAME)} = 3\n")
    made["recipe"] = folder / f"{FILE} recipe.toml"
    made["recipe"].write_text(f"about = {strange.toml(NAME)}\n[encoder]\nname = {strange.toml(NAME)}\n")
    (folder / "labels.csv").write_text(f'recording,label,t_us\n"{CELL}","{CELL}",3\n', newline="")
    return made


Commands = Callable[[dict[str, Path], Path], Iterator[list[Any]]]


def info(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    for place in places.values():
        yield ["info", place]
        yield ["info", place, "--topic", f"/{NAME}"]
    yield ["info", places["table"].parent]
    yield ["info", places[".npz"], "--picture", out / f"{FILE}.png", "--table", out / f"{FILE}.csv"]
    yield ["info", places[".npz"], "--tare", NAME]
    yield ["info", NAME]
    yield ["info", places["bag"], "--topic", NAME]
    yield ["info", places["bag"], "--topic", f"/{NAME}", "--field", NAME]
    yield ["info", places[".npz"], f"--{NAME}"]
    yield ["info", places[".npz"], "--array", NAME]


def convert(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    for name in (".mcap", ".npz", "bag", "table", "events"):
        for ending in (".mcap", ".csv", ".lsa", ".npz"):
            more = ["--topic", f"/{NAME}"] if name == "bag" else []
            yield ["convert", places[name], out / f"{name}{FILE}{ending}", *more]
    yield ["convert", places[".mcap"], places[".npz"]]
    yield ["convert", places[".mcap"], out / NAME / "a.mcap"]
    yield ["convert", places[".mcap"], out / f"a.{NAME}"]
    yield ["convert", places[".mcap"], out / "a.npz", "--source", NAME]


def cut(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["cut", places[".mcap"], out / f"{FILE}.npz", "--from", "0.5", "--to", "1"]
    yield ["cut", places[".mcap"], out / f"{FILE}.csv", "--rows", "0:1"]
    yield ["cut", places[".mcap"], out / f"{FILE}.csv", "--rows", NAME]


def merge(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["merge", places[".mcap"], places[".npz"], "--gap", 1, "-o", out / f"{FILE}.npz"]
    yield ["merge", places[".mcap"], places["events"], "-o", out / f"{FILE}.mcap"]


def encode(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    levels = ["--encoder", "level_crossing", "--set", "levels=[50]"]
    yield ["encode", places[".mcap"], out / f"{FILE}.npz", *levels]
    yield ["encode", places[".mcap"], out / f"{FILE}2.npz", "--encoder", NAME]
    yield ["encode", places[".mcap"], out / f"{FILE}2.npz", "--encoder", "fa1", "--set", f"{NAME}=3"]
    yield ["encode", places[".mcap"], out / f"{FILE}2.npz", "--encoder", "contact_area", "--tare", places["labels"]]


def detect(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    readout = ["--readout", places["readout"]]
    yield ["detect", places[".mcap"], *readout]
    yield ["detect", places[".mcap"], *readout, "--truth", places["labels"], "-o", out / f"{FILE}.csv"]
    yield ["detect", places[".mcap"], *readout, "--truth", "notes", "--report", out / FILE]
    yield ["detect", places["bag"], *readout, "--topic", f"/{NAME}"]
    yield ["detect", places["table"].parent, *readout]
    yield ["detect", places[".mcap"], "--readout", places["other readout"]]
    yield ["detect", places[".mcap"], "--readout", places["labels"]]
    yield ["detect", places[".mcap"], *readout, "--truth", places["table"]]


def train(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    labels = ["--labels", places["labels"]]
    learnt = ["--encoder", "level_crossing", "--set", "encoder.levels=[50, 100]"]
    yield ["train", places[".mcap"], *labels, *learnt, "--folds", 2, "-o", out / f"{FILE}.json", "--report", out / FILE]
    yield ["train", places[".mcap"], "--labels", "notes", *learnt, "-o", out / f"{FILE}2.json"]
    yield ["train", places[".mcap"], *labels, "--recipe", places["recipe"], "-o", out / f"{FILE}3.json"]
    yield ["train", places[".mcap"], *labels, "--recipe", NAME, "-o", out / f"{FILE}3.json"]
    yield ["train", places[".mcap"], *labels, *learnt, "--set", f"neurons.{NAME}.tau=3", "-o", out / f"{FILE}4.json"]
    yield ["train", places["table"].parent, "-o", out / f"{FILE}5.json"]


def calibrate(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["calibrate", places[".mcap"], "--load", 3, "--from", "0.4", "--to", "0.6", "--tare", "0.3", "-o", out / FILE]
    yield ["calibrate", places["events"], "--load", NAME, "-o", out / f"{FILE}.json"]


def information(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["information", places[".mcap"], "--labels", places["labels"], "--window-ms", 50, "--report", out / FILE]
    yield ["information", places[".mcap"], "--labels", NAME]


def simulate(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["simulate", places["scene"], "-o", out / f"{FILE}.mcap"]
    yield ["simulate", places["table"], "-o", out / f"{FILE}.mcap"]


def export(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["export", "nir", places["readout"], out / f"{FILE}.nir"]
    yield ["export", "nir", places["labels"], out / f"{FILE}.nir"]


def device(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["device", "show", places["labels"]]
    yield ["device", "show", f"/dev/{NAME}"]
    yield ["device", "apply", places["labels"], NAME]
    for text in (b"\x1b[2Jtaxel \xc2\x9b31m\xe2\x80\xae 64 64\r\n", b"\x1b]0;owned\x07" * 20 + b"\n", b"\xff\xfe\r\n"):
        ours, theirs = pty.openpty()
        # The line has been written before it is opened; nothing answers it.
        os.write(ours, text * 5)
        yield ["device", "show", os.ttyname(theirs)]
        os.close(ours), os.close(theirs)


def emulate(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    to = ["--port", free_port()]
    yield ["emulate", *to, "--preset", NAME]
    yield ["emulate", *to, "--replay", places["events"], "--no-clock"]
    yield ["emulate", *to, "--replay", places["table"]]
    yield ["emulate", *to, "--scenes", 1, "--truth", out / NAME / "labels.csv"]


def live(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    to = ["--host", "127.0.0.1", "--port", free_port(), "--seconds", "0.3"]
    yield ["live", *to, "--readout", places["other readout"], "--record", out / f"{FILE}.mcap"]
    yield ["live", *to, "--readout", places["labels"]]
    yield ["live", *to, "--send", f"lines+udp:{NAME}", "--readout", places["readout"]]
    yield ["live", *to, "--remote", NAME]


def record(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    to = ["--host", "127.0.0.1", "--port", free_port(), "--seconds", "0.5"]
    lines = out / f"{FILE}.lines"
    lines.write_text("".join(f"{10 * k},{CELL if k == 9 else k}\n" for k in range(50)), newline="")
    for what in (f"lines:{lines},columns=t_ms:a", f"lines:{lines},columns=t_ms:{CELL}", f"lines:{NAME}", NAME):
        yield ["record", out / f"{FILE}.mcap", *to, "--source", f"line={what}", "--overwrite"]
    yield ["record", out / f"{FILE}2.mcap", *to]
    yield ["record", out / f"{FILE}.mcap", *to, "--source", f"{NAME}=board:127.0.0.1:{free_port()}"]
    yield ["record", out / NAME / "a.mcap", *to]


def bridge(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["bridge", "--host", "127.0.0.1", "--name", NAME, "--listen", "127.0.0.1:0"]
    yield ["bridge", "--host", "127.0.0.1", "--name", "a", "--listen", NAME]


def view(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["view", places[".mcap"], "--no-open", "--seconds", "0.3"]
    yield ["view", shutil.copy(places[".mcap"], out / f"{CELL}\ntaxel: forged.mcap"), "--no-open", "--seconds", "0.3"]
    yield ["view", places["layout"], "--no-open", "--seconds", "0.3"]


def show(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["show", places[".mcap"], NAME]
    yield ["show", NAME, "rerun:127.0.0.1:1"]


def demo(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["demo", "--readout", places["labels"], "--no-clock", "--scenes", 1, "--folder", out / FILE]


def bench(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["bench", NAME, "--folder", places["table"].parent]


def study(places: dict[str, Path], out: Path) -> Iterator[list[Any]]:
    yield ["study", NAME]


COMMANDS: dict[str, Commands] = {
    one.__name__: one
    for one in (
        bench, bridge, calibrate, convert, cut, demo, detect, device, emulate, encode, export, info, information, live,
        merge, record, show, simulate, study, train, view,
    )
}  # fmt: skip


def test_every_command_is_tried() -> None:
    """Write a function that yields command lines of a new command with hostile texts."""
    group: Any = typer.main.get_command(app)
    assert set(COMMANDS) == set(group.list_commands(None))


@pytest.mark.parametrize("name", COMMANDS)
def test_no_command_prints_a_control_character_of_a_name(name: str, places: dict[str, Path], tmp_path: Path) -> None:
    for arguments in COMMANDS[name](places, tmp_path):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            done = run(*arguments)
        assert done.returncode in (0, 2, 3), (arguments, done)
        for said in (done.stdout, done.stderr):
            assert not strange.wrong(said), (arguments, strange.wrong(said))
    for page in tmp_path.rglob("*.html"):
        said = page.read_text()
        assert "owned" in said
        # Libraries of the page indent by tabs.
        assert not strange.wrong(said.replace("\t", "")), page


@pytest.mark.parametrize(
    "arguments",
    [
        ["info", ".mcap"],
        ["info", "table without a layout"],
        ["detect", ".mcap", "--readout", "readout", "--truth", "notes"],
        ["train", ".mcap", "--labels", "labels", "--encoder", "level_crossing", "--set", "encoder.levels=[50]"],
        ["convert", ".mcap"],
    ],
)
def test_on_a_terminal_nothing_but_the_commands_own_sequences_arrives(
    arguments: list[str], places: dict[str, Path], tmp_path: Path
) -> None:
    out = {"train": ["-o", tmp_path / f"{FILE}.json"], "convert": [tmp_path / f"{FILE}.csv"]}.get(arguments[0], [])
    typed = [str(places.get(one, one)) for one in [*arguments, *out]]
    ours, theirs = pty.openpty()
    command = [sys.executable, "-P", "-m", "taxel", *typed]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        said = b""
        # A terminal whose last writer has ended gives an error.
        while select.select([ours], [], [], 120)[0]:
            try:
                said += os.read(ours, 1 << 16)
            except OSError:
                break
        assert process.wait(60) in (0, 2)
    os.close(ours)
    text = OWN.sub("", said.decode("utf-8", "surrogateescape"))
    assert "owned" in text
    assert not strange.wrong(text)


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
        Panel(NAME, title=CELL),
        Group(NAME, Text(CELL)),
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
        assert [note.text for note in opened.notes] == [NAME, CELL]
    assert list(taxel.Readout.load(places["readout"]).labels) == [NAME, CELL]


def test_a_label_of_any_character_is_read_as_it_was_written(tmp_path: Path) -> None:
    """Other line ends than those of a table, as U+2028, once ended its rows."""
    controls = [chr(k) for k in (*range(1, 0x20), *range(0x7F, 0xA0), 0x2028, 0x2029, 0x202E) if chr(k) not in "\n\r"]
    table = tmp_path / "labels.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("label", "t_us"), *((f"a{one}b", 10 * k) for k, one in enumerate(controls))])
    assert [row.text for row in taxel.Labels(table).rows] == [f"a{one}b" for one in controls]
    found = taxel.Detections([f"a{one}b" for one in controls], range(len(controls)), range(len(controls)))
    assert taxel.Detections.from_csv(found.to_csv(tmp_path / "found.csv")) == found


def test_what_python_shows_of_them_is_escaped(places: dict[str, Path]) -> None:
    opened = taxel.open(places[".mcap"])
    readout, labels = taxel.Readout.load(places["readout"]), taxel.Labels(places["labels"])
    found = taxel.detect.run(readout, opened)
    score = taxel.detect.score(opened.detections, {NAME: [500_000]}, window_ms=50)
    trial = taxel.formats.Trial(NAME, NAME, strange.frames(), {NAME: np.array([3])}, NAME)
    tare = taxel.Tare.take(strange.frames(), stop_us=300_000, note=NAME)
    rule = taxel.detect.PlainRule("area", 2, labels=[NAME, None])
    for noun in (opened, opened.frames(), opened.array, opened.detections, opened.notes, readout, labels, found, score,
                 trial, tare, rule, opened.verdict):  # fmt: skip
        assert not strange.wrong(repr(noun)), type(noun)
    for noun in (opened, opened.frames(), opened.detections):
        assert not strange.wrong(noun._repr_html_()), type(noun)


def test_errors_and_warnings_are_one_line_wherever_they_are_shown() -> None:
    for kind in (taxel.Error, taxel.FormatError, taxel.ProblemError, taxel.DeviceError, taxel.SceneError):
        assert str(kind(f"{NAME}: wrong")) == f"{escaped(NAME)}: wrong"
        assert str(kind(f"{NAME}:", f"{CELL}\n{CELL}")) == f"{escaped(NAME)}:\n{escaped(CELL)}\n{escaped(CELL)}"
        assert (str(kind()), str(kind(3))) == ("", "3")
    with pytest.warns(UserWarning, match="strange") as caught:
        warn(f"{NAME}: strange", stacklevel=1)
    assert str(caught[0].message) == f"{escaped(NAME)}: strange"
    assert caught[0].filename == __file__


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


#: Classes whose `__repr__` shows numbers and words of taxel's own alone.
OWN_WORDS = {
    "Certificate",
    "Clock",
    "Columns",
    "Datagrams",
    "Decoder",
    "Estimate",
    "Events",
    "FrameSequence",
    "Health",
    "Learner",
    "Multipliers",
    "Panel",
    "Parameters",
    "Places",
    "Registers",
    "Source",
    "SpikeTrains",
    "Spread",
    "Training",
}


def test_no_repr_shows_a_text_unescaped() -> None:
    """A `__repr__` that puts a text into its line calls `escaped`, or puts the text's own `repr` there (`!r`)."""
    found = set()
    for file in Path(taxel.__file__).parent.rglob("*.py"):
        if "def __repr__" not in (text := file.read_text()):
            continue
        for kind in ast.walk(ast.parse(text)):
            for method in kind.body if isinstance(kind, ast.ClassDef) else ():
                if isinstance(method, ast.FunctionDef) and method.name == "__repr__":
                    inside = list(ast.walk(method))
                    is_raw = any(isinstance(one, ast.FormattedValue) and one.conversion != ord("r") for one in inside)
                    if is_raw and not any(isinstance(one, ast.Name) and one.id == "escaped" for one in inside):
                        found.add(kind.name)
    assert found == OWN_WORDS
