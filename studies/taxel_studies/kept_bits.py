"""How many bits a touch keeps by sampling period, by parameter, and by time, drawn for 5.5 to 5.8 and 5.11 to 5.13."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel_studies.study import Said, logarithmic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["by_period_parameter_and_time", "shares"]


def shares(lines: Sequence[Mapping[str, Any]], name: str) -> list[float]:
    """Return which share of the bits that can be told of a parameter is told, period by period."""
    return [line["by"][name]["bits"] / line["by"][name]["most"] for line in lines]


def by_period_parameter_and_time(
    said: Said,
    *,
    figures: tuple[str, str, str],
    curves: Mapping[str, str],
    named: Mapping[str, str],
    times_ms: Sequence[float],
    since: str,
) -> list[Figure]:
    """Draw three figures of what was found, period by period (``said["lines"]``).

    Parameters
    ----------
    said : what a study found; what was sampled in part (``said["part"]``) is in the third
    figures : the thesis' numbers of the three
    curves : of the first figure, what each curve of bits is called
    named : of the second, what each parameter is called
    times_ms : of the third, ms
    since : what times count from
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  loads slowly

    lines = said["lines"]
    periods = [line["period_ms"] for line in lines]
    labels = ("bits", "share of the bits that can be told", "bits")
    found = []
    for k, (title, label) in enumerate(zip(figures, labels, strict=True)):
        figure = Figure(figsize=(6, 4), layout="constrained")
        ax = figure.subplots()
        if k == 0:
            for (name, called), (style, filled) in zip(curves.items(), (("o-", None), ("s--", "w")), strict=True):
                ax.plot(periods, [line[name] for line in lines], style, mfc=filled, label=called)
            ax.axhline(np.log2(said["conditions"]), color="0.6", ls=":", label="ceiling")
        elif k == 1:
            for name in lines[0]["by"]:
                ax.plot(periods, shares(lines, name), "o-", label=named[name])
        else:
            for line in (*([said["part"]] if "part" in said else []), *lines):
                ax.plot(*zip(*line["times"], strict=True), ".-", label=f"{line['period_ms']:g} ms")
        logarithmic(ax, x=times_ms if k == 2 else periods)
        ax.set_xlabel(f"ms since {since}" if k == 2 else "sampling period, ms")
        ax.set_ylabel(label)
        ax.set_title(f"figure {title}")
        # Curves over time fill the axes; their names stand beside them.
        beside: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)} if k == 2 else {}
        ax.legend(fontsize="small", **beside)
        found.append(figure)
    return found
