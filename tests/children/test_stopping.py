"""Commands that are stopped: however that happens, recordings are closed, and no child is left or writes anything."""

from __future__ import annotations

import json
import signal
import socket
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live.boards import held
from loopback import free_port, until

import taxel
from taxel import Array

from .marked import ENDS, TAXEL, WITHIN_S, Marked


def ends(*quick: str) -> list[Any]:
    """All ends of a command, of which some are quick; each starts processes."""
    return [pytest.param(end, marks=() if end in quick else pytest.mark.slow) for end in ENDS]


def files(folder: Path) -> dict[str, int]:
    """Return the files of a folder and when they were written, without what the test itself keeps there."""
    return {str(one): one.stat().st_mtime_ns for one in folder.rglob("*") if one.name not in ("out", "err")}


def check_end(one: Marked, end: str, code: int | None = 0) -> None:
    """End a command, and check its exit code and that nothing of it runs or writes any more."""
    ENDS[end](one)
    left = one.ended_within(WITHIN_S)
    assert not left, (end, left)
    written = files(one.folder)
    if end == "kill":
        assert one.code() == -signal.SIGKILL
    elif end != "closed terminal" and code is not None:
        assert one.code() == code, (end, one.said())
    elif end == "closed terminal":
        # What it would print has no reader.
        assert one.code() >= 0
    time.sleep(0.2)
    assert files(one.folder) == written


def datagrams(count: int = 20) -> list[bytes]:
    events = taxel.Events(np.arange(count) * 1000, np.full(count, 2), np.full(count, 1), np.arange(count) % 2 == 0,
                          array=Array(4, 4))  # fmt: skip
    return [taxel.wire.encode(events[k : k + 1]) for k in range(count)]


@pytest.mark.parametrize("end", ends("kill", "SIGINT", "closed terminal"))
def test_a_recording_is_closed_however_the_command_is_stopped(tmp_path: Path, end: str) -> None:
    port = free_port()
    command = [TAXEL, "record", "walk.mcap", "--host", "127.0.0.1", "--port", port, "--array", "4x4"]
    with Marked(tmp_path / "here", *command, on_terminal=end == "closed terminal") as one:
        file = one.folder / "walk.mcap"
        one.until(lambda it: "listening" in it.said())
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            for datagram in datagrams():
                link.sendto(datagram, ("127.0.0.1", port))
        until(lambda: held(file) == 20)
        check_end(one, end)
        recording = taxel.open(file)
        assert len(recording.events) == 20
        assert recording.truncated == (end == "kill")


@pytest.mark.parametrize("end", ["kill", *(pytest.param(end, marks=pytest.mark.slow) for end in ("SIGTERM", "SIGHUP"))])
def test_a_demo_ends_with_the_board_that_it_plays(tmp_path: Path, end: str) -> None:
    words = ["demo", "--scenes", 50, "--seed", 1, "--folder", "report"]
    with Marked(tmp_path / "here", TAXEL, *words, on_terminal=True) as one:
        one.until(lambda it: it.children())
        time.sleep(0.5)
        check_end(one, end, 130)


@pytest.mark.parametrize("end", ends("kill"))
def test_workers_of_a_study_end_with_it(tmp_path: Path, end: str) -> None:
    words = ["study", "fig6.9", "--jobs", 2, "--report", "report"]
    with Marked(tmp_path / "here", TAXEL, *words, on_terminal=end == "closed terminal") as one:
        # Two workers, and two processes that clean up behind them.
        one.until(lambda it: it.children() >= 4)
        check_end(one, end, 130)


def test_a_request_that_takes_long_does_not_abort_a_server_that_ends(tmp_path: Path) -> None:
    """The thread of the request runs Python code while the process ends, and it is the one that gets the signal."""
    script = tmp_path / "script.py"
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("t_us,a,b\n" + "".join(f"{1000 * k},1,2\n" for k in range(100)))
    script.write_text(
        "import signal, sys, threading, time\n"
        "from taxel.panel.shown_files import ShownFiles\n"
        "read = ShownFiles.read\n"
        "def reads(self, path, *given, **named):\n"
        "    if path.name == 'a.csv':\n"
        "        return read(self, path, *given, **named)\n"
        "    signal.pthread_kill(threading.get_ident(), signal.SIGINT)\n"
        "    until = time.monotonic() + 120\n"
        "    while time.monotonic() < until:\n"
        "        time.sleep(0.0001)\n"
        "ShownFiles.read = reads\n"
        "sys.argv = ['taxel', 'view', 'a.csv', '--no-open', '--json']\n"
        "from taxel.cli import program\n"
        "program()\n"
    )
    pytest.importorskip("websockets")
    from panel.protocol import Client, door

    with Marked(tmp_path, sys.executable, "-P", script) as one:
        one.until(lambda it: (it.folder / "out").read_text().endswith("\n"))
        shown = json.loads((tmp_path / "out").read_text())
        with Client(door(shown["url"])) as page:
            page.send(type="open", id=1, name="b.csv")
            assert not one.ended_within(WITHIN_S)
    assert one.code() == 0, one.said()


@pytest.mark.slow
@pytest.mark.parametrize("ignored", [signal.SIGHUP, signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_was_ignored_at_the_start_stays_ignored(tmp_path: Path, ignored: signal.Signals) -> None:
    """As by nohup, or in the background of a shell."""
    begin = (
        f"import os, signal, sys; signal.signal({int(ignored)}, signal.SIG_IGN); print('begun', flush=True); "
        "os.execv(sys.argv[1], sys.argv[1:])"
    )
    words = ["record", "walk.mcap", "--host", "127.0.0.1", "--port", 0]
    with Marked(tmp_path, sys.executable, "-c", begin, TAXEL, *words) as one:
        one.until(lambda it: "begun" in it.said())
        one._process.send_signal(ignored)
        one.until(lambda it: "listening" in it.said())
        one._process.send_signal(ignored)
        time.sleep(0.5)
        assert one._process.poll() is None
        check_end(one, "SIGTERM" if ignored != signal.SIGTERM else "SIGINT", 3)


@pytest.mark.parametrize("after_s", [0.2, *(pytest.param(after_s, marks=pytest.mark.slow) for after_s in (0.1, 0.5))])
@pytest.mark.parametrize(
    "number", [signal.SIGINT, *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGTERM, signal.SIGHUP))]
)
def test_a_command_is_stopped_quietly_while_it_loads(tmp_path: Path, after_s: float, number: signal.Signals) -> None:
    """At any moment: it has ended by the default of the system, or says so by its exit code."""
    with Marked(tmp_path, TAXEL, "live", "--panel", "--host", "127.0.0.1", "--port", 0) as one:
        time.sleep(after_s)
        one._process.send_signal(number)
        code, said = one.code(), one.said()
        # Python that has not begun yet says so itself.
        if not said.startswith("Fatal Python error"):
            assert code in (-number, 130, 3)
            assert "Traceback" not in said or code == -number
        assert not one.ended_within(WITHIN_S)
