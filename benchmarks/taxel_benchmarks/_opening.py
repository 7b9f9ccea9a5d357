"""A step with a .mcap in a process of its own: ``python -m taxel_benchmarks._opening STEP PATH FOLDER``.

Prints CPU and wall seconds, and the largest memory of the process, MB.
"""

import sys
import time
from pathlib import Path

import taxel


def listed(path: str) -> object:
    """Read everything besides the events."""
    r = taxel.open(path)
    return r.notes, r.registers, r.zeroings, r.detections, r.verdict, list(r.sources)


def sliced(path: str) -> object:
    """Read the events of the first half."""
    r = taxel.open(path)
    return r.between(0, float(r.events.t[-1]) / 2).events


STEPS = {
    "imported": lambda *_: None,
    "opened": lambda path, _: taxel.open(path),
    "listed": lambda path, _: listed(path),
    "decoded": lambda path, _: taxel.open(path).events,
    "sliced": lambda path, _: sliced(path),
    "cut": lambda path, _: taxel.cut(taxel.open(path), columns=slice(0, 32)),
    "cut, its events": lambda path, _: taxel.cut(taxel.open(path), columns=slice(0, 32))[0].events,
    "copied": lambda path, folder: taxel.convert(path, folder + "/copy.mcap", overwrite=True),
    "to .npz": lambda path, folder: taxel.convert(
        taxel.open(path).between(0, 1e5), folder + "/copy.npz", overwrite=True
    ),
}

if __name__ == "__main__":
    step, *places = sys.argv[1:]
    taxel.open  # noqa: B018  loads what is loaded at the first use
    cpu, wall = time.process_time(), time.perf_counter()
    kept = STEPS[step](*places)
    done = time.process_time() - cpu, time.perf_counter() - wall
    peak = Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]
    print(*done, int(peak) / 1024)
