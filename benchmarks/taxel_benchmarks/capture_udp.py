"""CPU time and losses of receiving, and latency from the kernel's stamp to decoded.

Sender and receiver share this machine, over loopback, the sender a process of its own. *The worst case*: the sender
sends as the board does, each 192 us the events of a frame, in datagrams of at most 280 words, which the kernel cuts
out of one train (UDP_SEGMENT). *The portable calls*, which every system has (`TAXEL_CAPTURE=portable`), receive the
same, one call a datagram. *The largest array*: 128 x 128 taxels by version 2 of the wire, all of them in each frame,
while they are recorded. `highest` is the highest rate of `LADDER` that each way received without a loss. Latencies are
from the kernel's stamp to the end of decoding in the pipeline's thread; the cores are the CPU time of its threads.
`latency` has what a slow sensor's events take to the callback.

Peer: none. Unit: cores; datagrams lost; us. Goal: 21.3 million events/s without a loss in .15 core (receiving alone
.05), p50 below 50 us and p99 below 1 ms; 10 million by the portable calls.
"""

from __future__ import annotations

import json
import os
import pickle
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from taxel import Array, Events
from taxel.live import Live
from taxel.simulate import Board, Version2
from taxel.wire import Registers, encode
from taxel_benchmarks._goals import Goal, at_least, at_most
from taxel_benchmarks._rounds import printed, thread_seconds, together

#: The sensor's worst case, changes a second: 4096 taxels in each frame of 192 us; and that of 128 x 128 taxels.
WORST, LARGEST = 21.3e6, 85.3e6
FRAME_US, DATAGRAM_WORDS = 192.0, 280
#: The worst case as the board sends it, with a send call a datagram, and while another thread records.
WAYS: dict[str, dict[str, bool]] = {
    "worst_case": {},
    "worst_case_without_segments": {"segment": False},
    "worst_case_recorded": {"record": True},
    "worst_case_portable": {"portable": True},
    "largest_recorded": {"record": True, "version_2": True},
}
#: Rates that are tried for the highest without a loss, changes a second.
LADDER = (5e6, 1e7, 1.5e7, 2.13e7, 3e7, 4.26e7, 6e7, 8e7)
SEND = """
import json, pickle, sys
from taxel.live import send
port, path, each, seconds, segment = int(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), sys.argv[5]
print(json.dumps(send(pickle.load(open(path, "rb")), port=port, each=each, seconds=seconds, segment=segment == "1")))
"""


def datagrams(rate: float, frames: int) -> tuple[list[bytes], int]:
    """Return the datagrams of `frames` frames at `rate` changes a second, and their number a frame."""
    changes = max(1, round(rate * FRAME_US / 1e6))
    taxel = np.arange(changes * frames) % 4096
    t = np.repeat(np.arange(frames) * 192 // 100 * 100, changes)
    events = Events(t, taxel % 64, taxel // 64, np.ones(len(t), bool), array=Array(64, 64))
    words = encode(events)
    each = -(-changes // DATAGRAM_WORDS)
    cut: list[bytes] = []
    for frame in range(frames):
        part = words[frame * changes * 5 : (frame + 1) * changes * 5]
        cut += [part[k : k + DATAGRAM_WORDS * 5] for k in range(0, len(part), DATAGRAM_WORDS * 5)]
    return cut, each


def of_version_2(frames: int) -> tuple[list[bytes], int]:
    """Return the datagrams of `frames` frames of 128 x 128 taxels that all change, and their number a frame."""
    array = Array(128, 128)
    registers = Registers(array=array, wire_version=2, noise_floor=0)
    board = Board(registers, array, version_2=Version2(states_us=0))
    values = [np.full((128, 128), ticks, np.uint16) for ticks in (100, 160)]
    board.frame(values[1])
    each = [board.frame(values[k % 2]) for k in range(frames)]
    return [datagram for frame in each for datagram in frame], len(each[0])


@contextmanager
def calls(*, portable: bool) -> Iterator[None]:
    """Select the system's calls by which a `Live` receives that is made meanwhile."""
    if portable:
        os.environ["TAXEL_CAPTURE"] = "portable"
    try:
        yield
    finally:
        os.environ.pop("TAXEL_CAPTURE", None)


def ours(
    rate: float,
    seconds: float,
    scratch: Path,
    *,
    segment: bool = True,
    record: bool = False,
    portable: bool = False,
    version_2: bool = False,
) -> dict[str, Any]:
    """Receive and decode the datagrams of a sender of `rate` changes a second.

    One thread receives and decodes; while it records, another one receives. Datagrams of version 2 are numbered, so
    that each is sent once.
    """
    cut, each = of_version_2(int(seconds / FRAME_US * 1e6)) if version_2 else datagrams(rate, 4 if rate > 1e6 else 64)
    payload = scratch / f"{rate:.0f}.pickle"
    payload.write_bytes(pickle.dumps(cut))
    before = thread_seconds()
    file = scratch / "record.mcap" if record else None
    with calls(portable=portable):
        made = Live(0, host="127.0.0.1", record=file, overwrite=True, array=Array(128, 128) if version_2 else None)
    with made as live:
        port = live.address[1]
        said = printed(SEND, port, payload, each, seconds, "1" if segment else "0")
        time.sleep(0.2)
        after = thread_seconds()
        begun = time.perf_counter()
        counters = live.stop().counters
        stopped = time.perf_counter() - begun
    sent, capture = json.loads(said), counters["capture"]
    if not portable:
        assert sent["messages"] == capture["messages"] + capture["dropped_by_kernel"], "the sum at the socket closes"
    assert capture["datagrams"] == counters["decoded"] + capture["dropped_by_queue"], "the sum behind it closes"
    delay = counters["decode_latency"]

    def cores(thread: str) -> float:
        return (after.get(thread, 0.0) - before.get(thread, 0.0)) / seconds

    return {
        "asked_events_per_s": rate,
        "sent_events_per_s": rate * sent["datagrams"] / len(cut) if version_2 else sent["bytes"] / 5 / seconds,
        "sent_mb_per_s": sent["bytes"] / 1e6 / seconds,
        "segmenting": sent["segmenting"],
        "gro": capture["gro"],
        "lost_datagrams": sent["datagrams"] - counters["decoded"],
        "dropped_by_kernel_messages": capture["dropped_by_kernel"],
        "dropped_by_queue": capture["dropped_by_queue"],
        "receive_cores": cores("taxel-receive") if record else None,
        "cores": cores("taxel-receive") + cores("taxel-decode"),
        "latency": {name: delay[f"{name}_us"] for name in ("p50", "p99", "max")},
        "stop_s": stopped,
    }


def highest(seconds: float, scratch: Path, *, portable: bool) -> dict[str, Any]:
    """Return the highest rate that was sent and received without a loss, with its cores, of a rising ladder."""
    best: dict[str, Any] = {}
    for rate in LADDER:
        row = ours(rate, seconds, scratch, portable=portable)
        if row["lost_datagrams"] == 0 and row["sent_events_per_s"] >= 0.98 * rate:
            best = {name: row[name] for name in ("sent_events_per_s", "cores")}
    return best


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    worst = result["worst_case"]
    sent = {
        "events sent a second": worst["sent_events_per_s"],
        "events/s received by the portable calls without a loss": result["highest"]["portable"]["sent_events_per_s"],
    }
    figures = {
        "datagrams lost at 21.3 M events/s": worst["lost_datagrams"],
        "receiving alone, while another thread records, cores": result["worst_case_recorded"]["receive_cores"],
        "receiving and decoding, cores": worst["cores"],
        "p50 at 21.3 M events/s, us": worst["latency"]["p50"],
        "p99 at 21.3 M events/s, us": worst["latency"]["p99"],
    }
    return at_least(dict(zip(sent, (0.98 * WORST, 0.98e7), strict=True)), sent) + at_most(
        dict(zip(figures, (0, 0.05, 0.15, 50, 1000), strict=True)), figures
    )


def run(*, quick: bool) -> dict[str, Any]:
    rounds, seconds = (1, 0.5) if quick else (5, 2.0)
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        ladder = {name: highest(seconds, scratch, portable=name == "portable") for name in ("usual", "portable")}
        turns = [
            {
                name: ours(LARGEST if "version_2" in how else WORST, seconds, scratch, **how)
                for name, how in WAYS.items()
            }
            for _ in range(rounds)
        ]
    return {name: together([turn[name] for turn in turns]) for name in WAYS} | {"highest": ladder}
