"""The page of ``taxel information``: a table of all settings, and a curve."""

from __future__ import annotations

import os
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from taxel._base.arguments import instance
from taxel._base.files import write_whole
from taxel.information import Answer
from taxel.report.page import render
from taxel.report.svg import STYLE, picture


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
        curve = picture(_curve(checked))
    text = render("report/information.html.j2", answer=checked, curve=curve, labels=sum(checked.labels.values()))
    return write_whole(path, lambda file: file.write(text.encode()), overwrite=overwrite)


def _curve(answer: Answer) -> Figure:
    """Draw bits by time since contact, a line for each sampling period."""
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    axis = figure.subplots()
    for period in sorted({p.period_ms for p in answer.points}):
        line = sorted((p for p in answer.points if p.period_ms == period), key=lambda p: p.window_ms)
        bits, ends = np.array([p.found.bits for p in line]), np.array([p.found.interval for p in line])
        x = [p.window_ms for p in line]
        axis.errorbar(
            x, bits, [bits - ends[:, 0], ends[:, 1] - bits], marker="o", ms=3, capsize=2, label=f"{period:g} ms"
        )
    axis.set(xlabel="time since contact, ms", ylabel="bits", xscale="log", title="by sampling period")
    axis.axhline(answer.full.found.most, color="0.8", lw=1)
    axis.legend(frameon=False)
    return figure
