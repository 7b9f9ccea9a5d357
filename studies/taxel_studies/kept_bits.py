"""How many bits a touch keeps by sampling period, by parameter, and by time, drawn for 5.5 to 5.8 and 5.11 to 5.13."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.information import confusion_matrix, panzeri_treves, plug_in
from taxel_studies.study import Summary, logarithmic, subplots


def information(truth: NDArray[Any], answers: NDArray[Any], *wanted: str) -> dict[str, float]:
    """Return of answers: ``bits`` (corrected), ``plug_in`` (as counted), ``right`` (share), ``most`` (bits)."""
    counts, classes = confusion_matrix(truth, answers)
    values = {
        "bits": panzeri_treves(counts),
        "plug_in": plug_in(counts),
        "right": np.mean(truth == answers),
        "most": np.log2(len(classes)),
    }
    return {name: round(float(values[name]), 4) for name in wanted}


#: How much of a parameter is lost from the shortest period on: on average over the curve, or at its end.
LOST = ("over the whole curve", "from end to end")


def lost(lines: Sequence[Mapping[str, Any]], named: Mapping[str, str], taken: str) -> tuple[dict[str, float], str]:
    """Return how many bits less there are of each parameter at longer periods, as a share, and in words.

    Parameters
    ----------
    lines : a result a period, the shortest first
    named : of each parameter its name
    taken : of `LOST`
    """
    share = {name: shares(lines, name) for name in named if name in lines[0]["by"]}
    if taken == LOST[0]:
        less = {name: of[0] - float(np.mean(of[1:])) for name, of in share.items()}
        words = "; ".join(f"{named[name]} {by:.3f}" for name, by in less.items())
        return less, f"{words} of the largest possible bits lost on average"
    words = "; ".join(f"{named[name]} {of[0]:.2f} to {of[-1]:.2f}" for name, of in share.items())
    words += f" of the largest possible bits, from {lines[0]['period_ms']:g} to {lines[-1]['period_ms']:g} ms"
    return {name: of[0] - of[-1] for name, of in share.items()}, words


def shares(lines: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """Return the bits of a parameter as a share of the largest possible, period by period."""
    return [line["by"][name]["bits"] / line["by"][name]["most"] for line in lines]


def by_period_parameter_and_time(
    summary: Summary,
    *,
    figures: tuple[str, str, str],
    curves: Mapping[str, str],
    named: Mapping[str, str],
    times_ms: Sequence[float],
    since: str,
) -> list[Figure]:
    """Draw three figures of the results, period by period (``summary["lines"]``).

    Parameters
    ----------
    summary : of a study
    figures : the thesis' numbers of the three
    curves : of the first figure, what each curve of bits is called
    named : of the second, what each parameter is called
    times_ms : of the third, ms
    since : what times count from
    """
    lines = summary["lines"]
    periods = [line["period_ms"] for line in lines]
    labels = ("bits", "share of the largest possible bits", "bits")
    drawn_figures = []
    for k, (title, label) in enumerate(zip(figures, labels, strict=True)):
        figure, ax = subplots(6, 4)
        if k == 0:
            for (name, called), (style, filled) in zip(curves.items(), (("o-", None), ("s--", "w")), strict=True):
                ax.plot(periods, [line[name] for line in lines], style, mfc=filled, label=called)
            ax.axhline(np.log2(summary["conditions"]), color="0.6", ls=":", label="ceiling")
        elif k == 1:
            for name in lines[0]["by"]:
                ax.plot(periods, shares(lines, name), "o-", label=named[name])
        else:
            for line in lines:
                ax.plot(*zip(*line["times"], strict=True), ".-", label=f"{line['period_ms']:g} ms")
        logarithmic(ax, x=times_ms if k == 2 else periods)
        ax.set(xlabel=f"ms since {since}" if k == 2 else "sampling period, ms", ylabel=label, title=f"figure {title}")
        # Curves over time fill the axes, so the legend stands beside them.
        beside: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if k == 2 else {}
        ax.legend(fontsize="small", **beside)
        drawn_figures.append(figure)
    return drawn_figures
