"""A plain rule live, by board and by command: what it detects is what it detects in the recording."""

import threading
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Frames, Tare
from taxel.detect import PlainRule, run
from taxel.live import Live

from .boards import LOOPBACK, SMALL, play, touches, wait_for

TARE = Tare.take(Frames(np.full((2, 4, 4), 20.0), [0, 1000], array=SMALL))


@pytest.mark.parametrize(
    "rule",
    [
        PlainRule("area", 2),
        PlainRule("total", 30, 0.5, 5, labels=("on", "off")),
        PlainRule("total", 40, age_ms=2, labels=("light", "heavy")),
    ],
    ids=repr,
)
def test_a_rule_detects_live_what_it_detects_in_the_recording(rule: PlainRule, tmp_path: Path) -> None:
    called: list[taxel.Detection] = []
    events = touches(6)
    options = {"array": SMALL, "readout": rule, "tare": TARE, "guard_frames": 1e6, "say": called.append}
    with Live(0, host=LOOPBACK, record=tmp_path / "rule.mcap", **options) as live:
        thread = threading.Thread(target=play, args=(events, live.address[1]), kwargs={"pace": 0.0005})
        thread.start()
        thread.join()
        wait_for(live, len(np.unique(events.t)))
    live.stop()
    recorded = taxel.open(tmp_path / "rule.mcap")
    again = run(rule, recorded, tare=TARE)
    assert recorded.registers is not None
    assert again == run(rule, events, frame_us=recorded.registers.frame_us, tare=TARE)
    assert len(again) == 6 * (2 if rule.age_ms is None else 1)
    for found in (taxel.Detections.from_list(called), recorded.detections):
        # Nothing moved the time on after the last event.
        assert len(found) >= len(again) - 2
        assert list(found.label) == list(again.label[: len(found)])
        np.testing.assert_array_equal(found.t, again.t[: len(found)])
        np.testing.assert_array_equal(found.known, again.known[: len(found)])
        assert np.isnan(found.slope).all()
