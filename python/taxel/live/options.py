"""The options of a `Live`, each defined once for `Live`, the command line and Rust."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from taxel import _core
from taxel._base.arguments import flag, instance, integer, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._base.options import option
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import PlainRule, Readout
from taxel.detect.detector import detector
from taxel.detect.readout import USES, used
from taxel.tare import Tare
from taxel.wire import Registers

if TYPE_CHECKING:
    from taxel.detections import Detection


@dataclass(frozen=True)
class LiveOptions:
    """The options of a `Live`, which explains each: what the command line says of them, and their defaults.

    Parameters
    ----------
    port : int | None
        The UDP port that the board sends to. Default: 5208, unless --source names what to receive.
    host : str | None
        The address of this machine to listen on for a board; 0.0.0.0: all.
    array : Array | None
        Rows, columns and pitch of the sensor. Default: those of the readout, else 64x64x2.67. For example
        24x20x5. Default pitch: 2.67 mm.
    registers : str | Registers | None
        The board's registers, by a preset: one of `taxel.wire.PRESETS`. Default: those of a board of this array
        at reset.
    differences : bool
        The board sends intensity differences.
    readout : Readout | PlainRule | None
        A trained readout or a plain rule; without one nothing is detected. taxel train writes such files
        (JSON).
    use : str
        What detects each label: better (the better one in training), rule (its plain rule) or neuron. A label
        with no rule is not detected by rule.
    tare : Tare | float | None
        Rest of the taxels: a saved tare, or the seconds at rest at the beginning, from which a fresh tare is
        taken. A recording of the sensor at rest (taxel cut) can be used instead of a saved tare.
    absorb_s : float | None
        After how many seconds a load that stays becomes rest, in frames of numbers, whose rest follows drift;
        0: the rest stays as it was measured. Default: as in the training.
    record : str | os.PathLike[str] | None
        Record in a new .mcap file.
    record_later : bool
        Let `record` and `end_recording` begin and end recordings while the `Live` runs.
    name : str
        The board's name among the sources of the recording.
    sources : Mapping[str, str] | str | Sequence[str] | None
        The source to receive: [NAME=]KIND:PLACE and, after commas, KEY=VALUE; for example lines:-,array=16x16
        or serial:COM3,array=16x16. It sends frames of numbers, is a board (board:HOST:PORT), or is a further
        source of a recording. May be repeated.
    first_line_s : float
        How long each source of lines may be silent before its first line, s.
    compression : str
        Compression of a .mcap: none, lz4 or zstd.
    overwrite : bool
        Replace output files that exist already.
    guard_frames : float | None
        How far, in frames, a readout stays behind the host's clock while no events arrive. Default: 3; 5 of a
        source of numbers.
    lines : bool
        Print one line of JSON for each detection, and nothing else.
    send : str | Sequence[str]
        Send each detection as a line of JSON to serial:PLACE, lines:PATH (a named pipe), lines+tcp:HOST:PORT or
        lines+udp:HOST:PORT. May be repeated.
    say : Callable[[Detection], object] | None
        Called with each detection.
    """

    port: int | None = option(None, least=0, most=65_535, commands="live record")
    _: KW_ONLY
    host: str | None = option(None, commands="live record")
    array: Array | None = option(None, commands="live record", metavar="ROWSxCOLUMNS[xMM]")
    registers: str | Registers | None = option(None, commands="live record", flag="--preset")
    differences: bool = option(False, commands="live record")
    readout: Readout | PlainRule | None = option(None, metavar="FILE")
    use: str = option("better", metavar="better|rule|neuron")
    tare: Tare | float | None = option(None, metavar="FILE|SECONDS")
    absorb_s: float | None = option(None, least=0, most=1800)
    record: str | os.PathLike[str] | None = option(None)
    record_later: bool = option(False, commands="")
    name: str = option("board", commands="record")
    sources: Mapping[str, str] | str | Sequence[str] | None = option(
        None, commands="live record", flag="--source", metavar="[NAME=]KIND:PLACE"
    )
    first_line_s: float = option(3.0, least=0, commands="")
    compression: str = option("none", commands="record")
    overwrite: bool = option(False, commands="live record")
    guard_frames: float | None = option(None, least=0)
    lines: bool = option(False, flag="--json")
    send: str | Sequence[str] = option((), metavar="WHERE")
    say: Callable[[Detection], object] | None = option(None, commands="")

    def completed(self) -> LiveOptions:
        """Return the options with the sensor of the readout; refuse options that make no sense."""
        readout, array, registers = self.readout, self.array, self.registers
        text("use", self.use, USES)
        if readout is not None:
            detector("readout", readout)
            readout = used(readout, self.use).absorbing(self.absorb_s)
        if array is None and readout is not None:
            array = readout.array
        elif readout is not None and readout.array is not None:
            readout.array._warn_apart(instance("array", array, Array), "live")
        if self.say is not None and not callable(self.say):
            raise refused("say", f" is {shown(self.say)}: must be a function of a Detection")
        if readout is None and self.tare is not None:
            raise ProblemError("tare needs a readout: only a readout uses a tare")
        array = Array._of(array)
        stated = registers is not None
        if registers is None:
            registers = Registers(array=array)
        elif not isinstance(registers, Registers):
            registers = Registers._of(_core.registers_preset(text("registers", registers), array), array)
        if readout is not None and stated:
            readout = readout._with_floor(float(registers.noise_floor))
        return replace(self, array=array, registers=registers, readout=readout)

    def destinations(self) -> list[str]:
        """Return where detections are sent."""
        return [text("send", to) for to in ([self.send] if isinstance(self.send, str) else several("send", self.send))]

    def source_texts(self) -> list[str]:
        """Return what is received, as texts: [NAME=]KIND:PLACE and KEY=VALUE after commas."""
        if self.sources is None:
            return []
        if isinstance(self.sources, Mapping):
            listed: Iterable[str] = (
                f"{text('name of a source', name)}={text(f'source {name}', place)}"
                for name, place in self.sources.items()
            )
        else:
            listed = [self.sources] if isinstance(self.sources, str) else several("sources", self.sources)
        return [text("source", source) for source in listed]

    def for_rust(self, *, send: list[str], read: dict[str, Any] | None, sources: list[dict[str, Any]]) -> str:
        """Return the options as the compiled part reads them, with the frames that it receives instead of a board."""
        plain = {o.name: _plain(o, getattr(self, o.name)) for o in fields(self) if o.name not in _APART}
        return parameters(plain | {"send": send, "input": read, "sources": sources})


#: Options that are passed in another form, as the name of a file may be no text, or not at all.
_APART = ("absorb_s", "use", "record", "send", "sources", "first_line_s", "say")


def _plain(option: Field[Any], value: object) -> object:
    """Return the value of an option as JSON holds it; refuse a value of another type."""
    match value:
        case Array():
            return value._geometry()
        case Registers():
            return json.loads(value._json())
        case Readout() | PlainRule() | Tare():
            return value.to_json()
    if value is None and "None" in option.type:
        return None
    checks: dict[Any, Callable[[], object]] = {
        "bool": lambda: flag(option.name, value),
        "int": lambda: integer(option.name, value, option.metadata["min"], option.metadata["max"]),
        "str": lambda: text(option.name, value),
    }
    return checks.get(option.type.removesuffix(" | None"), lambda: number(option.name, value))()
