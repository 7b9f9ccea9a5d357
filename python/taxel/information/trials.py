"""Trials: labelled stretches of recordings, with their groups."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from taxel._base.arguments import checked_path, instance, integer, number, several, shown, text
from taxel._base.errors import helped, placed, refused, unreadable
from taxel._base.header_table import HeaderTable, text_of
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note, ahead_us, by_clock
from taxel.recorded import refuse_numbered
from taxel.recording import Recording
from taxel.spikes import to_ms, to_us

__all__ = ["LabelledTrial", "notes_as_trials", "read_trials", "recordings_as_trials"]

_COLUMNS = ("recording", "t_us", "label")


@dataclass(frozen=True, eq=False)
class LabelledTrial:
    """Hold one trial: a stretch of a recording, its label and its group.

    Its label belongs to the whole stretch, which a classifier distinguishes from others. A `taxel.detect.Example` has
    the times of labelled events, at which a neuron learns to fire.

    Parameters
    ----------
    source : Events or Frames
        The recording of the trial; trials of one recording share it.
    label : str
    start_us : int, us
        The touch begins at the first event at or after it.
    stop_us : int, us, optional
        The trial's end (exclusive): nothing after it is used, and the length of the touch is known.
    group : str
        Trials of a group (person, session, pose) are not split between folds; if it is empty, the trial is a group by
        itself.
    name : str
        Place of the trial, for errors.

    Raises
    ------
    ProblemError : a source of another kind, an empty label, or an end that is not after the start

    Examples
    --------
    >>> events = Events([0, 200], [0, 1], [0, 0], [True, False], array=Array(1, 2))
    >>> LabelledTrial(events, "ball", 0, 500).array.shape
    (1, 2)
    """

    source: Events | Frames
    label: str
    start_us: int
    stop_us: int | None = None
    group: str = ""
    name: str = "trial"

    def __post_init__(self) -> None:
        instance("source", self.source, Events, Frames)
        text("name", self.name)
        if not text("label", self.label):
            raise ProblemError(f"{self.name}: label is empty")
        text("group", self.group)
        object.__setattr__(self, "start_us", integer("start_us", self.start_us))
        if self.stop_us is not None:
            object.__setattr__(self, "stop_us", integer("stop_us", self.stop_us))
            if not self.stop_us > self.start_us:
                raise ProblemError(f"{self.name}: stop {self.stop_us} us is not after start {self.start_us} us")

    @property
    def array(self) -> Array:
        """The sensor."""
        return self.source.array


def read_trials(
    table: str | os.PathLike[str], recordings: Sequence[Recording], *, window_ms: float | None = None
) -> list[LabelledTrial]:
    """Read a table of trials: ``recording,t_us,label[,stop_us][,group][,host_ns]``; other columns are not read.

    Parameters
    ----------
    table : path
        A .csv with a header line, its columns in any order. A recording is named by its path, name or stem; with a
        single recording the column may be absent. The search for the touch begins at ``t_us``; ``host_ns`` decides if
        the recording began in mid-stream, as for `Labels`.
    recordings : sequence of Recording
        The table must name all of them, and no others.
    window_ms : float, ms, above 0, optional
        The length of trials without ``stop_us``; needed if there are such trials.

    Returns
    -------
    list of LabelledTrial, in the order of the table

    Raises
    ------
    FormatError : a column is missing, or a cell that is not a number (names file and line)
    ProblemError : recordings and table do not match, a recording is there twice or has no times, a start outside its
        recording, trials without an end, trials that overlap, or the host's time of another run
    """
    file = Path(checked_path("table", table))
    opened = _once(recordings)
    window_us = 0 if window_ms is None else _window_us(window_ms)
    by_name = _by_unique_name(opened)
    rows = _rows(file, opened)
    names = {row["recording"] for _, row in rows}
    strange = sorted(names - set(by_name))
    if strange:
        line = next(line for line, row in rows if row["recording"] == strange[0])
        alike = [str(recording.path) for recording in opened if strange[0] in (recording.name, _stem(recording))]
        if len(alike) > 1:
            raise ProblemError(
                f"{file}, line {line}: recording {strange[0]!r} may be {' or '.join(alike[:3])}; write the path"
            )
        there = sorted({recording.name for recording in opened})
        listed = ", ".join(there[:5]) + (" ..." if len(there) > 5 else "")
        raise ProblemError(
            f"{file}, line {line}: recording {strange[0]!r} is not one of the given recordings: {listed}"
        )
    unnamed = [
        recording.path for recording in opened if not {str(recording.path), recording.name, _stem(recording)} & names
    ]
    if unnamed:
        raise ProblemError(f"{file}: has no trial of {unnamed[0]}; add one, or leave the recording out")
    sources = {id(recording): _source(recording) for recording in opened}
    spans = {key: _span(source) for key, source in sources.items()}
    clocks = (
        {id(recording): recording.clock for recording in opened} if any(row.get("host_ns") for _, row in rows) else {}
    )
    trials = []
    for line, row in rows:
        recording = by_name[row["recording"]]
        source = sources[id(recording)]
        where = f"{file}, line {line}"
        times = ("stop_us", "host_ns")
        end, host_ns = (_whole(file, line, name, row[name]) if row.get(name) else None for name in times)
        start = _whole(file, line, "t_us", row["t_us"])
        span = spans[id(recording)]
        begin = by_clock(Note(row["label"], start, host_ns or 0), span[0] if span else 0)
        later = (begin.t or 0) - start - ahead_us(begin, recording.path, clocks.get(id(recording)), file)
        start, stop = start + later, None if end is None else end + later
        if stop is None and window_ms is None:
            error = placed(ProblemError("stop_us is missing, so the length of the trial is not known"), file, line=line)
            raise helped(error, "window_ms", "give")
        if not row["label"]:
            raise unreadable("label is empty", file, line=line)
        if row["label"].lower() == "nan":
            raise unreadable(
                f"label is {row['label']!r}, which tables use for a missing value; choose another name",
                file,
                line=line,
            )
        trials.append(LabelledTrial(source, row["label"], start, stop, row.get("group", ""), where))
        _inside(trials[-1], recording.name, span, window_us)
    if any(trial.group for trial in trials) and not all(trial.group for trial in trials):
        nameless = next(trial for trial in trials if not trial.group)
        raise ProblemError(f"{nameless.name}: group is empty; give a group to every trial, or to none")
    _apart(trials, window_us)
    return trials


def notes_as_trials(recordings: Sequence[Recording], *, window_ms: float) -> list[LabelledTrial]:
    """Take each note of recordings as a trial that begins at its time; its text is the label.

    Parameters
    ----------
    recordings : sequence of Recording
        Their notes were written while recording, or set in the panel; notes without the board's time are left out.
    window_ms : float, ms, above 0
        Time after the touch that counts.

    Returns
    -------
    list of LabelledTrial, in the order of time in each recording

    Raises
    ------
    ProblemError : a recording without notes or without times, or one that is there twice; an empty note, one outside
        its recording, or one inside another's window
    """
    window_us = _window_us(window_ms)
    trials = []
    for recording in _once(recordings):
        source = _source(recording)
        span = _span(source)
        notes = sorted(
            ((note.t, note.text) for note in recording.notes if note.t is not None), key=lambda note: note[0]
        )
        if not notes:
            raise ProblemError(f"{recording.path}: has no notes; leave it out, or give a table of trials")
        for start, label in notes:
            trials.append(LabelledTrial(source, label, start, name=f"{recording.path}, note at {start} us"))
            _inside(trials[-1], recording.name, span, window_us)
    _apart(trials, window_us)
    return trials


def recordings_as_trials(recordings: Sequence[Recording], *, window_ms: float | None = None) -> list[LabelledTrial]:
    """Take each recording as one trial, from its beginning; its folder's name is the label.

    Parameters
    ----------
    recordings : sequence of Recording
    window_ms : float, ms, above 0, optional
        Time after the first event that counts. Default: to the end.

    Returns
    -------
    list of LabelledTrial

    Raises
    ------
    ProblemError : a recording without anything in it or without times, or one that is there twice
    """
    if window_ms is not None:
        _window_us(window_ms)
    trials = []
    for recording in _once(recordings):
        source = _source(recording)
        span = _span(source)
        if span is None:
            raise ProblemError(f"{recording.path}: contains nothing; leave the recording out")
        start, stop = span[0], span[1] + 1
        label = recording.path.resolve().parent.name
        trials.append(
            LabelledTrial(source, label, start, None if window_ms is not None else stop, name=str(recording.path))
        )
    return trials


def _once(recordings: Sequence[Recording]) -> list[Recording]:
    """Return recordings, none of them twice: it would be trained on and tested."""
    opened = [
        instance(f"recordings[{k}]", recording, Recording)
        for k, recording in enumerate(several("recordings", recordings))
    ]
    seen: set[tuple[Path, str]] = set()
    for recording in opened:
        key = recording.path.resolve(), recording.name
        if key in seen:
            raise ProblemError(f"{recording.path}: is named twice; name it once")
        seen.add(key)
    return opened


def _source(recording: Recording) -> Events | Frames:
    refuse_numbered(recording)
    return recording.events if recording.has_events else recording.frames()


def _window_us(window_ms: float) -> int:
    if not 0 < number("window_ms", window_ms) < 1e9:
        raise refused("window_ms", f" is {shown(window_ms)}: must be above 0 and below 1e9")
    return round(to_us(window_ms))


def _span(source: Events | Frames) -> tuple[int, int] | None:
    return (int(source.t.min()), int(source.t.max())) if len(source) else None


def _inside(trial: LabelledTrial, recording: str, span: tuple[int, int] | None, window_us: int) -> None:
    """Refuse a trial outside its recording; silence before its first event may belong to a touch."""
    end = trial.start_us + window_us if trial.stop_us is None else trial.stop_us
    if span is None or trial.start_us > span[1] or end < span[0]:
        content = "contains nothing" if span is None else f"lasts from {span[0]} to {span[1]} us"
        raise ProblemError(f"{trial.name}: t_us {trial.start_us} is outside {recording}, which {content}")


def _apart(trials: list[LabelledTrial], window_us: int) -> None:
    """Refuse a trial that holds the start of another: what both hold would be trained on and tested."""
    by_source: dict[int, list[LabelledTrial]] = {}
    for trial in trials:
        by_source.setdefault(id(trial.source), []).append(trial)
    for trials_of_source in by_source.values():
        for trial, after in pairwise(sorted(trials_of_source, key=lambda trial: trial.start_us)):
            before, apart = trial.name.split(", ")[-1], after.start_us - trial.start_us
            if apart == 0:
                raise ProblemError(f"{after.name}: begins at the same time as {before}; each touch must be listed once")
            if trial.stop_us is None and apart < window_us:
                raise refused(
                    "window_ms",
                    f" is {to_ms(window_us):g}, but {after.name} begins {to_ms(apart):g} ms after {before}: the "
                    f"window must be at most {to_ms(apart):g} ms, or the trials must have stop_us",
                )
            if trial.stop_us is not None and after.start_us < trial.stop_us:
                raise ProblemError(
                    f"{after.name}: begins before {before} ends at {trial.stop_us} us; trials must not overlap"
                )


def _by_unique_name(recordings: Sequence[Recording]) -> dict[str, Recording]:
    """Return recordings by path, and by name and stem where only one has it."""
    by_name: dict[str, Recording] = {}
    for names in ([_stem(recording) for recording in recordings], [recording.name for recording in recordings]):
        count = Counter(names)
        by_name |= {name: recording for name, recording in zip(names, recordings, strict=True) if count[name] == 1}
    return by_name | {str(recording.path): recording for recording in recordings}


def _stem(recording: Recording) -> str:
    return Path(recording.name).stem


def _rows(file: Path, recordings: Sequence[Recording]) -> list[tuple[int, dict[str, str]]]:
    if file.is_dir():
        raise unreadable(f"is a directory; must be a .csv {','.join(_COLUMNS)}", file)
    table = HeaderTable.read(file, text_of(file))
    if not table.header:
        raise unreadable(f"contains nothing; must be {','.join(_COLUMNS)} ...", file)
    alone = len(recordings) == 1 and "recording" not in table.header
    only = {"recording": str(recordings[0].path)} if alone else {}
    table.has([name for name in _COLUMNS if name not in only])
    rows = []
    for line, cells in table:
        rows.append((line, only | {name: cell.strip() for name, cell in cells.items()}))
    if not rows:
        raise unreadable("names no trial", file)
    return rows


def _whole(file: Path, line: int, column: str, cell: str) -> int:
    value: int | None
    try:
        value = int(cell)
    except ValueError:
        try:
            real = float(cell)
        except ValueError:
            real = np.nan
        value = int(real) if np.isfinite(real) and real.is_integer() else None
    if value is None or not abs(value) < 2**62:
        raise unreadable(f"{column} is {shown(cell)}; must be whole {column[-2:]}", file, line=line)
    return value
