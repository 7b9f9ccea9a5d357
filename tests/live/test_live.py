"""What comes over the network is recorded and read out, and nothing is lost uncounted."""

import contextlib
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Array, Detection, DeviceError, Events, Neuron, ProblemError, Readout, wire
from taxel.encode import ChangeEvents, ContactArea
from taxel.live import Live, heard, send
from taxel.simulate import Board, Scene, emulate
from taxel.wire import Registers

LOOPBACK = "127.0.0.1"
SMALL = Array(4, 4, pitch_mm=2.0, name="small")


def presses(presses: int) -> Events:
    """Each 40 ms a taxel rises by 40 ticks in 2 ms and falls again."""
    t, ticks, p = [], [], []
    for press in range(presses):
        for k in range(20):
            t.append(press * 40_000 + k * 200 // 100 * 100)
            ticks.append(60 + 4 * (k if k < 10 else 20 - k))
            p.append(k < 10)
    n = len(t)
    return Events(t, np.full(n, 1), np.full(n, 2), p, array=SMALL, intensity=np.array(ticks))


def datagrams(events: Events) -> list[bytes]:
    return [wire.encode(events[events.t == t]) for t in np.unique(events.t)]


def touch() -> Readout:
    weights = np.where(np.arange(32) < 16, 0.5, 0.0)
    return Readout(ChangeEvents(), {"touch": (Neuron(tau=2.0, refractory=15.0), weights)})


def play(events: Events, port: int, *, pace: float = 0.0) -> int:
    """Send a datagram a stamp; return how many."""
    sent = datagrams(events)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        for one in sent:
            link.sendto(one, (LOOPBACK, port))
            if pace:
                time.sleep(pace)
    return len(sent)


def wait_for(live: Live, decoded: int) -> None:
    until = time.monotonic() + 30
    while live.counters["decoded"] < decoded:
        assert time.monotonic() < until, live.counters
        time.sleep(0.002)


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "taxel", *map(str, arguments)]


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind((LOOPBACK, 0))
        return int(link.getsockname()[1])


def listening(process: subprocess.Popen[str]) -> None:
    """Wait until a command says that it listens."""
    assert process.stderr is not None
    for line in process.stderr:
        if "listening" in line:
            return
    raise AssertionError("ended before it listened")


@pytest.mark.parametrize("segment", [False, True])
@pytest.mark.parametrize("gro", [False, True])
def test_the_sums_close_with_the_senders_own_count(segment: bool, gro: bool) -> None:
    with Live(0, host=LOOPBACK, gro=gro) as live:
        sent = send(
            [bytes.fromhex("c00005030 4".replace(" ", "")) * 280] * 7,
            *live.address,
            each=7,
            seconds=0.1,
            segment=segment,
        )
    counters = live.stop().counters
    capture, words = counters["capture"], counters["wire"]
    whole_trains = capture["gro"] and sent["segmenting"]
    assert capture["messages"] + capture["dropped_by_kernel"] == sent["messages" if whole_trains else "datagrams"]
    assert capture["datagrams"] == counters["decoded"] + capture["dropped_by_queue"]
    assert words["bytes"] == 5 * words["words"] + words["skipped"]
    assert capture["dropped_by_kernel"] or words["bytes"] == sent["bytes"]


def test_what_is_recorded_is_what_was_sent(tmp_path: Path) -> None:
    events = presses(5)
    for name in ("walk.mcap", "walk.lsa"):
        with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / name) as live:
            wait_for(live, play(events, live.address[1])) if name.endswith("mcap") else play(events, live.address[1])
        assert live.stop().lost == 0
    assert taxel.open(tmp_path / "walk.mcap").events == events
    assert (tmp_path / "walk.lsa").read_bytes() == wire.encode(events)
    assert (tmp_path / "walk.lss").exists()


def test_detections_come_live_and_are_those_of_the_recording(tmp_path: Path) -> None:
    called: list[Detection] = []
    # A machine that stalls makes datagrams late: here the host's clock moves nothing on.
    options = {"array": SMALL, "readout": touch(), "guard_frames": 1e6, "say": called.append}
    with Live(0, host=LOOPBACK, record=tmp_path / "said.mcap", **options) as live:
        thread = threading.Thread(target=play, args=(presses(6), live.address[1]), kwargs={"pace": 0.001})
        thread.start()
        iterated = []
        for said in live:
            iterated.append(said)
            if len(iterated) == 5:
                break
        thread.join()
        wait_for(live, len(datagrams(presses(6))))
    live.stop()
    recorded = taxel.open(tmp_path / "said.mcap")
    again = taxel.detect.run(touch(), recorded)
    assert len(again) == 6
    for found in (heard(called), recorded.detections):
        assert list(found.label) == ["touch"] * len(found)
        assert len(found) >= 5
        np.testing.assert_array_equal(found.t, again.t[: len(found)])
        np.testing.assert_array_equal(found.known, again.known[: len(found)])
    assert iterated == called[:5]
    assert heard(called).said is not None


def test_in_silence_what_is_owed_is_said() -> None:
    events = presses(1)
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch()) as live:
        play(events[:4], live.address[1])
        said = live.next(30)
    assert said is not None
    assert said.t > events.t[3]


def test_what_a_thread_keeps_for_itself_lasts_from_one_call_to_the_next() -> None:
    own, calls = threading.local(), []

    def count(said: Detection) -> None:
        own.calls = getattr(own, "calls", 0) + 1
        calls.append((threading.get_ident(), own.calls))

    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), guard_frames=1e6, say=count) as live:
        play(presses(6), live.address[1])
        for _ in zip(range(4), live, strict=False):
            pass
    each = {thread: [k for t, k in calls if t == thread] for thread, _ in calls}
    assert all(numbers == list(range(1, len(numbers) + 1)) for numbers in each.values()), calls
    assert max(len(numbers) for numbers in each.values()) > 1


def test_what_the_callers_function_raises_is_raised() -> None:
    def refuse(said: Detection) -> None:
        raise LookupError(f"nothing to do with {said.label}")

    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=refuse) as live:
        play(presses(2), live.address[1])
        with pytest.raises(LookupError, match="nothing to do with touch"):
            list(live)
        assert list(live) == [], "it has ended"


def test_a_tare_is_taken_and_can_be_kept() -> None:
    rest = Events(
        np.arange(64) * 1000,
        np.tile(np.arange(4), 16),
        np.repeat(np.tile(np.arange(4), 4), 4),
        np.ones(64, bool),
        array=SMALL,
        intensity=np.full(64, 40),
    )
    readout = Readout(ContactArea(), {"contact": (Neuron(tau=0.5), np.ones(10))})
    with Live(0, host=LOOPBACK, array=SMALL, readout=readout, tare=0.05) as live:
        assert live.tare is None
        wait_for(live, play(rest, live.address[1]))
        until = time.monotonic() + 30
        while live.tare is None:
            assert time.monotonic() < until
            time.sleep(0.01)
        tare = live.tare
    np.testing.assert_array_equal(tare.rest, np.full((4, 4), 40.0))
    assert (tare.start_us, tare.stop_us) == (0, 50_000)


def test_a_readout_that_needs_a_tare_and_has_none_is_refused() -> None:
    readout = Readout(ContactArea(), {"contact": (Neuron(), np.ones(10))})
    with pytest.raises(ProblemError, match="tare"):
        Live(0, host=LOOPBACK, readout=readout)


def test_the_picture_shows_what_the_taxels_hold() -> None:
    with Live(0, host=LOOPBACK, array=SMALL) as live:
        play(presses(1), live.address[1])
        until = time.monotonic() + 30
        while live.picture[2, 1] == 0:
            assert time.monotonic() < until
            time.sleep(0.01)
        assert np.count_nonzero(live.picture) == 1


def test_notes_and_markers_are_kept(tmp_path: Path) -> None:
    marked = Events([], [], [], [], array=SMALL, markers=[(1000, True), (5000, False)])
    with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "noted.mcap") as live:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.sendto(wire.encode(marked), live.address)
        wait_for(live, 1)
        assert live.take_markers() == [(1000, True), (5000, False)]
        assert live.take_markers() == []
        live.note("the left foot")
    recorded = taxel.open(tmp_path / "noted.mcap")
    assert [note.text for note in recorded.notes] == ["the left foot"]
    assert recorded.events.markers == marked.markers


def test_a_live_that_ended_says_its_summary_again_and_refuses_the_rest() -> None:
    live = Live(0, host=LOOPBACK)
    summary = live.stop()
    assert live.stop() is summary
    assert live.counters is summary.counters
    with pytest.raises(ProblemError, match="has been stopped"):
        live.note("too late")
    assert live.next(1.0) is None
    assert list(live) == []


@pytest.mark.parametrize(
    ("argument", "value", "kind", "said"),
    [
        ("port", 70_000, ProblemError, "port is 70000: must be a whole number from 0 to 65535"),
        ("host", "no such host", ProblemError, 'host is "no such host"'),
        ("host", 3, ProblemError, "host is 3: must be a text"),
        ("array", "64x64", ProblemError, "array is '64x64': must be a taxel.Array"),
        ("registers", "fast", ProblemError, 'preset "fast"'),
        ("registers", 4, ProblemError, "registers is 4"),
        ("differences", 1, ProblemError, "differences is 1: must be True or False"),
        ("readout", "r.json", ProblemError, "readout is 'r.json': must be a taxel.Readout"),
        ("tare", 1.0, ProblemError, "tare without a readout"),
        ("record", 3, ProblemError, "record is 3: must be a path"),
        ("record", "a.txt", ProblemError, "a.txt: a recording is named .mcap"),
        ("guard_frames", -1, ProblemError, "guard_frames is -1: must be 0 or more"),
        ("guard_frames", float("nan"), ProblemError, "guard_frames is nan"),
        ("say", 3, ProblemError, "say is 3"),
        ("lines", "yes", ProblemError, "lines is 'yes'"),
        ("queue_bytes", 10, ProblemError, "queue_bytes is 10: must be 65536 or more"),
        ("readout_events", 0, ProblemError, "readout_events is 0"),
        ("kernel_buffer_bytes", -5, ProblemError, "kernel_buffer_bytes is -5"),
        ("gro", 2, ProblemError, "gro is 2"),
    ],
)
def test_nonsense_is_refused_by_name(argument: str, value: object, kind: type[Exception], said: str) -> None:
    with pytest.raises(kind) as refused:
        Live(**{"port": 0, "host": LOOPBACK, argument: value})  # type: ignore[arg-type]
    assert said in str(refused.value)


def test_registers_that_break_a_rule_for_the_array_are_refused() -> None:
    with pytest.raises(DeviceError):
        Live(0, host=LOOPBACK, array=Array(64, 32), registers=wire.Registers.preset("5.2 kHz"))


@pytest.mark.parametrize(("rows", "columns"), [(300, 300), (300, 200), (65_535, 2)])
def test_an_array_that_no_board_can_name_is_refused(rows: int, columns: int) -> None:
    """65 536 positions are all, rows counted up to a power of 2."""
    with pytest.raises(ProblemError, match=f"{rows} x {columns} taxels: has more than 65536 positions"):
        Live(0, host=LOOPBACK, array=Array(rows, columns))


@pytest.mark.parametrize(("rows", "columns"), [(1, 65_535), (256, 256), (65_535, 1)])
def test_the_largest_arrays_that_a_board_can_name_are_heard(rows: int, columns: int) -> None:
    with Live(0, host=LOOPBACK, array=Array(rows, columns)) as live:
        pass
    assert live.stop().lost == 0


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"datagrams": []}, "one datagram or more"),
        ({"each": 0}, "each is 0"),
        ({"period_us": -1.0}, "period_us is -1"),
        ({"seconds": float("inf")}, "seconds is inf"),
        ({"port": 0}, "port is 0"),
    ],
)
def test_nonsense_is_not_sent(arguments: dict[str, object], said: str) -> None:
    with pytest.raises(ProblemError) as refused:
        send(**{"datagrams": [b"x"], "port": 9, **arguments})  # type: ignore[arg-type]
    assert said in str(refused.value)


def test_ctrl_c_ends_a_wait_for_detections() -> None:
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch()) as live:
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            live.next(60)


def test_taxel_record_keeps_what_comes_until_ctrl_c_and_gives_a_verdict(tmp_path: Path) -> None:
    port, file, events = free_port(), tmp_path / "walk.mcap", presses(3)
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--array", "4x4")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        play(events, port)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert said.splitlines()[-1].startswith("nothing lost after arrival")
    np.testing.assert_array_equal(taxel.open(file).events.to_numpy(), events.to_numpy())
    again = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert again.returncode == 2
    said = f"taxel: {file}: exists already; say --overwrite, or name another"
    assert again.stderr.strip().splitlines() == [said]


def test_taxel_record_says_how_much_a_board_of_version_2_sent(tmp_path: Path) -> None:
    port = free_port()
    arguments = command("record", tmp_path / "two.mcap", "--host", LOOPBACK, "--port", port, "--markers")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        report = emulate(f"{LOOPBACK}:{port}", [Scene.draw(seed=3)], seed=1, tare_ms=20.0, wire=2)
        said, _ = process.communicate(timeout=60)
    counted, verdict = said.splitlines()
    assert f"{report.datagrams} datagrams, {report.bytes} bytes, " in counted
    assert counted.endswith(" 2 markers")
    assert verdict == "nothing lost"


def test_taxel_record_ends_with_the_boards_stop_marker(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "marked.mcap"
    marked = Events([], [], [], [], array=SMALL, markers=[(1000, True), (5000, False)])
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--markers", "--seconds", 60, "--json")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            while process.poll() is None:
                link.sendto(wire.encode(marked), (LOOPBACK, port))
                time.sleep(0.05)
        said, _ = process.communicate(timeout=60)
    summary = json.loads(said)
    assert process.returncode == 0
    assert summary["counters"]["markers"] >= 2
    assert summary["path"] == str(file)


def test_taxel_record_goes_on_by_itself_in_automatic_mode(tmp_path: Path) -> None:
    port = free_port()
    automatic = ["--length", 0.3, "--countdown", 0, "--start-index", 7, "--trials", 2]
    arguments = command("record", tmp_path / "step.lsa", "--host", LOOPBACK, "--port", port, *automatic)
    with (
        subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        while process.poll() is None:
            link.sendto(wire.encode(presses(1)), (LOOPBACK, port))
            time.sleep(0.01)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["step7.lsa", "step7.lss", "step8.lsa", "step8.lss"]
    assert said.count("nothing lost after arrival") == 2
    again = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert (again.returncode, again.stderr.strip()) == (
        2,
        f"taxel: {tmp_path / 'step7.lsa'}: exists already; say --overwrite, or name another",
    )


def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    with Live(0, host=LOOPBACK) as holder:
        port = holder.address[1]
        with pytest.raises(OSError, match="in use"):
            Live(port, host=LOOPBACK)
        arguments = command("record", tmp_path / "a.mcap", "--host", LOOPBACK, "--port", port)
        done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (3, f"taxel: UDP {LOOPBACK}:{port}: address already in use\n")
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a disk that is always full")
@pytest.mark.parametrize("name", ["full.mcap", "full.lsa"])
def test_a_full_disk_is_one_clear_error(tmp_path: Path, name: str) -> None:
    (tmp_path / name).symlink_to("/dev/full")

    def record() -> None:
        with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / name, overwrite=True) as live:
            play(presses(300), live.address[1])
            list(live)

    with pytest.raises(OSError, match="No space left on device"):
        record()


@pytest.mark.parametrize("differences", [False, True])
def test_taxel_live_writes_a_line_of_json_a_detection(tmp_path: Path, differences: bool) -> None:
    port, events = free_port(), presses(5)
    if differences:
        moved = np.diff(events.intensity.astype(int), prepend=0)
        said = Events(events.t, events.x, events.y, moved >= 0, array=SMALL, intensity=np.abs(moved))
    else:
        said = events
    touch().save(tmp_path / "touch.json")
    files = ["--readout", tmp_path / "touch.json", "--record", tmp_path / "live.mcap"]
    arguments = command("live", *files, "--host", LOOPBACK, "--port", port, "--array", "4x4", "--json")
    # The datagrams do not keep the board's time: here the host's clock moves nothing on.
    arguments += ["--guard-frames", "1e6", *(["--differences"] if differences else [])]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        while not (tmp_path / "live.mcap").exists():
            assert process.poll() is None
            time.sleep(0.02)
        play(said, port)
        assert process.stdout is not None
        lines = [json.loads(process.stdout.readline()) for _ in range(4)]
        process.send_signal(signal.SIGINT)
        lines += [json.loads(line) for line in process.stdout]
    assert process.returncode == 0
    keys = {"label", "t_us", "known_us", "slope_mv_per_ms", "repaired"}
    assert [set(line) for line in lines] == [keys | {"said_us", "said_ns"}] * 5
    heard_again = ("detect", tmp_path / "live.mcap", "--readout", tmp_path / "touch.json", "--json")
    again = subprocess.run(command(*heard_again), capture_output=True, text=True, check=True)
    detected = json.loads(again.stdout)["detections"]
    assert detected == [{key: line[key] for key in keys} for line in lines], "one schema"
    recorded = taxel.open(tmp_path / "live.mcap")
    np.testing.assert_array_equal([line["t_us"] for line in lines], recorded.detections.t)
    np.testing.assert_array_equal(recorded.events.intensity, events.intensity)


def test_taxel_live_prints_a_line_a_detection_where_nobody_watches(tmp_path: Path) -> None:
    port = free_port()
    touch().save(tmp_path / "touch.json")
    arguments = command("live", "--readout", tmp_path / "touch.json", "--host", LOOPBACK, "--port", port)
    arguments += ["--array", "4x4", "--guard-frames", "1e6"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        play(presses(6), port)
        assert process.stdout is not None
        # The guard lets each press be told by the next one; the last one is told at the end, where it had come by then.
        lines = [process.stdout.readline() for _ in range(5)]
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read().splitlines()
    assert process.returncode == 0
    told = re.compile(r" +\d+\.\d{4} s  touch +said -?\d+\.\d\d ms after it was known")
    assert all(told.match(line) for line in lines), lines
    last = [line for line in rest if told.match(line)]
    assert rest[len(last)].startswith(f"{5 + len(last)} detections, "), rest


def test_taxel_live_says_which_taxels_its_tare_does_not_know(tmp_path: Path) -> None:
    """Begun in the middle of a stream, it hears of the taxels that change and of no others."""
    port = free_port()
    Readout(ContactArea(), {"contact": (Neuron(tau=0.5), np.ones(10))}).save(tmp_path / "touch.json")
    arguments = command("live", "--readout", tmp_path / "touch.json", "--host", LOOPBACK, "--port", port)
    arguments += ["--array", "4x4", "--tare", 0.05, "--seconds", 60]
    with subprocess.Popen(
        list(map(str, arguments)), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True
    ) as process:
        listening(process)
        play(presses(5), port)
        assert process.stderr is not None
        said = next(line for line in process.stderr if "the tare knows" in line)
        process.send_signal(signal.SIGINT)
        process.stderr.read()
    assert said.startswith("taxel: the tare knows 1 of 16 taxels")


def test_taxel_live_refuses_a_tare_that_nobody_keeps(tmp_path: Path) -> None:
    touch().save(tmp_path / "touch.json")
    arguments = command("live", "--readout", tmp_path / "touch.json", "--save-tare", tmp_path / "tare.json")
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "taxel: --save-tare without a fresh tare: give --tare SECONDS\n"


@pytest.mark.parametrize("kind", ["mcap", "lsa"])
def test_a_recording_to_which_nothing_came_is_not_kept(tmp_path: Path, kind: str) -> None:
    port, file = free_port(), tmp_path / f"walk.{kind}"
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--seconds", 0.2)
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert done.stdout.startswith(f"nothing arrived at UDP {LOOPBACK}:{port} in 0.")
    assert "nothing lost" not in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["mcap", "lsa"])
def test_an_earlier_recording_stays_where_nothing_came_to_replace_it(tmp_path: Path, kind: str) -> None:
    file = tmp_path / f"walk.{kind}"
    with Live(0, host=LOOPBACK, array=SMALL, record=file) as live:
        wait_for(live, play(presses(2), live.address[1]))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with Live(0, host=LOOPBACK, array=SMALL, record=file, overwrite=True) as live:
        pass
    summary = live.stop()
    assert summary.nothing_came
    assert summary.path is None
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    with Live(0, host=LOOPBACK, array=SMALL, record=file, overwrite=True) as live:
        wait_for(live, play(presses(1), live.address[1]))
    assert live.stop().path == file
    assert len(taxel.open(file, array=SMALL).events if kind == "lsa" else taxel.open(file).events) == len(presses(1))


def test_stop_from_several_threads_gives_each_the_same_summary() -> None:
    for _ in range(10):
        live = Live(0, host=LOOPBACK, array=SMALL)
        wait_for(live, play(presses(1), live.address[1]))
        ends: list[object] = []
        begin = threading.Barrier(4)

        def stop(live: Live = live, ends: list[object] = ends, begin: threading.Barrier = begin) -> None:
            begin.wait()
            try:
                ends.append(live.stop())
            except Exception as error:
                ends.append(error)

        threads = [threading.Thread(target=stop) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert ends == [live.stop()] * 4


def test_stop_from_within_say_is_one_error() -> None:
    def say(_: Detection) -> None:
        live.stop()

    live = Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=say)
    play(presses(2), live.address[1])
    with pytest.raises(ProblemError, match="`stop` was called by its own `say`"):
        for _ in live:
            pass
    with contextlib.suppress(ProblemError):
        live.stop()


def recording(file: Path, port: int, *more: object) -> subprocess.Popen[str]:
    """Begin ``taxel record``."""
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--array", "4x4", *more)
    return subprocess.Popen(
        arguments, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("kind", ["mcap", "lsa"])
@pytest.mark.parametrize("later", [False, True])
def test_a_second_recorder_does_not_take_the_file_of_a_running_one(tmp_path: Path, kind: str, later: bool) -> None:
    port, file = free_port(), tmp_path / f"walk.{kind}"
    if later:
        # The first replaces a file, and has not begun to: nothing has come.
        file.write_bytes(b"an earlier one")
    with recording(file, port, "--overwrite") as first:
        listening(first)
        if not later:
            play(presses(2), port)
            wait_until(lambda: file.stat().st_size > 0)
        done = subprocess.run(
            command("record", file, "--host", LOOPBACK, "--port", free_port(), "--overwrite", "--seconds", 0.1),
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        said = "is being recorded by another program; end that first, or name another file"
        assert (done.returncode, done.stderr) == (3, f"taxel: {file}: {said}\n")
        play(presses(2), port)
        time.sleep(0.3)
        first.send_signal(signal.SIGINT)
        out, _ = first.communicate(timeout=60)
    assert first.returncode == 0, out
    recorded = taxel.open(file, array=SMALL) if kind == "lsa" else taxel.open(file)
    assert len(recorded.events) == (2 - later) * len(presses(2))


def wait_until(done: Callable[[], bool]) -> None:
    until = time.monotonic() + 30
    while not done():
        assert time.monotonic() < until
        time.sleep(0.005)


def test_a_lock_dies_with_its_process(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    with recording(file, port) as first:
        listening(first)
        play(presses(2), port)
        first.kill()
    with Live(0, host=LOOPBACK, array=SMALL, record=file, overwrite=True) as live:
        wait_for(live, play(presses(1), live.address[1]))
    assert len(taxel.open(file).events) == len(presses(1))


@pytest.mark.parametrize("kind", ["mcap", "lsa"])
@pytest.mark.parametrize("what", ["removed", "renamed", "replaced", "folder"])
def test_a_recording_whose_file_is_gone_at_its_end_is_said_to_be_lost(tmp_path: Path, kind: str, what: str) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    file = folder / f"walk.{kind}"
    live = Live(0, host=LOOPBACK, array=SMALL, record=file)
    sent = play(presses(2), live.address[1])
    wait_for(live, sent)
    if what == "removed":
        file.unlink()
    elif what == "renamed":
        file.rename(folder / "other")
    elif what == "replaced":
        (folder / "other").write_text("of another program")
        (folder / "other").rename(file)
    else:
        shutil.rmtree(folder)
    lost = f"{sent} datagrams and lines" if kind == "mcap" else f"{10 * len(presses(2))} bytes"
    with pytest.raises(OSError, match=f"was removed, renamed or replaced while it was recorded; LOST: {lost}"):
        live.stop()
    if what == "replaced":
        assert file.read_text() == "of another program"
    assert not list(folder.glob("*.lss"))


@pytest.mark.parametrize("more", [["--seconds", 1.5], ["--length", 1.5, "--countdown", 0, "--trials", 1]])
def test_taxel_record_says_that_its_file_is_gone(tmp_path: Path, more: list[object]) -> None:
    (tmp_path / "here").mkdir()
    port, file = free_port(), tmp_path / "here" / "walk.mcap"
    with recording(file, port, *more) as process:
        listening(process)
        sent = play(presses(2), port)
        wait_until(lambda: any((tmp_path / "here").iterdir()))
        time.sleep(0.2)
        shutil.rmtree(tmp_path / "here")
        out, err = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "nothing lost" not in out
    assert err.splitlines()[-1].endswith(
        f"was removed, renamed or replaced while it was recorded; LOST: {sent} datagrams and lines"
    )


def test_two_recordings_of_one_program_do_not_share_a_file(tmp_path: Path) -> None:
    file = tmp_path / "walk.mcap"
    with (
        Live(0, host=LOOPBACK, array=SMALL, record_later=True) as one,
        Live(0, host=LOOPBACK, record_later=True) as two,
    ):
        one.record(file)
        with pytest.raises(OSError, match="is being recorded by another program"):
            two.record(file, overwrite=True)
        wait_for(one, play(presses(1), one.address[1]))
        assert one.end_recording().path == file
        two.record(file, overwrite=True)
        assert two.end_recording().path is None
    assert len(taxel.open(file).events) == len(presses(1))


def test_what_was_noted_is_kept_though_nothing_came(tmp_path: Path) -> None:
    with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "noted.mcap") as live:
        live.note("the cable is out")
    assert live.stop().path == tmp_path / "noted.mcap"
    assert [note.text for note in taxel.open(tmp_path / "noted.mcap").notes] == ["the cable is out"]


def test_taxel_live_to_which_nothing_came_names_no_latency(tmp_path: Path) -> None:
    touch().save(tmp_path / "touch.json")
    port = free_port()
    here = ["--host", LOOPBACK, "--port", port, "--array", "4x4", "--seconds", 0.2]
    arguments = command("live", "--readout", tmp_path / "touch.json", *here)
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 3
    assert f"nothing arrived at UDP {LOOPBACK}:{port}" in done.stdout
    assert "p50" not in done.stdout
    with Live(0, host=LOOPBACK) as live:
        assert live.counters["decode_latency"] == {"count": 0, "p50_us": None, "p99_us": None, "max_us": None}


@pytest.mark.parametrize("version", [1, 2])
def test_a_board_with_more_taxels_than_the_array_is_said_while_it_runs(tmp_path: Path, version: int) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    n = 500
    far = Events(np.arange(n) * 100, np.full(n, 40), np.full(n, 2), np.ones(n, bool), array=Array(64, 64))
    board = Board(Registers(wire_version=2))
    pressed = [datagram for ticks in (0, 90) for datagram in board.frame(np.full(4096, ticks, np.uint16))]
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--array", "8x8")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        assert process.stderr is not None
        if version == 1:
            play(far, port)
        else:
            send(pressed, LOOPBACK, port)
        said = next(line for line in process.stderr if line.startswith("taxel: "))
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert "words name taxels outside 8 x 8" in said
    assert "--array" in said
    assert process.returncode == 2
    assert file.exists(), "the bytes are kept"
