"""Draw the diagrams of the page of the sensor and its analogue side: python docs/diagrams.py."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

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


def wire(ax: Axes, *places: tuple[float, float]) -> None:
    """Draw a wire from place to place."""
    x, y = zip(*places, strict=True)
    ax.plot(x, y, color="k", lw=1, solid_joinstyle="miter")


def node(ax: Axes, x: float, y: float) -> None:
    """Draw where wires meet."""
    ax.add_patch(Circle((x, y), 0.07, color="k"))


def resistor(ax: Axes, x: float, y: float, value: str, *, upright: bool = False) -> None:
    """Draw a resistor about a place."""
    width, height = (0.3, 0.8) if upright else (0.8, 0.3)
    ax.add_patch(Rectangle((x - width / 2, y - height / 2), width, height, facecolor="w", edgecolor="k", zorder=3))
    beside = (x + 0.3, y, "left", "center") if upright else (x, y - 0.25, "center", "bottom")
    ax.text(beside[0], beside[1], value, ha=beside[2], va=beside[3], fontsize=7.5)


def capacitor(ax: Axes, x: float, y: float, value: str, *, upright: bool = False) -> None:
    """Draw a capacitor about a place; upright where its plates lie."""
    for side in (-0.08, 0.08):
        ends = ([x - 0.25, x + 0.25], [y + side] * 2) if upright else ([x + side] * 2, [y - 0.25, y + 0.25])
        ax.plot(*ends, color="k", lw=1.4, zorder=4)
    ax.add_patch(Rectangle((x - 0.08, y - 0.08), 0.16, 0.16, facecolor="w", edgecolor="none", zorder=3))
    beside = (x + 0.35, y, "left", "center") if upright else (x, y - 0.3, "center", "bottom")
    ax.text(beside[0], beside[1], value, ha=beside[2], va=beside[3], fontsize=7.5)


def ground(ax: Axes, x: float, y: float) -> None:
    """Draw ground below a place."""
    for k in range(3):
        ax.plot([x - 0.24 + 0.08 * k, x + 0.24 - 0.08 * k], [y + 0.1 * k] * 2, color="k", lw=1)


def amplifier(ax: Axes, x: float, y: float, name: str, signs: str = "-+") -> None:
    """Draw an amplifier or a comparator with inputs at y - 0.4 and y + 0.4, and its output at x + 1.6."""
    ax.add_patch(Polygon([(x, y - 0.8), (x, y + 0.8), (x + 1.6, y)], facecolor="0.95", edgecolor="k", zorder=2))
    for sign, down in zip(signs, (-0.4, 0.4), strict=True):
        ax.text(x + 0.2, y + down, sign, ha="center", va="center", fontsize=9)
    ax.text(x + 0.45, y, name, ha="left", va="center", fontsize=6.5)


def channel() -> Figure:
    """One channel: fabric, transimpedance amplifier, comparator with hysteresis."""
    figure, ax = page(10.0, 4.4, 20.0, 8.8)
    # The taxel, between the driven line at 0 V and the sense line.
    wire(ax, (1.2, 3.0), (4.6, 3.0))
    wire(ax, (1.2, 3.0), (1.2, 5.6))
    resistor(ax, 1.2, 4.0, "taxel, 1/G", upright=True)
    ax.add_patch(Rectangle((0.7, 5.6), 1.0, 0.9, facecolor="#cfe3f5", edgecolor="k"))
    ax.text(1.2, 6.05, "ADG734", ha="center", va="center", fontsize=7)
    wire(ax, (1.0, 6.5), (1.0, 7.2))
    ground(ax, 1.0, 7.2)
    ax.text(1.85, 6.3, "0 V while its line is read,\nV_trans else", fontsize=7, va="center")
    ax.text(2.7, 2.85, "sense line", fontsize=7.5, ha="center", va="bottom")
    amplifier(ax, 4.6, 3.4, "OPA4354")
    wire(ax, (4.6, 3.8), (3.9, 3.8), (3.9, 4.6))
    ax.text(3.9, 4.95, "V_trans\n1.3 V", fontsize=7.5, ha="center", va="center")
    node(ax, 4.2, 3.0)
    wire(ax, (4.2, 3.0), (4.2, 1.0), (6.6, 1.0), (6.6, 3.4))
    wire(ax, (4.2, 1.9), (6.6, 1.9))
    resistor(ax, 5.4, 1.9, "R_f 47 kOhm")
    capacitor(ax, 5.4, 1.0, "C_f about 1 pF")
    node(ax, 4.2, 1.9)
    node(ax, 6.6, 1.9)
    node(ax, 6.6, 3.4)
    wire(ax, (6.2, 3.4), (8.4, 3.4))
    ax.text(7.4, 3.3, "V_in", fontsize=8, ha="center", va="bottom")
    ax.add_patch(Rectangle((8.4, 2.9), 1.5, 1.0, facecolor="#f2f2f2", edgecolor="k", ls="--"))
    ax.text(9.15, 3.4, "ADG709\n4 : 1", ha="center", va="center", fontsize=7)
    ax.text(9.15, 2.75, "16 channels only", ha="center", va="bottom", fontsize=7)
    wire(ax, (9.9, 3.4), (13.4, 3.4))
    amplifier(ax, 13.4, 3.8, "MCP6564", "-+")
    # The ramp, with the hysteresis at the comparator's positive input.
    wire(ax, (9.4, 6.4), (12.6, 6.4), (12.6, 4.2), (13.4, 4.2))
    ax.text(9.3, 6.4, "V_ramp,\nbuffered", fontsize=7.5, ha="right", va="center")
    resistor(ax, 11.2, 6.4, "R_1 1 kOhm")
    node(ax, 12.6, 6.4)
    wire(ax, (12.6, 6.4), (15.9, 6.4), (15.9, 3.8))
    resistor(ax, 14.3, 6.4, "R_2 33 kOhm")
    wire(ax, (15.0, 3.8), (17.3, 3.8))
    node(ax, 15.9, 3.8)
    resistor(ax, 16.7, 3.8, "33 Ohm")
    arrow(ax, (17.1, 3.8), (18.2, 3.8))
    ax.text(18.3, 3.8, "comparators[k],\n3.3 V: high from\nV_ramp > V_in on", fontsize=7, va="center")
    ax.text(5.4, 7.9, "amplifiers 3.3 V, switches 5 V", fontsize=7.5, ha="center", color="0.3")
    ax.text(14.4, 7.9, "comparators: 3.3 V", fontsize=7.5, ha="center", color="0.3")
    ax.set_title("one channel (a proposal: no board of it was built)", fontsize=9)
    return figure


def ramp_circuit() -> Figure:
    """Draw the ramp: charging by a resistor, discharging by a diode, and a buffer for every 16 comparators."""
    figure, ax = page(9.0, 3.3, 18.0, 6.6)
    ax.text(0.3, 2.0, "ramp\n3.3 V", fontsize=7.5, va="center")
    wire(ax, (1.4, 2.0), (2.2, 2.0))
    box(ax, 2.2, 1.5, 2.3, 1.0, "74AHCT1G125\nat 5 V")
    wire(ax, (4.55, 2.0), (9.8, 2.0))
    resistor(ax, 6.6, 2.0, "R_r, by the preset")
    node(ax, 5.4, 2.0)
    node(ax, 8.0, 2.0)
    wire(ax, (5.4, 2.0), (5.4, 3.6), (8.0, 3.6), (8.0, 2.0))
    ax.add_patch(Polygon([(7.0, 3.35), (7.0, 3.85), (6.4, 3.6)], facecolor="k", edgecolor="k", zorder=3))
    ax.plot([6.4, 6.4], [3.35, 3.85], color="k", lw=1.4, zorder=3)
    ax.text(6.7, 4.15, "BAT54: falls back", fontsize=7.5, ha="center", va="center")
    wire(ax, (8.8, 2.0), (8.8, 5.2))
    node(ax, 8.8, 2.0)
    capacitor(ax, 8.8, 3.9, "C_r 1 nF, C0G", upright=True)
    ground(ax, 8.8, 5.2)
    amplifier(ax, 9.8, 1.6, "OPA4354")
    wire(ax, (9.8, 1.2), (9.4, 1.2), (9.4, 0.4), (12.0, 0.4), (12.0, 1.6))
    wire(ax, (11.4, 1.6), (13.2, 1.6))
    node(ax, 12.0, 1.6)
    resistor(ax, 12.7, 1.6, "22 Ohm")
    arrow(ax, (13.1, 1.6), (14.4, 1.6))
    ax.text(14.5, 1.6, "V_ramp to 16 comparators\n(64: four such buffers)", fontsize=7.5, va="center")
    ax.set_title("the ramp (a proposal: no board of it was built)", fontsize=9)
    return figure


def ramp_curve() -> Figure:
    """Draw the ramp over its time, and where inputs trip it."""
    figure = Figure(figsize=(7.5, 3.2), layout="constrained")
    ax = figure.subplots()
    tick = np.arange(0, 151)
    volts = 5.0 * (1 - 0.4 ** (tick / 150))
    ax.plot(tick, volts, color="C3", lw=1.5)
    for force, us in ((0.0, 0.1), (0.02, 1.74), (0.1, 5.16), (0.5, 15.71)):
        level = 1.3 * (1 + 0.047 * us)
        at = 150 * np.log(1 - level / 5.0) / np.log(0.4)
        ax.plot([0, at, at], [level, level, 0], color="0.6", lw=0.8)
        low = force in (0.0,)
        ax.text(
            1,
            level - 0.04 if low else level + 0.02,
            f"{force:g} N: {level:.2f} V, tick {at:.0f}",
            fontsize=7.5,
            va="top" if low else "bottom",
        )
    ax.set_xlim(0, 150)
    ax.set_ylim(0, 3.05)
    ax.set_xlabel("ticks of 3.33 ns from the ramp's rise", fontsize=8)
    ax.set_ylabel("V", fontsize=8)
    ax.tick_params(labelsize=8)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set_title("V_ramp of 150 ticks, and V_in of a taxel under a force (the fabric's law is a reading)", fontsize=9)
    return figure


#: All of them by their files' names.
DIAGRAMS = {
    "sensor-lines": lines,
    "sensor-layers": layers,
    "sensor-boards": boards,
    "sensor-readout": readout,
    "analogue-channel": channel,
    "analogue-ramp": ramp_circuit,
    "analogue-ticks": ramp_curve,
}


def write() -> None:
    """Write all of them, the same bytes each time."""
    for name, draw in DIAGRAMS.items():
        with mpl.rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
            draw().savefig(PICTURES / f"{name}.svg", metadata={"Date": None}, facecolor="white")


if __name__ == "__main__":
    write()
