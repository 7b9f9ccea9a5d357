"""Latency of a detection's callback after the last byte of the frame that shows the touch, at rest and under load.

A patch of 5 x 5 taxels is touched at random moments and places, for 4 ms each, 80 times a second. A frame sees it in
the lines that are scanned after its moment; contact area crosses 10 taxels, and one neuron detects that at once.
The other taxels are constant, or a tenth or all of them fall and rise in every frame, below the level that counts as
loaded. The frames' datagrams are made beforehand, and a process of its own sends each frame at its end, as the
board does.

The callback is the function of `Live(say=...)`, in Python, in the thread of the readout. Times by the host's clock:

- from the last byte: from just before the last datagrams of the frame that crosses were passed to the system;
- from due: from the end of that frame by the board's clock, so that the sender's lateness counts too;
- from the first event's stamp: of the touch;
- from the touch: from the simulated moment.

Rounds over all ways in turn; a figure is the median of those of the rounds. Loaded: a busy process for each processor.
Version 1 has no promises, so that silence is estimated.

Peer: wire version 1. Unit: us, medians and 99th percentiles. Goal: at rest p50 from the last byte 60 us at 5.2 kHz, 150
us on 128 x 128, 300 us with a tenth moving, 1 ms with all; from the first event's stamp 1 ms on 128 x 128 and with
version 1; nothing lost, each touch detected, and once.
"""

from __future__ import annotations

import os
import pickle
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Array, Detection, Frames, Neuron, Readout, Tare
from taxel.encode import ContactArea
from taxel.live import Live
from taxel.simulate import Board, Version2
from taxel.wire import Registers
from taxel_benchmarks._goals import Goal, at_most
from taxel_benchmarks._rounds import printed, script, together

SEED, REST, FALLEN, TOUCHED = 20_261_121, 100, 60, 140
#: To which the stamps of version 1 are rounded down.
STAMP_US = 100
SIDE, LEVEL, TOUCH_US, EACH_US = 5, 10, 4_000.0, 12_500.0

#: The sender: each frame at its time, equally long datagrams as one train.
SEND = """
import ctypes, pickle, socket, struct, sys, time
port, path, period_us, out = int(sys.argv[1]), sys.argv[2], float(sys.argv[3]), sys.argv[4]
frames = pickle.load(open(path, "rb"))
ctypes.CDLL(None).prctl(29, 1, 0, 0, 0)
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 22)
link.connect(("127.0.0.1", port))
calls = []
for frame in frames:
    trains = []
    for datagram in frame:
        if trains and len(trains[-1][-1]) == len(trains[-1][0]) >= len(datagram) and len(trains[-1]) < 40:
            trains[-1].append(datagram)
        else:
            trains.append([datagram])
    calls.append([(b"".join(t), [(17, 103, struct.pack("=H", len(t[0])))] if len(t) > 1 else []) for t in trains])
began, sent = time.time_ns() + 50_000_000, []
for k, train in enumerate(calls):
    due = began + int(k * period_us * 1000)
    left = due - time.time_ns()
    if left > 0:
        time.sleep(left / 1e9)
    now = time.time_ns()
    for data, control in train:
        now = time.time_ns()
        link.sendmsg([data], control)
    sent.append(now)
pickle.dump((began, sent), open(out, "wb"))
"""

BUSY = "import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n    sum(range(100_000))"


@dataclass(frozen=True)
class Way:
    """Hold a case: the load, and the goal for the median from the last byte, us."""

    name: str
    side: int
    registers: Registers
    moving: float = 0.0
    goal: float | None = None
    share: float = 1.0
    """The share of the seconds that is measured, if there is very much to send."""


def preset(side: int, times: str | None, version: int) -> Registers:
    """Return a preset of this many taxels a side, with a converter channel for each step if it is large."""
    array = Array(side, side)
    if times is None:
        return Registers(array=array, wire_version=version)
    row, read, step, step_read, ramp = (int(word) for word in times.split("/"))
    return Registers(array=array, channels=64, wire_version=version).replace(
        line_period=row / 100, line_read=read / 100, step_period=step / 100, step_read=step_read / 100, ramp=ramp,
        noise_floor=22 if ramp > 1000 else 10,
    )  # fmt: skip


KHZ_1, KHZ_2 = "781/780/390/370/1095", "390/390/195/175/510"

WAYS = (
    Way("version 1, 64 x 64 at 5.2 kHz", 64, preset(64, None, 1)),
    Way("64 x 64 at 5.2 kHz", 64, preset(64, None, 2), goal=60.0),
    Way("64 x 64 at 5.2 kHz, a tenth moving", 64, preset(64, None, 2), moving=0.1),
    Way("128 x 128 at 1 kHz", 128, preset(128, KHZ_1, 2), goal=150.0),
    Way("128 x 128 at 1 kHz, a tenth moving", 128, preset(128, KHZ_1, 2), moving=0.1, goal=300.0),
    Way("128 x 128 at 1 kHz, all moving", 128, preset(128, KHZ_1, 2), moving=1.0, goal=1000.0, share=0.5),
    Way("128 x 128 at 2 kHz", 128, preset(128, KHZ_2, 2), goal=150.0),
    Way("128 x 128 at 2 kHz, a tenth moving", 128, preset(128, KHZ_2, 2), moving=0.1, goal=300.0),
)


@dataclass(frozen=True)
class Touches:
    """Hold the simulated touches: their beginning, their first event's stamp (us), and the frame that crosses."""

    begin: NDArray[np.float64]
    stamp: NDArray[np.float64]
    frame: NDArray[np.int64]


def simulated(way: Way, seconds: float) -> tuple[list[list[bytes]], Touches]:
    """Return the datagrams of each frame, and the touches in them."""
    draw, registers = np.random.default_rng(SEED), way.registers
    frame_us, line_us = registers.frame_us, registers.line_period
    board = Board(registers, Array(way.side, way.side), queue=2**20, version_2=Version2())
    count = int(seconds * 1e6 / frame_us)
    begin = np.arange(20 * EACH_US, seconds * 1e6 - 2 * EACH_US, EACH_US)
    begin += draw.uniform(0, EACH_US / 4, len(begin))
    corner = draw.integers(0, way.side - SIDE, (len(begin), 2))
    moving = np.zeros(way.side**2, bool)
    moving[draw.permutation(way.side**2)[: round(way.moving * way.side**2)]] = True
    rest, fallen = np.full(way.side**2, REST, np.uint16), np.full(way.side**2, REST, np.uint16)
    fallen[moving] = FALLEN
    stamps, crossed = np.full(len(begin), np.nan), np.full(len(begin), -1)
    frames, lines = [], np.arange(SIDE)
    for k in range(count):
        ticks = (fallen if k % 2 else rest).copy().reshape(way.side, way.side)
        first = max(0, int(np.searchsorted(begin, k * frame_us - TOUCH_US)) - 1)
        for n in range(first, int(np.searchsorted(begin, (k + 1) * frame_us))):
            y, x = corner[n]
            scanned = k * frame_us + (x + lines) * line_us
            seen = (scanned >= begin[n]) & (scanned < begin[n] + TOUCH_US)
            ticks[y : y + SIDE, x + lines[seen]] = TOUCHED
            if seen.any() and np.isnan(stamps[n]):
                stamps[n] = k * frame_us if registers.frame_sync else scanned[seen][0]
            if seen.sum() * SIDE >= LEVEL and crossed[n] < 0:
                crossed[n] = k
        frames.append(board.frame(ticks))
    return frames, Touches(begin, stamps, crossed)


def readout(array: Array) -> tuple[Readout, Tare]:
    """Return a neuron that fires where the contact area rises through the level, and the rest that it needs."""
    rest = Frames(np.full((2, *array.shape), float(REST)), [0, 1000], unit="ticks", array=array)
    encoder = ContactArea(noise_floor=22.0, levels=[LEVEL])
    # After 8 ms the input of a touch is too small for a second spike; the next touch begins 9.4 ms later or more.
    return Readout(encoder, {"contact": (Neuron(tau=1.0, refractory=8.0), [30.0, 0.0])}, array=array), Tare.take(rest)


def measured(way: Way, seconds: float, payload: Path, touches: Touches) -> dict[str, Any]:
    """Send the simulated frames of a file, and return the delay of each detection."""
    array = Array(way.side, way.side)
    judge, tare = readout(array)
    log = payload.with_suffix(".sent")
    called: list[tuple[Detection, int]] = []
    used = time.process_time()
    with Live(
        0, host="127.0.0.1", array=array, registers=way.registers, readout=judge, tare=tare,
        say=lambda said: called.append((said, time.time_ns())),
    ) as live:  # fmt: skip
        printed(SEND, live.address[1], payload, way.registers.frame_us, log)
        time.sleep(0.2)
        counters = live.stop().counters
    used = time.process_time() - used
    began, sent = pickle.loads(log.read_bytes())
    frame_us, sent_ns = way.registers.frame_us, np.array(sent)
    due_ns = began + (np.arange(len(sent)) * frame_us * 1000).astype(np.int64)
    # The board's time 0 is one frame before the first frame's datagrams are sent.
    zero_ns = began - frame_us * 1000
    late: dict[str, list[float]] = {"last byte": [], "due": [], "first event's stamp": [], "touch": []}
    found, early = set(), frame_us + STAMP_US
    for said, now in called:
        n = int(np.searchsorted(touches.begin, said.t + early)) - 1
        if n < 0 or n in found or not -early <= said.t - touches.begin[n] <= TOUCH_US:
            continue
        found.add(n)
        k = touches.frame[n]
        late["last byte"].append((now - sent_ns[k]) / 1e3)
        late["due"].append((now - due_ns[k]) / 1e3)
        late["first event's stamp"].append((now - zero_ns) / 1e3 - touches.stamp[n])
        late["touch"].append((now - zero_ns) / 1e3 - touches.begin[n])
    capture = counters["capture"]
    return {
        "touches": len(touches.begin),
        "found": len(found),
        "said_too_much": len(called) - len(found),
        "events_per_s": counters["events"] / (seconds * way.share),
        "lost": {
            "by the kernel": capture["dropped_by_kernel"],
            "by the queue": capture["dropped_by_queue"],
            "before the readout": counters["events_dropped"],
            "on the way": counters["wire_v2"]["missing"],
        },
        "late": counters["late"],
        "wrong": counters["wrong"],
        "callback_us_from": {name: quantiles(values) for name, values in late.items()},
        "sender_late_us": quantiles(((sent_ns - due_ns) / 1e3).tolist()),
        "cores": used / (seconds * way.share),
    }


def quantiles(values: list[float]) -> dict[str, float]:
    """Return median, 99 %, 99.9 % and maximum, and the number below 0, which two clocks or an estimate can cause."""
    if not values:
        return {"count": 0}
    p50, p99, p999, most = np.percentile(values, [50, 99, 99.9, 100]).tolist()
    return {"count": len(values), "p50": p50, "p99": p99, "p99.9": p999, "max": most,
            "below 0": int(np.sum(np.array(values) < 0))}  # fmt: skip


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    rest = result["results"]["at rest"]
    limits = {f"{way.name}: p50 from the last byte, us": way.goal for way in WAYS if way.goal is not None}
    figures = {f"{name}: p50 from the last byte, us": p50(row, "last byte") for name, row in rest.items()}
    for name in ("128 x 128 at 2 kHz", "version 1, 64 x 64 at 5.2 kHz"):
        limits[f"{name}: p50 from the first event's stamp, us"] = 1000
        figures[f"{name}: p50 from the first event's stamp, us"] = p50(rest[name], "first event's stamp")
    none = {
        "lost at rest": sum(sum(row["lost"].values()) for row in rest.values()),
        "touches not detected at rest": sum(row["touches"] - row["found"] for row in rest.values()),
        "detections at rest that are no touch's first": sum(row["said_too_much"] for row in rest.values()),
    }
    return at_most(limits, figures) + at_most(dict.fromkeys(none, 0), none)


def p50(row: Mapping[str, Any], since: str) -> float:
    """Return the median of a way's callbacks, us, counted from `since`."""
    return float(row["callback_us_from"][since].get("p50", float("nan")))


def run(*, quick: bool) -> dict[str, Any]:
    seconds, rounds, load = (1.0, 1, os.getloadavg()[0]) if quick else (2.0, 5, os.getloadavg()[0])
    rows: dict[str, dict[str, list[dict[str, Any]]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        made = {}
        for k, way in enumerate(WAYS):
            frames, touches = simulated(way, seconds * way.share)
            made[way.name] = Path(folder) / f"{k}.pickle", touches
            made[way.name][0].write_bytes(pickle.dumps(frames))
            del frames
        for state in ("at rest", "loaded"):
            rows[state] = {way.name: [] for way in WAYS}
            crowd = [script(BUSY) for _ in range(os.cpu_count() or 1) if state == "loaded"]
            try:
                for _ in range(rounds):
                    for way in WAYS:
                        rows[state][way.name].append(measured(way, seconds, *made[way.name]))
            finally:
                for one in crowd:
                    one.kill()
                    one.communicate()
    results = {state: {name: together(of) for name, of in ways.items()} for state, ways in rows.items()}
    ratio, (one, two) = "version 1's p50 over version 2's, 64 x 64", [rows["at rest"][way.name] for way in WAYS[:2]]
    turns = [p50(a, "last byte") / p50(b, "last byte") for a, b in zip(one, two, strict=True)]
    low, middle, high = np.percentile(turns, [25, 50, 75]).tolist()
    since = "last byte", "first event's stamp"
    return {
        "rounds": rounds,
        "results": results,
        "ratios": {ratio: middle},
        "spread": {ratio: [low, high]}
        | {
            f"{name}: p50 from the {what}, us": row["callback_us_from"][what].get("p50 quartiles")
            for name, row in results["at rest"].items()
            for what in since
        },
        # Other processes determine the tails, and if they are as many as the processors, the medians too.
        "stable": bool(load < 0.5 * (os.cpu_count() or 1)),
    }
