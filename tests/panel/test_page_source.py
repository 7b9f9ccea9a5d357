"""A sensor is plugged in on the page: a mat on a serial line, in a real browser."""

from __future__ import annotations

import contextlib
import os
import pty
import socket
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
    """Plug in a sensor in the dialogs, by keys, once its lines look as they should."""
    press(page, "1")
    page.locator("#sensor-open").click()
    page.locator("#sensor-place").fill(str(port))
    page.locator("#sensor-place").press("Enter")
    until(lambda: page.locator("#roles").is_visible(), "its lines are shown")
    shape = page.locator("#roles-fields label", has_text="(a guess)").locator("input")
    until(lambda: shape.count() == 2, "rows and columns are guessed")
    assert [shape.nth(k).input_value() for k in range(2)] == [rows, columns]
    page.locator("#roles-open").press("Enter")
    until(lambda: page.locator("#roles").is_hidden(), "it is connected")


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


def test_what_a_server_prints_is_chosen_by_columns_on_a_phone(chromium: Any, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, followed(chromium, tmp_path, 0) as (_, page):
        page.set_viewport_size({"width": 390, "height": 800})
        place = "{}:{}".format(*server.getsockname())
        over = threading.Event()

        def send() -> None:
            # One who looks, and one who receives.
            while not over.is_set():
                line, _ = server.accept()
                with contextlib.suppress(OSError), line:
                    for k in range(100_000):
                        line.sendall(f"{k * 20},{k % 7},{k % 5},{k % 9},{k % 3},8\n".encode())
                        if over.wait(0.02):
                            return

        thread = threading.Thread(target=send, daemon=True)
        thread.start()
        page.locator("#tab-board").click()
        page.locator("#sensor-open").click()
        page.locator("#sensor-place").fill(f"lines+tcp:{place}")
        page.locator("#sensor-form button.primary").click()
        until(lambda: page.locator("#roles-rows tr").count() == 6, "a row for each column")
        assert page.evaluate("document.querySelector('#roles').scrollWidth <= window.innerWidth")
        page.locator("#roles-rows tr").nth(5).locator("select").first.select_option("left out")
        rows = page.locator("#roles-fields label", has_text="Rows").locator("input")
        until(lambda: rows.input_value() == "2", "four taxels are left")
        rows.fill("4")
        rows.press("Tab")
        columns = page.locator("#roles-fields label", has_text="Columns").locator("input")
        until(lambda: columns.input_value() == "1", "columns are proposed")
        until(lambda: page.locator("#roles-seen figure").count() == 1, "the map is drawn")
        page.locator("#roles-open").click()
        until(lambda: page.locator("#roles").is_hidden(), "it is connected")
        shows(page, "pressure-top", "counts")
        over.set()
        page.locator("#sensor-open").click()
        page.locator("#sensor-place").fill(f"lines:{tmp_path.parent / 'elsewhere.csv'}")
        page.locator("#sensor-form button.primary").click()
        shows(page, "sensor-about", "must be a file of the folder")


def test_each_of_several_live_sensors_is_shown_by_the_menu(chromium: Any, tmp_path: Path) -> None:
    with followed(chromium, tmp_path, 0, sources=["mat=given,array=4x2,rate=50,unit=N"]) as (live, page):
        shows(page, "source", "64 × 64$")
        page.locator("#parts").select_option("mat")
        shows(page, "source", "4 × 2$")
        for k in range(20):
            live.sample("mat", [0, 0, 0, 0, 0, 0, 0, 5.0 * (k % 2)])
        shows(page, "pressure-title", "Force")
        shows(page, "pressure-top", "N")
        assert page.locator("#zero-all").is_hidden()
        page.locator("#parts").select_option("board")
        shows(page, "source", "64 × 64$")
        shows(page, "pressure-title", "Pressure")
