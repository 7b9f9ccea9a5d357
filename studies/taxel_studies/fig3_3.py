"""Figure 3.3: from the analog readout of the fabric array to digital signals to spikes (thesis 3.4.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.encode import ThresholdIzhikevich
from taxel_studies.fabric_array import PERIOD_US, SENSOR, depth_of, pressed, read
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, subplots

WHERE = "thesis 3.4.3, figure 3.3"
PROTOCOL = (
    "A sphere of 65 mm pressed three times to 4 N into 10 mm of foam under the 8 x 8 array, at ten places; "
    "dividers of 10 kOhm at 5 V sampled at 10 kHz, a threshold of 0.25 V (foam, resistor, threshold, speed: ours); "
    "a .02, b .25, c -65, d 6, gain .5, Euler steps of 0.1 ms, neurons settled at the start."
)

PARAMETERS: dict[str, Any] = {
    **SENSOR,
    "diameter_mm": 65.0,
    "force_n": 4.0,
    "speed_mm_s": 10.0,
    "hold_ms": 150.0,
    "presses": 3,
    "realisations": 10,
}
SIZES = {"toy": {"realisations": 2, "presses": 2}}
#: How long a state must last to count, ms: that of the neuron (a step shows after some 20 ms), and longer.
STEADY_MS = (25.0, 60.0)


tasks = partial(grid, seed="realisations")


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Press a sphere several times and let go; count digital steps that last, and spikes."""
    p, random = params, np.random.default_rng(seed)
    x, y = random.uniform(-10, 10, 2)
    depth = depth_of(p["diameter_mm"], p["force_n"], p["foam_kpa"], p["foam_mm"])
    way = np.arange(0.0, depth, p["speed_mm_s"] * PERIOD_US * 1e-6)
    hold = round(p["hold_ms"] * 1000 / PERIOD_US)
    once = np.concatenate([np.zeros(hold), way, np.full(hold, depth), way[::-1]])
    course = np.concatenate([*[once] * p["presses"], np.zeros(hold)])
    frames = read(p, *pressed(p, p["diameter_mm"], depth, x, y), course, seed)
    digital = frames.values.reshape(len(frames), -1) > p["threshold_v"]
    spikes = ThresholdIzhikevich([p["threshold_v"]], published="3.4.3").encode(frames)
    assert spikes.values is not None
    values = [spikes.values[a:b] for a, b in pairwise(spikes.offsets)]
    counts = np.array([[(v > 0).sum(), (v < 0).sum()] for v in values])
    lines = []
    for lasts in STEADY_MS:
        turns = [np.diff(_lasting(digital[:, taxel], lasts).astype(int)) for taxel in range(len(values))]
        steps = np.array([[(d > 0).sum(), (d < 0).sum()] for d in turns])
        lines.append({"steps": steps.sum(axis=0).tolist(), "wrong": int((steps != counts).any(axis=1).sum())})
    busy = np.argsort(digital.sum(axis=0), kind="stable")[::-1][:12]
    every = 20
    return {
        "lines": lines,
        "spikes": counts.sum(axis=0).tolist(),
        "active": int(digital.any(axis=0).sum()),
        "drawn": {
            "t_ms": (frames.t[::every] / 1000).tolist(),
            "volts": frames.values.reshape(len(frames), -1)[::every][:, busy].T.round(4).tolist(),
            "digital": digital[::every][:, busy].T.astype(int).tolist(),
            "spikes": [spikes[int(k)].round(3).tolist() for k in busy],
        }
        if seed == 0
        else None,
    }


def _lasting(digital: np.ndarray[Any, Any], lasts_ms: float) -> np.ndarray[Any, Any]:
    """Return a signal without its shorter states: chatter across the threshold counts as one step."""
    edges = np.flatnonzero(np.diff(digital)) + 1
    out, state = np.empty_like(digital), digital[0]
    stops = [*edges[1:], len(digital)]
    out[: edges[0] if len(edges) else len(digital)] = state
    for start, stop in zip(edges, stops, strict=False):
        if stop - start >= lasts_ms * 1000 / PERIOD_US:
            state = digital[start]
        out[start:stop] = state
    return out


def summarise(_p: Parameters, rows: Sequence[Row]) -> Summary:
    """Sum up over places."""
    results = [r.result for r in rows]
    return {
        "lines": [
            {
                "lasts_ms": lasts,
                "steps": np.sum([r["lines"][k]["steps"] for r in results], axis=0).tolist(),
                "wrong": sum(r["lines"][k]["wrong"] for r in results),
            }
            for k, lasts in enumerate(STEADY_MS)
        ],
        "spikes": np.sum([r["spikes"] for r in results], axis=0).tolist(),
        "active": sum(r["active"] for r in results),
        "drawn": next(r["drawn"] for r in results if r["drawn"]),
    }


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 3.4.3 says, by the shortest state that counts."""
    ups, downs = summary["spikes"]
    for line in summary["lines"]:
        rises, falls = line["steps"]
        yield Judgement(
            1,
            f"{rises} rises and {falls} falls, {ups} and {downs} spikes; {line['wrong']} of {summary['active']} "
            "taxels differ",
            line["wrong"] == 0,
            f"{p['speed_mm_s']:g} mm/s, foam of {p['foam_kpa']:g} kPa; a state shorter than some 20 ms may be lost, "
            "and behind a short gap a spike comes late",
            f"states of {line['lasts_ms']:g} ms and longer",
        )


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw 3.3: analog, digital, spikes, of the twelve taxels that are on for longest."""
    figure, (left, middle, right) = subplots(11, 3.6, 1, 3, sharey=True)
    shown = summary["drawn"]
    t = np.array(shown["t_ms"])
    for row, (volts, digital, spikes) in enumerate(zip(shown["volts"], shown["digital"], shown["spikes"], strict=True)):
        left.plot(t, row + 0.8 * np.array(volts) / max(map(max, shown["volts"])), color="C0", lw=0.8)
        middle.step(t, row + 0.8 * np.array(digital), color="C2", lw=0.8, where="post")
        right.vlines(spikes, row, row + 0.8, color="k", lw=0.9)
    for ax, title in ((left, "analog readout"), (middle, f"above {p['threshold_v']:g} V"), (right, "spikes")):
        ax.set(xlabel="time, ms", title=title, xlim=(0, t[-1]))
    left.set_ylabel("taxel")
    return figure
