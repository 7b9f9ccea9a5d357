"""A source of numbers is chosen on the page: a mat on a serial line, in a real browser."""

from __future__ import annotations

import contextlib
import itertools
import os
import pty
import socket
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live.test_rest_shift import SHAPE, unplugged
from loopback import free_port
from tests.panel.browser import running
from tests.panel.pages import opened, shows, until

import taxel
from taxel.detect import PlainRule
from taxel.formats.layout import Layout
from taxel.live import Live, Panel

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


def test_what_arrives_is_shown_and_another_source_takes_the_place_of_the_first(tmp_path: Path) -> None:
    with mat(4, 4) as (line, _), Live(0, host="127.0.0.1", record_later=True) as first, Panel(first) as panel:
        panel.read_source(f"serial:{line},array=4x4,frame_end=blank,rate=50")
        live = panel.live
        assert live is not None
        assert (live.array.shape, live.unit, first.is_over) == ((4, 4), "counts", True)
        until(lambda: live.counters["frames"] > 10, "frames arrive")
        live.record(tmp_path / "mat.mcap")
        until(lambda: live.counters["frames"] > 40, "more frames arrive")
        live.end_recording()
        assert taxel.open(tmp_path / "mat.mcap").frames().array.shape == (4, 4)
        with pytest.raises(taxel.ProblemError, match="must be 25 per frame"):
            panel.read_source(f"serial:{line},array=5x5,frame_lines=4,columns=a:b:c:d,rate=50")
        assert panel.live is not None
        assert panel.live.array.shape == (4, 4)
        until(lambda: panel.live is not None and panel.live.counters["frames"] > 5, "the source before is back")


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


@contextlib.contextmanager
def falling() -> Iterator[str]:
    """Yield the address of a mat whose readings fall under touch, to whoever connects, 100 times a second."""
    over = threading.Event()

    def send(connection: socket.socket) -> None:
        rng = np.random.default_rng(1)
        with contextlib.suppress(OSError), connection:
            for k in itertools.count():
                frame = 800 + rng.integers(-1, 2, (6, 6))
                frame[2:5, 2:5] -= 200 * (k > 100 and k % 100 < 25)
                connection.sendall((",".join(map(str, frame.flat)) + "\n").encode())
                if over.wait(0.01):
                    break

    def accept() -> None:
        while not over.is_set():
            with contextlib.suppress(OSError):
                connection, _ = server.accept()
                threading.Thread(target=send, args=(connection,), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        thread = threading.Thread(target=accept, daemon=True)
        thread.start()
        try:
            yield f"127.0.0.1:{server.getsockname()[1]}"
        finally:
            over.set()
            thread.join(10)


def test_values_of_a_live_source_that_fall_are_turned_by_the_button_beside_what_says_so(chromium: Any) -> None:
    with (
        falling() as address,
        Live(sources=f"lines+tcp:{address},array=6x6,rate=100") as live,
        Panel(live) as panel,
        opened(chromium, panel.url) as page,
    ):
        shows(page, "silence-text", "fall from their rest.*falls=true")
        page.locator("#turn-values").click()
        until(lambda: page.locator("#silence").is_hidden(), "they are turned")
        assert page.locator("#numbers").input_value() == f"lines+tcp:{address},array=6x6,rate=100,falls=true"
        until(lambda: panel.live is not live and panel.live.frame.min() < -700, "the readings are turned")


def test_a_rest_that_shifted_in_a_gap_is_a_warning_of_the_source_until_it_is_zeroed(chromium: Any) -> None:
    shift = np.where(np.arange(36).reshape(SHAPE) < 20, 32.0, 0.0)
    rule = PlainRule("total", 200.0, 0.6, noise_floor=8.0, unit="counts")
    with (
        unplugged(shift) as address,
        Live(sources=f"lines+tcp:{address},array=6x6,rate=100", readout=rule, tare=0.5) as live,
        Panel(live) as panel,
        opened(chromium, panel.url) as page,
    ):
        shows(page, "silence-text", "After a gap of .* s, the rest of 20 of 36 taxels differs from the tare")
        live.zero(*np.indices(SHAPE)[::-1].reshape(2, -1))
        until(lambda: page.locator("#silence").is_hidden(), "it is zeroed")
