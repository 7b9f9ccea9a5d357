"""Which labelled events belong to which recordings: from a table, from notes, or given as times."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import column, mapping, several, shown
from taxel._base.errors import helped, refused
from taxel._base.messages import are, counted, warn
from taxel._base.times import beginning_us, begun
from taxel._core import ProblemError
from taxel.detect.examples import early
from taxel.detect.scoring import many
from taxel.labels import Labels, Note, beside, by_clock, by_label, trial_of
from taxel.recording import Recording, kind_of_file
from taxel.recording.cut import span_us
from taxel.spikes import to_ms, to_us

#: A table of labels, or several.
Tables: TypeAlias = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
#: "notes" (the recordings' own notes), tables, or times (us) by label, a mapping for each recording.
GivenLabels: TypeAlias = Tables | Sequence[Mapping[str, Any]]

_SIDES = {"left", "right"}
#: How long after the last event of a board a label may be, us, as people mark late; and from which distance on, the
#: window of a score, a warning names the label, as no detection can be near it.
_LATE_US, _NEAR_US = 1_000_000, 50_000


def given_labels(
    source: GivenLabels, recordings: Sequence[Recording], argument: str = "labels", shift_ms: float = 0.0
) -> tuple[list[dict[str, NDArray[np.int64]]], tuple[str, ...]]:
    """Return the labels of each recording, so much later, and the sources of which nothing is known.

    Raises
    ------
    ProblemError : no event in any recording
    """
    events = references(source, recordings, argument)
    if not any(events):
        titles = titles_of(recordings)
        if source == "notes":
            raise helped(ProblemError(f"no note of {titles} is a label"), argument, "give")
        names = table_names(source) if are_tables(source) else "given as times"
        raise refused(argument, f" is {names}: names no event in {titles}")
    for recording, of_recording in zip(recordings, events, strict=True):
        for label, times in of_recording.items():
            again = int(np.count_nonzero(np.diff(times) < _NEAR_US))
            if many(again, len(times)):
                warn(
                    f"{recording.title}: {again} of {len(times)} labels {shown(label)} are less than "
                    f"{to_ms(_NEAR_US):g} ms after another: is each listed once?"
                )
    unlabelled = sources_without(source, recordings, events)
    return [moved(each, one, shift_ms) for each, one in zip(events, recordings, strict=True)], unlabelled


def references(
    source: GivenLabels, recordings: Sequence[Recording], argument: str = "labels"
) -> list[dict[str, NDArray[np.int64]]]:
    """Return the reference events of each recording: from a table, or its own notes (a note's text is the label).

    A table names recordings by path, file name or stem; in one that it does not name nothing happened, unless the
    table also names a recording that is not there. `argument` is what errors call the source.
    """
    if not are_tables(source):
        return _mapped(source, recordings, argument)
    if source == "notes":
        noted = [_inside(_noted(recording), recording, f"the notes of {recording.title}") for recording in recordings]
        outside = next((each for each in recordings if any(note.t is not None for note in each.notes)), None)
        if outside is not None and not any(noted):
            notes = counted(sum(note.t is not None for note in outside.notes), "note")
            raise ProblemError(f"{outside.title}: has {notes}, none within {_span(outside)}")
        return noted
    table = _opened(source, recordings)
    # The sources of one file are one recording.
    count = len({(recording.path, trial_name(recording)) for recording in recordings})
    if count > 1 and any(not row.recording for row in table.rows):
        trials = f", with names like {trial_name(recordings[0])}" if are_trials(recordings) else ""
        raise refused(
            argument,
            f" is {table.path}: does not state the recording of each label, but there are {count} recordings; state it "
            f"in the column recording{trials}; the columns are {', '.join(map(shown, table._columns))}",
        )
    _check_sources(table, argument, recordings)
    named = {
        recording.title: table.named(recording.path, trial_name(recording), recording.label) for recording in recordings
    }
    unnamed = [recording for recording in recordings if named[recording.title] is None]
    known = set(named.values())
    others = [name for name in table.recordings if name not in known]
    if unnamed and (others or len(unnamed) == len(recordings)):
        names = f"it names {few(table.recordings)}" if table.rows else "it is empty"
        raise refused(argument, f" is {table.path}: names no event in {titles_of(unnamed)}; {names}")
    events = [
        _times(table, recording, recording.label, recording.side, _begin_of(recording, recordings))
        for recording in recordings
    ]
    return [_within(table, each, recording, argument) for each, recording in zip(events, recordings, strict=True)]


def _times(
    table: Labels, recording: Recording, source: str, side: str, begin_us: Callable[[], int]
) -> dict[str, NDArray[np.int64]]:
    """Return the events of a source of a recording, by its clock."""
    clock_of = partial(getattr, recording, "clock")
    return by_label(table._of(recording.path, source, trial_name(recording), side, begin_us, clock_of))


def spans(
    source: GivenLabels, recordings: Sequence[Recording], shift_ms: float = 0.0
) -> list[dict[str, NDArray[np.int64]]]:
    """Return begin and end, us, of the labels of each recording that have an end, shape (labels, 2), so much later."""
    if not are_tables(source):
        return [{} for _ in recordings]
    table = None if source == "notes" else _opened(source, recordings)
    each: list[dict[str, NDArray[np.int64]]] = []
    for recording in recordings:
        place = recording.path, recording.label, trial_name(recording), recording.side
        clock_of = partial(getattr, recording, "clock")
        rows = recording.notes if table is None else table._of(*place, _begin_of(recording, recordings), clock_of)
        lasting = [
            (row.text, row.t + round(to_us(shift_ms)), row.lasts) for row in rows if row.t is not None and row.lasts
        ]
        each.append(
            {
                label: np.array(sorted((t, t + lasts) for text, t, lasts in lasting if text == label), np.int64)
                for label in dict.fromkeys(text for text, _, _ in lasting)
            }
        )
    return each


def _begin_of(recording: Recording, recordings: Sequence[Recording]) -> Callable[[], int]:
    """Return a function that returns the first time (us) of a recording: that of all sources of its file."""
    file = recording.path, trial_name(recording)
    return lambda: min(span_us(each)[0] for each in recordings if (each.path, trial_name(each)) == file)


def moved(
    events: Mapping[str, NDArray[np.int64]], recording: Recording, shift_ms: float
) -> dict[str, NDArray[np.int64]]:
    """Return the labels of a recording so much later; those that are then outside it are left out."""
    if not shift_ms:
        return dict(events)
    first, last = span_us(recording)
    moved = {label: times + round(to_us(shift_ms)) for label, times in events.items()}
    inside = {label: times[(times >= first) & (times <= last)] for label, times in moved.items()}
    outside = sum(map(len, events.values())) - sum(map(len, inside.values()))
    if outside:
        are_outside = f"{counted(outside, 'label')} of {recording.title} {are(outside)} outside it"
        warn(f"{are_outside} when moved by {shift_ms:g} ms: left out")
    return inside


def sources_without(
    source: GivenLabels, recordings: Sequence[Recording], events: Sequence[Mapping[str, Any]]
) -> tuple[str, ...]:
    """Return the sources that no row of labels names, where rows name sources at all: nothing is known of them.

    Parameters
    ----------
    source : "notes", path or sequence of mapping
    recordings : sequence of Recording
    events : sequence of mapping of str to int64, us
        Labels of each recording, as `references` returns them.
    """
    if not are_tables(source):
        return ()
    # Notes of a file are those of all its sources; where a source has none, its reader gave notes to others alone.
    if source != "notes":
        titles = {name for each in recordings if each.label for name in (each.title, each.name)}
        if not any(row.source or row.recording in titles for row in _opened(source, recordings).rows):
            return ()
    named = {each.label for each, of_recording in zip(recordings, events, strict=True) if of_recording}
    return tuple(dict.fromkeys(each.label for each in recordings if each.label and each.label not in named))


def are_tables(source: GivenLabels) -> TypeGuard[Tables]:
    """Return whether labels are given by "notes" or by tables."""
    several_tables = isinstance(source, list | tuple) and source and isinstance(source[0], str | os.PathLike)
    return isinstance(source, str | os.PathLike) or bool(several_tables)


def table_names(source: Tables) -> str:
    """Return the names of tables in a message."""
    return few([str(source)] if isinstance(source, str | os.PathLike) else map(str, source))


def opened_tables(source: GivenLabels, recordings: Sequence[Recording]) -> Labels | None:
    """Return the tables that labels are given by as one; None of notes and times."""
    return _opened(source, recordings) if are_tables(source) and source != "notes" else None


def _opened(source: Tables, recordings: Sequence[Recording]) -> Labels:
    """Open tables of labels as one."""
    return Labels(source) if isinstance(source, str | os.PathLike) else _joined(source, recordings)


def _joined(paths: Sequence[str | os.PathLike[str]], recordings: Sequence[Recording]) -> Labels:
    """Return several tables as one; rows that name no recording are of the one that their table is named after.

    Raises
    ------
    ProblemError : rows of a table that is named after no recording
    """
    tables = [Labels(path) for path in paths]
    rows: list[Note] = []
    begins: dict[str, int] = {}
    for table in tables:
        owners = {table.named(each.path, trial_name(each), each.label): each for each in reversed(recordings)}
        namesake = next((each for each in recordings if _is_named_after(table.path, each)), None)
        for row in table.rows:
            owner = owners.get(row.recording) if row.recording else namesake
            if owner is None and not row.recording:
                raise ProblemError(
                    f"{table.path}: does not state the recording of each label; state it in the column recording, or "
                    f"name the table after its recording, for example {Path(trial_name(recordings[0])).stem}.csv"
                )
            name = _name_of(owner)
            if owner is not None and name not in begins:
                begins[name] = _begin_of(owner, recordings)()
            by_its_clock = by_clock(row, begins.get(name, 0), stated=table._from_beginning)
            rows.append(replace(by_its_clock, recording=row.recording or name))
    return tables[0]._with(Path(table_names(paths)), rows)


def _is_named_after(table: Path, recording: Recording) -> bool:
    """Return whether a table has the name of a recording, with or without what tables of labels have behind it."""
    stem = re.escape(Path(trial_name(recording)).stem)
    return re.fullmatch(rf"{stem}(_labels|_events|\.notes)?", table.stem) is not None


def _name_of(recording: Recording | None) -> str:
    """Return the name by which labels name a recording: its path, of a trial that of the trial."""
    if recording is None:
        return ""
    trial = trial_name(recording)
    return str(recording.path) if recording.path.name == trial else trial


def _tables(source: GivenLabels, recording: Path, recordings: Sequence[Recording]) -> list[Labels]:
    """Return the table of labels that a recording has, if any."""
    if not are_tables(source):
        return []
    if source != "notes":
        return [_opened(source, recordings)]
    return [_opened(beside(recording), recordings)] if beside(recording).is_file() else []


def _mapped(source: GivenLabels, recordings: Sequence[Recording], argument: str) -> list[dict[str, NDArray[np.int64]]]:
    """Return the events that are given as times by label, a mapping for each recording."""
    if isinstance(source, Mapping):
        raise refused(argument, " is one mapping: must be a list with one mapping of times by label for each recording")
    each = several(argument, source)
    if len(each) != len(recordings):
        have = counted(len(recordings), "recording")
        raise refused(argument, f" is {counted(len(each), 'mapping')}: must be one for each of {have}")
    named = [mapping(argument, times) for times in each]
    return [{label: column(f"{argument}[{label!r}]", t, np.int64) for label, t in labels.items()} for labels in named]


def trial_name(recording: Recording) -> str:
    """Return the name by which labels name a trial of a file with several."""
    return trial_of(recording.name, recording.label)


def are_trials(recordings: Sequence[Recording]) -> bool:
    """Return whether recordings are several trials of one file."""
    return len({each.path for each in recordings}) == 1 < len({trial_name(each) for each in recordings})


def titles_of(recordings: Sequence[Recording]) -> str:
    """Return the titles of the first recordings, of trials of one file as labels name them; and how many more."""
    if not are_trials(recordings):
        return few(recording.title for recording in recordings)
    return f"{few(dict.fromkeys(map(trial_name, recordings)))} of {recordings[0].path}"


def _named(table: Labels, recordings: Sequence[Recording]) -> list[tuple[set[str], set[str | None]]]:
    """Return source and side of each recording, and the names by which the table may name it."""
    trials = [(recording.path, trial_name(recording), recording.label, recording.side) for recording in recordings]
    return [
        ({label, side} - {""}, {table.named(path), table.named(path, trial, label), trial})
        for path, trial, label, side in trials
    ]


def few(names: Iterable[str]) -> str:
    """Return the first three names, and how many more there are.

    Examples
    --------
    >>> few(["a", "b", "c", "d", "e"])
    'a, b, c and 2 more'
    """
    all_names = list(names)
    return ", ".join(all_names[:3]) + f" and {len(all_names) - 3} more" * (len(all_names) > 3)


def labelled_trials(source: GivenLabels, recordings: Sequence[Recording]) -> list[Recording]:
    """Leave out trials of a file that its labels do not name, if they name another: those have no labels.

    A trial without labels would otherwise count as one in which nothing happened.
    """
    if not are_tables(source):
        return list(recordings)
    trials: dict[Path, set[str]] = {}
    for recording in recordings:
        trials.setdefault(recording.path, set()).add(trial_name(recording))
    with_labels: dict[Path, set[str]] = {}
    for path, names in trials.items():
        of_path = {row.recording for table in _tables(source, path, recordings) for row in table.rows}
        with_labels[path] = names & of_path
        if 0 < len(with_labels[path]) < len(names):
            left_out = f"{len(names) - len(with_labels[path])} of its {len(names)} trials, which have no labels"
            warn(f"{path}: left out {left_out}", stacklevel=2)
    return [each for each in recordings if not with_labels[each.path] or trial_name(each) in with_labels[each.path]]


def _check_sources(table: Labels, argument: str, recordings: Sequence[Recording]) -> None:
    """Refuse labels of a source that their recording does not have; say that those of the other side are left out."""
    names = _named(table, recordings)
    left_out = Counter[str]()
    for row in table.rows:
        sources = set[str]().union(*(each for each, names_of_each in names if row.recording in names_of_each))
        if not row.source or not sources or row.source in sources:
            continue
        if not (row.source in _SIDES and sources & _SIDES):
            there = ", ".join(sorted(sources))
            raise refused(
                argument,
                f" is {table.path}: {row.text} at {row.t} us names the source {row.source}; the recording has {there}",
            )
        left_out[row.source] += 1
    for side, count in left_out.items():
        (here,) = _SIDES - {side}
        warn(
            f"{table.path}: left out {counted(count, 'event')} of the {side}; the recording is of the {here}",
            stacklevel=3,
        )


def _noted(recording: Recording) -> dict[str, NDArray[np.int64]]:
    times: dict[str, list[int]] = {}
    for note in recording.notes:
        if note.t is not None:
            times.setdefault(note.text, []).append(note.t)
    return {label: np.sort(np.array(t, np.int64)) for label, t in times.items()}


def _within(
    table: Labels, events: dict[str, NDArray[np.int64]], recording: Recording, argument: str
) -> dict[str, NDArray[np.int64]]:
    """Return the events of a table that are within a recording; refuse a table without any."""
    if recording.clock is None and any(row.at_ns for row in table.rows):
        warn(
            f"the {kind_of_file(recording.kind)} holds no arrival times, so host_ns cannot show by how many periods of "
            f"the board's clock (6.5536 s) {table.path} is ahead of it: its times are used unchanged",
            stacklevel=2,
        )
    inside = _inside(events, recording, str(table.path))
    if any(map(len, events.values())) and not any(map(len, inside.values())):
        times = np.concatenate(list(events.values()))
        ends = " to ".join(f"{t / 1e6:.3f}" for t in np.unique([times.min(), times.max()]))
        content = f"{argument} is {table.path}: holds {counted(len(times), 'event')} ({ends} s)"
        raise ProblemError(f"{content}, none within {_span(recording)}")
    return inside


def _span(recording: Recording) -> str:
    first, last = span_us(recording)
    more = "" if recording.timed else ", whose frames are numbered (rate_hz gives them times)"
    begin = beginning_us(np.array([first]))
    if begin:
        more = (
            f"; it begins {begun(begin)}, {begin} us since 1970: labels must count from 1970, or from the recording's "
            "beginning"
        )
    return f"{recording.title} ({(first - begin) / 1e6:.3f} to {(last - begin) / 1e6:.3f} s){more}"


def _inside(events: Mapping[str, NDArray[np.int64]], recording: Recording, where: str) -> dict[str, NDArray[np.int64]]:
    """Return the events within a recording; report which are left out, and which may be outside it.

    A frame holds until the next one would come. A board sends nothing where nothing changes, so that the end of its
    recording may be after its last event: an event soon after that counts, and is named.
    """
    total = sum(map(len, events.values()))
    if not total:
        return dict(events)
    first, last = span_us(recording)
    if recording.has_events:
        board_events, interval = recording.events, recording.interval
        seen = [last, *(t for t, _ in board_events.markers), *(() if interval is None else interval[1:])]
        # A heartbeat or a frame without events is a sign of life, too.
        end = max(seen if recording.clock is None else [*seen, *recording.clock.board_us[-1:].tolist()])
        near_us, late_us = _NEAR_US, _LATE_US
    else:
        frames = recording.frames().t
        end = last + (int(np.median(np.diff(frames))) if len(frames) > 1 else 0)
        near_us, late_us = 0, 0
    inside = {label: t[(t >= first) & (t <= end + late_us)] for label, t in events.items()}
    if where_early := early(inside, first, last):
        warn(f"the {total} events of {where} {where_early}", stacklevel=2)
    behind = sorted((int(time), label) for label, t in inside.items() for time in t[t > end + near_us])
    if behind:
        (at, label), begin = behind[0], beginning_us(np.array([first]))
        warn(
            f"{len(behind)} of the {total} events of {where} {are(len(behind))} later than the last recorded event, at "
            f"{(end - begin) / 1e6:.3f} s ({label} at {(at - begin) / 1e6:.3f} s): these labels are scored, and "
            "missed if the recording stopped before them",
            stacklevel=2,
        )
    outside = total - sum(map(len, inside.values()))
    if outside:
        warn(f"{outside} of the {total} events of {where} left out: outside {_span(recording)}", stacklevel=2)
    return {label: t for label, t in inside.items() if len(t) or not len(events[label])}
