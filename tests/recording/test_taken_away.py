"""A file that another program takes while it is recorded: noticed within a second, and said as a full disk is."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from loopback import free_port, until
from shell import run_beside

import taxel
from taxel.live import Live, send
from taxel.panel import Panel

from .making import some_events

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows lets nobody take an open file")


def replace(path: Path) -> None:
    other = path.with_name("other")
    other.write_bytes(b"precious")
    other.replace(path)


def overwrite(path: Path) -> None:
    with path.open("wb") as file:
        file.write(b"precious" * 100_000)


#: What another program does, and whether a file is there then, with what was recorded.
TAKES: dict[str, tuple[Callable[[Path], object], str]] = {
    "removes": (Path.unlink, ""),
    "renames": (lambda path: path.rename(path.with_name("kept.mcap")), "kept.mcap"),
    "replaces": (replace, ""),
    "shortens": (lambda path: os.truncate(path, path.stat().st_size - 5), "a.mcap"),
    "empties": (lambda path: os.truncate(path, 0), ""),
    "overwrites": (overwrite, ""),
}


def begun(address: tuple[str, int], path: Path) -> None:
    """Send what a recording then has on the disk."""
    size, events = path.stat().st_size, some_events(50)
    send([taxel.wire.encode(events[k : k + 1]) for k in range(50)], *address, period_us=1000)
    until(lambda: path.stat().st_size > size)


def check_left(path: Path, left: str) -> None:
    """Check that no file of another program was touched, and that what was recorded can be read where it is."""
    names = {file.name: file for file in path.parent.iterdir()}
    if left:
        recording = taxel.open(names[left])
        assert recording.truncated
        assert len(recording.events) > 0
    elif path.exists() and (content := path.read_bytes()):
        assert content == b"precious" * (len(content) // 8)


@pytest.mark.parametrize("how", TAKES)
@pytest.mark.parametrize("later", [False, True])
def test_a_recording_whose_file_is_taken_ends_at_once_with_who_did_it(how: str, later: bool, tmp_path: Path) -> None:
    path, (take, left) = tmp_path / "a.mcap", TAKES[how]

    def record() -> None:
        with Live(0, host="127.0.0.1", record_later=later, record=None if later else path) as live:
            if later:
                live.record(path)
            begun(live.address, path)
            take(path)
            since = time.monotonic()
            until(lambda: not live.records if later else live.is_over)
            assert time.monotonic() - since < 1.0
            if later:
                live.end_recording()

    with pytest.raises(OSError, match="another program") as caught:
        record()
    assert str(path) in str(caught.value)
    check_left(path, left)


def test_the_command_ends_with_3_and_says_it(tmp_path: Path) -> None:
    path, port = tmp_path / "a.mcap", free_port()

    def take(_: str) -> None:
        until(path.exists)
        begun(("127.0.0.1", port), path)
        path.unlink()

    done = run_beside(take, "record", "--port", port, "--host", "127.0.0.1", path, ended=None)
    assert done.returncode == 3
    assert (str(path) in done.stderr, "another program" in done.stderr) == (True, True)
    assert "nothing lost" not in done.stdout


def test_the_page_says_it(tmp_path: Path) -> None:
    from panel.protocol import Client

    with Live(0, host="127.0.0.1") as live, Panel(live, folder=tmp_path) as panel, Client(panel) as page:
        assert page.ask("record", name="walk")["type"] == "done"
        begun(live.address, tmp_path / "walk.mcap")
        (tmp_path / "walk.mcap").unlink()
        told = page.until("recorder", state="idle")
        assert (told["last"], "another program" in told["error"]) == (None, True)
