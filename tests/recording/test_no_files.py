"""A pipe, a socket or a device where a file is expected: one line at once, and a folder is read without it."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from panel.protocol import Client
from refusal import refused_saying as refused

import taxel
from taxel import FormatError, formats
from taxel._base.files import open_file
from taxel.cli import main
from taxel.detect import PlainRule, recipes
from taxel.live import Panel
from taxel.simulate import SceneFile

from .hostile import KINDS
from .making import some_events, some_frames

pytestmark = pytest.mark.timeout(60)


def pipe(path: Path) -> None:
    os.mkfifo(path)


def bound(path: Path) -> None:
    # A socket's path is short.
    here = Path.cwd()
    os.chdir(path.parent)
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


def device(name: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(f"/dev/{name}")


def linked(path: Path) -> None:
    os.mkfifo(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


#: What stands where a file is expected, and how an error calls it.
NO_FILES = {
    "pipe": (pipe, "a named pipe"),
    "link to a pipe": (linked, "a named pipe"),
    "socket": (bound, "a socket"),
    "zero": (device("zero"), "a device"),
    "full": (device("full"), "a device"),
}


@pytest.fixture(params=NO_FILES)
def no_file(request: pytest.FixtureRequest) -> tuple[Callable[[Path], None], str]:
    return NO_FILES[request.param]


ENDINGS = [".mcap", ".lsa", ".npz", ".csv", ".csv.gz", ".txt", ".npy", ".asc", ".lst", ".asf", ".hea", ".bag", ".db3"]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_recording_is_a_file(ending: str, no_file: Any, tmp_path: Path) -> None:
    make, called = no_file
    make(path := tmp_path / f"a{ending}")
    with refused(f"{called}; must be a file", FormatError):
        taxel.open(path)


@pytest.mark.parametrize(
    "read",
    [
        formats.layout.Layout.read,
        recipes.read,
        SceneFile.open,
        taxel.Readout.load,
        PlainRule.load,
        taxel.Tare.load,
        taxel.Calibration.load,
        taxel.Labels,
        taxel.SpikeTrains.load,
        lambda path: taxel.open(path.with_name("ok.npz"), layout=path),
        lambda path: list(formats.trials(path, "gaitpdb")),
    ],
)
def test_what_describes_a_recording_is_a_file(read: Callable[[Path], Any], no_file: Any, tmp_path: Path) -> None:
    make, called = no_file
    make(path := tmp_path / "GaCo99_01.txt")
    taxel.convert(some_frames(), tmp_path / "ok.npz")
    with refused(f"{called}; must be a file|contains no spike trains", FormatError):
        read(path)


BESIDE = [
    *("labels.csv", "walk.notes.csv", "walk.layout.toml", "layout.toml", "walk.calibration.json", "calibration.json"),
    *("x.json", "x.toml", "x.mcap", "x.lsa", "x.csv", "x.txt", "x.asc", "x.lst", "x.h5", "x.npz", "events.csv"),
]


@pytest.mark.parametrize("name", BESIDE)
def test_what_lies_beside_a_recording_does_not_stop_it(name: str, no_file: Any, tmp_path: Path) -> None:
    """The frames open; labels of a whole folder that are none say so."""
    taxel.convert(some_frames(), tmp_path / "walk.npz")
    no_file[0](tmp_path / name)
    assert taxel.open(tmp_path / "walk.npz").frames() == some_frames()
    if name == "labels.csv":
        with refused("labels.csv: .*; must be a file", FormatError):
            taxel.open_all(tmp_path)
    else:
        assert len(taxel.open_all(tmp_path)) == 1


@pytest.mark.parametrize("kind", formats.FORMATS)
def test_a_folder_of_another_maker_is_read_beside_a_pipe(kind: str, tmp_path: Path) -> None:
    path = KINDS[kind](tmp_path)
    count = len(taxel.open_all(path))
    for ending in (".txt", ".csv", ".asc", ".asf", ".lst", ".npz", ".toml"):
        os.mkfifo(tmp_path / f"a{ending}")
    assert len(taxel.open_all(tmp_path)) == count


def test_the_page_serves_a_folder_with_pipes(tmp_path: Path) -> None:
    taxel.convert(some_events(), tmp_path / "walk.mcap")
    taxel.convert(some_frames(), tmp_path / "press.npz")
    for name in BESIDE:
        os.mkfifo(tmp_path / name)
    os.mkfifo(tmp_path / "walk.lss")
    with Panel(tmp_path / "walk.mcap") as panel, Client(panel) as page:
        for name in ("walk.mcap", "press.npz"):
            assert page.ask("open", name=name)["type"] == "done"
        page.send(type="recordings")
        listed = page.until("recordings")
        assert [one["name"] for one in listed["files"]] == ["press.npz", "walk.mcap"]
        assert listed["readouts"] == []
        for name in ("x.mcap", "x.lsa", "x.csv", "x.npz"):
            assert page.ask("open", name=name)["type"] == "refused"
        assert page.ask("open", name="walk.mcap")["type"] == "done"


@pytest.mark.parametrize("command", ["info", "convert", "cut", "merge", "encode", "detect", "train", "information"])
def test_a_command_says_it_in_one_line(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(path := tmp_path / "a.csv")
    more = {
        "convert": [str(tmp_path / "b.npz")],
        "cut": [str(tmp_path / "b.npz"), "--to", "1"],
        "encode": [str(tmp_path / "b.npz"), "--encoder", "change_events"],
        "merge": [str(path), "-o", str(tmp_path / "b.npz")],
        "detect": ["--readout", str(path)],
        "train": ["--labels", str(path), "-o", str(tmp_path / "b.json")],
        "information": ["--labels", str(path)],
    }
    with pytest.raises(SystemExit) as ended:
        main([command, str(path), *more.get(command, [])])
    assert ended.value.code == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert "a named pipe; must be a file" in said[0]


def test_links_to_files_and_descriptors_without_waiting_are_read(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"read")
    (tmp_path / "b").symlink_to("a")
    with open_file(tmp_path / "b") as file:
        assert os.get_blocking(file.fileno())
        assert not os.get_inheritable(file.fileno())
        assert file.read() == b"read"
    with pytest.raises(IsADirectoryError):
        open_file(tmp_path)
    with pytest.raises(FileNotFoundError, match="nothing"):
        open_file(tmp_path / "nothing")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OSError, match="symbolic links"):
        open_file(tmp_path / "loop")
    np.save(tmp_path / "a.npy", np.zeros((2, 3)))
    (tmp_path / "layout.toml").write_text("rows = 1\ncolumns = 3\nrate_hz = 100\n")
    assert len(taxel.open(tmp_path / "a.npy").frames()) == 2
