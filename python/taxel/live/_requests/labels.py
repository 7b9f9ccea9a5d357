"""Requests about the tables of labels beside recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from taxel.labels import Note
from taxel.live._label_join import Conflict, Edit
from taxel.live._label_table import LabelTables, TableRead
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening

#: The fields of a `Note` but `others`, with times in us of the view.
_Fields = Mapping[str, Any]


def _own_names(recording: str) -> frozenset[str]:
    """Return the names that a table beside a recording may have for it: none, its file name, and its stem."""
    return frozenset({"", recording, Path(recording).stem})


def _in_file(fields: _Fields, unit_us: float) -> Note:
    note = Note(**fields)
    replaced = None if note.replaces is None else round(note.replaces / unit_us)
    return replace(note, text=note.text.strip(), t=round((note.t or 0) / unit_us), replaces=replaced)


def _in_view(note: Note, unit_us: float) -> Note:
    replaced = None if note.replaces is None else round(note.replaces * unit_us)
    return replace(note, t=round((note.t or 0) * unit_us), replaces=replaced)


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

    def read(self, table: Path, recording: str, us: int) -> TableRead:
        """Return the labels of a recording from a table, and where the table lacks what was acknowledged."""
        with reasons():
            return self._to_view(table, us, self._labels.read(table, _own_names(recording)))

    def change(
        self,
        table: Path,
        recording: str,
        us: int,
        requests: Sequence[Sequence[tuple[_Fields | None, _Fields | None]]],
    ) -> tuple[list[str | list[Note | None]], TableRead]:
        """Carry out requests in one write of a table as it is now, and return when it is on the disk.

        Parameters
        ----------
        table : Path
        recording : str
            Its file name.
        us : int
            One us of the file in the view: above 1 where frames are numbered.
        requests : sequence of sequence of (fields or None, fields or None)
            The edits of each request, the old note and the new one. A request is carried out whole or not at all.

        Returns
        -------
        list
            For each request the new notes as they were written, or why it was not carried out.
        table
            As `read` returns it.
        """
        unit_us = self._unit_us(table, us)

        def note(fields: _Fields | None) -> Note | None:
            return None if fields is None else _in_file(fields, unit_us)

        edits = [[Edit(note(old), note(new)) for old, new in request] for request in requests]
        with reasons():
            outcomes, read = self._labels.change(table, _own_names(recording), edits)
        written: list[str | list[Note | None]] = [
            outcome
            if isinstance(outcome, str)
            else [None if note is None else _in_view(note, unit_us) for note in outcome]
            for outcome in outcomes
        ]
        return written, self._to_view(table, us, read)

    def settle(self, table: Path, recording: str, us: int, conflict: Mapping[str, Any], restore: bool) -> TableRead:
        """End a conflict: restore what was acknowledged, or accept the table as it is."""
        unit_us = self._unit_us(table, us)
        seen = Conflict(**{kind: tuple(_in_file(note, unit_us) for note in notes) for kind, notes in conflict.items()})
        with reasons():
            return self._to_view(table, us, self._labels.settle(table, _own_names(recording), seen, restore=restore))

    def undo(self, table: Path, recording: str, us: int, change: int) -> TableRead:
        """Take back a change by its number, in `changes` of the table that it was written in."""
        with reasons():
            return self._to_view(table, us, self._labels.undo(table, _own_names(recording), change))

    def _unit_us(self, table: Path, us: int) -> float:
        """Return how long one us of a table is in the view."""
        return us * self._opening.unit_us(table)

    def _to_view(self, table: Path, us: int, read: TableRead) -> TableRead:
        unit_us = self._unit_us(table, us)

        def in_view(notes: tuple[Note, ...]) -> tuple[Note, ...]:
            return tuple(_in_view(note, unit_us) for note in notes)

        conflict = Conflict(*map(in_view, (read.conflict.missing, read.conflict.returned, read.conflict.new)))
        return TableRead(tuple(sorted(in_view(read.rows), key=lambda note: note.t or 0)), conflict, read.changes)
