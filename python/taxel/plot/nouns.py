"""One plot for each data class."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize

from taxel._base.arguments import finite, instance, shown
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped
from taxel._core import ProblemError
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.spikes import SpikeTrains, to_ms

ON, OFF = "#c44e52", "#4c72b0"


def axes(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the given axes, or new ones of a size in inches."""
    if ax is None:
        return plt.subplots(figsize=size, layout="constrained")[1]
    if not isinstance(ax, Axes):
        raise refused("ax", f" is {shown(ax)}: must be matplotlib's Axes")
    return ax


def raster(trains: SpikeTrains, ax: Axes | None = None) -> Axes:
    """Draw spike times to the right (ms), trains upwards; values above and below 0 in two colours.

    Parameters
    ----------
    trains : SpikeTrains
    ax : matplotlib.axes.Axes, optional
        Default: new axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ProblemError : not spike trains; not axes of matplotlib

    Examples
    --------
    >>> import taxel
    >>> ax = raster(taxel.SpikeTrains.from_lists([[1.0, 5.0], [3.0]], stop=10.0))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('time (ms)', 'train')
    """
    instance("trains", trains, SpikeTrains)
    ax = axes(ax, (8, 4))
    times, train = trains.to_numpy()
    size = float(np.clip(4000 / max(1, len(trains)), 4, 200))
    if trains.values is None:
        ax.scatter(times, train, size, "black", marker="|", linewidths=0.8)
    else:
        names = ("ON", "OFF") if trains.signed else ("above 0", "below 0")
        for rising, colour, name in zip((True, False), (ON, OFF), names, strict=True):
            chosen = (trains.values > 0) == rising
            ax.scatter(times[chosen], train[chosen], size, colour, marker="|", linewidths=0.8, label=name)
        ax.legend(loc="upper right")
    ax.set(xlabel="time (ms)", ylabel="train", xlim=_wide(trains.start, trains.stop), ylim=(-0.7, len(trains) - 0.3))
    return ax


def pressure_map(frames: Frames, at: int | None = None, ax: Axes | None = None) -> Axes:
    """Draw one frame: the last at or before a time, or the one with the largest sum.

    Parameters
    ----------
    frames : Frames
        At least one.
    at : int, us, optional
        Time by the frames' clock.
    ax : matplotlib.axes.Axes, optional
        Default: new axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ProblemError : not frames, or empty ones; not a number; not axes of matplotlib

    Examples
    --------
    >>> import numpy as np, taxel
    >>> frames = taxel.Frames(np.arange(12.0).reshape(2, 2, 3), [0, 1500], unit="kPa")
    >>> pressure_map(frames).get_title(), pressure_map(frames, at=1000).get_title()
    ('1.500 ms', '0.000 ms')
    """
    instance("frames", frames, Frames)
    until = None if at is None else finite("at", at)
    if not len(frames):
        raise ProblemError("no frame to draw: the frames are empty")
    ax = axes(ax, (5, 4.4))
    k = int(frames.total().argmax())
    if until is not None:
        k = max(0, int(np.searchsorted(frames.t, until, side="right")) - 1)
    exists = True if frames.array.exists is None else frames.array.exists
    values = np.where(exists, frames.values[k], np.nan)
    image = ax.imshow(values, origin="upper", cmap="magma", interpolation="nearest")
    ax.figure.colorbar(image, ax=ax, label=escaped(frames.unit))
    ax.set(xlabel="x (column)", ylabel="y (row)", title=f"{to_ms(frames.t[k]):.3f} ms")
    return ax


def event_picture(events: Events, ax: Axes | None = None) -> Axes:
    """Draw the number of events of each taxel: rises in one colour, falls in another, both together dark.

    Parameters
    ----------
    events : Events
    ax : matplotlib.axes.Axes, optional
        Default: new axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ProblemError : not events; not axes of matplotlib

    Examples
    --------
    >>> import taxel
    >>> event_picture(taxel.Events([0, 2500], [1, 1], [0, 0], [True, False], array=taxel.Array(2, 3))).get_title()
    '2 events, 2.5 ms'
    """
    instance("events", events, Events)
    ax = axes(ax, (5.6, 4.4))
    picture = np.ones((*events.array.shape, 3))
    counts = [np.zeros(events.array.shape) for _ in range(2)]
    for count, there in zip(counts, (events.p, ~events.p), strict=True):
        np.add.at(count, (events.y[there], events.x[there]), 1)
    most = max(1.0, *(float(count.max()) for count in counts))
    for count, colour, name in zip(counts, (ON, OFF), ("rises", "falls"), strict=True):
        shades = LinearSegmentedColormap.from_list(name, ["white", colour])
        # The scale makes a single event visible against taxels without any.
        share = np.where(count > 0, 0.15 + 0.85 * count / most, 0.0)
        picture *= shades(share)[..., :3]
        scale = ScalarMappable(Normalize(0, most), shades)
        ax.figure.colorbar(scale, ax=ax, label=name, fraction=0.05)
    ax.imshow(picture, origin="upper", interpolation="nearest")
    ax.set(
        xlabel="x (column)",
        ylabel="y (row)",
        title=f"{counted(len(events), 'event')}, {to_ms(events.duration_us):.1f} ms",
    )
    return ax


def detections(found: Detections, ax: Axes | None = None) -> Axes:
    """Draw each label's detections as marks over time (s), a row for each label.

    Parameters
    ----------
    found : Detections
    ax : matplotlib.axes.Axes, optional
        Default: new axes.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ProblemError : not detections; not axes of matplotlib

    Examples
    --------
    >>> import taxel
    >>> ax = detections(taxel.Detections(["contact", "lift"], [1000, 9000], [1200, 9100]))
    >>> [label.get_text() for label in ax.get_yticklabels()]
    ['contact', 'lift']
    """
    instance("found", found, Detections)
    ax = axes(ax, (8, 2.4))
    for row, label in enumerate(found.labels):
        ax.scatter(found[label].t / 1e6, np.full(len(found[label]), row), marker="|", s=400, color=f"C{row}")
    ax.set(xlabel="time (s)", yticks=range(len(found.labels)), yticklabels=list(map(escaped, found.labels)))
    ax.set_ylim(-0.7, max(1, len(found.labels)) - 0.3)
    return ax


def _wide(start: float, stop: float) -> tuple[float, float]:
    """Return the limits of an axis, which are wider than the window if its length is 0."""
    return (start, stop) if stop > start else (start - 0.5, stop + 0.5)
