"""The join of a table of labels: what taxel acknowledged of it, the table as it is, and what changes.

A row is its label, time, source, recording and what it replaces, with its count. Any program may write the table. What
taxel acknowledged and another program's text lacks is a conflict, until a person settles it. Deletions by taxel are in
the acknowledged state too, so that the windows of several servers tell them from an older text.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from taxel._core import ProblemError
from taxel.labels import Note

#: Deletions that are remembered, the newest: a label moved by keys leaves one at every step, which was in the table.
_MOST_DELETED = 100_000

#: Label, time, source, recording, and the time of the note that it replaces.
_Key = tuple[str, int | None, str, str, int | None]


@dataclass(frozen=True)
class Edit:
    """Replace `old` by `new`; without `old` mark it, without `new` delete `old`."""

    old: Note | None
    new: Note | None


@dataclass(frozen=True)
class Acknowledged:
    """Hold what taxel's windows have acknowledged of a table.

    Parameters
    ----------
    labels : tuple of Note
        The rows that they set.
    deleted : tuple of Note
        Those that they deleted, moved or renamed, oldest first.
    table : tuple of Note or None
        The rows that taxel wrote last, or read before its first write.
    """

    labels: tuple[Note, ...] = ()
    deleted: tuple[Note, ...] = ()
    table: tuple[Note, ...] | None = None


@dataclass(frozen=True)
class Conflict:
    """Hold where a table lacks what was acknowledged.

    Parameters
    ----------
    missing : tuple of Note
        Acknowledged, and not in the table.
    returned : tuple of Note
        Deleted, moved or renamed by taxel, and in the table again.
    new : tuple of Note
        Other rows that another program has added since; they are in no conflict themselves.
    """

    missing: tuple[Note, ...] = ()
    returned: tuple[Note, ...] = ()
    new: tuple[Note, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.missing or self.returned)


@dataclass(frozen=True)
class Joined:
    """Hold the result of `join`.

    Parameters
    ----------
    rows : tuple of Note
        The rows of the table.
    acknowledged : Acknowledged
    outcomes : tuple of (tuple of Note or None) or str
        For each request its rows as they are in the table, one an edit, or why nothing of it was carried out.
    inverses : tuple of tuple of Edit
        For each request what takes it back; nothing where it changed nothing.
    """

    rows: tuple[Note, ...]
    acknowledged: Acknowledged
    outcomes: tuple[tuple[Note | None, ...] | str, ...] = ()
    inverses: tuple[tuple[Edit, ...], ...] = ()


def _key(note: Note) -> _Key:
    return note.text, note.t, note.source, note.recording, note.replaces


def minus(rows: Iterable[Note], others: Iterable[Note]) -> tuple[Note, ...]:
    """Return the rows that are left when each of `others` takes one away."""
    count = Counter(map(_key, others))
    left = []
    for row in rows:
        key = _key(row)
        if count[key]:
            count[key] -= 1
        else:
            left.append(row)
    return tuple(left)


def _inverse(gone: Sequence[Note], added: Sequence[Note]) -> tuple[Edit, ...]:
    """Return the edits that take a change back, of which these rows are gone and those were added."""
    # Rows that differ in nothing but columns that taxel does not know are different ones here.
    deleted, marked = Counter(added) - Counter(gone), Counter(gone) - Counter(added)
    return (*(Edit(row, None) for row in deleted.elements()), *(Edit(None, row) for row in marked.elements()))


def _common(rows: Sequence[Note], others: Iterable[Note]) -> tuple[Note, ...]:
    """Return the rows that `others` has too, as often."""
    return minus(rows, minus(rows, others))


def conflict_of(known: Acknowledged, rows: Sequence[Note]) -> Conflict:
    """Return where a table lacks what was acknowledged."""
    missing = minus(known.labels, rows)
    added = () if known.table is None else minus(rows, known.table)
    deleted = set(map(_key, known.deleted))
    # One of several equal rows may be deleted and another acknowledged, which is missing where it is not there.
    returned = tuple(row for row in _common(added, minus(rows, known.labels)) if _key(row) in deleted)
    return Conflict(missing, returned, minus(added, returned) if missing or returned else ())


class _Rows:
    """Hold rows by what they are, with their count."""

    def __init__(self, rows: Iterable[Note]) -> None:
        self._of: dict[_Key, list[Note]] = {}
        #: The rows without a label, by source, recording and the time of the note that they remove.
        self._removals: dict[tuple[str, str, int | None], list[Note]] = {}
        for row in rows:
            self.add(row)

    def __iter__(self) -> Iterator[Note]:
        for rows in self._of.values():
            yield from rows

    def count(self, row: Note) -> int:
        return len(self._of.get(_key(row), ()))

    def add(self, row: Note) -> None:
        self._of.setdefault(_key(row), []).append(row)
        if not row.text:
            self._removals.setdefault((row.source, row.recording, row.replaces), []).append(row)

    def take(self, row: Note) -> Note | None:
        """Take one away: that with the same time by the host, if there is one."""
        rows = self._of.get(_key(row))
        if not rows:
            return None
        taken = rows.pop(next((k for k, same in enumerate(rows) if same.at_ns == row.at_ns), 0))
        if not taken.text:
            self._removals[taken.source, taken.recording, taken.replaces].remove(taken)
        return taken

    def removals_beside(self, row: Note) -> list[Note]:
        """Return the rows that remove the note which a label replaces."""
        if row.replaces is None:
            return []
        return list(self._removals.get((row.source, row.recording, row.replaces), ()))


class _State:
    """The table and what is acknowledged of it, while requests are carried out."""

    def __init__(self, rows: Iterable[Note], labels: Iterable[Note], deleted: Iterable[Note], table: Iterable[Note]):
        self.rows, self.labels, self.table = _Rows(rows), _Rows(labels), _Rows(table)
        self.deleted = {_key(row): row for row in deleted}
        #: The rows of the table that a request deleted and added.
        self.gone: list[Note] = []
        self.added: list[Note] = []

    def copy(self) -> _State:
        return _State(self.rows, self.labels, self.deleted.values(), self.table)

    def carry_out(self, edit: Edit) -> Note | None:
        """Carry out an edit; return the row as it is in the table."""
        old, new = edit.old, edit.new
        if old is None:
            assert new is not None
            for removal in self.rows.removals_beside(new):
                self._delete(removal)
            self._set(new)
            return new
        if not self.rows.count(old):
            if new is not None and self.rows.count(new):
                # The same request has been carried out before.
                self._set(new)
                return new
            raise LookupError(f"{old.text} at {old.t} is no longer in the table: another window or program changed it")
        taken = self._delete(old)
        if new is None:
            return None
        new = replace(new, others=taken.others)
        # A label that is moved or renamed onto an equal one is one with it.
        self._set(new, again=_key(new) == _key(old))
        return new

    def _set(self, row: Note, *, again: bool = False) -> None:
        """Add a row that a person set to the table and the labels, unless an equal one is there; `again`: also then."""
        self.deleted.pop(_key(row), None)
        if again or not self.rows.count(row):
            self._add(row)
        if again or not self.labels.count(row):
            self.labels.add(row)

    def _delete(self, row: Note) -> Note:
        missing = max(0, self.labels.count(row) - self.rows.count(row))
        taken = self.rows.take(row)
        assert taken is not None
        # A row that is not acknowledged goes first.
        while self.labels.count(row) > self.rows.count(row) + missing:
            self.labels.take(row)
        self.table.take(row)
        self.gone.append(taken)
        self.deleted.pop(_key(row), None)
        self.deleted[_key(row)] = row
        return taken

    def _add(self, row: Note) -> None:
        self.rows.add(row)
        self.table.add(row)
        self.added.append(row)
        self.deleted.pop(_key(row), None)


def join(base: Acknowledged, file_rows: Sequence[Note], change: Sequence[Sequence[Edit]]) -> Joined:
    """Carry out requests on a table as it is.

    Parameters
    ----------
    base : Acknowledged
        What was acknowledged before.
    file_rows : sequence of Note
        The rows of the table now.
    change : sequence of sequence of Edit
        Requests, each carried out whole or not at all.

    Returns
    -------
    Joined
        Each row of `base` that was not deleted by `change` is in `rows` or in the conflict of the result.
    """
    state = _State(file_rows, base.labels, base.deleted, file_rows if base.table is None else base.table)
    outcomes: list[tuple[Note | None, ...] | str] = []
    inverses: list[tuple[Edit, ...]] = []
    for request in change:
        state.gone, state.added = [], []
        # Only an edit of a row that must be there can fail.
        before = state.copy() if len(request) > 1 and any(edit.old for edit in request) else None
        try:
            outcomes.append(tuple([state.carry_out(edit) for edit in request]))
        except LookupError as error:
            outcomes.append(str(error))
            state = state if before is None else before
        inverses.append(_inverse(state.gone, state.added))
    rows = tuple(state.rows)
    deleted = tuple(state.deleted.values())[-_MOST_DELETED:]
    known = Acknowledged(tuple(state.labels), deleted, tuple(state.table))
    return Joined(rows, _known_after(known, rows), tuple(outcomes), tuple(inverses))


def _known_after(known: Acknowledged, rows: tuple[Note, ...]) -> Acknowledged:
    """Return what is known with the table as it is written; a conflict stays one until it is settled."""
    return known if conflict_of(known, rows) else replace(known, table=rows)


def fold(base: Acknowledged, file_rows: Sequence[Note], before: Sequence[Note], after: Sequence[Note]) -> Joined:
    """Make the changes of another program, from `before` to `after`, on a table as it is.

    Another program may still write to a table that taxel has replaced.
    """
    merged = (*minus(file_rows, minus(before, after)), *minus(after, before))
    return Joined(merged, _known_after(base, merged))


def settled(base: Acknowledged, file_rows: Sequence[Note], conflict: Conflict, *, restore: bool) -> Joined:
    """End a conflict that a person has seen, in the table as it is; other rows stay in conflict.

    Parameters
    ----------
    base : Acknowledged
    file_rows : sequence of Note
    conflict : Conflict
    restore : bool
        Whether the table gets what was acknowledged; otherwise what it lacks is acknowledged no more.

    Raises
    ------
    ProblemError : nothing is left of the conflict
    """
    now = conflict_of(base, file_rows)
    missing, returned = _common(now.missing, conflict.missing), _common(now.returned, conflict.returned)
    if conflict and not (missing or returned):
        raise ProblemError("this conflict is over: another window settled it, or the file has changed since")
    rows, known = tuple(file_rows), base
    if restore:
        rows = (*minus(rows, returned), *missing)
    else:
        kept = set(map(_key, returned))
        deleted = tuple(row for row in base.deleted if _key(row) not in kept)
        known = replace(base, labels=minus(base.labels, missing), deleted=deleted)
    inverse = _inverse(minus(file_rows, rows), minus(rows, file_rows))
    return Joined(rows, _known_after(known, rows), inverses=(inverse,))
