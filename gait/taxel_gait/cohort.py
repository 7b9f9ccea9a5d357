"""Recordings of people: a folder with ``people.csv``, a folder of recordings, or single recordings.

``people.csv`` has a column `person`, and may have `recording` (a pattern of names, such as ``GaCo02_*``), `weight_kg`
and any others; without `recording`, a person's recordings begin with the person's name, or are in a folder of it.
``recordings.csv`` has `recording` and `person`, and may have `condition`, `foot` (left or right) and `walk`: two rows
of one walk are its left and its right foot.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

from taxel import FormatError, ProblemError
from taxel.recording.kinds import FOREIGN, is_folder, kind_of, natural_order, recordings_in

__all__ = ["PEOPLE", "RECORDINGS", "Cohort", "Entry"]

PEOPLE, RECORDINGS = "people.csv", "recordings.csv"
#: What every table of results begins with.
RESULT = b"# taxel "


@dataclass(frozen=True)
class Entry:
    """Name a recording, or those of both feet of one walk, and whose they are.

    Parameters
    ----------
    name : str
        Its path in the cohort, without endings: "GaCo02_01", "anna/fast".
    paths : tuple of Path
        One, or the left and the right foot's.
    person, condition, side : str
        "" where nothing is said.
    weight_kg : float, kg, optional
    """

    name: str
    paths: tuple[Path, ...]
    person: str
    condition: str = ""
    side: str = ""
    weight_kg: float | None = None


@dataclass(frozen=True)
class Cohort:
    """Hold the recordings of people, and what was left out.

    Parameters
    ----------
    place : Path
        Its folder, or the first recording.
    entries : tuple of Entry
    left_out : dict from str to str
        Why a recording, a person or a row of a table has no entry.
    """

    place: Path
    entries: tuple[Entry, ...]
    left_out: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, paths: Sequence[Path], layout: Path | None = None) -> Cohort:
        """Return the recordings that paths name.

        Parameters
        ----------
        paths : sequence of Path
            A folder; a recording; or the recordings of the left and of the right foot of one walk.
        layout : Path, optional
            A layout file for all.

        Raises
        ------
        ProblemError : more than two files, or a folder beside another path
        FormatError : a table that is none, or a folder without a recording (names the place)
        OSError : a path that is not there
        """
        for path in paths:
            path.stat()
        if len(paths) == 1 and is_folder(paths[0]):
            return _of_folder(paths[0], layout)
        if not 1 <= len(paths) <= 2 or any(is_folder(path) for path in paths):
            raise ProblemError(
                "must be one folder, one recording, or the left and the right foot's recording of one walk"
            )
        name = " + ".join(map(_stem, paths))
        return cls(paths[0], (Entry(name, tuple(paths), name),))


def _of_folder(folder: Path, layout: Path | None) -> Cohort:
    people = _table(folder / PEOPLE, ("person",))
    listed = _table(folder / RECORDINGS, ("recording", "person"))
    files = _files(folder, layout)
    if not files and not listed:
        raise FormatError(f"{folder}: contains no recording, and none of its folders does")
    names = {_name(folder, file): file for file in files}
    if not people and not listed:
        # Each recording is of a person of its own where nothing else is said; a folder is one person's.
        entries = [Entry(name, (file,), name.rpartition("/")[0] or name) for name, file in names.items()]
        return Cohort(folder, tuple(entries))
    weights = {row["person"]: _weight(folder, row) for row in people}
    left_out, entries = dict[str, str](), []
    if listed:
        walks: dict[str, list[Entry]] = {}
        for row in listed:
            files_of = _named(row["recording"], names)
            # A table of another program, which counts in a folder of tables alone.
            if not files_of and (other := folder / row["recording"]).is_file():
                files_of = [_name(folder, other)]
                names |= {files_of[0]: other}
            if people and row["person"] not in weights:
                raise FormatError(f"{folder / RECORDINGS}: {row['person']} is not a person of {PEOPLE}")
            if not files_of:
                left_out[row["recording"]] = f"{RECORDINGS} names it, and it is not in {folder}"
            for name in files_of:
                about = row.get("condition", ""), row.get("foot", "").lower()
                entry = Entry(name, (names[name],), row["person"], *about, weights.get(row["person"]))
                walks.setdefault(row.get("walk") or name, []).append(entry)
        entries += [_walk(folder / RECORDINGS, walk, own) for walk, own in walks.items()]
    else:
        for row in people:
            own = [name for name in names if _is_of(name, row)]
            if not own:
                left_out[row["person"]] = f"{PEOPLE} names this person, and no recording in {folder} is theirs"
            entries += [Entry(name, (names[name],), row["person"], weight_kg=weights[row["person"]]) for name in own]
    taken = {_name(folder, path) for entry in entries for path in entry.paths}
    table = RECORDINGS if listed else PEOPLE
    left_out |= {name: f"no row of {table} is of this recording" for name in names if name not in taken}
    if not entries:
        raise FormatError(f"{folder}: no row of {table} names a recording that is there: {_some(names)}")
    return Cohort(folder, tuple(entries), left_out)


def _walk(table: Path, name: str, rows: Sequence[Entry]) -> Entry:
    """Return the entry of the rows of a walk: of one recording, or of those of the left and the right foot."""
    if len(rows) == 1:
        return rows[0]
    by_foot = {row.side: row for row in rows}
    if len(rows) != 2 or {*by_foot} != {"left", "right"} or len({(row.person, row.condition) for row in rows}) > 1:
        raise FormatError(f"{table}: walk {name} must be two rows of one person and condition, foot left and right")
    left, right = by_foot["left"], by_foot["right"]
    return replace(left, name=name, paths=(*left.paths, *right.paths), side="")


def _files(folder: Path, layout: Path | None) -> list[Path]:
    """Return the recordings in a folder, and in its folders."""
    deeper = [one for one in sorted(folder.iterdir(), key=natural_order) if is_folder(one)]
    found = list[Path]()
    for place in (folder, *deeper):
        own = recordings_in(place, layout)
        # Beside taxel's own files those of makers are recordings too.
        found += own + [
            file for file in sorted(place.iterdir(), key=natural_order) if file not in own and _is_maker(file)
        ]
    return [file for file in found if file.name not in (PEOPLE, RECORDINGS) and not _is_result(file)]


def _is_maker(file: Path) -> bool:
    """Return whether a file is one of a maker, or of a published data set."""
    return file.is_file() and kind_of(file) not in (None, "ros", *FOREIGN)


def _is_result(file: Path) -> bool:
    """Return whether a file is a table that an earlier run wrote."""
    if file.suffix != ".csv" or not file.is_file():
        return False
    with file.open("rb") as opened:
        return opened.read(len(RESULT)) == RESULT


def _name(folder: Path, file: Path) -> str:
    return file.relative_to(folder).with_name(_stem(file)).as_posix()


def _stem(file: Path) -> str:
    return Path(file.name.removesuffix(".gz")).stem


def _named(recording: str, names: Mapping[str, Path]) -> list[str]:
    """Return the recordings that a cell names: a path in the cohort with or without its ending, or a pattern."""
    return [
        name
        for name, file in names.items()
        if recording in (name, file.name, f"{file.parent.name}/{file.name}") or fnmatchcase(name, recording)
    ]


def _is_of(name: str, row: Mapping[str, str]) -> bool:
    """Return whether a recording is a person's."""
    person, pattern = row["person"], row.get("recording", "")
    if pattern:
        return fnmatchcase(name, pattern) or fnmatchcase(name.rpartition("/")[2], pattern)
    folder, _, own = name.rpartition("/")
    return folder == person or (own.startswith(person) and not own[len(person) : len(person) + 1].isalnum())


def _weight(folder: Path, row: Mapping[str, str]) -> float | None:
    cell = row.get("weight_kg", "").replace(",", ".")
    try:
        weight = float(cell) if cell else None
    except ValueError:
        weight = -1.0
    if weight is not None and not 0 < weight < 1000:
        raise FormatError(f"{folder / PEOPLE}: weight_kg of {row['person']} is {cell}: must be kg, or empty")
    return weight


def _table(path: Path, wanted: Iterable[str]) -> list[dict[str, str]]:
    """Return the rows of a table with names, of commas or semicolons; none where there is no file."""
    if not path.exists():
        return []
    try:
        lines = path.read_text("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        lines = path.read_text("windows-1252").splitlines()
    separator = ";" if ";" in next(iter(lines), "") else ","
    rows = [
        {name.strip(): (cell or "").strip() for name, cell in row.items() if isinstance(name, str) and cell is not None}
        for row in csv.DictReader(lines, delimiter=separator)
    ]
    for k, row in enumerate(rows, 2):
        if missing := [name for name in wanted if not row.get(name)]:
            raise FormatError(f"{path}, line {k}: has no {missing[0]}; must have {' and '.join(wanted)}")
    if not rows:
        raise FormatError(f"{path}: has no rows; must have columns {', '.join(wanted)}, and a row for each")
    return rows


def _some(names: Iterable[str]) -> str:
    some = list(names)
    return ", ".join(some[:3]) + " ..." * (len(some) > 3)
