"""Plots of whole recordings."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel._base.arguments import instance
from taxel._base.messages import escaped
from taxel._base.times import beginning_us, begun
from taxel.plot.nouns import axes
from taxel.recording import Health, Recording, health
from taxel.recording.analysis.pressure import above_rest

_COLOURS = {"dead": "#4c72b0", "stuck": "#dd8452", "noisy": "#c44e52"}


def overview(recording: Recording) -> Figure:
    """Draw events per second (or the sum of pressure) over time, and each taxel's activity (or largest pressure).

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ProblemError : not a recording
    FormatError : the recording's file is damaged

    Examples
    --------
    >>> import os, tempfile, taxel
    >>> events = taxel.Events([0, 2500], [1, 1], [0, 0], [True, False], array=taxel.Array(2, 3))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = os.path.join(folder, "touch.npz")
    ...     lost = taxel.convert(events, path)
    ...     figure = overview(taxel.open(path))
    >>> figure.axes[0].get_title(), figure.axes[0].get_ylabel()
    ('touch.npz', 'events/s')
    """
    instance("recording", recording, Recording)
    figure, (over, where) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained", width_ratios=(2, 1))
    if recording.has_events:
        events = recording.events
        begin_us = beginning_us(events.t)
        t = (events.t - begin_us) / 1e6
        span = (float(t.min()), float(t.max())) if len(events) else (0.0, 1.0)
        bins = np.linspace(span[0], max(span[1], span[0] + 1e-4), 201)
        width = bins[1] - bins[0]
        for rising, colour, name in ((True, "#c44e52", "rises"), (False, "#4c72b0", "falls")):
            rate = np.histogram(t[events.p == rising], bins)[0] / width
            over.stairs(rate, bins, color=colour, label=name)
        # The axis is logarithmic from one event a bin on, as a tare has a thousand times the event rate of a touch.
        over.set_yscale("symlog", linthresh=1 / width)
        over.set_ylabel("events/s")
        over.legend(loc="upper right")
        health_map(health(events), where)
    else:
        frames = recording.frames()
        begin_us = beginning_us(frames.t)
        over.plot((frames.t - begin_us) / 1e6, frames.total(), color="black", linewidth=0.8)
        over.set_ylabel(escaped(f"sum of taxels ({frames.unit})"))
        above = above_rest(recording)
        assert above is not None  # of frames
        pressed, _, rest = above
        if rest.falls:
            # Above the rest of readings that fall is nothing but noise.
            health_map(health(frames), where)
        else:
            largest = np.fmax.reduce(pressed.values, axis=0, initial=0.0)
            known = " above rest" * (rest.source not in ("unit", "none"))
            _map(largest, f"largest{known} ({pressed.unit})", health(frames), where)
    for note in recording.notes:
        if note.t is not None:
            over.axvline((note.t - begin_us) / 1e6, color="grey", linestyle=":", linewidth=0.8)
    over.set(xlabel=_time(begin_us), title=escaped(recording.title.removeprefix(f"{recording.path.parent}/")))
    return figure


def _time(begin_us: int) -> str:
    """Return the name of the axis of time, s from `begin_us` on."""
    return f"time from {begun(begin_us)} (s)" if begin_us else "board time (s)"


def health_map(health: Health, ax: Axes | None = None) -> Axes:
    """Draw the activity of each taxel, with those marked that are dead, stuck or noisy.

    Parameters
    ----------
    health : Health
        As `taxel.recording.health` returns it.
    ax : matplotlib.axes.Axes, optional
        Default: new axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ProblemError : not the health of a recording; not axes of matplotlib

    Examples
    --------
    >>> import taxel
    >>> from taxel.recording import health
    >>> events = taxel.Events([0, 2500], [1, 1], [0, 0], [True, False], array=taxel.Array(2, 3))
    >>> health_map(health(events)).get_xlabel()
    'x (column)'
    """
    instance("health", health, Health)
    ax = axes(ax, (5, 4.4))
    return _map(np.log10(1.0 + health.activity), "log10 (1 + changes)", health, ax)


def _map(values: NDArray[np.floating], label: str, health: Health, ax: Axes) -> Axes:
    """Draw a value of each taxel, with those marked that are dead, stuck or noisy."""
    image = ax.imshow(values, origin="upper", cmap="Greys", interpolation="nearest")
    ax.figure.colorbar(image, ax=ax, label=escaped(label))
    for name, taxels in health.named().items():
        if taxels:
            x, y = np.array(taxels).T
            ax.scatter(x, y, marker="s", s=14, facecolors="none", edgecolors=_COLOURS[name], label=f"{name} ({len(x)})")
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="upper right", fontsize="small")
    ax.set(xlabel="x (column)", ylabel="y (row)")
    return ax
