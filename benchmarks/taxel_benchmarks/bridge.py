"""A bridge over Zenoh: rates, losses and latency from one pipeline to another, on loopback.

Three processes: a sender, the computer that it sends to (with its bridge), and the receiving one. They share this
machine and its clock, so a datagram's latency is exact: from the kernel's stamp there to the end of decoding here.
It contains the 5 ms for which datagrams gather. The clock comparison is tested with an offset of 3.7 s and 50 ppm.

Peer: none: nothing else carries these datagrams. Unit: ms from the kernel's stamp to the end of decoding; datagrams
lost. Goal: nothing lost on the way to a recorder, a killed process noticed within 2 s.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel import ProblemError
from taxel.live import Live
from taxel_benchmarks._goals import Goal, at_most
from taxel_benchmarks._peer import missing
from taxel_benchmarks._rounds import stamp
from taxel_bridge import Remote

#: Frames a second, datagrams a frame, and bytes a datagram.
STREAMS = {
    "a drop: 5208 datagrams/s of 64 bytes": (192.0, 1, 64),
    "a foot: 5208 datagrams/s of 640 bytes": (192.0, 1, 640),
    "full frames: 10 000 datagrams/s of 1400 bytes": (1000.0, 10, 1400),
}
#: Words of the figures that are better when smaller.
SMALLER = ("latency",)
AHEAD_S, DRIFT_PPM = 3.7, 50.0

SEND = """
import json, sys
from taxel.live import send
port, size, each, period, seconds = (float(a) for a in sys.argv[1:])
words = bytes.fromhex("c000050304") * (int(size) // 5)
print(json.dumps(send([words], port=int(port), each=int(each), period_us=period, seconds=seconds)))
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Other:
    """The process of the computer that the sender sends to, with its bridge."""

    def __init__(self, *more: str) -> None:
        self.port, self.place = free_port(), f"127.0.0.1:{free_port()}"
        command = [sys.executable, "-m", "taxel", "bridge", "--json", "--host", "127.0.0.1", "--port", str(self.port)]
        self.process = subprocess.Popen([*command, "--listen", self.place, *more], stdout=subprocess.PIPE, text=True)

    def end(self) -> dict[str, Any]:
        """End the process regularly; return its counts."""
        self.process.send_signal(signal.SIGINT)
        counted: dict[str, Any] = json.loads(self.process.communicate(timeout=60)[0])["counters"]
        return counted

    def __enter__(self) -> Other:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


def send(port: int, size: int, each: int, period_us: float, seconds: float) -> dict[str, Any]:
    """Send from a process of its own."""
    arguments = [str(a) for a in (port, size, each, period_us, seconds)]
    done = subprocess.run([sys.executable, "-c", SEND, *arguments], capture_output=True, text=True, check=True)
    counted: dict[str, Any] = json.loads(done.stdout)
    return counted


def wait_for(what: Callable[[], Any]) -> None:
    until = time.monotonic() + 60
    while not what():
        assert time.monotonic() < until, "never came"
        time.sleep(0.01)


def stream(period_us: float, each: int, size: int, seconds: float, congestion: str) -> dict[str, Any]:
    """Send, bridge and receive one stream."""
    with (
        Other() as other,
        Remote(f"zenoh:{other.place}", congestion=congestion, timeout=60.0) as remote,
        Live(remote=remote) as live,
    ):
        wait_for(lambda: live.counters["bridged"]["parcels"])
        before = os.times()
        sent = send(other.port, size, each, period_us, seconds)
        after = os.times()
        there = other.end()
        wait_for(lambda: live.counters["bridged"]["ended"])
        counters = live.stop().counters
    came, capture = counters["bridged"], counters["capture"]
    lost = came["missing"] + came["dropped"] + capture["dropped_by_queue"]
    assert there["capture"]["datagrams"] == counters["decoded"] + lost, "the sum closes"
    return {
        "sent_datagrams_per_s": sent["datagrams"] / seconds,
        "sent_mb_per_s": sent["bytes"] / 1e6 / seconds,
        "lost_before_the_bridge": sent["datagrams"] - there["capture"]["datagrams"],
        "lost_there": came["dropped"],
        "lost_between": came["missing"],
        "lost_here": capture["dropped_by_queue"],
        "listener_cores": (after.user + after.system - before.user - before.system) / seconds,
        "latency": {name: counters["decode_latency"][f"{name}_us"] for name in ("p50", "p99", "max")},
    }


def clocks(seconds: float) -> dict[str, Any]:
    """Record arrivals there by the true clock, and here with the offset clock; return their differences."""
    with tempfile.TemporaryDirectory() as folder:
        near, far = Path(folder) / "near.mcap", Path(folder) / "far.mcap"
        skew = ["--clock-ahead", str(AHEAD_S), "--clock-drift", str(DRIFT_PPM), "--record", str(near)]
        with (
            Other(*skew) as other,
            Remote(f"zenoh:{other.place}", timeout=60.0) as remote,
            Live(remote=remote, record=far) as live,
        ):
            wait_for(lambda: live.counters["bridged"]["parcels"])
            send(other.port, 64, 1, 2000.0, seconds)
            other.end()
            wait_for(lambda: live.counters["bridged"]["ended"])
            clock = live.stop().counters["bridged"]["clock"]
        there, here = (taxel.open(path).datagrams().arrived_ns for path in (near, far))
    since = (there - there[0]) / 1e9
    apart_us = (here - there) / 1e3
    return {
        "injected": {"ahead_s": AHEAD_S, "drift_ppm": DRIFT_PPM},
        "drift_ppm": clock["drift_ppm"],
        "within_us": clock["within_ns"] / 1e3,
        **{
            f"apart after {first:g} s, us": {
                "p50": float(np.median(np.abs(apart_us[since >= first]))),
                "max": float(np.abs(apart_us[since >= first]).max()),
            }
            for first in (0.0, 1.0, 10.0)
            if (since >= first).any()
        },
    }


def killed() -> dict[str, float]:
    """Kill a bridge and restart it; return the times until that is noticed and until data arrive again, s."""
    with Other() as other:
        place = ["--listen", other.place]
        with Remote(f"zenoh:{other.place}", timeout=60.0) as remote, Live(remote=remote) as live:
            wait_for(lambda: live.counters["bridged"]["parcels"])
            other.process.kill()
            begun = time.monotonic()
            wait_for(lambda: not live.counters["bridged"]["received"])
            noticed = time.monotonic() - begun
            with Other(*place) as again:
                # Starting takes a while: the process has started when its address accepts connections.
                Remote(f"zenoh:{again.place}", timeout=60.0).stop()
                begun = time.monotonic()
                wait_for(lambda: live.counters["bridged"]["received"])
                back = time.monotonic() - begun
    return {"noticed_s": noticed, "heard_again_s": back}


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    if "streams" not in result:
        return []
    blocked = [ways["block"] for ways in result["streams"].values()]
    figures = {
        "datagrams lost on the way to a recorder": sum(row["lost_between"] + row["lost_there"] for row in blocked),
        "a killed peer noticed, s": max(one["noticed_s"] for one in result["killed"]),
    }
    return at_most(dict(zip(figures, (0, 2.0), strict=True)), figures)


def run(*, quick: bool) -> dict[str, Any]:
    absent = missing({"taxel_zenoh": "taxel_zenoh"})
    if absent:
        if not quick:
            raise ProblemError("bridge: the wheel taxel_zenoh is not built: make bridge")
        return stamp() | {"left out": {"all of it": "taxel_zenoh not installed: make bridge"}, "ratios": {}}
    rounds, seconds = (1, 1.0) if quick else (3, 2.0)
    load = os.getloadavg()[0]
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {name: {"block": [], "drop": []} for name in STREAMS}
    for _ in range(rounds):
        for name, (period_us, each, size) in STREAMS.items():
            for congestion, kept in rows[name].items():
                kept.append(stream(period_us, each, size, seconds, congestion))
    apart = clocks(3.0 if quick else 15.0)
    gone = [killed() for _ in range(rounds)]
    streams = {name: {way: _middle(kept) for way, kept in ways.items()} for name, ways in rows.items()}
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp("taxel_zenoh"),
        "load_before": load,
        "load_after": os.getloadavg()[0],
        "streams": streams,
        "clock": apart,
        "killed": gone,
        "ratios": {
            f"p50 latency of {name}, {way}, ms": row["p50_us"] / 1e3
            for name, ways in streams.items()
            for way, row in ways.items()
        },
    }


def _middle(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the median of every number over the rounds, and the largest loss."""
    flat = [{**row, **{f"{k}_us": v for k, v in row["latency"].items()}} for row in rows]
    names = [name for name in flat[0] if name != "latency"]
    return {
        name: max(row[name] for row in flat)
        if name.startswith("lost")
        else float(np.median([row[name] for row in flat]))
        for name in names
    }
