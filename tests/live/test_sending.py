"""Detections on their way to other programs: the lines of --json, lost where there is no reader, never waited for."""

import json
import os
import socket
import time
from pathlib import Path

from loopback import free_port
from shell import run, run_beside

import taxel
from taxel.live import Live

from .boards import LOOPBACK, SMALL, play, presses, touch, wait_for

LONG_BEFORE_ANY = {"guard_frames": 1e6}
KEYS = {"label", "t_us", "known_us", "slope_mv_per_ms", "repaired", "reported_us", "reported_ns"}


def listen(send: object, record: Path) -> Live:
    return Live(0, host=LOOPBACK, array=SMALL, readout=touch(), send=send, record=record, **LONG_BEFORE_ANY)


def the_same(lines: list[bytes], record: Path) -> None:
    """What was sent is what the recording says was said."""
    said, kept = [json.loads(line) for line in lines], taxel.open(record).detections
    assert all(set(one) == KEYS for one in said)
    assert [one["label"] for one in said] == list(kept.label)
    assert [one["t_us"] for one in said] == kept.t.tolist()
    assert [one["known_us"] for one in said] == kept.known.tolist()


def everything(read: int) -> list[bytes]:
    """Read a descriptor until its other end is closed."""
    got = b""
    while piece := os.read(read, 65_536):
        got += piece
    return got.splitlines()


def test_a_detection_goes_by_udp_and_into_a_pipe(tmp_path: Path) -> None:
    record, pipe = tmp_path / "said.mcap", tmp_path / "said.pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((LOOPBACK, 0))
        other.settimeout(30)
        with listen([f"lines+udp:{LOOPBACK}:{other.getsockname()[1]}", f"lines:{pipe}"], record) as live:
            wait_for(live, 0)
            wait_for(live, play(presses(6), live.address[1]))
            counts = live.stop().counters
        datagrams = [other.recv(65_536) for _ in range(counts["detections"])]
    os.set_blocking(reader, True)
    lines = everything(reader)
    os.close(reader)
    assert counts["detections"] == 6
    assert [line + b"\n" for line in lines] == datagrams, "one format"
    the_same(lines, record)
    assert [(one["sent"], one["lost"], one["waiting"]) for one in counts["sent"]] == [(6, 0, 0)] * 2


def test_who_does_not_read_loses_lines_and_holds_nothing(tmp_path: Path) -> None:
    """A pipe takes 64 KiB, 1024 lines wait, the rest is lost and counted: what went is whole, nothing else is lost."""
    pipe, presses_made = tmp_path / "slow", 1500
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    with listen(f"lines:{pipe}", tmp_path / "said.mcap") as live:
        wait_for(live, 0)
        events, until = presses(presses_made), time.monotonic() + 60
        for k in range(0, len(events), 20 * 50):
            play(events[k : k + 20 * 50], live.address[1])
        while (
            live.counters["events"] < len(events) or sum(live.counters["sent"][0][k] for k in ("waiting", "lost")) == 0
        ):
            assert time.monotonic() < until, live.counters
            time.sleep(0.01)
        before = live.counters
        assert before["capture"]["dropped_by_queue"] == before["events_dropped"] == 0
        counts = live.stop().counters
    os.set_blocking(reader, True)
    lines = everything(reader)
    os.close(reader)
    (sent,) = counts["sent"]
    assert counts["detections"] == presses_made == sent["sent"] + sent["lost"]
    assert sent["lost"] > 0
    assert sent["waiting"] == 0
    assert len([line for line in lines if line.endswith(b"}")]) == sent["sent"], (
        "whole lines, and as many as were counted"
    )


def test_taxel_live_sends_and_says_what_was_lost(tmp_path: Path) -> None:
    port, pipe = free_port(), tmp_path / "nobody"
    os.mkfifo(pipe)
    touch().save(tmp_path / "touch.json")
    heard = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind((LOOPBACK, 0))
        other.settimeout(30)

        def board(_: str) -> None:
            play(presses(3), port)
            heard.extend(json.loads(other.recv(65_536)) for _ in range(3))

        receivers = ["--send", f"lines+udp:{LOOPBACK}:{other.getsockname()[1]}", "--send", f"lines:{pipe}"]
        listens = ["--array", "4x4", "--host", LOOPBACK, "--port", port, "--guard-frames", "1e6"]
        done = run_beside(board, "live", "--readout", tmp_path / "touch.json", *listens, *receivers)
    assert [set(line) for line in heard] == [KEYS] * 3
    assert f"taxel: 3 of 3 lines not sent to lines:{pipe}: no reader" in done.stderr
    assert done.returncode == 3
    said = run("live", "--send", "lines+udp:127.0.0.1:9")
    assert said.stderr == "taxel: nothing to do: give --readout FILE to detect, or --panel to show the board\n"
    assert said.returncode == 2
