"""CPU time and losses of receiving, and latency from sending to decoded, beside faery's UDP receiver.

Sender and receiver share this machine, over loopback, the sender a process of its own. *The worst case*: the sender
sends as the board does, each 192 us the events of a frame, in datagrams of at most 280 words, which the kernel cuts
out of one train (UDP_SEGMENT). *The portable calls*, which every system has (`TAXEL_CAPTURE=portable`), receive the
same, one call a datagram. *The largest array*: 128 x 128 taxels by version 2 of the wire, all of them in each frame,
while they are recorded. `highest` is the highest rate of `LADDER` that each way received without a loss. *Beside
faery*: both receive from the same sender, paced alike, one send call a datagram of 111 events, ours in words of 5
bytes, faery's in its own format of 13 ("t64_x16_y16_on8"); in turn. `DOES` says what each latency is; the cores are
the CPU time of the receiving process. faery looks for packets every 20 ms; *a socket loop* is the plain Python
receiver: `recv`, and NumPy's view of faery's format, which asks for no decoding.

Peer: faery's UDP receiver, and a socket loop. Unit: us from sending to decoded; cores; datagrams lost. Goal: 21.3
million events/s without a loss in .15 core (receiving alone .05), 10 million by the portable calls; beside faery up to
1e7 events/s p50 below 50 us, p99 below 1 ms.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
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
from taxel_benchmarks._peer import missing
from taxel_benchmarks._rounds import stamp, thread_seconds

#: The sensor's worst case, changes a second: 4096 taxels in each frame of 192 us; and that of 128 x 128 taxels.
WORST, LARGEST = 21.3e6, 85.3e6
FRAME_US, DATAGRAM_WORDS = 192.0, 280
RATES = (1e4, 1e6, 1e7)
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
#: Events a datagram beside faery.
ALIKE = 111
DOES = {
    "taxel": "from the kernel's stamp to the end of decoding in the pipeline's thread, and the time of the send call",
    "faery": "from the clock just before the send call to the packet of events in Python",
    "socket loop": "the same, of one thread that does nothing else",
}

SEND = """
import json, pickle, sys
from taxel.live import send
port, path, each, seconds, segment = int(sys.argv[1]), sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), sys.argv[5]
print(json.dumps(send(pickle.load(open(path, "rb")), port=port, each=each, seconds=seconds, segment=segment == "1")))
"""

#: Sends datagrams of 111 events: words of a file to ours, or faery's format with the time of each send.
SEND_ALIKE = """
import json, pickle, socket, sys, time
import numpy as np
port, rate, seconds, path = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
words = pickle.load(open(path, "rb")) if path else None
events = np.zeros(111, np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")]))
events["x"], events["y"] = np.arange(111) % 64, np.arange(111) // 64
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
begun, calls = time.perf_counter(), []
while (passed := time.perf_counter() - begun) < seconds:
    due = int(passed * rate / 111)
    if len(calls) >= due:
        time.sleep(min(111 / rate, 192e-6))
    while len(calls) < due:
        events["t"] = time.time_ns() // 1000
        data = words or events.tobytes()
        before = time.perf_counter_ns()
        link.sendto(data, ("127.0.0.1", port))
        calls.append(time.perf_counter_ns() - before)
if not words:
    time.sleep(0.5)
    events["on"] = True
    for _ in range(20):
        link.sendto(events.tobytes(), ("127.0.0.1", port))
        time.sleep(0.02)
p50, p99, most = np.percentile(calls, [50, 99, 100]) / 1e3
print(json.dumps({"datagrams": len(calls), "call_us": {"p50": p50, "p99": p99, "max": most}}))
"""

#: How each peer names its packets of events, from the port on.
FAERY = """
import faery
stream = iter(faery.events_stream_from_udp((64, 64), ("127.0.0.1", port), format="t64_x16_y16_on8"))
"""
LOOP = """
import socket
kind = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
link.bind(("127.0.0.1", port))
stream = (np.frombuffer(link.recv(65536), kind) for _ in iter(int, 1))
"""
PEERS = {"faery": "faery"}
RECEIVE = """
import json, os, sys, time
import numpy as np
port = int(sys.argv[1])
late, events = [], 0
{stream}
print("ready", flush=True)
begun = time.process_time()
for packet in stream:
    now = time.time_ns() // 1000
    if packet["on"].any():
        break
    events += len(packet)
    late.append(now - int(packet["t"][0]))
p50, p99 = np.percentile(late, [50, 99]) if late else (0, 0)
print(json.dumps({{"events": events, "p50_us": float(p50), "p99_us": float(p99), "max_us": float(max(late, default=0)),
                  "cpu_s": time.process_time() - begun}}), flush=True)
os._exit(0)
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
        arguments = [str(port), str(payload), str(each), str(seconds), "1" if segment else "0"]
        sender = subprocess.run([sys.executable, "-c", SEND, *arguments], capture_output=True, text=True, check=True)
        time.sleep(0.2)
        after = thread_seconds()
        begun = time.perf_counter()
        counters = live.stop().counters
        stopped = time.perf_counter() - begun
    sent, capture = json.loads(sender.stdout), counters["capture"]
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


def send_alike(port: int, rate: float, seconds: float, path: Path | str = "") -> dict[str, Any]:
    """Send datagrams of 111 events from a process of its own, of words if their file is given."""
    arguments = [str(port), str(rate), str(seconds), str(path)]
    done = subprocess.run([sys.executable, "-c", SEND_ALIKE, *arguments], capture_output=True, text=True, check=True)
    sent: dict[str, Any] = json.loads(done.stdout)
    return sent


def beside_faery(rate: float, seconds: float, scratch: Path) -> dict[str, Any]:
    """Receive and decode what is sent to faery too, in words."""
    taxel = np.arange(ALIKE)
    events = Events(0 * taxel, taxel % 64, taxel // 64, np.ones(ALIKE, bool), array=Array(64, 64))
    words = scratch / "alike.pickle"
    words.write_bytes(pickle.dumps(encode(events)))
    with Live(0, host="127.0.0.1") as live:
        before = time.process_time()
        sent = send_alike(live.address[1], rate, seconds, words)
        time.sleep(0.2)
        used = time.process_time() - before
        counters = live.stop().counters
    delay, call = counters["decode_latency"], sent["call_us"]
    return {
        "sent_events_per_s": ALIKE * sent["datagrams"] / seconds,
        "arrived": counters["decoded"] / sent["datagrams"],
        "cores": used / seconds,
        "latency": {name: delay[f"{name}_us"] + call[name] for name in ("p50", "p99", "max")},
    }


def received(stream: str, rate: float, seconds: float, port: int) -> dict[str, Any]:
    """Receive with a peer the datagrams of a sender of `rate` events a second, in faery's format."""
    code = RECEIVE.format(stream=stream)
    receiver = subprocess.Popen([sys.executable, "-c", code, str(port)], stdout=subprocess.PIPE, text=True)
    assert receiver.stdout is not None
    receiver.stdout.readline()
    time.sleep(0.3)
    sent = send_alike(port, rate, seconds)
    try:
        printed, _ = receiver.communicate(timeout=10 + seconds)
    except subprocess.TimeoutExpired:
        receiver.kill()
        receiver.communicate()
        return {"failed": "its receiver never got the end mark"}
    came = json.loads(printed.splitlines()[-1])
    return {
        "sent_events_per_s": ALIKE * sent["datagrams"] / seconds,
        "arrived": came["events"] / (ALIKE * sent["datagrams"]),
        "cores": came["cpu_s"] / seconds,
        "latency": {"p50": came["p50_us"], "p99": came["p99_us"], "max": came["max_us"]},
    }


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    worst, slowest = result["worst_case"], result["latency_us"].values()
    figures = {
        "datagrams lost at 21.3 M events/s": worst["lost_datagrams"],
        "receiving alone, while another thread records, cores": result["worst_case_recorded"]["receive_cores"],
        "receiving and decoding, cores": worst["cores"],
        "p50 up to 1e7 events/s, us": max(row["taxel"]["p50"]["median"] for row in slowest),
        "p99 up to 1e7 events/s, us": max(row["taxel"]["p99"]["median"] for row in slowest),
    }
    sent = {"events sent a second": worst["sent_events_per_s"]}
    portable = {
        "events/s received by the portable calls without a loss": result["highest"]["portable"]["sent_events_per_s"]
    }
    return (
        at_least({"events sent a second": 0.98 * WORST}, sent)
        + at_least(dict.fromkeys(portable, 0.98e7), portable)
        + at_most(dict(zip(figures, (0, 0.05, 0.15, 50, 1000), strict=True)), figures)
    )


def run(*, quick: bool) -> dict[str, Any]:
    rounds, seconds = (1, 0.5) if quick else (5, 2.0)
    load, absent = os.getloadavg()[0], missing(PEERS)
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        worst: dict[str, list[dict[str, Any]]] = {name: [] for name in WAYS}
        streams = {name: of for name, of in {"faery": FAERY, "socket loop": LOOP}.items() if name not in absent}
        rows: dict[float, dict[str, list[dict[str, Any]]]] = {
            rate: {name: [] for name in ("taxel", *streams)} for rate in RATES
        }
        ladder = {name: highest(seconds, scratch, portable=name == "portable") for name in ("usual", "portable")}
        for turn in range(rounds):
            for name, how in WAYS.items():
                rate = LARGEST if "version_2" in how else WORST
                worst[name].append(ours(rate, seconds, scratch, **how))
            for k, rate in enumerate(RATES):
                rows[rate]["taxel"].append(beside_faery(rate, seconds, scratch))
                for n, (name, stream) in enumerate(streams.items()):
                    rows[rate][name].append(received(stream, rate, seconds, 42_000 + 100 * n + 10 * turn + k))
    latency = {
        f"{rate:.0e} events/s": {name: _spread(row) for name, row in peers.items()} for rate, peers in rows.items()
    }
    turns = {
        f"{name}'s {what} over ours at {rate:.0e} events/s": of
        for rate, all_of in rows.items()
        for name in streams
        for what, find in (("p50", lambda row: row["latency"]["p50"]), ("cores", lambda row: row["cores"]))
        if (of := [find(b) / find(a) for a, b in zip(all_of["taxel"], all_of[name], strict=True) if "latency" in b])
    }
    p50s = [row["latency"]["p50"] for peers in rows.values() for row in peers["taxel"]]
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp("faery"),
        "left out": absent,
        "load_before": load,
        "load_after": os.getloadavg()[0],
        **{name: _together(of) for name, of in worst.items()},
        "highest": ladder,
        "does": DOES,
        "latency_us": latency,
        "ratios": {name: float(np.median(of)) for name, of in turns.items()},
        "spread": {name: np.percentile(of, [25, 75]).tolist() for name, of in turns.items()},
        "stable": bool(load < os.cpu_count() and max(p50s) < 3 * min(p50s)),
    }


def _together(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the median of every number over the rounds, and the sum of what was lost."""
    together: dict[str, Any] = {}
    for name, first in rows[0].items():
        values = [row[name] for row in rows]
        if isinstance(first, dict):
            together[name] = _together(values)
        elif first is None or isinstance(first, bool):
            together[name] = first
        else:
            lost = name.startswith(("lost", "dropped"))
            together[name] = sum(values) if lost else float(np.median(values))
    return together


def _spread(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return median and quartiles over the rounds of each latency, us, and of the share that arrived."""
    rows = [row for row in rows if "latency" in row]
    if not rows:
        return {"failed": "no round came to its end"}

    def over(values: list[float]) -> dict[str, Any]:
        low, middle, high = np.percentile(values, [25, 50, 75])
        return {"median": float(middle), "quartiles": [float(low), float(high)]}

    spread: dict[str, Any] = {name: over([row["latency"][name] for row in rows]) for name in ("p50", "p99", "max")}
    return spread | {name: over([row[name] for row in rows]) for name in ("sent_events_per_s", "arrived", "cores")}
