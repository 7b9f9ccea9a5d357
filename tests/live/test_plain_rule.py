"""A plain rule live, by board and by command: what it detects is what it detects in the recording."""

import json
import threading
from pathlib import Path

import numpy as np
import pytest
from shell import call

import taxel
from taxel import Events, Frames, Tare
from taxel.detect import PlainRule, run
from taxel.live import Live

from .boards import LOOPBACK, SMALL, play, wait_for

TARE = Tare.take(Frames(np.full((2, 4, 4), 20.0), [0, 1000], array=SMALL))


def touches(count: int) -> Events:
    """Each 40 ms two taxels rise and fall again, one 400 us behind the other."""
    rows = []
    for press in range(count):
        for k in range(20):
            for x, behind in ((1, 0), (2, 400)):
                ticks = 20 + 3 * (k if k < 10 else 19 - k)
                rows.append((press * 40_000 + k * 200 + behind, x, 2, k < 10, ticks))
    t, x, y, p, ticks = zip(*sorted(rows), strict=True)
    return Events(t, x, y, p, array=SMALL, intensity=np.array(ticks))


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


def test_in_a_fresh_tare_nothing_is_detected_live_or_from_the_recording(tmp_path: Path, capsys) -> None:
    rule, events = PlainRule("area", 2), touches(6)
    rule.save(tmp_path / "rule.json")
    with Live(0, host=LOOPBACK, array=SMALL, readout=rule, tare=0.05, record=tmp_path / "rule.mcap") as live:
        play(events, live.address[1])
        wait_for(live, len(np.unique(events.t)))
    live.stop()
    detections = taxel.Detections.from_list(taxel.open(tmp_path / "rule.mcap").detections)
    asked = ("detect", tmp_path / "rule.mcap", "--readout", tmp_path / "rule.json", "--tare", 0.05, "--json")
    again = [one["t_us"] for one in json.loads(call(capsys, *asked)[1])["detections"]]
    assert len(again) == 8, "two of six touches lie in the tare"
    assert again[0] >= 50_000
    assert detections.t.tolist() == again[: len(detections)]
    assert len(detections) >= 6
