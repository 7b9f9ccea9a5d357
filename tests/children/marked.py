"""Processes that a test starts, and all that descend from them: they are found by a variable of their environment."""

from __future__ import annotations

import contextlib
import itertools
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType

import pytest

pty = pytest.importorskip("pty", reason="needs terminals of its own, which Windows does not have")

#: The command as a user types it.
TAXEL = Path(sys.executable).with_name("taxel")
#: A child ends within this time after its parent, s: it has 3 s, and a machine with much to do takes longer.
WITHIN_S = 60.0
#: How a process may be ended: a signal to it alone, to its group, or its terminal closes.
ENDS = {
    "kill": lambda one: os.kill(one.pid, signal.SIGKILL),
    "SIGTERM": lambda one: os.kill(one.pid, signal.SIGTERM),
    "SIGHUP": lambda one: os.kill(one.pid, signal.SIGHUP),
    "SIGINT": lambda one: os.kill(one.pid, signal.SIGINT),
    "SIGINT to the group": lambda one: os.killpg(one.pid, signal.SIGINT),
    "SIGTERM to the group": lambda one: os.killpg(one.pid, signal.SIGTERM),
    "closed terminal": lambda one: one.close_terminal(),
}
#: The leader of a session takes the terminal for its own: when that closes, the kernel sends SIGHUP.
#: It heeds all signals, also where these tests run under nohup.
_BEGIN = """
import fcntl, os, signal, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
for number in (signal.SIGHUP, signal.SIGINT):
    signal.signal(number, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])
"""
_numbers = itertools.count()


class Marked:
    """A command in a session of its own, on a terminal of its own, and its descendants.

    What it prints goes into the files ``out`` and ``err`` of the folder, unless its terminal is to be closed.
    """

    def __init__(
        self, folder: Path, *command: object, environment: Mapping[str, str] | None = None, on_terminal: bool = False
    ) -> None:
        self.mark = f"{os.getpid()}.{next(_numbers)}"
        self.folder, self._shown = folder, b""
        folder.mkdir(exist_ok=True)
        self._terminal, inner = pty.openpty()
        with (folder / "out").open("wb") as out, (folder / "err").open("wb") as err:
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-c", _BEGIN, *map(str, command)],
                cwd=folder,
                stdin=inner,
                stdout=inner if on_terminal else out,
                stderr=inner if on_terminal else err,
                env={**os.environ, "TAXEL_TEST_MARK": self.mark, **(environment or {})},
                start_new_session=True,
            )
        os.close(inner)
        self.pid = self._process.pid

    def alive(self) -> dict[int, str]:
        """Return the processes with the mark that run, and their command lines."""
        found = {}
        for place in Path("/proc").iterdir():
            if place.name.isdigit():
                try:
                    if f"TAXEL_TEST_MARK={self.mark}\0".encode() in (place / "environ").read_bytes() + b"\0":
                        state = (place / "stat").read_text().rpartition(")")[2].split()[0]
                        if state != "Z":
                            found[int(place.name)] = (place / "cmdline").read_text().replace("\0", " ")
                except (OSError, UnicodeDecodeError):
                    continue
        return found

    def children(self) -> int:
        """Return the number of descendants."""
        return len(self.alive().keys() - {self.pid})

    def said(self) -> str:
        """Return what it has printed."""
        while self._terminal >= 0 and select.select([self._terminal], [], [], 0)[0]:
            try:
                self._shown += os.read(self._terminal, 4096)
            except OSError:
                break
        return self._shown.decode() + (self.folder / "out").read_text() + (self.folder / "err").read_text()

    def close_terminal(self) -> None:
        """Close its terminal, as a person closes the window."""
        os.close(self._terminal)
        self._terminal = -1

    def code(self, seconds: float = 60.0) -> int:
        """Wait for its end and return its exit code."""
        return self._process.wait(seconds)

    def ended_within(self, seconds: float) -> dict[int, str]:
        """Wait until nothing with the mark runs, at most so long; return what runs yet."""
        end = time.monotonic() + seconds
        while (left := self.alive()) and time.monotonic() < end:
            self._process.poll()
            # A full terminal would block it.
            self.said()
            time.sleep(0.05)
        return left

    def until(self, ready: Callable[[Marked], object], seconds: float = 120.0) -> None:
        """Wait until something is true of it."""
        end = time.monotonic() + seconds
        while not ready(self):
            assert self._process.poll() is None, f"it ended with {self._process.returncode}:\n{self.said()}"
            assert time.monotonic() < end, f"never came:\n{self.said()}"
            time.sleep(0.05)

    def __enter__(self) -> Marked:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for pid in self.alive():
            # It may have ended since.
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.wait()
        if self._terminal >= 0:
            os.close(self._terminal)
