"""The recordings that the panel shows: read, judged and cut."""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.documents import read_text
from taxel._base.errors import refused
from taxel._base.files import beside as file_beside
from taxel._base.files import named, whole_file
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats import layout_text
from taxel.formats.layout import Layout, layout_name
from taxel.frames import Frames
from taxel.labels import Labels, Note, beside, by_clock
from taxel.options import FullReading
from taxel.recording import Recording
from taxel.recording.analysis.health import health, judge
from taxel.recording.analysis.rest import flickering, loaded_from, of_frames, ticks_by_unit
from taxel.recording.convert import convert
from taxel.recording.cut import cut
from taxel.recording.kinds import is_recording
from taxel.recording.reading_options import layout_for

#: A text table of more bytes than the first number is shown by its beginning first, of as many bytes as the second.
_LARGE, _BEGINNING = 8 << 20, 1 << 19
_TEXTS = {".csv", ".txt", ".asc", ".asf", ".lst"}

#: Time from one frame to the next, us, where frames are numbered: a view shows them as 100 a second.
_NUMBER_US = 10_000

_Taxels = list[tuple[int, int]]


@dataclass(frozen=True)
class ReadRest:
    """Hold how a sensor rests.

    Parameters
    ----------
    source : str
        Where the rest is known from.
    values : float64, one per taxel, NaN where unknown
    ticks_by_unit : float
    loaded_from : float
        From where on a value above rest is a load.
    falls : bool
        Whether values fall under load.
    flickering : list of int
        Indices of taxels.
    preload_at : str
        What lay on the sensor, in words.
    """

    source: str
    values: NDArray[np.float64]
    ticks_by_unit: float
    loaded_from: float
    falls: bool
    flickering: list[int]
    preload_at: str


@dataclass(frozen=True)
class ReadSource:
    """Hold the frames of a sensor, from column `left` of the array that is shown; times in us."""

    name: str
    left: int
    rows: int
    columns: int
    t: NDArray[np.int64]
    values: NDArray[np.float32]
    rest: ReadRest


@dataclass(frozen=True)
class ReadFrames:
    """Hold a recording of frames for the panel's server.

    Parameters
    ----------
    array : the array of all sources
    sources : list of ReadSource
    unit : str
    number_us : int, optional
        Time from one frame to the next, us, where frames are numbered.
    notes : list of (time in us or None, text, source)
    detections : list of (label, time, time at which it was known, us; and which of several sensors it is of)
    verdict : str
        Empty if it is unknown.
    trial, trials : str and list of str
        The trial, and all of the file where it has several.
    left_s : float, optional
        How long the rest of the file takes to read, s.
    """

    array: _core._Array
    sources: list[ReadSource]
    unit: str
    number_us: int | None
    notes: list[tuple[int | None, str, str]]
    detections: list[tuple[str, int, int, str]]
    verdict: str
    trial: str | None = None
    trials: list[str] = field(default_factory=list)
    left_s: float | None = None


@dataclass(frozen=True)
class Opening:
    """Hold how a recording is opened that needs options.

    Parameters
    ----------
    opens : function of a path
        Opens a file, with the feet of each trial joined.
    file : path, optional
        The file that is opened so; default: each file.
    options : FullReading
        Those by which it is opened so. Labels of numbered frames that have times by its `rate_hz` are in numbers of
        frames.
    """

    opens: Callable[[Path], Sequence[Recording]] = FullReading().open_trials
    file: Path | None = None
    options: FullReading = field(default_factory=FullReading)

    def open(self, file: Path) -> Sequence[Recording]:
        """Open a file."""
        return self.opens(file) if self.file in (None, file) else FullReading().open_trials(file)

    def is_recording(self, file: Path) -> bool:
        """Return whether a file is a recording by its name, its first bytes and its layout."""
        options = self.options_of(file)
        return is_recording(file, layout_for(file, options.layout, options.rate_hz))

    def options_of(self, file: Path) -> FullReading:
        """Return the options by which a file is opened."""
        return self.options if self.file in (None, file) else FullReading()

    def unit_us(self, table: Path) -> float:
        """Return how many us a unit of time in a table of labels is."""
        rate_hz = self.options.rate_hz
        applies = self.file is None or beside(self.file) == table
        return 1e6 / rate_hz if applies and rate_hz else 1.0


def judged(activity: _core._Activity) -> dict[str, Any]:
    """Return the numbers of taxels, active and untested ones, and the dead, stuck and noisy ones."""
    array, events, moved, touches, values = activity
    sensor = Array._from_parts(array)
    greatest = np.zeros(sensor.shape) if values is None else values[2]
    active, repeated, most = (
        np.asarray(column, np.int64).reshape(sensor.shape) for column in (events, moved, greatest)
    )
    result = judge(sensor, active, repeated, touches, most > 0)
    named_taxels = result.named()
    return {
        "taxels": sensor.taxels if sensor.exists is None else int(np.count_nonzero(sensor.exists)),
        "active": int(np.count_nonzero(active)),
        **{kind: named_taxels[kind] for kind in ("dead", "stuck", "noisy")},
        "untested": int(np.count_nonzero(result.untested)),
    }


class ShownFiles:
    """Read recordings for the panel; the events of tables are written to temporary .mcap files, until `close`."""

    def __init__(self, opening: Opening | None = None) -> None:
        self._opening = Opening() if opening is None else opening
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._lock = threading.Lock()
        #: The trials of the file with several that was read last, by its path and the time of its last change.
        self._trials: tuple[tuple[Path, int], list[Recording]] | None = None

    def close(self) -> None:
        """Remove the temporary files."""
        with self._lock:
            if self._folder is not None:
                self._folder.cleanup()
                self._folder = None

    def forget(self) -> None:
        """Read again the next recording whose layout file was written."""
        with self._lock:
            self._trials = None

    def opened(self, path: Path, trial: str | None) -> tuple[Recording, list[str]]:
        """Return a recording of a file, and the names of its trials if it has several.

        Raises
        ------
        FormatError : no recording
        ProblemError : no trial of that name
        """
        key = path, path.stat().st_mtime_ns
        with self._lock:
            known = self._trials
        recordings = known[1] if known is not None and known[0] == key else list(self._opening.open(path))
        if not recordings:
            raise FormatError(f"{path.name}: contains no recording")
        if len(recordings) == 1:
            return recordings[0], []
        with self._lock:
            self._trials = key, recordings
        names = [recording.name for recording in recordings]
        if trial is not None and trial not in names:
            raise ProblemError(f"{path.name}: contains no trial {trial}")
        return recordings[0 if trial is None else names.index(trial)], names

    def read(self, path: Path, trial: str | None, *, entire: bool) -> tuple[Path | None, ReadFrames | None]:
        """Read a recording that is not a file of a board's events.

        Parameters
        ----------
        path : path
        trial : str or None
            Of a file with several; default: the first.
        entire : bool
            Whether all of a large text table is read, not only its beginning.

        Returns
        -------
        path or None
            Of events, a .mcap that holds them, until `close`.
        ReadFrames or None
            Frames.
        """
        beginning = None if entire else self._beginning(path)
        if beginning is not None:
            recording, names, left_s = beginning
        else:
            (recording, names), left_s = self.opened(path, trial), None
        if not recording.is_several and recording.has_events:
            return self._converted(recording), None
        frames = _frames(recording)
        return None, replace(frames, trial=recording.name if names else None, trials=names, left_s=left_s)

    def judge(self, path: Path, trial: str | None) -> dict[str, Any]:
        """Return what `judged` does, of a recording of frames; its taxels are in the array that is shown."""
        recording, _ = self.opened(path, trial)
        frames = {name: sensor.frames() for name, sensor in _sources(recording).items()}
        array, lefts = _array_of(frames)
        found: dict[str, _Taxels] = {"dead": [], "stuck": [], "noisy": []}
        untested = 0
        for left, sensor in zip(lefts, frames.values(), strict=True):
            result = health(sensor)
            untested += int(np.count_nonzero(result.untested))
            for kind, taxels in result.named().items():
                if kind in found:
                    found[kind] += [(x + left, y) for x, y in taxels]
        return {"taxels": array.taxels, "active": array.taxels, **found, "untested": untested}

    def cut(self, path: Path, trial: str | None, out: Path, start_us: int, stop_us: int) -> list[str]:
        """Write a stretch of a recording to a new file; return what that file cannot hold."""
        recording, _ = self.opened(path, trial)
        (part,) = cut(recording, start_us=start_us, stop_us=stop_us)
        return list(convert(part, out))

    def invert(self, path: Path) -> None:
        """State in the layout file beside a recording that its values fall with pressure.

        Raises
        ------
        ProblemError : the command states a layout
        """
        if "layout" in self._opening.options_of(path).given():
            raise refused(
                "layout", " is given in the command taxel view: change that file, or start taxel view without it"
            )
        # A layout of the whole folder stays as it is; this recording gets a copy with this key.
        there = Layout.beside(path)
        target = file_beside(path, layout_name(named(path)))
        written = layout_text.with_falls(target, "" if there is None else read_text(there))
        with whole_file(target, overwrite=True) as part:
            part.write_text(written, "utf-8", newline="\n")

    def _temporary(self) -> Path:
        with self._lock:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix="taxel-panel-")
            return Path(tempfile.mkdtemp(dir=self._folder.name))

    def _converted(self, recording: Recording) -> Path:
        target = self._temporary() / f"{recording.path.stem}.mcap"
        convert(recording, target)
        return target

    def _beginning(self, path: Path) -> tuple[Recording, list[str], float] | None:
        """Return the beginning of a large text table, and how long the rest takes to read (s); None of any other file.

        Reading takes as long for each line, so the time of the beginning tells that of all.
        """
        size = path.stat().st_size
        if path.suffix.lower() not in _TEXTS or size <= _LARGE:
            return None
        with open(path, "rb") as file:
            head = file.read(_BEGINNING)
        part = self._temporary() / path.name
        part.write_bytes(head[: head.rfind(b"\n") + 1])
        begun = time.perf_counter()
        try:
            recordings = self._opening.opens(part)
        except (FormatError, ProblemError, OSError):
            # A format whose files have no beginning of their own, or options that are of the whole file.
            return None
        finally:
            os.unlink(part)
        if len(recordings) != 1:
            return None
        taken = time.perf_counter() - begun
        return recordings[0], [], taken * size / max(1, len(head))


def _sources(recording: Recording) -> dict[str, Recording]:
    """Return the sensors of a recording of frames: its sources, or itself."""
    several = recording.is_several
    sensors = recording.sources if several else {recording.label or "board": recording}
    return (
        {n: sensor for n, sensor in sensors.items() if not sensor.has_events and not sensor.is_stream}
        if several
        else sensors
    )


def _array_of(frames: dict[str, Frames]) -> tuple[Array, list[int]]:
    """Return the array that shows those of all sensors, and the first column of each."""
    return Array._beside([sensor.array for sensor in frames.values()], gap=1)


def _frames(recording: Recording) -> ReadFrames:
    sources = _sources(recording)
    frames = {name: _in_its_unit(sensor) for name, sensor in sources.items()}
    units = {sensor.unit for sensor in frames.values()}
    if len(units) > 1:
        raise ProblemError(f"{recording.path}: its sources are in {', '.join(sorted(units))}; must be in one unit")
    array, lefts = _array_of(frames)
    us = 1 if recording.timed else _NUMBER_US
    parts = [
        ReadSource(name, left, read.array.rows, read.array.columns, _times(read.t, us), _values(read), _rest(read))
        for (name, read), left in zip(frames.items(), lefts, strict=True)
    ]
    noted = {name: {(note.t, note.text) for note in sensor.notes} for name, sensor in sources.items()}
    of_all = set.intersection(*noted.values())
    notes = {(t, text, "") for t, text in of_all}
    notes |= {(t, text, name) for name, of_source in noted.items() for t, text in of_source - of_all}
    begin_us = min((int(read.t.min()) for read in frames.values() if len(read.t)), default=0)
    rows = (by_clock(row, begin_us) for row in _labels_beside(recording))
    labels = {(row.t, row.text) for row in rows}
    notes = {note for note in notes if note[:2] not in labels}
    each = sources.items() if len(sources) > 1 else [("", sensor) for sensor in sources.values()]
    found = [(d.label, d.t, d.known, name) for name, sensor in each for d in sensor.detections]
    sorted_notes = sorted(notes, key=lambda note: (note[0] or 0, note[1]))
    verdict = "" if recording.verdict.status == "unknown" else recording.verdict
    number_us = None if us == 1 else us
    return ReadFrames(array._parts(), parts, units.pop(), number_us, sorted_notes, found, verdict)


def _labels_beside(recording: Recording) -> tuple[Note, ...]:
    """Return the labels of the table beside a file, which the panel shows as such and not as notes."""
    table = beside(recording.path)
    return Labels(table).rows if table.is_file() else ()


def _in_its_unit(recording: Recording) -> Frames:
    """Return frames in N or kPa where a calibration gives it, else in the file's unit."""
    return recording.frames() if recording.calibration is None else recording.calibrated()


def _rest(frames: Frames) -> ReadRest:
    rest = of_frames(frames)
    source, flickers = {"unit": "given"}.get(rest.source, rest.source), np.flatnonzero(flickering(frames)).tolist()
    loaded = loaded_from(frames, rest)
    return ReadRest(source, rest.values, ticks_by_unit(frames), loaded, rest.falls, flickers, rest.preload_at)


def _times(t: NDArray[np.int64], us: int) -> NDArray[np.int64]:
    return np.ascontiguousarray(t * us)


def _values(frames: Frames) -> NDArray[np.float32]:
    return np.ascontiguousarray(frames.values).reshape(-1)
