"""A recording of another maker from the command line to the page: times, sums, notes, headings, in a real browser."""

from __future__ import annotations

import csv
import json
import re
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
from tests.panel.pages import clock, opened, pixel, press, shown, shows, span, until

import taxel
from taxel import Array, Frames
from taxel.live import Panel
from taxel.recording.analysis.pressure import force_n

pytestmark = pytest.mark.timeout(600)

SIZES = [{"width": 1400, "height": 900}, {"width": 390, "height": 844}]
LOW = "e => e.getBoundingClientRect().bottom"


@contextmanager
def walked(chromium: Any, folder: Path, *words: str, **size: int) -> Iterator[Any]:
    """Show a recording in a browser, by the command."""
    with (
        running("view", *words, "--no-open", folder=folder) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"), **size) as page,
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


@pytest.mark.parametrize("size", SIZES)
def test_times_since_1970_count_from_the_begin_of_the_recording_which_the_page_states(
    size: dict[str, int], chromium: Any, tmp_path: Path
) -> None:
    skin(tmp_path)
    with walked(chromium, tmp_path, "skin.bag", "--topic", "/palm", "--array", "24x32", **size) as page:
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


@pytest.mark.parametrize("size", SIZES)
def test_of_a_long_sensor_of_known_area_the_force_is_in_newtons_and_the_buttons_are_in_sight(
    size: dict[str, int], chromium: Any, tmp_path: Path
) -> None:
    values = np.zeros((60, 60, 21))
    values[20:40, 10:20, 5:10] = 100.0
    frames = Frames(values, np.arange(60) * 20_000, unit="kPa", array=Array(60, 21, pitch_mm=5.08))
    taxel.convert(frames, tmp_path / "walk.npz")
    newtons = force_n(frames).max()
    with shown(chromium, tmp_path / "walk.npz", **size) as page:
        shows(page, "force-title", "^Force$")
        shows(page, "force-sum", rf"^{newtons:.0f} N$")
        foot = page.locator("footer").evaluate("e => e.getBoundingClientRect().top")
        for name in ("zoom-all", "zoom-out", "zoom-in", "health"):
            button = page.locator(f"#{name}")
            assert button.is_visible()
            if size == SIZES[0]:
                assert button.evaluate(LOW) <= foot, name
        assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]


@pytest.mark.parametrize("size", SIZES)
def test_neither_marks_nor_lines_cover_the_headings_of_the_lanes(
    size: dict[str, int], chromium: Any, tmp_path: Path
) -> None:
    values = np.zeros((200, 8, 8))
    values[50:, 2:5, 2:5] = 40
    taxel.convert(Frames(values, np.arange(200) * 10_000, unit="N", array=Array(8, 8)), tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz", **size) as page:
        assert page.locator("#detection-marks").is_hidden(), "no row for marks where there are none"
        # In one go: the page draws its marks anew whenever the recording's own come.
        mark, lane, head = page.evaluate(
            """() => {
                const box = name => document.querySelector(name).getBoundingClientRect().toJSON();
                const marks = document.getElementById("detection-marks"), one = document.createElement("span");
                const without = marks.hidden;
                [marks.hidden, one.className, one.style.left] = [false, "shape", "20%"];
                marks.append(one);
                const boxes = ["#detection-marks span", "#label-lane", "#force-block h2"].map(box);
                one.remove();
                marks.hidden = without;
                return boxes;
            }"""
        )
        assert lane["bottom"] <= mark["y"]
        assert mark["bottom"] <= head["y"]
        # The line at the time shown and the cursor's stand over the lanes; their headings stand over the lines.
        order = """() => { const z = name => Number(getComputedStyle(document.querySelector(name)).zIndex);
            return [z("#force-block h2"), z("#track")]; }"""
        above, below = page.evaluate(order)
        assert above > below
        assert (
            page.locator("#force-block h2").evaluate("e => getComputedStyle(e).backgroundColor") != "rgba(0, 0, 0, 0)"
        )
        assert head["width"] < lane["width"] * 0.95, "beside a heading the lines are seen"


def test_notes_of_both_feet_are_used_as_labels_of_each(chromium: Any, tmp_path: Path) -> None:
    file = write_gaitpdb(tmp_path)
    noted = {one.label: [(note.text, note.t) for note in one.notes] for one in taxel.open_all(file)}
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
    again = {one.label: [(note.text, note.t) for note in one.notes] for one in taxel.open_all(file)}
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


def test_what_is_being_read_is_named(chromium: Any, tmp_path: Path) -> None:
    frames = Frames(np.zeros((50, 4, 4)), np.arange(50) * 10_000, unit="N", array=Array(4, 4))
    taxel.convert(frames, tmp_path / "mat.npz")
    # What the server sends is held back, as by a file that takes long to read.
    with Panel(tmp_path / "mat.npz") as panel:
        page = chromium.new_context().new_page()
        held: list[Any] = []

        def hold(socket: Any) -> None:
            to = socket.connect_to_server()
            socket.on_message(to.send)

            def pass_on(message: Any) -> None:
                answers = isinstance(message, str) and json.loads(message)["type"] in ("opened", "done")
                held.append(message) if answers else socket.send(message)

            to.on_message(pass_on)

        page.route_web_socket("**/socket", hold)
        page.goto(panel.url)
        shows(page, "state-word", "^Opening$")
        shows(page, "source", r"^reading mat\.npz …")
        page.context.close()


def test_a_label_of_numbered_frames_is_at_a_frame_and_not_at_a_second(chromium: Any, tmp_path: Path) -> None:
    values = np.zeros((60, 4, 5))
    values[20:30, 1:3, 2:4] = 9.0
    np.savetxt(tmp_path / "mat.csv", values.reshape(60, -1), fmt="%g", delimiter=",")
    (tmp_path / "mat.layout.toml").write_text("rows = 4\ncolumns = 5\n")
    with walked(chromium, tmp_path, "mat.csv") as page:
        shows(page, "clock", "^frame 20$")
        page.locator("#label-name").fill("touch")
        page.locator("#mark").click()
        shows(page, "label-count", "^1 label$")
        time = page.locator("#label-list li input").nth(1)
        assert f"frame {time.input_value()}" == page.locator("#clock").inner_text()
        assert time.get_attribute("aria-label") == "time of touch, frames"
        time.fill("25")
        time.press("Enter")
        table = tmp_path / "mat.notes.csv"
        until(lambda: [row["t_us"] for row in csv.DictReader(table.open())] == ["25"], "its number is saved")
        until(lambda: page.locator("#label-list li input").nth(1).input_value() == "25", "and shown")


def test_values_that_fall_are_said_above_the_maps_with_what_to_do(chromium: Any, tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    values = 900 + random.normal(0, 2, (600, 8, 8))
    for begin in (200, 400):
        values[begin : begin + 60, 2:5, 2:5] -= 300
    taxel.convert(
        Frames(np.round(values), np.arange(600) * 10_000, unit="counts", array=Array(8, 8)), tmp_path / "a.npz"
    )
    with shown(chromium, tmp_path / "a.npz") as page:
        shows(
            page,
            "silence",
            r"^The values fall from their rest.* writes “falls = true” into a\.layout\.toml beside the rec",
        )
    (tmp_path / "a.layout.toml").write_text("falls = true\n")
    with shown(chromium, tmp_path / "a.npz") as page:
        until(lambda: 2 <= clock(page) < 2.6, "the first touch")
        assert page.locator("#silence").is_hidden()


def test_why_a_file_was_not_opened_stays_in_sight(chromium: Any, tmp_path: Path) -> None:
    (tmp_path / "worn.csv").write_text("t_us,a,b\n0,1,2\n10000,x,1\n")
    with (
        running("view", "worn.csv", "--no-open", folder=tmp_path) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)")) as page,
    ):
        shows(page, "silence", r"worn\.csv, line 3")
        assert page.locator("#notice").is_hidden()
        assert page.locator("#silence").is_visible()
        shows(page, "state-word", "^No recording$")


def test_a_taxel_that_flickers_sets_no_colours_and_is_marked(chromium: Any, tmp_path: Path) -> None:
    values = np.random.default_rng(6).integers(0, 3, (600, 8, 8))
    values[200:240, 2:5, 2:5] += 60
    values[7::30, 6, 5] = 4000
    taxel.convert(Frames(values, np.arange(600) * 20_000, unit="counts", array=Array(8, 8)), tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz") as page:
        until(lambda: 4 <= clock(page) < 4.8, "the first touch")
        shows(page, "pressure-top", "^6[0-9] counts$")
        shows(page, "rest-from", "1 flickering taxel left out$")
        assert page.locator("#pressure-marks .noisy").get_attribute("title") == "noisy: row 6, column 5"


def test_notes_have_the_room_of_their_tab(chromium: Any, tmp_path: Path) -> None:
    times = np.arange(40) * 20_000
    taxel.convert(Frames(np.ones((40, 4, 4)), times, unit="N", array=Array(4, 4)), tmp_path / "mat.npz")
    (tmp_path / "labels.csv").write_text("recording,label,t_us\n" + "".join(f"mat,contact,{t}\n" for t in times[:12]))
    with shown(chromium, tmp_path / "mat.npz") as page:
        last = page.locator("#note-list li").nth(11)
        assert last.evaluate(LOW) < page.locator(".detections-block").bounding_box()["y"], "without scrolling"


def test_the_head_of_frames_has_their_number_and_each_foot_and_no_words_on_losses_that_no_such_file_counts(
    chromium: Any, tmp_path: Path
) -> None:
    file = write_gaitpdb(tmp_path)
    feet = taxel.open_all(file)
    assert {foot.verdict.status for foot in feet} == {"unknown"}
    with shown(chromium, file) as page:
        count = f"{sum(len(foot.frames()) for foot in feet):,}"
        shows(page, "source", rf"^{re.escape(file.name)} · {count} frames, left 1 × 8, right 1 × 8$")


def test_the_values_above_the_lanes_are_in_full_on_a_phone(chromium: Any, tmp_path: Path) -> None:
    values = np.zeros((60, 64, 64))
    values[20:40, 10:34, 25:49] = 50.0
    frames = Frames(values, np.arange(60) * 20_000, unit="kPa", array=Array(64, 64, pitch_mm=2.67))
    taxel.convert(frames, tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz", **SIZES[1]) as page:
        press(page, "c", "ArrowRight")
        until(lambda: page.locator("#taxel-block").is_visible(), "the taxel's lane")
        for name in ("taxel", "force", "centre"):
            head = page.locator(f"#{name}-block h2")
            assert head.evaluate("e => e.scrollWidth <= e.clientWidth"), head.inner_text()
        # Text is written eight times a second.
        shows(page, "centre-now", r"mm\)")


@pytest.mark.parametrize("seconds", [2, 4, 60])
def test_a_frame_of_missing_values_alone_has_no_force(seconds: int, chromium: Any, tmp_path: Path) -> None:
    values = np.zeros((100 * seconds // 2, 6, 4))
    values[20:40], values[60:80] = 10.0, np.nan
    taxel.convert(Frames(values, np.arange(len(values)) * 20_000, unit="N", array=Array(6, 4)), tmp_path / "walk.npz")
    with shown(chromium, tmp_path / "walk.npz") as page:
        box = page.locator("#force-lane .u-over").bounding_box()
        for t_s, says in ((0.5, "^240 N$"), (1.0, "^0 N$"), (1.4, "^missing$"), (1.8, "^0 N$")):
            page.mouse.move(pixel(page, t_s), box["y"] + 5)
            shows(page, "force-sum", says)


def pointed(page: Any, t_s: float, name: str, says: str) -> None:
    """Point at a time in the lanes, and wait until one says this."""
    page.mouse.move(pixel(page, t_s), page.locator("#force-lane .u-over").bounding_box()["y"] + 5)
    shows(page, name, says)


#: The colours of a canvas below an element, as "r,g,b" texts.
COLOURS = """e => {
    const { width, height } = e.querySelector("canvas");
    const { data } = e.querySelector("canvas").getContext("2d").getImageData(0, 0, width, height);
    const all = new Set();
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] === 255) all.add(data.slice(i, i + 3).join(", "));
    return [...all];
}"""


@pytest.mark.parametrize("size", SIZES)
def test_each_foot_has_a_sum_and_a_colour_of_its_own(size: dict[str, int], chromium: Any, tmp_path: Path) -> None:
    file = write_gaitpdb(tmp_path)
    with shown(chromium, file, **size) as page:
        for t_s, left, right in ((0.05, 320, 320), (0.3, 320, 0), (0.8, 0, 320), (5.05, 320, 320)):
            pointed(page, t_s, "force-sums", rf"^\s*left\s+{left} N\s+right\s+{right} N\s*$")
        shows(page, "area-now", "^16 taxels$")
        for name in ("force", "centre"):
            head = page.locator(f"#{name}-block h2")
            assert head.evaluate("e => e.scrollWidth <= e.clientWidth"), f"all is in sight of {head.inner_text()}"
        # Each foot has a centre, where its own heel and toes are.
        shows(page, "centre-now", r"^left x -\d+, y 0, right x \d+, y 0, units of the file$")
        pointed(page, 0.3, "centre-now", r"^left x -\d+, y 0, units of the file$")
        pointed(page, 0.8, "centre-now", r"^right x \d+, y 0, units of the file$")
        named = page.locator("#force-sums .swatch").evaluate_all(
            "all => all.map(e => getComputedStyle(e).backgroundColor.slice(4, -1))"
        )
        assert len(set(named)) == 2
        assert set(named) <= set(page.locator("#force-lane").evaluate(COLOURS))


@pytest.mark.parametrize("noise", [0, 3, 6])
def test_of_noise_alone_no_centre_is_drawn(noise: int, chromium: Any, tmp_path: Path) -> None:
    random = np.random.default_rng(noise)
    values = random.normal(200, 20, (12, 10)) + random.normal(0, noise, (600, 12, 10))
    presses = [(k, 2 + k // 100, 1 + k // 150) for k in range(100, 600, 100)]
    for k, y, x in presses:
        values[k : k + 40, y : y + 3, x : x + 4] += 120
    frames = Frames(np.round(values), np.arange(600) * 10_000, unit="counts", array=Array(12, 10))
    taxel.convert(frames, tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz") as page:
        for k, y, x in presses:
            pointed(page, k / 100 - 0.3, "centre-now", "^nothing pressed$")
            pointed(page, k / 100 + 0.2, "centre-now", r"^\d")
            column, row = (float(n) for n in page.locator("#centre-now").inner_text().split(", "))
            assert (column, row) == (pytest.approx(x + 1.5, abs=0.5), pytest.approx(y + 1, abs=0.5))


@pytest.mark.parametrize("feet", [1, 2])
def test_on_a_phone_the_map_leaves_the_curves_in_sight(feet: int, chromium: Any, tmp_path: Path) -> None:
    path = tmp_path / "walk.npz"
    values = np.zeros((60, 8, 2))
    values[20:40] = 100.0
    taxel.convert(Frames(values, np.arange(60) * 20_000, unit="N", array=Array(8, 2)), path)
    with shown(chromium, write_gaitpdb(tmp_path) if feet == 2 else path, width=390, height=844) as page:
        assert page.locator("#pressure-frame").bounding_box()["height"] > 200
        lane = page.locator("#force-lane").bounding_box()
        assert lane["y"] + lane["height"] <= page.locator("footer").bounding_box()["y"]
