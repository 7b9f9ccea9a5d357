"""The simulated logic as an object of Python: trip times and command bytes in, datagrams and status lines out."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np

from verilated import SOURCES, built

#: A write acts in the frame whose edge comes so many clocks or more after the middle of its last stop bit.
WRITE_CLOCKS = 23
#: Bytes that are fetched at once.
ROOM = 1 << 22


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
        A folder of other sources than `rtl/src`: the tests' planted faults.
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
        source: Path = SOURCES,
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
