"""A recording of another maker from the command line to the page: times, sums, notes, headings, in a real browser."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats import bags
from tests.formats.bags import BEGIN_NS, PALM
from tests.formats.making import write_gaitpdb
from tests.panel.browser import running
from tests.panel.pages import clock, opened, pixel, shown, shows, span, until

import taxel
from taxel import Array, Frames

pytestmark = pytest.mark.timeout(600)


@contextmanager
def walked(chromium: Any, folder: Path, *words: str) -> Iterator[Any]:
    """Show a recording in a browser, by the command."""
    with (
        running("view", *words, "--no-open", folder=folder) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)")) as page,
    ):
        shows(page, "state-word", "^Replay$")
        shows(page, "clock", r"\d")
        yield page


def skin(folder: Path, name: str = "skin.bag") -> Path:
    """Write a bag of a skin at some 200 counts, with noise, that is pressed twice."""
    random = np.random.default_rng(1)
    values = random.normal(200, 20, (24, 32)) + random.normal(0, 3, (300, 24, 32))
    for begin in (100, 200):
        values[begin : begin + 50, 6:11, 10:16] += 300
    messages = [("/palm", PALM, 10.0 * k, 10.0 * k, bags.palm(np.round(one))) for k, one in enumerate(values)]
    return bags.write(folder / name, messages)


def test_times_since_1970_count_from_the_begin_of_the_recording_which_the_page_states(
    chromium: Any, tmp_path: Path
) -> None:
    skin(tmp_path)
    with walked(chromium, tmp_path, "skin.bag", "--topic", "/palm", "--array", "24x32") as page:
        assert clock(page) < 3
        start, stop = span(page)
        assert (start, stop) == (pytest.approx(0, abs=0.05), pytest.approx(2.99, abs=0.05))
        shows(page, "begun", r"^0 s: 2026-11-18 11:06:40\.000 UTC$")
        # Nothing is pressed between the presses: the rest of some 200 counts is subtracted.
        shows(page, "rest-from", "^above the rest of a quiet stretch$")
        area = page.locator("#area-now")
        until(lambda: int(area.inner_text().split()[0]) > 1, "the first touch")
        assert 25 <= int(area.inner_text().split()[0]) <= 40
        shows(page, "force-title", "^Sum$")
        page.locator("#label-name").fill("touch")
        page.locator("#mark").click()
        shows(page, "label-count", "^1 label$")
        table = tmp_path / "skin.notes.csv"
        at = [int(row["t_us"]) for row in csv.DictReader(table.open())]
        assert at == [pytest.approx(BEGIN_NS / 1000 + clock(page) * 1e6, abs=2)]
        time = page.locator("#label-list li input").nth(1)
        assert float(time.input_value()) == pytest.approx(clock(page), abs=1e-5)
        time.fill("2.123456")
        time.press("Enter")
        moved = BEGIN_NS // 1000 + 2_123_456
        until(lambda: [int(row["t_us"]) for row in csv.DictReader(table.open())] == [moved], "its own time is saved")
        assert time.evaluate("e => e.scrollWidth <= e.clientWidth"), "all of the number is in sight"


def notes_by_foot(file: Path) -> dict[str, list[tuple[str, int]]]:
    sources = taxel.open(file).sources
    return {foot: [(note.text, note.t) for note in one.notes] for foot, one in sources.items()}


def test_notes_of_both_feet_are_used_as_labels_of_each(chromium: Any, tmp_path: Path) -> None:
    file = write_gaitpdb(tmp_path)
    noted = notes_by_foot(file)
    count = sum(map(len, noted.values()))
    assert count > 0
    with shown(chromium, file) as page:
        shows(page, "label-count", "^0 labels$")
        assert page.locator("#train").is_hidden()
        shows(page, "notes-as-labels", rf"^Use as labels \({count}\)$")
        page.locator("#notes-as-labels").click()
        shows(page, "label-count", rf"^{count} label")
        until(page.locator("#notes-as-labels").is_hidden, "none is left to use")
        assert page.locator("#train").is_visible()
        assert set(page.locator("#label-list .unit").all_inner_texts()) == {"s"}
        assert set(page.locator("#label-list .source").all_inner_texts()) == set(noted)
    table = list(csv.DictReader((tmp_path / f"{file.stem}.notes.csv").open()))
    for foot, own in noted.items():
        assert sorted((row["label"], int(row["t_us"])) for row in table if row["source"] == foot) == sorted(own)
    # A note that is a label too is one event.
    again = notes_by_foot(file)
    assert {foot: sorted(own) for foot, own in again.items()} == {foot: sorted(own) for foot, own in noted.items()}


def test_the_notes_of_one_sensor_are_labels_of_all_of_it(chromium: Any, tmp_path: Path) -> None:
    frames = Frames(np.zeros((100, 4, 4)), np.arange(100) * 10_000, unit="N", array=Array(4, 4))
    (tmp_path / "noted").mkdir()
    taxel.convert(frames, tmp_path / "noted" / "mat.npz")
    (tmp_path / "noted" / "mat.notes.csv").write_text("label,t_us\nheel,300000\n")
    taxel.convert(taxel.open(tmp_path / "noted" / "mat.npz"), tmp_path / "mat.mcap")
    with shown(chromium, tmp_path / "mat.mcap") as page:
        shows(page, "notes-as-labels", r"^Use as labels \(1\)$")
        page.locator("#notes-as-labels").click()
        shows(page, "label-count", "^1 label$")
        table = tmp_path / "mat.notes.csv"
        assert table.read_text() == "label,t_us,replaces_us\nheel,300000,300000\n"
        assert [(note.text, note.t) for note in taxel.open(tmp_path / "mat.mcap").notes] == [("heel", 300_000)]
        # Moved, it is still one event; deleted none, until it is used again.
        time = page.locator("#label-list li input").nth(1)
        time.fill("0.25")
        time.press("Enter")
        until(lambda: table.read_text().endswith("heel,250000,300000\n"), "the new time is saved")
        assert page.locator("#notes-as-labels").is_hidden()
        assert [(note.text, note.t) for note in taxel.open(tmp_path / "mat.mcap").notes] == [("heel", 250_000)]
        until(lambda: page.locator("[title^='label heel at 0.25']").count() == 1, "the page has the new time")
        page.locator("#label-list li button").nth(0).click()
        until(lambda: clock(page) == 0.25, "the frame at the new time")
        page.locator("#label-list li button").nth(1).click()
        shows(page, "label-count", "^0 labels$")
        assert not taxel.open(tmp_path / "mat.mcap").notes
        shows(page, "notes-as-labels", r"^Use as labels \(1\)$")
        page.locator("#notice-offer").click()
        shows(page, "label-count", "^1 label$")
        assert [(note.text, note.t) for note in taxel.open(tmp_path / "mat.mcap").notes] == [("heel", 250_000)]


def test_a_frame_of_missing_values_alone_has_no_force(chromium: Any, tmp_path: Path) -> None:
    values = np.zeros((200, 6, 4))
    values[20:40], values[60:80] = 10.0, np.nan
    taxel.convert(Frames(values, np.arange(len(values)) * 20_000, unit="N", array=Array(6, 4)), tmp_path / "walk.npz")
    with shown(chromium, tmp_path / "walk.npz") as page:
        box = page.locator("#force-lane .u-over").bounding_box()
        for t_s, says in ((0.5, "^240 N$"), (1.0, "^0 N$"), (1.4, "^missing$"), (1.8, "^0 N$")):
            page.mouse.move(pixel(page, t_s), box["y"] + 5)
            shows(page, "force-sum", says)
