"""Opens recordings as options say that are typed (`taxel.options.FullReading`): sizes as text, and a rate."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel._base.arguments import checked_path, several, text
from taxel._base.errors import refused
from taxel.array import Array, of_size
from taxel.formats.foreign import is_bag
from taxel.recording.kinds import ListedTopics, known, layout_of
from taxel.recording.opening import open_all
from taxel.recording.recording import Recording
from taxel.recording.stated import is_row_of, on_array


def open_trials(
    path: str | os.PathLike[str],
    *,
    array: Sequence[str] | None = None,
    layout: str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    **options: Any,
) -> list[Recording]:
    """Open a file or a folder; of a folder, or of another maker's file, all trials in it.

    Parameters
    ----------
    path : path
    array : sequence of str, optional
        Rows, columns and pitch (mm) of the sensor, as "24x20x5"; of a ROS bag one for each topic, or one for all.
    layout : path, optional
    rate_hz : float, Hz, optional
        Frames a second, for recordings without times.
    **options
        Others of `taxel.open`.

    Raises
    ------
    ProblemError : an `array` that differs from the sensor that a file holds; a `rate_hz` of one with times
    """
    file = Path(checked_path("path", path))
    sizes = [] if array is None else several("array", array)
    arrays = [of_size(text("array", size), of_wire=False) for size in sizes]
    given = arrays if len(arrays) > 1 else arrays[0] if arrays else None
    opened = open_all(file, array=given, layout=layout, **options)
    placed = (_on_array(recording, sizes) for recording in opened)
    return [recording if rate_hz is None else recording.at_rate(rate_hz) for recording in placed]


def topics_in(path: Path, topic: object, ros: str | None, layout: str | os.PathLike[str] | None) -> ListedTopics | None:
    """Return the topics of a ROS bag if none is chosen; None of other files.

    Raises
    ------
    FormatError, ImportError, ProblemError : as of opening it
    """
    if topic or not is_bag(path):
        return None
    stated, listed = layout_of(path, layout), getattr(known(path)[1], "topics", None)
    chosen = None if stated is None or stated.ros is None else stated.ros.topic
    return None if chosen or listed is None else listed(path, ros)


def _on_array(recording: Recording, sizes: Sequence[str]) -> Recording:
    """Return a recording on the sensor of `array`; refuse one that holds a sensor that differs from it."""
    # A bag holds no sensor, so that its messages are of the given one or are left out.
    if not sizes or recording.kind == "ros":
        return recording
    stated, array = recording.array, of_size(sizes[0], of_wire=False)
    are_frames = not recording.has_events and not recording.is_stream and len(recording.sources) < 2
    if are_frames and is_row_of(stated, array):
        return _on_sensor(recording, array)
    differs = array.pitch_mm is not None and (stated.pitch_mm, stated.places) != (array.pitch_mm, None)
    if stated.shape != array.shape or differs:
        given = ", ".join(sizes)
        raise refused("array", f" is {given}: must be left out, because {recording.path} states its sensor, {stated!r}")
    # A .mcap holds its sensor, whose pitch may be unknown, and a camera's file its pixels.
    if not recording.has_events or stated._is_measured or recording.kind in ("mcap", "event_camera"):
        return recording
    # A size without a pitch says nothing of it, and events without one are of the board's wire.
    wire = of_size(sizes[0])
    return _on_sensor(recording, Array(*stated.shape, wire.pitch_mm, stated.exists, wire.name))


def _on_sensor(recording: Recording, array: Array) -> Recording:
    """Return a recording on another description of its sensor."""
    label = recording._main.facts.label
    return Recording({**recording._sources, label: on_array(recording._main, array)})
