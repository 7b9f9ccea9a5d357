"""A source of numbers is chosen on the page: a mat on a serial line, in a real browser."""

from __future__ import annotations

import contextlib
import os
import pty
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loopback import free_port
from tests.panel.browser import running
from tests.panel.pages import opened, shows, until

import taxel
from taxel.formats.layout import Layout

pytestmark = pytest.mark.timeout(600)


@contextlib.contextmanager
def mat(rows: int, columns: int) -> Iterator[tuple[str, threading.Event]]:
    """Yield a serial line on which a mat prints its rows and an empty line, 50 times a second, until the event."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    over, silent = threading.Event(), threading.Event()

    def send() -> None:
        rng, k = np.random.default_rng(1), 0
        text = "Mat 1.0 ready\n"
        while not over.wait(0.02):
            frame = rng.integers(0, 3, (rows, columns))
            frame[2:5, 2:5] += 200 * (k % 100 > 50)
            text += "\n".join(",".join(map(str, row)) for row in frame) + "\n\n"
            if not silent.is_set():
                with contextlib.suppress(BlockingIOError):
                    os.write(ours, text.encode())
            k, text = k + 1, ""

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    try:
        yield os.ttyname(theirs), silent
    finally:
        over.set()
        thread.join(10)
        os.close(ours)
        os.close(theirs)


def test_a_mat_on_a_serial_line_is_chosen_seen_and_recorded(chromium: Any, tmp_path: Path) -> None:
    port = str(free_port())
    with (
        mat(16, 12) as (line, silent),
        running("live", "--panel", "--port", port, "--host", "127.0.0.1", folder=tmp_path) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)")) as page,
    ):
        source = page.locator("#numbers")
        source.fill("serial:ttyX")
        page.locator("#numbers-look").click()
        shows(page, "numbers-why", "must be a serial port")
        source.fill(f"serial:{line}")
        page.locator("#numbers-look").click()
        shows(page, "numbers-about", "16 lines of 12 numbers, then an empty line: 16 x 12")
        assert source.input_value() == f"serial:{line},array=16x12,frame_end=blank"
        page.locator("#numbers-form").get_by_role("button", name="Connect", exact=True).click()
        shows(page, "pressure-top", "counts")
        shows(page, "where-info", f"serial:{line}")
        shows(page, "registers-why", "A sensor that prints numbers has no registers")
        shows(page, "numbers-command", r"taxel live --panel --source serial:.*,array=16x12,frame_end=blank$")
        # A source that was begun elsewhere is in the field as a whole.
        page.evaluate("localStorage.clear()")
        page.reload()
        until(lambda: source.input_value() == f"serial:{line},array=16x12,frame_end=blank", "all of it is in the field")
        name = page.locator("#layout-name")
        name.fill("my mat")
        page.locator("#layout-save").click()
        shows(page, "layout-saved", r"^Saved in my mat\.layout\.toml, which the command reads\.$")
        shows(page, "numbers-shell", r"^taxel live --panel --source 'my mat\.layout\.toml'$")
        layout = Layout.read(tmp_path / "my mat.layout.toml")
        assert layout.source_text() == source.input_value()
        page.locator("#layout-save").click()
        shows(page, "numbers-why", r"my mat\.layout\.toml: exists already$")
        page.locator("#numbers-falls").check()
        assert source.input_value().endswith(",falls=true")
        silent.set()
        time.sleep(0.1)
        until(lambda: "The line is silent" in page.content(), "the page says that the line is silent")


def test_a_plug_that_is_pulled_while_recording_is_said_and_is_in_the_verdict(chromium: Any, tmp_path: Path) -> None:
    plug = tmp_path / "mat"
    with (
        running("live", "--panel", "--port", "0", "--host", "127.0.0.1", folder=tmp_path) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)")) as page,
    ):
        connect = page.locator("#numbers-form").get_by_role("button", name="Connect", exact=True)
        with mat(4, 4) as (line, _):
            plug.symlink_to(line)
            page.locator("#numbers").fill(f"serial:{plug},array=4x4,frame_end=blank")
            connect.click()
            shows(page, "pressure-top", "counts")
            shows(page, "state-word", "^Live$")
            page.locator("#record").click()
            shows(page, "state-word", r"^Recording trial1\.mcap$")
            page.wait_for_timeout(1000)
        shows(
            page,
            "silence-text",
            rf"^The line is silent: nothing has arrived from serial:{plug}.* since \d+\.\d+ s by the clock",
        )
        shows(page, "state-word", "^Silent, Recording")
        page.wait_for_timeout(1500)  # a silence counts from a second on
        plug.unlink()
        with mat(4, 4) as (line, _):
            plug.symlink_to(line)
            until(lambda: page.locator("#silence").is_hidden(), "lines arrive again")
            shows(page, "state-word", r"^Recording trial1\.mcap$")
            page.wait_for_timeout(500)
            page.locator("#record").click()
            shows(page, "record-last-verdict", r"no frame arrived for a second or more: 1 time, \d+\.\d s in all")
            shows(page, "state-word", "^Live$")
            connect.click()
            until(lambda: page.locator("#numbers-why").is_hidden(), "it is connected again")
            shows(page, "state-word", "^Live$")
    verdict = taxel.open(tmp_path / "trial1.mcap").verdict
    assert verdict.noted["silences"] == 1
    assert verdict.noted["silent_ms"] >= 1000
