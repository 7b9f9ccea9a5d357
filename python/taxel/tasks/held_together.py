"""Which recordings are held out together: those of one person, object or sensor, by a column of a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from taxel._base.errors import refused
from taxel._base.header_table import HeaderTable, text_of
from taxel._base.messages import warn
from taxel._core import ProblemError
from taxel.recording import Recording
from taxel.tasks.labels import GivenLabels, few, opened_tables, trial_name

#: The first of these columns that is there is taken where none is named.
_USUAL = ("person", "group")
#: A table of recordings beside them, with the column recording.
_BESIDE = "recordings.csv"


def held_together(
    source: GivenLabels, recordings: Sequence[Recording], column: str | None = None
) -> tuple[str, list[str]]:
    """Return the column that says what recordings are of, and its value for each; "" where there is none.

    Parameters
    ----------
    source : "notes", tables, or times by label
        The column is of these tables of labels, or of ``recordings.csv`` beside a recording.
    recordings : sequence of Recording
        Sources of one recording, as two feet, have the same value.
    column : str, optional
        Default: person where there is one, else group, where it names two or more.

    Raises
    ------
    ProblemError : no such column; a recording without a value, or with two; fewer than two values
    """
    cells: dict[str, list[Mapping[str, str]]] = {}
    for recording in recordings:
        cells.setdefault(_walk(recording), []).extend(_rows(source, recordings, recording))
    there = {name for rows in cells.values() for row in rows for name in row}
    name = next((name for name in ((column,) if column else _USUAL) if name in there), "")
    if column and not name:
        columns = few(sorted(there - {"recording"})) or "none"
        raise refused(
            "hold_out", f" is {column!r}: no column of the labels or of {_BESIDE} beside; there are: {columns}"
        )
    if not name:
        return "", [""] * len(recordings)
    found = {walk: {row[name].strip() for row in rows if name in row} - {""} for walk, rows in cells.items()}
    if several := next((walk for walk, values in found.items() if len(values) > 1), None):
        text = f"{several}: {name} is {few(sorted(found[several]))}: must be one for each recording"
        if column:
            raise ProblemError(text)
        warn(f"{text}; whole recordings are held out")
        return "", [""] * len(recordings)
    known = set[str]().union(*found.values())
    if lacking := [walk for walk, values in found.items() if known and not values]:
        raise ProblemError(f"{lacking[0]}: {name} is empty; give it to every recording, or to none")
    if len(known) < 2:
        if column:
            raise refused("hold_out", f" is {name!r}: names {few(known) or 'none'}; must name two or more")
        return "", [""] * len(recordings)
    return name, [next(iter(found[_walk(recording)])) for recording in recordings]


def _walk(recording: Recording) -> str:
    """Return the name of what a recording is a source of."""
    return recording.title.removesuffix(recording.label)


def _rows(source: GivenLabels, recordings: Sequence[Recording], recording: Recording) -> Iterator[Mapping[str, str]]:
    """Yield the cells of the rows about a recording."""
    trial = trial_name(recording)
    if (table := opened_tables(source, recordings)) is not None:
        # Times do not matter.
        about = table._rows(recording.path, recording.label, trial, recording.side, lambda: 0)
        yield from (dict(row.others) for row in about)
    beside = recording.path.parent / _BESIDE
    if beside.is_file():
        listed = HeaderTable.read(beside, text_of(beside))
        listed.has(["recording"])
        names = {trial, recording.path.name, recording.path.stem, recording.path.name.split(".")[0]}
        yield from (row for _, row in listed if row["recording"].strip() in names)
