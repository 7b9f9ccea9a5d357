"""Draw the pins of the simulated logic while a line is read, for docs/hardware.md.

Usage: .venv/bin/python rtl/tools/waveforms.py
"""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "rtl" / "dv"))

from logic import Logic  # noqa: E402

PICTURES = ROOT / "docs" / "pictures"
#: The four instants of 20 ns in which a clock rises, ns.
INSTANTS = (0.0, 20 / 3, 10.0, 40 / 3)
#: Half a clock of the converter, ns: a tick.
TICK = 10 / 3
#: Pins in the order of the bench's bits.
PINS = (
    "frame_sync_out",
    "row_read_sync",
    "col_change_sync",
    "col_read_sync",
    "csel_reg_clk_out",
    "csel_reg_din_out",
)
#: When the comparator that is drawn trips, ticks after the ramp's rise, by step.
TRIPS = (30, 60, 90, 120)


def simulated(ns: float) -> tuple[Any, dict[str, Any]]:
    """Run 64 x 64 taxels with 16 channels from a frame's edge on; return times, ns, and the levels of the pins."""
    logic = Logic(64, 64, 16)
    ticks = np.zeros((64, 64), np.uint16)
    # Of channel 0 the sense lines are 0 to 3, one a step.
    ticks[:4] = np.array(TRIPS)[:, None]
    logic.ticks(ticks)
    for _ in range(3):
        logic.edge()
    times, rows, turn = [], [], 0.0
    before = -1
    while not times or times[-1] < ns:
        bits = logic.call("instant")
        phase = bits & 3
        turn += 20.0 if phase <= before else 0.0
        before = phase
        times.append(turn + INSTANTS[phase])
        rows.append(bits)
    at, found = np.array(times) - times[0], np.array(rows)
    levels = {name: found >> 2 + k & 1 for k, name in enumerate(PINS)}
    halves = {}
    # Ramp and comparators have two levels a clock of the converter, which rises in all instants but the third.
    fast = (found & 3) != 2
    for name, bit in (("ramp", 8), ("comparators[0]", 10)):
        times_of = np.stack([at[fast], at[fast] + TICK], 1).ravel()
        halves[name] = times_of, np.stack([found[fast] >> bit & 1, found[fast] >> bit + 1 & 1], 1).ravel()
    return at, {name: (at, level) for name, level in levels.items()} | {"rsel": (at, found >> 12)} | halves


def drawn(pins: dict[str, Any], names: tuple[str, ...], begin: float, end: float, title: str) -> Figure:
    """Draw pins from one time to another, ns."""
    figure = Figure(figsize=(9.5, 0.42 * len(names) + 1.0), layout="constrained")
    ax = figure.subplots()
    for row, name in enumerate(names):
        times, level = pins[name]
        if name == "rsel":
            changes = [begin, *times[np.flatnonzero(np.diff(level)) + 1], end]
            for start, stop in itertools.pairwise(changes):
                if start < end and stop > begin and stop > start:
                    here = level[np.searchsorted(times, max(start, begin), "right") - 1]
                    low, high = max(start, begin), min(stop, end)
                    ax.fill_between([low, high], -row, -row + 0.7, facecolor="0.93", edgecolor="k", lw=0.8)
                    ax.text((low + high) / 2, -row + 0.33, str(here), ha="center", va="center", fontsize=8)
            continue
        ax.step(times, 0.7 * level - row, where="post", color="C3" if name == "ramp" else "k", lw=1)
    ax.set_xlim(begin, end)
    ax.set_yticks([0.35 - row for row in range(len(names))], names, fontsize=8, family="monospace")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("ns from the start of a line", fontsize=8)
    ax.tick_params(axis="x", labelsize=8)
    ax.grid(axis="x", color="0.9", lw=0.5)
    ax.spines[["left", "top", "right"]].set_visible(False)
    ax.set_title(title, fontsize=9)
    return figure


def rises(pin: tuple[Any, Any]) -> list[float]:
    """Return when a pin rises, ns."""
    times, level = pin
    return [float(t) for t in times[1:][(level[1:] == 1) & (level[:-1] == 0)]]


def main() -> int:
    """Draw both pictures, and print what the page says in numbers."""
    _, pins = simulated(6100)
    lines = [t for t in rises(pins["csel_reg_clk_out"]) if t > 100]
    line = lines[0] - 40
    shown = {name: (times - line, level) for name, (times, level) in pins.items()}
    names = (*PINS[1:], "rsel", "ramp", "comparators[0]")
    read = next(t for t in rises(shown["col_read_sync"]) if t > 0)
    ramp = next(t for t in rises(shown["ramp"]) if t > read)
    print(f"the ramp rises {ramp - read:.1f} ns after col_read_sync")
    pictures = {
        "board-line": (names, -100.0, 3100.0, "a line of four steps: 64 x 64 taxels, 16 channels, 5.2 kHz"),
        "board-read": (names[2:], read - 250, read + 650, f"a read: channel 0 trips {TRIPS[0]} ticks (100 ns) after the ramp's rise"),
    }  # fmt: skip
    with mpl.rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
        for name, (rows, begin, end, title) in pictures.items():
            drawn(shown, rows, begin, end, title).savefig(
                PICTURES / f"{name}.svg", metadata={"Date": None}, facecolor="white"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
