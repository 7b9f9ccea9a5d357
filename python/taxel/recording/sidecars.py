"""Sidecar files of a recording: labels that people set, and a calibration."""

from __future__ import annotations

from pathlib import Path

from taxel._core import ProblemError
from taxel.calibration import Calibration
from taxel.labels import Labels, Note, beside
from taxel.recording.contents import Contents, alone, once, together

__all__ = ["calibration_beside", "has_calibration", "with_sidecars"]


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
    if labelled and of.path.is_file() and beside(of.path).is_file():
        changed["notes"] = once(lambda: of.notes + _labels(of))
    calibration = once(lambda: calibration_beside(of.path, of), lambda: has_calibration(of.path))
    return of.but(calibration=calibration, **changed)


def _labels(of: Contents) -> tuple[Note, ...]:
    """Return the labels that people set on a finished recording: those of its source, and those of all."""
    labels = Labels(beside(of.path))
    name = labels.named(of.path)
    chosen = (row for row in labels.rows if row.recording == name and row.source in ("", of.label))
    return tuple(Note(row.text, row.t, row.at_ns) for row in sorted(chosen, key=lambda row: row.t or 0))


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
    read = "ticks" if of.frames is None else of.frames.unit
    if not calibration.array.fits(of.array) or calibration.of != read:
        raise ProblemError(
            f"{place}: turns {calibration.of} of {calibration.array!r} into {calibration.unit}; {of.name} holds {read} "
            f"of {of.array!r}, another array"
        )
    return calibration
