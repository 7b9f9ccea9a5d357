"""The page on screens and for sensors of any shape: a phone, less motion, names of controls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import (
    FOLLOWS,
    live,
    opened,
    page,
    shows,
    until,
)

import taxel
import taxel.panel

__all__ = ["live", "page"]

pytestmark = pytest.mark.timeout(600)


@pytest.mark.parametrize(("rows", "columns"), [(200, 3), (3, 200), (1, 1)])
def test_a_sensor_of_any_shape_is_seen_and_pointed_at(chromium: Any, tmp_path: Path, rows: int, columns: int) -> None:
    array = taxel.Array(rows, columns, pitch_mm=2.67)
    with (
        taxel.live.Live(0, host="127.0.0.1", array=array) as board,
        taxel.panel.Panel(board, folder=tmp_path) as panel,
        opened(chromium, panel.url) as page,
    ):
        shows(page, "state-word", FOLLOWS)
        source = taxel.live.Source(array, 100.0, to="{}:{}".format(*board.address))
        for k in range(10):
            source.push(np.full((rows, columns), 100 + 10 * k))
        until(lambda: page.locator("#events").inner_text() != "–", "it is heard")
        # No registers are stated, and another sensor has another rate than a board at reset.
        shows(page, "frames", "^–$")

        def last_taxel_is_named() -> bool:
            # The map changes its size until all parts of the page are there.
            box = page.locator("#pressure-frame").bounding_box()
            assert 40 <= box["height"] <= 700
            assert box["width"] >= 40
            page.mouse.click(box["x"] + box["width"] - 2, box["y"] + box["height"] - 2)
            return f"row {rows - 1}, column {columns - 1} " in page.locator("#taxel-name").inner_text()

        until(last_taxel_is_named, "its last taxel is named")
        until(lambda: "ticks" in page.locator("#taxel-value").inner_text(), "its value")


def test_every_control_has_a_name_and_every_id_is_one(page: Any) -> None:
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, canvas[role], [role=application]")]
            .filter(e => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim()))
            .map(e => e.outerHTML.slice(0, 80))"""
    )
    assert nameless == []
