"""Trials: labelled stretches of recordings, with their groups."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from taxel._base.arguments import instance, integer, number, several, shown, text
from taxel._base.errors import helped, refused, unreadable
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Labels, ahead_us, by_clock, trial_of
from taxel.recorded import refuse_numbered
from taxel.recording import Recording
from taxel.spikes import to_ms, to_us

__all__ = ["LabelledTrial", "notes_as_trials", "read_trials", "recordings_as_trials"]


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
    """Read a table of trials: that of `Labels` with the columns ``stop_us`` (us) and ``group``, which may be absent.

    Parameters
    ----------
    table : path
        The search for the touch begins at ``t_us``; ``host_ns`` decides if the recording began in mid-stream, as for
        `Labels`.
    recordings : sequence of Recording
        The table must name all of them, and no others.
    window_ms : float, ms, above 0, optional
        The length of trials without ``stop_us``; needed if there are such trials.

    Returns
    -------
    list of LabelledTrial, in the order of the table

    Raises
    ------
    FormatError : as `Labels`
    ProblemError : recordings and table do not match, a recording is there twice or has no times, a start outside its
        recording, trials without an end, trials that overlap, or the host's time of another run
    """
    labels = Labels(table)
    opened = _once(recordings)
    window_us = 0 if window_ms is None else _window_us(window_ms)
    if not labels.rows:
        raise unreadable("names no trial", labels.path)
    owners = _owners(labels, opened)
    sources = {name: _source(recording) for name, recording in owners.items()}
    spans = {name: _span(source) for name, source in sources.items()}
    host_ns = any(row.at_ns for row in labels.rows)
    clocks = {name: recording.clock if host_ns else None for name, recording in owners.items()}
    trials = []
    for row in labels.rows:
        name, others = row.recording, dict(row.others)
        trial, span = f"{labels.path}, {row.text} at {row.t} us", spans[name]
        begin = by_clock(row, span[0] if span else 0, stated=labels._from_beginning)
        later = (begin.t or 0) - (row.t or 0) - ahead_us(begin, owners[name].path, clocks[name], labels.path)
        end = others.get("stop_us", "").strip()
        if not end and window_ms is None:
            raise helped(
                ProblemError(f"{trial}: stop_us is missing, so the length of the trial is not known"),
                "window_ms",
                "give",
            )
        if end and not end.removeprefix("-").isdecimal():
            raise ProblemError(f"{trial}: stop_us is {shown(end)}; must be whole us")
        stop = int(end) + later if end else None
        group = others.get("group", "").strip()
        trials.append(LabelledTrial(sources[name], row.text, (row.t or 0) + later, stop, group, trial))
        _inside(trials[-1], owners[name].name, span, window_us)
    if any(trial.group for trial in trials) and not all(trial.group for trial in trials):
        nameless = next(trial for trial in trials if not trial.group)
        raise ProblemError(f"{nameless.name}: group is empty; give a group to every trial, or to none")
    _apart(trials, window_us)
    return trials


def _owners(labels: Labels, recordings: Sequence[Recording]) -> dict[str, Recording]:
    """Return the recordings by the names that a table has for them."""
    named = [labels.named(each.path, trial_of(each.name, each.label), each.label) for each in recordings]
    strange = next((row.recording for row in labels.rows if row.recording not in named), None)
    if strange is not None:
        there = ", ".join(sorted(recording.name for recording in recordings)[:5])
        raise ProblemError(f"{labels.path}: recording {strange!r} is not one of the given recordings: {there}")
    owners: dict[str, Recording] = {}
    for name, recording in zip(named, recordings, strict=True):
        if name is None:
            raise ProblemError(f"{labels.path}: has no trial of {recording.path}; add one, or leave the recording out")
        if name in owners:
            several_of = f"recording {name!r} may be {owners[name].path} or {recording.path}"
            what = several_of if name else "does not state the recording of each trial"
            raise ProblemError(f"{labels.path}: {what}; write its path in the column recording")
        owners[name] = recording
    return owners


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
