"""Frames that a sensor prints: 1000 lines a second of 256 numbers, read, recorded, read out and sent to a page.

A process of its own prints lines, each a frame of 16 x 16 counts with noise and touches, into a pipe, at the rate. This
process reads them live, records them to a .mcap on the disk, runs a readout of level crossings on all taxels, and
serves the panel to a client in another process, which reads every frame. CPU is of this process, all threads; a wall
second has one core second.

Peer: none. Unit: cores. Goal: .15 core for all of it,
nothing lost, each line a frame.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel import Array, Neuron, Readout
from taxel.encode import LevelCrossing
from taxel.live import Live
from taxel.panel import Panel
from taxel_benchmarks._goals import Goal
from taxel_benchmarks._rounds import ALL, script

SIDE, RATE, SEED = 16, 1000, 20_261_127
#: The module that the client of the page needs.
PEERS = {ALL: "websockets"}

#: Prints lines at their times; a late line is printed at once.
SEND = """
import sys, time
import numpy as np
side, rate, count, seed = map(int, sys.argv[1:])
draw = np.random.default_rng(seed)
lines = []
for k in range(rate):
    frame = draw.integers(0, 4, (side, side))
    if k % 500 > 300:
        frame[4:9, 4:9] += 400
    lines.append((",".join(map(str, frame.reshape(-1))) + "\\n").encode())
out, began = sys.stdout.buffer, time.perf_counter()
for k in range(count):
    left = began + k / rate - time.perf_counter()
    if left > 0:
        time.sleep(left)
    out.write(lines[k % rate])
    out.flush()
"""

#: Reads the frames of a panel until it ends; prints how many there were.
WATCH = """
import json, sys, time
from urllib.parse import parse_qs, urlsplit
from websockets.sync.client import connect
url, count, until = urlsplit(sys.argv[1]), 0, time.monotonic() + float(sys.argv[2])
protocols = ["taxel.panel.1", "token." + parse_qs(url.fragment)["token"][0]]
with connect(
    f"ws://{url.netloc}/socket", origin=f"http://{url.netloc}", subprotocols=protocols, max_size=None
) as socket:
    socket.send(json.dumps({"type": "credit", "n": 2}))
    for message in socket:
        if isinstance(message, bytes):
            count += 1
            socket.send(json.dumps({"type": "credit", "n": 1}))
        if time.monotonic() > until:
            break
print(count)
"""


def readout() -> Readout:
    """Return a readout of every taxel, which fires in each touch."""
    weights = np.tile([1.0, 0.0], SIDE * SIDE)
    return Readout(LevelCrossing([100.0]), {"contact": (Neuron(tau=2.0), weights, 2.5)}, array=Array(SIDE, SIDE))


def live(seconds: float, folder: Path) -> dict[str, Any]:
    """Read, record, read out and show lines for so long; return cores, counts and latency."""
    count = int(seconds * RATE)
    lines, path = folder / "lines", folder / "lines.mcap"
    os.mkfifo(lines)
    found: list[taxel.Detection] = []
    reading = os.open(lines, os.O_RDWR)  # so that the sender does not wait
    with lines.open("wb", buffering=0) as pipe, script(SEND, SIDE, RATE, count, SEED, stdout=pipe):
        source = f"lines:{lines},array={SIDE}x{SIDE},rate={RATE}"
        with (
            Live(readout=readout(), sources=source, record=path, say=found.append) as pipeline,
            Panel(pipeline, folder=folder) as panel,
        ):
            with script(WATCH, panel.url, seconds) as client:
                while pipeline.counters["frames"] < RATE // 2:
                    time.sleep(0.01)
                before, wall, cpu = pipeline.counters, time.perf_counter(), time.process_time()
                time.sleep(seconds * 0.7)
                cores = (time.process_time() - cpu) / (time.perf_counter() - wall)
                passed, after = time.perf_counter() - wall, pipeline.counters
                while pipeline.counters["frames"] < count:
                    time.sleep(0.05)
                shown = int(client.communicate()[0])
            summary = pipeline.stop()
    os.close(reading)
    recorded = taxel.open(path)
    return {
        "cores": cores,
        "lines_per_s": (after["lines"]["lines"] - before["lines"]["lines"]) / passed,
        "frames": summary.counters["frames"],
        "frames_missing": count - summary.counters["frames"],
        "lost": summary.counters["capture"]["dropped_by_queue"] + summary.counters["events_dropped"],
        "recorded": len(recorded.frames()),
        "detections": len(found),
        "page_frames_per_s": shown / seconds,
        "line_to_frame_us": summary.counters["decode_latency"],
        "file_mb": path.stat().st_size / 1e6,
        "verdict": str(summary.verdict),
    }


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals."""
    if "live" not in result:
        return []
    of = result["live"]
    return [
        Goal("cores for all of it", of["cores"], 0.15, at_most=True),
        Goal("lines that are no frame, or lost", of["frames_missing"] + of["lost"], 0, at_most=True),
        Goal("frames recorded, of all", of["recorded"] / max(1, of["frames"]), 1.0),
    ]


def run(*, quick: bool) -> dict[str, Any]:
    """Return the result."""
    with tempfile.TemporaryDirectory() as folder:
        measured = live(3.0 if quick else 20.0, Path(folder))
    return {"live": measured, "ratios": {".15 core over all of ours": 0.15 / measured["cores"]}}
