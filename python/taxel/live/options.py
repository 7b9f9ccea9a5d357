"""The options of a `Live`, checked and completed; `_stated_options` lists them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

from taxel import _core
from taxel._base.arguments import flag, instance, integer, number, parameters, several, shown, text
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import PlainRule, Readout
from taxel.detect.detector import detector
from taxel.live._stated_options import StatedOptions
from taxel.tare import Tare
from taxel.wire import Registers

if TYPE_CHECKING:
    from taxel.detections import Detection


@dataclass(frozen=True, kw_only=True)
class LiveOptions(StatedOptions):
    """Hold all options of a `Live`: those that Rust reads too, and a function."""

    say: Callable[[Detection], object] | None = None

    def completed(self) -> LiveOptions:
        """Return the options with the sensor of the readout; refuse options that make no sense."""
        readout, array, registers = self.readout, self.array, self.registers
        if readout is not None:
            detector("readout", readout)
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
            registers = Registers._of(_core.registers_preset(text("registers", registers), array._parts()), array)
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
        plain = {o.name: _plain(o, getattr(self, o.name)) for o in fields(StatedOptions) if o.name not in _APART}
        return parameters(plain | {"send": send, "input": read, "sources": sources})


#: Options that are passed in another form, as the name of a file may be no text, or not at all.
_APART = ("record", "send", "sources", "first_line_s")


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
