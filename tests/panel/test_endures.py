"""What a panel endures: a long run with many who look."""

from __future__ import annotations

import re
import time
from pathlib import Path

import psutil
import pytest
from children.marked import TAXEL, Marked
from loopback import free_port
from tests.panel.protocol import ADDRESS, Client, door

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]


def while_it_runs(page: Client, seconds: float) -> dict:
    """Look for a while; return the last counters."""
    end = time.monotonic() + seconds
    counters = page.until("counters")
    while time.monotonic() < end:
        counters = page.until("counters")
    return counters


def test_memory_is_bounded_and_nothing_is_lost_over_time(tmp_path: Path) -> None:
    port = free_port()
    here = ("--port", port, "--host", "127.0.0.1", "--folder", ".")
    with (
        Marked(tmp_path / "live", TAXEL, "live", "--panel", *here) as server,
        Marked(tmp_path / "board", TAXEL, "emulate", "--port", port, "--seed", 1),
    ):
        server.until(lambda one: re.search(ADDRESS, one.said()))
        at, memory = door(re.findall(ADDRESS, server.said())[0]), psutil.Process(server.pid).memory_info
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
                early = memory().rss
                counters = while_it_runs(page, 120.0)
                late = memory().rss
                first, last = counters["reach_us"]
                assert 60_000_000 <= last - first < 62_000_000
                assert (counters["lost"]["number"], counters["lost"]["by_kernel_known"]) == (0, True)
                assert counters["viewers"] < 7, "who never reads is let go"
        finally:
            for page in pages:
                page.socket.socket.close()
        assert late - early < 32 << 20, f"{early >> 20} MiB, then {late >> 20} MiB"
