"""Find paths between registers of two clocks in a netlist that go through no instance of the modules for crossings."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

Netlist = dict[str, Any]
Bit = int | str

#: The pins of a cell's clocks: of a register, and of a RAM block by its outputs.
CLOCKS = {"TRELLIS_FF": {"Q": "CLK"}, "DP16KD": {"DOA": "CLKA", "DOB": "CLKB"}, "TRELLIS_DPR16X4": {"DO": "WCK"}}
#: How the registers of `taxel_synchroniser` that a path may end in are called, and those of `taxel_standing_word` that it may begin in.
ENDS, BEGINS = "unsettled", "held"


def unlisted(netlist: Netlist, top: str) -> list[tuple[str, str]]:
    """Return the first and last register, or block, of each path that goes from one clock to another one elsewhere."""
    cells = netlist["modules"][top]["cells"]
    names: dict[Bit, set[str]] = defaultdict(set)
    for net, wire in netlist["modules"][top]["netnames"].items():
        for bit in wire["bits"]:
            names[bit].add(net)
    drivers: dict[Bit, tuple[str, str]] = {}
    for name, cell in cells.items():
        for pin, bits in cell["connections"].items():
            if cell["port_directions"][pin] == "output":
                drivers |= dict.fromkeys(bits, (name, pin))

    def clock(name: str, pin: str) -> Bit | None:
        """Return the clock of an output; none of gates and of what is no part of the logic."""
        of_outputs = CLOCKS.get(cells[name]["type"], {})
        found = next((clock for output, clock in of_outputs.items() if pin.startswith(output)), None)
        return cells[name]["connections"][found][0] if found else None

    def inputs(name: str) -> list[Bit]:
        cell = cells[name]
        pins = [pin for pin in cell["connections"] if cell["port_directions"][pin] == "input"]
        return [bit for pin in pins for bit in cell["connections"][pin] if isinstance(bit, int)]

    found = set()
    for name, cell in cells.items():
        if cell["type"] not in CLOCKS:
            continue
        outputs = [pin for pin in cell["connections"] if cell["port_directions"][pin] == "output"]
        clocks = {clock(name, pin) for pin in outputs} - {None}
        ends = {net for pin in outputs for bit in cell["connections"][pin] for net in names[bit] or {name}}
        listed = any(end.rpartition(".")[2] == ENDS for end in ends)
        seen, left = set(), inputs(name)
        while left:
            bit = left.pop()
            if bit in seen or bit not in drivers or bit in clocks:
                continue
            seen.add(bit)
            driver, pin = drivers[bit]
            begins = clock(driver, pin)
            if begins is None and cells[driver]["type"] not in CLOCKS:
                left += inputs(driver)
            elif begins not in clocks:
                starts = names[bit] or {driver}
                if not listed and all(start.rpartition(".")[2] != BEGINS for start in starts):
                    found.add((min(starts), min(ends)))
    return sorted(found)
