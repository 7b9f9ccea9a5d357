"""A drift or a delay that cannot be is said to be wrong, with its likely cause; what can be is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from panel.protocol import Client, opened
from shell import run

from taxel.cli.board import counters_line, doubts
from taxel.clock import doubt
from taxel.live import Live
from taxel.panel import Panel

from .pauses import CAUSE, recorded


@pytest.mark.parametrize(
    ("drift_ppm", "delay_s", "said"),
    [
        (9_900.0, 0.0, None),
        (-10_100.0, 0.0, "a drift of "),
        # No fit takes such a drift, so the delays say it.
        (500_000.0, 0.0, "a median delay of -4.1 s "),
        (0.0, 1.2, "a delay of 1.1 s "),
    ],
)
def test_info_says_which_clocks_cannot_be(tmp_path: Path, drift_ppm: float, delay_s: float, said: str | None) -> None:
    file = recorded(tmp_path / "board.mcap", drift_ppm, delay_s)
    facts = json.loads(run("info", file, "--json").stdout)
    page = run("info", file).stdout
    with Panel(file) as panel, Client(panel) as client:
        pace = opened(client, file.name)["pace"]
    if abs(drift_ppm) < 20_000 and not delay_s:
        assert facts["drift_ppm"] == pytest.approx(drift_ppm, abs=5)
        assert pace["drift_ppm"] == pytest.approx(drift_ppm, rel=0.01, abs=5)
    cause = "ran faster than its own clock" if drift_ppm < 0 else CAUSE
    if said is None:
        assert (facts["clock_doubt"], cause in page, pace["doubt"]) == (None, False, None)
    else:
        assert said in facts["clock_doubt"]
        assert facts["clock_doubt"] in page
        assert cause in page
        assert cause in pace["doubt"]


@pytest.mark.parametrize(("drift_ppm", "wrong"), [(9_999.0, False), (-10_001.0, True), (-318_601.0, True)])
def test_live_says_it_too(drift_ppm: float, wrong: bool) -> None:
    with Live(0, host="127.0.0.1") as live:
        before = live.counters
    assert before["pace"] is None
    delay = {"count": 9, "p50_us": 41.0, "p99_us": 620.0, "max_us": 700.0}
    pace = {"drift_ppm": drift_ppm, "delay": delay, "doubt": doubt(drift_ppm, 620.0)}
    now = {**before, "seconds": before["seconds"] + 1, "pace": pace, "board_us": 500_000}
    assert counters_line(before, now).endswith(f"clock 0.50 s ({drift_ppm:+.1f} ppm{', wrong' * wrong})")
    assert list(doubts(now)) == ([pace["doubt"]] if wrong else [])
    assert list(doubts({**before, "sources": {"foot": now, "imu": {"lines": 3}}})) == (
        [f"foot: {pace['doubt']}"] if wrong else []
    )
