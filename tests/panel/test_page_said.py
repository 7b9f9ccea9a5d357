"""What the page says of a training, of detections and of what cannot be shown, in a real browser."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.browser import running
from tests.panel.pages import clock, opened, press, recording, shown, shows, still, until

import taxel
from taxel import Array, Frames
from taxel.live import Panel
from taxel.live._requests.training import TrainedReadout, TrainingRequests
from taxel.live._shown_files import Opening, ShownFiles
from taxel.recording.analysis.pressure import readings
from taxel.recording.analysis.rest import of_frames

__all__ = ["recording"]

pytestmark = pytest.mark.timeout(600)


@contextmanager
def answered(chromium: Any, file: Path, answers: dict[str, list[dict[str, Any]]]) -> Iterator[Any]:
    """Show a recording; for requests of the kinds in `answers` these messages come instead of the server's.

    The server sends its list of recordings by itself too, which must not replace theirs.
    """
    given = {answer["type"] for each in answers.values() for answer in each} - {"done"}
    with Panel(file) as panel:
        page = chromium.new_context().new_page()

        def between(socket: Any) -> None:
            server = socket.connect_to_server()

            def pass_on(text: Any) -> None:
                message = json.loads(text)
                for answer in answers.get(message["type"], []):
                    socket.send(
                        json.dumps({**answer, **({"id": message.get("id")} if answer["type"] == "done" else {})})
                    )
                if message["type"] not in answers:
                    server.send(text)

            def pass_back(message: Any) -> None:
                if isinstance(message, bytes) or json.loads(message)["type"] not in given:
                    socket.send(message)

            socket.on_message(pass_on)
            server.on_message(pass_back)

        page.route_web_socket("**/socket", between)
        page.goto(panel.url)
        shows(page, "state-word", "^Replay$")
        yield page
        page.context.close()


def labelled(recording: Path) -> None:
    """Give the recording labels, so that it can be trained on."""
    recording.with_suffix("").with_suffix(".notes.csv").write_text("label,t_us\ncontact,2000000\nlift,3000000\n")


def test_a_training_that_runs_says_how_far_it_is(chromium: Any, recording: Path) -> None:
    labelled(recording)
    said = "fold 2 of 5, after 30 s; about 148 s in all"
    with answered(chromium, recording, {"train": [], "training": [{"type": "training", "text": said}]}) as page:
        page.locator("#train").click()
        shows(page, "train-text", f"^{said}$")
        shows(page, "train", "^Stop the training")


@pytest.mark.parametrize("count", [1, 3, 40])
def test_labels_and_what_a_training_printed_are_in_sight_together(count: int, chromium: Any, recording: Path) -> None:
    table = recording.with_suffix("").with_suffix(".notes.csv")
    table.write_text("label,t_us\n" + "".join(f"contact,{200_000 * k}\n" for k in range(1, count + 1)))
    printed = "\n".join(f"held out: contact, neuron: {k} of 5 found, 0 missed, 0 false" for k in range(30))
    trained = {"type": "trained", "name": recording.name, "readout": "walk.readout.json", "text": printed}
    trained |= {"next": "taxel detect RECORDING", "judged_on": "held out", "mistakes": []}
    score = {"label": "contact", "is_plain_rule": False, "found": 5, "missed": 0, "false": 0, "delay_ms": 4.5}
    trained |= {"scores": [score, score | {"is_plain_rule": True, "delay_ms": None}]}
    found = [{"label": "contact", "t_us": 10**5 * k, "known_us": 10**5 * k} for k in range(40)]
    detected = {
        "type": "detections",
        "source": recording.name,
        "readout": "walk.readout.json",
        "labels": ["contact"],
        "encoders": [],
    }
    answers = {"train": [trained, {"type": "done"}], "read_out": [{**detected, "detections": found}, {"type": "done"}]}
    with answered(chromium, recording, answers) as page:
        page.set_viewport_size({"width": 1400, "height": 900})
        shows(page, "label-count", f"^{count} label")
        page.locator("#train").click()
        until(lambda: page.locator("#detection-list li").count() == 40, "what it detects is listed")
        panel, list_ = (page.locator(name).bounding_box() for name in ("#panel-labels", "#label-list"))
        low = panel["y"] + panel["height"]
        assert page.locator("#panel-labels").evaluate("e => e.scrollTop") == 0
        rows = [row.bounding_box() for row in page.locator("#label-list li").all()[:3]]
        assert max(row["y"] + row["height"] for row in rows) <= min(low, list_["y"] + list_["height"])
        scores = page.locator("#train-rows").bounding_box()
        assert scores["y"] + scores["height"] <= low
        assert page.locator("#train-rows tr").all_inner_texts() == [
            "contact\tneuron\t5\t0\t0\t4.5 ms",
            "rule\t5\t0\t0\t–",
        ]
    table.unlink()


def test_how_far_a_training_is_can_be_read_while_it_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    command, end = tmp_path / "python", tmp_path / "end"
    command.write_text(
        f"""#!{sys.executable}
import json, pathlib, sys, time
assert json.loads(sys.stdin.readline())["overwrite"]
for done in range(2):
    print(json.dumps({{"type": "progress", "step": f"fold {{done + 1}} of 5", "done": done, "of": 5}}), flush=True)
    time.sleep(0.6)
while not pathlib.Path({str(end)!r}).exists():
    time.sleep(0.02)
score = {{"found": 3, "missed": 1, "false": 0, "known_delay_ms": {{"median": 5.0}}}}
mistake = {{"recording": "walk", "source": "", "label": "contact", "t_us": 7, "missed": True}}
result = {{"labels": ["contact"], "score": {{"by_label": {{"contact": score}}}}, "plain_rule": None}}
result |= {{"mistakes": [mistake], "warnings": ["3 are alone"]}}
detects = "taxel detect RECORDING --readout a.json"
print(json.dumps({{"type": "result", "lines": ["held out: all found"], "result": result, "command": detects}}))
"""
    )
    command.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(command))
    handler = TrainingRequests(Opening(), ShownFiles())
    assert handler.progress() == ""
    printed: list[TrainedReadout] = []
    training = threading.Thread(target=lambda: printed.append(handler.train(tmp_path / "a.npz", tmp_path / "a.json")))
    training.start()
    until(lambda: re.fullmatch(r"fold 2 of 5, after \d+ s; about \d+ s in all", handler.progress()), "its estimate")
    end.touch()
    training.join()
    [trained] = printed
    assert trained.text.splitlines() == ["held out: all found", "warning: 3 are alone"]
    assert trained.next.startswith("taxel detect RECORDING --readout ")
    assert trained.judged_on == "held out: all found"
    assert trained.scores == [("contact", False, 3, 1, 0, 5.0)]
    assert trained.mistakes == [("contact", 7, True, "", "walk")]
    assert handler.progress() == ""


def test_detections_of_a_recording_are_in_order_and_the_time_stays_without_them(chromium: Any, recording: Path) -> None:
    readout = recording.with_name("walk.readout.json")
    readout.write_text("{}")
    times = [400_000, 2_000_000, 2_500_000, 9_000_000]
    found = [{"label": "contact", "t_us": t, "known_us": t} for t in times]
    message = {
        "type": "detections",
        "source": recording.name,
        "readout": readout.name,
        "labels": ["contact"],
        "encoders": [],
    }
    listing = {"type": "recordings", "folder": "", "files": [], "readouts": [readout.name]}
    answers = {"read_out": [{**message, "detections": found}, {"type": "done"}], "recordings": [listing]}
    with answered(chromium, recording, answers) as page:
        page.locator("#readout").select_option(readout.name)
        rows = page.locator("#detection-list .when")
        until(lambda: rows.all_inner_texts() == [f"{t / 1e6:.3f} s" for t in times], "as the labels are listed")
        rows.nth(1).click()
        until(lambda: clock(page) == 2, "its frame")
        page.locator("#readout").select_option("")
        shows(page, "detections-none", "^No detections in this recording")
        assert still(page) == 2
    readout.unlink()


def test_the_list_of_detections_says_which_readout_reads_and_of_which_sensor_each_is(
    chromium: Any, recording: Path
) -> None:
    readout = recording.with_name("walk.readout.json")
    readout.write_text("{}")
    found = [{"label": "contact", "t_us": 10**6, "known_us": 10**6, "source": "right"}]
    message = {
        "type": "detections",
        "source": recording.name,
        "readout": readout.name,
        "labels": ["contact"],
        "encoders": [],
    }
    listing = {"type": "recordings", "folder": "", "files": [], "readouts": [readout.name]}
    for answer, said in (
        ([], "^No detections yet: walk.readout.json is reading this recording"),
        ([{**message, "detections": []}, {"type": "done"}], "^walk.readout.json detected nothing"),
    ):
        with answered(chromium, recording, {"read_out": answer, "recordings": [listing]}) as page:
            page.locator("#readout").select_option(readout.name)
            shows(page, "detections-none", said)
    answers = {"read_out": [{**message, "detections": found}, {"type": "done"}], "recordings": [listing]}
    with answered(chromium, recording, answers) as page:
        page.locator("#readout").select_option(readout.name)
        row = page.locator("#detection-list li .what")
        until(lambda: row.all_inner_texts() == ["contact, right"], "the row names the sensor")
        mark = page.locator("#detection-marks span")
        until(
            lambda: mark.count() == 1 and mark.get_attribute("title") == "contact, right at 1.000 s", "so does the mark"
        )
    readout.unlink()


@pytest.mark.parametrize("count", [100, 101])
def test_where_not_all_detections_are_listed_it_is_said(count: int, chromium: Any, recording: Path) -> None:
    readout = recording.with_name("walk.readout.json")
    readout.write_text("{}")
    found = [{"label": "contact", "t_us": 50_000 * k, "known_us": 50_000 * k} for k in range(count)]
    message = {
        "type": "detections",
        "source": recording.name,
        "readout": readout.name,
        "labels": ["contact"],
        "encoders": [],
    }
    listing = {"type": "recordings", "folder": "", "files": [], "readouts": [readout.name]}
    answers = {"read_out": [{**message, "detections": found}, {"type": "done"}], "recordings": [listing]}
    with answered(chromium, recording, answers) as page:
        page.locator("#readout").select_option(readout.name)
        shows(page, "detection-count", "^100$" if count == 100 else "^101, 100 listed$")
        until(lambda: page.locator("#detection-list li").count() == 100, "the first of them")
    readout.unlink()


@pytest.mark.parametrize("order", [["contact", "lift"], ["lift", "contact"]])
def test_shapes_of_detections_follow_the_order_of_the_readout(order: list[str], chromium: Any, recording: Path) -> None:
    readout = recording.with_name("walk.readout.json")
    readout.write_text("{}")
    found = [{"label": order[k % 2], "t_us": 10**6 * (k + 1), "known_us": 10**6 * (k + 1)} for k in range(4)]
    message = {
        "type": "detections",
        "source": recording.name,
        "readout": readout.name,
        "labels": ["contact", "lift"],
        "encoders": [],
    }
    listing = {"type": "recordings", "folder": "", "files": [], "readouts": [readout.name]}
    answers = {"read_out": [{**message, "detections": found}, {"type": "done"}], "recordings": [listing]}
    with answered(chromium, recording, answers) as page:
        page.locator("#readout").select_option(readout.name)
        shows(page, "detection-count", "^4$")
        rows = page.locator("#detection-list li")
        until(lambda: rows.count() == 4, "they are listed")
        shapes = {row.locator(".what").inner_text(): row.locator(".shape").get_attribute("class") for row in rows.all()}
        assert shapes == {"contact": "shape shape-0", "lift": "shape shape-1"}
    readout.unlink()


@pytest.mark.parametrize("size", [(1400, 900), (1100, 800), (390, 844)])
@pytest.mark.parametrize("words", [3, 60])
def test_a_notice_covers_nothing(size: tuple[int, int], words: int, chromium: Any, recording: Path) -> None:
    labelled(recording)
    refused = {"type": "refused", "reason": "no such label " * words}
    with answered(chromium, recording, {"delete": [refused]}) as page:
        page.set_viewport_size({"width": size[0], "height": size[1]})
        page.locator("#label-list button").nth(1).click()
        shows(page, "notice-text", "^no such label")
        # On a phone the page scrolls below the header, in which it is.
        page.evaluate("scrollTo(0, 0)")
        covered = page.evaluate(
            """() => {
                const { left, right, top, bottom } = document.getElementById("notice").getBoundingClientRect();
                const hidden = [];
                const seen = document.querySelectorAll("header > *, canvas, button, input, select, #axis, h2, li");
                for (const one of seen) {
                    const box = one.getBoundingClientRect();
                    if (one.closest("#notice") || !one.offsetParent || !box.width) continue;
                    const beside = box.right <= left + 1 || box.left >= right - 1;
                    const apart = beside || box.bottom <= top + 1 || box.top >= bottom - 1;
                    const [x, y] = [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
                    const over = document.elementFromPoint(x, y);
                    if (!apart && (!over || over.closest("#notice"))) hidden.push(one.id || one.textContent);
                }
                return hidden;
            }"""
        )
        assert not covered
        assert page.locator("#notice").evaluate("e => getComputedStyle(e).position") == "static"
        assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    recording.with_suffix("").with_suffix(".notes.csv").unlink()


def test_without_a_board_the_tab_record_says_so(chromium: Any, recording: Path) -> None:
    with shown(chromium, recording) as page:
        press(page, "2")
        shows(page, "record-state", "^No board$")
        shows(page, "record-more", "^is connected: ")
        assert page.locator("#record-form").is_hidden(), "there is nothing to fill in"


def test_why_a_file_was_not_opened_is_said_once_with_its_name_and_fits_a_phone(chromium: Any, tmp_path: Path) -> None:
    name = f"{'long' * 20}.csv"
    (tmp_path / name).write_text("t_us,a,b\n0,1,2\n10000,x,1\n")
    with (
        running("view", name, "--no-open", folder=tmp_path) as server,
        opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"), width=390, height=844) as page,
    ):
        shows(page, "silence", rf"{name}.*line 3")
        assert page.locator("#notice").is_hidden()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_of_frames_there_are_no_maps_to_choose_from_and_no_counters_of_a_board(
    chromium: Any, recording: Path, tmp_path: Path
) -> None:
    frames = Frames(np.ones((40, 4, 4)), np.arange(40) * 20_000, unit="N", array=Array(4, 4))
    taxel.convert(frames, tmp_path / "mat.npz")
    for file, there in ((recording, True), (tmp_path / "mat.npz", False)):
        with shown(chromium, file) as page:
            press(page, "4")
            assert page.locator("#map-choice").is_visible() is there
            assert page.locator("#pressure-alone").is_visible() is there
            assert page.locator("#counters").is_hidden()


def test_the_views_never_scroll_sideways(chromium: Any, recording: Path) -> None:
    with shown(chromium, recording, width=1400, height=900) as page:
        assert page.locator("#views").evaluate("e => getComputedStyle(e).overflowX") == "hidden"


def test_what_lay_there_while_the_rest_was_taken_is_said_above_the_maps(chromium: Any, tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    values = 900 + random.normal(0, 2, (600, 8, 8))
    values[:300, 2:5, 4:7] += 200
    values[400:460, 1:4, 1:4] += 500
    frames = Frames(np.round(values), np.arange(600) * 10_000, unit="counts", array=Array(8, 8))
    where = of_frames(frames).preload_at
    assert where.startswith("rows 2 to 4, columns 4 to 6")
    taxel.convert(frames, tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz") as page:
        shows(
            page,
            "silence",
            "^Something pressed on the sensor while its rest was measured: rows 2 to 4, columns 4",
        )
        assert where in page.locator("#silence").inner_text()


def test_a_file_that_was_refused_does_not_stay_chosen(chromium: Any, recording: Path) -> None:
    broken = recording.with_name("broken.npz")
    broken.write_bytes(b"PK\x03\x04")
    with shown(chromium, recording) as page:
        page.locator("#files").select_option(broken.name)
        shows(page, "notice-text", "broken.npz: ")
        until(lambda: page.locator("#files").input_value() == recording.name, "the open recording is chosen again")
    broken.unlink()


def test_a_readout_that_was_refused_does_not_stay_chosen(chromium: Any, recording: Path) -> None:
    readout = recording.with_name("other.readout.json")
    readout.write_text("{}")
    listing = {"type": "recordings", "folder": "", "files": [], "readouts": [readout.name]}
    with answered(chromium, recording, {"recordings": [listing]}) as page:
        page.locator("#readout").select_option(readout.name)
        shows(page, "notice-text", "other.readout.json: ")
        until(lambda: page.locator("#readout").input_value() == "", "no readout is chosen")
    readout.unlink()


def test_another_recording_has_a_scale_of_its_own(chromium: Any, tmp_path: Path) -> None:
    y, x = np.mgrid[:8, :8]
    for name, most in (("large", 60_000.0), ("small", 80.0)):
        values = np.zeros((200, 8, 8), np.float32)
        values[60:150] = most * np.exp(-((x - 4) ** 2 + (y - 4) ** 2) / 6.0)
        taxel.convert(Frames(values, np.arange(200) * 10_000, unit="counts"), tmp_path / f"{name}.npz")
    with shown(chromium, tmp_path / "large.npz") as page:
        shows(page, "pressure-top", r"^[56]\d,?\d{3} counts$")
        page.locator("#files").select_option("small.npz")
        shows(page, "pressure-top", r"^\d\d(\.\d+)? counts$")


@pytest.mark.parametrize(("load", "rows", "columns"), [(60, (2, 4), (3, 6)), (15, (0, 2), (5, 7)), (0, (2, 4), (3, 6))])
def test_what_lay_there_is_said_of_events_in_the_same_words(
    load: int, rows: tuple[int, int], columns: tuple[int, int], chromium: Any, tmp_path: Path
) -> None:
    on = np.zeros((8, 8), bool)
    on[rows[0] : rows[1] + 1, columns[0] : columns[1] + 1] = True
    # It lies there for 2 s, is taken away, and something else touches at 4 s for half a second.
    stamps = [(0, np.full((8, 8), True), 50 + load * on), (2_000_000, on, 50 + 0 * on)]
    stamps += [(4_000_000 + 1000 * k, ~on, np.full((8, 8), 50 + 8 * min(k, 9))) for k in range(10)]
    stamps += [(4_500_000, ~on, np.full((8, 8), 50)), (6_500_000, np.full((8, 8), True), np.full((8, 8), 50))]
    t, y, x, ticks = (
        np.concatenate(parts)
        for parts in zip(
            *((np.full(of.sum(), at), *np.nonzero(of), values[of]) for at, of, values in stamps), strict=True
        )
    )
    events = taxel.Events(t, x, y, ticks > 50, intensity=ticks, array=Array(8, 8))
    taxel.convert(events, tmp_path / "mat.mcap")
    read = readings(taxel.open(tmp_path / "mat.mcap"))
    assert read is not None
    assert bool(read[1].preload_at) is bool(load)
    with shown(chromium, tmp_path / "mat.mcap") as page:
        if load:
            shows(page, "silence", r"^Something pressed on the sensor while its rest was measured: ")
            assert page.locator("#silence").inner_text().endswith(f"while its rest was measured: {read[1].preload_at}.")
        else:
            assert page.locator("#silence").is_hidden()
