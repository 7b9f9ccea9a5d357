"""A sensor is plugged in on the page: a mat on a serial line, in a real browser."""

from __future__ import annotations

import contextlib
import os
import pty
import threading
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import followed, is_in, press, shows, until

import taxel
import taxel.live

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


def connect(page: Any, port: object, rows: str, columns: str) -> None:
    """Plug in a sensor in the dialog, once its lines look as they should; a pseudo-terminal is in no list of ports."""
    press(page, "1")
    page.locator("#sensor-open").click()
    until(lambda: page.locator("#sensor-port option").count() > 0, "the ports are listed")
    page.locator("#sensor-port").evaluate("(list, port) => list.append(new Option(port, port))", str(port))
    page.locator("#sensor-port").select_option(str(port))
    until(lambda: page.locator("#sensor-rows").input_value() == rows, "the rows are guessed")
    assert page.locator("#sensor-columns").input_value() == columns
    page.locator("#sensor").get_by_role("button", name="Connect", exact=True).click()
    until(lambda: page.locator("#sensor").is_hidden(), "it is connected")


def is_free(port: Path) -> bool:
    """Whether another program can listen to a port."""
    with contextlib.suppress(OSError), taxel.live.Live(sources=f"serial:{port},array=4x4,frame_end=blank"):
        return True
    return False


def test_a_plug_that_is_pulled_while_recording_is_said_and_is_in_the_verdict(chromium: Any, tmp_path: Path) -> None:
    plug = tmp_path / "mat"
    with followed(chromium, tmp_path, 0) as (_, page):
        with mat(4, 4) as (line, _):
            plug.symlink_to(line)
            connect(page, plug, "4", "4")
            shows(page, "pressure-top", "counts")
            shows(page, "registers-why", "A sensor that prints numbers has no registers")
            is_in(page, "live")
            page.locator("#record").click()
            shows(page, "state-word", r"^Recording trial1\.mcap$")
            begun = (tmp_path / "trial1.mcap").stat().st_size
            until(lambda: (tmp_path / "trial1.mcap").stat().st_size > begun + 500, "lines are in the recording")
        shows(
            page,
            "silence-text",
            # The page says so after half a second; a verdict counts silences of a second or more.
            rf"^The line is silent: nothing has arrived from serial:{plug}.* for \d+\.\d s, since \d+\.\d+ s by",
        )
        shows(page, "state-word", "^Silent, Recording")
        plug.unlink()
        with mat(4, 4) as (line, _):
            plug.symlink_to(line)
            until(lambda: page.locator("#silence").is_hidden(), "lines arrive again")
            shows(page, "state-word", r"^Recording trial1\.mcap$")
            page.locator("#record").click()
            shows(page, "record-last-verdict", r"1 silence of a second or more, \d+ milliseconds of silence")
            is_in(page, "live")
            page.locator("#sensor-open").click()
            page.locator("#sensor-off").click()
            until(lambda: is_free(plug), "the port is free for other programs")
    verdict = taxel.open(tmp_path / "trial1.mcap").verdict
    assert verdict.noted["silences"] == 1
    assert verdict.noted["silent_ms"] >= 1000
