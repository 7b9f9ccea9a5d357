"""Requests about the tables of labels beside recordings."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from taxel._core import ProblemError
from taxel.labels import Note
from taxel.live._label_file import Edit, LabelFile, Outcome
from taxel.live._requests.reasons import reasons
from taxel.live._shown_files import Opening

#: How many changes of tables can be taken back.
_MOST_CHANGES = 1000

#: The fields of a `Note` but `others`, with times in us of the view.
_Fields = Mapping[str, Any]


@dataclass(frozen=True)
class TableRead:
    """Hold a table as it was read or written.

    Parameters
    ----------
    rows : tuple of Note
        Those of the recording itself have no name of a recording.
    changes : tuple of int or None
        The number of each request, by which `LabelRequests.undo` takes it back; None where it changed nothing.
    """

    rows: tuple[Note, ...]
    changes: tuple[int | None, ...] = ()


class LabelRequests:
    """Read and change tables of labels; methods may be called from several threads at a time.

    A recording is given by its file name, the length of a us of its file in the view, which is above 1 where frames
    are numbered, and its first time in the view, us.

    Parameters
    ----------
    opening : Opening
        How recordings are opened.
    """

    def __init__(self, opening: Opening) -> None:
        self._opening = opening
        #: What takes the newest changes back, by their numbers.
        self._inverses: dict[int, tuple[Edit, ...]] = {}
        self._numbers = itertools.count(1)

    def read(self, table: Path, recording: str, us: int, begin_us: int) -> TableRead:
        """Return the labels of a recording from a table."""
        with reasons():
            return TableRead(self._file(table, recording, us, begin_us).read())

    def change(
        self,
        table: Path,
        recording: str,
        us: int,
        begin_us: int,
        requests: Sequence[Sequence[tuple[_Fields | None, _Fields | None]]],
    ) -> tuple[list[str | list[Note | None]], TableRead]:
        """Carry out requests in one write of a table as it is now, and return when it is in its place.

        Parameters
        ----------
        table : Path
        recording, us, begin_us : str, int, int
        requests : sequence of sequence of (fields or None, fields or None)
            The edits of each request, the old note and the new one. A request is carried out whole or not at all.

        Returns
        -------
        list
            For each request the new notes as they were written, or why it was not carried out.
        table
            As it is then.
        """
        edits = [[(_note(old), _note(new)) for old, new in request] for request in requests]
        return self._change(self._file(table, recording, us, begin_us), edits)

    def undo(self, table: Path, recording: str, us: int, begin_us: int, change: int) -> TableRead:
        """Take back a change by its number, in `changes` of the table that it was written in, whole or not at all."""
        inverse = self._inverses.pop(change, None)
        if inverse is None:
            raise ProblemError("undo: this change is too long ago")
        (outcome,), read = self._change(self._file(table, recording, us, begin_us), [inverse])
        if isinstance(outcome, str):
            raise ProblemError(f"undo: {outcome}")
        return read

    def _change(
        self, file: LabelFile, requests: Sequence[Sequence[Edit]]
    ) -> tuple[list[str | list[Note | None]], TableRead]:
        with reasons():
            outcomes, rows = file.change(requests)
        changes = tuple(
            next(self._numbers) if isinstance(outcome, Outcome) and outcome.inverse else None for outcome in outcomes
        )
        for number, outcome in zip(changes, outcomes, strict=True):
            if number is not None and isinstance(outcome, Outcome):
                self._inverses[number] = outcome.inverse
        for oldest in sorted(self._inverses)[:-_MOST_CHANGES]:
            self._inverses.pop(oldest, None)
        written = [outcome if isinstance(outcome, str) else list(outcome.rows) for outcome in outcomes]
        return written, TableRead(rows, changes)

    def _file(self, table: Path, recording: str, us: int, begin_us: int) -> LabelFile:
        names = frozenset({"", recording, Path(recording).stem})
        return LabelFile(table, names, begin_us, us * self._opening.unit_us(table))


def _note(fields: _Fields | None) -> Note | None:
    return None if fields is None else Note(**{**fields, "text": fields["text"].strip()})
