"""The options of opening as text, and the opening by them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from taxel._base.arguments import checked_path, several, text
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.array import Array, of_size
from taxel.formats.layout import Layout, layout_name
from taxel.recording.layout import is_row_of, on_array
from taxel.recording.opening import SharedOptions, files_in, is_folder, kind_of, open_all, sensors
from taxel.recording.recording import Recording

#: How an option is typed of whose name a command may have another one.
TYPED = {"window_ms": "count_ms"}


@dataclass(frozen=True, kw_only=True)
class TextOptions(SharedOptions):
    """Hold the options of opening as a command line or a request in JSON states them.

    Parameters
    ----------
    array : sequence of str, optional
        Rows, columns and pitch (mm) of the sensor, as "24x20x5"; of a ROS bag one for each topic, or one for all.
    layout, topic, field, ros, region, bin, window_ms, polarity, label_column
        As in `taxel.open`.
    rate_hz : float, Hz, optional
        Frames a second, for recordings without times.
    """

    array: Sequence[str] | None = None
    rate_hz: float | None = None

    def open_trials(self, path: str | os.PathLike[str]) -> list[Recording]:
        """Open a file or a folder; of a folder, or of another maker's file, all trials in it.

        Raises
        ------
        ProblemError : an `array` that differs from the sensor that a file holds; a `rate_hz` of one with times
        """
        file = Path(checked_path("path", path))
        sizes = [] if self.array is None else several("array", self.array)
        arrays = [of_size(text("array", size), of_wire=False) for size in sizes]
        options = {option.name: getattr(self, option.name) for option in fields(SharedOptions)}
        options["array"] = arrays if len(arrays) > 1 else arrays[0] if arrays else None
        options["layout"] = self.layout_of(file)
        opened = open_all(file, **options)
        placed = map(self._on_array, opened)
        return [recording if self.rate_hz is None else recording.at_rate(self.rate_hz) for recording in placed]

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults, as JSON holds them."""
        options = ((f.name, getattr(self, f.name)) for f in fields(self))
        return {
            name: str(value) if isinstance(value, Path) else value
            for name, value in options
            if value not in (None, [], ())
        }

    def words(self) -> list[str]:
        """Return the options as words of a command line."""
        words: list[str] = []
        for name, value in self.given().items():
            for entry in value if isinstance(value, list | tuple) else [value]:
                words += [f"--{TYPED.get(name, name).replace('_', '-')}", str(entry)]
        return words

    def _names_topic(self, bag: Path) -> bool:
        """Return whether these options, or the layout file of a ROS bag, say which topic to open."""
        layout = self.layout or Layout.beside(bag)
        return bool(self.topic) or (layout is not None and "topic" in Layout.read(Path(layout)).ros)

    def layout_of(self, path: Path) -> Any:
        """Return the layout that is given, or an empty one for a table or arrays, whose rate `rate_hz` says."""
        if self.layout is not None or self.rate_hz is None or not path.exists():
            return self.layout
        files = files_in(path) if is_folder(path) else [path]
        undescribed = [
            file
            for file in files
            if file.is_file() and Layout.beside(file) is None and kind_of(file) in ("table", "arrays")
        ]
        return Layout(path.with_name(layout_name(path))) if undescribed else None

    def _on_array(self, recording: Recording) -> Recording:
        """Return a recording on the sensor of `array`; refuse one that holds a sensor that differs from it."""
        # A bag holds no sensor, so that its messages are of the given one or are left out.
        if not self.array or recording.kind == "ros":
            return recording
        stated, array = recording.array, of_size(self.array[0], of_wire=False)
        if _is_row_of(recording, array):
            return _on_sensor(recording, array)
        differs = array.pitch_mm is not None and (stated.pitch_mm, stated.places) != (array.pitch_mm, None)
        if stated.shape != array.shape or differs:
            sizes = ", ".join(self.array)
            raise refused(
                "array", f" is {sizes}: must be left out, because {recording.path} states its sensor, {stated!r}"
            )
        # A .mcap holds its sensor, whose pitch may be unknown, and a camera's file its pixels.
        if not recording.has_events or stated._is_measured or recording.kind in ("mcap", "event_camera"):
            return recording
        # A size without a pitch says nothing of it, and events without one are of the board's wire.
        wire = of_size(self.array[0])
        return _on_sensor(recording, Array(*stated.shape, wire.pitch_mm, stated.exists, wire.name))

    def open_sensors(self, paths: Sequence[str | os.PathLike[str]]) -> list[Recording]:
        """Open recordings one after the other; of a folder, or of another maker's file, all trials in it.

        Each sensor of a file with several is a separate recording (`Recording.title`).
        """
        trials = (trial for path in several("paths", paths) for trial in self.open_trials(path))
        return [sensor for trial in trials for sensor in sensors(trial)]

    def open_one(self, path: str | os.PathLike[str]) -> Recording:
        """Open a file that holds one recording.

        Raises
        ------
        ProblemError : it holds several
        """
        recordings = self.open_trials(path)
        if len(recordings) != 1:
            some = ", ".join(recording.name for recording in recordings[:3]) + ", ..." * (len(recordings) > 3)
            raise ProblemError(f"{path}: contains {len(recordings)} recordings ({some}); must contain one")
        return recordings[0]


def _on_sensor(recording: Recording, array: Array) -> Recording:
    """Return a recording on another description of its sensor."""
    label = recording._main.facts.label
    return Recording({**recording._sources, label: on_array(recording._main, array)})


def _is_row_of(recording: Recording, array: Array) -> bool:
    """Return whether a recording is of frames that are a row of as many channels as a sensor has taxels."""
    are_frames = not recording.has_events and not recording.is_stream and len(recording.sources) < 2
    return are_frames and is_row_of(recording.array, array)
