"""The commands `taxel record` and `taxel live`: when they end, what they print and with which exit code."""

import json
import signal
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from loopback import free_port
from shell import run

import taxel
from taxel import Array, Events, wire
from taxel.live import Live, send
from taxel.options import FullReading
from taxel.simulate import Board, Scene, emulate
from taxel.wire import Registers

from .boards import LOOPBACK, SMALL, command, listening, play, presses, recording, touch


@pytest.mark.parametrize("ended", [signal.SIGINT, signal.SIGTERM])
def test_taxel_record_keeps_what_comes_until_ctrl_c_and_gives_a_verdict(ended: signal.Signals, tmp_path: Path) -> None:
    port, file, events = free_port(), tmp_path / "walk.mcap", presses(3)
    arguments = ("record", file, "--host", LOOPBACK, "--port", port, "--array", "4x4")
    with subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        play(events, port)
        time.sleep(0.3)
        process.send_signal(ended)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert said.splitlines()[-1].startswith("nothing lost after arrival")
    assert taxel.open(file).verdict.status == "complete after arrival"
    np.testing.assert_array_equal(taxel.open(file).events.to_numpy(), events.to_numpy())
    again = run(*arguments)
    assert again.returncode == 2
    said = f"taxel: {file}: exists already; give --overwrite, or another name"
    assert again.stderr.strip().splitlines() == [said]


def test_taxel_record_keeps_the_registers_of_a_sensor_of_ones_own(tmp_path: Path) -> None:
    port, file, array = free_port(), tmp_path / "own.mcap", Array(4, 4)
    with recording(file, port, "--rate-hz", 500, "--bits", 12) as process:
        listening(process)
        source = taxel.live.Source(array, rate=500, bits=12, to=f"{LOOPBACK}:{port}")
        for k in range(20):
            source.push(np.full((4, 4), 100 + 20 * k))
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        said, wrong = process.communicate(timeout=60)
    assert process.returncode == 0, (said, wrong)
    registers = taxel.open(file).registers
    assert registers == source.registers
    assert registers.frame_us == pytest.approx(2000, rel=1e-3)
    # No pitch is stated.
    assert taxel.open(file).array.pitch_mm is None
    assert FullReading(array=["4x4"]).open_one(file).array.pitch_mm is None


def test_taxel_record_says_how_much_a_board_of_version_2_sent(tmp_path: Path) -> None:
    port = free_port()
    arguments = command("record", tmp_path / "two.mcap", "--host", LOOPBACK, "--port", port, "--markers")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        listening(process)
        report = emulate(f"{LOOPBACK}:{port}", [Scene.draw(seed=3)], seed=1, tare_ms=20.0, wire=2)
        said, _ = process.communicate(timeout=60)
    # A verdict of losses has several lines.
    counted, verdict = said.rstrip().split("\n", 1)
    kept = taxel.open(tmp_path / "two.mcap").datagrams()
    assert f"{len(kept)} datagrams, " in counted
    assert f", {kept.payload.size} bytes, " in counted
    # The system drops datagrams of a recorder that a busy machine keeps waiting; then the verdict says so.
    assert (verdict == "nothing lost") == (len(kept) == report.datagrams)
    if verdict == "nothing lost":
        assert kept.payload.size == report.bytes
        assert counted.endswith(" 2 markers")


def test_taxel_record_ends_with_the_boards_stop_marker(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "marked.mcap"
    marked = Events([], [], [], [], array=SMALL, markers=[(1000, True), (5000, False)])
    arguments = command("record", file, "--host", LOOPBACK, "--port", port, "--markers", "--seconds", 60, "--json")
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            while process.poll() is None:
                link.sendto(wire.encode(marked), (LOOPBACK, port))
                time.sleep(0.05)
        said, for_people = process.communicate(timeout=60)
    summary = json.loads(said)
    assert process.returncode == 0
    first, *_, last = for_people.splitlines()
    assert first.startswith("listening on ")
    assert last.endswith(" s: the board marked a stop")
    assert summary["counters"]["markers"] >= 2
    assert summary["path"] == str(file)


def test_taxel_record_goes_on_by_itself_in_automatic_mode(tmp_path: Path) -> None:
    port = free_port()
    automatic = ["--length", 0.3, "--countdown", 0, "--start-index", 7, "--trials", 2]
    arguments = ("record", tmp_path / "step.mcap", "--host", LOOPBACK, "--port", port, *automatic)
    with (
        subprocess.Popen(command(*arguments), stdout=subprocess.PIPE, text=True) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        while process.poll() is None:
            link.sendto(wire.encode(presses(1)), (LOOPBACK, port))
            time.sleep(0.01)
        said, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["step7.mcap", "step8.mcap"]
    assert said.count("nothing lost after arrival") == 2
    again = run(*arguments)
    assert (again.returncode, again.stderr.strip()) == (
        2,
        f"taxel: {tmp_path / 'step7.mcap'}: exists already; give --overwrite, or another name",
    )


def test_a_port_that_is_taken_is_one_line(tmp_path: Path) -> None:
    with Live(0, host=LOOPBACK) as holder:
        port = holder.address[1]
        with pytest.raises(OSError, match="in use"):
            Live(port, host=LOOPBACK)
        done = run("record", tmp_path / "a.mcap", "--host", LOOPBACK, "--port", port)
    assert (done.returncode, done.stderr) == (3, f"taxel: UDP {LOOPBACK}:{port}: address already in use\n")
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize("differences", [False, True])
def test_taxel_live_writes_a_line_of_json_a_detection(tmp_path: Path, differences: bool) -> None:
    port, events = free_port(), presses(5)
    if differences:
        moved = np.diff(events.intensity.astype(int), prepend=0)
        said = Events(events.t, events.x, events.y, moved >= 0, array=SMALL, intensity=np.abs(moved))
    else:
        said = events
    touch().save(tmp_path / "touch.json")
    files = ["--readout", tmp_path / "touch.json", "--record", tmp_path / "live.mcap", "--report", tmp_path / "report"]
    arguments = command("live", *files, "--host", LOOPBACK, "--port", port, "--array", "4x4", "--json")
    # The datagrams' times do not follow the board's pace: the guard prevents the host's clock from advancing time here.
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
    assert "Live detections, recorded to" in (tmp_path / "report" / "report.html").read_text()
    keys = {"label", "t_us", "known_us", "slope_mv_per_ms", "repaired"}
    assert [set(line) for line in lines] == [keys | {"reported_us", "reported_ns"}] * 5
    heard_again = ("detect", tmp_path / "live.mcap", "--readout", tmp_path / "touch.json", "--json")
    detected = json.loads(run(*heard_again).stdout)["detections"]
    assert detected == [{key: line[key] for key in keys} for line in lines], "one schema"
    recorded = taxel.open(tmp_path / "live.mcap")
    np.testing.assert_array_equal([line["t_us"] for line in lines], recorded.detections.t)
    np.testing.assert_array_equal(recorded.events.intensity, events.intensity)


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
    assert "words are of taxels outside 8 x 8" in said
    assert "--array" in said
    assert process.returncode == 2
    assert file.exists(), "the bytes are kept"
