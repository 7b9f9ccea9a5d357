"""What a panel endures: killed boards, panels and pages, and a long run with many who look."""

from __future__ import annotations

import re
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from loopback import free_port
from tests.panel.browser import Process, running
from tests.panel.protocol import ADDRESS, Client, door

import taxel

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

#: Delay after which received data must be in the file, on a quiet machine; a busy one may take a few times as long.
KEPT_US = 100_000


def rss_bytes(server: Process) -> int:
    """Return the resident memory of a process."""
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", status).group(1)) << 10  # type: ignore[union-attr]


def while_it_runs(page: Client, seconds: float) -> dict:
    """Look for a while; return the last counters."""
    end = time.monotonic() + seconds
    counters = page.until("counters")
    while time.monotonic() < end:
        counters = page.until("counters")
    return counters


@pytest.mark.parametrize("turn", range(3))
@pytest.mark.parametrize("dies", ["recorder", "board", "page"])
def test_whoever_is_killed_what_was_recorded_is_there(dies: str, turn: int, tmp_path: Path) -> None:
    port, random = str(free_port()), np.random.default_rng([turn, len(dies)])
    here = ("--port", port, "--host", "127.0.0.1", "--folder", ".")
    with (
        running("live", "--panel", *here, folder=tmp_path) as server,
        running("emulate", "--port", port, "--seed", str(turn), folder=tmp_path) as board,
        Client(door(server.wait_for(f"({ADDRESS})"))) as page,
    ):
        page.send(type="credit", n=2)
        while not page.until("counters")["events"]:
            pass
        assert page.ask("record", name=f"walk{turn}")["type"] == "done"
        page.since_asked("recorder", state="recording")
        last = while_it_runs(page, random.uniform(1.0, 3.0))
        file = tmp_path / f"walk{turn}.mcap"
        if dies == "recorder":
            server.process.kill()
            server.process.wait()
            kept = taxel.open(file)
            assert kept.truncated
            # Ten times what a quiet machine takes: this one may be busy.
            assert kept.events.t[-1] >= last["board_us"] - 10 * KEPT_US
        else:
            if dies == "board":
                board.process.kill()
                board.process.wait()
            else:
                # The connection is cut without a closing handshake, as by a browser that crashes.
                page.socket.socket.close()
            with Client(door_again(server, page)) as other:
                other.send(type="credit", n=2)
                counters = while_it_runs(other, 1.0)
                assert other.ask("stop")["type"] == "done"
                ended = other.until("recorder", state="idle")
            assert ended["error"] is None
            kept = taxel.open(file)
            assert not kept.truncated
            assert kept.verdict.startswith("nothing lost")
            if dies == "board":
                # Everything that was received is recorded: the board sent nothing after that.
                assert kept.events.t[-1] == counters["board_us"]
            else:
                assert kept.events.t[-1] > last["board_us"]
        assert kept.events.t[0] <= last["board_us"]
        assert (np.diff(kept.datagrams().number) == 1).all(), "nothing is missing within"


def door_again(server: Process, page: Client) -> SimpleNamespace:
    """Return the door that a client came through."""
    host, port = page.host.rsplit(":", 1)
    return SimpleNamespace(address=(host, int(port)), token=page.token)


def test_memory_is_bounded_and_nothing_is_lost_over_time(tmp_path: Path) -> None:
    port = str(free_port())
    here = ("--port", port, "--host", "127.0.0.1", "--folder", ".")
    with (
        running("live", "--panel", *here, folder=tmp_path) as server,
        running("emulate", "--port", port, "--seed", "1", folder=tmp_path),
    ):
        at = door(server.wait_for(f"({ADDRESS})"))
        pages = [Client(at) for _ in range(6)]
        try:
            for k, page in enumerate(pages):
                page.send(type="credit", n=8)
                if k % 2:
                    # A client that requests everything, including narrow columns, and never reads.
                    page.send(type="zoom", column_us=125)
                    page.send(type="credit", n=8)
            with Client(at) as page:
                page.send(type="credit", n=2)
                # The ring buffer is full after a minute: from then on memory must be constant.
                while_it_runs(page, 90.0)
                early = rss_bytes(server)
                counters = while_it_runs(page, 120.0)
                late = rss_bytes(server)
                first, last = counters["reach_us"]
                assert 60_000_000 <= last - first < 62_000_000
                assert counters["lost"]["kernel"] == counters["lost"]["queue"] == 0
                assert counters["viewers"] < 7, "who never reads is let go"
        finally:
            for page in pages:
                page.socket.socket.close()
        assert late - early < 32 << 20, f"{early >> 20} MiB, then {late >> 20} MiB"
