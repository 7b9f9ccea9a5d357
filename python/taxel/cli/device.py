"""``taxel device``: a board on its serial line, and whether it works."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import Annotated, Any

from cyclopts import Parameter

from taxel._base.arguments import text
from taxel._core import ProblemError
from taxel.board_check import check_board
from taxel.cli._say import in_columns, say
from taxel.cli.app import OUTSIDE, App, Flat, JsonOption, Limits
from taxel.device import Device, ports
from taxel.live.sending import PORT
from taxel.wire import PRESETS, Registers, described
from taxel.wire.registers import QUOTED_PRESETS

app = App(name="device", help="Find a board on its serial line, set its registers by name, and read them back.")

PlaceArgument = Annotated[str, Parameter(help="A serial port (COM3, /dev/ttyACM0), or host:port.")]


@dataclass(frozen=True)
class _Line:
    """Hold how a board's line is read, and how the board is shown.

    Parameters
    ----------
    baud
        Baud rate of the serial line.
    """

    baud: int = 115_200
    as_json: JsonOption = False


@app.command(name="ports")
def listed(*, as_json: JsonOption = False) -> None:
    """List the serial ports of this machine.

    Example: taxel device ports
    """
    serial_ports = ports()
    if as_json:
        say(json.dumps([asdict(port) for port in serial_ports]))
        return
    for port in serial_ports:
        usb = "" if port.usb is None else f"{port.usb[0]:04x}:{port.usb[1]:04x}"
        say("  ".join(filter(None, (port.place, port.kind, usb, port.maker, port.product, port.serial))))
    if not serial_ports:
        say("no serial port was found: is the cable plugged in, and are you allowed to open the port?", err=True)


@app.command
def show(place: PlaceArgument, /, *, line: Flat[_Line] = _Line()) -> None:
    """Show a board's identity, and every register with its unit.

    Example: taxel device show /dev/ttyACM0
    """
    with Device(place, baud=line.baud) as device:
        _print(device, device.registers, line.as_json)


@app.command(name="set")
def set_registers(
    place: PlaceArgument,
    fields: Annotated[list[str], Parameter(help="NAME=VALUE, for example ramp=140 noise_floor=4; times in us.")],
    /,
    *,
    line: Flat[_Line] = _Line(),
) -> None:
    """Set registers by name, in an order in which the board is never without a valid set, and print what changed.

    Example: taxel device set /dev/ttyACM0 noise_floor=5 wire_version=2
    """
    values = dict(_field(assignment) for assignment in fields)
    with Device(place, baud=line.baud) as device:
        before = {name: value for name, value, *_ in described(device.registers)}
        after = device.set(**values)
        if line.as_json:
            _print(device, after, line.as_json)
            return
        changed = [(name, value, unit) for name, value, unit, *_ in described(after) if value != before[name]]
        for name, value, unit in changed:
            say(f"{name}: {before[name]:g} -> {value:g}" + f" {unit}" * bool(unit))
        if not changed:
            say("nothing changed: the board had these values")
        for warning in after.warnings:
            say(f"warning: {warning}", err=True)


@app.command
def apply(
    place: PlaceArgument,
    preset: Annotated[str, Parameter(help=f"One of {QUOTED_PRESETS}.")],
    /,
    *,
    line: Flat[_Line] = _Line(),
) -> None:
    """Set a board to a preset, and read it back; its version of the wire stays as it is.

    Example: taxel device apply /dev/ttyACM0 "2 kHz"
    """
    text("preset", preset, PRESETS)
    with Device(place, baud=line.baud) as device:
        _print(device, device.apply(preset), line.as_json)


@app.command
def check(
    place: str,
    /,
    *,
    port: Annotated[int, Parameter(validator=Limits(1, 65_535))] = PORT,
    host: str = "0.0.0.0",
    seconds: Annotated[float, Parameter(validator=Limits(0.1))] = 4.0,
    as_json: JsonOption = False,
) -> int:
    """Check a board by a pattern that it makes itself, and then its comparators at rest, while nothing touches it.

    The board sends version 2 of the wire meanwhile; afterwards its registers are as before. Exit code 3: the check
    found a fault.

    Example: taxel device check /dev/ttyACM0

    Parameters
    ----------
    place
        The serial port, or host:port.
    port
        The UDP port that the board sends to.
    host
        The address of this machine to listen on; 0.0.0.0: all.
    seconds
        Duration of each part of the check, s.
    """
    result = check_board(place, port=port, host=host, seconds=seconds, say=None if as_json else say)
    if as_json:
        say(json.dumps({"good": result.good, "findings": [asdict(finding) for finding in result.findings]}))
    return 0 if result.good else OUTSIDE


def _field(assignment: str) -> tuple[str, float]:
    """Return name and value of NAME=VALUE."""
    name, equals, value = assignment.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = {"true": 1.0, "false": 0.0}.get(value, math.nan)
    if not equals or math.isnan(number):
        raise ProblemError(f"{assignment}: must be NAME=NUMBER, for example noise_floor=4")
    return name, int(number) if number.is_integer() else number


def _print(device: Device, registers: Registers, as_json: bool) -> None:
    rows = described(registers)
    if as_json:
        result: dict[str, Any] = {"place": device.cable.place, **asdict(device.greeting)}
        result["frame_us"] = registers.frame_us
        result["registers"] = {name: value for name, value, *_ in rows}
        result["warnings"] = list(registers.warnings)
        say(json.dumps(result))
        return
    g = device.greeting
    say(
        f"{device.cable.place}: {g.rows} x {g.columns} taxels, {g.channels} channels, wire version "
        f"{registers.wire_version}, {1e6 / registers.frame_us:.2f} frames/s"
    )
    say(*in_columns([(name, f"{value:g}", unit, at, meaning) for name, value, unit, at, meaning in rows]))
    for warning in registers.warnings:
        say(f"warning: {warning}", err=True)
