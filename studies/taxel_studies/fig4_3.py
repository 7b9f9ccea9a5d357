"""Figure 4.3: single-slope conversion, from the input to the time until the ramp passes it (thesis 4.3.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.simulate.circuit import Converter
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, subplots

WHERE = "thesis 4.3.2, figure 4.3"
PROTOCOL = (
    "One comparator with 0.1 V of hysteresis, a ramp of 150 ticks of 1/300 us that ends at 3 V: the board's RC "
    "curve towards 5 V, and a straight one. Inputs from 0.5 to 3.4 V, each settled."
)

PARAMETERS: dict[str, Any] = {
    "shapes": ["rc", "linear"],
    "ramp": 150,
    "least_v": 0.5,
    "most_v": 3.4,
    "points": 291,
    "drawn_v": 2.0,
}
SIZES = {"toy": {"points": 59}}
#: Ticks of the counter in 1 us.
TICKS_A_US = 300.0


tasks = partial(grid, shape="shapes")


def realise(params: dict[str, Any], _seed: int) -> dict[str, Any]:
    """Convert a row of inputs, each settled, and trace one conversion."""
    converter = Converter(shape=params["shape"], ramp=params["ramp"], steps=1)
    volts = np.linspace(params["least_v"], params["most_v"], params["points"])
    ticks = np.array([converter.ticks([[v]]) for v in volts]).ravel()
    trace = converter.trace([params["drawn_v"]], every_us=0.005, stop_us=0.75)
    return {
        "volts": volts.round(6).tolist(),
        "elapsed_us": (ticks / TICKS_A_US).round(9).tolist(),
        "trace": {
            "t_us": trace.t_us.round(6).tolist(),
            "input_v": trace.input_v.round(6).tolist(),
            "ramp_v": trace.ramp_v.round(6).tolist(),
            "high": trace.high.astype(int).tolist(),
        },
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return for each shape whether the time grows, up to which input, and how far it is from a straight line."""
    summary: Summary = {"shapes": {}}
    for row in rows:
        volts, elapsed = np.array(row.result["volts"]), np.array(row.result["elapsed_us"])
        whole = p["ramp"] / TICKS_A_US
        within = elapsed < whole - 1e-9
        line = np.polyfit(volts[within], elapsed[within], 1)
        summary["shapes"][row.params["shape"]] = {
            **row.result,
            "grows": bool((np.diff(elapsed[within]) > 0).all() and (np.diff(elapsed) >= -1e-9).all()),
            "ends_v": round(float(volts[within].max()), 3),
            "bent_us": round(float(np.abs(np.polyval(line, volts[within]) - elapsed[within]).max()), 5),
        }
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.3.2 says."""
    for shape, one in summary["shapes"].items():
        reading = "RC ramp" if shape == "rc" else "linear ramp"
        yield Judgement(
            10,
            f"grows up to {one['ends_v']:g} V; above that it is the ramp's {p['ramp'] / TICKS_A_US:g} us",
            one["grows"],
            reading=reading,
        )
        straight = one["bent_us"] < 1e-3
        yield Judgement(
            11,
            f"within {1e3 * one['bent_us']:.1f} ns of a straight line",
            straight,
            "" if straight else "an RC ramp flattens, so that later voltages are resolved more finely",
            reading,
        )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw one conversion as 4.3 does, and the time against the input for both ramps."""
    figure, (left, right) = subplots(9, 3.8, 1, 2)
    trace = next(iter(summary["shapes"].values()))["trace"]
    left.plot(trace["t_us"], trace["ramp_v"], color="C3", label="V_ramp")
    left.plot(trace["t_us"], trace["input_v"], color="C2", label="V_in")
    left.step(trace["t_us"], trace["high"], color="C0", where="post", label="V_comp (high: 1)")
    left.set(xlabel="time, us", ylabel="V")
    left.legend(fontsize="small", loc="upper right")
    for number, (shape, one) in enumerate(summary["shapes"].items()):
        right.plot(one["volts"], one["elapsed_us"], color=f"C{number}", label=f"{shape} ramp")
    right.set(xlabel="V_in, V", ylabel="t_elapsed, us")
    right.legend(fontsize="small")
    return figure
