"""Drift and delays of a recording, as its arrivals show them, and said to be wrong where they cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.panel.protocol import Client
from tests.recording.pauses import CAUSE, recorded

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
