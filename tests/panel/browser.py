"""A browser, an emulated board and a panel as processes, for the tests that look at the page."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue

import pytest
from playwright.sync_api import Browser, sync_playwright
from tools.chromium import LACKING, chromium

#: Timeout for any action on a machine at load 20, s.
PATIENCE = 90
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--autoplay-policy=no-user-gesture-required",
]
#: The browser's program, found while no Playwright runs.
CHROMIUM = chromium()


def installed() -> str:
    """Return the browser's program, or fail where there is none."""
    if CHROMIUM is None:
        pytest.fail(LACKING, pytrace=False)
    return CHROMIUM


class Process:
    """`taxel` with some arguments, and what it prints."""

    def __init__(self, *arguments: str, folder: Path) -> None:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "XDG_CONFIG_HOME": str(folder / "config")}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "taxel", *arguments],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines: Queue[str] = Queue()
        self.said: list[str] = []
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.put(line)
        self.lines.put("")

    def wait_for(self, pattern: str) -> str:
        """Return the first group of the first line that matches."""
        while True:
            try:
                line = self.lines.get(timeout=PATIENCE)
            except Empty:
                raise AssertionError(f"{pattern!r} was not said:\n{''.join(self.said)}") from None
            self.said.append(line)
            assert line, f"it ended before it said {pattern!r}:\n{''.join(self.said)}"
            if found := re.search(pattern, line):
                return found.group(1)

    def heard(self) -> str:
        """Return all that it has printed so far."""
        while not self.lines.empty():
            self.said.append(self.lines.get())
        return "".join(self.said)

    def end(self) -> int:
        """Send Ctrl-C and wait until it has ended and all that it printed is read."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(PATIENCE)
            self.reader.join(PATIENCE)
            return self.process.returncode
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise


@contextmanager
def running(*arguments: str, folder: Path) -> Iterator[Process]:
    """Run `taxel` for a while."""
    process = Process(*arguments, folder=folder)
    try:
        yield process
    finally:
        process.end()


@contextmanager
def started_chromium() -> Iterator[Browser]:
    """Start the browser, with one page for most tests."""
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=installed(), args=FLAGS)
        browser.new_context().new_page()
        yield browser
        browser.close()
