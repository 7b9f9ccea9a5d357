"""Figure 4.6: the input of one taxel against its load, at two voltages of the lines (thesis 4.4.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.simulate.circuit import Converter, Fabric, VirtualGround
from taxel.wire import Registers
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, results, subplots

WHERE = "thesis 4.4.1, figure 4.6"
PROTOCOL = (
    "One taxel of 64 x 64 loaded, all others at rest, R_f 47 kOhm, through the exact network (switches of 2.5 ohm, "
    "amplifiers of gain 1e5) and an RC ramp of 150 ticks. The fabric: G0 + k F^0.7, with 1.64 uS at 0.02 N; taxels "
    "differ by 20 % in k (all guesses). The first is the law itself."
)

PARAMETERS: dict[str, Any] = {
    "v_trans": [1.3, 0.5],
    "feedback_kohm": 47.0,
    "size": 64,
    "at": [31, 33],
    "loads": 46,
    "least_n": 0.001,
    "most_n": 30.0,
    "exponent": 0.7,
    "gain_spread": 0.2,
    "realisations": 100,
}
SIZES = {"toy": {"realisations": 4, "size": 8, "at": [3, 4], "loads": 24}}
#: The load that the thesis says is detected, N.
SEEN_N = 0.02


#: The first taxel that is drawn is the law itself.
tasks = partial(grid, v_trans="v_trans", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Load one taxel of the array, all others at rest: its voltage and its ticks."""
    random = np.random.default_rng(seed)
    law = Fabric(exponent=params["exponent"])
    gain = float(np.exp(params["gain_spread"] * random.standard_normal())) if seed else 1.0
    fabric = Fabric(touch_us=law.touch_us * gain, exponent=params["exponent"])
    loads = np.geomspace(params["least_n"], params["most_n"], params["loads"])
    # One of the loads is exactly the one that the thesis detects.
    loads[np.abs(np.log(loads / SEEN_N)).argmin()] = SEEN_N
    loads = np.concatenate([[0.0], loads])
    x, y = params["at"]
    g = np.full((params["size"], params["size"]), law.rest_us)
    lines = VirtualGround(v_trans=params["v_trans"], feedback_kohm=params["feedback_kohm"])
    volts = []
    for conductance in fabric.conductance(loads):
        g[y, x] = conductance
        volts.append(lines.volts(g)[y, x])
    ticks = Converter(steps=1).ticks(np.array(volts)[None])[0] if volts else np.zeros(0)
    return {
        "loads": loads.tolist(),
        "volts": np.round(volts, 6).tolist(),
        "ticks": np.floor(ticks).astype(int).tolist(),
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return for each voltage the law's curve, the taxels that detect 0.02 N, and where ramp and amplifier saturate."""
    floor, ramp = Registers().noise_floor, Registers().ramp
    summary: Summary = {"floor": floor, "ramp": ramp, "lines": []}
    for v_trans in p["v_trans"]:
        here = results(rows, v_trans=v_trans)
        loads = np.array(here[0]["loads"])
        volts, ticks = (np.array([r[name] for r in here]) for name in ("volts", "ticks"))
        at = int(np.flatnonzero(loads == SEEN_N)[0])
        # An event is a change by more than the noise floor.
        first = [loads[np.argmax(t - t[0] > floor)] if (t - t[0] > floor).any() else np.nan for t in ticks]
        ends = [loads[np.argmax(t >= ramp)] if (t >= ramp).any() else np.nan for t in ticks]
        summary["lines"].append(
            {
                "v_trans": v_trans,
                "loads": loads.tolist(),
                "volts": volts[0].tolist(),
                "between": np.percentile(volts, [5, 95], axis=0).round(5).tolist(),
                "gained_v": round(float(volts[0, at] - volts[0, 0]), 5),
                "gained_ticks": int(ticks[0, at] - ticks[0, 0]),
                "seen": round(float(np.mean(ticks[:, at] - ticks[:, 0] > floor)), 4),
                "least_n": round(float(np.nanmedian(first)), 5),
                "most_n": round(float(np.nanmedian(ends)), 4),
                "straight": round(_straight(loads, volts[0]), 5),
            }
        )
    return summary


def _straight(loads: np.ndarray[Any, Any], volts: np.ndarray[Any, Any]) -> float:
    """Return the share of the variance that a line over log load explains, below saturation."""
    below = (loads > 0) & (volts < volts.max() - 1e-6)
    return float(np.corrcoef(np.log(loads[below]), volts[below])[0, 1] ** 2)


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.4.1 says."""
    lines = {line["v_trans"]: line for line in summary["lines"]}
    high, low = lines[max(lines)], lines[min(lines)]
    full = p["realisations"] >= PARAMETERS["realisations"]
    yield Judgement(
        15,
        f"{high['gained_v']:.3f} V and {high['gained_ticks']} ticks more than at rest; {100 * high['seen']:.0f} % "
        f"of taxels say so beyond a noise floor of {summary['floor']} ticks, the median one from "
        f"{high['least_n']:.3g} N on",
        high["seen"] >= 0.95 if full else None,
        "the fabric's law is laid through this figure (0.1 V at 0.02 N), so what is tested is the converter and "
        "how far taxels differ (a guess: 20 %)",
    )
    yield Judgement(
        16,
        f"{low['gained_v']:.3f} V at {SEEN_N:g} N, seen by {100 * low['seen']:.0f} %; the median taxel from "
        f"{low['least_n']:.3g} N on",
        low["least_n"] > high["least_n"],
    )
    yield Judgement(
        17,
        f"the ramp ends at {high['most_n']:.3g} N ({high['v_trans']:g} V) and {low['most_n']:.3g} N "
        f"({low['v_trans']:g} V); from the least to the most: {high['most_n'] / high['least_n']:.0f} and "
        f"{low['most_n'] / low['least_n']:.0f} times",
        high["most_n"] < low["most_n"],
    )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 4.6: V_in over load, semi-log; 90 % of taxels in the band."""
    figure, ax = subplots(6.5, 4.2)
    for line, colour in zip(summary["lines"], ("C0", "C3", "C2", "C1"), strict=False):
        ax.semilogx(line["loads"][1:], line["volts"][1:], color=colour, label=f"V_trans = {line['v_trans']:g} V")
        ax.fill_between(line["loads"][1:], *(edge[1:] for edge in line["between"]), color=colour, alpha=0.2, lw=0)
    ax.axhline(3.0, color="0.6", lw=0.8)
    ax.annotate("the ramp's end", (p["least_n"], 3.0), va="bottom", fontsize="small")
    ax.axvline(SEEN_N, color="0.6", lw=0.8, ls=":")
    ax.set(xlabel="load on one taxel, N", ylabel="V_in, V")
    ax.legend(fontsize="small", loc="upper left")
    return figure
