"""The labels of recordings, in tables beside them: read, changed by the page, and followed."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from taxel.labels import Note
from taxel.panel.folder import Folder, Shown
from taxel.panel.label_file import Edit, LabelFile
from taxel.panel.shown_files import Opening
from taxel.panel.threads import in_thread


@dataclass
class _Table:
    """Hold the rows of a table as they were read, and what changed with the file then."""

    rows: tuple[Note, ...]
    stamp: tuple[int, int] | None
    us: int
    begin_us: int


class LabelTables:
    """Hold the labels of the recordings that clients have opened, by the recordings' names.

    Parameters
    ----------
    folder : Folder
    opening : Opening
        How recordings are opened.
    tables : str
        The end of the names of the tables: "notes" for NAME.notes.csv.
    """

    def __init__(self, folder: Folder, opening: Opening, tables: str = "notes") -> None:
        self._folder, self._opening, self._ending = folder, opening, f".{tables}.csv"
        self._tables: dict[str, _Table] = {}
        self._lock = asyncio.Lock()

    def count(self, name: str) -> int | None:
        """Return the number of labels of a recording, once they have been read."""
        table = self._tables.get(name)
        return None if table is None or table.stamp is None else sum(bool(row.text) for row in table.rows)

    def message(self, name: str) -> dict[str, Any]:
        """Return the labels of a recording, sent to the clients that show it when they have changed."""
        table = self._tables.get(name)
        return {
            "type": "labels",
            "name": name,
            "path": self._file_of(name),
            "labels": [_shown(row) for row in (table.rows if table is not None else ()) if row.text],
        }

    async def read(self, shown: Shown) -> bool:
        """Read the table of a recording that is shown; return whether others have an older one."""
        name = shown.name
        async with self._lock:
            known = self._tables.get(name)
            table = _Table((), self._stamp(name), shown.us, shown.begin_us)
            # Also where it cannot be read now: it is read again when it has changed.
            self._tables[name] = table
            table.rows = await in_thread(self._file(name, table).read)
            return known is not None and known.rows != table.rows

    async def changed(self) -> list[str]:
        """Read the tables again that have changed; return the recordings whose labels are others now."""
        names = []
        for name, table in list(self._tables.items()):
            async with self._lock:
                stamp = self._stamp(name)
                if table.stamp == stamp or self._tables.get(name) is not table:
                    continue
                before, table.stamp = table.rows, stamp
                table.rows = await in_thread(self._file(name, table).read)
                if before != table.rows:
                    names.append(name)
        return names

    async def change(self, name: str, shown: Shown | None, edits: Sequence[Edit]) -> tuple[Edit, ...]:
        """Carry out edits in the table as it is now, all or none; return what takes them back.

        Raises
        ------
        ProblemError : a row is no longer in the table; a time outside the recording; the table cannot be saved
        """
        async with self._lock:
            table = self._tables.get(name)
            if table is None:
                us, begin_us = (1, 0) if shown is None else (shown.us, shown.begin_us)
                table = _Table((), None, us, begin_us)
            return await self._write(name, table, [self._exact(edit, table, shown) for edit in edits])

    async def take_back(self, name: str, inverse: Sequence[Edit]) -> None:
        """Take edits back, all or none.

        Raises
        ------
        ProblemError : another window or program has changed such a row since; the table cannot be saved
        """
        async with self._lock:
            await self._write(name, self._tables[name], inverse)

    async def _write(self, name: str, table: _Table, edits: Sequence[Edit]) -> tuple[Edit, ...]:
        inverse, table.rows = await in_thread(self._file(name, table).change, edits)
        table.stamp = self._stamp(name)
        self._tables[name] = table
        return inverse

    def _exact(self, edit: Edit, table: _Table, shown: Shown | None) -> Edit:
        """Return an edit with what the page does not know of its rows."""
        old, new = edit
        if old is not None:
            known = next((row for row in table.rows if _shown(row) == _shown(old)), old)
            if new is None and old.replaces is not None:
                # Without the row that replaces it, its note would count again.
                new = replace(old, text="")
            if new is not None:
                new = replace(new, at_ns=known.at_ns if new.t == old.t else 0)
        if new is not None and new.text and (old is None or new.t != old.t):
            assert new.t is not None
            new = replace(new, t=new.t // table.us * table.us)
            if shown is not None:
                shown.check_label(new.t or 0)
        return old, new

    def _file(self, name: str, table: _Table) -> LabelFile:
        path = self._folder.file(self._file_of(name))
        names = frozenset({"", name, Path(name).stem})
        return LabelFile(path, names, table.begin_us, table.us * self._opening.unit_us(path))

    def _file_of(self, recording: str) -> str:
        """Return the name of the file that holds the labels of a recording."""
        return (recording.rpartition(".")[0] or recording) + self._ending

    def _stamp(self, name: str) -> tuple[int, int] | None:
        """Return what changes with a table; None where there is none."""
        try:
            about = self._folder.file(self._file_of(name)).stat()
        except OSError:
            return None
        return about.st_mtime_ns, about.st_size


def _shown(row: Note) -> dict[str, Any]:
    """Return a row as the page has it."""
    return {
        "label": row.text,
        "t_us": row.t,
        "source": row.source,
        "trial": row.recording,
        "replaces_us": row.replaces,
    }
