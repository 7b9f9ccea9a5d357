"""What the page says of a training, of detections and of what cannot be shown, in a real browser."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import clock, recording, shown, shows, still, until

import taxel
from taxel import Array, Frames
from taxel.panel import Panel
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
