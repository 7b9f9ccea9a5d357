"""Recordings of the panel: made, labelled, shown again and cut."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from panel.protocol import (
    Client,
    head,
    heard,
    opened,
    say,
    section,
    word,
)

import taxel
import taxel.device
from taxel.live import Live, send
from taxel.panel import Panel


def test_a_recording_is_made_labelled_shown_and_cut(live, panel, tmp_path):  # noqa: PLR0915  one story
    playing = threading.Event()
    clock = {"t": 7_000_000}

    def play():
        # Later than one turn of the board's clock, so that a recording that starts now must determine the turn.
        while not playing.is_set():
            t = clock["t"] = clock["t"] + 1000
            send([word(t, t // 1000 % 64, 7, 40 + t // 1000 % 50)], *live.address, seconds=0.0005)
            time.sleep(0.001)

    board = threading.Thread(target=play)
    with Client(panel) as page:
        send([word(3_000_000, 9, 9, 77)], *live.address, seconds=0.0005)
        heard(live, 1)
        board.start()
        try:
            assert page.ask("record", name="step1", length_s=0.5, label="heel")["type"] == "done"
            assert page.ask("record", name="other")["type"] == "refused"
            last = page.since_asked("recorder", state="idle")
        finally:
            playing.set()
            board.join()
        assert last["last"]["file"] == "step1.mcap"
        again = page.ask("record", name="step1")
        assert again["type"] == "refused"
        assert "exists" in again["reason"]
        recording = taxel.open(tmp_path / "step1.mcap")
        assert recording.verdict.startswith("nothing lost")
        assert [(note.text, note.t) for note in recording.notes] == [("heel", None)]
        # Times are on the clock of the live board, not relative to the recording's first stamp.
        assert recording.events.t[0] > 6_553_600
        page.send(type="credit", n=2)
        assert page.ask("open", name="step1.mcap")["type"] == "done"
        opened = next(m for m in page.said if m["type"] == "opened")
        assert (opened["events"], opened["start_us"]) == (len(recording.events), recording.events.t[0])
        middle = int(recording.events.t[len(recording.events) // 2])
        assert page.ask("seek", t_us=middle)["type"] == "done"
        while head(page.until("frame"))[0]["t_us"] != middle:
            pass
        frame = section(page.frames[-1], 0, "<u2").reshape(64, 64)
        seen = recording.events.t <= middle
        for x in range(64):
            here = seen & (recording.events.x == x)
            if here.any():
                assert frame[7, x] == recording.events.intensity[here][-1]
        assert frame[9, 9] == 77, "what was held when it began"
        assert page.mark("contact", middle)["type"] == "done"
        (marked,) = page.labels()
        before = (tmp_path / "step1.mcap").read_bytes()
        assert page.alter(marked, label="lift")["type"] == "done"
        assert page.alter(page.labels()[0], t_us=middle + 5)["type"] == "done"
        assert (tmp_path / "step1.notes.csv").read_text() == f"label,t_us\nlift,{middle + 5}\n"
        assert (tmp_path / "step1.mcap").read_bytes() == before
        notes = taxel.open(tmp_path / "step1.mcap").notes
        assert [(n.text, n.t) for n in notes][1:] == [("lift", middle + 5)]
        assert page.ask("cut", start_us=opened["start_us"], stop_us=middle, name="half.mcap")["type"] == "done"
        assert len(taxel.open(tmp_path / "half.mcap").events) == int((recording.events.t < middle).sum())
        assert page.remove(page.labels()[0])["type"] == "done"
        assert page.ask("step", frames=-1)["type"] == "done"
        earlier = recording.events.t[recording.events.t < middle].max()
        assert next(m for m in reversed(page.said) if m["type"] == "transport")["t_us"] == earlier


def test_a_recording_of_the_panel_holds_all_sources_of_the_board(tmp_path):
    sources = {"imu": "given,columns=t_us:ax"}
    with (
        Live(0, host="127.0.0.1", record_later=True, sources=sources) as live,
        Panel(live, folder=tmp_path) as panel,
        Client(panel) as page,
    ):
        live.sample("imu", [1.0, 0.0])
        # It goes on when the page that began it is gone.
        with Client(panel) as gone:
            gone.ask("record", name="walk")
        page.until("recorder", state="recording")
        live.sample("imu", [2.0, 0.5])
        sent = send([bytes.fromhex("c000050304")], *live.address, seconds=0.01)["datagrams"]
        page.until("counters", events=sent)
        live.sample("imu", [3.0, 1.5])
        page.ask("stop")
        done = page.since_asked("recorder", state="idle")
        assert (done["error"], done["last"]["file"]) == (None, "walk.mcap")
    recording = taxel.open(tmp_path / "walk.mcap")
    assert len(recording.sources["board"].events) == sent
    assert recording.sources["imu"].frames().values.reshape(-1).tolist() == [0.5, 1.5]


def test_each_of_several_live_sensors_is_shown_to_who_chose_it(tmp_path):
    given = ["left=given,array=2x3,rate=50,unit=kPa", "right=given,array=4x2,rate=50,unit=N", "imu=given,columns=ax:ay"]
    with (
        Live(sources=given, record_later=True) as live,
        Panel(live, folder=tmp_path) as panel,
        Client(panel) as page,
        Client(panel) as other,
    ):
        assert other.until("hello")["sources"] == ["left", "right", "imu"]
        for name, rows, columns in (("right", 4, 2), ("imu", 1, 2), ("left", 2, 3)):
            assert page.ask("sensor", name=name)["type"] == "done"
            hello = page.since_asked("hello", sensor=name)
            assert (hello["array"]["rows"], hello["array"]["columns"]) == (rows, columns)
            values = np.arange(rows * columns) + 1.0
            live.sample(name, values)
            while not (about := page.until("hello", sensor=name)["frames"]):
                pass
            page.send(type="credit", n=1)
            page.until("counters", frames_per_s=0.0)
            step = about["step"]
            assert np.allclose((section(page.frames[-1], 0, "<u2") - about["zero"]) * step, values, atol=step)
            assert page.ask("zero", taxels=[[0, 0]])["type"] == ("done" if name == "left" else "refused")
        assert page.ask("sensor", name="none")["type"] == "refused"
        assert {message["sensor"] for message in other.said if message["type"] == "hello"} == {"left"}


def test_a_recording_alone_is_viewed_and_the_address_names_it(tmp_path):
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "two.mcap")
    with Panel(tmp_path / "two.mcap") as panel:
        assert panel.url.endswith("&open=two.mcap")
        with Client(panel) as page:
            hello = page.until("hello")
            assert (hello["live"], hello["open"]) == (False, "two.mcap")
            assert page.ask("open", name="two.mcap")["type"] == "done"
            assert page.ask("record", name="x")["type"] == "refused"
    with pytest.raises(FileNotFoundError):
        Panel(tmp_path / "none.mcap")


def test_a_taxel_is_zeroed_for_all_and_the_next_recording_begins_with_it(live, tmp_path):
    with Panel(live, folder=tmp_path) as panel, Client(panel) as page, Client(panel) as other:
        assert page.until("zeroed")["taxels"] == []
        page.send(type="credit", n=1)
        assert page.ask("zero", taxels=[[3, 5]])["type"] == "refused"
        say(live, word(4000, 3, 5, 48), word(5000, 3, 5, 90))
        heard(live, 2)
        for wrong in ([], [[3]], [[3, -1]], "all", [[3, 5], [4, 5]], [[64, 5]]):
            assert page.ask("zero", taxels=wrong)["type"] == "refused"
        assert page.ask("zero", taxels=[[3, 5]])["type"] == "done"
        for one in (page, other):
            # The message may have been sent before the command was answered.
            while not (all_told := [m for m in one.said if m["type"] == "zeroed" and m["taxels"]]):
                one.until("zeroed")
            (told,) = all_told[-1]["taxels"]
            assert (told["taxel"], told["rest"], told["before"]) == ([3, 5], 90.0, None)
        # The frame has its value, and the new rest, which a lower value did not change.
        say(live, word(6000, 3, 5, 80), word(7000, 3, 5, 95))
        heard(live, 4)
        page.send(type="credit", n=8)
        at = 5 * 64 + 3
        while not (rest := section(page.until("frame"), 5, "<u2")).size or rest[at] != 90:
            page.send(type="credit", n=1)
        while section(page.frames[-1], 0, "<u2")[at] != 95:
            page.until("frame")
        assert page.ask("record", name="after")["type"] == "done"
        page.since_asked("recorder", state="recording")
        say(live, word(8000, 3, 5, 99))
        heard(live, 5)
        assert page.ask("stop")["type"] == "done"
        page.since_asked("recorder", state="idle")
        (kept,) = taxel.open(tmp_path / "after.mcap").zeroings
        assert (kept.x, kept.y, kept.rest) == (3, 5, 90.0)
        assert page.ask("open", name="after.mcap")["type"] == "done"
        opened = next(m for m in reversed(page.said) if not isinstance(m, bytes) and m["type"] == "opened")
        assert [z["taxel"] for z in opened["zeroed"]] == [[3, 5]]


def labels_of(page):
    """What the page shows last, after all that was sent to it."""
    page.ask("seek", t_us=1500)
    return next(m for m in reversed(page.said) if m["type"] == "labels")["labels"]


def test_a_label_outside_the_recording_is_refused(tmp_path):
    """A late label of the last touch may lie a second behind the last event, one of frames on the last of them."""
    t = np.arange(2_000_000, 3_000_000, 1000)
    events = taxel.Events(t, t % 4, t % 3, t % 2 == 0, array=taxel.Array(4, 4))
    taxel.convert(events, tmp_path / "walk.mcap")
    frames = taxel.Frames(np.zeros((100, 4, 4)), np.arange(100) * 20_000, unit="N", array=taxel.Array(4, 4))
    taxel.convert(frames, tmp_path / "mat.npz")
    (tmp_path / "table.csv").write_text("\n".join(["1,2,3,4"] * 60) + "\n")
    (tmp_path / "table.layout.toml").write_text("rows = 2\ncolumns = 2\n")
    with Panel(tmp_path / "walk.mcap") as panel, Client(panel) as page:
        for name, first, last, late, far in (
            ("walk.mcap", 2_000_000, 2_999_000, 1_000_000, "1.000 s"),
            ("mat.npz", 0, 1_980_000, 20_000, "0.020 s"),
            ("table.csv", 0, 590_000, 10_000, "2 frames"),
        ):
            assert page.ask("open", name=name)["type"] == "done"
            assert page.mark("a", last + late)["type"] == "done"
            assert page.mark("a", first - late)["type"] == "done"
            more = 10_000 if name == "table.csv" else 1
            for t_us, side in ((last + late + more, "after the end"), (first - late - more, "before the beginning")):
                refused = page.mark("a", t_us)
                said = f"t_us: a label is {far} {side} of {name}: must be within the recording"
                assert (refused["field"], refused["reason"]) == ("t_us", said)
            mine = labels_of(page)[0]
            assert page.alter(mine, t_us=10**12)["type"] == "refused"
            assert page.alter(mine, label="b")["type"] == "done"


def test_events_look_the_same_from_any_file(tmp_path):
    random = np.random.default_rng(5)
    t = np.sort(random.integers(1, 3_000_000, 5000))
    x, y, p, ticks = random.integers(0, 8, 5000), random.integers(0, 6, 5000), t % 2 == 1, random.integers(40, 90, 5000)
    events = taxel.Events(t, x, y, p, intensity=ticks, array=taxel.Array(6, 8))
    files = {"events.mcap", "events.npz"}
    shown = {}
    for name in files:
        taxel.convert(events, tmp_path / name)
        with Panel(tmp_path / name) as panel, Client(panel) as page:
            page.send(type="credit", n=2)
            about = opened(page, name)
            assert (about["events"], about["start_us"], about["stop_us"]) == (5000, t[0], t[-1])
            for t_us in (2_500_000, 400_000):
                assert page.ask("seek", t_us=t_us)["type"] == "done"
                while head(page.until("frame"))[0]["t_us"] != t_us:
                    pass
                shown[name, t_us] = [section(page.frames[-1], k, "u1").tobytes() for k in (0, 1, 2, 3)]
                frame = section(page.frames[-1], 0, "<u2").reshape(6, 8)
                for row_of, column in np.ndindex(6, 8):
                    there = (t <= t_us) & (y == row_of) & (x == column)
                    assert frame[row_of, column] == ticks[there][-1]
            assert page.ask("health")["type"] == "done"
    for t_us in (2_500_000, 400_000):
        assert len({tuple(shown[name, t_us]) for name in files}) == 1
    assert {file.name for file in tmp_path.iterdir()} == files


def test_while_a_recording_runs_no_file_of_another_program_is_opened(live, panel, tmp_path):
    """Such a file may need all memory of the process that records."""
    events = taxel.Events([0, 1000], [1, 1], [2, 2], [True, False], array=live.array)
    for name in ("walk.mcap", "walk.lsa", "walk.csv", "walk.h5"):
        taxel.convert(events, tmp_path / name)
    with Client(panel) as page:
        opened(page, "walk.csv")
        assert page.ask("record", name="new")["type"] == "done"
        for name, answer in (("walk.mcap", "done"), ("walk.lsa", "done"), ("walk.h5", "refused")):
            told = page.ask("open", name=name)
            assert (told["type"], told.get("field")) == (answer, None if answer == "done" else "name"), name
        assert ".mcap and .lsa only" in told["reason"]
        assert page.ask("stop")["type"] == "done"
        page.since_asked("recorder", state="idle")
        assert page.ask("open", name="walk.h5")["type"] == "done"
