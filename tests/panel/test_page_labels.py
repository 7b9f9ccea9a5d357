"""The list of labels and the keys that set them: what is typed, refused and kept, in a real browser."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import clock, press, recording, replay, shown, shows, still, until

import taxel
from taxel import Array, Frames

__all__ = ["recording", "replay"]

pytestmark = pytest.mark.timeout(600)

#: Waits in the page for each request of a kind, so that keys come before its answer.
SLOW = """kinds => {
    const send = WebSocket.prototype.send;
    WebSocket.prototype.send = function (text) {
        const slow = typeof text === "string" && kinds.includes(JSON.parse(text).type);
        slow ? setTimeout(() => send.call(this, text), 700) : send.call(this, text);
    };
}"""


def rows(table: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(table.open()))


@pytest.fixture
def table(recording: Path, replay: Any) -> Path:
    """The labels of the recording that is shown: none yet."""
    return unlabelled(recording)


def unlabelled(recording: Path) -> Path:
    """Return the table of a recording, without it."""
    path = recording.with_suffix(".notes.csv")
    path.unlink(missing_ok=True)
    return path


def labelled(page: Any, table: Path, text: str) -> None:
    """Show the recording with other labels."""
    table.write_text(text)
    page.reload()
    shows(page, "label-count", rf"^{len(rows(table))} label")
    still(page)


def test_a_key_that_follows_a_move_at_once_counts_from_where_it_leads(replay: Any, table: Path) -> None:
    for keys, reached in (("End", 9.2), ("End Home", 0.2), ("End ,", 9.2), ("End p", 4.0)):
        labelled(replay, table, "label,t_us\nold,4000000\n")
        replay.locator("#label-name").fill("new")
        replay.evaluate(SLOW, ["seek", "step"])
        press(replay, *keys.split(), "m")
        shows(replay, "label-count", "^2 labels$")
        (new,) = (int(row["t_us"]) / 1e6 for row in rows(table) if row["label"] == "new")
        assert new == pytest.approx(reached, abs=0.02)
        # It is the time that the page shows then.
        until(lambda new=new: clock(replay) == pytest.approx(new, abs=1e-4), "it is shown")


def test_ctrl_z_takes_back_every_change_of_labels(replay: Any, table: Path) -> None:
    text = "label,t_us,comment\nheel,2000000,first\ntoe,3000000,second\n"
    labelled(replay, table, text)
    texts = [table.read_text()]

    def changed(what: str) -> None:
        until(lambda: table.read_text() != texts[-1], what)
        texts.append(table.read_text())

    row = replay.locator("#label-list li").first.locator("input")
    row.nth(1).fill("2.5")
    row.nth(1).press("Enter")
    changed("it is moved")
    row.nth(0).fill("ball")
    row.nth(0).press("Enter")
    changed("it is renamed")
    replay.locator("#label-list li").nth(1).get_by_role("button", name="delete toe").click()
    changed("it is deleted")
    press(replay, "Home", "m")
    changed("another is marked")
    # A label that is moved onto an equal one is one with it.
    replay.locator("#label-name").fill("ball")
    press(replay, "m")
    changed("an equal one is marked")
    first = replay.locator("#label-list li").first.locator("input").nth(1)
    first.fill("2.5")
    first.press("Enter")
    changed("two are one")
    while len(texts) > 1:
        texts.pop()
        press(replay, "Control+z")
        wanted = sorted(texts[-1].splitlines())
        until(lambda wanted=wanted: sorted(table.read_text().splitlines()) == wanted, "the last change is taken back")
    press(replay, "Control+z")
    shows(replay, "notice-text", "^nothing to undo")
    # In a field it is the field's own.
    name = replay.locator("#label-name")
    name.fill("new")
    name.press("Control+z")
    assert sorted(table.read_text().splitlines()) == sorted(text.splitlines())


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
