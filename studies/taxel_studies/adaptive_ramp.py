"""A ramp that adapts to the signal, beside fixed ones: responsive in gross movement, fine in fine control (4.3.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.simulate.circuit import AdaptiveRamp, Converter, Fabric, VirtualGround
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, grid, logarithmic, results, subplots

WHERE = "thesis 4.3.2"
PROTOCOL = (
    "64 columns and four rows of one channel, read by ramps of five lengths, or by one that adapts between 38 and "
    "510 ticks: so long that the fastest taxel moves by four of its ticks in a frame. A taxel and its neighbours "
    "are pressed slowly and held (fine control), then tapped for 6 ms (gross movement); lines are ideal, "
    "comparators without hysteresis, no noise but that of whole ticks. The thesis states neither a rule nor a gain."
)

PARAMETERS: dict[str, Any] = {
    "ramps": [38, 75, 150, 300, 510],
    "rows": 4,
    "columns": 64,
    "period_us": 20.0,
    "press_n": 0.12,
    "tremor": 0.05,
    "tremor_hz": 8.0,
    "tap_n": 0.5,
    "tap_ms": 6.0,
    "taps": 3,
    "fine_ms": 500.0,
    "realisations": 10,
}
SIZES = {"toy": {"realisations": 2, "ramps": [38, 150, 510], "period_us": 40.0, "fine_ms": 200.0}}
#: A tap counts as detected once the reading has risen by this much, V (the least load that the thesis resolves, 4.4.1).
SEEN_V = 0.1
#: Silence before the first tap and between two, ms.
APART_MS = 40.0
PHASES = ("fine", "gross")


def force(p: Parameters, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the load on the middle taxel at even times, N, and when taps begin, us.

    Fine control: a slow press that is held, with a tremor. Gross movement: taps, half a sine each.
    """
    every = p["period_us"]
    t = np.arange(int(1e3 * p["fine_ms"] / every)) * every * 1e-6
    rise = np.clip(t / (0.6e-3 * p["fine_ms"]), 0.0, 1.0)
    swing = 1.0 + p["tremor"] * np.sin(2 * np.pi * (p["tremor_hz"] * t + rng.random()))
    fine = p["press_n"] * rise * swing
    parts, begins = [fine], []
    for _ in range(p["taps"]):
        apart = 1e3 * (APART_MS + 5.0 * rng.random())
        parts.append(np.zeros(int(apart / every)))
        begins.append(every * sum(len(part) for part in parts))
        parts.append(p["tap_n"] * np.sin(np.linspace(0.0, np.pi, int(1e3 * p["tap_ms"] / every))))
    parts.append(np.zeros(int(5e3 / every)))
    return np.concatenate(parts), np.array(begins)


def tasks(p: Parameters) -> list[Task]:
    """List one task a converter and a drawn touch."""
    return grid({**p, "ramps": [None, *p["ramps"]]}, ramp="ramps", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Convert a touch; return the error of the last reading by phase, and when each tap shows in the readings."""
    rng = np.random.default_rng([seed, 432])
    loads, taps = force(params, rng)
    rows, columns, every = params["rows"], params["columns"], params["period_us"]
    away = np.hypot(*np.meshgrid(np.arange(columns) - columns / 2, np.arange(rows) - rows / 2))
    share = np.exp(-((away / 3.0) ** 2)) * np.exp(0.2 * rng.standard_normal(away.shape))
    volts = VirtualGround().volts_alone(Fabric().conductance(loads[:, None, None] * share))
    # Each taxel has its own rest, so that quantisation errors differ between taxels.
    volts += 0.02 * rng.standard_normal(share.shape)
    converter = Converter(hysteresis_v=0.0)
    fixed = params["ramp"]
    ramp = AdaptiveRamp(converter=converter)
    if fixed is not None:
        ramp = AdaptiveRamp(converter=converter, steepest=fixed, gentlest=fixed)
    scans = ramp.convert(volts, period_us=every)
    line_us = converter.line_us + converter.steps * (scans.ramp.astype(float) - converter.ramp) / 300.0
    loaded = np.argwhere(share > 0.2)
    ends = every * int(1e3 * params["fine_ms"] / every)
    # The host's value at each time is the last reading before it.
    t = every * np.arange(len(loads))
    squares = {phase: [0.0, 0] for phase in PHASES}
    late: list[float] = []
    tapped = np.zeros(len(t), bool)
    for tap in taps:
        tapped |= (t >= tap) & (t < tap + 1e3 * params["tap_ms"])
    for y, x in loaded.tolist():
        sampled_us = scans.t_us + x * line_us
        last = np.searchsorted(sampled_us, t, side="right") - 1
        known = last >= 0
        wrong = scans.volts[last[known], y, x] - volts[known, y, x]
        for phase, when in (("fine", t[known] < ends), ("gross", tapped[known])):
            squares[phase][0] += float((wrong[when] ** 2).sum())
            squares[phase][1] += int(when.sum())
    y, x = loaded[np.argmax(share[loaded[:, 0], loaded[:, 1]])].tolist()
    sampled_us = scans.t_us + x * line_us
    for tap in taps:
        before = scans.volts[max(0, int(np.searchsorted(sampled_us, tap)) - 1), y, x]
        after = np.flatnonzero((sampled_us >= tap) & (scans.volts[:, y, x] > before + SEEN_V))
        late.append(float(sampled_us[after[0]] - tap) if len(after) else float("nan"))
    return {
        "rms_mv": {phase: 1e3 * float(np.sqrt(s / max(1, n))) for phase, (s, n) in squares.items()},
        "late_us": late,
        "frames_a_s": {
            "fine": float((scans.t_us < ends).sum() / (1e-6 * ends)),
            "gross": float(np.median(1e6 / (columns * line_us[np.searchsorted(scans.t_us, taps + 2e3)]))),
        },
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return each converter's error in each phase, its delay until a tap shows, and its scan rate."""
    summary: Summary = {"ramps": {}}
    for name in [None, *p["ramps"]]:
        here = results(rows, ramp=name)
        late = np.concatenate([one["late_us"] for one in here])
        summary["ramps"]["adaptive" if name is None else str(name)] = {
            "rms_mv": {phase: float(np.median([one["rms_mv"][phase] for one in here])) for phase in PHASES},
            "late_us": float(np.nanmedian(late)),
            "unseen": int(np.isnan(late).sum()),
            "frames_a_s": {phase: float(np.median([one["frames_a_s"][phase] for one in here])) for phase in PHASES},
        }
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.3.2 says."""
    ramps = dict(summary["ramps"])
    own = ramps.pop("adaptive")
    gentle, steep = ramps[str(max(p["ramps"]))], ramps[str(min(p["ramps"]))]

    def wrong(one: dict[str, Any], phase: str) -> float:
        return float(one["rms_mv"][phase])

    def whole(one: dict[str, Any]) -> float:
        """Return the largest ratio, over the phases, of a converter's error to that of the best fixed ramp."""
        return max(wrong(one, phase) / min(wrong(other, phase) for other in ramps.values()) for phase in PHASES)

    best = min(ramps, key=lambda name: whole(ramps[name]))
    yield Judgement(
        12,
        f"wrong by {wrong(own, 'fine'):.1f} mV with the adaptive ramp, {wrong(gentle, 'fine'):.1f} with the "
        f"gentlest, {wrong(steep, 'fine'):.1f} with the steepest",
        wrong(own, "fine") <= 1.1 * wrong(gentle, "fine"),
    )
    yield Judgement(
        13,
        f"during taps wrong by {wrong(own, 'gross'):.0f} mV with the adaptive ramp, {wrong(gentle, 'gross'):.0f} "
        f"with the gentlest, {wrong(steep, 'gross'):.0f} with the steepest",
        wrong(own, "gross") <= 0.7 * wrong(gentle, "gross"),
        "the host holds the last reading: what moved since is its error",
    )
    yield Judgement(
        14,
        f"at most {whole(own):.2f} times as wrong as the best fixed ramp of each phase; the best single fixed one, "
        f"{best} ticks, {whole(ramps[best]):.2f} times",
        whole(own) < whole(ramps[best]),
    )
    yield Judgement(
        201,
        f"{own['late_us']:.0f} us after it begins (median), {gentle['late_us']:.0f} with the gentlest, "
        f"{steep['late_us']:.0f} with the steepest ramp",
        None,
        "it turns steep by what a gentle frame has shown",
    )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw the two errors against each other."""
    figure, ax = subplots(6, 4)
    for name, one in summary["ramps"].items():
        own = name == "adaptive"
        at = (one["rms_mv"]["fine"], one["rms_mv"]["gross"])
        ax.plot(*at, "o" if own else "s", color="C3" if own else "C0")
        ax.annotate(name if own else f"{name} ticks", at, (0, 6), textcoords="offset points", ha="center")
    ax.set(xlabel="fine control, mV rms", ylabel="taps, mV rms")
    logarithmic(ax, x=[1, 2, 5, 10, 20, 50], y=[20, 30, 50, 70, 100])
    ax.margins(0.25, 0.2)
    return figure
