"""Sources of lines: each byte that comes is in a line, or counted: live, in the recording and by ``taxel record``."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import shutil
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from children.marked import TAXEL
from loopback import until
from shell import call

import taxel
from taxel import ProblemError
from taxel.live import Live

LOOPBACK = "127.0.0.1"
#: Longest line, bytes.
LONGEST = 1 << 16


@contextlib.contextmanager
def writing(place: Path, pieces: list[bytes]) -> Iterator[threading.Event]:
    """Write pieces into a named pipe, in a thread that closes it at the end; the event is set when all are written."""
    os.mkfifo(place)
    written, over = threading.Event(), threading.Event()

    def write() -> None:
        with place.open("wb", buffering=0) as pipe:
            for piece in pieces:
                view = memoryview(piece)
                while view:
                    view = view[pipe.write(view) :]
            written.set()
            over.wait(30)

    thread = threading.Thread(target=write, daemon=True)
    thread.start()
    try:
        yield written
    finally:
        over.set()
        thread.join(10)


def numbers_of(pieces: list[bytes]) -> tuple[int, int, int, int, int]:
    """Return the number of lines, of those that are no frame, of bytes in no line and of unfinished lines,
    and of frames.

    A frame is two numbers; text before the first one is no fault.
    """
    *whole, last = b"".join(pieces).replace(b"\r", b"\n").split(b"\n")
    lines = [line for line in whole if line.strip()]
    beyond = sum(max(0, len(line) - LONGEST) for line in [*lines, last])
    cut = [line for line in [*lines, last] if len(line) > LONGEST]
    all_ = [*lines, *([last] if last in cut else [])]
    good = [line not in cut and _is_pair(line) for line in all_]
    begun = good.index(True) if any(good) else len(all_)
    strange = [k for k, line in enumerate(all_) if not good[k] and (k > begun or line.isdigit())]
    return len(all_), len(strange), beyond, 0 if last in cut else len(last), sum(good)


def _is_pair(line: bytes) -> bool:
    try:
        return len([float(field) for field in line.decode().split(",")]) == 2
    except ValueError:
        return False


LONG = b"7" * 300_000
PIPES = {
    "nothing but one line that does not end": [b"x" * 3_000_000],
    "such a line, and then good ones": [b"x" * 3_000_000, b"\n1,2\n3,4\n"],
    "garbage after good lines": [b"1,2\n3,4\n", bytes(range(256)) * 30, b"\n5,6\n"],
    "a long line in the middle": [b"1,2\n", b"3,", LONG, b"\n5,6\n"],
    "a long line that could be numbers": [b"1,2\n3,4", b" " * 100_000, b"\n5,6\n"],
    "a last line without an end": [b"1,2\n3,4\n5,"],
    "NUL bytes": [b"1,2\n\0\0\0,3\n3\0,4\n5,6\n"],
    "no UTF-8": [b"1,2\n\xff\xfe,3\n5,6\n"],
    "carriage returns alone": [b"1,2\r3,4\r5,6\r"],
    "carriage returns and line feeds": [b"1,2\r\n3,4\r\n\r\n5,6\r\n"],
    "a line of the longest length, and two bytes more": [b"9" * LONGEST, b"\n", b"9" * (LONGEST + 2), b"\n1,2\n"],
}


@pytest.mark.parametrize("name", PIPES)
def test_each_byte_of_a_pipe_is_in_a_line_or_counted(tmp_path: Path, name: str) -> None:
    pieces = PIPES[name]
    lines, strange, beyond, unfinished, frames = numbers_of(pieces)
    path, place = tmp_path / "a.mcap", tmp_path / "pipe"
    sources = {"imu": f"lines:{place},columns=a:b"}
    with writing(place, pieces) as written, Live(0, host=LOOPBACK, record=path, sources=sources) as live:
        assert written.wait(20)
        until(lambda: counts_of(live)["lines"] == lines and counts_of(live)["bytes_in_no_line"] == beyond)
        summary = live.stop()
    counts = summary.counters["sources"]["imu"]["lines"]
    assert (counts["lines"], counts["strange"]) == (lines, strange)
    assert (counts["bytes_in_no_line"], counts["bytes_of_unfinished_lines"]) == (beyond, unfinished)
    verdict = summary.verdict.parts["imu"]
    assert verdict.lost == ({"bytes_in_no_line": beyond} if beyond else {})
    assert verdict.damaged.get("lines_that_could_not_be_read", 0) == strange
    assert verdict.noted.get("bytes_of_unfinished_lines", 0) == unfinished
    assert (f"{beyond} bytes in no line of numbers" in verdict) == bool(beyond)
    assert verdict.status == ("lost" if beyond else "damaged" if strange else "complete after arrival")
    recording = taxel.open(path).sources["imu"]
    assert recording.verdict.to_dict() == verdict.to_dict()
    assert recording.counts["bytes_in_no_line"] == beyond
    assert recording.counts["lines_that_could_not_be_read"] == strange
    assert len(recording.frames()) == frames
    # What a line of 3 MB takes in the file is bounded, too.
    assert path.stat().st_size < 1_500_000


def counts_of(live: Live) -> dict[str, int]:
    counts: dict[str, int] = live.counters["sources"]["imu"]["lines"]
    return counts


@pytest.mark.parametrize("garbage", [b"x" * 5_000_000, b"\0\1\2\n" * 1000, b"\xff" * 70_000])
def test_what_comes_before_the_first_line_is_told_and_names_no_column(tmp_path: Path, capsys, garbage) -> None:
    path, place = tmp_path / "a.mcap", tmp_path / "pipe"
    with writing(place, [garbage, b"\n1,2\n3,4\n"]):
        source = ("--source", f"imu=lines:{place}", "--seconds", "1", "--json")
        code, out, err = call(capsys, "record", path, "--port", "0", "--host", LOOPBACK, *source)
    summary = json.loads(out)
    counts = summary["counters"]["sources"]["imu"]["lines"]
    # Of a line that is too long the beginning is read.
    other, beyond = garbage.count(b"\n") or 1, max(0, len(garbage) - LONGEST)
    assert (code, counts["lines"], counts["strange"], counts["bytes_in_no_line"]) == (3, 2 + other, 0, beyond)
    [kind] = counts["unread"].values()
    assert kind["lines"] == other
    assert f"imu: {other} line" in err
    lost = {"bytes_in_no_line": beyond} if beyond else {}
    assert summary["verdict_details"]["parts"]["imu"]["lost"] == lost
    assert taxel.open(path).sources["imu"].columns == ["column_0", "column_1"]
    code, out, _ = call(capsys, "info", path)
    assert (f"{beyond} bytes in no line of numbers" in out.replace("\n", " ")) == bool(beyond)


@contextlib.contextmanager
def plugged(kind: str, link: Path) -> Iterator[tuple[str, Callable[[], Callable[[bytes], bool]]]]:
    """Yield the place of a serial line, and a function that plugs it in anew and returns one that sends on it."""
    with contextlib.ExitStack() as plug, socket.create_server((LOOPBACK, 0)) as server:

        def plug_port() -> Callable[[bytes], bool]:
            plug.close()
            ours, theirs = pty.openpty()
            tty.setraw(theirs)
            link.symlink_to(os.ttyname(theirs))
            for close, end in ((os.close, ours), (os.close, theirs), (os.unlink, link)):
                plug.callback(close, end)
            return lambda data: os.write(ours, data) > 0

        def plug_server() -> Callable[[bytes], bool]:
            plug.close()
            accepted: list[socket.socket] = []

            def send(data: bytes) -> bool:
                if not accepted:
                    accepted.append(plug.enter_context(server.accept()[0]))
                return accepted[0].send(data) > 0

            return send

        if kind == "port":
            yield str(link), plug_port
        else:
            yield f"{LOOPBACK}:{server.getsockname()[1]}", plug_server


@pytest.mark.parametrize("kind", ["port", "server"])
def test_a_serial_line_is_read_again_after_it_was_unplugged(tmp_path: Path, kind: str) -> None:
    with plugged(kind, tmp_path / "line") as (place, plug):
        send, sources = plug(), {"imu": f"serial:{place},columns=a:b"}
        with Live(0, host=LOOPBACK, record=tmp_path / "a.mcap", sources=sources) as live:
            send(b"1,2\n3,4\n5,")
            until(lambda: counts_of(live)["lines"] == 2)
            send = plug()
            until(lambda: send(b"6,7\n") and counts_of(live)["lines"] > 2)
            summary = live.stop()
    counts = summary.counters["sources"]["imu"]["lines"]
    assert (counts["strange"], counts["bytes_in_no_line"], counts["bytes_of_unfinished_lines"]) == (0, 0, 2)
    # The line is back.
    assert counts["trouble"] is None


@pytest.mark.parametrize("keys", [",columns=a:b:c", ""])
def test_the_rest_of_a_line_amid_which_reading_began_is_no_fault(tmp_path: Path, keys: str) -> None:
    place = tmp_path / "pipe"
    sources = {"imu": f"lines:{place}{keys}"}
    with (
        writing(place, [b"5,6\n1,2,3\n4,5,6\n7,8,9\n"]) as written,
        Live(0, host=LOOPBACK, record=tmp_path / "a.mcap", sources=sources) as live,
    ):
        assert written.wait(20)
        until(lambda: counts_of(live)["lines"] == 3)
        summary = live.stop()
    counts, verdict = summary.counters["sources"]["imu"]["lines"], summary.verdict.parts["imu"]
    assert (counts["lines"], counts["strange"], counts["bytes_of_unfinished_lines"]) == (3, 0, 0)
    assert (dict(verdict.damaged), dict(verdict.noted)) == ({}, {})
    recording = taxel.open(tmp_path / "a.mcap").sources["imu"]
    assert recording.frames().values[:, 0].tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]


@pytest.mark.parametrize("came", [b"", b"9" * 10_000_000, b"9" * 100, b"\xff\n" * 1000])
def test_where_no_line_came_it_is_said_how_many_bytes_did(tmp_path: Path, came: bytes) -> None:
    place, said = tmp_path / "pipe", f"{sum(map(len, came.splitlines()))} bytes arrived"
    with writing(place, [came]), pytest.raises(ProblemError) as caught:
        Live(0, host=LOOPBACK, sources=f"lines:{place},array=4x4")
    assert (said in str(caught.value), "no line arrived" in str(caught.value)) == (bool(came), not came)


#: Sets the clock of a program back, as soon as a file is there.
SET_BACK = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static long ahead(void) { return access(getenv("SET_BACK"), F_OK) == 0 ? 10 : 0; }
int clock_gettime(clockid_t which, struct timespec *now) {
    int (*of_system)(clockid_t, struct timespec *) = dlsym(RTLD_NEXT, "clock_gettime");
    int failed = of_system(which, now);
    if (which == CLOCK_REALTIME) now->tv_sec -= ahead();
    return failed;
}
"""


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="needs a C compiler on Linux")
def test_a_computers_clock_that_is_set_back_tears_no_lines_apart(tmp_path: Path) -> None:
    (tmp_path / "back.c").write_text(SET_BACK)
    shim, place, path, back = (tmp_path / name for name in ("back.so", "pipe", "a.mcap", "is set back"))
    subprocess.run(["cc", "-shared", "-fPIC", "-o", shim, tmp_path / "back.c", "-ldl"], check=True)
    os.mkfifo(place)
    source = f"lines:{place},array=1x2,rate=50"
    typed = (TAXEL, "record", path, "--host", LOOPBACK, "--source", source, "--seconds", "4")
    environment = os.environ | {"LD_PRELOAD": str(shim), "SET_BACK": str(back)}
    with (
        subprocess.Popen(typed, env=environment, stderr=subprocess.PIPE, text=True) as recording,
        contextlib.suppress(BrokenPipeError),
        place.open("wb", buffering=0) as pipe,
    ):
        while recording.poll() is None:
            pipe.write(b"1,2\n")
            time.sleep(0.02)
            if path.exists() and path.stat().st_size > 8000:
                back.touch()
    assert back.exists()
    steps_us = np.diff(taxel.open(path).sources["frames"].frames().t)
    assert len(steps_us) > 60
    # Lines that waited together have times one after the other, and no others have.
    assert (steps_us < 1000).mean() < 0.3
    assert steps_us.max() < 2_000_000
