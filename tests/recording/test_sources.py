"""Several sources in one recording: each a recording with its own clock, and one clock where it is asked for."""

import contextlib
import json
import os
import pty
import socket
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live.boards import LOOPBACK, SMALL, play
from loopback import until
from shell import run

import taxel
from taxel import _core
from taxel.clock import Clock
from taxel.live import Live
from taxel.simulate import Board


def presses(n: int, x: int) -> taxel.Events:
    """A taxel rises each 20 ms by one tick more."""
    t = np.arange(n) * 20_000
    return taxel.Events(t, np.full(n, x), np.full(n, 2), np.ones(n, bool), array=SMALL, intensity=np.arange(n) + 60)


def lines(live: Live, name: str) -> int:
    return int(live.counters["sources"][name]["lines"]["lines"])


def record_all(path: Path) -> dict[str, taxel.Events]:
    """Two boards, an IMU on a serial line and numbers that are given, into one file."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    sources = {
        "left": f"board:{LOOPBACK}:0,array=4x4",
        "imu": f"serial:{os.ttyname(theirs)},columns=t_ms:ax:ay",
        "given": "given,columns=force",
    }
    sent = {"right": presses(30, 1), "left": presses(20, 3)}
    with Live(0, host=LOOPBACK, array=SMALL, record=path, name="right", sources=sources) as live:
        play(sent["right"], live.address[1])
        play(sent["left"], live.source_address("left")[1])
        os.write(ours, b"".join(f"{10 * k}, {k / 8}, {-k}\r\n".encode() for k in range(50)) + b"nonsense\n")
        for k in range(5):
            live.sample("given", [k + 0.5], arrived_ns=1_700_000_000_000_000_000 + k * 1_000_000)
        until(lambda: lines(live, "imu") == 51)
        until(lambda: live.counters["sources"]["left"]["decoded"] == 20 and live.counters["decoded"] == 30)
        live.note("standing")
        summary = live.stop()
        counts, verdict = summary.counters["sources"], summary.verdict
    os.close(ours)
    os.close(theirs)
    none = {"bytes_in_no_line": 0, "bytes_of_unfinished_lines": 0, "trouble": None}
    unread = {"text": {"lines": 1, "first": "nonsense"}}
    assert counts["imu"]["lines"] == {"lines": 51, "strange": 1, "unread": unread, **none}
    assert counts["given"]["frames"] == 5
    assert verdict.parts["imu"].damaged == verdict.damaged == {"lines_that_could_not_be_read": 1}
    assert (verdict.status, verdict.parts["left"].status) == ("damaged", "complete after arrival")
    of_file = taxel.open(path).verdict
    assert (of_file.parts, of_file.status, of_file.damaged) == (verdict.parts, verdict.status, verdict.damaged)
    assert counts["left"]["events"] == 20
    return sent


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, taxel.Events]]:
    path = tmp_path_factory.mktemp("sources") / "all.mcap"
    return path, record_all(path)


def test_each_source_is_a_recording_that_holds_what_was_sent(several: tuple[Path, dict[str, taxel.Events]]) -> None:
    path, sent = several
    sources = taxel.open(path).sources
    assert list(sources) == ["right", "left", "imu", "given"]
    for name in ("right", "left"):
        events = sources[name].events
        np.testing.assert_array_equal(events.x, sent[name].x)
        np.testing.assert_array_equal(events.intensity, sent[name].intensity)
        np.testing.assert_array_equal(np.diff(events.t), np.diff(sent[name].t))
        assert (
            sources[name].verdict
            == "nothing lost after arrival (version 1 of the wire cannot show losses before arrival)"
        )
        assert len(taxel.encode.ChangeEvents().encode(events)) == 16
    imu = sources["imu"]
    assert not imu.has_events
    assert imu.columns == ["ax", "ay"]
    assert imu.counts["lines_that_could_not_be_read"] == 1
    assert "1 line that could not be read" in imu.verdict
    frames = imu.frames()
    np.testing.assert_array_equal(frames.t, np.arange(50) * 10_000)
    np.testing.assert_array_equal(frames.values[:, 0, 0], np.arange(50, dtype=np.float32) / 8)
    np.testing.assert_array_equal(frames.values[:, 0, 1], -np.arange(50, dtype=np.float32))
    given = sources["given"].frames()
    np.testing.assert_array_equal(given.t, 1_700_000_000_000_000 + np.arange(5) * 1000)
    np.testing.assert_array_equal(given.values.ravel(), np.arange(5) + 0.5)
    spikes = taxel.encode.LevelCrossing(np.arange(0.5, 7.0)).encode(frames)
    assert len(spikes[0]) > 0


def test_of_several_boards_none_is_the_files_own(several: tuple[Path, dict[str, taxel.Events]]) -> None:
    recording = taxel.open(several[0])
    assert repr(recording) == "Recording(all.mcap: 4 sources: right, left, imu, given)"
    for ask in (
        lambda: recording.events,
        recording.frames,
        lambda: recording.registers,
        lambda: recording.clock,
        recording.datagrams,
        lambda: taxel.encode.ChangeEvents().encode(recording.events),
        lambda: taxel.convert(recording, several[0].with_suffix(".npz")),
    ):
        with pytest.raises(
            taxel.ProblemError, match=r"contains 4 sources \(right, left, imu, given\); choose one with"
        ) as refused:
            ask()
        assert "\n" not in str(refused.value)
    with pytest.raises(taxel.ProblemError, match="call on_clock"):
        taxel.cut(recording, stop_us=5.0)
    assert [note.text for note in recording.notes] == ["standing"]
    assert not several[0].with_suffix(".npz").exists()


def test_of_one_board_and_numbers_the_files_own_is_the_board(tmp_path: Path) -> None:
    path, sent = tmp_path / "one.mcap", presses(10, 2)
    with Live(0, host=LOOPBACK, array=SMALL, record=path, sources={"imu": "given,columns=t_us:ax"}) as live:
        play(sent, live.address[1])
        live.sample("imu", [7.0, 1.0])
        until(lambda: live.counters["decoded"] == 10)
    recording = taxel.open(path)
    assert "beside imu" in repr(recording)
    assert recording.events == recording.sources["board"].events
    assert len(recording.frames(100)) == 19
    [lost] = taxel.convert(recording, tmp_path / "one.npz")
    assert "the source imu" in lost
    assert taxel.convert(recording, tmp_path / "one_again.mcap") == ["the source imu"]
    assert taxel.convert(recording.sources["imu"], tmp_path / "imu.mcap") == []
    alone = taxel.open(tmp_path / "imu.mcap")
    assert alone.frames() == recording.sources["imu"].frames()
    assert list(alone.sources) == ["imu"]
    (part,) = taxel.cut(recording, stop_us=90_000.0)
    assert len(part.events) == 5
    assert list(part.sources) == ["board"]
    assert part.lost == ("the source imu (it has another clock)", "raw datagrams")


def test_the_command_line_shows_and_writes_one_source(
    several: tuple[Path, dict[str, taxel.Events]], tmp_path: Path
) -> None:
    said = json.loads(run("info", several[0], "--json").stdout)["sources"]
    assert {name: one.get("events", one.get("frames")) for name, one in said.items()} == {
        "right": 30, "left": 20, "imu": 50, "given": 5,
    }  # fmt: skip
    assert said["imu"]["columns"] == ["ax", "ay"]
    assert abs(said["left"]["against"]["offset_us"]) < 60_000_000
    assert run("convert", several[0], tmp_path / "imu.csv", "--source", "imu").returncode == 0
    assert taxel.open(tmp_path / "imu.csv").frames().values.shape == (50, 1, 2)
    assert run("cut", several[0], tmp_path / "left.npz", "--source", "left", "--to", "0.1").returncode == 0
    refused = run("convert", several[0], tmp_path / "x.csv")
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"taxel: {several[0]}: contains 4 sources (right, left, imu, given)")
    unknown = run("cut", several[0], tmp_path / "x.npz", "--source", "up")
    assert unknown.stderr == f"taxel: --source up: {several[0]} contains only right, left, imu, given\n"


def test_a_source_needs_a_recording_that_can_hold_it_and_its_place(tmp_path: Path) -> None:
    with pytest.raises(taxel.ProblemError, match="source imu: taxel can only record this source"):
        Live(0, host=LOOPBACK, sources={"imu": "given,columns=a"})
    with pytest.raises(OSError, match="/no/such/line"):
        Live(0, host=LOOPBACK, record=tmp_path / "no.mcap", sources={"imu": "serial:/no/such/line,columns=a"})
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        where = f"board:{LOOPBACK}:{taken.getsockname()[1]}"
        with pytest.raises(OSError, match="Address already in use"):
            Live(0, host=LOOPBACK, record=tmp_path / "no.mcap", sources={"left": where})
    assert not list(tmp_path.iterdir())


def test_what_a_line_does_not_hold_is_counted_and_a_missing_value_too(tmp_path: Path) -> None:
    pipe = tmp_path / "imu"
    os.mkfifo(pipe)
    writer = os.open(pipe, os.O_RDWR)
    os.write(writer, b"t_us,ax,ay\n")
    sound = b"1000,1,2\n2000,nan,2\n3000,nan,NaN\n4000,-3e38,4\n4500,inf,5\n"
    strange = b"2500,-Infinity,1\n2500,1e400,1\n2500,1e39,1\n2500,1_0,1\n"
    no_time = b"5000000000000000,1,1\nnan,1,1\n-1e300,1,1\n"
    with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "imu.mcap", sources={"imu": f"lines:{pipe}"}) as live:
        os.write(writer, sound + strange + "2500,\u0663,1\n".encode() + no_time)
        until(lambda: lines(live, "imu") == 13)
    os.close(writer)
    imu = taxel.open(tmp_path / "imu.mcap").sources["imu"]
    np.testing.assert_array_equal(imu.frames().t, [1000, 2000, 3000, 4000, 4500])
    values = np.float32([[1, 2], [np.nan, 2], [np.nan, np.nan], [-3e38, 4], [np.nan, 5]])
    np.testing.assert_array_equal(imu.frames().values[:, 0], values)
    assert imu.verdict.damaged == {"lines_that_could_not_be_read": 8}
    assert imu.verdict.noted == {"missing_values": 4}
    assert "8 lines that could not be read; 4 missing values" in imu.verdict


@contextlib.contextmanager
def standard_input(file: Path) -> Iterator[None]:
    """Let a file be the standard input of this process."""
    before = os.dup(0)
    with file.open() as lines:
        os.dup2(lines.fileno(), 0)
    try:
        yield
    finally:
        os.dup2(before, 0)
        os.close(before)


def test_the_command_says_what_came_of_each_source_of_an_input_whose_last_line_lacks_its_end(tmp_path: Path) -> None:
    line = ("record", tmp_path / "two.mcap", "--port", 0, "--host", LOOPBACK, "--seconds", 1)
    # More lines than are read at once.
    (tmp_path / "lines").write_text("ax,ay\n" + "".join(f"{k},0.25\n" for k in range(900)) + "3,4.5")
    with standard_input(tmp_path / "lines"):
        done = run(*line, "--source", f"left=board:{LOOPBACK}:0", "--source", "imu=lines:-")
    assert "  left: 0 datagrams, 0 events\n" in done.stdout
    assert "  imu: 901 lines, 901 frames\n" in done.stdout
    frames = taxel.open(tmp_path / "two.mcap").sources["imu"].frames()
    assert frames.values[-2:, 0].tolist() == [[899, 0.25], [3, 4.5]]


def test_times_go_from_one_clock_to_the_other_and_nothing_else_moves(
    several: tuple[Path, dict[str, taxel.Events]],
) -> None:
    recording = taxel.open(several[0])
    plain, on_left = recording.sources, recording.on_clock("left").sources
    assert on_left["left"].events == plain["left"].events
    np.testing.assert_array_equal(on_left["right"].events.intensity, plain["right"].events.intensity)
    host = plain["right"].clock.host_ns(plain["right"].events.t)
    np.testing.assert_array_equal(on_left["right"].events.t, plain["left"].clock.board_us_at(host))
    assert recording.sources["right"].events == plain["right"].events, "what was opened stays as it was"
    cut = recording.on_clock("left").between(0, 100_000).sources
    assert len(cut["left"].events) == 5
    with pytest.raises(taxel.ProblemError, match="has no clock 'up'; must be one of right, left, imu, given, host"):
        recording.on_clock("up")
    with pytest.raises(taxel.ProblemError, match="is already on the clock of left"):
        recording.on_clock("left").on_clock("host")
    with pytest.raises(taxel.ProblemError, match=r"call on_clock\('left'\) before between"):
        plain["left"].between(0, 5).on_clock("left")
    note = recording.on_clock("host").notes[0]
    assert abs(note.t - note.at_ns / 1000) < 60_000_000


@pytest.mark.parametrize("seed", range(5))
def test_arrivals_of_a_busy_machine_put_two_boards_on_one_clock(seed: int) -> None:
    """Of two real processes at +50 and -30 ppm, 1 % of them 5 ms late: 40 us after 1 s, 20 us after 10 s."""
    random, kept = np.random.default_rng(seed), np.load(Path(__file__).parents[1] / "data/clock/arrivals.npz")
    off: dict[str, list[float]] = {}
    for name, ppm in {"board": 50.0, "left": -30.0}.items():
        own = np.cumsum(kept[f"{name}_step_us"].astype(np.int64))
        late = (kept[f"{name}_late"].astype(np.int64) - 100) * 100
        late += np.where(random.random(len(own)) < 0.01, 5_000_000, 0)
        truth = 1_700_000_000_000_000_000 + np.rint(own * 1000 / (1 + ppm * 1e-6)).astype(np.int64)
        for seconds in (1, 10):
            until_now = own <= seconds * 1_000_000
            clock = Clock(own[until_now], (truth + late)[until_now])
            back = clock.board_us_at(clock.host_ns(own[until_now]))
            assert np.abs(back - own[until_now]).max() <= 1
            off.setdefault(name, []).append((clock.host_ns(own[until_now][-1]) - truth[until_now][-1]) / 1e3)
    after_1_s, after_10_s = np.abs(np.subtract(off["board"], off["left"]))
    assert after_1_s < 40, off
    assert after_10_s < 20, off


def test_a_drift_is_not_stated_between_a_few_datagrams() -> None:
    board_us = 1000 * np.arange(10)
    few, enough = (Clock(board_us[:count], 5_000_000 + 1000 * board_us[:count]) for count in (3, 10))
    assert repr(few) == "Clock(3 datagrams, too few for a drift, delays 0 us median, 0 us 99 %)"
    assert "drift +" in repr(enough)


@pytest.mark.parametrize("knows", [True, False])
@pytest.mark.parametrize("intensity", ["difference", "value"])
def test_version_2_begun_in_mid_stream_says_what_the_whole_says(tmp_path: Path, intensity: Any, knows: bool) -> None:
    """With what the taxels held its events are the whole's; without, differences have no value until one is told."""
    draw, ticks = np.random.default_rng(3), np.full(16, 40)
    registers = taxel.wire.Registers(array=SMALL, wire_version=2)
    board, whole = Board(registers, SMALL, intensity=intensity), taxel.wire.Decoder(2, array=SMALL)
    heard, at = [], 40
    writer = _core.RecordingWriter(tmp_path / "mid.mcap", json.dumps({"array": SMALL._geometry()}), "none", True)
    for k in range(100):
        ticks[draw.integers(0, 16)] = draw.integers(0, 150)
        for datagram in board.frame(ticks.astype(np.uint16)):
            if k == at:
                held = np.where(whole.held < 0, 65_535, whole.held).astype(np.uint16).reshape(-1)
                if knows:
                    writer.held(1_700_000_000_000_000_000, None, held)
                at = -1
            events = whole.push(datagram)
            if at < 0:
                heard.append(events)
                writer.datagram(1_700_000_000_000_000_000 + 192_000 * k, k, datagram)
    writer.finish("{}")
    begun, right = taxel.open(tmp_path / "mid.mcap").events, sum(heard[1:], heard[0])
    assert right.present is None or right.present.all()
    if knows:
        assert begun == right
    else:
        told = begun.repaired if begun.repaired is not None else np.zeros(len(begun), bool)
        mine = begun[~told]
        np.testing.assert_array_equal(mine.t, right.t)
        assert mine.present.all() == (intensity == "value")
        np.testing.assert_array_equal(mine.intensity[mine.present], right.intensity[mine.present])
