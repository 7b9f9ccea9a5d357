"""The list of labels and the keys that set them: what is typed, refused and kept, in a real browser."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from tests.panel.pages import press, recording, replay, shows, still, until

__all__ = ["recording", "replay"]

pytestmark = pytest.mark.timeout(600)


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


def test_ctrl_z_takes_back_every_change_of_labels(replay: Any, table: Path) -> None:
    text = "label,t_us,comment\nheel,2000000,first\ntoe,3000000,second\n"
    labelled(replay, table, text)
    texts = [table.read_text()]

    def changed(what: str) -> None:
        until(lambda: table.read_text() != texts[-1], what)
        texts.append(table.read_text())

    name, at = replay.locator("#chosen-name"), replay.locator("#chosen-time")

    def choose(number: int, label: str) -> None:
        replay.locator("#label-list li").nth(number).locator(".link").click()
        until(lambda: name.input_value() == label, "it is in the form")

    choose(0, "heel")
    at.fill("2.5")
    at.press("Enter")
    changed("it is moved")
    name.fill("ball")
    name.press("Enter")
    changed("it is renamed")
    replay.locator("#label-list li").nth(1).get_by_role("button", name="delete toe").click()
    changed("it is deleted")
    press(replay, "Home", "m")
    changed("another is marked")
    # A label that is moved onto an equal one is one with it.
    replay.locator("#label-name").fill("ball")
    press(replay, "m")
    changed("an equal one is marked")
    choose(1, "ball")
    at.fill("2.5")
    at.press("Enter")
    changed("two are one")
    while len(texts) > 1:
        texts.pop()
        press(replay, "Control+z")
        wanted = sorted(texts[-1].splitlines())
        until(lambda wanted=wanted: sorted(table.read_text().splitlines()) == wanted, "the last change is taken back")
    press(replay, "Control+z")
    shows(replay, "notice-text", "^nothing to undo")
    # In a field it is the field's own.
    next_name = replay.locator("#label-name")
    next_name.fill("new")
    next_name.press("Control+z")
    assert sorted(table.read_text().splitlines()) == sorted(text.splitlines())
