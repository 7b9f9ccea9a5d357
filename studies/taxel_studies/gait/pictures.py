"""Figures 6.12 to 6.14: pressure and spikes of the insole during a footfall, and the shares of events found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from taxel_studies.gait import insole, search
from taxel_studies.gait.judgement import STAND, stand_for
from taxel_studies.gait.outcomes import EVENTS
from taxel_studies.study import Parameters, Summary, subplots


def draw(_p: Parameters, summary: Summary) -> list[Figure]:
    """Draw, of what was run, 6.12 and 6.13 (footfalls of the plate), 6.14 (what stands for 6.5) and the search."""
    conversion, rows = summary["conversion"], stand_for(summary)
    figures = [*([_conversion(conversion)] if conversion else []), *([_bars(rows)] if rows else [])]
    return [*figures, *search.draw(summary["searched"])]


def _bars(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw 6.14: top found, bottom error, a group a source and event."""
    figure, (top, bottom) = subplots(11, 6.5, 2, 1, sharex=True)
    groups = list(dict.fromkeys((r["source"], r["event"]) for r in rows))
    for number, name in enumerate(("chosen", "printed")):
        for at, (source, event) in enumerate(groups):
            row = next((r for r in rows if (r["source"], r["event"], r["row"]) == (source, event, name)), None)
            if row is None:
                continue
            x, style = at + 0.36 * (number - 0.5), {"width": 0.34, "color": f"C{3 - 3 * number}"}
            top.bar(x, row["found_percent"], label=STAND[name] if at == 0 else None, **style)
            top.annotate(f"{row['false']}", (x, 2), ha="center", fontsize=7, color="white")
            if row["error_ms"]:
                bottom.bar(x, row["error_ms"]["mean"], yerr=row["error_ms"]["sd"], ecolor="0.3", capsize=3, **style)
    top.axhline(95, color="0.5", ls=":", lw=0.9)
    top.set(ylabel="% found (in the bars: false)", ylim=(0, 103))
    figure.legend(fontsize="small", loc="outside upper center", ncols=2)
    bottom.axhline(0, color="0.5", lw=0.8)
    for y in (-10, 10):
        bottom.axhline(y, color="0.5", ls=":", lw=0.9)
    bottom.set_ylabel("neuron less reference, ms (mean, sd)")
    bottom.set_xticks(range(len(groups)), [f"{s}\n{EVENTS[e]}" for s, e in groups])
    return figure


def _conversion(summary: Mapping[str, Any]) -> Figure:
    """Draw 6.12 and 6.13: the insole, the readings of three taxels, and the spikes of all inputs over one footfall."""
    figure, (foot, analog, raster) = subplots(13, 4.6, 1, 3, width_ratios=[1, 2, 3])
    at = [(c - (n - 1) / 2, r) for r, n in enumerate(insole.CELLS) for c in range(n)]
    foot.scatter(*zip(*at, strict=True), c=summary["peak"], norm=Normalize(0), cmap="viridis", marker="s", s=90)
    foot.set(
        title=f"{insole.TAXELS} taxels, heel at the foot\n(colour: peak load)", xticks=[], yticks=[], aspect="equal"
    )
    frames = 0
    for name, values in summary["felt"].items():
        frames = len(values)
        analog.plot([summary["frame_ms"] * k for k in range(frames)], values, label=name)
    analog.axhline(summary["threshold"], color="k", ls="--", lw=0.9, label="threshold")
    analog.set(xlabel="ms since contact", ylabel="counts", title="what three taxels feel")
    analog.legend(fontsize="small")
    raster.eventplot(summary["spikes_ms"], colors="k", linewidths=1.4, linelengths=2.0)
    for event, times in summary["truth_ms"].items():
        for time in times:
            raster.axvline(time, color={"contact": "C3", "heel_off": "C2", "foot_off": "C0"}[event], lw=1.1)
    raster.set(xlabel="ms since contact", ylabel="input neuron", xlim=(-40, summary["frame_ms"] * (frames - 1) + 90))
    raster.set_title(
        f"spikes of {len(summary['spikes_ms'])} inputs; lines: {', '.join(EVENTS[e] for e in summary['truth_ms'])}"
    )
    return figure
