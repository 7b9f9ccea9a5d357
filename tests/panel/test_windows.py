"""The window of columns beside the time shown, what a recording opens on, and readouts that a client chooses."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from discs import recipe, tare, touches
from loopback import until
from panel.protocol import EXTENT, SOON, Client, head, heard, say, section, word
from tests.tasks.recordings import rested

import taxel
from taxel.detect import Example, fit
from taxel.live import Live
from taxel.panel import Panel


@pytest.fixture
def steps(tmp_path):
    """Three touches of growing force on a taxel that rests at 40 ticks, half a second each, from 2, 5 and 8 s on."""
    t, ticks = [0], [40]
    for start, force in ((2, 30), (5, 60), (8, 90)):
        t += [start * 1_000_000, start * 1_000_000 + 500_000]
        ticks += [40 + force, 40]
    events = taxel.Events(
        np.array(t),
        0 * np.array(t) + 3,
        0 * np.array(t) + 2,
        np.array(ticks) > 40,
        intensity=ticks,
        array=taxel.Array(8, 8),
    )
    taxel.convert(events, tmp_path / "steps.mcap")
    return tmp_path / "steps.mcap"


def frame_at(page, t_us):
    """The next frame of this time."""
    while head(page.until("frame"))[0]["t_us"] != t_us:
        pass
    return page.frames[-1]


def near(force, of):
    """Whether a force is that of a touch of half a second, of which the tracked rest (20 s) may take its part."""
    return math.floor(of * math.exp(-0.5 / 20)) <= force <= of


def columns_of(frames):
    """Greatest sum of ticks above rest by column of time, from the last restart on."""
    sums = {}
    for frame in frames:
        about = head(frame)[0]
        if about["flags"] & 4:
            sums = {}
        one = section(frame, 3, EXTENT)["sum"][:, 1]
        sums |= {about["first"] + k: int(force) for k, force in enumerate(one)}
    return sums


@pytest.mark.parametrize("column_us", [1000, 64_000])
def test_the_window_ends_where_it_is_asked_to_and_the_time_moves_in_it(steps, column_us):
    with Panel(steps) as panel, Client(panel) as page:
        page.send(type="credit", n=2)
        page.ask("open", name="steps.mcap")
        page.ask("watch", taxel=[3, 2])
        end = 8_300_000
        assert page.ask("zoom", column_us=column_us, end_us=end)["type"] == "done"
        page.ask("seek", t_us=2_100_000)
        frame_at(page, 2_100_000)
        begin = len(page.frames)
        for t_us in (5_200_000, 400_000, 8_250_000):
            page.ask("seek", t_us=t_us)
            frame = frame_at(page, t_us)
            held = section(frame, 0, "<u2").reshape(8, 8)[2, 3]
            assert held == {5_200_000: 100, 400_000: 40, 8_250_000: 130}[t_us]
        assert not any(head(frame)[0]["flags"] & 4 for frame in page.frames[begin:]), "columns are sent once"
        sums = columns_of(page.frames)
        assert max(sums) == end // column_us
        assert min(sums) == max(0, end // column_us - 1249)
        for column, found in sums.items():
            begin, last = column * column_us, min((column + 1) * column_us - 1, end)
            inside = max(
                f * (begin < 1_000_000 * s + 500_000 and last >= 1_000_000 * s) for s, f in ((2, 30), (5, 60), (8, 90))
            )
            assert near(found, inside), (column, found, inside)
        for field, wrong in (("end_us", "soon"), ("column_us", 3000), ("column_us", 125 << 21)):
            assert page.ask("zoom", **{"column_us": column_us, field: wrong})["field"] == field


def test_a_view_that_plays_beyond_its_window_takes_it_along(steps):
    with Panel(steps) as panel, Client(panel) as page:
        page.send(type="credit", n=2)
        page.ask("open", name="steps.mcap")
        page.ask("zoom", column_us=1000, end_us=1_950_000)
        page.ask("seek", t_us=1_900_000)
        page.ask("play", speed=2.0)
        end = time.monotonic() + SOON
        while head(page.until("frame"))[0]["t_us"] < 2_300_000:
            assert time.monotonic() < end
        page.ask("pause")
        sums = columns_of(page.frames)
        assert [sums[column] for column in (1998, 2001, 2200)] == [0, 30, 30]


def test_a_readout_of_the_folder_reads_a_recording_and_the_board(tmp_path):
    readout = fit([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe())
    readout.save(tmp_path / "touch.json")
    rule = taxel.detect.PlainRule("area", 2, noise_floor=3.0)
    rule.save(tmp_path / "rule.json")
    (tmp_path / "other.json").write_text('{"format": "something else"}')
    events, _ = rested(11)
    taxel.convert(events, tmp_path / "played.mcap")
    with (
        Live(0, host="127.0.0.1", array=events.array) as live,
        Panel(live, folder=tmp_path) as panel,
        Client(panel) as page,
    ):
        assert page.until("recordings")["readouts"] == ["rule.json", "touch.json"]
        page.ask("open", name="played.mcap")
        assert page.ask("read_out", readout="none.json")["type"] == "refused"
        assert page.ask("read_out", readout="touch.json")["type"] == "done"
        answer = next(m for m in page.said if m["type"] == "detections")
        assert answer["labels"] == ["contact", "lift"]
        found = answer["detections"]
        assert [one["label"] for one in found] == ["contact", "lift"] * 6
        assert page.ask("train")["reason"].count("is a label")
        page.ask("live")
        address = live.address
        # The board: first something must be held that can be its rest.
        assert "no values of taxels have arrived" in page.ask("read_out", readout="touch.json")["reason"]
        say(live, *(word(4000, x, y, 50) for x in range(8) for y in range(8)))
        heard(live, 64)
        # Its rest is held a little later than the events are counted.
        until(lambda: page.ask("read_out", readout="touch.json")["type"] == "done")
        hello = page.since_asked("hello")
        assert hello["readout"] == ["contact", "lift"]
        assert panel.live is not live
        assert panel.live.address == address
