"""Film of the taxels' values over time."""

from __future__ import annotations

import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib import animation
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from taxel._base.arguments import finite
from taxel._base.errors import refused
from taxel._base.files import write_whole
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.recording.analysis.pressure import above_rest_at
from taxel.spikes import to_ms
from taxel.wire import FRAME_US

#: Frame rate of the film, Hz.
_RATE_HZ = 20
#: The most frames of a film.
_MOST = 2_000


def film(
    events: Events,
    path: str | os.PathLike[str],
    force_n: NDArray[np.float32] | None = None,
    *,
    frame_us: float = FRAME_US,
    slower: float = 10.0,
    overwrite: bool = False,
    watch: Callable[[float], object] = lambda _: None,
) -> Path:
    """Write a film of the taxels' values above the rest that they show, with a plot of the force on the foam.

    Parameters
    ----------
    events : Events
        With intensities and a start marker.
    path : path
        A .gif always works (Pillow writes it); .mp4 and others if matplotlib finds a writer, such as ffmpeg.
    force_n : float32, optional
        The true force at each frame of the board.
    frame_us : float, us
        Duration of a frame of the board.
    slower : float, above 0
        Factor by which the film is slower than the touch.
    overwrite : bool
        Whether an existing file may be replaced.
    watch : function, optional
        Called with the share of frames drawn.

    Raises
    ------
    ProblemError : no event, no intensities, a file ending without a writer, or a film of more than 2000 frames
    FileExistsError : the file is there already
    """
    target = Path(path)
    if not finite("slower", slower) > 0:
        raise refused("slower", f" is {slower:g}: must be above 0")
    writer = writer_of(target)
    if not len(events) or events.intensity is None:
        raise refused("events", ": nothing to draw; a film needs events with intensities")
    begin = events.markers[0][0] if events.markers else int(events.t[0])
    period_us = 1e6 / _RATE_HZ / slower
    events = events.sorted()
    times = np.arange(begin, int(events.t[-1]) + period_us, period_us)
    if len(times) > _MOST:
        raise ProblemError(
            f"{len(times)} frames; must be at most {_MOST}: choose a value of slower below "
            f"{slower * _MOST / len(times):.3g}"
        )
    over = above_rest_at(events, times.astype(np.int64))

    figure, image, below = _stage(events.array, times, float(over.max(initial=1.0)))
    if force_n is None:
        ends = np.searchsorted(events.t, times, side="right")
        below.plot(to_ms(times - begin), np.diff(ends, prepend=0))
        below.set(ylabel="events")
    else:
        below.plot(to_ms(np.arange(len(force_n)) * frame_us - begin), force_n)
        below.set(ylabel="force (N)")
    cursor = below.axvline(0.0, color="0.5")
    # The layout is computed once, as no moving part changes its size.
    figure.draw_without_rendering()
    figure.set_layout_engine("none")

    def write(file: io.BufferedIOBase) -> None:
        # Writers require a file name with an ending, so they write to a temporary file, whose bytes are copied to
        # `file`.
        with tempfile.TemporaryDirectory() as folder:
            film = Path(folder) / f"film{target.suffix.lower()}"
            with writer.saving(figure, str(film), dpi=80):
                for n, (t, frame) in enumerate(zip(times, over, strict=True)):
                    image.set_data(frame)
                    cursor.set_xdata([to_ms(t - begin)] * 2)
                    writer.grab_frame()
                    watch((n + 1) / len(times))
            file.write(film.read_bytes())

    return write_whole(target, write, overwrite=overwrite)  # type: ignore[arg-type]


def writer_of(file: Path) -> animation.AbstractMovieWriter:
    """Return matplotlib's writer for a film of that name.

    Raises
    ------
    ProblemError : no writer supports the ending
    """
    if file.suffix.lower() == ".gif":
        return animation.PillowWriter(fps=_RATE_HZ)
    if file.suffix.lower() in (".mp4", ".webm", ".mkv", ".mov") and animation.writers.is_available("ffmpeg"):
        return animation.FFMpegWriter(fps=_RATE_HZ)
    raise ProblemError(f"{file}: must end in .gif; .mp4, .webm, .mkv and .mov need the program ffmpeg")


def _stage(array: Array, times: NDArray[np.float64], most: float) -> tuple[Figure, AxesImage, Axes]:
    """Return a figure, the image of the taxels in it, and the axes of the plot over time."""
    figure = Figure(figsize=(5.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=[5, 1])
    rows, columns = array.shape
    known = array.pitch_mm is not None
    down, across = array._pitch("film") if known else (1.0, 1.0)
    image = above.imshow(
        np.zeros((rows, columns)), cmap="magma", vmin=0, vmax=most, interpolation="nearest",
        extent=(-across / 2, (columns - 0.5) * across, (rows - 0.5) * down, -down / 2),
    )  # fmt: skip
    figure.colorbar(image, ax=above, label="ticks above rest")
    above.set(xlabel="x (mm)" if known else "column", ylabel="y (mm)" if known else "row")
    below.set(xlabel="time since the start marker (ms)", xlim=(0, to_ms(times[-1] - times[0])))
    return figure, image, below
