"""Windows of several servers that label the recordings of one folder at once, while a hand writes the tables."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from panel.protocol import Client, row

import taxel
from taxel.panel import Panel


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """A recording of ten seconds."""
    events = taxel.Events(np.array([0, 10**7]), [1, 1], [2, 2], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "walk.mcap")
    return tmp_path / "walk.mcap"


@pytest.fixture
def table(walk: Path) -> Path:
    return walk.with_suffix(".notes.csv")


def told(page: Client) -> list[tuple[str, int]]:
    return [(row["label"], row["t_us"]) for row in page.labels()]


def opened(page: Client, name: str = "walk.mcap") -> list[tuple[str, int]]:
    assert page.ask("open", name=name)["type"] == "done"
    return told(page)


def shown_by(page: Client, wanted: list[tuple[str, int]]) -> None:
    """Wait until a page shows these labels."""
    while told(page) != wanted:
        page.until("labels")


def held(table: Path) -> Counter:
    return Counter((row.text, row.t) for row in taxel.Labels(table).rows)


def test_the_tables_of_another_word_are_shown_and_changed(walk, table):
    steps = walk.with_suffix(".steps.csv")
    steps.write_text("t_us,label,found_us\n5,contact,4\n9,lift,9\n")
    with Panel(walk, labels="steps") as panel, Client(panel) as here:
        assert opened(here) == [("contact", 5), ("lift", 9)]
        here.remove(here.labels()[1])
        here.alter(here.labels()[0], t_us=6)
    assert steps.read_text() == "t_us,label,found_us\n6,contact,4\n"
    assert not table.exists()


def test_a_page_shows_what_another_window_and_a_hand_write_and_refuses_to_change_what_is_gone(walk, table):
    with Panel(walk) as one, Panel(walk) as other, Client(one) as here, Client(other) as there:
        opened(here)
        opened(there)

        assert here.mark("heel", 5)["type"] == "done"
        shown_by(there, [("heel", 5)])
        older = table.read_text()
        assert there.mark("toe", 7)["type"] == "done"
        shown_by(here, [("heel", 5), ("toe", 7)])
        # A program that saves an older table wins.
        editor = table.with_name("editor")
        editor.write_text(older + "hand,9\n")
        gone = here.labels()[1]
        os.replace(editor, table)
        for change in ({"new": {**gone, "t_us": 6}}, {"new": {**gone, "label": "ball"}}, {}):
            assert here.ask("change", changes=[{"old": gone, **change}])["type"] == "refused"
        for page in (here, there):
            shown_by(page, [("heel", 5), ("hand", 9)])
        assert here.ask("undo")["type"] == "done"
        assert there.ask("undo")["type"] == "refused"
        assert held(table) == {("hand", 9): 1}
        table.write_text("label,t_us\nheel,soon\n")
        assert here.until("warning")
        assert here.mark("toe", 7)["type"] == "refused"
        assert table.read_text() == "label,t_us\nheel,soon\n"
        table.unlink()
        shown_by(here, [])
        table.write_text("label,t_us\nhand,0\n")
        for page in (here, there):
            shown_by(page, [("hand", 0)])


def test_several_changes_are_one_request_that_is_done_or_not(walk, table):
    with Panel(walk) as panel, Client(panel) as page:
        opened(page)
        group = [{"new": row("heel", t, source="left", replaces_us=t)} for t in (10, 20, 30)]
        for wrong, field in (
            ([], "changes"),
            ([*group, 3], "changes"),
            ([{"new": {**row("heel", 5), "t_us": "soon"}}], "t_us"),
            ([*group, {"new": row("heel", 10**12)}], "t_us"),
            ([*group, {"new": row("", 5)}], "label"),
            ([*group, {"new": {"label": "toe"}}], "t_us"),
            ([{"old": row("toe", 7), "now": row("toe", 8)}], "now"),
            ([{"new": row("heel", t)} for t in range(5001)], "changes"),
        ):
            assert page.ask("change", changes=wrong)["field"] == field, wrong
        assert page.ask("change", changes=[*group, {"old": row("toe", 7)}])["type"] == "refused"
        assert not table.exists()
        assert page.ask("change", changes=[*group, {"new": row("toe", 15)}])["type"] == "done"
        assert table.read_text() == (
            "label,t_us,source,replaces_us\nheel,10,left,10\ntoe,15,,\nheel,20,left,20\nheel,30,left,30\n"
        )
        assert page.ask("change", changes=[{"new": row(f"{t}", t)} for t in range(500)])["type"] == "done"
        for k in range(20):
            page.send(type="change", id=1000 + k, changes=[{"new": row("ball", k)}])
        assert {page.until("done")["id"] for _ in range(20)} == set(range(1000, 1020))
        assert held(table).total() == 524
        assert page.ask("undo")["type"] == "done"
        assert held(table).total() == 523


@pytest.mark.parametrize("kind", ["pipe", "link that leads nowhere", "folder"])
def test_labels_are_in_regular_files_alone_and_nobody_waits_for_another(walk, table, kind):
    elsewhere = walk.with_name("elsewhere")
    if kind == "pipe":
        os.mkfifo(table)
    elif kind == "folder":
        table.mkdir()
    else:
        table.symlink_to(elsewhere)
    with Panel(walk) as panel, Client(panel) as page, Client(panel) as other:
        for client in (page, other):
            assert opened(client) == []
            assert "no regular file" in client.since_asked("warning")["text"]
            assert client.mark("heel", 5)["type"] == "refused"
    assert not elsewhere.exists()
