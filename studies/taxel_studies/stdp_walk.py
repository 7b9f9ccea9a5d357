"""A neuron that learns without labels, from a foot that walks, to fire once a stride (thesis 3.6.2 asks for it)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel_rules import STDP
from taxel_studies.gait import sources
from taxel_studies.gait.pieces import Piece
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary
from taxel_studies.unlabelled import moved, threshold, unlearning

WHERE = "thesis 3.6.2, which calls for it; the rule of Masquelier, Guyonneau and Thorpe 2008"
PROTOCOL = (
    "Two minutes of walking a foot, eight force sensors (PhysioNet gaitpdb), as crossings of levels in shares "
    "of the running range: 112 trains. One neuron a foot gets the first minute eight times, then the second for the "
    "first time, always learning; judged by that. Its threshold is such that before it learns it fires once in ten "
    "seconds. Time constants are longer than the paper's (50 ms for 10), as a step is longer than its pattern. Beside "
    "it a neuron that never learns, whose threshold lets it fire as often as the learnt one."
)
#: The source of the recordings, of those of the gait study.
SOURCE = "gaitpdb"
DATA = (sources.SOURCES[SOURCE].folder,)
PARAMETERS: dict[str, Any] = {
    "levels": [0.02, 0.045, 0.08, 0.15, 0.3, 0.45, 0.6],
    "tau_m": 50.0,
    "tau_s": 12.5,
    "tau_plus": 50.0,
    "tau_minus": 100.0,
    "untrained_hz": 0.1,
    "passes": 8,
    "feet": 0,
}
SIZES = {"toy": {"feet": 2, "passes": 2}}
#: The constants were chosen on every sixth foot; statements are about the others.
CHOSEN_ON = 6
#: A stride is found with this share of strides with one spike, and at most this deviation of its time, ms.
ONCE, WANDERS_MS = 0.8, 50.0
#: Longer than this is no stride but a pause, ms.
LONGEST_STRIDE_MS = 2000.0


def tasks(p: Parameters, *, data: Path) -> list[Task]:
    """List one foot a task."""
    feet = list(_feet(data, p["levels"]))[: p["feet"] or None]
    shared = {name: value for name, value in p.items() if name != "feet"}
    shared["data"] = sources.fingerprint(data / sources.SOURCES[SOURCE].folder, SOURCE)
    return [Task({**shared, "foot": name}) for name in feet]


def _feet(data: Path, levels: Sequence[float]) -> Mapping[str, Piece]:
    encoder = {
        "name": "level_crossing",
        "levels": list(levels),
        "release_share": 0.7,
        "running_range": {"low": 10.0, "high": 95.0, "first_window": "itself"},
    }
    return sources.encoded(data / sources.SOURCES[SOURCE].folder, SOURCE, encoder).pieces


def realise(params: dict[str, Any], seed: int, *, data: Path) -> dict[str, Any]:
    """Train and test a neuron on one foot."""
    del seed
    return train_and_test(_feet(data, params["levels"])[params["foot"]], params)


def train_and_test(foot: Piece, params: Parameters) -> dict[str, Any]:
    """Train a neuron on the first half of a walk, presented again and again, and test it on the second."""
    # A whole ms, so that each piece begins where the last one ends.
    half = float(foot.spikes.stop // 2)
    first, second = foot.spikes.between(0, half), foot.spikes.between(half, foot.spikes.stop)
    taus = {name: params[name] for name in ("tau_m", "tau_s", "tau_plus", "tau_minus")}
    stdp = STDP(threshold=threshold(first, params["untrained_hz"], taus), **taus)
    course = []
    for k in range(params["passes"]):
        stdp.partial_fit(moved(first, k * half))
        phase = phases(stdp.spikes_ - k * half, foot.truth["contact"], 0.0, half)[1]
        course += [[round(k * half / 1000 + t / 1000, 2), round(s, 3)] for t, s in phase]
    late = (params["passes"] - 1) * half
    stdp.partial_fit(moved(second, late))
    learnt = judged(stdp.spikes_ - late, foot, half)
    # For comparison a neuron that does not learn, with a threshold at which it fires as often.
    hz = max(1000 * len(stdp.spikes_) / half, params["untrained_hz"])
    untrained = unlearning(threshold(first, hz, taus), taus).partial_fit(foot.spikes)
    return {
        "learnt": learnt,
        "untrained": judged(untrained.spikes_[untrained.spikes_ >= half], foot, half),
        "strong": int(np.count_nonzero(stdp.weights_ > 0.5)),
        "course": course,
    }


def phases(
    times: NDArray[np.float64], contacts: NDArray[np.float64], begin: float, end: float
) -> tuple[NDArray[np.int64], list[tuple[float, float]], float]:
    """Sort spikes by the stride that they fall into.

    Returns
    -------
    tuple
        How many spikes each stride holds; each spike's time (ms) and the share of its stride that was over; the
        strides' median length, ms.
    """
    steps = contacts[(contacts >= begin) & (contacts < end)]
    lasts = np.diff(steps)
    stride = np.searchsorted(steps, times, side="right") - 1
    inside = (stride >= 0) & (stride < len(lasts))
    inside[inside] = lasts[stride[inside]] < LONGEST_STRIDE_MS
    mine = stride[inside]
    share = (times[inside] - steps[mine]) / lasts[mine]
    counts = np.bincount(mine, minlength=len(lasts))[lasts < LONGEST_STRIDE_MS]
    length = float(np.median(lasts[lasts < LONGEST_STRIDE_MS])) if len(counts) else 0.0
    return counts, list(zip(times[inside].tolist(), share.tolist(), strict=True)), length


def judged(times: NDArray[np.float64], foot: Piece, begin: float) -> dict[str, Any]:
    """Return the share of strides with exactly one spike, its mean phase, and the circular deviation of the phase."""
    counts, phased, length = phases(times, foot.truth["contact"], begin, foot.scored[1])
    if not len(counts) or not phased:
        return {"strides": len(counts), "once": 0.0, "phase_ms": None, "wanders_ms": None}
    turns = np.exp(2j * np.pi * np.array([share for _, share in phased])).mean()
    phase = float(np.angle(turns)) / (2 * np.pi)
    wanders = float(np.sqrt(max(0.0, -2 * np.log(max(abs(turns), 1e-12))))) / (2 * np.pi)
    return {
        "strides": len(counts),
        "once": round(float(np.mean(counts == 1)), 4),
        "phase_ms": round(phase * length, 1),
        "wanders_ms": round(wanders * length, 1),
    }


def finds_stride(one: Mapping[str, Any]) -> bool:
    """Judge whether a neuron has found the stride."""
    return one["wanders_ms"] is not None and one["once"] >= ONCE and one["wanders_ms"] <= WANDERS_MS


def summarise(p: Parameters, rows: Sequence[Row], *, data: Path) -> Summary:
    """List the feet."""
    del p, data
    feet = [
        {"foot": row.params["foot"], "chosen_on": k % CHOSEN_ON == 0, **row.result, "course": None}
        for k, row in enumerate(rows)
    ]
    good = [row for row in rows if finds_stride(row.result["learnt"])]
    shown = min(good, key=lambda row: float(row.result["learnt"]["wanders_ms"])) if good else rows[0]
    return {"feet": feet, "shown": shown.params["foot"], "course": shown.result["course"]}


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Judge how many neurons have found the stride."""
    del p
    feet = [one for one in summary["feet"] if not one["chosen_on"]] or summary["feet"]
    good, by_chance = ([one for one in feet if finds_stride(one[how])] for how in ("learnt", "untrained"))
    wander = np.median([one["learnt"]["wanders_ms"] for one in good]) if good else float("nan")
    after = [one["learnt"]["phase_ms"] for one in good]
    near = sum(-WANDERS_MS <= t <= 2 * WANDERS_MS for t in after)
    return [
        Statement(
            "A neuron without labels comes to fire once a stride, always at the same moment of it.",
            "called for in 3.6.2",
            f"{len(good)} of {len(feet)} feet, in the second half of a walk; a neuron that learns nothing and "
            f"fires as often: {len(by_chance)}",
            bool(len(good) > len(feet) / 2 and len(good) > len(by_chance)) if len(feet) > CHOSEN_ON else None,
            f"found: one spike in {ONCE:.0%} of the strides and a deviation of {WANDERS_MS:g} ms or less; holds where "
            f"more than half of the feet are, and more than without learning; constants chosen on other feet",
        ),
        Statement(
            "That moment is where the pattern begins: the foot's contact.",
            "called for in 3.6.2",
            f"{near} of {len(good)} fire within -{WANDERS_MS:g} and {2 * WANDERS_MS:g} ms of it, "
            f"{np.median(after) if good else float('nan'):.0f} ms after it (median), deviation {wander:.1f} ms",
            bool(near >= 0.9 * len(good)) if good else None,
            "contact: the foot's total force rises above 50 N (100 Hz)",
        ),
    ]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw when one neuron fires while it learns, and when those fire that have found the stride."""
    del p
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    if summary["course"]:
        left.plot(*np.transpose(summary["course"]), ".", markersize=2)
    left.set(xlabel="s presented", ylabel="share of the stride", ylim=(-0.02, 1.02), title=summary["shown"])
    for how, colour in (("untrained", "0.6"), ("learnt", "C0")):
        every = [one[how] for one in summary["feet"] if one[how]["wanders_ms"] is not None]
        right.plot(
            [one["wanders_ms"] for one in every], [one["once"] for one in every], "o", ms=4, color=colour, label=how
        )
    right.axhline(ONCE, color="0.8", zorder=0)
    right.axvline(WANDERS_MS, color="0.8", zorder=0)
    right.set(xscale="log", xlabel="deviation of its moment, ms", ylabel="share of strides with one spike")
    right.legend(fontsize="small")
    return figure


def unread(_p: Parameters, data: Path) -> Mapping[str, str]:
    """Return which recordings cannot be read, and why."""
    return sources.unread(data, [SOURCE])
