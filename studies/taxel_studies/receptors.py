"""Responses of SA-1, FA-1, SA-2 and FA-2 to ramp and hold, and to sines of all frequencies (thesis 2.1.5, 3.3, 7.2).

Published: the phases of a ramp-and-hold in which each type fires; the frequency at which its threshold of one spike a
cycle is least, near 5 Hz (SA-1), 34 Hz (FA-1) and 200 to 250 Hz (FA-2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.encode import FA1, FA2, SA1, SA2, Encoder
from taxel.frames import Frames
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, subplots

WHERE = "thesis 2.1.5, 3.3 and 7.2, which asks for the types beside FA-1"
PROTOCOL = (
    "One afferent a type, with its defaults, every 0.2 ms; FA-1's threshold decays by the ms. Half of the "
    "range is pressed within 5 or 200 ms, held for 1 s and let go: spikes by phase. Sines from contact on, 200 sizes: "
    "the least that gives a spike in every cycle. Times and thresholds of SA-1 and FA-2 were fitted to these published "
    "frequencies, so that they agree is no discovery; FA-1 is the thesis', and was fitted to nothing."
)

PARAMETERS: dict[str, Any] = {
    "kinds": ["SA-1", "FA-1", "SA-2", "FA-2"],
    "frequencies_hz": [1, 2, 3, 5, 7, 10, 15, 20, 34, 50, 70, 100, 150, 200, 225, 250, 300, 400],
    "amplitudes": 200,
    "ramps_ms": [5.0, 200.0],
    "period_ms": 0.2,
}
SIZES = {"toy": {"frequencies_hz": [5, 34, 225], "amplitudes": 12}}
#: Full scale of all of them, kPa, and how high the ramp goes.
RANGE, HELD = 100.0, 50.0
#: When the ramp begins, how long the hold lasts, ms.
BEGIN, HOLD = 200.0, 1000.0
#: The claims on where thresholds are least, and where that is, Hz: from, to.
LEAST = {"SA-1": (209, 2.0, 10.0), "FA-1": (210, 20.0, 60.0), "FA-2": (211, 200.0, 250.0)}
PHASES = ("before", "rise", "hold", "fall", "after")


def encoder(kind: str, period_ms: float) -> Encoder:
    """Return the afferent of a type; FA-1's threshold decays by the ms."""
    if kind == "FA-1":
        return FA1(range=RANGE, period_ms=period_ms, decay="ms")
    types: dict[str, type[SA1] | type[SA2] | type[FA2]] = {"SA-1": SA1, "SA-2": SA2, "FA-2": FA2}
    return types[kind](range=RANGE, period_ms=period_ms)


def frames(t_ms: NDArray[np.float64], values: NDArray[np.float64]) -> Frames:
    """Return one taxel a column."""
    return Frames(values[:, None, :], np.rint(1000 * t_ms).astype(np.int64), unit="kPa")


def threshold(kind: str, frequency_hz: float, amplitudes: int, period_ms: float) -> float | None:
    """Return the least sine, peak to peak, a share of the range, that gives a spike in every cycle; None above it.

    Pressed from contact on: ``a (1 - cos) / 2``. The first cycles, a fifth of a second, are left out.
    """
    warm, cycles = max(2, int(0.2 * frequency_hz)), max(5, int(0.2 * frequency_hz))
    t = np.arange(0.0, (warm + cycles) * 1000 / frequency_hz, period_ms)
    sizes = np.geomspace(1e-3, 1.0, amplitudes)
    course = (1 - np.cos(2 * np.pi * frequency_hz * t / 1000)) / 2
    spikes = encoder(kind, period_ms).encode(frames(t, RANGE * course[:, None] * sizes))
    answers = []
    for times in spikes:
        cycle = np.floor(times * frequency_hz / 1000 + 1e-9).astype(int)
        counts = np.bincount(cycle[cycle >= 0], minlength=warm + cycles)[warm : warm + cycles]
        answers.append(bool((counts > 0).all()))
    return float(sizes[answers.index(True)]) if any(answers) else None


def phases(kind: str, ramp_ms: float, period_ms: float) -> list[int]:
    """Return how often it fires before a ramp, in rise, hold and fall, and after; 20 ms behind a ramp belong to it."""
    edges = np.cumsum([0.0, BEGIN, ramp_ms + 20.0, HOLD - 20.0, ramp_ms + 20.0, HOLD])
    corners = np.cumsum([BEGIN, ramp_ms, HOLD, ramp_ms])
    t = np.arange(0.0, edges[-1], period_ms)
    course = np.interp(t, corners, [0.0, HELD, HELD, 0.0])
    times = encoder(kind, period_ms).encode(frames(t, course[:, None]))[0]
    return [int(np.count_nonzero((times > a) & (times <= b))) for a, b in pairwise(edges)]


tasks = partial(grid, kind="kinds")


def realise(params: dict[str, Any], _seed: int) -> dict[str, Any]:
    """Press one type of afferent with ramps and sines."""
    kind, period = params["kind"], params["period_ms"]
    return {
        "phases": {f"{ramp:g}": phases(kind, ramp, period) for ramp in params["ramps_ms"]},
        "thresholds": [threshold(kind, f, params["amplitudes"], period) for f in params["frequencies_hz"]],
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List each type's spikes, and the frequency at which its threshold is least."""
    summary: Summary = {}
    for row in rows:
        known = [(f, a) for f, a in zip(p["frequencies_hz"], row.result["thresholds"], strict=True) if a is not None]
        least = min((a for _, a in known), default=None)
        near = [f for f, a in known if least is not None and a <= 1.02 * least]
        summary[row.params["kind"]] = {**row.result, "least": least, "least_hz": [near[0], near[-1]] if near else None}
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge phases and frequencies."""
    fast, slow = (f"{ramp:g}" for ramp in (min(p["ramps_ms"]), max(p["ramps_ms"])))
    expected: dict[str, tuple[int, Callable[[list[int], list[int]], bool]]] = {
        "SA-1": (8, lambda q, s: min(q[2], s[2]) > 0 and s[4] == 0),
        "FA-1": (6, lambda q, s: min(*q[1:4:2], *s[1:4:2]) > 0 and q[2] == s[2] == 0),
        "SA-2": (9, lambda q, s: min(q[2], s[2]) > 0 and s[4] == 0),
        "FA-2": (7, lambda q, s: min(q[1], q[3]) > 0 and q[2] == 0 and sum(s) == 0),
    }
    for kind, one in summary.items():
        quick, gentle = one["phases"][fast], one["phases"][slow]
        claim, holds = expected[kind]
        yield Judgement(
            claim,
            "; ".join(
                f"ramp of {ramp} ms: " + ", ".join(f"{name} {n}" for name, n in zip(PHASES, q, strict=True))
                for ramp, q in ((fast, quick), (slow, gentle))
            ),
            bool(holds(quick, gentle)),
            "spikes by phase"
            + ("; what the raised threshold held back may fire late, as it sinks" if kind == "FA-1" else ""),
        )
    for kind, (claim, low, high) in LEAST.items():
        if kind not in summary or summary[kind]["least_hz"] is None:
            continue
        first, last = summary[kind]["least_hz"]
        if not low <= max(p["frequencies_hz"]) or not min(p["frequencies_hz"]) <= high:
            continue
        why = "criterion: a spike in every cycle, peak to peak from contact on; within 2 % of the least"
        if kind == "FA-1":
            why += "; FA-1 of 5.1 to 5.5 never forgets a change, so that slow ones reach it as fast ones do, and "
            why += "its threshold, raised by each spike, sinks for hundreds of ms"
        ours = f"{first:g} to {last:g} Hz" if first != last else f"{first:g} Hz"
        yield Judgement(claim, ours, bool(low <= last and first <= high), why)


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw thresholds over frequency."""
    figure, axes = subplots(6.5, 4)
    for kind, one in summary.items():
        known = [(f, a) for f, a in zip(p["frequencies_hz"], one["thresholds"], strict=True) if a is not None]
        if known:
            axes.plot(*zip(*known, strict=True), "o-", markersize=4, label=kind)
    axes.set(xscale="log", yscale="log", xlabel="frequency, Hz", ylabel="threshold, share of range, peak to peak")
    axes.legend()
    return figure
