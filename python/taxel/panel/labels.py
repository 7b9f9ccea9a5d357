"""The labels of recordings, in tables beside them: read, changed by the page, and followed."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from taxel.labels import Note
from taxel.panel.folder import Folder, Shown
from taxel.panel.label_file import Edit, LabelFile
from taxel.panel.shown_files import Opening
from taxel.panel.threads import in_thread


class LabelTables:
    """Hold the labels of the recordings that clients have opened, by the recordings' names.

    Parameters
    ----------
    folder : Folder
    opening : Opening
        How recordings are opened.
    """

    def __init__(self, folder: Folder, opening: Opening) -> None:
        self._folder, self._opening, self._ending = folder, opening, f".{opening.labels}.csv"
        self._files: dict[str, LabelFile] = {}
        self._lock = asyncio.Lock()

    def count(self, name: str) -> int | None:
        """Return the number of labels of a recording, once they have been read."""
        file = self._files.get(name)
        return None if file is None or file.state is None else sum(bool(row.text) for row in file.rows)

    def message(self, name: str) -> dict[str, Any]:
        """Return the labels of a recording, sent to the clients that show it when they have changed."""
        file = self._files.get(name)
        return {
            "type": "labels",
            "name": name,
            "path": self._file_of(name),
            "labels": [_shown(row) for row in (() if file is None else file.rows) if row.text],
        }

    async def read(self, shown: Shown) -> bool:
        """Read the table of a recording that is shown; return whether others have an older one."""
        async with self._lock:
            known = self._files.get(shown.name)
            # Also where it cannot be read now: it is read again when it has changed.
            file = self._files[shown.name] = self._file(shown.name, shown)
            await in_thread(file.read)
            return known is not None and known.rows != file.rows

    async def changed(self) -> list[str]:
        """Read the tables again that have changed; return the recordings whose labels are others now."""
        names = []
        for name, file in list(self._files.items()):
            async with self._lock:
                if file.state == file.state_now() or self._files.get(name) is not file:
                    continue
                before = file.rows
                await in_thread(file.read)
                if before != file.rows:
                    names.append(name)
        return names

    async def change(self, name: str, shown: Shown | None, edits: Sequence[Edit]) -> tuple[Edit, ...]:
        """Carry out edits in the table as it is now, all or none; return what takes them back.

        Raises
        ------
        ProblemError : a row is no longer in the table; a time outside the recording; the table cannot be saved
        """
        async with self._lock:
            file = self._files.get(name) or self._file(name, shown)
            inverse, _ = await in_thread(file.change, [_exact(edit, file.rows, shown) for edit in edits])
            self._files[name] = file
            return inverse

    async def take_back(self, name: str, inverse: Sequence[Edit]) -> None:
        """Take edits back, all or none.

        Raises
        ------
        ProblemError : another window or program has changed such a row since; the table cannot be saved
        """
        async with self._lock:
            await in_thread(self._files[name].change, inverse)

    def _file(self, name: str, shown: Shown | None) -> LabelFile:
        path = self._folder.file(self._file_of(name))
        us, begin_us = (1, 0) if shown is None else (shown.us, shown.begin_us)
        return LabelFile(path, frozenset({"", name, Path(name).stem}), begin_us, us * self._opening.unit_us(path))

    def _file_of(self, recording: str) -> str:
        """Return the name of the file that holds the labels of a recording."""
        return (recording.rpartition(".")[0] or recording) + self._ending


def _exact(edit: Edit, rows: Sequence[Note], shown: Shown | None) -> Edit:
    """Return an edit with what the page does not know of its rows."""
    old, new = edit
    if old is not None:
        known = next((row for row in rows if _shown(row) == _shown(old)), old)
        if new is None and old.replaces is not None:
            # Without the row that replaces it, its note would count again.
            new = replace(old, text="")
        if new is not None:
            new = replace(new, at_ns=known.at_ns if new.t == old.t else 0)
    if shown is not None and new is not None and new.text and (old is None or new.t != old.t):
        new = replace(new, t=(new.t or 0) // shown.us * shown.us)
        shown.check_label(new.t or 0)
    return old, new


def _shown(row: Note) -> dict[str, Any]:
    """Return a row as the page has it."""
    return {
        "label": row.text,
        "t_us": row.t,
        "source": row.source,
        "trial": row.recording,
        "replaces_us": row.replaces,
    }
