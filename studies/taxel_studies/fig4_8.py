"""Figures 4.8 and 4.10: a tennis ball dropped on the array: frames, and bits by sampling rate (thesis 4.4.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.information import confusion_matrix, nested_predictions, panzeri_treves
from taxel_studies import dropped
from taxel_studies.dropped import TENNIS, Condition
from taxel_studies.study import (
    Judgement,
    Kept,
    Parameters,
    Row,
    Summary,
    Task,
    grid,
    listed,
    logarithmic,
    results,
    subplots,
)

WHERE = "thesis 4.4.2, figures 4.8 and 4.10"
PROTOCOL = (
    "A tennis ball (65 mm, 56 g) falls from 40 and 80 cm on the emulated board at 2 kHz, level and tilted by 30 "
    "degrees, 100 times each, under the 10 mm of foam of 4.3.1, whose other values the study foam finds; it gives "
    "by a spring of 25 N/mm, as a rigid one would crush the foam. By guess, heights and places vary by 5 mm "
    "(standard deviations). 17 x 17 taxels around the first that answered, 40 ms from the impact's first frame on "
    "(the first in which three taxels rise: one alone may be noise), as ticks above those before it. Slower "
    "sampling: what the host holds is looked at every so often, from that frame on, as the thesis resampled its "
    "films; beside it, from any phase on. Linear discriminants of the frames, 10 folds, the ridge chosen inside "
    "them; bits of the answers (4.1), corrected by Panzeri and Treves."
)

PARAMETERS: dict[str, Any] = {
    **dropped.TENNIS_TABLE,
    "periods_ms": [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 40.0],
    "drawn": [65.0, 400.0, 0.0],
    "seed": 1,
}
TOY: dict[str, Any] = {**dropped.TENNIS_TOY, "periods_ms": [2.0, 40.0]}
SIZES = {"toy": TOY}
#: Figure 4.8: frames a ms, so many.
FRAME_MS, FRAMES = 1.0, 8
#: 100 Hz, which 4.4.2 names.
SLOW_MS = 10.0
#: What counts as little of the bits that there can be, and as a marked gain, bits.
LITTLE, MARKED = 0.5, 0.5
#: How far from the region's middle the middle of the pressure may lie to be around the first taxel, taxels.
AROUND = 3.0
#: The readings of how a slow sampler begins, and their names in the results.
SAMPLED = {"from the impact on": "bits", "begun at any phase": "any_phase_bits"}
#: Seed of the phase at which a slow sampler takes its first frame.
PHASES = 410


shared = partial(dropped.shared, rig=TENNIS)


def tasks(p: Parameters) -> list[Task]:
    """List one realisation a period, sampled from the impact on, and from any phase on."""
    return grid({**p, "aligned": [True, False]}, period_ms="periods_ms", aligned="aligned")


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Return the bits of discriminants on all drops at a period."""
    x, y = sampled_drops(params, kept, params["period_ms"], TENNIS.length_ms, aligned=params["aligned"])
    x -= x.mean(0)
    named = nested_predictions([x @ x.T], [int(x.any(0).sum())], y, count=10, seed=params["seed"])
    return {
        "bits": round(float(panzeri_treves(confusion_matrix(y, named.responses)[0])), 4),
        "right": round(float(np.mean(named.responses == y)), 4),
    }


def sampled_drops(
    p: Parameters, kept: Kept, period_ms: float, length_ms: float, *, aligned: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the frames of all drops at a period, one drop a row, and the number of each drop's condition."""
    rng = np.random.default_rng([p["seed"], PHASES])
    parts = []
    for condition in dropped.conditions(p):
        ticks = dropped.played(p, condition, kept, TENNIS).ticks
        late = np.zeros(len(ticks)) if aligned else rng.uniform(0, period_ms, len(ticks))
        shown = dropped.frames_of(ticks, period_ms, late, TENNIS, length_ms)
        parts.append(shown.reshape(len(ticks), -1))
    return np.concatenate(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])


def summarise(p: Parameters, rows: Sequence[Row], kept: Kept) -> Summary:
    """List the bits by period, and one drop's frames."""
    one = dropped.played(p, Condition(*p["drawn"]), kept, TENNIS).ticks[:1]
    frame_ms = TENNIS.frame_us / 1000
    whole = dropped.frames_of(one, frame_ms, np.zeros(1), TENNIS, TENNIS.length_ms)[0]
    shown = dropped.frames_of(one, FRAME_MS, np.zeros(1), TENNIS, (FRAMES + 1) * FRAME_MS)[0]
    x = np.arange(TENNIS.region**2) % TENNIS.region - TENNIS.region // 2
    y = np.arange(TENNIS.region**2) // TENNIS.region - TENNIS.region // 2
    most = np.clip(whole[int(whole.sum(1).argmax())], 0, None)
    return {
        "lines": [
            {
                "period_ms": period,
                **results(rows, period_ms=period, aligned=True)[0],
                "any_phase_bits": results(rows, period_ms=period, aligned=False)[0]["bits"],
            }
            for period in sorted(p["periods_ms"])
        ],
        "conditions": len(dropped.conditions(p)),
        "sum": [[round(frame_ms * k, 3), round(float(total))] for k, total in enumerate(whole.sum(1))],
        "middle": [round(float(np.average(of, weights=most)), 2) for of in (x, y)],
        "full": int(one.max()),
        "frames": shown.round().astype(int).tolist(),
    }


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.4.2 says."""
    lines, most = summary["lines"], float(np.log2(summary["conditions"]))
    size = f"{summary['conditions']} conditions, {p['drops']} drops each"
    total = np.array(summary["sum"])
    at, over = float(total[total[:, 1].argmax(), 0]), total[:, 1] < 0.1 * total[:, 1].max()
    ended = next((t for (t, _), low in zip(summary["sum"], over, strict=True) if low and t > at), float("inf"))
    apart = float(np.hypot(*summary["middle"]))
    yield Judgement(
        20,
        f"largest after {at:.1f} ms, below a tenth of that after {ended:.1f} ms, its middle {apart:.1f} taxels off "
        "the first",
        bool(0 < at < ended < TENNIS.length_ms and apart < AROUND),
        f"around: within {AROUND:g} taxels; taxels under the ball reach the ramp's end ({summary['full']} ticks)",
    )
    slow = [line for line in lines if line["period_ms"] > SLOW_MS]
    fast = [line for line in lines if line["period_ms"] < SLOW_MS]
    for reading, name in SAMPLED.items() if slow and fast else ():
        least, best = max(line[name] for line in slow), max(line[name] for line in fast)
        there = [best - line[name] for line in lines if line["period_ms"] == SLOW_MS]
        shown = listed([line[name] for line in lines], [1000 / line["period_ms"] for line in lines], place="{:g} Hz")
        yield Judgement(
            22, f"{shown} bits", least < LITTLE * most, f"little: less than half of {most:.0f} bits; {size}", reading
        )
        yield Judgement(
            23,
            f"{best - least:+.2f} bits, to {best:.2f} of {most:.0f}"
            + "".join(f"; from 100 Hz itself on {gain:+.2f}" for gain in there),
            best - least > MARKED,
            f"marked: half a bit or more; simulated drops vary as we guess; {size}",
            reading,
        )


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw 4.8 (the frames) and 4.10 (bits)."""
    return [_draw_frames(p, summary), _draw_bits(summary)]


def _draw_frames(p: Parameters, summary: Summary) -> Figure:
    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots(2, FRAMES // 2).ravel()
    frames = np.array(summary["frames"])[1:].reshape(FRAMES, TENNIS.region, TENNIS.region)
    for k, ax in enumerate(axes):
        shown = ax.imshow(frames[k], cmap="viridis", vmin=0, vmax=frames.max())
        ax.set_title(f"{FRAME_MS * (k + 1):g} ms", fontsize="medium")
        ax.set_xticks([])
        ax.set_yticks([])
    figure.colorbar(shown, ax=list(axes), label="ticks above the impact's start")
    ball, height, slant = p["drawn"]
    figure.suptitle(f"figure 4.8: a tennis ball ({ball:g} mm) from {height / 10:g} cm, {slant:g} degrees")
    return figure


def _draw_bits(summary: Summary) -> Figure:
    figure, ax = subplots(6, 4)
    rates = [1000 / line["period_ms"] for line in summary["lines"]]
    ax.plot(rates, [line["bits"] for line in summary["lines"]], "o-", label="sampled from the impact on")
    ax.plot(rates, [line["any_phase_bits"] for line in summary["lines"]], "s--", mfc="w", label="at any phase")
    ax.axhline(np.log2(summary["conditions"]), color="0.6", ls=":", label="ceiling")
    ax.axvline(1000 / SLOW_MS, color="0.8")
    logarithmic(ax, x=rates)
    ax.set(ylim=(0, None), xlabel="frames a second", ylabel="bits", title="figure 4.10")
    ax.legend(fontsize="small")
    return figure
