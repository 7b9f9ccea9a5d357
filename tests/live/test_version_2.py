"""A board of version 2, heard live and read again: nothing lost, and said so."""

import taxel
from taxel.simulate import Scene, Silence, emulate, play


def test_a_recording_of_version_2_says_that_nothing_was_lost(tmp_path):
    acts = [Silence(80.0), Scene.draw(seed=3)]
    with taxel.live.Live(0, host="127.0.0.1", record=tmp_path / "two.mcap") as live:
        report = emulate("{}:{}".format(*live.address), acts, seed=1, tare_ms=20.0, wire=2)
        summary = live.stop()
    assert summary.counters["wire_version"] == 2
    assert summary.counters["wire"]["bytes"] == 0
    assert summary.counters["wire_v2"]["missing"] == 0
    assert summary.verdict == "nothing lost"
    recording = taxel.open(tmp_path / "two.mcap")
    events = recording.events
    repaired = summary.counters["wire_v2"]["repaired"]
    assert len(events) == report.changes + repaired
    one = play(acts, seed=1, tare_ms=20.0).events
    # Version 1 tells the same changes, its times cut to 100 us.
    assert len(one) == report.changes
    assert [start for _, start in events.markers] == [True, False]
