"""Figure 4.7: how soon the transducer responds, and how soon the input settles while four channels are multiplexed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.simulate.circuit import Converter, Fabric, VirtualGround
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, subplots

WHERE = "thesis 4.4.1, figure 4.7"
PROTOCOL = (
    "(a) 0.5 N within 5 us on one taxel whose fabric answers 50 us late. (b) One comparator reads four lines, "
    "loaded by 0.02, 0.6, 0.1 and 0.3 N, 0.75 us each, at 3 us a column; settled is within 2 % of the step. Then "
    "the same with amplifiers of 47 kOhm x 15 pF, and a column at rest behind the loaded one."
)

PARAMETERS: dict[str, Any] = {
    "delay_us": 50.0,
    "rise_us": 5.0,
    "impact_n": 0.5,
    "forces_n": [0.02, 0.6, 0.1, 0.3],
    "amplifiers_us": [0.0, 0.705],
    "every_us": 0.002,
    "settled": 0.02,
}
SIZES = {"toy": {"every_us": 0.01}}
#: When the thesis' input has settled, us.
SETTLED_US = 0.2


tasks = partial(grid, amplifier_us="amplifiers_us")


def realise(params: dict[str, Any], _seed: int) -> dict[str, Any]:
    """Read four lines of one channel; then two columns of which the first was pressed and the second was not."""
    converter = Converter(amplifier_us=params["amplifier_us"])
    lines = VirtualGround().volts(Fabric().conductance(np.array(params["forces_n"]))[:, None]).ravel()
    trace = converter.trace(lines.tolist(), every_us=params["every_us"], stop_us=2 * converter.line_us)
    second = trace.t_us >= converter.line_us
    settling_us = []
    for step in range(converter.steps):
        begins = converter.line_us + step * converter.step_us
        here = second & (trace.t_us >= begins) & (trace.t_us < begins + converter.step_us)
        off = np.abs(trace.input_v - trace.line_v)[here]
        last = np.flatnonzero(off > params["settled"] * off[0])
        settling_us.append(float(trace.t_us[here][last[-1]] - begins) if len(last) else 0.0)
    pressed = np.stack([lines, np.full(len(lines), VirtualGround().v_trans)], axis=1)
    plain = Converter().ticks(np.stack([pressed[:, 1:]] * 2))[1].ravel()
    left = converter.ticks(np.stack([pressed] * 2))[1][:, 1]
    return {
        "trace": {name: getattr(trace, name)[second].round(6).tolist() for name in ("t_us", "input_v", "ramp_v")}
        | {"high": trace.high[second].astype(int).tolist()},
        "settles_us": np.round(settling_us, 4).tolist(),
        "left_ticks": np.round(left - plain, 3).tolist(),
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Strike one taxel at time 0, and list the scans by time constant."""
    return {"impact": _impact(p), "scans": [{"amplifier_us": r.params["amplifier_us"], **r.result} for r in rows]}


def _impact(p: Parameters) -> dict[str, Any]:
    """Strike one taxel at time 0: the fabric conducts by the force of `delay_us` before."""
    t = np.arange(-20.0, 120.0, 0.5)
    force = p["impact_n"] * np.clip((t - p["delay_us"]) / p["rise_us"], 0.0, 1.0)
    volts = VirtualGround().volts(Fabric().conductance(force).reshape(-1, 1, 1)).ravel()
    moved = t[np.argmax(volts > volts[0] + 1e-6)]
    return {"t_us": t.tolist(), "volts": volts.round(6).tolist(), "moved_us": round(float(moved), 3)}


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.4.1 says."""
    yield Judgement(
        18,
        f"V_in begins to move {summary['impact']['moved_us']:g} us after the impact",
        None,
        "the fabric's delay is taken over from here, so it is no test; on the board the scan adds 0 to 192 us",
    )
    for scan in summary["scans"]:
        worst = max(scan["settles_us"])
        if scan["amplifier_us"] == 0:
            yield Judgement(
                19,
                f"to {100 * p['settled']:g} % of the step within {worst:.3f} us, in each of the four steps",
                None if worst <= SETTLED_US + p["every_us"] else False,
                "the multiplexer's time constant, 0.05 us, is chosen for it, so it is no test; no part states one",
                "no capacitor across R_f",
            )
        else:
            yield Judgement(
                19,
                "an unpressed column behind a pressed one reads "
                + ", ".join(f"{t:.1f}" for t in scan["left_ticks"])
                + " ticks too many in its four steps",
                None,
                "what a lab can measure: none if the capacitors lie elsewhere",
                f"the board's 15 pF across R_f ({scan['amplifier_us']:g} us)",
            )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw 4.7: the impact, and one comparator's input, ramp and output over a column."""
    figure, (left, right) = subplots(10, 3.8, 1, 2, width_ratios=[1, 1.6])
    left.plot(summary["impact"]["t_us"], summary["impact"]["volts"], color="C2")
    left.axvline(0.0, color="k", ls=":", lw=0.9)
    left.set(xlabel="time since the impact, us", ylabel="V_in, V", title="(a)")
    trace = summary["scans"][0]["trace"]
    t = np.array(trace["t_us"]) - trace["t_us"][0]
    right.plot(t, trace["ramp_v"], color="C3", label="V_ramp")
    right.plot(t, trace["input_v"], color="C2", label="V_in")
    right.step(t, trace["high"], color="C0", where="post", label="V_comp (high: 1)")
    right.set(xlabel="time since the column's change, us", ylabel="V", title="(b)")
    right.legend(fontsize="small", loc="upper right")
    return figure
