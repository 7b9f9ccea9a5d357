"""A bridge over Zenoh: datagrams lost, latency, and how soon a killed end is noticed, on loopback.

Four processes: a sender, both ends of the bridge (`taxel bridge publish` and `receive`), and this one, which receives
where `taxel record` would. Each datagram holds the time at which it was sent; all share the clock of this machine.

Peer: none: nothing else carries these datagrams. Unit: ms from sending to receiving; datagrams lost. Goal: of 10 000
datagrams a second of 1400 bytes none is lost, with a median of 6 ms; a killed end is noticed within 2 s.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from taxel_benchmarks._goals import Goal, at_most
from taxel_benchmarks._rounds import stamp

#: Datagrams a ms, and bytes a datagram.
STREAMS = {
    "a foot: 5000 datagrams/s of 640 bytes": (5, 640),
    "full frames: 10 000 datagrams/s of 1400 bytes": (10, 1400),
}

#: Sends datagrams of version 2's first byte that hold the time; prints how many.
SEND = """
import socket, sys, time
port, each, size, seconds = (int(a) for a in sys.argv[1:])
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
rest, began = bytes(size - 9), time.perf_counter()
for ms in range(1000 * seconds):
    for _ in range(each):
        link.sendto(b"T" + time.perf_counter_ns().to_bytes(8, "little") + rest, ("127.0.0.1", port))
    time.sleep(max(0.0, began + (ms + 1) / 1000 - time.perf_counter()))
print(1000 * seconds * each)
"""


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class End:
    """A process of the command ``taxel bridge``."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "taxel", "bridge", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def says(self, words: str) -> float:
        """Wait until it says words; return when."""
        assert self.process.stderr is not None
        for line in self.process.stderr:
            if words in line:
                return time.monotonic()
        raise AssertionError(f"ended before it said {words!r}")

    def end(self) -> None:
        """Kill it, if it still runs."""
        self.process.kill()
        self.process.communicate()


@contextmanager
def bridge(to: int) -> Iterator[tuple[End, End, int]]:
    """Yield both ends, which are connected, and the port that is published."""
    place, port = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}", free_port(socket.SOCK_DGRAM)
    publisher = End("publish", "--host", "127.0.0.1", "--port", str(port), "--listen", place)
    publisher.says("listening on UDP")
    receiver = End("receive", "--port", str(to), "--connect", place)
    try:
        receiver.says("the board's computer is connected")
        publisher.says("a receiver is connected")
        yield publisher, receiver, port
    finally:
        publisher.end()
        receiver.end()


def stream(each: int, size: int, seconds: int) -> dict[str, float]:
    """Send, carry and receive one stream."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here:
        here.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 32 << 20)
        here.bind(("127.0.0.1", 0))
        here.settimeout(2.0)
        took = []
        with bridge(here.getsockname()[1]) as (_, _, port):
            words = [sys.executable, "-c", SEND, *map(str, (port, each, size, seconds))]
            with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as sender:
                while True:
                    try:
                        datagram = here.recv(65_535)
                    except TimeoutError:
                        break
                    took.append(time.perf_counter_ns() - int.from_bytes(datagram[1:9], "little"))
                sent = int(sender.communicate()[0])
    p50, p99, most = np.percentile(np.array(took) / 1e6, (50, 99, 100))
    return {"sent": sent, "lost": sent - len(took), "p50_ms": float(p50), "p99_ms": float(p99), "max_ms": float(most)}


def killed() -> dict[str, float]:
    """Kill each end; return how soon the other says so, s."""
    found = {}
    for name in ("publisher", "receiver"):
        with bridge(free_port(socket.SOCK_DGRAM)) as (publisher, receiver, _):
            ends = (publisher, receiver) if name == "publisher" else (receiver, publisher)
            begun = time.monotonic()
            ends[0].process.kill()
            found[name] = ends[1].says("LOST") - begun
    return found


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    streams = result["streams"].values()
    figures = {
        "datagrams lost": max(row["lost"] for row in streams),
        "median latency, ms": max(row["p50_ms"] for row in streams),
        "a killed end noticed, s": max(max(one.values()) for one in result["killed"]),
    }
    return at_most(dict(zip(figures, (0, 6.0, 2.0), strict=True)), figures)


def run(*, quick: bool) -> dict[str, Any]:
    rounds, seconds = (1, 1) if quick else (3, 5)
    load = os.getloadavg()[0]
    rows: dict[str, list[dict[str, float]]] = {name: [] for name in STREAMS}
    for _ in range(rounds):
        for name, (each, size) in STREAMS.items():
            rows[name].append(stream(each, size, seconds))
    gone = [killed() for _ in range(rounds)]
    streams = {
        name: {
            figure: float((max if figure == "lost" else np.median)([row[figure] for row in kept])) for figure in kept[0]
        }
        for name, kept in rows.items()
    }
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp("eclipse-zenoh"),
        "load_before": load,
        "load_after": os.getloadavg()[0],
        "streams": streams,
        "killed": gone,
        "ratios": {f"p50 latency of {name}, ms": row["p50_ms"] for name, row in streams.items()},
    }
