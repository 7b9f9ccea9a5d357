"""What systems do differently: paths, names, line ends, consoles, files that are open elsewhere, ends of commands."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from live.boards import held
from loopback import free_port, until
from recording.making import some_events
from shell import run

import taxel
from taxel import Frames, Labels
from taxel._base.files import create, write_whole
from taxel._base.stopping import asked_to_end

on_windows = pytest.mark.skipif(sys.platform != "win32", reason="a matter of Windows alone")


@pytest.mark.parametrize("ending", [".mcap", ".npz", ".h5", ".csv"])
def test_a_recording_is_written_and_opened_in_any_folder(tmp_path: Path, ending: str) -> None:
    """Its path has blanks, letters beyond ASCII and more than 300 characters."""
    path = tmp_path / "my  day ä ł 足 \U0001f9b6" / "/".join(["long" * 15] * 5) / f"a walk é{ending}"
    path.parent.mkdir(parents=True)
    events = some_events(50)
    taxel.convert(events, path)
    assert taxel.open(path).events.t.tolist() == events.t.tolist()
    said = run("info", path, "--json")
    assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout)


@pytest.mark.parametrize("end", ["\n", "\r\n"], ids=["LF", "CRLF"])
def test_texts_are_read_with_the_line_ends_of_every_system(tmp_path: Path, end: str) -> None:
    events, frames = some_events(20), Frames(np.arange(12.0).reshape(3, 2, 2), [0, 1000, 2000], unit="N")
    taxel.convert(events, tmp_path / "events.csv")
    taxel.convert(frames, tmp_path / "frames.csv")
    (tmp_path / "walk.notes.csv").write_bytes(b"label,t_us\nheel,5\ntoe,9\n")
    for file in tmp_path.iterdir():
        text = file.read_bytes()
        # What taxel writes has the same bytes on every system.
        assert b"\r" not in text
        file.write_bytes(text.replace(b"\n", end.encode()))
    assert taxel.open(tmp_path / "events.csv").events.t.tolist() == events.t.tolist()
    assert taxel.open(tmp_path / "frames.csv").frames().values.tolist() == frames.values.tolist()
    assert [note.t for note in Labels(tmp_path / "walk.notes.csv").rows] == [5, 9]


@on_windows
def test_a_file_that_another_program_holds_is_named_and_stays_whole(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    taxel.convert(some_events(20), path)
    before = path.read_bytes()
    with path.open("rb"), pytest.raises(PermissionError, match="another program has it open") as raised:
        taxel.convert(some_events(30), path, overwrite=True)
    assert raised.value.filename == str(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_file_never_replaces_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On file systems without links too."""

    def no_link(*_: object) -> None:
        raise OSError(errno.EPERM, "no links")

    for k, links in enumerate((True, False)):
        if not links:
            monkeypatch.setattr(os, "link", no_link)
        new, other = tmp_path / f"new{k}", tmp_path / f"other{k}"
        new.write_text("new"), other.write_text("other")
        with pytest.raises(FileExistsError):
            create(new, other)
        assert (new.read_text(), other.read_text()) == ("new", "other")
        other.unlink()
        create(new, other)
        assert (new.exists(), other.read_text()) == (False, "new")
    assert write_whole(tmp_path / "whole", lambda file: file.write(b"1")).read_bytes() == b"1"


def test_ctrl_break_stops_as_ctrl_c_does(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another signal stands for it where there is none."""
    if not hasattr(signal, "SIGBREAK"):
        monkeypatch.setattr(signal, "SIGBREAK", signal.SIGUSR1, raising=False)
    before = signal.getsignal(signal.SIGBREAK)
    with asked_to_end() as request:
        assert not request.is_set()
        signal.raise_signal(signal.SIGBREAK)
        assert request.is_set()
    assert signal.getsignal(signal.SIGBREAK) == before


@on_windows
def test_a_recording_is_complete_after_ctrl_break(tmp_path: Path) -> None:
    port = free_port()
    command = ["record", "walk.mcap", "--host", "127.0.0.1", "--port", str(port), "--array", "64x64"]
    process = subprocess.Popen(
        [sys.executable, "-m", "taxel", *command],
        cwd=tmp_path,
        stdin=subprocess.DEVNULL,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        until((tmp_path / "walk.mcap").exists)
        board.sendto(taxel.wire.encode(some_events(20)), ("127.0.0.1", port))
    until(lambda: held(tmp_path / "walk.mcap") == 20)
    process.send_signal(getattr(signal, "CTRL_BREAK_EVENT", 0))
    assert process.wait(60) == 0
    recording = taxel.open(tmp_path / "walk.mcap")
    assert len(recording.events) == 20
    assert not recording.truncated
