"""The emulated board over UDP on loopback."""

import json
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import taxel
from taxel import ProblemError, wire
from taxel.demo.script import script
from taxel.simulate import Silence, emulate, play, truth


@pytest.fixture
def listener():
    """A socket on loopback, and what it hears until nothing comes for a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 26)
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(30.0)
        heard = []

        def hear():
            try:
                while True:
                    heard.append(opened.recv(65_536))
                    opened.settimeout(1.0)
            except TimeoutError:
                pass

        yield opened.getsockname()[1], heard, hear


def test_a_board_in_real_time_sends_what_one_without_a_clock_does(listener):
    """Byte for byte the same play, and the sender's own count closes the whole."""
    port, heard, hear = listener
    acts = [Silence(40.0)]
    thread = threading.Thread(target=hear)
    thread.start()
    begun = []
    report = emulate(f"127.0.0.1:{port}", acts, seed=4, tare_ms=2.0, begun=begun.append)
    thread.join()
    assert begun == [None]
    assert sum(map(len, heard)) == report.bytes
    assert len(heard) == report.datagrams
    events = wire.decode(b"".join(heard))
    assert events == play(acts, seed=4, tare_ms=2.0).events
    assert report.changes == len(events) > 0, "what arming would have sent is not counted"
    assert report.frames == round(40_000 / 192)
    assert "frames/s" in report.verdict


def test_what_a_callback_raises_ends_the_play(listener):
    port, _, _ = listener

    def complain(_):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        emulate(f"127.0.0.1:{port}", [Silence(60_000.0)], seed=4, watch=complain)


@pytest.mark.parametrize("to", ["nowhere", "127.0.0.1", "127.0.0.1:99999", 5208])
def test_an_address_that_is_none_is_refused(to):
    with pytest.raises(ProblemError):
        emulate(to, [Silence(100.0)], seed=1)


def test_the_command_says_what_it_sent(listener):
    port, heard, hear = listener
    thread = threading.Thread(target=hear)
    thread.start()
    command = [
        sys.executable,
        "-m",
        "taxel",
        "emulate",
        "--port",
        str(port),
        "--scenes",
        "0",
        "--tare",
        "0.002",
        "--json",
    ]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    thread.join()
    said = json.loads(ended.stdout)
    assert said["bytes"] == sum(map(len, heard))
    assert 0 <= said["seed"] < 2**32


def test_the_command_refuses_a_preset_that_is_none():
    command = [sys.executable, "-m", "taxel", "emulate", "--preset", "9 kHz"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert "5.2 kHz" in ended.stderr


def test_the_truth_is_written_as_it_happens_by_both_clocks(listener, tmp_path):
    port, _, hear = listener
    thread = threading.Thread(target=hear)
    thread.start()
    labels = tmp_path / "labels.csv"
    command = [sys.executable, "-m", "taxel", "emulate", "--port", str(port), "--scenes", "1", "--seed", "3"]
    began = time.time_ns()
    process = subprocess.Popen([*command, "--truth", str(labels)], stderr=subprocess.DEVNULL)
    while process.poll() is None:
        if labels.exists() and labels.read_text().count("\n") > 1:
            break
        time.sleep(0.01)
    assert process.poll() is None, "a line is there before the end"
    process.wait(timeout=60)
    ended = time.time_ns()
    thread.join()
    contacts, _ = truth(script(3, 1))
    rows = taxel.Labels(labels).rows
    times = sorted([round(c.start_us) for c in contacts] + [round(c.stop_us) for c in contacts])
    assert [row.t_us for row in rows] == times
    assert {row.label for row in rows} == {"contact", "lift"}
    host = [row.host_ns for row in rows]
    assert began < host[0] < host[-1] < ended
    np.testing.assert_allclose(np.diff(host), 1000 * np.diff(times), atol=2000)
    again = subprocess.run([*command, "--truth", str(labels)], capture_output=True, text=True, timeout=60, check=False)
    assert (again.returncode, again.stdout) == (2, "")
    assert str(labels) in again.stderr
