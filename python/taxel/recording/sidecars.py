"""Sidecar files of a recording: labels that people set, and a calibration."""

from __future__ import annotations

from pathlib import Path

from taxel._core import ProblemError
from taxel.calibration import Calibration
from taxel.labels import Labels, Note, beside, trial_of
from taxel.recording.contents import Contents, alone, once, together
from taxel.recording.pictures import calibrated

__all__ = ["calibrated_by", "calibration_beside", "has_calibration", "with_sidecars"]


def with_sidecars(of: Contents) -> Contents:
    """Return the contents of a file with the labels of `NAME.notes.csv` and the calibration in its folder."""
    sources: dict[str, Contents] = {}
    every = of.sources or {of.label: of}
    one_clock = together(every)
    for name, one in every.items():
        # Labels are by the clock of the file's first source, or of all.
        sources[name] = _of_one(one, labelled=one_clock or not sources)
    if not of.sources:
        return sources[of.label]
    for name, one in sources.items():
        sources[name] = one.but(sources=sources)
    return alone(sources)


def _of_one(of: Contents, *, labelled: bool) -> Contents:
    changed = {}
    if labelled and of.path.exists() and beside(of.path).is_file():
        changed["notes"] = once(lambda: _notes(of))
    calibration = once(lambda: calibration_beside(of.path, of), lambda: has_calibration(of.path))
    return of.but(calibration=calibration, **changed)


def _notes(of: Contents) -> tuple[Note, ...]:
    """Return the notes of a recording, and the labels that people set on it: of its trial and source, and those of all.

    Notes can be used as labels: one that a label replaces is left out, and a label that says the same at the same time
    is that note.
    """
    labels, which = Labels(beside(of.path)), (of.path, of.label, trial_of(of.name, of.label))
    replaced = labels._replaced(*which)
    own = tuple(note for note in of.notes if note.t is None or note.t not in replaced)
    noted = {(note.text, note.t) for note in own}
    more = sorted((row for row in labels._rows(*which) if (row.text, row.t) not in noted), key=lambda row: row.t or 0)
    return own + tuple(Note(row.text, row.t, row.at_ns) for row in more)


def has_calibration(path: Path) -> bool:
    """Return whether a calibration file lies beside a file."""
    return Calibration.beside(path) is not None


def calibration_beside(path: Path, of: Contents) -> Calibration | None:
    """Return the calibration beside a file (`Calibration.beside`); None if there is none.

    Raises
    ------
    FormatError : it cannot be read
    ProblemError : it is of another array than the recording, or of readings in another unit
    """
    place = Calibration.beside(path)
    if place is None:
        return None
    calibration = Calibration.load(place)
    _check(calibration, place, of)
    return calibration


def calibrated_by(of: Contents, place: Path) -> Contents:
    """Return a recording, or each sensor of one with several, as pictures in N or kPa by a calibration file.

    Raises
    ------
    FormatError : it cannot be read
    ProblemError : it is of another array than the recording, or of readings in another unit
    """
    calibration = Calibration.load(place)
    sources: dict[str, Contents] = {}
    for name, one in (of.sources or {of.label: of}).items():
        sources[name] = one
        if one.columns is None:
            _check(calibration, place, one)
            sources[name] = calibrated(one.but(calibration=calibration, sources={}))
    if not of.sources:
        return sources[of.label]
    for name, one in sources.items():
        sources[name] = one.but(sources=sources)
    return alone(sources)


def _check(calibration: Calibration, place: Path, of: Contents) -> None:
    """Refuse a calibration of another array or of readings in another unit."""
    read = "ticks" if of.frames is None else of.frames.unit
    if not calibration.array.fits(of.array) or calibration.of != read:
        raise ProblemError(
            f"{place}: turns {calibration.of} of {calibration.array!r} into {calibration.unit}; {of.name} holds {read} "
            f"of {of.array!r}, another array"
        )
