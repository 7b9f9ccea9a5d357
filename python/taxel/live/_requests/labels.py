"""Requests about the tables of labels beside recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from taxel.labels import Note
from taxel.live._label_join import Conflict, Edit
from taxel.live._label_table import LabelTables, TableRead
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening

#: A label, its time (us), source and trial ("": all), the time of the note that it replaces, and that by the host (ns);
#: "" removes that note.
_LabelRow = tuple[str, int, str, str, int | None, int | None]

#: Labels that were acknowledged and are missing in a table, that were deleted and returned, and other new ones.
_LabelConflict = tuple[list[_LabelRow], list[_LabelRow], list[_LabelRow]]

#: The labels of a table, and its conflict.
_LabelTable = tuple[list[_LabelRow], _LabelConflict]


def _own_names(recording: str) -> frozenset[str]:
    """Return the names that a table beside a recording may have for it: none, its file name, and its stem."""
    return frozenset({"", recording, Path(recording).stem})


def _to_note(row: _LabelRow, unit_us: float) -> Note:
    label, t, source, trial, replaces, host_ns = row
    replaced = None if replaces is None else round(replaces / unit_us)
    return Note(label.strip(), round(t / unit_us), host_ns or 0, trial, source, replaced)


def _to_row(note: Note, unit_us: float) -> _LabelRow:
    replaced = None if note.replaces is None else round(note.replaces * unit_us)
    t = round((note.t or 0) * unit_us)
    return note.text, t, note.source, note.recording, replaced, note.at_ns or None


class LabelRequests:
    """Read and change tables of labels.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    """

    def __init__(self, opening: Opening) -> None:
        self._opening, self._labels = opening, LabelTables()

    def close(self) -> None:
        """Close the tables."""
        self._labels.close()

    def stamp(self, table: Path) -> str:
        """Return a text that changes when a table of labels, or what was acknowledged of it, may have changed."""
        with reasons():
            return self._labels.stamp(table)

    def read(self, table: Path, recording: str) -> _LabelTable:
        """Return the labels of a recording from a table, and where the table lacks what was acknowledged."""
        with reasons():
            return self._shown(table, self._labels.read(table, _own_names(recording)))

    def change(
        self, table: Path, recording: str, requests: Sequence[Sequence[tuple[_LabelRow | None, _LabelRow | None]]]
    ) -> tuple[list[str | list[_LabelRow | None]], _LabelTable]:
        """Carry out requests in one write of a table as it is now, and return when it is on the disk.

        Parameters
        ----------
        table : Path
        recording : str
            Its file name.
        requests : sequence of sequence of (row or None, row or None)
            The edits of each request, the old row and the new one. A request is carried out whole or not at all.

        Returns
        -------
        list
            For each request the new rows as they were written, or why it was not carried out.
        table
            As `read` returns it.
        """
        unit_us = self._opening.unit_us(table)

        def note(row: _LabelRow | None) -> Note | None:
            return None if row is None else _to_note(row, unit_us)

        edits = [[Edit(note(old), note(new)) for old, new in request] for request in requests]
        with reasons():
            outcomes, read = self._labels.change(table, _own_names(recording), edits)
        written: list[str | list[_LabelRow | None]] = [
            one if isinstance(one, str) else [None if note is None else _to_row(note, unit_us) for note in one]
            for one in outcomes
        ]
        return written, self._shown(table, read)

    def settle(self, table: Path, recording: str, conflict: _LabelConflict, restore: bool) -> _LabelTable:
        """End a conflict: restore what was acknowledged, or accept the table as it is."""
        unit_us = self._opening.unit_us(table)
        seen = Conflict(*(tuple(_to_note(row, unit_us) for row in rows) for rows in conflict))
        with reasons():
            return self._shown(table, self._labels.settle(table, _own_names(recording), seen, restore=restore))

    def _shown(self, table: Path, read: TableRead) -> _LabelTable:
        unit_us = self._opening.unit_us(table)
        conflict = read.conflict
        rows, *others = (
            [_to_row(note, unit_us) for note in notes]
            for notes in (read.rows, conflict.missing, conflict.returned, conflict.new)
        )
        return sorted(rows, key=lambda row: row[1]), (others[0], others[1], others[2])
