"""What a text or a layout file states of a live source: `[NAME=]KIND:PLACE[,KEY=VALUE...]`."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from taxel import _core
from taxel._base.arguments import shown
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array, of_size
from taxel.formats.form import Form
from taxel.formats.layout import Layout, PrintedFrames
from taxel.live.line_frames import array_of
from taxel.wire import Registers

__all__ = ["StatedSource", "with_layout"]

#: How a source is written, for errors.
_FORMS = (
    "[NAME=]board:HOST:PORT, serial:PLACE, lines:PATH (- is the standard input), lines+tcp:HOST:PORT, "
    "lines+udp:HOST:PORT, lsl:NAME or given, and KEY=VALUE after commas"
)
_LINES = ("serial", "lines", "lines+tcp", "lines+udp")
_OF_BOARD = ("array", "preset")
_OF_LINES = ("array", *(each.name for each in fields(PrintedFrames)[1:]), "unit", "falls", "rate")


@dataclass(frozen=True)
class StatedSource:
    """What is stated of a source.

    Parameters
    ----------
    text : str
        The source as it was stated.
    kind : {"board", "lines", "given", "lsl"}
    name : str
        Its name, "" if none is stated.
    place : str
        The address of a board, the place of lines, the name of a stream.
    array : Array, optional
    printed : PrintedFrames
        How its lines are read.
    unit : str, optional
    turned : float, optional
        The number from which readings are subtracted, as they fall with pressure.
    rate_hz : float, Hz, optional
    preset : str
        Of the registers of a board.
    """

    text: str
    kind: str
    name: str
    place: str
    array: Array | None
    printed: PrintedFrames
    unit: str | None = None
    turned: float | None = None
    rate_hz: float | None = None
    preset: str = "5.2 kHz"

    def __post_init__(self) -> None:
        if self.rate_hz is not None and not 1 / 3600 <= self.rate_hz <= 1e6:
            raise ProblemError(f"rate is {self.rate_hz:g} Hz: must be from 1 per hour to 1000000")

    @classmethod
    def of(cls, text: str) -> StatedSource:
        """Return what a text states, or the layout file that it names.

        Raises
        ------
        ProblemError : no source, or a key or value that it cannot have
        FormatError : the layout file cannot be read, or names no source
        """
        if text.endswith(".toml") and "," not in text:
            name, _, path = text.rpartition("=")
            return cls._of_layout(text, name, Layout.read(Path(path)))
        head, *pairs = text.split(",")
        before, is_named, after = head.partition("=")
        name, head = (before.strip(), after) if is_named and ":" not in before else ("", head)
        kind, _, place = head.partition(":")
        keys = dict[str, str]()
        for pair in pairs:
            key, there, value = pair.partition("=")
            if not there:
                raise ProblemError(f"source {text!r}: {pair!r} must be KEY=VALUE")
            keys[key.strip()] = value.strip()
        is_lines = kind in _LINES and bool(place)
        if not is_lines and head != "given" and not (kind in ("board", "lsl") and place):
            right = f"a serial port is serial:{head}" if _is_port(head) else f"must be {_FORMS}"
            raise ProblemError(f"source {text!r}: {right}")
        known = _OF_BOARD if kind == "board" else () if kind == "lsl" else _OF_LINES
        unknown = next((key for key in keys if key not in known), None)
        if unknown is not None:
            options = ", ".join(known) or "none"
            raise ProblemError(f"source {text!r}: has no option {unknown!r}; the options are {options}")
        try:
            return cls._of_keys(text, "lines" if is_lines else kind, name, head if is_lines else place, keys)
        except ProblemError as error:
            raise ProblemError(f"source {text!r}: {first_line(error)}") from None

    @classmethod
    def _of_layout(cls, text: str, name: str, layout: Layout) -> StatedSource:
        """Return what a layout file states."""
        if layout.source is None or layout.rows is None or layout.columns is None:
            lacks = "[source] place is missing" if layout.source is None else "rows and columns are missing"
            raise FormatError(f"{layout.path}: {lacks}; must be in the layout file of a live source")
        kind, _, place = layout.source.place.partition(":")
        if kind not in _LINES or not place:
            raise FormatError(f"{layout.path}: [source] place is {shown(layout.source.place)}: must be {_FORMS}")
        source, array = layout.source, layout.array(layout.rows * layout.columns)
        try:
            return cls(text, "lines", name, source.place, array, source, layout.unit, layout.turned, layout.rate_hz)
        except ProblemError as error:
            raise FormatError(f"{layout.path}: {first_line(error)}") from None

    @classmethod
    def _of_keys(cls, text: str, kind: str, name: str, place: str, keys: dict[str, str]) -> StatedSource:
        array = of_size(keys["array"], of_wire=kind == "board") if "array" in keys else None
        rate = _number("rate", keys.get("rate"))
        if keys.get("unit") == "":
            raise ProblemError("unit is empty: must be the unit of the values, for example N or kPa")
        falls = keys.get("falls", "false")
        turned = {"true": 0.0, "false": None}[falls] if falls in ("true", "false") else _number("falls", falls)
        columns = tuple(keys["columns"].split(":")) if "columns" in keys else ()
        if len(set(columns)) < len(columns) or "" in columns:
            raise ProblemError(f"columns={keys['columns']}: each column must have a name of its own")
        printed = PrintedFrames(
            place,
            baud=_whole("baud", keys.get("baud")),
            columns=columns,
            leave_out=keys["leave_out"].split(":") if "leave_out" in keys else (),
            frame_lines=_whole("frame_lines", keys.get("frame_lines")),
            **{key: keys.get(key) for key in ("time", "by", "frame_end", "frame_begin", "frame_time")},
        )
        unit, preset = keys.get("unit"), keys.get("preset", cls.preset)
        return cls(text, kind, name, place, array, printed, unit, turned, rate, preset)

    @property
    def are_frames(self) -> bool:
        """Whether its lines are stated to be frames of an array."""
        printed = self.printed
        return self.array is not None or any((printed.frame_lines, printed.frame_end, printed.frame_begin))

    @property
    def called(self) -> str:
        """The name, or that of its kind."""
        if self.kind in ("board", "lsl"):
            return self.name or self.kind
        return self.name or ("frames" if self.are_frames else "numbers")

    def registers(self, array: Array) -> Registers:
        """Return the registers of a board."""
        return Registers._of(_core.registers_preset(self.preset, array), array)


def with_layout(source: str, form: Form, layout: Layout) -> str:
    """Return a source with what a layout states of its lines, which a form reads."""
    table, columns = form.table, form.columns
    array = layout.grid() or (array_of(form, None, None, "")[0] if form.lines > 1 else None)
    times = "+".join(str(k + 1) for k in columns.times)
    left = (k for k in range(len(form.names)) if k not in {*columns.times, *columns.taxels, columns.by})
    keys = {
        "time": f"{times}:{table.time_unit}".removesuffix(":s" * (len(columns.times) > 1)) if times else "0",
        "leave_out": ":".join(str(k + 1) for k in left),
        "by": None if columns.by is None else columns.by + 1,
        "frame_lines": table.frame_lines,
        "frame_end": table.frame_end,
        "frame_begin": table.frame_begin,
        "frame_time": table.frame_time,
        "array": None if array is None else f"{array.rows}x{array.columns}",
        "unit": layout.unit,
        "falls": "true" if layout.falls is True else layout.turned,
        "rate": layout.rate_hz,
    }
    return ",".join([source, *(f"{key}={value}" for key, value in keys.items() if value)])


def _is_port(text: str) -> bool:
    return text.startswith("/dev/") or (text[:3].upper() == "COM" and text[3:].isdecimal())


def _number(key: str, value: str | None) -> float | None:
    try:
        return None if value is None else float(value)
    except ValueError:
        raise ProblemError(f"{key} is {shown(value)}: must be a number") from None


def _whole(key: str, value: str | None) -> int | None:
    if value is not None and not value.isdecimal():
        raise ProblemError(f"{key} is {shown(value)}: must be a whole number")
    return None if value is None else int(value)
