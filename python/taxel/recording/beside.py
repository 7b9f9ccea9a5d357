"""Files beside a recording: the tables of labels that people and other programs wrote."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from taxel._base.files import beside as beside_file
from taxel._base.files import named
from taxel._base.times import SINCE_1970_US
from taxel._event_table import are_of_events, is_of_track
from taxel.labels import Labels, Note, ahead_us, beside, trial_of
from taxel.recording.files.csv import first_line_of, names_in
from taxel.recording.recording import Recording
from taxel.recording.source import SourceView, share_clock

#: The table of labels of a folder.
LABELS = "labels.csv"
#: What follows the name of a recording in the names of its tables of labels that other programs write.
TABLES = ("_labels.csv", "_events.csv", "_events.tsv", ".txt")


def labels_for(
    recording: Recording, name: Path, of_folder: Labels | None = None, *, is_alone: bool = False
) -> Recording:
    """Return a recording with the labels of the tables beside it among its notes.

    The tables are ``labels.csv`` of its folder, ``NAME_labels.csv``, ``NAME_events.csv``, ``NAME_events.tsv``, a label
    track ``NAME.txt``, and ``NAME.notes.csv``, whose rows may replace others.

    Parameters
    ----------
    recording : Recording
    name : Path
        What tables may call it: its path in the folder.
    of_folder : Labels, optional
        The table of its folder, if that is opened as a whole; default: that beside it, if it is of frames.
    is_alone : bool
        Whether it is the only one of its folder, so that rows that name no recording are its own.
    """
    sources, path = recording._sources, recording.path
    place = path.parent / trial_of(recording.name, recording.label)
    folder = path.parent / LABELS
    are_frames = not any(source.facts.has_events for source in sources.values())
    if of_folder is None and are_frames and folder.is_file() and is_label_table(folder):
        of_folder = Labels(folder)
    tables: list[Labels | Path] = [*([] if of_folder is None else [of_folder]), *map(Labels, label_tables(place))]
    # People set labels by the clock of the first source, or of all.
    are_alike, set_here = share_clock(sources), path.exists() and beside(path).is_file()
    labelled = {}
    for k, (label, source) in enumerate(sources.items()):
        own = [*tables] * (not source.facts.columns)
        # People may still change theirs: it is read when notes are asked for.
        own += [beside(path)] * (set_here and (are_alike or not k))
        add = partial(_labelled, source, name, sources, own, is_alone)
        labelled[label] = source.labelled(add) if own else source
    return Recording(labelled)


def _labelled(
    source: SourceView,
    name: Path,
    sources: Mapping[str, SourceView],
    tables: list[Labels | Path],
    is_alone: bool,
    notes: tuple[Note, ...],
) -> tuple[Note, ...]:
    """Return the notes of a source and the labels that tables have for it, without those that others replace."""
    facts, labelled = source.facts, list[Note]()
    names = facts.label, trial_of(facts.name, facts.label), facts.side
    for table in tables:
        labels = table if isinstance(table, Labels) else Labels(table)
        begin_us, is_of_folder = _begin_of(sources, labels), labels.path.name == LABELS
        recording = name if is_of_folder else facts.path
        if is_of_folder and not is_alone and labels.named(recording, names[1], names[0]) in (None, ""):
            continue
        replaced = labels._replaced(recording, *names, begin_us)
        notes = tuple(note for note in notes if note.t is None or note.t not in replaced)
        labelled = [note for note in labelled if note.t not in replaced]
        there = {(note.text, note.t) for note in (*notes, *labelled)}
        rows = (_by_run(row, source, labels) for row in labels._rows(recording, *names, begin_us))
        new = dict.fromkeys(row for row in rows if (row.text, row.t) not in there)
        labelled += [Note(row.text, row.t, row.at_ns, source=row.source) for row in new]
    return notes + tuple(sorted(labelled, key=lambda note: note.t or 0))


def _by_run(row: Note, source: SourceView, labels: Labels) -> Note:
    """Return a row with its time by the clock of this run of the board, which the host's time of the row tells."""
    if not row.at_ns or labels.path == beside(source.facts.path):
        return row
    return replace(row, t=(row.t or 0) - ahead_us(row, source.facts.path, source.clock, labels.path))


def _begin_of(sources: Mapping[str, SourceView], labels: Labels) -> Callable[[], int]:
    """Return a function that reads from which time (us) a table of labels may count; 0 where it cannot.

    It is the first time of the sensors. Where a clock does not count from 1970, the table is not read for it.
    """

    def first(source: SourceView) -> list[int]:
        about = source.facts.begins_us
        if about is not None and about < SINCE_1970_US and not labels._from_beginning:
            return [0]
        t = source.table.t
        return [int(t.min())] if len(t) else []

    sensors = [source for source in sources.values() if not source.facts.columns]
    return lambda: min((t for source in sensors for t in first(source)), default=0)


def is_label_table(path: Path) -> bool:
    """Return whether a text is a table of labels (`taxel.Labels`): by its first lines, or empty by its name."""
    if (first := first_line_of(path)) is None:
        return False
    (names, _), is_named = names_in(first), path.name.endswith(TABLES[:-1])
    if {"label", "t_us"} <= set(names) or is_of_track(first):
        return True
    is_empty = names == [""] and (is_named or path.name == LABELS or path.name.endswith(".notes.csv"))
    return is_empty or are_of_events(names, named=is_named)


def label_tables(recording: Path) -> list[Path]:
    """Return the tables of labels that other programs wrote beside a recording, by its name: `walk_events.csv` ..."""
    tables = [beside_file(recording, f"{named(recording).stem}{ending}") for ending in TABLES]
    return [table for table in tables if table != recording and table.is_file() and is_label_table(table)]
