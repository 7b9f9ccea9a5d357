"""Write the table of a board's pins in docs/hardware.md from its .lpf.

Usage: python rtl/tools/pins.py
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

RTL = Path(__file__).parents[1]
PAGE = RTL.parent / "docs" / "hardware.md"
BEGIN, END = "<!-- pins: made from colorlight_i9.lpf by rtl/tools/pins.py -->\n", "<!-- end of pins -->\n"

#: What is connected to a signal, and whether the board drives it.
WIRES = {
    "clk25": ("in", "the module's oscillator, 25 MHz"),
    "button_n": ("in", "the extension board's button, to ground; pulled up"),
    "rx": ("in", "serial line, from the host: the extension board's USB adapter"),
    "tx": ("out", "serial line, to the host: the same adapter"),
    "ramp": ("out", "high while the ramp rises, low while it falls back"),
    "csel_reg_clk_out": ("out", "clock of the chain of 74HC164"),
    "csel_reg_din_out": ("out", "data of the chain's first 74HC164, its inputs A and B"),
    "record_sync": ("out", "high while a recording runs"),
    "frame_sync_out": ("out", "a pulse of 10 ns per frame, for an oscilloscope"),
    "col_change_sync": ("out", "a pulse of 10 ns per step"),
    "col_read_sync": ("out", "high during a read"),
    "row_read_sync": ("out", "high while a line is read"),
    "eth_reset_n": ("out", "the PHY's reset"),
    "eth_tx_clk": ("out", "RGMII to the PHY"),
    "eth_tx_ctl": ("out", "RGMII to the PHY"),
    "eth_tx_data": ("out", "RGMII to the PHY, bit by bit"),
    "comparators": ("in", "pulled down"),
}


def located(lpf: str) -> list[tuple[str, int | None, str, str]]:
    """Return signal, index, connector's pin and ball of each pin, in the order of the file."""
    found, connector, numbers = [], "", iter(())
    for line in lpf.splitlines():
        if said := re.match(r"# (P\d), pins? (\d+)(?: (?:to|and) (\d+))?", line):
            connector, first, last = said[1], int(said[2]), int(said[3] or said[2])
            numbers = iter(range(first, last + 1))
        elif line.startswith("#"):
            connector = "" if line.startswith(("# The", "# Pins")) else connector
        elif pin := re.match(r'LOCATE COMP "(\w+)(?:\[(\d+)\])?" SITE "(\w+)"', line):
            place = f"{connector}, {next(numbers)}" if connector else "on the module"
            found.append((pin[1], None if pin[2] is None else int(pin[2]), place, pin[3]))
    return found


def table(lpf: str) -> str:
    """Return the table: one row a signal, of a bus one for eight pins that follow each other on a connector."""
    rows = ["| signal | connector, pin | ball | wire |", "|---|---|---|---|"]
    pins = located(lpf)
    k = 0
    while k < len(pins):
        signal, index, place, _ball = pins[k]
        count = 1
        if index is not None:
            here = place.split(",")[0]
            while (
                k + count < len(pins)
                and count < 8
                and pins[k + count][0] == signal
                and pins[k + count][2].split(",")[0] == here
            ):
                count += 1
        last = pins[k + count - 1]
        direction, wire = WIRES[signal]
        name = f"`{signal}`" if index is None else f"`{signal}[{index}]` to `[{last[1]}]`"
        where = place if count == 1 or "," not in place else f"{place} to {last[2].split(', ')[1]}"
        balls = " ".join(pin[3] for pin in pins[k : k + count])
        rows.append(f"| {name} | {where} | {balls} | {direction}: {wire} |")
        k += count
    return "\n".join(rows) + "\n"


def page(text: str) -> str:
    """Return the page with the table as the .lpf has it."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table((RTL / 'boards' / 'colorlight_i9.lpf').read_text())}\n{END}{after}"


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(PAGE.read_text()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
