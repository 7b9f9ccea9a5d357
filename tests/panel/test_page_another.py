"""Another recording is opened in the page: nothing of the one before stays, and a reload shows it again."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats.making import write_gaitpdb
from tests.panel.pages import press, shown, shows, still

import taxel
from taxel import Array, Frames

pytestmark = pytest.mark.timeout(600)

#: All that a person reads, but for the frames a second.
PARTS = "#source, #views, aside, footer, #notice:not([hidden])"


def folder_of_several(folder: Path) -> list[str]:
    """Write recordings of a mat, of another of its size, of channels, and of two feet."""
    for k, (name, size) in enumerate((("one", (8, 6)), ("other", (8, 6)), ("row", (1, 6)))):
        values = np.zeros((100, *size))
        values[20 + 10 * k : 40 + 10 * k, :, 1:4] = 50.0 + k
        frames = Frames(values, np.arange(100) * 10_000, unit="N", array=Array(*size, name=name))
        taxel.convert(frames, folder / f"{name}.npz")
    return ["one.npz", "other.npz", "row.npz", write_gaitpdb(folder).name]


def said(page: Any, name: str) -> str:
    """Return what the page says once it has shown a recording."""
    shows(page, "source", f"^{name}")
    still(page)
    page.wait_for_timeout(300)
    return "\n".join(page.locator(PARTS).all_inner_texts())


def test_another_recording_is_shown_as_by_a_page_that_opens_on_it(chromium: Any, tmp_path: Path) -> None:
    names = folder_of_several(tmp_path)
    anew = {}
    for name in names:
        with shown(chromium, tmp_path / name) as page:
            anew[name] = said(page, name)
    with shown(chromium, tmp_path / names[0]) as page:
        # Each kind comes after another one, and the first again.
        for before, name in itertools.pairwise([*names, names[1], names[0]]):
            press(page, "c", "ArrowRight", "End")
            page.locator("#label-name").fill("")
            page.locator("#mark").click()
            shows(page, "notice-text", "^type the label")
            page.locator("#label-name").fill("contact")
            page.locator("#files").select_option(name)
            assert said(page, name) == anew[name], f"{name} after {before}"
            # What is cut from it is named after it.
            stem, ending = name.rsplit(".", 1)
            assert page.locator("#cut-name").input_value() == f"{stem}-cut.{ending}"
