"""Time and memory of opening, listing, cutting and converting a large .mcap, beside decoding its datagrams.

Datagrams of 280 words (1400 bytes), change and intensity alternating. Each step runs in a process of its own; its peak
memory and CPU time are its result, the memory less that of a process that only imports taxel. "listed" reads notes,
registers, losses and everything else besides the events, and no datagram; nor does "cut", before its events are read.

Peer: decoding the same datagrams. Unit: CPU seconds and MB of memory. Goal: opening, listing and cutting, which
read no datagram, a quarter of either at most.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from taxel.recording.files.mcap import RecordingWriter
from taxel_benchmarks._goals import Goal, at_most
from taxel_benchmarks._opening import STEPS
from taxel_benchmarks._rounds import compared, summary
from taxel_benchmarks.recording_write import BYTES, HEADER, datagrams


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    parts = [f"{name} / decoded, {of}" for name in ("opened", "listed", "cut") for of in ("time", "memory")]
    return at_most(dict.fromkeys(parts, 0.25), result["ratios"])


def run(*, quick: bool) -> dict[str, Any]:
    n, rounds = (3_500, 2) if quick else (70_000, 5)
    raw = datagrams(n)
    found: dict[str, list[list[float]]] = {name: [] for name in STEPS}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mcap"
        writer = RecordingWriter(path, HEADER, "none", True)
        offsets = np.arange(n + 1, dtype=np.int64) * BYTES
        writer.datagrams(np.arange(n, dtype=np.int64) * 13_100, np.arange(n, dtype=np.uint64), offsets, raw)
        writer.finish("{}")
        for _ in range(rounds):
            for name in STEPS:
                command = [sys.executable, "-P", "-m", "taxel_benchmarks._opening", name, path, folder]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                found[name].append([float(value) for value in done.stdout.split()])
    none = statistics.median(one[2] for one in found["imported"])
    results = {
        name: {
            **summary([one[0] for one in rows], [one[1] for one in rows]),
            "peak_mb": statistics.median(one[2] for one in rows) - none,
        }
        for name, rows in found.items()
    }
    steps = ("opened", "listed", "cut", "sliced", "cut, its events", "copied")
    ratios, spread = compared(results, {f"{name} / decoded, time": ("decoded", name) for name in steps})
    peak = max(1.0, results["decoded"]["peak_mb"])
    ratios |= {f"{name} / decoded, memory": results[name]["peak_mb"] / peak for name in steps}
    return {"bytes": raw.size, "results": results, "ratios": ratios, "spread": spread}
