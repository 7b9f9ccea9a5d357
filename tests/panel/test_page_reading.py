"""What a recording does not say itself is chosen on the page and written beside it; what the page opens with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.formats import bags
from tests.formats.bags import PALM
from tests.panel.pages import clock, opened, press, shown, shows, span, until

import taxel
from taxel.live import Panel

pytestmark = pytest.mark.timeout(600)


def touched(touches: int, count: int) -> np.ndarray:
    """Return values of a mat of 6 x 6 taxels, 100 frames a second, on which something is pressed again and again."""
    values = 100 + np.random.default_rng(2).normal(0, 0.5, (count, 6, 6))
    for k in range(touches):
        begin = 500 + 150 * k
        values[begin : begin + 40, 1:4, 1:4] += 60
    return np.round(values)


def test_a_long_recording_opens_on_its_first_touches_with_all_of_it_below(chromium: Any, tmp_path: Path) -> None:
    frames = taxel.Frames(touched(20, 6000), np.arange(6000) * 10_000, unit="counts", array=taxel.Array(6, 6))
    taxel.convert(frames, tmp_path / "mat.npz")
    with shown(chromium, tmp_path / "mat.npz") as page:
        start, stop = span(page)
        assert stop - start == pytest.approx(10, abs=0.1)
        assert start < 5 < clock(page) < 5.5 < stop
        assert float(page.locator("#strip").get_attribute("aria-valuemax")) == pytest.approx(59.99, abs=0.02)
        press(page, "a")
        until(lambda: span(page)[1] - span(page)[0] > 59, "all of it")


def test_the_rate_of_an_array_is_stated_on_the_page(chromium: Any, tmp_path: Path) -> None:
    np.save(tmp_path / "mat.npy", touched(3, 1200))
    (tmp_path / "mat.layout.toml").write_text("# mine\nunit = 'counts'\n")
    with shown(chromium, tmp_path / "mat.npy") as page:
        shows(page, "clock", "^frame")
        press(page, "4")
        page.locator("#reading summary").click()
        page.locator("#rate").fill("100")
        page.get_by_role("button", name="Save and read again").click()
        shows(page, "clock", r"^5\.\d+ s$")
        assert (tmp_path / "mat.layout.toml").read_text() == "rate_hz = 100.0\n# mine\nunit = 'counts'\n"
        page.reload()
        shows(page, "clock", r"^5\.\d+ s$")


def test_the_topic_of_a_bag_is_chosen_on_the_page(chromium: Any, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    np.save(tmp_path / "first.npy", touched(1, 900))
    (tmp_path / "first.layout.toml").write_text("rate_hz = 100\nunit = 'counts'\n")
    values = touched(2, 900).repeat(4, 1)[:, :24].repeat(6, 2)[:, :, :32]
    messages = [("/hand/palm", PALM, 10.0 * k, 10.0 * k, bags.palm(one)) for k, one in enumerate(values)]
    bags.write(tmp_path / "hand.bag", messages)
    with Panel(tmp_path / "first.npy") as panel, opened(chromium, panel.url) as page:
        shows(page, "clock", "s$")
        page.locator("#files").select_option("hand.bag")
        until(lambda: page.locator("#reading-form").is_visible(), "what can be chosen")
        shows(page, "topic", "/hand/palm taxels")
        page.locator("#reading-rows").fill("24")
        page.locator("#reading-columns").fill("32")
        page.get_by_role("button", name="Save and read again").click()
        shows(page, "source", r"^hand\.bag · .*24 × 32")
        text = (tmp_path / "hand.layout.toml").read_text()
        assert "[ros]" in text
        assert 'topic = "/hand/palm"' in text
        # All that reads the bag knows it now.
        assert taxel.open(tmp_path / "hand.bag").array.shape == (24, 32)
