"""Draw the diagrams of the page of the sensor: python docs/diagrams.py."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

PICTURES = Path(__file__).resolve().parent / "pictures"
READ, HELD = "C3", "0.35"


def page(width: float, height: float, across: float, down: float) -> tuple[Figure, Axes]:
    """Return an empty sheet of so many units."""
    figure = Figure(figsize=(width, height), layout="constrained")
    ax = figure.subplots()
    ax.set_xlim(0, across)
    ax.set_ylim(down, 0)
    ax.set_aspect("equal")
    ax.axis("off")
    return figure, ax


def box(ax: Axes, x: float, y: float, width: float, height: float, says: str, colour: str = "0.93") -> None:
    """Draw a part with its name."""
    ax.add_patch(FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0.05", facecolor=colour, edgecolor="0.4"))
    ax.text(x + width / 2, y + height / 2, says, ha="center", va="center", fontsize=8)


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str = "k") -> None:
    """Draw the way that a signal takes."""
    ax.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": colour})


def lines() -> Figure:
    """Figure 4.1: rows and columns while one column is read."""
    figure, ax = page(7.5, 4.6, 15.0, 9.2)
    for row in range(4):
        y = 1.5 + 1.8 * row
        ax.plot([1.2, 9.2], [y, y], color=HELD, lw=1.5)
        box(ax, 9.2, y - 0.45, 2.6, 0.9, "amplifier\nholds V_trans")
        arrow(ax, (11.9, y), (13.0, y))
        ax.text(13.1, y, f"V_in, row {row + 1}", va="center", fontsize=8)
    for column in range(4):
        x, read = 2.0 + 1.8 * column, column == 3
        ax.plot([x, x], [0.9, 8.0], color=READ if read else HELD, lw=2.5 if read else 1.5, zorder=0)
        ax.text(
            x,
            8.4,
            "0 V:\nread" if read else "V_trans",
            ha="center",
            va="center",
            fontsize=8,
            color=READ if read else HELD,
        )
        for row in range(4):
            y = 1.5 + 1.8 * row
            ax.add_patch(Rectangle((x - 0.22, y - 0.22), 0.44, 0.44, facecolor=READ if read else "w", edgecolor="k"))
    ax.set_title("squares: fabric between a row and a column; current flows in the red ones alone", fontsize=9)
    return figure


def layers() -> Figure:
    """Figure 4.2 was a photograph: what lies above what."""
    figure, ax = page(7.5, 3.4, 15.0, 6.6)
    shown = [
        (0.4, 3.0, "#f2dfb5", "polyurethane foam, 10 mm: spreads a load over several taxels"),
        (3.4, 0.5, "#cfe3f5", "film"),
        (3.9, 0.22, "C1", ""),
        (4.12, 0.6, "#d9d2e9", "piezoresistive fabric"),
        (4.72, 0.22, "C0", ""),
        (4.94, 0.5, "#cfe3f5", "film"),
        (5.44, 0.8, "0.75", "what it lies on"),
    ]
    for y, height, colour, says in shown:
        ax.add_patch(Rectangle((0.5, y), 10.0, height, facecolor=colour, edgecolor="0.4", lw=0.6))
        if says:
            ax.text(5.5, y + height / 2, says, ha="center", va="center", fontsize=8)
    ax.text(10.7, 4.0, "64 printed traces: rows", va="center", fontsize=8, color="C1")
    ax.text(10.7, 4.83, "64 printed traces, across: columns", va="center", fontsize=8, color="C0")
    ax.set_title(
        "a cut through the sensor, 17 x 17 cm, 2.67 mm from taxel to taxel (heights are not to scale)", fontsize=9
    )
    return figure


def boards() -> Figure:
    """Figure 4.4 was the layout of two boards: what is on them (Appendix 1, Tables 2.1 and 2.2)."""
    figure, ax = page(8.5, 4.2, 17.0, 8.4)
    ax.text(4.2, 0.5, "column board", ha="center", fontsize=9, weight="bold")
    box(ax, 0.5, 1.0, 7.4, 1.1, "8 shift registers 74HC164: one bit walks over 64 columns")
    box(ax, 0.5, 2.8, 7.4, 1.1, "16 quad switches ADG734: 0 V or V_trans, a column each")
    box(ax, 0.5, 4.6, 7.4, 1.1, "4 headers 8 x 2: to the sensor's columns", "#cfe3f5")
    arrow(ax, (4.2, 2.15), (4.2, 2.75))
    arrow(ax, (4.2, 3.95), (4.2, 4.55))
    ax.text(12.8, 0.5, "row board (analogue)", ha="center", fontsize=9, weight="bold")
    box(ax, 9.1, 1.0, 7.4, 1.1, "4 headers 8 x 2: to the sensor's rows", "#cfe3f5")
    box(ax, 9.1, 2.5, 7.4, 1.1, "17 quad amplifiers OPA4354: 64 rows, and 4 over")
    box(ax, 9.1, 4.0, 7.4, 1.1, "8 multiplexers ADG709: 64 rows onto 16 lines, in 4 steps")
    box(ax, 9.1, 5.5, 7.4, 1.1, "4 quad comparators MCP6564: against the ramp")
    box(ax, 9.1, 7.0, 7.4, 1.1, "VHDCI connector: to the FPGA board (Atlys)", "#cfe3f5")
    for y in (2.15, 3.65, 5.15, 6.65):
        arrow(ax, (12.8, y), (12.8, y + 0.3))
    box(
        ax,
        0.5,
        6.4,
        7.4,
        1.5,
        "ramp: an RC circuit at the Aux ramp port\n"
        "(the current source LM334 that was meant\nfell short near the supply's voltage)",
        "#fbe5d6",
    )
    arrow(ax, (8.0, 7.0), (9.0, 6.1))
    return figure


def readout() -> Figure:
    """Figure 5.9: from a taxel to an event."""
    figure, ax = page(9.0, 3.6, 18.0, 7.0)
    ax.add_patch(Rectangle((0.2, 0.8), 7.0, 5.4, facecolor="#dbe9f6", edgecolor="none", zorder=-2))
    ax.add_patch(Rectangle((7.5, 0.8), 10.2, 5.4, facecolor="#f9dfdc", edgecolor="none", zorder=-2))
    ax.text(3.7, 0.5, "crosstalk is cancelled", ha="center", fontsize=9, color="C0")
    ax.text(12.6, 0.5, "time is converted", ha="center", fontsize=9, color="C3")
    box(ax, 0.5, 1.3, 2.6, 1.5, "a column to 0 V,\nthe others\nto V_trans")
    box(ax, 0.5, 4.0, 2.6, 1.5, "taxel: fabric\nunder a load")
    box(ax, 4.2, 4.0, 2.7, 1.5, "amplifier,\n47 kOhm,\na row")
    box(ax, 7.8, 4.0, 2.2, 1.5, "4 : 1\nmultiplexer")
    box(ax, 10.8, 4.0, 2.6, 1.5, "comparator,\n0.1 V\nhysteresis")
    box(ax, 10.8, 1.3, 2.6, 1.5, "ramp, begun\nwith the timers")
    box(ax, 14.3, 4.0, 3.2, 1.5, "timer, 300 MHz:\nticks to the trip")
    box(ax, 14.3, 1.3, 3.2, 1.5, "further from the\nlast value than the\nnoise floor? event")
    arrow(ax, (1.8, 2.9), (1.8, 3.9))
    for start, end in ((3.2, 4.1), (7.0, 7.7), (10.1, 10.7), (13.5, 14.2)):
        arrow(ax, (start, 4.75), (end, 4.75))
    arrow(ax, (12.1, 2.9), (12.1, 3.9))
    arrow(ax, (15.9, 3.9), (15.9, 2.9))
    return figure


def write() -> None:
    """Write all of them, the same bytes each time."""
    for name, draw in (("lines", lines), ("layers", layers), ("boards", boards), ("readout", readout)):
        with mpl.rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
            draw().savefig(PICTURES / f"sensor-{name}.svg", metadata={"Date": None}, facecolor="white")


if __name__ == "__main__":
    write()
