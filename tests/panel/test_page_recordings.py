"""The page of a recording: its time axis and numbers, cuts and labels, in a real browser."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import (
    GRID,
    NUMBERS,
    clock,
    pixel,
    press,
    recording,
    replay,
    shown,
    shows,
    span,
    still,
    until,
)

import taxel

__all__ = ["recording", "replay"]

pytestmark = pytest.mark.timeout(600)

#: 2026-11-18 11:06:40 UTC, us since 1970.
BEGIN_US = 1_794_999_999_000_000 + 1_000_000


def test_a_long_recording_opens_on_its_first_touch_and_cursors_say_its_numbers(chromium: Any, tmp_path: Path) -> None:
    draw = np.random.default_rng(4)
    values = draw.integers(0, 90, (1200, 3, 4)) * (draw.random((1200, 1, 1)) < 0.1)
    values[:60], values[60:64] = 0, 80
    frames = taxel.Frames(values, BEGIN_US + np.arange(1200) * 50_000, unit="N", array=taxel.Array(3, 4))
    taxel.convert(frames, tmp_path / "peaks.npz")
    with shown(chromium, tmp_path / "peaks.npz") as page:
        opens_on_its_first_touch(page)
        cursors_say_numbers(page, values)


def opens_on_its_first_touch(page: Any) -> None:
    """Of a long recording ten seconds are shown, with all of it below; times count from its beginning."""
    until(lambda: 3.0 <= clock(page) < 3.2, "the first touch")
    start, stop = span(page)
    assert stop - start == pytest.approx(10, abs=0.1)
    assert start < 3.0
    assert stop > 3.2
    assert float(page.locator("#strip").get_attribute("aria-valuemax")) == pytest.approx(59.95, abs=0.02)
    shows(page, "clock-more", r"^of 59\.\d{3} s$")
    shows(page, "begun", r"^0 s: \d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.000 UTC$")
    assert page.locator("#pressure-cross").is_hidden(), "no crosshair was placed"
    assert page.locator("#tab-labels").get_attribute("aria-selected") == "true"


def cursor_s(page: Any, t_s: float) -> float:
    """Point at a time in the lanes; return the time that the cursor says."""
    page.mouse.move(pixel(page, t_s), page.locator("#force-lane").bounding_box()["y"] + 9)
    return float(page.locator("#cursor-time").inner_text()[:-2])


def cursors_say_numbers(page: Any, values: np.ndarray) -> None:
    """The sum beside the cursor is that of its frame; a second cursor measures from the first."""
    press(page, "a")
    until(lambda: span(page)[1] - span(page)[0] > 59, "all of it")
    tried = 0
    for t_s in np.random.default_rng(5).uniform(1, 58, 20):
        t_us = 1e6 * cursor_s(page, t_s)
        # The time is written in ms.
        if 2000 < t_us % 50_000 < 48_000:
            tried += 1
            shows(page, "force-sum", f"^{int(values[int(t_us // 50_000)].sum())} N$")
    assert tried > 10
    first = cursor_s(page, 10.0)
    press(page, "s")
    second = cursor_s(page, 42.0)
    shows(page, "second-time", r"^\+\d+\.\d{3} s$")
    assert float(page.locator("#second-time").inner_text()[1:-2]) == pytest.approx(second - first, abs=0.002)
    press(page, "s")
    until(lambda: page.locator("#second-line").is_hidden(), "it is taken away")


def test_the_lanes_zoom_and_scroll(replay: Any) -> None:
    still(replay)
    box = replay.locator("#raster").bounding_box()
    replay.mouse.move(pixel(replay, 5.2), box["y"] + 5)
    for _ in range(8):
        before = span(replay)
        replay.mouse.wheel(0, -200)
        until(lambda before=before: span(replay) != before, "it zooms")
    start, stop = span(replay)
    assert stop - start < 1
    # The time under the pointer stays there, and the columns are narrower now: the fall is 7.5 ms long.
    pointed = float(replay.locator("#cursor-time").inner_text()[:-2])
    assert pixel(replay, 5.2) == pytest.approx(pixel(replay, pointed), abs=3)
    replay.mouse.click(pixel(replay, 5.2), box["y"] + 5)
    until(lambda: clock(replay) == pytest.approx(5.2, abs=0.003), "a click shows the map at that time")
    middle = box["x"] + box["width"] / 2
    replay.mouse.move(middle, box["y"] + 5)
    replay.mouse.down()
    replay.mouse.move(middle + box["width"] / 4, box["y"] + 6, steps=4)
    replay.mouse.up()
    until(lambda: span(replay)[0] == pytest.approx(start - (stop - start) / 4, abs=0.01), "a drag scrolls")
    assert clock(replay) == pytest.approx(5.2, abs=0.003), "and shows no other time"
    # While it is dragged too, the lines of the grid are at the numbers below.
    replay.mouse.down()
    for step in range(1, 5):
        replay.mouse.move(middle + box["width"] / 4 - 37 * step, box["y"] + 5)
        replay.wait_for_timeout(60)
        lines, numbers = replay.evaluate(GRID, "force"), replay.evaluate(NUMBERS)
        assert len(numbers) > 1
        assert all(min(abs(line - number) for line in lines) < 0.4 for number in numbers), (lines, numbers)
    replay.mouse.up()
    press(replay, "Home")
    until(lambda: span(replay)[0] < 0.2 < span(replay)[1], "the window follows the time")
    replay.locator("#zoom-all").click()
    until(lambda: span(replay)[1] > 9.2, "all of it")
    press(replay, "z")
    shows(replay, "span", r"^4\.\d s$")
    press(replay, "x", "x", "x")
    until(lambda: span(replay)[1] - span(replay)[0] < 10, "no longer than the recording")
    press(replay, "End", "5")
    until(lambda: clock(replay) > 9, "the end")


def test_a_click_anywhere_in_the_row_makes_a_label_and_a_handle_moves_it(replay: Any, recording: Path) -> None:
    table = recording.with_suffix("").with_suffix(".notes.csv")
    table.unlink(missing_ok=True)
    replay.reload()
    shows(replay, "label-count", "^0 labels")
    still(replay)
    replay.locator("#label-name").fill("a name of a label that is long")
    lane = replay.locator("#label-lane").bounding_box()
    low = lane["y"] + lane["height"] - 4
    # One click for each: the names of the others are not in its way.
    for count, t_s in enumerate((2.0, 2.3, 2.6, 2.9, 8.0), start=1):
        replay.mouse.click(pixel(replay, t_s), low)
        shows(replay, "label-count", f"^{count} label")
    marked = [int(row["t_us"]) / 1e6 for row in csv.DictReader(table.open())]
    assert marked == pytest.approx([2.0, 2.3, 2.6, 2.9, 8.0], abs=10 / lane["width"])
    # One count everywhere.
    assert "5 labels" in replay.locator("#files option:checked").inner_text()
    assert replay.locator("#label-list li").count() == replay.locator(".flag").count() == 5
    # Without a name there is no label: it is asked for.
    replay.locator("#label-name").fill("")
    replay.locator("#label-name").blur()
    replay.mouse.click(pixel(replay, 6.0), low)
    replay.locator("#label-name:focus").wait_for()
    replay.keyboard.type("toe")
    replay.mouse.click(pixel(replay, 6.0), low)
    shows(replay, "label-count", "^6 label")
    flag = replay.locator(".flag", has_text="toe")
    said = flag.get_attribute("aria-label")
    handle = flag.locator("i").bounding_box()
    at = (handle["x"] + 4, handle["y"] + 4)
    replay.mouse.click(*at)
    shows(replay, "label-count", "^6 label")
    assert "chosen" in flag.get_attribute("class")
    replay.mouse.move(*at)
    replay.mouse.down()
    replay.mouse.move(at[0] + 40, at[1], steps=4)
    replay.keyboard.press("Escape")
    replay.mouse.up()
    assert flag.get_attribute("aria-label") == said, "Escape gives up a drag"
    replay.mouse.move(*at)
    replay.mouse.down()
    replay.mouse.move(at[0] + lane["width"] / 10, at[1], steps=4)
    replay.mouse.up()
    until(lambda: flag.get_attribute("aria-label") != said, "it moves")
    seconds = [float(re.findall(r"at ([\d.]+) s", text)[0]) for text in (said, flag.get_attribute("aria-label"))]
    start, stop = span(replay)
    assert seconds[1] - seconds[0] == pytest.approx((stop - start) / 10, abs=0.03)
    # A label that was deleted by a click comes back by one.
    replay.locator("#label-list li").last.get_by_text("×").click()
    shows(replay, "label-count", "^5 label")
    replay.locator("#notice-offer").click()
    shows(replay, "label-count", "^6 label")
    a_key_takes_back_a_change(replay)
    a_stretch_is_cut_out(replay, recording)


def a_key_takes_back_a_change(replay: Any) -> None:
    """But in a field, where the key is the field's own."""
    replay.locator("#label-name").fill("new")
    replay.locator("#label-name").press("Control+z")
    press(replay, "m")
    shows(replay, "label-count", "^7 label")
    press(replay, "Control+z")
    shows(replay, "label-count", "^6 label")


def a_stretch_is_cut_out(replay: Any, recording: Path) -> None:
    """Cut from the cursor's keys; the file is named after the recording."""
    press(replay, "Home", "5")
    until(lambda: clock(replay) < 0.3, "the beginning")
    press(replay, "[")
    press(replay, "Shift+ArrowRight")
    until(lambda: clock(replay) > 1.1, "a second on")
    press(replay, "]")
    assert replay.locator("#cut-name").input_value() == "walk-cut.mcap"
    replay.locator("#cut-name").fill("piece.mcap")
    replay.locator("#cut-write").click()
    shows(replay, "notice-text", r"wrote piece\.mcap")
    whole, piece = taxel.open(recording).events, taxel.open(recording.parent / "piece.mcap").events
    assert 0 < len(piece.t) < len(whole.t)
