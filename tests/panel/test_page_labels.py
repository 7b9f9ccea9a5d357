"""The list of labels and the keys that set them: what is typed, refused and kept, in a real browser."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats.making import write_gaitpdb
from tests.panel.pages import clock, press, recording, replay, shown, shows, still, until

import taxel

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


def test_the_ends_of_a_cut_count_from_where_the_keys_before_them_lead(replay: Any, table: Path) -> None:
    still(replay)
    press(replay, "4")
    replay.evaluate(SLOW, ["seek"])
    press(replay, "Home", "[", "End", "]")
    until(lambda: clock(replay) > 9, "the end")
    shows(replay, "cut-from-time", r"^0\.2")
    shows(replay, "cut-to-time", r"^9\.2")


def test_two_marks_at_one_time_are_one_label(replay: Any, table: Path) -> None:
    labelled(replay, table, "label,t_us\nold,4000000\n")
    replay.locator("#label-name").fill("new")
    press(replay, "m", "m")
    shows(replay, "label-count", "^2 labels$")
    replay.locator("#label-name").fill("other")
    press(replay, "m")
    shows(replay, "label-count", "^3 labels$")
    assert sorted(row["label"] for row in rows(table)) == ["new", "old", "other"]


def test_what_is_typed_after_a_refusal_is_no_longer_marked_as_wrong(replay: Any, table: Path) -> None:
    labelled(replay, table, "label,t_us\nold,4000000\n")
    line = replay.locator("#label-list li").first
    for k, wrong, right, kept in ((1, "99", "3", "3.000"), (1, "", "2,25", "2.250"), (0, "", " heel ", "heel")):
        field = line.locator("input").nth(k)
        field.fill(wrong)
        field.press("Enter")
        until(lambda field=field: field.get_attribute("aria-invalid") == "true", "it is refused")
        assert replay.locator("#notice").is_visible()
        field.fill(right)
        field.press("Enter")
        until(lambda field=field: field.get_attribute("aria-invalid") is None, "it is taken")
        assert field.input_value() == kept
        assert replay.locator("#notice").is_hidden(), "the reason goes with what it is about"
    assert rows(table) == [{"label": "heel", "t_us": "2250000"}]
    # Escape brings back what the label holds now, not what it held when the list was written.
    field = line.locator("input").nth(1)
    field.fill("99")
    field.press("Enter")
    until(lambda: field.get_attribute("aria-invalid") == "true", "it is refused")
    field.press("Escape")
    assert (field.input_value(), field.get_attribute("aria-invalid")) == ("2.250", None)


def test_the_name_of_the_last_label_is_offered_until_another_is_typed(replay: Any, table: Path) -> None:
    name = replay.locator("#label-name")
    labelled(replay, table, "label,t_us\nrelease,4000000\npress,3000000\n")
    assert name.input_value() == "release"
    # The name that was typed last stays where a label of the file has it, and while labels are added.
    name.fill("press")
    replay.reload()
    shows(replay, "label-count", "^2 labels$")
    assert name.input_value() == "press"
    name.fill("slip")
    replay.locator("#label-list li").first.locator("button").last.click()
    shows(replay, "label-count", "^1 label$")
    assert name.input_value() == "slip"


def test_where_labels_will_be_saved_is_not_called_saved(replay: Any, table: Path) -> None:
    replay.reload()
    shows(replay, "label-place", r"^To be saved in walk\.notes\.csv$")
    assert not table.exists()
    still(replay)
    replay.locator("#label-name").fill("new")
    press(replay, "m")
    shows(replay, "label-place", r"^Saved in walk\.notes\.csv$")
    assert table.exists()


def feet(folder: Path) -> Path:
    """Write a recording of two feet with 34 labels of each in turn."""
    file = write_gaitpdb(folder)
    lines = [f"{('contact', 'foot_off')[k // 2 % 2]},{20_000 * k},{('left', 'right')[k % 2]}" for k in range(34)]
    (folder / f"{file.stem}.notes.csv").write_text("\n".join(["label,t_us,source", *lines]) + "\n")
    return file


def test_names_and_sources_of_labels_are_in_full(chromium: Any, tmp_path: Path) -> None:
    with shown(chromium, feet(tmp_path), width=1400, height=900) as page:
        shows(page, "label-count", "^34 labels$")
        names = page.locator("#label-list li input:first-child")
        assert names.evaluate_all("all => all.filter(e => e.scrollWidth > e.clientWidth).map(e => e.value)") == []
        assert len(set(names.evaluate_all("all => all.map(e => e.offsetWidth)"))) == 1
        assert page.locator("#label-list .source").all_inner_texts()[:2] == ["left", "right"]


def test_on_a_phone_detections_are_not_below_a_long_list_of_labels(chromium: Any, tmp_path: Path) -> None:
    with shown(chromium, feet(tmp_path), width=390, height=844) as page:
        shows(page, "label-count", "^34 labels$")
        list_, found = (page.locator(name).bounding_box() for name in ("#label-list", ".detections-block"))
        assert list_["height"] < 844 / 2
        assert found["y"] < list_["y"] + 844, "within a screen, notes between them"


def test_the_page_asks_before_it_closes_while_a_label_is_being_saved(replay: Any, table: Path) -> None:
    labelled(replay, table, "label,t_us\nold,4000000\n")
    replay.locator("#label-name").fill("new")
    asks = "() => !dispatchEvent(new Event('beforeunload', { cancelable: true }))"
    assert not replay.evaluate(asks)
    replay.evaluate(SLOW, ["mark"])
    press(replay, "m")
    until(lambda: replay.evaluate(asks), "it asks")
    shows(replay, "label-count", "^2 labels$")
    until(lambda: not replay.evaluate(asks), "it asks no more")


def test_notes_are_used_as_labels_by_one_request(chromium: Any, tmp_path: Path) -> None:
    frames = taxel.Frames(np.zeros((100, 4, 4)), np.arange(100) * 10_000, unit="N", array=taxel.Array(4, 4))
    (tmp_path / "own").mkdir()
    taxel.convert(frames, tmp_path / "own" / "mat.npz")
    noted = [f"{('heel', 'toe')[k % 2]},{20_000 * k}" for k in range(34)]
    (tmp_path / "own" / "mat.notes.csv").write_text("\n".join(["label,t_us", *noted]) + "\n")
    taxel.convert(taxel.open(tmp_path / "own" / "mat.npz"), tmp_path / "mat.mcap")
    with shown(chromium, tmp_path / "mat.mcap") as page:
        page.evaluate("""() => {
            window.sent = [];
            const send = WebSocket.prototype.send;
            WebSocket.prototype.send = function (text) {
                if (typeof text === "string" && JSON.parse(text).type.startsWith("mark")) window.sent.push(text);
                send.call(this, text);
            };
        }""")
        shows(page, "notes-as-labels", r"^Use as labels \(34\)$")
        page.locator("#notes-as-labels").click()
        shows(page, "label-count", "^34 labels$")
        assert len(page.evaluate("window.sent")) == 1
        assert page.locator("#notes-as-labels").is_hidden()
        # All of them are there after a reload, and one step takes all of them back.
        page.reload()
        shows(page, "label-count", "^34 labels$")


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


def test_a_thousand_notes_become_labels_all_or_none(chromium: Any, tmp_path: Path) -> None:
    frames = taxel.Frames(np.zeros((1100, 2, 2)), np.arange(1100) * 10_000, unit="N", array=taxel.Array(2, 2))
    (tmp_path / "own").mkdir()
    taxel.convert(frames, tmp_path / "own" / "mat.npz")
    noted = [f"{('heel', 'toe')[k % 2]},{10_000 * k}" for k in range(1000)]
    (tmp_path / "own" / "mat.notes.csv").write_text("\n".join(["label,t_us", *noted]) + "\n")
    taxel.convert(taxel.open(tmp_path / "own" / "mat.npz"), tmp_path / "mat.mcap")
    with shown(chromium, tmp_path / "mat.mcap") as page:
        shows(page, "notes-as-labels", r"^Use as labels \(1000\)$")
        # The page goes the moment after the press.
        page.evaluate("() => { document.getElementById('notes-as-labels').click(); location.reload(); }")
        shows(page, "state-word", "^Replay$")
        shows(page, "label-count", "^(0|1,000) labels$")
        if page.locator("#label-count").inner_text() == "0 labels":
            page.locator("#notes-as-labels").click()
        shows(page, "label-count", "^1,000 labels$")
        assert len(rows(tmp_path / "mat.notes.csv")) == 1000
        # A second's worth of flags would cover each other: their number stands there.
        counts = page.locator("#label-lane .count").all_inner_texts()
        assert sum(int(count.replace(",", "")) for count in counts) > 900
        assert page.locator(".flag").count() < 20
