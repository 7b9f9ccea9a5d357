"""What the page of a long recording opens with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import clock, press, shown, span, until

import taxel

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
