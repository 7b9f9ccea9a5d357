"""Drift and delays of a source on the page: as its arrivals show them, and said to be wrong where they cannot be."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.protocol import Client, say, word
from tests.recording.test_clock_doubt import CAUSE, recorded

import taxel
from taxel.panel import Panel

pytestmark = pytest.mark.timeout(600)


@pytest.mark.parametrize(
    ("drift_ppm", "delay_s", "doubted"),
    [(0.0, 0.0, None), (-150.0, 0.0, None), (9_900.0, 0.0, None), (12_000.0, 0.0, "drift"), (-318_601.0, 0.0, "drift"),
     (0.0, 0.9, None), (0.0, 1.2, "delay of 1.")],
)  # fmt: skip
def test_the_arrivals_of_a_recording_are_judged(
    tmp_path: Path, drift_ppm: float, delay_s: float, doubted: str | None
) -> None:
    file = recorded(tmp_path / "board.mcap", drift_ppm, delay_s)
    with Panel(file) as panel, Client(panel) as page:
        assert page.ask("open", name=file.name)["type"] == "done"
        pace = page.since_asked("opened", name=file.name)["pace"]
    clock = taxel.open(file).clock
    assert clock is not None
    if not delay_s:
        assert pace["drift_ppm"] == pytest.approx(drift_ppm, rel=0.01, abs=5)
    if doubted is None:
        assert pace["doubt"] is None
        if abs(drift_ppm) < 200 and not delay_s:
            # The delays of the first second are above a line of few datagrams.
            assert pace["delay"]["p50_us"] == pytest.approx(np.median(clock.delay_us), rel=0.2)
    else:
        assert doubted in pace["doubt"]
        assert CAUSE in pace["doubt"]


def test_a_board_that_lags_behind_its_own_clock_is_said_to_be_wrong_live(live: Any, panel: Any) -> None:
    with Client(panel) as page:
        assert page.until("counters")["pace"] is None
        # 28 s of the board's clock pass in six seconds and less: what comes too soon in the first ten may have waited.
        begun = time.monotonic()
        for k in range(5600):
            say(live, word(5_000 * k, 3, 4, 60 + k % 2))
            time.sleep(max(0.0, begun + k * 0.001 - time.monotonic()))
        while True:
            pace = page.until("counters")["pace"]
            if pace is not None and pace["doubt"] is not None:
                break
            assert time.monotonic() < begun + 60, pace
        found = re.match(r"a drift of (-\d+) ppm", pace["doubt"])
        assert found is not None, pace
        assert -900_000 < float(found[1]) < -100_000
        assert CAUSE in pace["doubt"]
