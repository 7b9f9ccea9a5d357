"""The page of a live board: registers, recordings, readouts, silence; a real browser and an emulated board."""

from __future__ import annotations

import csv
import re
import socket
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from discs import recipe, tare, touches
from loopback import free_port
from tests.panel.pages import (
    FOLLOWS,
    PIXELS,
    clock,
    followed,
    is_in,
    live,
    page,
    press,
    recording,
    replay,
    shows,
    still,
    until,
)
from tests.panel.protocol import word

import taxel
from taxel.detect import Example, fit
from taxel.simulate import Board, Replay, emulate
from taxel.wire import Registers

__all__ = ["live", "page", "recording", "replay"]

pytestmark = pytest.mark.timeout(600)

#: What can be used and has no name for those who do not see it.
NAMELESS = """() => [...document.querySelectorAll("button, input, select, canvas[role], [role=application]")]
    .filter(e => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim()))
    .map(e => e.outerHTML.slice(0, 80))"""


def test_a_trained_readout_is_heard_in_the_page_with_its_latency(chromium: Any, tmp_path: Path) -> None:
    readout = fit([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe())
    events, truth = touches(11)
    found: list[taxel.Detection] = []
    given = {"readout": readout, "tare": tare(), "array": taxel.Array(8, 8), "say": found.append}
    with followed(chromium, tmp_path, 0, **given) as (live, page):
        is_in(page, FOLLOWS)
        shows(page, "detections-none", "^None yet")
        press(page, "5")
        emulate("{}:{}".format(*live.address), Replay(events), registers=Registers(array=events.array))
        wanted = sorted(truth["contact"] + truth["lift"])
        until(lambda: len(found) >= len(wanted), "the board has been heard to its end")
        until(lambda: page.locator("#detection-count").inner_text() == str(len(found)), "the page has each of them")
        listed = page.locator("#detection-list li")
        until(lambda: listed.count() == len(found), "the page lists each of them")
        # The page lists the detections, the latest first, with the time and the latency of each.
        rows = listed.all_inner_texts()
        assert all(re.search(r"\d+\.\d{3} s\s+(at once|-?\d[\d.]* (µs|ms|s))$", row) for row in rows), rows
        names = [re.match(r"\w+", row.strip()).group() for row in rows]  # type: ignore[union-attr]
        at = np.array([float(re.findall(r"([\d.]+) s", row)[0]) for row in rows])
        assert names[::-1] == [one.label for one in found]
        assert at[::-1] == pytest.approx([one.t / 1e6 for one in found], abs=0.0011)
        until(lambda: page.locator("#latency").inner_text() != "–", "latency is counted")
        page.locator("#detection-list button").last.click()
        is_in(page, "held")
        # Where the view is at rest: one that follows leaves them behind.
        until(lambda: page.locator("#detection-marks span").count() > 0, "detections are marked")
        # If the machine delays the emulated board, detections that were output too early are in the list too, and
        # counted there.
        if not live.counters["late"] + live.counters["wrong"]:
            assert names == ["lift", "contact"] * 6
            assert np.diff(at[::-1]) * 1e6 == pytest.approx(np.diff(wanted), abs=4000)


def test_what_does_not_arrive_is_said(chromium: Any, tmp_path: Path) -> None:
    port = free_port()
    array = taxel.Array(4, 4)
    registers = Registers._of_source(array, 500.0, 12)[0].replace(noise_floor=3)
    board, given = Board(registers, array), {"array": array, "registers": registers}

    def push(value: int) -> None:
        for datagram in board.frame(np.full(16, value)):
            sender.sendto(datagram, ("127.0.0.1", port))

    with followed(chromium, tmp_path, port, **given) as (_, page), socket.socket(type=socket.SOCK_DGRAM) as sender:
        shows(page, "silence", rf"^Nothing has arrived at UDP 127\.0\.0\.1:{port} so far")
        shows(page, "state-word", "^Nothing arrives$")
        shows(page, "frames", "^–$")
        # Version 1 has no heartbeats: quiet.
        sender.sendto(word(1_000_000, 1, 1, 50), ("127.0.0.1", port))
        shows(page, "silence", r"^Quiet: nothing has arrived for .*, since 1\.000 s by the clock of the board")
        shows(page, "state-word", "^Quiet$")
        # Version 2 sends them: lost.
        for k in range(200):
            push(100 if k < 20 else 300)
            time.sleep(0.002)

        def shown() -> bool:
            push(300)
            return bool(page.locator("#frames").inner_text() == "500")

        until(shown, "the frames of a board that sends")
        shows(page, "silence", "^The board is silent: nothing has arrived for .* heartbeat at least every ")
        shows(page, "state-word", "^Silent$")
        shows(page, "frames", "^–$")


def looked_back(page: Any) -> None:
    """Look back at a board that goes on, step there, and follow it again."""
    until(lambda: clock(page) > 2, "there is something to look back at")
    press(page, "Space")
    is_in(page, "held")
    held = still(page)
    shows(page, "clock-more", r"^\d+(\.\d)? (ms|s) behind$")
    press(page, "ArrowLeft")
    until(lambda: clock(page) == pytest.approx(held - 0.1, abs=0.002), "a tenth of a second back")
    back = still(page)
    press(page, ".")
    until(lambda: clock(page) > back, "a step on")
    on = still(page)
    press(page, ",", ",")
    until(lambda: clock(page) < on, "two steps back")
    events = page.locator("#events").inner_text()
    until(lambda: page.locator("#events").inner_text() != events, "the board goes on")
    press(page, "l")
    is_in(page, "live")
    until(lambda: clock(page) > held + 0.1, "it follows again")
    shows(page, "clock-more", "^$")


def story(page: Any, folder: Path, name: str, floor_ticks: int) -> None:
    """Set a register, see the map move, record, label, stop, replay, and look into the file."""
    before = page.evaluate(PIXELS, "pressure-map")
    press(page, "1")
    floor = page.get_by_label("Noise floor", exact=True)
    floor.fill(str(floor_ticks))
    floor.press("Tab")
    # The page must show the value that the board reports, not the one that was typed.
    page.locator("#read-back").click()
    shows(page, "registers-why", "^$")
    until(lambda: floor.input_value() == str(floor_ticks), "the board holds the floor")
    until(lambda: page.evaluate(PIXELS, "pressure-map") != before, "the map moves")
    press(page, "2")
    page.locator("#record-name").fill(f"{name}7")
    page.locator("#record-label").fill("heel")
    press(page, "r")
    shows(page, "state-word", rf"Recording {name}7\.mcap")
    page.locator("#label-name").evaluate(
        "input => { input.value = 'contact'; input.dispatchEvent(new Event('input')) }"
    )
    press(page, "m")
    shows(page, "label-count", "^1 label")
    begun = clock(page)
    until(lambda: clock(page) > begun + 1, "a second of the board's time")
    until(lambda: float((page.locator("#record-state").inner_text().split() or ["0"])[0]) >= 2, "two seconds of it")
    press(page, "r")
    shows(page, "record-last-file", rf"^{name}7\.mcap$")
    assert page.locator("#record-name").input_value() == f"{name}8"
    page.locator("#files").select_option(f"{name}7.mcap")
    is_in(page, "replay")
    shows(page, "label-count", "^1 label")
    press(page, "Home")
    start = still(page)
    press(page, "Space")
    until(lambda: clock(page) > start + 0.2, "it plays")
    file = taxel.open(folder / f"{name}7.mcap")
    assert len(file.events.t) > 0
    assert file.registers is not None
    assert file.registers.noise_floor == floor_ticks
    rows = list(csv.DictReader((folder / f"{name}7.notes.csv").open()))
    assert [row["label"] for row in rows] == ["contact"]
    # The trial's label is no event: it has no time. The recording may begin in silence.
    said = {note.text: note.t for note in file.notes}
    assert said == {"heel": None, "contact": int(rows[0]["t_us"])}
    assert file.events.t[0] - 2_500_000 <= said["contact"] <= file.events.t[-1] + 2_500_000


def test_a_register_a_recording_and_a_label_reach_board_and_file(page: Any, live: SimpleNamespace) -> None:
    nameless = page.evaluate(NAMELESS)
    assert nameless == []
    looked_back(page)
    story(page, live.folder, "walk", 5)
