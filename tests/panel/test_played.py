"""A recording that is played, and the past of a board, reach a client whole; the oracle reads the events alone."""

import time

import numpy as np
import pytest
from loopback import until
from panel.protocol import EXTENT, SOON, Client, head, section
from tests.live.boards import LOOPBACK, SMALL, above_rest, force, play, presses, touch, wait_for

import taxel
from taxel.live import Live
from taxel.panel import Panel

ConnectionClosedOK = pytest.importorskip("websockets.exceptions").ConnectionClosedOK


def shown(frame, rest):
    """The values above rest, by a noise floor of 3 ticks, as docs and page have them."""
    values = section(frame, 0, "<u2").astype(int)
    above = np.where((values == 65_535) | (rest == 65_535), 0, values - rest)
    return np.where(above > 3, above, 0).reshape(SMALL.shape)


def test_a_recording_is_played_to_its_end(tmp_path):
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), record=tmp_path / "one.mcap") as live:
        wait_for(live, play(presses(20), live.address[1], pace=0.002))
        live.note("here")
    recording, sums, rest = taxel.open(tmp_path / "one.mcap"), {}, None
    with Panel(tmp_path / "one.mcap") as panel, Client(panel) as page:
        assert page.ask("open", name="one.mcap")["type"] == "done"
        opened = page.since_asked("opened", name="one.mcap")
        page.send(type="credit", n=2)
        assert page.ask("play", speed=5.0)["type"] == "done"
        while not page.frames or head(page.frames[-1])[0]["t_us"] < recording.events.t[-1]:
            page.next()
    for frame in page.frames:
        found = section(frame, 5, "<u2").astype(int)
        rest = found if len(found) else rest
        first = head(frame)[0]["first"]
        sums |= {(first + k) * 4000: one["sum"].tolist() for k, one in enumerate(section(frame, 3, EXTENT))}
    assert np.array_equal(shown(page.frames[-1], rest), above_rest(recording.events))
    times = np.array([t for t in sorted(sums) if t + 4000 <= recording.events.t[-1]])
    assert np.all(np.diff(times) == 4000)
    # A change is each 100 us at most; before the first one nothing is known.
    inside = [
        force(recording.events, np.arange(t + 1, t + 4001, 100)) for t in np.maximum(times, recording.events.t[0])
    ]
    assert [sums[t] for t in times] == [[min(each), max(each)] for each in inside]
    assert sorted(found["t_us"] for found in opened["detections"]) == sorted(d.t for d in recording.detections)
    assert [note["text"] for note in opened["notes"]] == ["here"]


def test_a_client_that_connects_later_is_told_the_detections_before_it_and_the_end():
    found, events = [], presses(5)
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=found.append) as live:
        panel = Panel(live)
        wait_for(live, play(events, live.address[1]))
        until(lambda: live.counters["detections"] == 5)
        with Client(panel) as page:
            page.send(type="credit", n=2)
            told = [page.until("detection")["t_us"] for _ in range(5)]
            assert told == [one.t for one in found]
            end, rest = time.monotonic() + SOON, None
            while rest is None or not np.array_equal(shown(page.frames[-1], rest), above_rest(events)):
                assert time.monotonic() < end
                values = section(page.until("frame"), 5, "<u2").astype(int)
                rest = values if len(values) else rest
            panel.stop()
            with pytest.raises(ConnectionClosedOK):
                list(iter(page.next, None))
