"""Measuring: ours and peers in one run, in turn, by the CPU time of the process; BLAS in one thread.

``python -m taxel_benchmarks._rounds NAME SIZE`` runs a benchmark, and prints its result.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import scipy.linalg  # noqa: F401  its pool of threads can be limited once it is loaded
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from taxel import Error, ProblemError

#: What needs all the modules of its line, without which nothing can be measured.
ALL = "all of it"
#: The packages of modules that have another name.
PACKAGES = {"sklearn": "scikit-learn"}
#: A ratio is not stable if the interquartile range of the rounds is larger than this share of the median.
WIDEST = 0.15


def measure(
    runs: Mapping[str, Callable[[], Any]], *, rounds: int, work: float = 1.0, warm_up: bool = True
) -> dict[str, dict[str, Any]]:
    """Run all of them `rounds` times in turn, BLAS in one thread; return seconds and `work` per second.

    The CPU time is that of the process, of ours and of peers: threads that either starts count.

    Parameters
    ----------
    runs : by name, called without arguments
    rounds : int
    work : float
        Amount of work of one call, in the unit of the rate: events, spikes ...
    warm_up : bool
        Whether each runs once before; calls of minutes need none.
    """
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    walls: dict[str, list[float]] = {name: [] for name in runs}
    for done in range(0 if warm_up else 1, rounds + 1):
        with threadpool_limits(1):  # each time, as a first call may load libraries
            for name, run in runs.items():
                wall, cpu = time.perf_counter(), time.process_time()
                run()
                cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
                if done:
                    seconds[name].append(cpu)
                    walls[name].append(wall)
    return {name: summary(seconds[name], walls[name], work) for name in runs}


def summary(seconds: Sequence[float], walls: Sequence[float], work: float = 1.0) -> dict[str, Any]:
    """Return median, quartiles and every round of CPU seconds, the median of wall seconds, and the rate."""
    low, middle, high = np.percentile(seconds, [25, 50, 75]).tolist()
    return {
        "cpu_s": {"median": middle, "quartiles": [low, high], "rounds": list(seconds)},
        "wall_s": {"median": float(np.median(walls))},
        "rate": work / middle,
        "stable": high - low <= WIDEST * middle,
    }


def compared(
    results: Mapping[str, Mapping[str, Any]], pairs: Mapping[str, tuple[str, str]]
) -> tuple[dict[str, float], dict[str, list[float]]]:
    """Return how many times less CPU time ours took than the peer: medians over the rounds, and quartiles.

    Parameters
    ----------
    results : what `measure` returned
    pairs : by the ratio's name, the names of ours and of the peer
    """

    def rates(name: str) -> NDArray[np.float64]:
        of = results[name]
        return of["rate"] * of["cpu_s"]["median"] / np.array(of["cpu_s"]["rounds"])

    ratios, spread = {}, {}
    for name, (ours, peer) in pairs.items():
        # Both of a round ran one after the other, so that what slows the machine for a while slows both.
        low, ratios[name], high = np.percentile(rates(ours) / rates(peer), [25, 50, 75]).tolist()
        spread[name] = [low, high]
    return ratios, spread


def measured(
    runs: Mapping[str, Callable[[], Any]],
    pairs: Mapping[str, tuple[str, str]] | None = None,
    *,
    rounds: int,
    work: float = 1.0,
    warm_up: bool = True,
) -> dict[str, Any]:
    """Return times of runs (as `measure`), ratios of those `pairs` that ran, and whether times are stable."""
    results = measure(runs, rounds=rounds, work=work, warm_up=warm_up)
    there = {name: pair for name, pair in (pairs or {}).items() if set(pair) <= results.keys()}
    ratios, spread = compared(results, there)
    stable = all(result["stable"] for result in results.values())
    return {"results": results, "ratios": ratios, "spread": spread, "stable": stable}


def together(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return of the rounds the sums of counts, and the median of all else that is a number."""
    merged: dict[str, Any] = {}
    for key, first in rows[0].items():
        values = [row[key] for row in rows if key in row]
        if isinstance(first, dict):
            merged[key] = together(values)
        elif first is None or isinstance(first, bool):
            merged[key] = first
        elif isinstance(first, int):
            merged[key] = sum(values)
        else:
            merged[key] = float(np.median(values))
            if key == "p50":
                merged["p50 quartiles"] = np.percentile(values, [25, 75]).tolist()
    return merged


def script(code: str, *arguments: object, **pipes: Any) -> subprocess.Popen[str]:
    """Start Python code in a process of its own; what it prints can be read, unless a pipe is given for it."""
    command = [sys.executable, "-P", "-c", code, *map(str, arguments)]
    return subprocess.Popen(command, text=True, **({"stdout": subprocess.PIPE} | pipes))


def printed(code: str, *arguments: object) -> str:
    """Return what Python code prints in a process of its own.

    Raises
    ------
    ProblemError : it failed
    """
    with script(code, *arguments) as process:
        said = process.communicate()[0]
    if process.returncode:
        raise ProblemError(f"a process of the benchmark ended with status {process.returncode}")
    return said


def thread_seconds() -> dict[str, float]:
    """Return the CPU time of each named thread of this process so far, s."""
    # The system does not know the names that Python gives its threads.
    names = {thread.native_id: thread.name for thread in threading.enumerate()}
    seconds: dict[str, float] = {}
    for task in Path("/proc/self/task").iterdir():
        name = names.get(int(task.name)) or (task / "comm").read_text().strip()
        seconds[name] = seconds.get(name, 0.0) + int((task / "schedstat").read_text().split()[0]) / 1e9
    return seconds


def missing(peers: Mapping[str, str]) -> dict[str, str]:
    """Return the peers that cannot be measured here, and how to install them.

    Parameters
    ----------
    peers : by name, the modules that each needs, with spaces between them
    """
    lacks = {name: [one for one in modules.split() if find_spec(one) is None] for name, modules in peers.items()}
    return {
        name: f"{' and '.join(modules)} not installed: pip install {' '.join(PACKAGES.get(m, m) for m in modules)}"
        for name, modules in lacks.items()
        if modules
    }


def stamp(peers: Mapping[str, str]) -> dict[str, Any]:
    """Return machine, versions and commit; `taxel bench` writes a result of a clean commit only."""
    from taxel_studies.commit import code_version  # noqa: PLC0415  what a benchmark measures is loaded by itself

    packages = ["taxel", "numpy", "scipy", *(PACKAGES.get(one, one) for of in peers.values() for one in of.split())]
    return {
        "machine": {
            "cpu": processor(),
            "cores": os.cpu_count(),
            "load": os.getloadavg()[0],
            "system": platform.platform(),
        },
        "versions": {"python": platform.python_version()} | {package: _version(package) for package in packages},
        "commit": code_version("taxel", "taxel_benchmarks"),
    }


def processor() -> str:
    """Return the processor's model and its widest vectors, as models of one name have AVX-512 or not."""
    about = Path("/proc/cpuinfo")
    lines = about.read_text().splitlines() if about.exists() else []
    named = dict(map(str.strip, line.partition(":")[::2]) for line in lines)
    flags = named.get("flags", "").split()
    widest = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), None)
    return ", ".join(filter(None, (named.get("model name", platform.processor()), widest)))


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "absent"


def question_of(benchmark: Any) -> str:
    """Return the question that a benchmark asks."""
    return str(getattr(benchmark, "about", benchmark.__doc__)).partition("\n")[0]


def alone(name: str, *, quick: bool) -> dict[str, Any]:
    """Run a benchmark in a process of its own.

    Benchmarks of one command do not share libraries, threads and memory then, and no peer pays for the command line's
    stack of calls (ContactMechanics looks through the stack in each step, which made it up to five times slower).

    Raises
    ------
    ProblemError : it ended without a result
    """
    command = [sys.executable, "-P", "-m", "taxel_benchmarks._rounds", name, "quick" if quick else "whole"]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise ProblemError(f"{name}: ended with status {done.returncode}, without a result")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def _main(name: str, size: str) -> None:
    # Only the module that has it is loaded: `encode` has encode_fa1, `learn_cone_x` has learn_cone_x_mixed.
    stem = next(stem for stem in _stems(name) if find_spec(f"taxel_benchmarks.{stem}") is not None)
    module = import_module(f"taxel_benchmarks.{stem}")
    benchmark = getattr(module, "BENCHMARKS", {name: module})[name]
    peers = getattr(module, "PEERS", {})
    absent = missing(peers)
    result = {"question": question_of(benchmark), **stamp(peers), "left out": absent, "ratios": {}}
    try:
        if ALL not in absent:
            result |= benchmark.run(quick=size == "quick")
        elif size != "quick":
            raise ProblemError(absent[ALL])
    except Error as error:
        sys.exit(f"{name}: {error}")
    print(json.dumps(result))


def _stems(name: str) -> list[str]:
    """Return a name, and what is left of it word by word."""
    words = name.split("_")
    return ["_".join(words[:n]) for n in range(len(words), 0, -1)]


if __name__ == "__main__":
    _main(*sys.argv[1:])
