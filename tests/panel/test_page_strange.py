"""Control characters of names are escaped on the page: in its texts, and in what those hear who do not see them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest
import strange
from strange import CELL, NAME
from tests.panel.pages import press, shown, shows, still

import taxel

pytestmark = pytest.mark.timeout(600)

#: All texts of the page, and the attributes that are read to people.
TEXTS = """() => {
    const found = [];
    const walk = document.createTreeWalker(document.documentElement, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
    for (let node = walk.currentNode; node; node = walk.nextNode()) {
        if (node.nodeType === Node.TEXT_NODE) found.push(node.data);
        else for (const name of ["title", "aria-label", "label", "placeholder", "alt"])
            if (node.hasAttribute(name)) found.push(node.getAttribute(name));
    }
    return found;
}"""


def test_names_of_taxels_labels_notes_and_units_are_escaped(chromium: Any, tmp_path: Path) -> None:
    taxel.convert(strange.recording(), tmp_path / "press.mcap")
    table = tmp_path / "press.notes.csv"
    with table.open("w", newline="") as file:
        csv.writer(file).writerows([("label", "t_us"), (CELL, 700_000), (f"b{CELL}", 900_000)])
    neuron = (taxel.Neuron(tau=2.0), [0.5] * 12)
    levels = taxel.encode.LevelCrossing(levels=[50.0])
    readout = taxel.Readout(levels, {NAME: neuron}, array=strange.frames().array, unit=CELL)
    readout.save(tmp_path / f"{CELL}.json")
    with shown(chromium, tmp_path / "press.mcap") as page:
        shows(page, "source", "^press.mcap")
        still(page)
        for key in "12345":
            press(page, key)
            page.locator("[role=tab][aria-selected=true]").wait_for()
        texts = page.evaluate(TEXTS)
        # What a request is refused with.
        page.evaluate("text => import('/notice.js').then(({ failed }) => failed(new Error(text)))", f"{CELL}: refused")
        shows(page, "notice-text", "owned")
        texts += page.evaluate(TEXTS)
        press(page, "3")
        page.locator("#label-list .link").first.click()
        typed = page.locator("#chosen-name").input_value()
    owned = [text for text in texts if "owned" in text]
    assert len(owned) > 8, owned
    for text in texts:
        # The page's own file is indented by line breaks and blanks.
        assert not strange.CONTROL.search(text), text
        assert "\ntaxel: forged" not in text, text
    # What the page sends back is the name.
    assert typed == CELL
