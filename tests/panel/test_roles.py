"""What a file of another program holds: seen, changed and written by the page, and by a client of its own."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats.strangers import FILES, TEXTS, written
from tests.formats.test_opens import outcome
from tests.panel.pages import is_in, opened, until
from tests.panel.protocol import Client

import taxel
from taxel import FormatError, ProblemError
from taxel._base.table_text import Text
from taxel.formats.layout import Layout, layout_name
from taxel.formats.line_form import form_of_lines
from taxel.formats.table_form import form_of
from taxel.live.stated_source import StatedSource
from taxel.panel import Panel
from taxel.panel.folder import Folder
from taxel.panel.look import Looks
from taxel.panel.shown_files import Opening

OPEN = "15 a position that rises"


def look(path: Path, said: dict[str, Any] | None = None, changes: dict[str, Any] | None = None) -> dict[str, Any]:
    layout = path.with_name(layout_name(path))
    at = Layout(layout) if said is None else Layout.of_text(layout, said["text"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Looks().look(path, at, changes or {})[0]


@pytest.mark.parametrize("name", [*TEXTS, *FILES])
def test_answers_open_a_strangers_file_and_no_offer_ends_in_a_foreign_error(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    try:
        said = look(path)
    except (FormatError, ProblemError):
        assert not str(outcome(path)).startswith("asked"), "what is asked is shown"
        return
    asked = str(outcome(path)).startswith("asked")
    assert asked == bool(said["questions"])
    for role in said["roles"][:6]:
        for changes in (*role["menu"].values(), *role["units"].values()):
            try:
                look(path, said, changes)
            except (FormatError, ProblemError):
                continue
    while said["questions"]:
        before = len(said["questions"])
        said = look(path, said, next(iter(said["questions"][0]["choices"].values())))
        assert len(said["questions"]) <= before
    if asked:
        path.with_name(layout_name(path)).write_text(said["text"], encoding="utf-8")
        assert not isinstance(outcome(path), str), said["text"]


def test_a_layout_is_written_over_another_only_if_asked(tmp_path: Path) -> None:
    path = written(OPEN, tmp_path)
    said = look(path)
    said = look(path, said, said["questions"][0]["choices"]["a taxel"])
    taxel.convert(taxel.Frames(np.zeros((9, 2, 2)), np.arange(9), unit="N"), tmp_path / "own.npz")
    with Panel(tmp_path) as panel, Client(panel) as page:
        assert page.ask("look", name=path.name)["type"] == "done"
        assert page.since_asked("look", name=path.name)["questions"]
        assert page.ask("lay", name=path.name, text=said["text"])["type"] == "done"
        there = path.with_name(layout_name(path)).read_bytes()
        assert page.ask("lay", name=path.name, text="rate_hz = 9\n")["field"] == "replace"
        assert path.with_name(layout_name(path)).read_bytes() == there
        assert page.ask("lay", name=path.name, text="rate_hz = 9\n", replace=True)["type"] == "done"
        assert path.with_name(layout_name(path)).read_text().strip() == "rate_hz = 9"
        for wrong in ({"text": "rate_hz ="}, {"text": "wheels = 4"}, {"name": "../a.csv"}, {"name": "own.npz"}):
            message = {"name": path.name, "text": "rate_hz = 1\n", "replace": True} | wrong
            assert page.ask("lay", **message)["type"] == "refused", wrong
        assert page.ask("look", name=path.name, changes={"__class__": 1})["type"] == "refused"
    assert sorted(each.name for each in tmp_path.iterdir()) == sorted([path.name, layout_name(path), "own.npz"])


@pytest.mark.parametrize(
    ("lines", "changes"),
    [
        ([f"{20 * k},{k % 7},{k % 5},{k % 9}" for k in range(60)], [{}]),
        ([f"{20 * k},{k % 7},{k % 5},{k % 9}" for k in range(60)], [{"time_column": 0, "left": [1]}]),
        ([f"{k % 7},{k % 5},{k % 9},1" for k in range(60)], [{"left": [4]}, {"rows": 3}]),
        (["", *["1,2,3", "4,5,6", ""] * 20], [{"rows": 3}, {"unit": "N", "falls": True}]),
        ([line for k in range(30) for line in (f"FRAME {k}", "1,2,3", f"4,5,{k % 9}")], [{}, {"rows": 2}]),
        ([line for k in range(30) for line in (f"at {20 * k} ms", "1 2", "3 4", f"4 {k % 9}", "")], [{"unit": "N"}]),
        ([f'{{"t": {20 * k}, "p": [1, {k % 9}], "battery": 3}}' for k in range(60)], [{"time_unit": "us"}]),
    ],
)
def test_a_live_source_reads_lines_as_they_were_looked_at(lines: list[str], changes: list[dict[str, Any]]) -> None:
    looks, name = Looks(), "serial:/dev/ttyACM0,baud=9600"
    looks.hear(name, lines)
    path, layout = looks.heard(name)  # type: ignore[misc]
    for change in [{}, *changes]:
        message, whole = looks.look(path, layout, change, name)
        layout = Layout.of_text(layout.path, message["text"])
    stated = StatedSource.of(looks.source(name, message["text"]))
    form, full = form_of(Text(path), whole)  # type: ignore[arg-type]
    size = None if stated.array is None else stated.array.taxels
    live = form_of_lines(lines, stated.printed, size, lambda *_: "")
    assert live is not None
    assert (live.taxels, live.clocks) == (form.taxels, form.clocks)
    keys = ("frame_end", "frame_begin", "frame_time")
    assert [getattr(live.table, key) for key in keys] == [getattr(form.table, key) for key in keys]
    assert (stated.printed.baud, stated.unit) == (9600, full.unit)
    assert (None if stated.array is None else stated.array.shape[0]) == (
        full.rows or (form.lines if form.lines > 1 else None)
    )


def test_a_strangers_file_is_not_looked_at_while_a_recording_runs(tmp_path: Path) -> None:
    path = written(OPEN, tmp_path)
    with pytest.raises(ProblemError, match=r"while a recording runs"):
        Folder(tmp_path, Opening(), lambda: True).look(path.name, None, {})


def test_an_open_role_is_chosen_on_the_page(chromium: Any, tmp_path: Path) -> None:
    path = written(OPEN, tmp_path)
    with Panel(path) as panel, opened(chromium, panel.url) as page:
        until(lambda: page.locator("#roles").is_visible(), "the dialog opens by itself")
        chosen = page.locator("#roles-rows tr.open select").first
        assert page.locator("#roles-open").is_disabled()
        chosen.select_option("taxel")
        until(lambda: page.locator("#roles-open").is_enabled(), "nothing is open")
        until(lambda: page.locator("#roles-seen figure").count() == 1, "the map is drawn")
        page.locator("#roles-open").press("Enter")
        until(lambda: page.locator("#roles").is_hidden(), "the layout is written")
        is_in(page, "replay")
        assert layout_name(path) in {each.name for each in tmp_path.iterdir()}
        # Of what is open the same is seen by a button.
        page.locator("#tab-view").click()
        page.locator("#roles-button").click()
        until(lambda: page.locator("#roles-rows tr").count() > 1, "the roles")
        page.locator("#roles-open").click()
        until(lambda: page.locator("#roles-replace").is_visible(), "the layout file is there")
        page.locator("#roles-replace").click()
        until(lambda: page.locator("#roles").is_hidden(), "it is replaced")
