"""Frames of any other sensor, from a pipe, as the touch of an emulated board."""

from __future__ import annotations

import os
from typing import IO, Any

from taxel._base.arguments import integer, number, shown
from taxel._base.documents import of_json
from taxel._base.errors import placed, refused, unreadable
from taxel._core import DeviceError, FormatError, ProblemError
from taxel.array import Array
from taxel.wire import Registers

__all__ = ["Pipe"]

#: Largest length of the first line, bytes.
_LONGEST_LINE = 1 << 16
#: What errors name in place of a file, and what its first line must be like.
_SOURCE = "standard input"
_EXPECTED = '{"rows": 16, "columns": 8, "rate": 100, "bits": 12}'


class Pipe:
    """Play frames of any other sensor to the board as they come: from a pipe, after a line that describes them.

    The line is JSON: ``{"rows": 16, "columns": 8, "rate": 100, "bits": 12}``, and may name ``pitch_mm`` and ``name``.
    After it come frames: uint16, little-endian, row by row. The pipe gives the board's clock: a frame lasts 1 / `rate`
    s.

    Parameters
    ----------
    source : binary file
        For example ``sys.stdin.buffer``; must have a descriptor.
    noise_floor : int, ticks
        A change above it makes an event; a tick is one unit of the values, or more where so many bits are too many for
        so fast a scan (`shift` is how often a value is halved).

    Raises
    ------
    FormatError : the first line is not as described
    ProblemError : numbers in it that are invalid
    """

    def __init__(self, source: IO[bytes], noise_floor: int = 3) -> None:
        try:
            self._descriptor, self._ahead = source.fileno(), b""
        except AttributeError:
            raise refused("source", f" is {shown(source)}: must be a pipe or a file, opened to read bytes") from None
        line = self._line()
        try:
            header = of_json(_SOURCE, line.decode())
            rows, columns, rate, bits = (header[name] for name in ("rows", "columns", "rate", "bits"))
        except FormatError as error:
            raise unreadable(f"{error.args[0]}; must be like {_EXPECTED}", _SOURCE, line=1) from None
        except (ValueError, TypeError, KeyError) as error:
            begin = line[:60].decode("utf-8", "replace")
            raise unreadable(f"{begin!r} ({error}); must be like {_EXPECTED}", _SOURCE, line=1) from None
        self.array = Array(rows, columns, pitch_mm=header.get("pitch_mm"), name=header.get("name", "pipe"))
        self.rate_hz, floor = number("rate", rate), integer("noise_floor", noise_floor, 0, 255)
        try:
            registers, self.shift = Registers._of_source(self.array, self.rate_hz, integer("bits", bits, 1, 16))
        except DeviceError as error:
            raise placed(ProblemError(f"{rows} x {columns} taxels: {error}"), _SOURCE, line=1) from None
        self._registers = registers.replace(noise_floor=floor)

    def registers(self, preset: str | None) -> Registers:  # noqa: ARG002  the frames' line has their rate
        """Return the registers of a board that scans such frames.

        Parameters
        ----------
        preset : str or None
            As in `emulate`.

        Raises
        ------
        ProblemError : no such preset
        """
        return self._registers

    def _line(self) -> bytes:
        while b"\n" not in self._ahead and len(self._ahead) < _LONGEST_LINE:
            more = os.read(self._descriptor, 4096)
            if not more:
                break
            self._ahead += more
        line, _, self._ahead = self._ahead.partition(b"\n")
        return line

    def _touch(self, registers: Registers) -> tuple[Any, ...]:
        return self._descriptor, list(self._ahead), self.shift, registers.ramp
