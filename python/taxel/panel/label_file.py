"""A table of labels that several windows and other programs write: each change is made on the table as it is now."""

from __future__ import annotations

import contextlib
import errno
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, TypeAlias

from filelock import FileLock, Timeout

from taxel._base.documents import decoded
from taxel._base.files import write_whole
from taxel._base.header_table import lines_of, separator_of
from taxel._base.table_text import marked
from taxel._core import FormatError, ProblemError
from taxel.labels import Note, by_clock, is_from_beginning, rows_of, text_with

#: The lock of all tables of a folder.
LOCK = ".taxel-labels.lock"

#: How long the lock is waited for, and a table that other programs write without a pause, s.
_LOCKED_S, _WRITTEN_S = 20.0, 5.0

#: Replace the first row by the second; without the first mark the second, without the second delete the first.
Edit: TypeAlias = tuple[Note | None, Note | None]

#: A row in the view, and as it is in the file; None for one that was changed.
_Row: TypeAlias = tuple[Note, Note | None]

#: Time of the last change, ns, and size of a table.
_State: TypeAlias = tuple[int, int] | None


class _Changed(Exception):  # noqa: N818  no error
    """Another program has written the table since it was read."""


class LabelFile:
    """A table of labels; its rows have the times of the view of the recording.

    A change is acknowledged when the table was renamed into place under the lock of its folder: of the windows and
    servers that change tables here, none loses a change of another. A program that saves an older table wins.

    Parameters
    ----------
    table : path
        It need not exist. A link to a file stays one: that file is written. What is no regular file, such as a pipe,
        which would be waited for, and a link that leads nowhere are refused.
    names : set of str
        The names that the table may have for the recording; its rows are given without one.
    begin_us : int, us
        The first time of the recording in the view.
    unit_us : float, us
        How long one us of the table is in the view: above 1 where frames are numbered.
    """

    def __init__(self, table: Path, names: frozenset[str], begin_us: int = 0, unit_us: float = 1.0) -> None:
        self._named, self.path = table, Path(os.path.realpath(table))
        self._names, self._begin_us, self._unit_us = names, begin_us, unit_us
        #: The rows as they were read or written last, and what the file was then.
        self.rows: tuple[Note, ...] = ()
        self.state: _State = None

    def state_now(self) -> _State:
        """Return what changes with the table; None where there is none."""
        try:
            about = self.path.stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size

    def read(self) -> tuple[Note, ...]:
        """Return the rows, also those without a label, in the order of time.

        Raises
        ------
        FormatError : no table of labels (names the line)
        OSError : it cannot be read
        """
        self.state, text = self.state_now(), self._text() or b""
        rows, _ = rows_of(self.path, lines_of(decoded(self.path, text, marked(self.path, text))))
        self.rows = _in_order(map(self._in_view, rows))
        return self.rows

    def change(self, edits: Sequence[Edit]) -> tuple[tuple[Edit, ...], tuple[Note, ...]]:
        """Carry out edits in the table as it is now, all or none; return what takes them back, and the rows.

        A row that is there already is not marked again: what takes that back is empty.

        Raises
        ------
        ProblemError : a row that is replaced or deleted is no longer there; it is no table of labels or cannot be
            written, or another program holds the lock
        """
        lock = self.path.with_name(LOCK)
        try:
            with FileLock(lock, timeout=_LOCKED_S, poll_interval=0.01):
                until = time.monotonic() + _WRITTEN_S
                try:
                    while True:
                        try:
                            inverse, self.rows = self._try_to_change(edits)
                            self.state = self.state_now()
                            return inverse, self.rows
                        except _Changed:
                            if time.monotonic() > until:
                                reason = "other programs write it"
                                raise ProblemError(f"{self.path.name} cannot be saved: {reason}") from None
                        time.sleep(0.01)
                finally:
                    # Who waits for it sees that it has gone; Windows, which removes no open file, does so when it ends.
                    with contextlib.suppress(OSError):
                        lock.unlink()
        except Timeout:
            raise ProblemError(f"{lock}: another program holds this lock; nothing was saved") from None
        except OSError as error:
            reason = (error.strerror or str(error)).removeprefix("is ").lower()
            raise ProblemError(f"{self.path.name} cannot be saved: {reason}") from error

    def _try_to_change(self, edits: Sequence[Edit]) -> tuple[tuple[Edit, ...], tuple[Note, ...]]:
        text = self._text()
        try:
            mark, encoding = marked(self.path, text or b"")
            lines = lines_of(decoded(self.path, text or b"", (mark, encoding)))
            found, columns = rows_of(self.path, lines)
        except FormatError as error:
            self._check_unchanged(text)
            again = ProblemError(f"{error.args[0]}; nothing was saved: correct the table, then try again")
            again.place = error.place
            raise again from None
        counts_from_beginning = any(is_from_beginning(row.t or 0, self._begin_us) for row in found)
        rows = _Rows(zip(map(self._in_view, found), found, strict=True))
        inverse = rows.carry_out(edits)
        if inverse:
            end = next((end for end in ("\r\n", "\r") if lines and lines[0].endswith(end)), "\n")
            separator = separator_of(next((line for line in lines if line.strip()), ""))
            in_file = rows.in_file(lambda row: self._in_file(row, counts_from_beginning))
            written = text_with(in_file, columns, end, separator)
            try:
                new = mark + written.encode(encoding)
            except UnicodeEncodeError:
                # Windows-1252 has few letters.
                new = written.encode()

            def write(file: BinaryIO) -> None:
                file.write(new)
                # As late as can be: what another program writes between this and the rename is lost.
                self._check_unchanged(text)

            write_whole(self.path, write, overwrite=True)
        return inverse, _in_order(rows.shown())

    def _text(self) -> bytes | None:
        """Return the text of the table; None where there is none."""
        if os.path.lexists(self._named) and not self.path.is_file():
            raise OSError(errno.EINVAL, "is no regular file", str(self._named))
        try:
            return self.path.read_bytes()
        except FileNotFoundError:
            return None

    def _check_unchanged(self, text: bytes | None) -> None:
        if self._text() != text:
            raise _Changed

    def _in_view(self, row: Note) -> Note:
        shown = by_clock(_times_by(row, lambda t: round(t * self._unit_us)), self._begin_us)
        return replace(shown, recording="" if row.recording in self._names else row.recording)

    def _in_file(self, row: Note, counts_from_beginning: bool) -> Note:
        begin_us = self._begin_us if counts_from_beginning else 0
        return _times_by(row, lambda t: round((t - begin_us) / self._unit_us))


def _times_by(row: Note, convert: Callable[[int], int]) -> Note:
    return replace(row, t=convert(row.t or 0), replaces=None if row.replaces is None else convert(row.replaces))


class _Rows:
    """Hold the rows of a table while edits are carried out: in the view, with those that the file has."""

    def __init__(self, rows: Iterable[tuple[Note, Note]]) -> None:
        self._of: dict[tuple[object, ...], list[_Row]] = {}
        for shown, in_file in rows:
            self._add(shown, in_file)

    def shown(self) -> Iterator[Note]:
        """Return the rows in the view."""
        return (shown for rows in self._of.values() for shown, _ in rows)

    def in_file(self, convert: Callable[[Note], Note]) -> list[Note]:
        """Return the rows for the file; those that were not changed stay as they are."""
        rows = (row for rows in self._of.values() for row in rows)
        return [convert(shown) if in_file is None else in_file for shown, in_file in rows]

    def carry_out(self, edits: Sequence[Edit]) -> tuple[Edit, ...]:
        """Carry out edits; return what takes them back, nothing where they changed nothing."""
        gone: list[_Row] = []
        added: list[Note] = []
        for old, wanted in edits:
            if old is not None and not self._of.get(_key(old)):
                raise ProblemError(
                    f"{old.text} at {old.t} us is no longer in the table: another window or program changed it"
                )
            if old is not None:
                gone.append(self._take(old))
            elif wanted is not None and wanted.replaces is not None:
                # A label for a note that counted no more.
                removal = replace(wanted, text="")
                while self._of.get(_key(removal)):
                    gone.append(self._take(removal))
            new = wanted if wanted is None or old is None else replace(wanted, others=gone[-1][0].others)
            stays = old is not None and new is not None and _key(new) == _key(old)
            # A label that is moved or renamed onto an equal one is one with it.
            if new is not None and (stays or not self._of.get(_key(new))):
                self._add(new, None)
                added.append(new)
        removed, made = Counter(row for row, _ in gone), Counter(added)
        undone, restored = (made - removed).elements(), (removed - made).elements()
        return (*((row, None) for row in undone), *((None, row) for row in restored))

    def _add(self, shown: Note, in_file: Note | None) -> None:
        self._of.setdefault(_key(shown), []).append((shown, in_file))

    def _take(self, row: Note) -> _Row:
        return self._of[_key(row)].pop(0)


def _key(row: Note) -> tuple[object, ...]:
    """Return what makes a row another one: where it has no label, it removes a note, whatever its own time."""
    return row.text, row.t if row.text else None, row.source, row.recording, row.replaces


def _in_order(rows: Iterable[Note]) -> tuple[Note, ...]:
    return tuple(sorted(rows, key=lambda row: row.t or 0))
