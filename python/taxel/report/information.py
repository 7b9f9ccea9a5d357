"""The page of ``taxel information``: bits by period, time, taxels and rate, and the confusion matrix."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from taxel._base.arguments import instance
from taxel._base.files import write_whole
from taxel._base.messages import escaped
from taxel.information import Answer, Point
from taxel.report.page import render
from taxel.report.svg import STYLE, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours of verdicts.
_COLOURS = {"keeps": "#2f6690", "open": "#e8b04b", "loses": "#b5423c", "full": "#2b2b2b", "nothing": "#9a9a9a"}
#: Labels whose names still fit a confusion matrix.
_MOST_NAMES = 40


def write_information(path: str | os.PathLike[str], answer: Answer, *, overwrite: bool = False) -> Path:
    """Write an answer as a page with pictures.

    Parameters
    ----------
    path : path
        An .html.
    answer : Answer
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    FileExistsError : the file is there already and `overwrite` is false
    OSError : the folder is missing, the disk is full ...
    """
    checked = instance("answer", answer, Answer)
    with mpl.rc_context(STYLE):
        drawn = {"curves": picture(_curves(checked)), "confusion": picture(_confusion(checked))}
    text = render(
        "report/information.html.j2",
        answer=checked,
        pictures=drawn,
        colours=_COLOURS,
        early=_early(checked),
        labels=sum(checked.labels.values()),
    )
    return write_whole(path, lambda file: file.write(text.encode()), overwrite=overwrite)


def _early(answer: Answer) -> list[tuple[float, list[Point]]]:
    windows = sorted({p.window_ms for p in answer.points})
    return [(w, [p for p in answer.points if p.window_ms == w]) for w in windows]


def _curves(answer: Answer) -> Figure:
    from matplotlib.figure import Figure  # noqa: PLC0415  loads slowly

    figure = Figure(figsize=(10.5, 9.2), layout="constrained")
    axes = figure.subplots(3, 2)
    most = answer.full.found.most
    _by_period(axes[0, 0], answer)
    for period in sorted({p.period_ms for p in answer.points}):
        line = [p for p in answer.points if p.period_ms == period]
        axes[0, 1].plot(
            [p.window_ms for p in line], [p.found.bits for p in line], marker="o", ms=3, label=f"{period:g} ms"
        )
    axes[0, 1].set(xscale="log", xlabel="time since contact, ms", title="bits over time (one line per period)")
    axes[0, 1].legend(frameon=False)
    _by_taxels(axes[1, 0], answer)
    for point in answer.by_period:
        says = "full" if point.verdict is None else point.verdict.says
        axes[1, 1].plot(point.kbps, point.found.bits, "o", color=_COLOURS[says], ms=5)
    axes[1, 1].plot([p.kbps for p in answer.taxels], [p.found.bits for p in answer.taxels], "s", color="0.5", ms=5)
    for says, colour in _COLOURS.items():
        if says != "nothing" or answer.empty:
            axes[1, 1].plot([], [], "o", color=colour, label="nothing to keep" if says == "nothing" else says)
    axes[1, 1].set(xscale="log", xlabel="kbit/s while touched", title="cost (squares: fewer or larger taxels)")
    axes[1, 1].axhline(0.95 * answer.full.found.bits, color="0.7", lw=1, ls=":")
    axes[1, 1].legend(frameon=False)
    names = [c.name for c in answer.controls if c.found is not None] + ["full"]
    values = [c.found for c in answer.controls if c.found is not None] + [answer.full.found]
    axes[2, 0].barh(names, [v.bits for v in values], color=[*["0.7"] * (len(names) - 1), _COLOURS["keeps"]])
    for k, value in enumerate(values):
        axes[2, 0].plot(value.interval, [k, k], color="0.2", lw=1)
    axes[2, 0].axvline(answer.zero.level, color=_COLOURS["loses"], lw=1, ls=":")
    axes[2, 0].set(xlabel="bits", title="simpler measurements (dotted: labels shuffled)")
    axes[2, 0].set_xlim(0, most)
    axes[2, 1].remove()
    for ax in axes.ravel()[:4]:
        ax.set_ylabel("bits")
        ax.set_ylim(0, most * 1.03)
        ax.axhline(most, color="0.8", lw=1)
    axes[0, 0].set_ylim(0, 1.03 * max(most, *(points[0].found.most for points in answer.parameters.values()), 0.0))
    _ticks(axes[0, 0], [p.period_ms for p in answer.by_period])
    _ticks(axes[0, 1], sorted({p.window_ms for p in answer.points}))
    _ticks(axes[1, 0], sorted({p.taxels for p in (*answer.by_period, *answer.taxels)}))
    return figure


def _ticks(ax: Axes, values: Sequence[float]) -> None:
    """Mark these values alone on a logarithmic axis."""
    ax.set_xticks(values, [f"{value:g}" for value in values])
    ax.set_xticks([], minor=True)


def _by_period(ax: Axes, answer: Answer) -> None:
    line = answer.by_period
    bits = np.array([p.found.bits for p in line])
    ends = np.array([p.found.interval for p in line])
    x = [p.period_ms for p in line]
    ax.errorbar(
        x,
        bits,
        [bits - ends[:, 0], ends[:, 1] - bits],
        marker="o",
        ms=4,
        capsize=2,
        color=_COLOURS["keeps"],
        label="events",
    )
    if answer.frames:
        ax.plot(list(answer.frames), [e.bits for e in answer.frames.values()], "--", color="0.5", label="frames")
    for name, points in answer.parameters.items():
        normal = [p.found.bits for p in points]
        ax.plot(
            [p.period_ms for p in points], normal, marker=".", lw=1, label=f"{name} (of {points[0].found.most:.2f})"
        )
    ax.set(xscale="log", xlabel="sampling period, ms", title=f"how fast to sample (to {answer.full.window_ms:g} ms)")
    ax.legend(frameon=False)


def _by_taxels(ax: Axes, answer: Answer) -> None:
    for kind, style in (("random", "o-"), ("pooled", "s--")):
        line = sorted((p for p in answer.taxels if p.kind == kind), key=lambda p: p.taxels)
        if line:
            ax.plot([p.taxels for p in line], [p.found.bits for p in line], style, ms=4, label=kind)
    at = answer.taxels[0].period_ms if answer.taxels else answer.full.period_ms
    answer_at = next(p for p in answer.by_period if p.period_ms == at)
    ax.plot(answer_at.taxels, answer_at.found.bits, "k*", ms=8, label="all")
    ax.set(xscale="log", xlabel="taxels", title=f"how many taxels ({at:g} ms)")
    ax.legend(frameon=False)


def _confusion(answer: Answer) -> Figure:
    from matplotlib.figure import Figure  # noqa: PLC0415  loads slowly

    counts = answer.full.found.counts.mean(0)
    share: Any = counts / np.maximum(counts.sum(1, keepdims=True), 1)
    figure = Figure(figsize=(6.4, 5.4), layout="constrained")
    ax = figure.subplots()
    picture = ax.imshow(share, cmap="Blues", vmin=0, vmax=1)
    names = [escaped(name) for name in answer.full.found.classes]
    if len(names) <= _MOST_NAMES:
        ax.set_xticks(range(len(names)), names, rotation=45, ha="right")
        ax.set_yticks(range(len(names)), names)
    ax.set(
        xlabel="classified as", ylabel="label", title=f"{answer.full.period_ms:g} ms, to {answer.full.window_ms:g} ms"
    )
    figure.colorbar(picture, ax=ax, label="share of the label's trials")
    return figure
