"""The sources of a `Live`: which of them is read out, and those that are only recorded."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from taxel import _core
from taxel._core import ProblemError
from taxel.array import Array
from taxel.live.lines import Lines
from taxel.live.lsl import LslInlet
from taxel.live.options import LiveOptions
from taxel.live.sensor_lines import SensorLines
from taxel.live.stated_source import StatedSource

__all__ = ["Sources"]


class Sources:
    """Open the sources that options state.

    A board is received if a port, a host or a board is stated, or no source is; else the first source, as frames.

    Parameters
    ----------
    options : LiveOptions
        Complete.
    kept : sequence of Lines
        Those whose places are open, to go on where their sources are stated again.

    Attributes
    ----------
    options : LiveOptions
        With the address, sensor and name of the board, or the sensor and name of the frames.
    lines : list of Lines
        Those that are read, or that a program passes.

    Raises
    ------
    OSError : a source cannot be opened
    ProblemError : no such source, or one whose lines are not what is stated
    """

    def __init__(self, options: LiveOptions, kept: Sequence[Lines] = ()) -> None:
        stated = [StatedSource.of(text) for text in options.source_texts()]
        for k, source in enumerate(stated):
            if any(before.called == source.called for before in stated[:k]):
                raise ProblemError(
                    f"source {source.text!r}: two sources have the name {source.called}; begin one of them with "
                    "another NAME="
                )
        self.lines: list[Lines] = []
        self._kept = {lines.stated.text: lines for lines in reversed(kept) if lines.is_open}
        self._inlets: dict[str, LslInlet] = {}
        self._unit = getattr(options.readout, "unit", None)
        self._readout = options.array
        self._read: Lines | None = None
        is_board = options.port is not None or options.host is not None or not stated
        with self.abandoned_on_error():
            if not is_board:
                boards = [k for k, source in enumerate(stated) if source.kind == "board"]
                options = self._read_out(stated.pop(boards[0] if boards else 0), options)
            self.options = options
            self._others = [] if self._read is None else self._of_rust(self._read, self._read.sensors[1:])
            self._others += [each for source in stated for each in self._other(source)]

    @contextlib.contextmanager
    def abandoned_on_error(self) -> Iterator[None]:
        """Close what was opened here if the block fails: other programs may open it."""
        try:
            yield
        except BaseException:
            self.lines = [lines for lines in self.lines if lines.stated.text not in self._kept]
            self.close()
            raise

    def _read_out(self, source: StatedSource, options: LiveOptions) -> LiveOptions:
        """Return the options to receive a source."""
        if source.kind == "board":
            host, _, port = source.place.rpartition(":")
            if not host or not port.isdecimal():
                raise ProblemError(f"source {source.text!r}: {source.place!r} must be HOST:PORT")
            options = replace(options, host=host.strip("[]"), port=int(port), name=source.called)
            if source.array is None:
                return options
            return replace(options, array=source.array, registers=source.registers(source.array))
        if source.kind == "lsl":
            raise ProblemError(
                f"source {source.text!r}: contains no frames, so it cannot be shown or read by a readout"
            )
        self._read = self._opened(source, options, is_read_out=True)
        first = self._read.sensors[0]
        return replace(options, array=first.shape.array, name=first.name)

    def _other(self, source: StatedSource) -> list[dict[str, Any]]:
        """Return a further source as the compiled part knows it, or several that print to one place."""
        if source.kind == "board":
            array = source.array or Array.thesis()
            registers = json.loads(source.registers(array)._json())
            board = {"address": source.place, "array": array._geometry(), "registers": registers}
            return [{"name": source.called, "place": f"udp {source.place}", "kind": {"board": board}}]
        if source.kind == "lsl":
            inlet = self._inlets[source.called] = LslInlet(source.place)
            source = StatedSource.of(f"{source.called}=given,columns={':'.join(inlet.columns)}")
        lines = self._opened(source, self.options, is_read_out=False)
        return self._of_rust(lines, lines.sensors)

    def _of_rust(self, lines: Lines, sensors: Sequence[SensorLines]) -> list[dict[str, Any]]:
        return [
            {"name": each.name, "place": lines.place, "kind": {"frames": each.shape.layout(self._unit)}}
            for each in sensors
        ]

    def _opened(self, source: StatedSource, options: LiveOptions, *, is_read_out: bool) -> Lines:
        if (lines := self._kept.get(source.text)) is not None:
            lines.renew()
            self.lines.append(lines)
            return lines
        lines = Lines(source, is_read_out=is_read_out, readout=self._readout)
        self.lines.append(lines)
        lines.find(options.first_line_s)
        names = [sensor.name for each in self.lines for sensor in each.sensors]
        if len({*names}) < len(names):
            raise ProblemError(f"source {source.text!r}: another has lines of {names[-1]} too; begin it with NAME=")
        return lines

    def for_rust(self, send: Sequence[str]) -> str:
        """Return the options as the compiled part reads them."""
        read = self._read
        frames = None
        if read is not None:
            layout = read.sensors[0].shape.layout(self._unit)
            frames = {"text": read.stated.text, "place": read.place, "layout": layout}
        return self.options.for_rust(send=list(send), read=frames, sources=self._others)

    @property
    def read_as(self) -> str:
        """How the lines that are read out were understood, if what they are was not stated; else ""."""
        return "" if self._read is None else self._read.sensors[0].shape.read_as

    @property
    def states_unit(self) -> bool:
        """Whether a board is received, or lines of which the unit is stated."""
        return self._read is None or self._read.stated.unit is not None

    def begin(self, core: _core.Live) -> None:
        """Pass what arrives on."""
        for lines in self.lines:
            lines.begin(core.lines, core.end_lines)
        for name, inlet in self._inlets.items():
            inlet.begin(partial(self.sample, name))

    def sample(self, name: str, values: Sequence[float], at_ns: int | None) -> None:
        """Pass on the numbers of a line of a source that a program has.

        Raises
        ------
        ProblemError : no such source, or another number of columns
        OSError : the disk is full
        """
        lines = next((lines for lines in self.lines if name in [each.name for each in lines.sensors]), None)
        if lines is None:
            raise ProblemError(f"source {name!r}: no source of numbers has this name")
        lines.sample(values, _core.now_ns() if at_ns is None else at_ns)

    def with_unread(self, counters: dict[str, Any]) -> dict[str, Any]:
        """Return counters with the lines of each source of frames that are in no frame, by kind."""
        for sensor in (sensor for lines in self.lines for sensor in lines.sensors):
            of = counters if sensor.name == self.options.name else counters["sources"].get(sensor.name, {})
            if of.get("lines") is not None and sensor.frames is not None:
                of["lines"]["unread"] = {kind: dict(found) for kind, found in sensor.frames.unread.items()}
        return counters

    def pause(self) -> None:
        """End reading; what was read is passed on, and places of lines stay open for another `Sources`."""
        self._close_inlets()
        for lines in self.lines:
            lines.pause()

    def close(self) -> None:
        """End reading; what was read is passed on, and places are closed at once."""
        self._close_inlets()
        for lines in self.lines:
            lines.close()

    def _close_inlets(self) -> None:
        inlets, self._inlets = self._inlets, {}
        for inlet in inlets.values():
            inlet.close()

    @property
    def failed(self) -> Exception | None:
        """The error that ended reading early, as that of a full disk."""
        return next((lines.failed for lines in self.lines if lines.failed is not None), None)
