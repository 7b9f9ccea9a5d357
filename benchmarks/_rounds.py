"""Measuring: peers in one run, rounds interleaved, CPU time of the working thread."""

from __future__ import annotations

import os
import platform
import subprocess
import time
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

#: A ratio is not stable if the interquartile range of the rounds is larger than this share of the median.
WIDEST = 0.15


def measure(
    runs: Mapping[str, Callable[[], Any]],
    *,
    rounds: int,
    work: float = 1.0,
    clock: int = time.CLOCK_THREAD_CPUTIME_ID,
) -> dict[str, dict[str, Any]]:
    """Run each once to warm up, then all of them `rounds` times in turn; return seconds and `work` per second.

    Parameters
    ----------
    runs : by name, called without arguments
    rounds : int
    work : float
        Amount of work of one call, in the unit of the rate: events, spikes ...
    clock : int
        CPU time of this thread; of the process (``CLOCK_PROCESS_CPUTIME_ID``) if peers have threads of their own.
    """
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    walls: dict[str, list[float]] = {name: [] for name in runs}
    for done in range(rounds + 1):
        for name, run in runs.items():
            wall, cpu = time.perf_counter(), time.clock_gettime(clock)
            run()
            cpu, wall = time.clock_gettime(clock) - cpu, time.perf_counter() - wall
            if done:
                seconds[name].append(cpu)
                walls[name].append(wall)
    return {name: _summary(seconds[name], walls[name], work) for name in runs}


def _summary(seconds: list[float], walls: list[float], work: float) -> dict[str, Any]:
    low, middle, high = np.percentile(seconds, [25, 50, 75])
    return {
        "cpu_s": {"median": middle, "quartiles": [low, high], "rounds": len(seconds)},
        "wall_s": {"median": float(np.median(walls))},
        "rate": work / middle,
        "stable": bool(high - low <= WIDEST * middle),
    }


def ratio(results: Mapping[str, Mapping[str, Any]], ours: str, peer: str) -> float:
    """Return how many times faster ours is than the peer, by medians."""
    return float(results[ours]["rate"] / results[peer]["rate"])


def thread_seconds() -> dict[str, float]:
    """Return the CPU time of each named thread of this process so far, s."""
    seconds: dict[str, float] = {}
    for task in Path("/proc/self/task").iterdir():
        name = (task / "comm").read_text().strip()
        seconds[name] = seconds.get(name, 0.0) + int((task / "schedstat").read_text().split()[0]) / 1e9
    return seconds


def stamp(*packages: str) -> dict[str, Any]:
    """Return machine, versions and commit; `taxel bench` writes a result of a clean commit only."""
    versions = {"python": platform.python_version()}
    versions |= {package: version(package) for package in ("taxel", "numpy", *packages)}
    ran = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parent,
    )
    return {
        "machine": {
            "cpu": processor(),
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "system": platform.platform(),
        },
        "versions": versions,
        "commit": ran.stdout.strip() or "unknown",
    }


def processor() -> str:
    """Return the processor's model and its widest vectors, as models of one name have AVX-512 or not."""
    about = dict(map(str.strip, line.partition(":")[::2]) for line in _read("/proc/cpuinfo"))
    flags = about.get("flags", "").split()
    widest = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), None)
    return ", ".join(filter(None, (about.get("model name", platform.processor()), widest)))


def version(package: str) -> str:
    """Return the version of an installed package."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "in the checkout" if package == "taxel" else "absent"


def _read(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
