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

#: What is connected to a signal.
WIRES = {
    "button_n": "the extension board's button, to ground; pulled up",
    "rx": "serial line, from the extension board's USB adapter",
    "tx": "serial line, to the same",
    "ramp": "high while the ramp rises, low while it falls back",
    "csel_reg_clk_out": "clock of the chain of 74HC164",
    "csel_reg_din_out": "data of the first of them, A and B",
    "record_sync": "high while a recording runs",
    "frame_sync_out": "a pulse of 10 ns a frame, for an oscilloscope",
    "col_change_sync": "a pulse of 10 ns a step",
    "col_read_sync": "high during a read",
    "row_read_sync": "high while a line is read",
    "comparators": "these sense lines",
}


def located(lpf: str) -> list[tuple[str, int | None, str]]:
    """Return signal, index and connector's pin of each pin on a connector, in the order of the file."""
    found, connector, numbers = [], "", iter(())
    for line in lpf.splitlines():
        if said := re.match(r"# (P\d), pins? (\d+)(?: (?:to|and) (\d+))?", line):
            connector, first, last = said[1], int(said[2]), int(said[3] or said[2])
            numbers = iter(range(first, last + 1))
        elif line.startswith("#"):
            connector = "" if line.startswith(("# The", "# Pins")) else connector
        elif connector and (pin := re.match(r'LOCATE COMP "(\w+)(?:\[(\d+)\])?" SITE', line)):
            found.append((pin[1], None if pin[2] is None else int(pin[2]), f"{connector}, {next(numbers)}"))
    return found


def table(lpf: str) -> str:
    """Return the table: one row a signal, of a bus one for eight pins that follow each other on a connector."""
    rows = ["| signal | connector, pin | wire |", "|---|---|---|"]
    pins = located(lpf)
    k = 0
    while k < len(pins):
        signal, index, place = pins[k]
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
        name = f"`{signal}`" if index is None else f"`{signal}[{index}]` to `[{last[1]}]`"
        where = place if count == 1 else f"{place} to {last[2].split(', ')[1]}"
        rows.append(f"| {name} | {where} | {WIRES[signal]} |")
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
