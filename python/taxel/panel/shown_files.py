"""The recordings that the panel shows: read, judged and cut."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.limits import available
from taxel._core import UNKNOWN, FormatError, ProblemError
from taxel.array import Array
from taxel.formats.layout import Layout, layout_name
from taxel.frames import Frames
from taxel.labels import Labels, beside, by_clock
from taxel.options import FullReading
from taxel.panel.regions import RegionLoads
from taxel.recording import Recording
from taxel.recording.analysis.health import health, judge
from taxel.recording.analysis.rest import loaded_from, of_frames, ticks_by_unit
from taxel.recording.convert import convert
from taxel.recording.cut import cut
from taxel.recording.kinds import is_recording, layout_of, takes_layout
from taxel.verdict import Verdict
from taxel.wire import Registers

#: Time from one frame to the next, us, where frames are numbered: a view shows them as 100 a second.
_NUMBER_US = 10_000

#: Detections of a recording that are shown.
_MOST_DETECTIONS = 10_000

#: Changes of a recording take one in so many bytes of the memory that is available, at most.
_MEMORY_SHARE = 4

#: The endings of what is read in little memory.
_OWN = (".mcap", ".lsa")

_Taxels = list[tuple[int, int]]


@dataclass(frozen=True)
class ReadSource:
    """The frames of a sensor, from column `left` of the array that is shown, with their rest; times in us."""

    name: str
    left: int
    array: Array
    t: NDArray[np.int64]
    values: NDArray[np.float32]
    rest_source: str
    rest: NDArray[np.float64]
    ticks_by_unit: float
    loaded_from: float
    falls: bool
    preload_at: str


@dataclass(frozen=True)
class ReadFrames:
    """The frames of a recording for its view.

    Parameters
    ----------
    array : the array of all sources
    sources : list of ReadSource
    unit : str
    number_us : int, optional
        Time from one frame to the next, us, where frames are numbered.
    """

    array: Array
    sources: list[ReadSource]
    unit: str
    number_us: int | None


#: A recording for its view, and what the message `opened` says of it.
Viewed: TypeAlias = tuple[_core.PanelRecording, dict[str, Any]]


@dataclass(frozen=True)
class Opening:
    """How a recording is opened that needs options.

    Parameters
    ----------
    opens : function of a path
        Opens a file, with the feet of each trial joined.
    file : path, optional
        The file that is opened so; default: each file.
    options : FullReading
        Those by which it is opened so. Labels of numbered frames that have times by its `rate_hz` are in numbers of
        frames.
    first : str, optional
        The name of the recording that is shown first.
    labels : str
        The end of the names of the tables of labels: "notes" for NAME.notes.csv.
    """

    opens: Callable[[Path], Sequence[Recording]] | None = None
    file: Path | None = None
    options: FullReading = field(default_factory=FullReading)
    first: str | None = None
    labels: str = "notes"

    def open(self, file: Path) -> Sequence[Recording]:
        """Open a file."""
        opens = FullReading().open_trials if self.opens is None or self.file not in (None, file) else self.opens
        return opens(file)

    def is_recording(self, file: Path) -> bool:
        """Return whether a file is a recording by its name, its first bytes and its layout."""
        options = self.options_of(file)
        return is_recording(file, options.layout)

    def options_of(self, file: Path) -> FullReading:
        """Return the options by which a file is opened."""
        return self.options if self.file in (None, file) else FullReading()

    def layout_of(self, file: Path) -> Layout:
        """Return the layout by which a file is opened; an empty one if it has none."""
        options = self.options_of(file)
        given = options.layout
        return layout_of(file, given) or Layout(file.with_name(layout_name(file)))

    def unit_us(self, table: Path) -> float:
        """Return how many us a unit of time in a table of labels is."""
        rate_hz = self.options.rate_hz
        applies = self.file is None or beside(self.file) == table
        return 1e6 / rate_hz if applies and rate_hz else 1.0


def judged(activity: _core._Activity) -> dict[str, Any]:
    """Return the numbers of taxels and untested ones, and the dead, stuck and noisy ones."""
    array, events, moved, touches, greatest = activity
    sensor = Array._from_geometry(array)
    active, repeated, most = (
        np.asarray(column, np.int64).reshape(sensor.shape) for column in (events, moved, greatest)
    )
    result = judge(sensor, active, repeated, touches, most > 0)
    named_taxels = result.named()
    return {
        "taxels": sensor.taxels if sensor.exists is None else int(np.count_nonzero(sensor.exists)),
        **{kind: named_taxels[kind] for kind in ("dead", "stuck", "noisy")},
        "untested": int(np.count_nonzero(result.untested)),
    }


class FileState(NamedTuple):
    """What is another once a recording or its layout file was written: the size, bytes, and when that was, ns."""

    size: int
    written_ns: int
    layout_ns: int


def state_of(path: Path) -> FileState:
    """Return the state of a recording; the size of a bag that is a folder is that of its files."""
    layout = Layout.beside(path)
    files = path.iterdir() if path.is_dir() else [path]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return FileState(size, path.stat().st_mtime_ns, 0 if layout is None else layout.stat().st_mtime_ns)


class ShownFiles:
    """Read recordings for the panel.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    records : function
        Whether a recording runs, which a file of another program may end: it may need all memory of the process.
    """

    def __init__(self, opening: Opening | None = None, records: Callable[[], bool] = lambda: False) -> None:
        self._opening, self._records = Opening() if opening is None else opening, records
        self._lock = threading.Lock()
        #: The trials of the file with several that was read last, by its path and state.
        self._trials: tuple[tuple[Path, FileState], list[Recording]] | None = None
        #: The loads of the recording whose regions were asked for last, and the lock of what reads them.
        self._loads: tuple[tuple[Path, FileState, str | None], RegionLoads] | None = None
        self._loading = threading.Lock()

    def check(self, path: Path) -> None:
        """Refuse a file of another program while a recording runs.

        Raises
        ------
        ProblemError : a recording runs, and the file is of another program
        """
        if path.suffix.lower() not in _OWN and self._records():
            own = " and ".join(_OWN)
            raise ProblemError(
                f"{path.name}: while a recording runs, the page opens {own} only, as another file may need all memory; "
                "stop the recording first"
            )

    def opened(self, path: Path, trial: str | None) -> tuple[Recording, list[str]]:
        """Return a recording of a file, and the names of its trials if it has several.

        Raises
        ------
        FormatError : no recording
        ProblemError : no trial of that name; as of `check`
        """
        self.check(path)
        key = path, state_of(path)
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

    def read(self, path: Path, trial: str | None) -> Viewed:
        """Read a recording for its view: of a file with several trials one of them, by default the first."""
        # A board's .mcap is read as it is, but the one that is shown first by the options, if there are any.
        board = None if self._opening.opens and path.name == self._opening.first else _board(path)
        if board is not None:
            return board
        recording, names = self.opened(path, trial)
        are_events = not recording.is_several and recording.has_events
        shown, contents = _events(recording) if are_events else _frames(recording)
        contents["has_roles"] = takes_layout(recording.path)
        if not are_events:
            contents["frames"] |= {"trial": recording.name if names else None, "trials": names}
        return shown, contents

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
        return {"taxels": array.taxels, **found, "untested": untested}

    def loads(self, path: Path, trial: str | None, us: int) -> RegionLoads:
        """Return the loads of the regions of a recording, read once.

        Raises
        ------
        ProblemError : as of `RegionLoads`
        """
        key = path, state_of(path), trial
        with self._loading:
            if self._loads is None or self._loads[0] != key:
                self._loads = None
                self._loads = key, RegionLoads(path.name, _sources(self.opened(path, trial)[0]), us)
            return self._loads[1]

    def cut(self, path: Path, trial: str | None, out: Path, start_us: int, stop_us: int) -> list[str]:
        """Write a stretch of a recording to a new file; return what that file cannot hold."""
        recording, _ = self.opened(path, trial)
        (part,) = cut(recording, start_us=start_us, stop_us=stop_us)
        return list(convert(part, out))


def _sources(recording: Recording) -> dict[str, Recording]:
    """Return the sensors of a recording of frames: its sources, or itself."""
    if not recording.is_several:
        return {recording.label or "board": recording}
    return {n: sensor for n, sensor in recording.sources.items() if not sensor.has_events and not sensor.is_stream}


def _array_of(frames: dict[str, Frames]) -> tuple[Array, list[int]]:
    """Return the array that shows those of all sensors, and the first column of each."""
    return Array._beside([sensor.array for sensor in frames.values()], gap=1)


def _board(path: Path) -> Viewed | None:
    """Read a .mcap of a board's events; None of any other file, those of other programs among them."""
    if path.suffix != ".mcap":
        return None
    try:
        reader = _core.RecordingReader(path)
    except (_core.Error, OSError):
        return None
    header, *_ = reader.about()
    if header.get("frames") is not None:
        return None
    shown, remarks, pace = _core.PanelRecording.of_board(reader, path.parent, available() // _MEMORY_SHARE)
    values = header.get("registers")
    contents = _contents(
        shown,
        Verdict._of({"file": remarks.condition}),
        ((note["t_us"], note["text"], "") for note in remarks.notes),
        ((label, t, "") for _, label, t, *_ in remarks.detections),
        registers=None if values is None else Registers._of_file(values, Array._from_geometry(header["array"])),
        zeroed=((each["x"], each["y"], each["t"], each["rest"], each["before"]) for _, each in remarks.zeroings),
    )
    return shown, contents | {"pace": pace}


def _events(recording: Recording) -> Viewed:
    """Read another recording of events."""
    held, registers, events = recording.held, recording.registers, recording.events.sorted()
    labels = _labels_beside(recording, int(events.t[0]) if len(events) else 0)
    ticks = None if held is None else np.where(np.isnan(held), UNKNOWN, held).astype(np.uint16).ravel()
    shown = _core.PanelRecording.of_events(
        events,
        ticks,
        0 if registers is None else registers.noise_floor,
        recording.path.parent,
        available() // _MEMORY_SHARE,
    )
    contents = _contents(
        shown,
        _verdict(recording),
        ((note.t, note.text, "") for note in recording.notes if (note.t, note.text) not in labels),
        ((found.label, found.t, "") for found in recording.detections),
        registers=registers,
        zeroed=((each.x, each.y, each.t, each.rest, each.before) for each in recording.zeroings),
    )
    return shown, contents


def _contents(
    recording: _core.PanelRecording,
    verdict: str,
    notes: Iterable[tuple[int | None, str, str]],
    detections: Iterable[tuple[str, int, str]],
    *,
    registers: Registers | None = None,
    zeroed: Iterable[tuple[int, int, int, float, float | None]] = (),
) -> dict[str, Any]:
    """Return what the message `opened` says of a recording, of which these are the notes and the detections.

    Parameters
    ----------
    recording : PanelRecording
    verdict : str
        Empty if it is unknown.
    notes : (time in us or None, text, source)
    detections : (label, time in us, which of several sensors it is of)
    registers : Registers, optional
    zeroed : (column, row, time in us, rest, rest before)
    """
    us = recording.times()[2]
    return {
        **recording.opened(),
        "verdict": str(verdict),
        "pace": None,
        "has_roles": False,
        "registers": None if registers is None else registers._held,
        "frame_us": None if registers is None else registers.frame_us,
        "notes": [{"t_us": None if t is None else t * us, "text": text, "source": source} for t, text, source in notes],
        "zeroed": [{"taxel": (x, y), "t_us": t, "rest": rest, "before": before} for x, y, t, rest, before in zeroed],
        "detections": [
            {"label": label, "t_us": t * us, "source": source}
            for label, t, source in itertools.islice(detections, _MOST_DETECTIONS)
        ],
    }


def _verdict(recording: Recording) -> str:
    return "" if recording.verdict.status == "unknown" else recording.verdict


def _frames(recording: Recording) -> Viewed:
    sources = _sources(recording)
    # In N or kPa where a calibration gives it, else in the file's unit.
    frames = {
        name: sensor.frames() if sensor.calibration is None else sensor.calibrated() for name, sensor in sources.items()
    }
    units = {sensor.unit for sensor in frames.values()}
    if len(units) > 1:
        raise ProblemError(f"{recording.path}: its sources are in {', '.join(sorted(units))}; must be in one unit")
    array, lefts = _array_of(frames)
    us = 1 if recording.timed else _NUMBER_US
    parts = [_read(name, left, read, us) for (name, read), left in zip(frames.items(), lefts, strict=True)]
    noted = {name: {(note.t, note.text) for note in sensor.notes} for name, sensor in sources.items()}
    of_all = set.intersection(*noted.values())
    notes = {(t, text, "") for t, text in of_all}
    notes |= {(t, text, name) for name, of_source in noted.items() for t, text in of_source - of_all}
    begin_us = min((int(read.t.min()) for read in frames.values() if len(read.t)), default=0)
    labels = _labels_beside(recording, begin_us)
    notes = {note for note in notes if note[:2] not in labels}
    each = sources.items() if len(sources) > 1 else [("", sensor) for sensor in sources.values()]
    found = ((d.label, d.t, name) for name, sensor in each for d in sensor.detections)
    sorted_notes = sorted(notes, key=lambda note: (note[0] or 0, note[1]))
    read_frames = ReadFrames(array, parts, units.pop(), None if us == 1 else us)
    shown = _core.PanelRecording.of_frames(read_frames, recording.path.parent, available() // _MEMORY_SHARE)
    return shown, _contents(shown, _verdict(recording), sorted_notes, found)


def _labels_beside(recording: Recording, begin_us: int) -> set[tuple[int | None, str]]:
    """Return time and text of the labels in the table beside a file, which the panel shows as such and not as notes."""
    table = beside(recording.path)
    rows = Labels(table).rows if table.is_file() else ()
    return {(row.t, row.text) for row in (by_clock(row, begin_us) for row in rows)}


def _read(name: str, left: int, frames: Frames, us: int) -> ReadSource:
    taken, values = of_frames(frames), np.ascontiguousarray(frames.values).reshape(-1)
    return ReadSource(
        name,
        left,
        frames.array,
        np.ascontiguousarray(frames.t * us),
        values,
        "given" if taken.source == "unit" else taken.source,
        taken._values(frames.array),
        ticks_by_unit(frames),
        loaded_from(frames, taken),
        taken.falls,
        taken.preload_at,
    )
