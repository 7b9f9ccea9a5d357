"""The list of labels and the keys that set them: what is typed, refused and kept, in a real browser."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
from tests.panel.pages import clock, press, recording, replay, shows, still, until

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


def test_the_times_of_the_host_stay_with_labels_that_nobody_moves(replay: Any, table: Path) -> None:
    kept = [
        (f"{label},{t}", 10**18 + t) for label, t in (("contact", 2_000_000), ("lift", 3_000_000), ("toe", 4_000_000))
    ]
    labelled(replay, table, "label,t_us,host_ns\n" + "".join(f"{row},{ns}\n" for row, ns in kept))
    time = replay.locator("#label-list li").nth(1).locator("input").nth(1)
    time.fill("3.5")
    time.press("Enter")
    moved = {"contact": ("2000000", str(kept[0][1])), "lift": ("3500000", ""), "toe": ("4000000", str(kept[2][1]))}
    until(
        lambda: {row["label"]: (row["t_us"], row.get("host_ns")) for row in rows(table)} == moved, "the others keep it"
    )
    name = replay.locator("#label-list li").nth(0).locator("input").first
    name.fill("heel")
    name.press("Enter")
    until(lambda: rows(table)[0] == {"label": "heel", "t_us": "2000000", "host_ns": str(kept[0][1])}, "a new name too")


@pytest.mark.parametrize(
    ("keys", "reached"),
    [(("End", "m"), 9.2), (("End", "Home", "m"), 0.2), (("End", ",", "m"), 9.2), (("End", "p", "m"), 4.0)],
)
def test_a_key_that_follows_a_move_at_once_counts_from_where_it_leads(
    keys: tuple[str, ...], reached: float, replay: Any, table: Path
) -> None:
    labelled(replay, table, "label,t_us\nold,4000000\n")
    replay.locator("#label-name").fill("new")
    replay.evaluate(SLOW, ["seek", "step"])
    press(replay, *keys)
    shows(replay, "label-count", "^2 labels$")
    (new,) = (int(row["t_us"]) / 1e6 for row in rows(table) if row["label"] == "new")
    assert new == pytest.approx(reached, abs=0.02)
    # It is the time that the page shows then.
    until(lambda: clock(replay) == pytest.approx(new, abs=1e-4), "it is shown")


def test_a_label_after_a_step_is_at_the_stamp_that_it_leads_to(replay: Any, table: Path) -> None:
    labelled(replay, table, "label,t_us\nold,4000000\n")
    press(replay, "Home")
    before = still(replay)
    replay.locator("#label-name").fill("new")
    replay.evaluate(SLOW, ["step"])
    press(replay, ".", "m")
    shows(replay, "label-count", "^2 labels$")
    after = still(replay)
    assert after > before
    assert [row["t_us"] for row in rows(table) if row["label"] == "new"] == [str(round(after * 1e6))]


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
