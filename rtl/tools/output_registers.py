"""Registers behind RAM blocks become the blocks' own, which Yosys 0.70 does not use: their output comes 4.9 ns earlier.

A block's output stands 5.83 ns after the clock, that of its register 0.96 ns (speed grade 6, nextpnr 0.11.1; no board has
confirmed its data base).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

Netlist = dict[str, Any]
Bit = int | str


def merged(netlist: Netlist, top: str) -> int:
    """Move the flip-flops that alone take a block's output into the block; return how many there were.

    Those of a port move together: with its clock, without reset, with one enable. Where the port reads in some clocks only, that
    must be the enable too, as what a block's register does while its port does not read is not said here.
    """
    cells, ports = netlist["modules"][top]["cells"], netlist["modules"][top]["ports"]
    sinks: dict[Bit, list[str]] = defaultdict(list)
    for name, cell in cells.items():
        for pin, bits in cell["connections"].items():
            if cell["port_directions"][pin] == "input":
                for bit in bits:
                    sinks[bit].append(f"{name} {pin}")
    for name, port in ports.items():
        for bit in port["bits"]:
            sinks[bit].append(f"{name} ")
    moved = 0
    for block in [cell for cell in cells.values() if cell["type"] == "DP16KD"]:
        for port in "AB":
            pins = [pin for pin in block["connections"] if pin.startswith(f"DO{port}")]
            taken = {pin: sinks[bit] for pin in pins for bit in block["connections"][pin] if sinks[bit]}
            enable = _enable(cells, block, port, list(taken.values()))
            if enable is None:
                continue
            for pin, (register,) in taken.items():
                block["connections"][pin] = cells.pop(register.rpartition(" ")[0])["connections"]["Q"]
            block["connections"][f"OCE{port}"] = enable
            block["parameters"][f"REGMODE_{port}"] = "OUTREG"
            moved += len(taken)
    return moved


def _enable(cells: Netlist, block: Netlist, port: str, taken: Sequence[Sequence[str]]) -> list[Bit] | None:
    """Return what enables all registers of a port, a constant 1 if nothing does; None where they cannot be its own."""
    enables = []
    for sinks in taken:
        name, _, pin = sinks[0].rpartition(" ")
        register = cells.get(name)
        if len(sinks) != 1 or pin != "DI" or register is None or register["type"] != "TRELLIS_FF":
            return None
        wires, settings = register["connections"], register["parameters"]
        enable = {"1 ": ["1"], "CE": wires.get("CE")}.get(settings["CEMUX"])
        clocked = settings["CLKMUX"] == "CLK" and wires["CLK"] == block["connections"][f"CLK{port}"]
        if enable is None or not clocked or wires["LSR"] != ["0"] or settings["REGSET"] != "RESET":
            return None
        enables.append(enable)
    if not enables or enables.count(enables[0]) != len(enables):
        return None
    return enables[0] if block["connections"][f"CE{port}"] in (["1"], enables[0]) else None
