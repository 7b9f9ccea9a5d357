"""Sidecar files of a recording: labels that people set, and a calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from taxel._base.times import SINCE_1970_US
from taxel._core import ProblemError
from taxel.calibration import Calibration
from taxel.labels import Labels, Note, beside, trial_of
from taxel.recording.contents import BoardSource, Contents, FrameSource, RecordedSource, Stream, alone, share_clock
from taxel.recording.frames import calibrate
from taxel.recording.once import Once, known
from taxel.recording.recording import Recording
from taxel.recording.sections import Wire


def with_sidecars(contents: Contents) -> Contents:
    """Return the contents of a file with the labels of `NAME.notes.csv` and the calibration in its folder."""
    # Labels are by the clock of the file's first source, or of all.
    sources = contents.sources
    labelled = sources if share_clock(sources) else dict(list(sources.items())[:1])
    of_labels = {name: list(labelled.values()) if name in labelled else [] for name in sources}
    return alone({name: _with_sidecars(source, of_labels[name]) for name, source in sources.items()})


def _with_sidecars(source: RecordedSource, of_labels: Sequence[RecordedSource]) -> RecordedSource:
    """Return a source with its sidecars; labels by the clock of `of_labels`, or none."""
    path, marks = source.origin.path, source.marks
    if of_labels and path.exists() and beside(path).is_file():
        marks = replace(marks, notes=Once(lambda: _notes(source, of_labels)))
    return replace(source, sensor=replace(source.sensor, calibration=calibration_beside(path, source)), marks=marks)


def begin_of(sources: Iterable[RecordedSource], labels: Labels) -> Callable[[], int]:
    """Return a function that reads from which time (us) a table of labels may count; 0 where it cannot.

    It is the first time of the sources. A board's own clock does not count from 1970, and reading its events may take
    long.
    """

    def first(source: RecordedSource) -> list[int]:
        wire = source.section(Wire)
        is_own = isinstance(source, BoardSource) and wire.datagrams.holds() and wire.origin_us < SINCE_1970_US
        if is_own and not labels._from_beginning:
            return [0]
        t = source.table.t
        return [int(t.min())] if len(t) else []

    return lambda: min((t for source in sources if not isinstance(source, Stream) for t in first(source)), default=0)


def _notes(source: RecordedSource, sources: Sequence[RecordedSource]) -> tuple[Note, ...]:
    """Return the notes of a recording, and the labels that people set on it: of its trial and source, and those of all.

    Notes can be used as labels: one that a label replaces is left out, and a label that says the same at the same time
    is that note.
    """
    labels = Labels(beside(source.origin.path))
    names, begin_us = labels_of(source), begin_of(sources, labels)
    replaced = labels._replaced(*names, begin_us)
    notes = tuple(note for note in source.marks.notes() if note.t is None or note.t not in replaced)
    noted = {(note.text, note.t) for note in notes}
    rows = labels._rows(*names, begin_us)
    more = sorted((row for row in rows if (row.text, row.t) not in noted), key=lambda row: row.t or 0)
    return notes + tuple(Note(row.text, row.t, row.at_ns, source=row.source) for row in more)


def labels_of(source: RecordedSource) -> tuple[Path, str, str, str]:
    """Return what names the labels of a source in a table of labels beside its file."""
    origin = source.origin
    return origin.path, origin.label, trial_of(origin.name, origin.label), source.sensor.side


def calibration_beside(path: Path, source: RecordedSource) -> Once[Calibration | None]:
    """Return the calibration beside a file (`Calibration.beside`); None if there is none.

    Reading it raises a FormatError if it cannot be read, and a ProblemError if it is of another array than the
    recording, or of readings in another unit.
    """

    def read() -> Calibration | None:
        file = Calibration.beside(path)
        return None if file is None else _fitting(file, source)

    return Once(read, lambda: Calibration.beside(path) is not None)


def calibrate_by(recording: Recording, path: Path) -> Recording:
    """Return a recording, or each sensor of one with several, as frames in N or kPa by a calibration file.

    Raises
    ------
    FormatError : it cannot be read
    ProblemError : it is of another array than the recording, or of readings in another unit
    """

    def with_calibration(source: RecordedSource) -> RecordedSource:
        if isinstance(source, Stream):
            return source
        calibration: Once[Calibration | None] = known(_fitting(path, source))
        return calibrate(replace(source, sensor=replace(source.sensor, calibration=calibration)))

    sources = recording._contents.sources
    return Recording(alone({name: with_calibration(source) for name, source in sources.items()}))


def _fitting(path: Path, source: RecordedSource) -> Calibration:
    """Return a calibration; refuse one of another array or of readings in another unit."""
    calibration = Calibration.load(path)
    unit = source.table.unit if isinstance(source, FrameSource) else "ticks"
    if not calibration.array.fits(source.sensor.array) or calibration.reading_unit != unit:
        raise ProblemError(
            f"{path}: the calibration is for {calibration.reading_unit} of {calibration.array!r}; "
            f"{source.origin.name} contains {unit} of {source.sensor.array!r}"
        )
    return calibration
