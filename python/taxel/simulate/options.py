"""Options of an emulated board, each defined once for `emulate`, the command line and Rust."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from functools import partial
from typing import Any, Literal

from taxel._base.arguments import instance, integer, number, text
from taxel._base.options import option
from taxel.array import Array
from taxel.simulate.acts import Act, Contact
from taxel.simulate.board import Version2, board_options, fitting, lines_of
from taxel.simulate.circuit import Circuit
from taxel.simulate.emulator_report import EmulatorReport
from taxel.simulate.replay import Replay
from taxel.simulate.trouble import Faults, Flaws
from taxel.wire import Registers

__all__ = ["EmulateOptions"]


def _nothing(_: object) -> None:
    """Do nothing: the default of a callback."""


@dataclass(frozen=True)
class EmulateOptions:
    """Hold the options of `emulate`, which documents each: what the command line says of them, and their defaults.

    Parameters
    ----------
    seed : int
        Seed of scenes, taxels and noise.
    preset : str | None
        The registers: one of `taxel.wire.PRESETS`. Default: the scene's, or those of the array at reset.
    wire : Literal[1, 2] | None
        Version of the wire. Default: the registers decide.
    circuit : Circuit | None
        Simulate the circuit of shared lines; NAME is one of gain, switch_ohm, offset_mv, hysteresis_v,
        settle_us, amplifier_us. One value is enough: the whole circuit is simulated, with the usual values for
        the other names. The board then reaches about 2.4 kHz.
    asynchronous : bool
        Taxels send by themselves, without a scan, with stamps of 1 us (wire 2).
    flaws : Flaws | None
        A flaw of taxels and its size: gain (deviation of its logarithm), threshold, hysteresis and noise
        (ticks), drift (ticks a minute), dead and stuck (share of taxels, 0 to 1), loose (lines). May be
        repeated.
    faults : Faults | None
        A fault of the network: a share of the datagrams is lost, repeated, reordered, cut or corrupted. May be
        repeated.
    reset_every_s : float | None
        Interval between resets of the board, s. Default: none.
    drift_ppm : float
        Error of the board's clock in parts per million; above 0, it runs too fast.
    control : str | None
        Accept commands on this TCP port, from this computer only; 0 finds a free one.
    source_port : int
        The UDP port to send from; 0: any.
    """

    touch: Iterable[Act] | Replay
    _: KW_ONLY
    seed: int = option(0, least=0)
    preset: str | None = option(None)
    registers: Registers | None = None
    tare_ms: float = 50.0
    array: Array | None = None
    sensor: Mapping[str, float] | None = None
    wire: Literal[1, 2] | None = option(None, least=1, most=2)
    previous: Literal["last_sent", "last_sample"] = "last_sent"
    intensity: Literal["value", "difference", "nothing"] = "value"
    version_2: Version2 | None = None
    circuit: Circuit | None = option(None)
    asynchronous: bool = option(False)
    flaws: Flaws | None = option(None)
    faults: Faults | None = option(None)
    reset_every_s: float | None = option(None, least=0.001)
    drift_ppm: float = option(0.0)
    control: str | None = option(None)
    source_port: int = option(0, least=0, most=65_535)
    begun: Callable[[str | None], object] = _nothing
    watch: Callable[[EmulatorReport], object] = _nothing
    touched: Callable[[list[Contact]], object] = _nothing

    def completed(self) -> EmulateOptions:
        """Return the options with the array of the touch and the registers that the board begins with."""
        touch, registers = self.touch, self.registers
        if isinstance(touch, Replay):
            array, preset = touch.array, touch.registers
        else:
            array = Array._of(self.array)
            preset = partial(fitting, array=array)
        registers = preset(self.preset) if registers is None else registers
        registers = instance("registers", registers, Registers)
        if self.wire is not None:
            registers = registers.replace(wire_version=integer("wire", self.wire, 1, 2))
        return replace(self, array=array, registers=registers)

    def for_rust(self) -> dict[str, Any]:
        """Return the completed options as Rust reads them."""
        registers = instance("registers", self.registers, Registers)
        return {
            "registers": registers._held,
            "tare_ms": None if isinstance(self.touch, Replay) else number("tare_ms", self.tare_ms),
            "board": board_options(self.previous, self.intensity, self.version_2, self.asynchronous),
            "control": None if self.control is None else text("control", self.control),
            "circuit": lines_of(self.circuit, self.asynchronous),
            "flaws": None if self.flaws is None else instance("flaws", self.flaws, Flaws)._parts(),
            "faults": None if self.faults is None else instance("faults", self.faults, Faults)._parts(),
            "reset_every_s": None if self.reset_every_s is None else number("reset_every_s", self.reset_every_s),
            "drift_ppm": number("drift_ppm", self.drift_ppm),
            "source_port": integer("source_port", self.source_port, 0, 65_535),
        }
